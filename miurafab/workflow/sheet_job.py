"""A job in memory: a pattern laid out, with the G-code of its sheets, and how it is written."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from miurafab.display import Shown
from miurafab.errors import PatternError, ProfileError
from miurafab.fabrication.layout import write_layout
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.plan_advice import SizeAdvice, advised_size
from miurafab.fabrication.sheets import DrawnLayout, lay_out
from miurafab.files import AnyPath, as_file_name, as_path, read_bytes, write_draft
from miurafab.gcode.job import Job
from miurafab.options import written_options
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.formats.fold import fold_text, seen_from
from miurafab.posting import post
from miurafab.profiles import (
    OPERATIONS,
    MachineProfile,
    Material,
    find_file,
    find_profile,
    load_machine,
    load_material,
)
from miurafab.profiles.shipped import Kind
from miurafab.workflow.drawings import drawings, guides, read_formats
from miurafab.workflow.dry_run import SheetPreview, clock_text, dry_run
from miurafab.workflow.job_directory import JobDirectory
from miurafab.workflow.job_files import CAPPED, OPENED, job_files, keep_profiles
from miurafab.workflow.manifest import LAYOUT, sha256, write_manifest
from miurafab.workflow.picture import first_sheet
from miurafab.workflow.quicker import QuickerWay, quicker_ways

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Progress = Callable[[float, str], None]


@dataclass(frozen=True, eq=False, repr=False)
class SheetJob(Shown):
    """A pattern laid out, with the G-code of its sheets, in memory.

    Parameters
    ----------
    name : str
        What the job is called in its drawings.
    layout : DrawnLayout
        Patches, sheets and strokes.
    machine : MachineProfile
        The machine that the job is made for.
    material : Material
        The material of the sheets.
    jobs : tuple of Job
        The G-code of each sheet, in the order in which they are made.
    dry_runs : tuple of SheetPreview
        What each job does and how long it takes.
    machine_file, material_file : Path
        The files of the profiles.
    pattern_file : Path, optional
        The FOLD file of the pattern, None where the pattern has none or was changed.
    options : LayoutOptions
        How the pattern was laid out.
    opened : bool
        Whether the pattern was opened or capped for the job.
    fitted : CreasePattern, optional
        The pattern as it was before that, where no file holds it.
    """

    name: str
    layout: DrawnLayout
    machine: MachineProfile
    material: Material
    jobs: tuple[Job, ...]
    dry_runs: tuple[SheetPreview, ...]
    machine_file: Path
    material_file: Path
    pattern_file: Path | None
    options: LayoutOptions
    opened: bool = False
    fitted: CreasePattern | None = None

    @property
    def pattern(self) -> CreasePattern:
        """The pattern whose facets and edges the layout names."""
        return self.layout.pattern

    @property
    def most_power(self) -> float:
        """The most power that the material allows, as a share of full power."""
        return self.material.most_power(self.machine)

    @property
    def seconds(self) -> float:
        """The estimated time of all sheets, without changing sheets."""
        return sum(sheet.seconds for sheet in self.dry_runs)

    def write(
        self,
        directory: AnyPath,
        *,
        formats: str | Collection[str] = (),
        on_progress: Progress | None = None,
    ) -> JobDirectory:
        """Write the job directory: G-code, drawings, assembly guide, layout, pattern.

        All files are put in place at once. Sheets of an earlier job in the same directory are
        removed; files that are no part of a job are left alone.

        Parameters
        ----------
        directory : str or os.PathLike
            The job directory. It is made if need be.
        formats : str or collection of str
            Drawings besides SVG: dxf, dxf-r2010, pdf, hpgl, picture, and tiled-
            with a page: a0 to a6, letter, legal, tabloid, or a measure (tiled-200x300mm).
        on_progress : callable, optional
            Called with a fraction in 0..1 and a short text.

        Returns
        -------
        JobDirectory

        Raises
        ------
        InputError
            Where the directory holds something else than a job, or cannot be written, and for an
            unknown format.
        """
        from miurafab.fabrication.drawing.svg import sheet_svg
        from miurafab.fabrication.drawing.views import edge_letters

        folder = as_path(directory, "The job directory")
        wanted = read_formats((formats,) if isinstance(formats, str) else formats)
        if self.machine.dialect == "hpgl":  # whose programs are HPGL
            wanted = tuple(name for name in wanted if name != "hpgl")
        tell = on_progress or (lambda fraction, note: None)
        layout, machine = self.layout, self.machine
        letters = edge_letters(layout, self.pattern)
        with job_files(folder) as staging:
            keep_profiles(self.machine_file, self.material_file, folder, staging)
            for number, (toolpath, job) in enumerate(zip(layout.passes, self.jobs, strict=True)):
                tell(0.7 * number / len(self.jobs), f"drawing {toolpath.sheet}")
                write_draft(staging / f"{toolpath.sheet}{machine.job_suffix}", job.text)
                write_draft(staging / f"{toolpath.sheet}.svg", sheet_svg(toolpath, letters))
            for name, content in drawings(layout, self.pattern, wanted, self.name):
                write_draft(staging / name, content)
            tell(0.7, "drawing the assembly guide")
            for name, explains in guides(layout, machine, self.material, self.name):
                write_draft(staging / name, explains)
            used = self._put_pattern(folder, staging)
            if self.fitted is not None:
                text = fold_text(seen_from(self.fitted, folder), self.name)
                write_draft(staging / as_file_name(f"{self.name}.fold"), text)
            digest = sha256(used)
            write_draft(staging / LAYOUT, write_layout(layout, used.name, digest))
            besides = [] if used.parent == staging else [used]
            profiles: dict[Kind, Path] = {
                "firmware_profiles": self.machine_file,
                "materials": self.material_file,
            }
            write_manifest(staging, besides, written_options(self.options), profiles)
        tell(1.0, "done")
        return JobDirectory(folder, layout, machine, self.most_power, self.jobs, self.dry_runs)

    def _put_pattern(self, folder: Path, staging: Path) -> Path:
        """The file of the pattern, which is put into ``staging`` unless it is in ``folder``."""
        if self.pattern_file is None:
            capped = CAPPED if self.opened and self.options.caps else ""
            changed = capped or (OPENED if self.opened else "")
            file = staging / as_file_name(f"{self.name}{changed}.fold")
            write_draft(file, fold_text(seen_from(self.pattern, folder), self.name))
            return file
        file = staging / as_file_name(self.pattern_file.name)
        if (folder / file.name).resolve() == self.pattern_file.resolve():
            return self.pattern_file
        write_draft(file, read_bytes(self.pattern_file, PatternError))
        return file

    @property
    def operation_seconds(self) -> dict[str, float]:
        """The estimated time of each operation on all sheets; ``""`` for the rest."""
        found: dict[str, float] = {}
        for sheet in self.dry_runs:
            for name, seconds in sheet.operation_seconds.items():
                found[name] = found.get(name, 0.0) + seconds
        return {name: found[name] for name in (*OPERATIONS, "") if name in found}

    def advised_size(self) -> SizeAdvice | None:
        """The size that pays, found by plans (:mod:`miurafab.fabrication.plan_advice`).

        Returns
        -------
        SizeAdvice or None
            None where no size pays.
        """
        options = self.options
        if self.opened:  # the pattern is opened and capped already
            options = replace(options, open_row=None, open_column=None, caps=())
        return advised_size(self.pattern, self.layout, self.machine, self.material, options)

    def quicker(self) -> tuple[QuickerWay, ...]:
        """What would make the job quicker, measured (:mod:`miurafab.workflow.quicker`).

        Returns
        -------
        tuple of QuickerWay
            Each a ``change`` in words, and the ``seconds`` that the job would take.
        """
        return quicker_ways(self)

    def plot(self) -> list[Axes]:
        """Draw what is made of each sheet (:meth:`DrawnLayout.plot`)."""
        return self.layout.plot()

    def _summary(self) -> str:
        return f"{self.name}: {self.layout._summary()}, {clock_text(self.seconds)}"

    def _picture(self) -> str:
        return first_sheet(self.dry_runs, self.machine)

    def _facts(self) -> Mapping[str, object]:
        totals = self.layout.totals
        return {
            "machine": self.machine.title,
            "material": self.material.title,
            "patches": totals.patches,
            "tabs": totals.tabs,
            "sheets": totals.sheets,
            "cut_mm": totals.cut_mm,
            "perforated_mm": totals.perforated_mm,
            "time": clock_text(self.seconds),
        }


def make_job(
    pattern: CreasePattern,
    name: str,
    machine: MachineProfile | AnyPath | None,
    material: Material | AnyPath | None,
    options: LayoutOptions | None,
    *,
    file: Path | None = None,
    on_progress: Progress | None = None,
) -> SheetJob:
    """``pattern``, which ``file`` holds if it has one, laid out as ``options`` say."""
    profile, machine_file = _machine(machine)
    stock, material_file = _material(material)
    tell = on_progress or (lambda fraction, note: None)
    tell(0.0, "patches, tabs, perforation, nesting")
    layout = lay_out(pattern, profile, stock, options=options)
    labels = {patch.id: patch.label for patch in layout.patches}
    jobs, dry_runs = [], []
    for number, toolpath in enumerate(layout.passes):
        tell(0.6 + 0.4 * number / len(layout.passes), f"dry run of {toolpath.sheet}")
        job = post(toolpath, profile, stock, patch_labels=labels)
        jobs.append(job)
        size = (toolpath.width_mm, toolpath.height_mm)
        dry_runs.append(dry_run(toolpath.sheet, job, profile, size, stock.most_power(profile)))
    tell(1.0, "done")
    seconds = round(float(sum(sheet.seconds for sheet in dry_runs)), 1)
    opened = layout.pattern is not pattern
    kept = None if file is None or opened or file.suffix.lower() != ".fold" else file
    return SheetJob(
        name,
        replace(layout, totals=replace(layout.totals, seconds=seconds)),
        profile,
        stock,
        tuple(jobs),
        tuple(dry_runs),
        machine_file,
        material_file,
        kept,
        options or LayoutOptions(),
        opened,
        pattern if opened and file is None else None,
    )


def _machine(given: MachineProfile | AnyPath | None) -> tuple[MachineProfile, Path]:
    if not isinstance(given, MachineProfile):
        file = find_profile("firmware_profiles", given)
        return load_machine(file), file
    file = find_file("firmware_profiles", given.name)
    if load_machine(file) != given:
        raise _without_file(given)
    return given, file


def _material(given: Material | AnyPath | None) -> tuple[Material, Path]:
    if not isinstance(given, Material):
        file = find_profile("materials", given)
        return load_material(file), file
    file = find_file("materials", given.name)
    if load_material(file) != given:
        raise _without_file(given)
    return given, file


def _without_file(profile: MachineProfile | Material) -> ProfileError:
    return ProfileError(
        f"{reprlib.repr(profile.name)} is not as its file says; a job needs profiles with a file. "
        "Write a TOML file and give its path."
    )
