"""``miurafab fit`` as a function: from a target, in any form, to a sheet that folds onto it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

from miurafab.errors import OptionError
from miurafab.files import AnyPath
from miurafab.findings import Finding
from miurafab.options import declared, read_options
from miurafab.options.documented import described
from miurafab.options.verbs import verb
from miurafab.origami.fitting.fit import fit as fit_request
from miurafab.origami.fitting.request import BED, FitOptions, FitRequest
from miurafab.origami.fitting.result import FitResult
from miurafab.origami.judge_pattern import judge_quality
from miurafab.origami.verify import Measurements
from miurafab.profiles import MachineProfile, Material
from miurafab.workflow.bed_options import BedOptions
from miurafab.workflow.bed_size import fit_to_bed
from miurafab.workflow.design import design


@verb
def fit(
    target: object,
    /,
    *,
    machine: MachineProfile | AnyPath | None = None,
    material: Material | AnyPath | None = None,
    on_progress: Callable[[float, str], None] | None = None,
    **options: Any,
) -> FitResult:
    """Fit a generalized Miura-ori to a target surface.

    Lengths are in mm and angles in degrees; text with a unit is taken too (``size="10in"``). The
    names of options and the parameters of a surface never meet, so both are keywords here.

    Parameters
    ----------
    target : str, os.PathLike, Design, trimesh.Trimesh, callable or array
        One of

        - a built-in surface, ``"hypar"`` or ``"hypar:height=0.5"`` (:func:`list_surfaces`);
          its parameters are keywords;
        - a design ``.toml``, a mesh (``.stl``, ``.obj``, ``.ply``, ``.off``, ``.glb``), a
          ``trimesh.Trimesh`` or a :class:`Design`;
        - a function of u and v that returns a point (x, y, z), or one number: the height z over
          x = u, y = v. It is called with arrays if it computes with arrays, else once for each
          sample. Its parameter is ``domain``: u0, u1, v0, v1; -1, 1, -1, 1 by default;
        - heights, an array (rows, columns), with ``spacing`` (1 mm by default); or an image, whose
          grey values are heights, with ``height`` (white above black) and ``spacing``;
        - a grid of points, an array (rows, columns, 3).
    machine : MachineProfile, str or os.PathLike, optional
        With ``size="bed"``: the machine for which the sheet is made. The default is that of a
        design, then grbl-laser-400.
    material : Material, str or os.PathLike, optional
        With ``size="bed"``: the material. The default is that of a design, then card-250.
    on_progress : callable, optional
        Called with a fraction in 0..1 and a short text.
    {options}

    Returns
    -------
    FitResult
        A fit that finds no sheet is a result as well: ``status`` and ``advice`` tell.

    Raises
    ------
    TargetError
        For a target that cannot be read.
    OptionError
        For a name that is neither an option nor a parameter, and for a value that cannot be taken.

    Examples
    --------
    >>> import miurafab as mf
    >>> sheet = mf.fit("hypar", height=0.5, facets=(6, 6), size=250)
    >>> sheet.status
    'converged'
    >>> mf.fit(lambda u, v: (u, v, 0.3 * u * v), facets=(6, 6)).status
    'converged'

    Source
    ------
    L. H. Dudte, E. Vouga, T. Tachi and L. Mahadevan, "Programming curvature using origami
    tessellations", Nature Materials 15 (2016).
    """
    of_bed = {name: options.pop(name, None) for name in declared(BedOptions)}
    asked = design(target, **options)
    if asked.request.size_mm == BED:
        result = fit_to_bed(
            asked.request,
            asked.machine if machine is None else machine,
            asked.material if material is None else material,
            read_options(BedOptions, of_bed),
            asked.layout,
            on_progress,
        )
    else:
        for name, value in {"machine": machine, "material": material, **of_bed}.items():
            if value is not None:
                raise OptionError(
                    name, "is for a `size` that the bed decides; ask for the `size` bed"
                )
        result = fit_request(asked.request, on_progress)
    found = list(asked.findings + result.findings)
    if result.measurements is not None:
        found += _more_facets(asked.request, result.measurements)
        found += judge_quality(result.measurements, fitted=True)
    return replace(result, findings=tuple(found))


def _more_facets(asked: FitRequest, measured: Measurements) -> Iterator[Finding]:
    """Whether the pieces took more facets than were asked for: each has columns of its own."""
    count = 0 if asked.facets is None else asked.columns * asked.rows
    if measured.pieces > 1 and 0 < count < measured.facets:
        yield Finding(
            "more-facets",
            f"`facets` asks for {count} facets and the sheet has {measured.facets}: it comes in "
            f"{measured.pieces} pieces, and each has whole columns of its own. Fewer `pieces` "
            "need fewer.",
        )


described(fit, FitOptions, BedOptions)
