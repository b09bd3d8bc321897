"""``miurafab sheets`` as a function: a pattern as a job, in memory first, then on disk."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from miurafab.display import Shown
from miurafab.errors import InputError
from miurafab.fabrication.options import LayoutOptions
from miurafab.files import AnyPath, as_path
from miurafab.options import declared, read_options
from miurafab.options.documented import described
from miurafab.options.verbs import verb
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import MachineProfile, Material, Table, read_toml
from miurafab.workflow.patterns import PatternLike, sound_pattern
from miurafab.workflow.scaling import ScaleOptions, scaled

# What lays out is imported when the pattern is read: loading it takes longer than the reading.
if TYPE_CHECKING:
    from miurafab.workflow.sheet_job import Progress, SheetJob


@verb
def sheets(
    pattern: PatternLike,
    machine: MachineProfile | AnyPath | None = None,
    material: Material | AnyPath | None = None,
    *,
    design: AnyPath | None = None,
    on_progress: Progress | None = None,
    **options: Any,
) -> SheetJob:
    """Lay a pattern out on the sheets of a machine and make their G-code, all in memory.

    Parameters
    ----------
    pattern : CreasePattern, FitResult, str or os.PathLike
        The pattern, or a file that :func:`load` reads.
    machine : MachineProfile, str or os.PathLike, optional
        A shipped name (:func:`list_machines` lists them) or a TOML file. The default is that of
        ``design``, then grbl-laser-400.
    material : Material, str or os.PathLike, optional
        A shipped name (:func:`list_materials` lists them) or a TOML file. The default is that of
        ``design``, then card-250.
    design : str or os.PathLike, optional
        A design file whose ``[layout]`` gives options, machine and material. Arguments win.
    on_progress : callable, optional
        Called with a fraction in 0..1 and a short text.
    {options}

    Returns
    -------
    SheetJob
        ``.write("jobs/hypar")`` puts it on disk; :func:`preview` and :func:`cut` take it.

    Raises
    ------
    LayoutError
        If a facet does not fit the bed, or the stock does not suffice.
    ProfileError
        For a machine or material that is unknown or has a fault.
    OptionError
        For options that cannot be taken.

    Examples
    --------
    >>> import miurafab as mf
    >>> sheet = mf.fit("hypar", height=0.5, facets=(6, 6), size=120)
    >>> job = mf.sheets(sheet, machine="grbl-laser-400", material="card-250")
    >>> job.layout.totals.sheets
    1
    """
    of_size = {name: options.pop(name, None) for name in declared(ScaleOptions)}
    wanted, usual_machine, usual_material = layout_options(options, design)
    machine = machine if machine is not None else usual_machine
    material = material if material is not None else usual_material
    read = sound_pattern(pattern)
    given = scaled(read, read_options(ScaleOptions, of_size))
    file = None if isinstance(pattern, CreasePattern | Shown) else as_path(pattern, "The pattern")
    name = file.stem if file is not None else given.name or "sheet"
    file = file if given is read else None

    from miurafab.workflow.sheet_job import make_job

    return make_job(given, name, machine, material, wanted, file=file, on_progress=on_progress)


described(sheets, LayoutOptions, ScaleOptions)


def layout_options(
    given: Mapping[str, Any], design: AnyPath | None = None
) -> tuple[LayoutOptions, str | None, str | None]:
    """The options ``given``, else those of the design file, with its machine and material."""
    if design is None:
        return read_options(LayoutOptions, given), None, None
    file = as_path(design, "The design file")
    table = Table(read_toml(file, InputError), file.name, InputError)
    if not table.has("layout"):
        raise InputError(f"{file} has no [layout], so there is nothing to take from it.")
    from miurafab.workflow.design import read_layout_table

    return read_layout_table(table.table("layout"), file.parent, given)
