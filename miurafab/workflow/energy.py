"""``miurafab energy`` as a function: energy on the way to flat, or force against extension."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from miurafab.errors import InputError, OptionError, PatternError
from miurafab.files import AnyPath
from miurafab.options import read_options
from miurafab.options.documented import described
from miurafab.options.verbs import verb
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.cut_open import cut_open
from miurafab.origami.unfold import FLAT_ANGLE
from miurafab.profiles import Material, read_material
from miurafab.workflow.energy_options import CYCLES, STRAIN, EnergyOptions
from miurafab.workflow.patterns import (
    PatternLike,
    as_pattern,
    consistent_pattern,
    movable_pattern,
)

# What solves is imported when the pattern is read: loading it takes longer than the reading.
if TYPE_CHECKING:
    from miurafab.origami.energy.bar_hinge import Paper
    from miurafab.origami.energy.curve import EnergyCurve
    from miurafab.origami.energy.path import Progress
    from miurafab.origami.energy.pieces import PieceEnergies
    from miurafab.origami.energy.pull import PullCurve

STEPS_FROM_FLAT = 20
"""The steps of the motion that finds the folded form of a pattern without one."""


@verb
def energy(
    pattern: PatternLike,
    steps: int | None = None,
    *,
    material: Material | AnyPath | None = None,
    on_progress: Progress | None = None,
    **options: Any,
) -> EnergyCurve | PieceEnergies | PullCurve:
    """Compute the energy of a pattern on the way from its folded form to flat, or with ``pull`` the
    force against extension.

    Parameters
    ----------
    pattern : CreasePattern, FitResult, str or os.PathLike
        The pattern, or a file that :func:`load` reads. Without a folded form, the last shape of its
        motion from flat is taken, if its facets stay flat on the way.
    material : Material, str or os.PathLike, optional
        A profile with a modulus, its shipped name or its TOML file: energies are then in joules.
        Without it their unit is k_f times the mean edge. A force needs a material, by default the
        usual one.
    on_progress : callable, optional
        Called with a fraction in 0..1 and a short text.
    {options}

    Returns
    -------
    EnergyCurve, PieceEnergies or PullCurve
        With barrier and stable states; ``.plot()`` draws it, ``.save("x.png")`` writes it. A
        pattern of several pieces has a curve for each, since each piece folds by itself.
        With ``pull``, the force over the extension in newtons, with its cycles.

    Raises
    ------
    InputError
        For a material without a modulus, and with ``pull`` for one without the stiffness of its
        creases.
    PatternError
        For a pattern without a folded form whose facets bend on the way from flat.
    OptionError
        For a name that is no option, and for a value that cannot be taken.

    Examples
    --------
    >>> import miurafab as mf
    >>> sheet = mf.fit("plane", facets=(4, 4), size=80)
    >>> mf.energy(sheet, steps=5).rigid
    True
    >>> pulled = mf.energy(sheet, pull="corners", strain=0.1, cycles=2, material="paper-100")
    >>> pulled.converged, len(pulled.report()["cycles"])
    (True, 2)

    Source
    ------
    E. T. Filipov et al., "Bar and hinge models for scalable analysis of origami", International
    Journal of Solids and Structures 124 (2017), for the stiffness of facets and creases.
    """
    asked = read_options(EnergyOptions, options | {"steps": steps})
    _check(asked)
    found = _with_folded_form(pattern)
    if asked.pull is not None:
        return _pulled(found, asked, read_material(material), on_progress)
    paper = None if material is None else _paper(read_material(material))

    from miurafab.origami.energy.bar_hinge import sheet_model
    from miurafab.origami.energy.curve import energy_curve
    from miurafab.origami.energy.pieces import energies_of_pieces

    if found.pieces_count > 1:
        return energies_of_pieces(
            found,
            asked.steps,
            crease=asked.crease,
            paper=paper,
            crease_ratio=asked.crease_ratio,
            on_progress=on_progress,
        )
    model = sheet_model(found, paper=paper, crease_ratio=asked.crease_ratio)
    return energy_curve(
        found, asked.steps, crease=asked.crease, model=model, on_progress=on_progress
    )


def _with_folded_form(pattern: PatternLike) -> CreasePattern:
    """The pattern opened along its cuts, with the last shape of its motion from flat where it has
    no folded form.
    """
    found = as_pattern(pattern)
    if found.folded_coords is not None:
        return cut_open(consistent_pattern(pattern))
    found = movable_pattern(pattern)

    from miurafab.origami.folding.motion import find_motion

    motion = find_motion(found, STEPS_FROM_FLAT).motion
    if not motion.is_rigid:
        raise PatternError(
            "The pattern has no folded form, and on its way from flat its facets bend: energy is "
            "measured from a form in which they are flat. Give a file that holds that form."
        )
    last = int(np.flatnonzero(np.isfinite(motion.states))[-1])
    angles = motion.fold_angles[last]
    letters = motion.pattern.edges_assignment
    free = np.isin(letters, ("M", "V", "F", "U"))
    lettered = np.where(angles > FLAT_ANGLE, "V", np.where(angles < -FLAT_ANGLE, "M", "F"))
    inner = (motion.pattern.edges_faces >= 0).all(axis=1)
    return replace(
        motion.pattern,
        folded_coords=motion.frames[last],
        edges_fold_angle=np.where(inner, angles, 0.0),
        edges_assignment=np.where(inner & free, lettered, letters),
    )


def _check(asked: EnergyOptions) -> None:
    if asked.pull is None:
        for name, value in (("strain", asked.strain), ("cycles", asked.cycles)):
            if value is not None:
                raise OptionError(name, "is for a sheet that is pulled; add a `pull`")
        return
    if asked.strain == 0:
        raise OptionError("strain", "is 0, which pulls nothing")
    if asked.crease is not None:
        raise OptionError("crease", "is driven on the way to flat; leave it out with `pull`")
    if asked.crease_ratio:
        raise OptionError(
            "crease_ratio", "does not go with `pull`, which takes its creases from the material"
        )


def _pulled(
    pattern: CreasePattern,
    asked: EnergyOptions,
    stock: Material,
    on_progress: Progress | None,
) -> PullCurve:
    if stock.folding is None:
        raise InputError(
            f"The material '{stock.name}' does not say how stiff its creases are; add a table "
            '[folding] with a line such as crease_length = "50mm" to its file (docs/forces.md says '
            "how to measure it)."
        )
    from miurafab.origami.energy.pull import pull
    from miurafab.workflow.uncut import uncut_shares

    folding = stock.folding
    paper = replace(
        _paper(stock),
        crease_length_mm=folding.crease_length_mm,
        yield_angle=math.inf if folding.yield_angle is None else folding.yield_angle,
        hardening=folding.hardening,
    )
    return pull(
        pattern,
        paper,
        None if isinstance(asked.pull, str) else asked.pull,
        strain=STRAIN if asked.strain is None else asked.strain,
        cycles=CYCLES if asked.cycles is None else asked.cycles,
        steps=asked.steps,
        uncut=uncut_shares(pattern, stock),
        on_progress=on_progress,
    )


def _paper(stock: Material) -> Paper:
    if stock.modulus_pa is None:
        raise InputError(
            f"The material '{stock.name}' gives no modulus; add a line such as "
            'modulus = "3GPa" to its file, or leave `material` out.'
        )
    from miurafab.origami.energy.bar_hinge import Paper

    return Paper(stock.thickness_mm, stock.modulus_pa)


described(energy, EnergyOptions)
