"""Cutting: whatever is missing on the way from a THING to a finished cut is made, then streamed.

THING is a job directory, a G-code file, a pattern (.fold), a design (.toml) or a TARGET. Everything
is made and checked before the port is opened; then the sheets go one after another.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from miurafab.errors import InputError
from miurafab.gcode.job import Job
from miurafab.machine.sender import Progress as StreamProgress
from miurafab.machine.sender import StreamResult, plan_job, stream_job
from miurafab.origami.audit import audit
from miurafab.origami.fit import fit
from miurafab.profiles import MachineProfile, load_machine
from miurafab.workflow.design import design, load_pattern, save_pattern
from miurafab.workflow.dry_run import SheetPreview, dry_run, read_gcode
from miurafab.workflow.job_directory import JobDirectory, read_job, write_job
from miurafab.workflow.preview import ASSUMED_MACHINE, named_machine

GCODE_SUFFIXES = (".nc", ".gcode", ".ngc", ".tap")
DEFAULT_MATERIAL = "card-250"
JOBS = Path("jobs")
"""Where jobs are made unless told otherwise."""


@dataclass(frozen=True)
class Prepared:
    """What will be cut: the jobs with their dry runs and the machine, and how they were made.

    ``report`` is that of the fit or the check, None for what came as G-code or a job directory;
    ``refusal`` says why nothing will be cut (a fit that failed, a pattern that is not valid).
    """

    name: str
    machine: MachineProfile
    jobs: tuple[Job, ...]
    dry_runs: tuple[SheetPreview, ...]
    directory: JobDirectory | None = None
    report: dict[str, Any] | None = None
    refusal: str | None = None


def prepare(
    thing: str,
    *,
    machine: str | None = None,
    material: str | None = None,
    out: Path | None = None,
    options: dict[str, str | None] | None = None,
    on_progress: Callable[[float, str], None] | None = None,
) -> Prepared:
    """Make whatever is missing between ``thing`` and the G-code of its sheets.

    ``machine`` and ``material`` default to what the job or design names, then to the common ones;
    ``out`` is the job directory to make (default ``jobs/NAME``); ``options`` are those of a fit.
    Raises :class:`~miurafab.errors.InputError` and its kin for whatever cannot be read or made.
    """
    path = Path(thing)
    tell = on_progress or (lambda fraction, note: None)
    if path.is_dir():
        job = read_job(path)
        profile = job.machine if machine is None else load_machine(machine)
        dry_runs = job.dry_runs
        if machine is not None:
            dry_runs = tuple(_dry_run(each, profile) for each in job.jobs)
        return Prepared(path.resolve().name, profile, job.jobs, dry_runs, job)
    if path.suffix.lower() in GCODE_SUFFIXES:
        gcode = read_gcode(path)
        named = named_machine(gcode, path.parent) if machine is None else load_machine(machine)
        profile = named or load_machine(ASSUMED_MACHINE)
        return Prepared(path.name, profile, (gcode,), (_dry_run(gcode, profile),))
    if path.suffix.lower() == ".fold":
        pattern, surface, _ = load_pattern(path)
        tell(0.1, "checking the pattern")
        checked = audit(pattern, surface)
        return _from_pattern(
            path, path.stem, checked.report(), checked.valid, machine, material, out, tell
        )
    wanted = design(thing, **(options or {}))
    tell(0.0, "fitting")
    result = fit(wanted.request, lambda fraction, note: tell(0.4 * fraction, note))
    name = path.stem if path.suffix else wanted.title
    directory = out or JOBS / name
    if result.pattern is None or result.status != "converged":
        return Prepared(
            name,
            load_machine(machine or wanted.machine or ASSUMED_MACHINE),
            (),
            (),
            report=result.report(),
            refusal=result.advice,
        )
    directory.mkdir(parents=True, exist_ok=True)
    fold = directory / f"{name}.fold"
    save_pattern(result.pattern, fold, wanted.title)
    return _from_pattern(
        fold,
        name,
        result.report(),
        True,
        machine or wanted.machine,
        material or wanted.material,
        directory,
        tell,
    )


def _from_pattern(
    fold: Path,
    name: str,
    report: dict[str, Any],
    valid: bool,
    machine: str | None,
    material: str | None,
    out: Path | None,
    tell: Callable[[float, str], None],
) -> Prepared:
    chosen = machine or ASSUMED_MACHINE
    if not valid:
        return Prepared(
            name, load_machine(chosen), (), (), report=report, refusal=str(report["advice"])
        )
    directory = write_job(
        fold,
        out or JOBS / name,
        chosen,
        material or DEFAULT_MATERIAL,
        lambda fraction, note: tell(0.4 + 0.6 * fraction, note),
    )
    return Prepared(name, directory.machine, directory.jobs, directory.dry_runs, directory, report)


def _dry_run(job: Job, machine: MachineProfile) -> SheetPreview:
    bed = (machine.bed.width_mm, machine.bed.height_mm)
    return dry_run(Path(job.name).stem, job, machine, bed)


@dataclass(frozen=True)
class CutSheet:
    """One sheet that was cut: ``estimated_s`` before, and what the sender says after."""

    name: str
    lines: int
    cut_mm: float
    travel_mm: float
    estimated_s: float
    result: StreamResult


def cut(
    prepared: Prepared,
    *,
    port: str,
    sheets: Sequence[int] | None = None,
    force: frozenset[str] = frozenset(),
    allow_m3: bool = False,
    check_mode: bool = False,
    virtual_speed: float | None = None,
    before_sheet: Callable[[int, int], None] | None = None,
    on_progress: Callable[[int, StreamProgress], None] | None = None,
) -> tuple[CutSheet, ...]:
    """Stream the sheets of ``prepared`` (or those numbered in ``sheets``, from 1) to ``port``.

    Every sheet is checked before the first is started. ``before_sheet`` is called with the number
    of the sheet and how many there are, before each: the place to ask for fresh material. The
    journal and the transcript go beside the job. Raises what
    :func:`~miurafab.machine.sender.stream_job` raises.
    """
    if prepared.refusal is not None:
        raise InputError(f"{prepared.name} cannot be cut: {prepared.refusal}")
    chosen = list(sheets) if sheets else list(range(1, len(prepared.jobs) + 1))
    for number in chosen:
        if not 1 <= number <= len(prepared.jobs):
            raise InputError(f"{prepared.name} has no sheet {number}; it has {len(prepared.jobs)}.")
    for number in chosen:
        plan_job(
            prepared.jobs[number - 1],
            prepared.machine,
            force=force,
            allow_m3=allow_m3,
            check_mode=check_mode,
        )
    done = []
    for number in chosen:
        job = prepared.jobs[number - 1]
        expected = prepared.dry_runs[number - 1]
        if before_sheet is not None:
            before_sheet(number, len(prepared.jobs))
        result = stream_job(
            job,
            prepared.machine,
            port,
            journal_path=_beside(prepared, job, ".journal"),
            transcript_path=_beside(prepared, job, ".transcript"),
            on_progress=None if on_progress is None else _numbered(on_progress, number),
            force=force,
            allow_m3=allow_m3,
            check_mode=check_mode,
            virtual_speed=virtual_speed,
        )
        done.append(
            CutSheet(
                expected.name,
                result.lines,
                expected.cut_mm,
                expected.travel_mm,
                expected.seconds,
                result,
            )
        )
    return tuple(done)


def _numbered(
    on_progress: Callable[[int, StreamProgress], None], number: int
) -> Callable[[StreamProgress], None]:
    return lambda progress: on_progress(number, progress)


def _beside(prepared: Prepared, job: Job, suffix: str) -> Path | None:
    if prepared.directory is None:
        return None
    return prepared.directory.path / f"{Path(job.name).stem}{suffix}"
