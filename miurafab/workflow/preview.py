"""The preview of a job: each of its G-code files dry-run on one machine; no port is opened."""

from __future__ import annotations

import os
import re
import reprlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from miurafab.display import Shown
from miurafab.errors import InputError
from miurafab.fabrication.wording import count
from miurafab.files import AnyPath, as_path, new_folder, read_text
from miurafab.findings import Finding, findings_json
from miurafab.gcode.job import Job
from miurafab.grbl.settings import parse_dump
from miurafab.options import Whole, declared, read_value
from miurafab.options.verbs import verb
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import MachineProfile, known_names, read_machine
from miurafab.profiles.board import with_settings
from miurafab.workflow.alignment import Mark, lay, the_one
from miurafab.workflow.cut_options import CutOptions
from miurafab.workflow.dry_run import (
    SheetPreview,
    clock_text,
    dry_run,
    length_text,
    read_gcode,
    readiness,
)
from miurafab.workflow.job_files import job_machine, job_material, settle_job
from miurafab.workflow.manifest import LAYOUT, edits, sha256

if TYPE_CHECKING:
    from miurafab.fabrication.layout import LayoutHead
    from miurafab.fabrication.mates import SeamTab
    from miurafab.workflow.job_directory import JobDirectory
    from miurafab.workflow.sheet_job import SheetJob

Progress = Callable[[float, str], None]

_ASSUMED_CUTTER = "hpgl-cutter-a3"
_MACHINE = re.compile(r"^\(machine ([^()]+)\)$", re.MULTILINE)


@dataclass(frozen=True, eq=False, repr=False)
class Preview(Shown):
    """A whole job, dry-run.

    Parameters
    ----------
    name : str
        What the job is called.
    machine : MachineProfile
        The machine whose times and limits hold.
    sheets : tuple of SheetPreview
        What each G-code file does.
    pattern : CreasePattern, optional
        The pattern that the sheets fold into, None where it is not known.
    findings : tuple of Finding
        About the job as a whole; each sheet has its own.
    tabs : tuple of SeamTab
        The tabs with their mates, none where the layout is not known.
    """

    name: str
    machine: MachineProfile
    sheets: tuple[SheetPreview, ...]
    pattern: CreasePattern | None
    findings: tuple[Finding, ...]
    tabs: tuple[SeamTab, ...] = ()

    @property
    def seconds(self) -> float:
        """The time of all sheets, one after another, without changing sheets."""
        return sum(sheet.seconds for sheet in self.sheets)

    def write(self, folder: AnyPath, *, on_progress: Progress | None = None) -> tuple[Path, ...]:
        """Write a picture of each sheet, and ``preview.html``, which shows everything.

        Parameters
        ----------
        folder : str or os.PathLike
            It is made if need be.
        on_progress : callable, optional
            Called with a fraction in 0..1 and a short text.

        Returns
        -------
        tuple of Path
            The files, the page last.
        """
        from miurafab.workflow.page import write_page
        from miurafab.workflow.picture import write_pictures

        directory = new_folder(folder, "The folder of the preview")
        if on_progress is not None:
            on_progress(0.0, "pictures")
        files = write_pictures(self, directory)
        page = directory / "preview.html"
        write_page(page, title=self.name, preview=self, pattern=self.pattern)
        return (*files, page)

    def _summary(self) -> str:
        sheets, time = count(len(self.sheets), "sheet", "sheets"), clock_text(self.seconds)
        return f"{self.name} on {self.machine.name}: {sheets}, {time}"

    def _picture(self) -> str:
        from miurafab.workflow.picture import first_sheet

        return first_sheet(self.sheets, self.machine)

    def _facts(self) -> Mapping[str, object]:
        facts: dict[str, object] = {"machine": self.machine.title}
        for sheet in self.sheets:
            facts[sheet.name] = f"{clock_text(sheet.seconds)}, {length_text(sheet.cut_mm)} burnt"
        return facts

    def as_dict(self) -> dict[str, Any]:
        """The JSON answer of ``preview``."""
        of_sheets = (finding for sheet in self.sheets for finding in sheet.findings)
        return {
            "status": readiness([*self.findings, *of_sheets]),
            "job": self.name,
            "machine": self.machine.name,
            "seconds": round(self.seconds, 3),
            "sheets": [sheet.figures() for sheet in self.sheets],
            "findings": findings_json(self.findings),
        }


