"""``miurafab energy`` as a function: the energy of a pattern in a material."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from miurafab.errors import InputError
from miurafab.files import AnyPath
from miurafab.options import Whole, number, option, read_options
from miurafab.options.documented import described
from miurafab.options.verbs import verb
from miurafab.origami.energy.bar_hinge import Paper, sheet_model
from miurafab.origami.energy.curve import EnergyCurve, energy_curve
from miurafab.origami.energy.path import Progress
from miurafab.origami.energy.pieces import PieceEnergies, energies_of_pieces
from miurafab.profiles import Material, read_material
from miurafab.workflow.patterns import PatternLike, consistent_pattern


@dataclass(frozen=True)
class EnergyOptions:
    """The options of an energy curve beside its pattern and its material."""

    steps: int = option(Whole(1, 100_000), "Steps from the folded form to flat.", default=40)
    crease: int | None = option(
        Whole(),
        "The edge whose fold angle is driven.",
        default_text="a crease in the middle",
    )
    crease_ratio: float = option(
        number(0), "Stiffness of the creases over that of the facets.", default=0.0
    )


@verb
def energy(
    pattern: PatternLike,
    steps: int | None = None,
    *,
    material: Material | AnyPath | None = None,
    on_progress: Progress | None = None,
    **options: Any,
) -> EnergyCurve | PieceEnergies:
    """Compute the energy of a pattern on the way from its folded form to flat.

    Parameters
    ----------
    pattern : CreasePattern, FitResult, str or os.PathLike
        The pattern, or a file that :func:`load` reads. It needs a folded form.
    material : Material, str or os.PathLike, optional
        A profile with a modulus, its shipped name or its TOML file: energies are then in joules.
        Without it their unit is k_f times the mean edge.
    on_progress : callable, optional
        Called with a fraction in 0..1 and a short text.
    {options}

    Returns
    -------
    EnergyCurve or PieceEnergies
        With barrier and stable states; ``.plot()`` draws it, ``.save("x.png")`` writes it. A
        pattern of several pieces has a curve for each, since each piece folds by itself.

    Raises
    ------
    InputError
        For a material without a modulus.
    PatternError
        For a pattern without a folded form.
    OptionError
        For a name that is no option, and for a value that cannot be taken.

    Examples
    --------
    >>> import miurafab as mf
    >>> mf.energy(mf.fit("plane", facets=(4, 4)), steps=5).rigid
    True
    """
    asked = read_options(EnergyOptions, options | {"steps": steps})
    found = consistent_pattern(pattern)
    paper = None
    if material is not None:
        stock = read_material(material)
        if stock.modulus_pa is None:
            raise InputError(
                f"The material '{stock.name}' gives no modulus; add a line such as "
                'modulus = "3GPa" to its file, or leave `material` out.'
            )
        paper = Paper(stock.thickness_mm, stock.modulus_pa)
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


described(energy, EnergyOptions)
