"""The job directory: everything that one job is, on disk, in files that stand alone.

All files are put in place at once (:mod:`~miurafab.workflow.job_files`), so that a directory with a
layout is whole. The pattern, and a machine or material of the user's own, are
copied in: the directory can be carried to the machine's computer and cut there. A ring that was
opened for the job is in it as it was laid out, under a name of its own.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from miurafab.errors import InputError, LayoutError
from miurafab.fabrication.drawing.assembly_guide import assembly_guide
from miurafab.fabrication.drawing.svg import sheet_svg
from miurafab.fabrication.layout import read_layout, write_layout
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.sheets import Layout, lay_out
from miurafab.findings import Finding
from miurafab.gcode.job import Job
from miurafab.options import read_options
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.formats.fold import fold_text, read_fold
from miurafab.posting import post
from miurafab.profiles import (
    MachineProfile,
    Table,
    load_machine,
    load_material,
    read_toml,
)
from miurafab.workflow.drawings import drawings, read_formats
from miurafab.workflow.dry_run import SheetPreview, dry_run, read_gcode
from miurafab.workflow.job_files import (
    LAYOUT,
    job_files,
    job_machine,
    job_material,
    keep_profiles,
)

GUIDE = "assembly.pdf"
OPENED = "-opened"
"""What the name of a pattern that was opened for the job ends in."""
Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class JobDirectory:
    """A job on disk: its layout, its machine, the largest power of its material as a fraction of
    full power, and the jobs of its sheets in order with their dry runs.
    """

    path: Path
    layout: Layout
    machine: MachineProfile
    most_power: float
    jobs: tuple[Job, ...]
    dry_runs: tuple[SheetPreview, ...]

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The findings on the layout and then on each sheet."""
        return (*self.layout.findings, *(f for sheet in self.dry_runs for f in sheet.findings))


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
    if design_file is None:
        return read_options(LayoutOptions, given)
    table = _layout_table(design_file)
    for key in ("machine", "material"):
        table.text(key, "")
    written, folder = table.rest(), design_file.parent
    return read_options(LayoutOptions, written, where=table.where, folder=folder, over=given)


def design_profiles(design_file: Path) -> tuple[str | None, str | None]:
    """The machine and the material that the ``[layout]`` of ``design_file`` names, None for one
    that it does not.

    Raises :class:`~miurafab.errors.InputError` naming the file and the key.
    """
    table = _layout_table(design_file)
    machine = table.text("machine") if table.has("machine") else None
    return machine, table.text("material") if table.has("material") else None


def _layout_table(design_file: Path) -> Table:
    written = Table(read_toml(design_file, InputError), design_file.name, InputError)
    if not written.has("layout"):
        raise InputError(f"{design_file} has no [layout], so there is nothing to take from it.")
    return written.table("layout")


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
    with job_files(directory) as staging:
        keep_profiles(machine, material, directory, staging)
        layout = lay_out(given, profile, stock, options=options)
        pattern = layout.pattern or given
        labels = {patch.id: patch.label for patch in layout.patches}
        jobs, dry_runs = [], []
        for number, toolpath in enumerate(layout.passes):
            tell(0.4 + 0.5 * number / len(layout.passes), f"drawing {toolpath.sheet}")
            job = post(toolpath, profile, stock, patch_labels=labels)
            jobs.append(job)
            size = (toolpath.width_mm, toolpath.height_mm)
            dry_runs.append(dry_run(toolpath.sheet, job, profile, size, stock.max_power))
            write_text(staging / f"{toolpath.sheet}{profile.job_suffix}", job.text)
            write_text(staging / f"{toolpath.sheet}.svg", sheet_svg(toolpath))
        for name, content in drawings(layout, pattern, wanted, pattern_file.stem):
            (staging / name).write_bytes(content)
        seconds = round(float(sum(sheet.seconds for sheet in dry_runs)), 1)
        layout = replace(layout, totals=replace(layout.totals, seconds=seconds))
        tell(0.9, "drawing the assembly guide")
        guide = assembly_guide(layout, pattern, profile, stock, pattern_file.stem)
        (staging / GUIDE).write_bytes(guide)
        name = pattern_file.name
        if pattern is not given:
            name = f"{pattern_file.stem}{OPENED}.fold"
            write_text(staging / name, fold_text(pattern, pattern_file.stem))
        elif (directory / name).resolve() != pattern_file.resolve():
            shutil.copyfile(pattern_file, staging / name)
        used = staging / name if (staging / name).exists() else pattern_file
        digest = hashlib.sha256(used.read_bytes()).hexdigest()
        write_text(staging / LAYOUT, write_layout(layout, name, digest))
    tell(1.0, "done")
    return JobDirectory(directory, layout, profile, stock.max_power, tuple(jobs), tuple(dry_runs))


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
    machine = job_machine(layout.machine, directory)
    most_power = job_material(layout.material, directory).max_power
    made = [(name, sheet) for sheet in layout.sheets for name in sheet.passes]
    jobs = []
    for name, _ in made:
        file = directory / f"{name}{machine.job_suffix}"
        if not file.is_file():
            raise InputError(f"{file} is missing; make the job again with 'miurafab sheets'.")
        jobs.append(read_gcode(file))
    dry_runs = (
        dry_run(name, job, machine, (sheet.width_mm, sheet.height_mm), most_power)
        for (name, sheet), job in zip(made, jobs, strict=True)
    )
    return JobDirectory(directory, layout, machine, most_power, tuple(jobs), tuple(dry_runs))


def write_text(path: Path, text: str) -> None:
    """Write ``text`` with the same bytes on every system."""
    path.write_text(text, encoding="utf-8", newline="\n")