@verb
def preview(
    job: SheetJob | JobDirectory | AnyPath,
    *,
    machine: MachineProfile | AnyPath | None = None,
    settings: AnyPath | None = None,
    sheet: int | None = None,
    align: Sequence[Mark] | str = (),
    on_progress: Progress | None = None,
) -> Preview:
    """Dry-run a job; no port is opened.

    Parameters
    ----------
    job : SheetJob, JobDirectory, str or os.PathLike
        A job in memory, a job directory or a G-code file.
    machine : MachineProfile, str or os.PathLike, optional
        A profile, its shipped name or its TOML file. The default is the machine that the job names.
    settings : str or os.PathLike, optional
        A file with the answer of a controller to ``$$``. Its rates, accelerations, S range and
        travel replace those of the profile.
    sheet : int, optional
        The number of the one sheet to show, from 1. The default is all.
    align : sequence of pairs of points, optional
        Two marks of the one sheet, as those of :func:`cut`: it is shown where it lies.
    on_progress : callable, optional
        Called with a fraction in 0..1 and a short text.

    Returns
    -------
    Preview
        ``.write(folder)`` writes pictures and a page.

    Raises
    ------
    InputError
        For a path that holds no job.
    GcodeError
        For a program that the controller would refuse, by file and line.
    ProfileError
        For a machine or settings with a fault.

    Examples
    --------
    >>> import miurafab as mf
    >>> job = mf.sheets(mf.fit("hypar", facets=(6, 6), size=120))
    >>> len(mf.preview(job).sheets)
    1
    """
    profile = None if machine is None else read_machine(machine)
    marks = read_value("align", declared(CutOptions)["align"].kind, align)
    chosen = None if sheet is None else read_value("sheet", Whole(1), sheet)
    if not isinstance(job, str | os.PathLike):
        return _chosen(*_of_value(job, profile, settings), chosen, marks)
    path = as_path(job, "The job")
    if not path.exists():
        raise InputError(f"{path} does not exist.")
    if path.suffix.lower() == ".fold":
        raise InputError(
            f"{path} is a pattern and no job; make a job with 'miurafab sheets {path} -o JOB', "
            "then preview JOB."
        )
    layout = _read_layout(path / LAYOUT) if path.is_dir() else None
    files = _job_files(path, layout)
    jobs = [read_gcode(file) for file in files]
    findings = [*edits(path, (LAYOUT, *(file.name for file in files)))] if layout else []
    if profile is None:
        profile = _made_for(path, layout, jobs[0], findings)
    if settings is not None:
        profile = _as_dumped(profile, as_path(settings, "The settings"))
    bed = (profile.bed.width_mm, profile.bed.height_mm)
    papers = {} if layout is None else _papers(layout)
    most_power = 1.0
    made_for = maker_of(jobs[0], path.parent) if layout is None else None
    if layout is not None:
        made_for = job_machine(layout.machine, path)
        most_power = job_material(layout.material, path).most_power(made_for)
    findings += another_beam(made_for, profile, path.name)
    sheets = []
    for number, (file, gcode) in enumerate(zip(files, jobs, strict=True)):
        if on_progress is not None:
            on_progress(number / len(files), file.name)
        sheets.append(dry_run(file.stem, gcode, profile, papers.get(file.stem, bed), most_power))
    pattern = None if layout is None else _pattern(path, layout, findings)
    is_whole = layout is not None and layout.is_whole
    tabs = _tabs(path / LAYOUT, pattern, findings) if is_whole else ()
    name = path.resolve().name
    seen = Preview(name, profile, tuple(sheets), pattern, tuple(findings), tabs)
    return _chosen(seen, jobs, most_power, chosen, marks)


def _tabs(
    layout: Path, pattern: CreasePattern | None, findings: list[Finding]
) -> tuple[SeamTab, ...]:
    """The tabs of a job as it was made; a changed layout may name anything."""
    if pattern is None or any(each.code == "edited" for each in findings):
        return ()
    from miurafab.fabrication.layout import read_layout  # slow to load
    from miurafab.fabrication.mates import seam_tabs

    text = read_text(layout, InputError, "a layout")
    return (*seam_tabs(read_layout(text, layout), pattern),)


def _chosen(
    seen: Preview,
    jobs: Sequence[Job],
    most_power: float,
    sheet: int | None,
    marks: Sequence[Mark],
) -> Preview:
    """The one ``sheet`` of a preview, where its ``marks`` are; None: all of them."""
    if sheet is not None:
        if sheet > len(jobs):
            raise InputError(f"{seen.name} has no sheet {sheet}; it has {len(jobs)}.")
        seen, jobs = replace(seen, sheets=(seen.sheets[sheet - 1],)), jobs[sheet - 1 : sheet]
    if not marks:
        return seen
    the_one(range(len(jobs)))
    _, there, aligned = lay(jobs[0], seen.machine, seen.sheets[0], marks, most_power=most_power)
    return replace(seen, sheets=(there,), findings=(*seen.findings, aligned.finding))


