"""``miurafab energy`` as a function: the energy of a pattern in a material."""

from __future__ import annotations

from miurafab.errors import InputError
from miurafab.files import AnyPath
from miurafab.options import Whole, number, read_value
from miurafab.origami.energy.bar_hinge import Paper, sheet_model
from miurafab.origami.energy.path import EnergyCurve, Progress, energy_curve
from miurafab.profiles import Material, load_material
from miurafab.workflow.patterns import PatternLike, as_pattern

STEPS = Whole(1, 100_000)


def energy(
    pattern: PatternLike,
    steps: int = 40,
    *,
    material: Material | AnyPath | None = None,
    crease: int | None = None,
    crease_ratio: float = 0.0,
    on_progress: Progress | None = None,
) -> EnergyCurve:
    """Compute the energy of a pattern on the way from its folded form to flat.

    Parameters
    ----------
    pattern : CreasePattern, FitResult, str or os.PathLike
        The pattern, or a file that :func:`load` reads. It needs a folded form.
    steps : int
        Steps from the folded form to flat, 40 by default.
    material : Material, str or os.PathLike, optional
        A profile with a modulus, its shipped name or its TOML file: energies are then in joules.
        Without it their unit is k_f times the mean edge.
    crease : int, optional
        The edge that is driven. The default is a crease in the middle.
    crease_ratio : float
        Stiffness of the creases over that of the facets, 0 by default.
    on_progress : callable, optional
        Called with a fraction in 0..1 and a short text.

    Returns
    -------
    EnergyCurve
        With barrier and stable states; ``.plot()`` draws it, ``.save("x.png")`` writes it.

    Raises
    ------
    InputError
        For a material without a modulus.
    PatternError
        For a pattern without a folded form.
    OptionError
        For a number out of range.

    Examples
    --------
    >>> import miurafab as mf
    >>> mf.energy(mf.fit("plane", facets=(4, 4)), steps=5).rigid
    True
    """
    found = as_pattern(pattern)
    steps = read_value("steps", STEPS, steps)
    ratio = read_value("crease_ratio", number(0), crease_ratio)
    if crease is not None:
        crease = read_value("crease", Whole(), crease)
    paper = None
    if material is not None:
        stock = material if isinstance(material, Material) else load_material(material)
        if stock.modulus_pa is None:
            raise InputError(
                f"The material '{stock.name}' gives no modulus; add a line such as "
                'modulus = "3GPa" to its file, or leave `material` out.'
            )
        paper = Paper(stock.thickness_mm, stock.modulus_pa)
    model = sheet_model(found, paper=paper, crease_ratio=ratio)
    return energy_curve(found, steps, crease=crease, model=model, on_progress=on_progress)
