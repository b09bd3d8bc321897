"""Preparing a cut: from a THING to the G-code of its sheets.

THING is a job directory, a G-code file, a pattern (.fold), a design (.toml) or a TARGET.
"""

from __future__ import annotations

import os
import reprlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from miurafab.errors import InputError, OptionError
from miurafab.files import AnyPath, as_path
from miurafab.findings import Finding, refusals
from miurafab.gcode.job import Job
from miurafab.options import declared, read_options
from miurafab.profiles import MachineProfile, read_machine
from miurafab.workflow.dry_run import SheetPreview, dry_run, read_gcode
from miurafab.workflow.preview import another_beam, assumed_machine, maker_of, named_machine

# What fits and lays out is imported where it is needed: loading it
# takes longer than all that cuts.
if TYPE_CHECKING:
    from miurafab.fabrication.options import LayoutOptions
    from miurafab.origami.crease_pattern import CreasePattern
    from miurafab.workflow.alignment import Aligned
    from miurafab.workflow.job_directory import JobDirectory

Progress = Callable[[float, str], None]
GCODE_SUFFIXES = (".nc", ".gcode", ".ngc", ".tap", ".plt")
JOBS = Path("jobs")
"""Where jobs are made unless told otherwise."""


@dataclass(frozen=True)
class Prepared:
    """What will be cut: the jobs with their dry runs and the machine, and how they were made.

    ``folder`` is where the journals go. ``report`` is that of the fit or the check, None for what
    came as G-code or a job directory; ``refused`` are the findings of a fit that failed or a
    pattern that is not valid, for which nothing will be cut. ``aligned`` says which sheet was
    turned and shifted to where it lies (:func:`~miurafab.workflow.alignment.align`); ``elsewhere``
    that the job was made for another beam.
    """

    name: str
    machine: MachineProfile
    jobs: tuple[Job, ...]
    dry_runs: tuple[SheetPreview, ...]
    directory: JobDirectory | None = None
    folder: Path | None = None
    report: dict[str, Any] | None = None
    refused: tuple[Finding, ...] = ()
    aligned: Aligned | None = None
    elsewhere: tuple[Finding, ...] = ()

    @property
    def most_power(self) -> float:
        """The material's ``max_power``, 1 where no material is known."""
        return 1.0 if self.directory is None else self.directory.most_power

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Which files of a job directory are not as they were made, and whether it is for another
        beam.
        """
        return (() if self.directory is None else self.directory.edits) + self.elsewhere

    def written(self, number: int) -> Job:
        """The job of sheet ``number`` as it was written, before it was turned."""
        aligned = self.aligned
        return aligned.written if aligned and aligned.number == number else self.jobs[number - 1]

    def sha256_of(self, number: int) -> str:
        """The digest of that job."""
        return self.written(number).sha256

    def back_of(self, number: int) -> str | None:
        """The digest of the job for the back of sheet ``number``; None for a back itself and a
        sheet that is worked from one side.
        """
        back = f"{Path(self.jobs[number - 1].name).stem}-back"
        names = [Path(job.name).stem for job in self.jobs]
        return self.sha256_of(names.index(back) + 1) if back in names else None

    def chosen(self, sheets: Sequence[int] | None) -> list[int]:
        """The numbers of the ``sheets`` (None: all); raises ``InputError`` for one that is
        missing.
        """
        if self.refused:
            why = " ".join(finding.sentence for finding in self.refused)
            raise InputError(f"{self.name} cannot be cut: {why}")
        chosen = list(sheets) if sheets else list(range(1, len(self.jobs) + 1))
        for number in chosen:
            if not 1 <= number <= len(self.jobs):
                raise InputError(f"{self.name} has no sheet {number}; it has {len(self.jobs)}.")
        return chosen


def prepare(
    thing: object,
    *,
    machine: MachineProfile | AnyPath | None = None,
    material: AnyPath | None = None,
    out: AnyPath | None = None,
    options: Mapping[str, object] | None = None,
    unread: bool = False,
    on_progress: Progress | None = None,
) -> Prepared:
    """Make whatever is missing between ``thing`` and the G-code of its sheets.

    ``machine`` and ``material`` default to those that the job or design names, then to the usual
    ones; ``out`` is the job directory to make (default ``jobs/NAME``); ``options`` are those of a
    fit. With ``unread`` a program that the controller would refuse is a finding and no error: it
    is forced, or the controller is asked. Raises :class:`~miurafab.errors.InputError` and its kin
    for whatever cannot be read or made.
    """
    tell = on_progress or (lambda fraction, note: None)
    path = as_path(thing, "The job") if isinstance(thing, str | os.PathLike) else None
    made = path is not None and (path.is_dir() or path.suffix.lower() in GCODE_SUFFIXES)
    if not made:
        return _from_value(thing, machine, material, out, options or {}, tell)
    assert path is not None
    _fitted_already(options or {}, path)
    if path.is_dir():
        from miurafab.workflow.job_directory import read_job

        read = read_job(path, unread=unread, on_progress=on_progress)
        return _from_directory(read, machine, unread)
    gcode = read_gcode(path)
    named = named_machine(gcode, path.parent) if machine is None else read_machine(machine)
    profile = named or assumed_machine(path)
    sheet = _dry_run(
        gcode, profile, unread=unread, on_share=lambda share: tell(share, f"timing {path.name}")
    )
    elsewhere = tuple(another_beam(maker_of(gcode, path.parent), profile, path.name))
    return Prepared(path.name, profile, (gcode,), (sheet,), None, path.parent, elsewhere=elsewhere)


def _fitted_already(options: Mapping[str, object], thing: object) -> None:
    shown = os.fspath(thing) if isinstance(thing, str | os.PathLike) else reprlib.repr(thing)
    for name in options:
        raise OptionError(name, f"is for a target or a design; {shown} is fitted already")


def _from_directory(
    job: JobDirectory, machine: MachineProfile | AnyPath | None, unread: bool = False
) -> Prepared:
    profile, dry_runs = job.machine, job.dry_runs
    if machine is not None:
        profile = read_machine(machine)
        dry_runs = tuple(
            _dry_run(each, profile, job.most_power, unread=unread) for each in job.jobs
        )
    name = job.path.resolve().name
    elsewhere = tuple(another_beam(job.machine, profile, name))
    return Prepared(name, profile, job.jobs, dry_runs, job, job.path, elsewhere=elsewhere)


def _from_value(
    thing: object,
    machine: MachineProfile | AnyPath | None,
    material: AnyPath | None,
    out: AnyPath | None,
    options: Mapping[str, object],
    tell: Progress,
) -> Prepared:
    """A job in memory, a pattern, or a target: what is missing is made and written."""
    from miurafab.origami.crease_pattern import CreasePattern
    from miurafab.origami.fitting.request import BED
    from miurafab.origami.fitting.result import FitResult
    from miurafab.workflow.bed_options import BedOptions
    from miurafab.workflow.design import Design, design

    if not isinstance(thing, str | os.PathLike):
        from miurafab.workflow.job_directory import JobDirectory
        from miurafab.workflow.sheet_job import SheetJob

        if isinstance(thing, JobDirectory | SheetJob):
            _fitted_already(options, thing)
            if isinstance(thing, SheetJob):
                thing = thing.write(out or JOBS / thing.name)
            return _from_directory(thing, machine)
    path = Path(thing) if isinstance(thing, str | os.PathLike) else None
    if isinstance(thing, CreasePattern | FitResult) or (
        path is not None and path.suffix.lower() == ".fold"
    ):
        from miurafab.workflow.patterns import as_pattern, check

        _fitted_already(options, thing)
        tell(0.1, "checking the pattern")
        pattern = as_pattern(thing)
        checked = check(pattern)
        name = path.stem if path is not None else pattern.name or "sheet"
        report, faults = checked.report(), refusals(checked.findings)
        return _from_pattern(
            pattern, path, name, report, faults, machine, material, out or JOBS / name, tell
        )
    of_bed: dict[str, Any] = {
        name: value for name, value in options.items() if name in declared(BedOptions)
    }
    options = {name: value for name, value in options.items() if name not in of_bed}
    wanted = thing if isinstance(thing, Design) and not options else design(thing, **options)
    from miurafab.workflow.bed_size import with_stock
    from miurafab.workflow.fit import fit

    by_bed: dict[str, Any] = {}
    if wanted.request.size_mm == BED:
        by_bed = {"machine": machine, "material": material}
    tell(0.0, "fitting")
    result = fit(
        wanted,
        on_progress=lambda fraction, note: tell(0.4 * fraction, note),
        **by_bed,
        **of_bed,
    )
    if result.status == "interrupted":
        raise KeyboardInterrupt  # the person wants no job now
    named = path is not None and path.suffix.lower() == ".toml"
    name = path.stem if path is not None and named else wanted.title
    directory = as_path(out or JOBS / name, "The job directory")
    machine = wanted.machine if machine is None else machine
    if result.pattern is None or result.status != "converged":
        profile = read_machine(machine)
        return Prepared(name, profile, (), (), report=result.report(), refused=result.findings)
    return _from_pattern(
        result.pattern,
        None,
        name,
        result.report(),
        (),
        machine,
        wanted.material if material is None else material,
        directory,
        tell,
        with_stock(wanted.layout, read_options(BedOptions, of_bed)),
    )


def _from_pattern(
    pattern: CreasePattern,
    file: Path | None,
    name: str,
    report: dict[str, Any],
    faults: tuple[Finding, ...],
    machine: MachineProfile | AnyPath | None,
    material: AnyPath | None,
    out: AnyPath,
    tell: Progress,
    options: LayoutOptions | None = None,
) -> Prepared:
    if faults:
        profile = read_machine(machine)
        return Prepared(name, profile, (), (), report=report, refused=faults)
    from miurafab.workflow.sheet_job import make_job

    job = make_job(
        pattern,
        name,
        machine,
        material,
        options,
        file=file,
        on_progress=lambda fraction, note: tell(0.4 + 0.4 * fraction, note),
    )
    directory = job.write(out, on_progress=lambda part, note: tell(0.8 + 0.2 * part, note))
    return replace(_from_directory(directory, None), name=name, report=report)


def _dry_run(
    job: Job,
    machine: MachineProfile,
    most_power: float = 1.0,
    *,
    unread: bool = False,
    on_share: Callable[[float], None] | None = None,
) -> SheetPreview:
    bed = (machine.bed.width_mm, machine.bed.height_mm)
    name = Path(job.name).stem
    return dry_run(name, job, machine, bed, most_power, unread=unread, on_share=on_share)
