"""The job directory: everything that one job is, on disk, in files that stand alone.

All files are put in place at once (:mod:`~miurafab.workflow.job_files`), so that a directory with a
layout is whole. The pattern, and a machine or material of the user's own, are
copied in: the directory can be carried to the machine's computer and cut there. A ring that was
opened for the job is in it as it was laid out, under a name of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from miurafab.display import Shown
from miurafab.errors import InputError
from miurafab.fabrication.layout import read_layout
from miurafab.fabrication.sheets import Layout, Sheet
from miurafab.files import AnyPath, as_path, read_text
from miurafab.findings import Finding
from miurafab.gcode.job import Job
from miurafab.profiles import MachineProfile
from miurafab.workflow.dry_run import SheetPreview, clock_text, dry_run, read_gcode
from miurafab.workflow.job_files import job_machine, job_material, settle_job
from miurafab.workflow.manifest import LAYOUT, edits
from miurafab.workflow.picture import first_sheet


@dataclass(frozen=True, repr=False)
class JobDirectory(Shown):
    """A job on disk.

    Parameters
    ----------
    path : Path
        The directory.
    layout : Layout
        Patches and sheets.
    machine : MachineProfile
        The machine that the job is made for.
    most_power : float
        The largest power of the material, as a fraction of full power.
    jobs : tuple of Job
        The G-code of each sheet, in the order in which they are made.
    dry_runs : tuple of SheetPreview
        What each job does and how long it takes.
    edits : tuple of Finding
        Which files are not as they were made.
    """

    path: Path
    layout: Layout
    machine: MachineProfile
    most_power: float
    jobs: tuple[Job, ...]
    dry_runs: tuple[SheetPreview, ...]
    edits: tuple[Finding, ...] = ()

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The findings on the files, on the layout and then on each sheet."""
        sheets = (found for sheet in self.dry_runs for found in sheet.findings)
        return (*self.edits, *self.layout.findings, *sheets)

    def _summary(self) -> str:
        return f"{self.path}: {self.layout._summary()}"

    def _picture(self) -> str:
        return first_sheet(self.dry_runs, self.machine)

    def _facts(self) -> Mapping[str, object]:
        seconds = sum(sheet.seconds for sheet in self.dry_runs)
        return {"path": self.path, "machine": self.machine.title, "time": clock_text(seconds)}


def read_job(
    directory: AnyPath,
    *,
    unread: bool = False,
    on_progress: Callable[[float, str], None] | None = None,
) -> JobDirectory:
    """Read the job of a directory that :meth:`SheetJob.write` made.

    Parameters
    ----------
    directory : str or os.PathLike
        The job directory.
    unread : bool
        Whether a program that the controller would refuse is a finding of its dry run instead of
        an error.
    on_progress : callable, optional
        Called with a fraction in 0..1 and a short text.

    Returns
    -------
    JobDirectory

    Raises
    ------
    InputError
        If the directory holds no whole job.

    Examples
    --------
    >>> import miurafab as mf
    >>> sheet = mf.fit("plane", facets=(4, 4))
    >>> _ = mf.sheets(sheet).write("jobs/plane")
    >>> len(mf.read_job("jobs/plane").dry_runs)
    1
    """
    written = read_written(as_path(directory, "The job directory"))
    tell = on_progress or (lambda fraction, note: None)

    def share_of(number: int, name: str) -> Callable[[float], None]:
        return lambda share: tell((number + share) / len(written.jobs), f"timing {name}")

    dry_runs = (
        dry_run(
            name,
            job,
            written.machine,
            (sheet.width_mm, sheet.height_mm),
            written.most_power,
            unread=unread,
            on_share=share_of(number, name),
        )
        for number, ((name, sheet), job) in enumerate(
            zip(written.passes, written.jobs, strict=True)
        )
    )
    return JobDirectory(
        written.directory,
        written.layout,
        written.machine,
        written.most_power,
        written.jobs,
        tuple(dry_runs),
        edits(written.directory, (LAYOUT, *(job.name for job in written.jobs))),
    )


@dataclass(frozen=True)
class WrittenJob:
    """A job as it stands in its ``directory``, before anything is judged: ``passes`` are the names
    of the programs, each with its sheet, and ``jobs`` the programs.
    """

    directory: Path
    layout: Layout
    machine: MachineProfile
    most_power: float
    passes: tuple[tuple[str, Sheet], ...]
    jobs: tuple[Job, ...]


def read_written(directory: Path) -> WrittenJob:
    """The job in ``directory``. Raises :class:`~miurafab.errors.InputError` if it is not whole."""
    settle_job(directory)
    path = directory / LAYOUT
    if not path.is_file():
        raise InputError(
            f"{directory} holds no whole job ({LAYOUT} is missing); make it with 'miurafab sheets'."
        )
    layout = read_layout(read_text(path, InputError, "a layout"), path)
    machine = job_machine(layout.machine, directory)
    most_power = job_material(layout.material, directory).most_power(machine)
    passes = tuple((name, sheet) for sheet in layout.sheets for name in sheet.passes)
    jobs = []
    for name, _ in passes:
        file = directory / f"{name}{machine.job_suffix}"
        if not file.is_file():
            raise InputError(f"{file} is missing; make the job again with 'miurafab sheets'.")
        jobs.append(read_gcode(file))
    return WrittenJob(directory, layout, machine, most_power, passes, tuple(jobs))
