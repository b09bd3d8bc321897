"""Preparing a cut: from a THING to the G-code of its sheets.

THING is a job directory, a G-code file, a pattern (.fold), a design (.toml) or a TARGET.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from miurafab.errors import OptionError
from miurafab.findings import Finding
from miurafab.gcode.job import Job
from miurafab.profiles import MachineProfile, load_machine
from miurafab.workflow.dry_run import SheetPreview, dry_run, read_gcode
from miurafab.workflow.preview import ASSUMED_MACHINE, assumed_machine, named_machine

# What fits and lays out is imported where it is needed: loading it
# takes longer than all that cuts.
if TYPE_CHECKING:
    from miurafab.fabrication.options import LayoutOptions
    from miurafab.workflow.job_directory import JobDirectory

GCODE_SUFFIXES = (".nc", ".gcode", ".ngc", ".tap", ".plt")
DEFAULT_MATERIAL = "card-250"
JOBS = Path("jobs")
"""Where jobs are made unless told otherwise."""


@dataclass(frozen=True)
class Prepared:
    """What will be cut: the jobs with their dry runs and the machine, and how they were made.

    ``folder`` is where the journals go. ``report`` is that of the fit or the check, None for what
    came as G-code or a job directory; ``refused`` are the findings of a fit that failed or a
    pattern that is not valid, for which nothing will be cut.
    """

    name: str
    machine: MachineProfile
    jobs: tuple[Job, ...]
    dry_runs: tuple[SheetPreview, ...]
    directory: JobDirectory | None = None
    folder: Path | None = None
    report: dict[str, Any] | None = None
    refused: tuple[Finding, ...] = ()

    @property
    def most_power(self) -> float:
        """The material's ``max_power``, 1 where no material is known."""
        return 1.0 if self.directory is None else self.directory.most_power


def prepare(
    thing: str,
    *,
    machine: str | None = None,
    material: str | None = None,
    out: Path | None = None,
    options: Mapping[str, object] | None = None,
    on_progress: Callable[[float, str], None] | None = None,
) -> Prepared:
    """Make whatever is missing between ``thing`` and the G-code of its sheets.

    ``machine`` and ``material`` default to what the job or design names, then to the common ones;
    ``out`` is the job directory to make (default ``jobs/NAME``); ``options`` are those of a fit.
    Raises :class:`~miurafab.errors.InputError` and its kin for whatever cannot be read or made.
    """
    path = Path(thing)
    for name in options or {}:
        if path.is_dir() or path.suffix.lower() in (*GCODE_SUFFIXES, ".fold"):
            raise OptionError(name, f"is for a target or a design; {thing} is fitted already")
    tell = on_progress or (lambda fraction, note: None)
    if path.is_dir():
        from miurafab.workflow.job_directory import read_job

        job = read_job(path)
        profile = job.machine if machine is None else load_machine(machine)
        dry_runs = job.dry_runs
        if machine is not None:
            dry_runs = tuple(_dry_run(each, profile, job.most_power) for each in job.jobs)
        return Prepared(path.resolve().name, profile, job.jobs, dry_runs, job, path)
    if path.suffix.lower() in GCODE_SUFFIXES:
        gcode = read_gcode(path)
        named = named_machine(gcode, path.parent) if machine is None else load_machine(machine)
        profile = named or assumed_machine(path)
        return Prepared(
            path.name, profile, (gcode,), (_dry_run(gcode, profile),), None, path.parent
        )
    from miurafab.origami.fitting.fit import fit
    from miurafab.origami.verify import audit
    from miurafab.workflow.design import design, load_pattern, save_pattern

    if path.suffix.lower() == ".fold":
        pattern, surface, _ = load_pattern(path)
        tell(0.1, "checking the pattern")
        checked = audit(pattern, surface)
        return _from_pattern(
            path, path.stem, checked.report(), checked.findings, machine, material, out, tell
        )
    wanted = design(thing, **(options or {}))
    tell(0.0, "fitting")
    result = fit(wanted.request, lambda fraction, note: tell(0.4 * fraction, note))
    name = path.stem if path.suffix.lower() == ".toml" else wanted.title
    directory = out or JOBS / name
    if result.pattern is None or result.status != "converged":
        return Prepared(
            name,
            load_machine(machine or wanted.machine or ASSUMED_MACHINE),
            (),
            (),
            report=result.report(),
            refused=result.findings,
        )
    directory.mkdir(parents=True, exist_ok=True)
    fold = directory / f"{name}.fold"
    save_pattern(result.pattern, fold, wanted.title)
    return _from_pattern(
        fold,
        name,
        result.report(),
        (),
        machine or wanted.machine,
        material or wanted.material,
        directory,
        tell,
        wanted.layout,
    )


def _from_pattern(
    fold: Path,
    name: str,
    report: dict[str, Any],
    faults: tuple[Finding, ...],
    machine: str | None,
    material: str | None,
    out: Path | None,
    tell: Callable[[float, str], None],
    options: LayoutOptions | None = None,
) -> Prepared:
    chosen = machine or ASSUMED_MACHINE
    if faults:
        return Prepared(name, load_machine(chosen), (), (), report=report, refused=faults)
    from miurafab.workflow.job_directory import write_job

    directory = write_job(
        fold,
        out or JOBS / name,
        chosen,
        material or DEFAULT_MATERIAL,
        lambda fraction, note: tell(0.4 + 0.6 * fraction, note),
        options=options,
    )
    return Prepared(
        name,
        directory.machine,
        directory.jobs,
        directory.dry_runs,
        directory,
        directory.path,
        report,
    )


def _dry_run(job: Job, machine: MachineProfile, most_power: float = 1.0) -> SheetPreview:
    bed = (machine.bed.width_mm, machine.bed.height_mm)
    return dry_run(Path(job.name).stem, job, machine, bed, most_power)