def _of_value(
    job: object, machine: MachineProfile | None, settings: AnyPath | None
) -> tuple[Preview, Sequence[Job], float]:
    """The preview of a job in memory or of one that was read, its programs and most power."""
    from miurafab.fabrication.mates import seam_tabs  # slow to load
    from miurafab.workflow.job_directory import JobDirectory
    from miurafab.workflow.sheet_job import SheetJob

    if not isinstance(job, SheetJob | JobDirectory):
        raise InputError(
            f"{reprlib.repr(job)} is no job; give the path of a job directory or a G-code file, or "
            "what sheets() returns."
        )
    name = job.name if isinstance(job, SheetJob) else job.path.resolve().name
    pattern = job.pattern if isinstance(job, SheetJob) else None
    edited = job.edits if isinstance(job, JobDirectory) else ()
    dry_runs = job.dry_runs
    elsewhere: list[Finding] = []
    if machine is not None or settings is not None:
        profile = machine or job.machine
        elsewhere = another_beam(job.machine, profile, name)
        if settings is not None:
            profile = _as_dumped(profile, as_path(settings, "The settings"))
        dry_runs = tuple(
            dry_run(sheet.name, gcode, profile, sheet.paper_mm, job.most_power)
            for sheet, gcode in zip(job.dry_runs, job.jobs, strict=True)
        )
    else:
        profile = job.machine
    tabs = tuple(seam_tabs(job.layout, job.pattern)) if isinstance(job, SheetJob) else ()
    made = Preview(name, profile, dry_runs, pattern, (*edited, *elsewhere), tabs)
    return made, job.jobs, job.most_power


def _as_dumped(machine: MachineProfile, dump: Path) -> MachineProfile:
    """``machine`` as the board has it whose ``$$`` is in the file ``dump``.

    Raises :class:`~miurafab.errors.ProfileError` for a line that is no setting.
    """
    return with_settings(machine, parse_dump(read_gcode(dump).text, dump.name).values)


def _read_layout(path: Path) -> LayoutHead | None:
    settle_job(path.parent)
    if not path.is_file():
        return None
    from miurafab.fabrication.layout import read_head  # slow to load

    return read_head(read_text(path, InputError, "a layout"), path)


def _papers(layout: LayoutHead) -> dict[str, tuple[float, float]]:
    """The sheet sizes by the names of their programs."""
    return {
        name: (sheet.width_mm, sheet.height_mm) for sheet in layout.sheets for name in sheet.passes
    }


def _job_files(path: Path, layout: LayoutHead | None) -> list[Path]:
    if not path.is_dir():
        return [path]
    if layout is None:
        files = sorted(path.glob("*.nc"))
    else:
        suffix = job_machine(layout.machine, path).job_suffix
        files = [path / f"{name}{suffix}" for name in _papers(layout)]
    if not files:
        raise InputError(f"{path} holds no G-code (*.nc); make it with 'miurafab sheets'.")
    return files


def named_machine(job: Job, folder: Path | None = None) -> MachineProfile | None:
    """The machine that the job's ``(machine ...)`` comment names, None without one.

    A profile of that name in ``folder`` is a user's own, and comes before the shipped ones.
    """
    comment = _MACHINE.search(job.text)
    return None if comment is None else job_machine(comment[1], folder)


def maker_of(job: Job, folder: Path) -> MachineProfile | None:
    """As :func:`named_machine`, and None where the machine is not known here."""
    comment = _MACHINE.search(job.text)
    known = {*known_names("firmware_profiles"), *(file.stem for file in folder.glob("*.toml"))}
    return named_machine(job, folder) if comment and comment[1] in known else None


def another_beam(
    made_for: MachineProfile | None, machine: MachineProfile, job: str
) -> list[Finding]:
    """The finding that a ``job`` was made for a machine whose beam is not that of ``machine``."""
    if made_for is None or made_for.tool.same_beam(machine.tool):
        return []
    says = (
        f"{job} was made for {made_for.tool.strength} ({made_for.name}), and {machine.name} is "
        f"{machine.tool.strength}, where its S values mean another power: make it anew for that "
        "machine with 'miurafab sheets'."
    )
    return [Finding("other-beam", says, job)]


def _made_for(
    path: Path, layout: LayoutHead | None, job: Job, findings: list[Finding]
) -> MachineProfile:
    """The machine that the job was made for, or the assumed machine and a note."""
    folder = path if path.is_dir() else path.parent
    if layout is not None:
        return job_machine(layout.machine, folder)
    named = named_machine(job, folder)
    if named is not None:
        return named
    assumed = assumed_machine(path)
    findings.append(
        Finding(
            "assumed-machine",
            f"No machine is named, so times and limits hold for {assumed.name}; give `machine` or "
            "`settings` for another.",
            path.name,
        )
    )
    return assumed


def assumed_machine(path: Path) -> MachineProfile:
    """The machine assumed for a file that names none: a cutter for HPGL, else the default."""
    return read_machine(_ASSUMED_CUTTER if path.suffix.lower() == ".plt" else None)


def _pattern(path: Path, layout: LayoutHead, findings: list[Finding]) -> CreasePattern | None:
    """The pattern that the sheets fold into, if its file is where the layout says, unchanged."""
    file = path / layout.pattern_file
    if file.is_file():
        if sha256(file) == layout.pattern_sha256:
            from miurafab.origami.formats.fold import read_fold  # slow to load, seldom needed

            return read_fold(file)
        says = f"{file} has changed since the sheets were made, so it is not shown."
        findings.append(Finding("pattern-changed", says, str(file)))
        return None
    says = f"The pattern {file.name} is not there, so its fold is not shown."
    findings.append(Finding("pattern-missing", says, file.name))
    return None
