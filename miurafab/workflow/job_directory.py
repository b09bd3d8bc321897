"""The job directory: everything that one job is, on disk, in files that stand alone.

``layout.json`` is written last and removed first, so that a directory with a layout is whole and
one that was interrupted is no job. The pattern, and a machine or material of the user's own, are
copied in: the directory can be carried to the machine's computer and cut there. A ring that was
opened for the job is in it as it was laid out, under a name of its own.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from miurafab.errors import InputError, LayoutError
from miurafab.fabrication.drawing.assembly_guide import assembly_guide
from miurafab.fabrication.drawing.svg import sheet_svg
from miurafab.fabrication.layout import read_layout, write_layout
from miurafab.fabrication.options import LayoutOptions, read_options
from miurafab.fabrication.sheets import Layout, lay_out
from miurafab.gcode.job import Job
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.fold_format import fold_text, read_fold
from miurafab.posting import post
from miurafab.profiles import (
    MachineProfile,
    Table,
    find_file,
    load_machine,
    load_material,
    read_toml,
)
from miurafab.profiles.shipped import Kind, shipped_directory
from miurafab.workflow.drawings import ENDINGS, PICTURE, drawings, read_formats
from miurafab.workflow.dry_run import SheetPreview, dry_run, read_gcode

LAYOUT = "layout.json"
GUIDE = "assembly.pdf"
OPENED = "-opened"
"""What the name of a pattern that was opened for the job ends in."""
Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class JobDirectory:
    """A job on disk: its layout, its machine, and the jobs of its sheets in order, with what the
    dry run says of each.
    """

    path: Path
    layout: Layout
    machine: MachineProfile
    jobs: tuple[Job, ...]
    dry_runs: tuple[SheetPreview, ...]


def sheets(
    pattern: CreasePattern, machine: str, material: str, options: LayoutOptions | None = None
) -> Layout:
    """``pattern`` laid out for the machine and material of these names (or TOML files).

    Raises :class:`~miurafab.errors.LayoutError` or ``ProfileError``.
    """
    return lay_out(pattern, load_machine(machine), load_material(material), options=options)


def layout_options(given: Mapping[str, Any], design_file: Path | None = None) -> LayoutOptions:
    """The options ``given``, by the keys of a design file's ``[layout]``, and for the rest those
    of ``design_file``.

    Raises :class:`~miurafab.errors.InputError` naming the key.
    """
    values: dict[str, Any] = {}
    if design_file is not None:
        written = Table(read_toml(design_file, InputError), design_file.name, InputError)
        values = written.table("layout", {}).rest()
        for key in ("machine", "material"):
            values.pop(key, None)
        if isinstance(values.get("stock"), str):
            values["stock"] = str(design_file.parent / values["stock"])
    table = Table(values | dict(given), "The layout options", InputError)
    options = read_options(table)
    table.finish()
    return options


def write_job(
    pattern_file: Path,
    directory: Path,
    machine: str,
    material: str,
    on_progress: Progress | None = None,
    *,
    formats: Collection[str] = (),
    options: LayoutOptions | None = None,
) -> JobDirectory:
    """Lay the pattern of a FOLD file out and write its job directory.

    ``machine`` and ``material`` are shipped names or TOML files; ``formats`` are further drawings
    (:mod:`~miurafab.workflow.drawings`), ``options`` what is asked of the layout. Sheets of an
    earlier job in the same directory are removed; files that are no part of a job are left alone.
    Raises :class:`~miurafab.errors.InputError` where the directory holds something else than a job.
    """
    wanted = read_formats(formats)
    tell = on_progress or (lambda fraction, note: None)
    tell(0.0, "patches, tabs, perforation, nesting")
    profile, stock = load_machine(machine), load_material(material)
    given = read_fold(pattern_file)
    layout = lay_out(given, profile, stock, options=options)
    pattern = layout.pattern or given
    labels = {patch.id: patch.label for patch in layout.patches}
    make_room(directory)
    jobs, dry_runs = [], []
    for number, toolpath in enumerate(layout.passes):
        tell(0.4 + 0.5 * number / len(layout.passes), f"drawing {toolpath.sheet}")
        job = post(toolpath, profile, stock, patch_labels=labels)
        jobs.append(job)
        size = (toolpath.width_mm, toolpath.height_mm)
        dry_runs.append(dry_run(toolpath.sheet, job, profile, size))
        write_text(directory / f"{toolpath.sheet}{profile.job_suffix}", job.text)
        write_text(directory / f"{toolpath.sheet}.svg", sheet_svg(toolpath))
    for name, content in drawings(layout, pattern, wanted, pattern_file.stem):
        (directory / name).write_bytes(content)
    seconds = round(float(sum(sheet.seconds for sheet in dry_runs)), 1)
    layout = replace(layout, totals=replace(layout.totals, seconds=seconds))
    tell(0.9, "drawing the assembly guide")
    guide = assembly_guide(layout, pattern, profile, stock, pattern_file.stem)
    (directory / GUIDE).write_bytes(guide)
    copy = directory / pattern_file.name
    if pattern is not given:
        copy = directory / f"{pattern_file.stem}{OPENED}.fold"
        write_text(copy, fold_text(pattern, pattern_file.stem))
    elif copy.resolve() != pattern_file.resolve():
        shutil.copyfile(pattern_file, copy)
    keep_own_profile("firmware_profiles", machine, directory)
    keep_own_profile("materials", material, directory)
    digest = hashlib.sha256(copy.read_bytes()).hexdigest()
    write_text(directory / LAYOUT, write_layout(layout, copy.name, digest))
    tell(1.0, "done")
    return JobDirectory(directory, layout, profile, tuple(jobs), tuple(dry_runs))


def read_job(directory: Path) -> JobDirectory:
    """The job in a directory that :func:`write_job` made.

    Raises :class:`~miurafab.errors.InputError` if it holds no whole job.
    """
    path = directory / LAYOUT
    if not path.is_file():
        raise InputError(
            f"{directory} holds no whole job ({LAYOUT} is missing); make it with 'miurafab sheets'."
        )
    try:
        layout = read_layout(path.read_text(encoding="utf-8"))
    except LayoutError as fault:
        raise InputError(f"{path}: {fault}") from None
    own = directory / f"{layout.machine}.toml"
    machine = load_machine(own if own.is_file() else layout.machine)
    made = [(name, sheet) for sheet in layout.sheets for name in sheet.passes]
    jobs = []
    for name, _ in made:
        file = directory / f"{name}{machine.job_suffix}"
        if not file.is_file():
            raise InputError(f"{file} is missing; make the job again with 'miurafab sheets'.")
        jobs.append(read_gcode(file))
    dry_runs = (
        dry_run(name, job, machine, (sheet.width_mm, sheet.height_mm))
        for (name, sheet), job in zip(made, jobs, strict=True)
    )
    return JobDirectory(directory, layout, machine, tuple(jobs), tuple(dry_runs))


def keep_own_profile(kind: Kind, name: str, directory: Path) -> None:
    """Copy a profile or material of the user's own into the job ``directory``."""
    path = find_file(kind, name)
    if path.resolve().parent != shipped_directory(kind).resolve():
        copy = directory / path.name
        if copy.resolve() != path.resolve():
            shutil.copyfile(path, copy)


def make_room(directory: Path) -> None:
    """Create the directory, or clear the sheets of the job that is in it."""
    if directory.exists() and not directory.is_dir():
        raise InputError(f"{directory} is a file; a job needs a directory.")
    layout = directory / LAYOUT
    if not layout.exists():
        strangers = sorted(directory.glob("*.nc")) if directory.exists() else []
        if strangers:
            raise InputError(
                f"{directory} holds {strangers[0].name}, which no layout there accounts for; "
                "choose another directory or remove it."
            )
        directory.mkdir(parents=True, exist_ok=True)
        return
    try:
        made = json.loads(layout.read_text())["sheets"]
        names = [str(sheet["name"]) for sheet in made]
        names += [str(sheet["back"]) for sheet in made if sheet.get("back")]
    except (ValueError, KeyError, TypeError):
        raise InputError(
            f"{layout} is not a layout of this version; choose another directory or remove it."
        ) from None
    layout.unlink()
    for name in names:
        for ending in (".nc", ".plt", ".svg", *ENDINGS):
            (directory / f"{Path(name).name}{ending}").unlink(missing_ok=True)
    (directory / PICTURE).unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write ``text`` with the same bytes on every system."""
    path.write_text(text, encoding="utf-8", newline="\n")
