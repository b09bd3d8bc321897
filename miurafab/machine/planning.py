"""A plan: a job that passed the checks which need no machine, with how it is to be sent."""

from __future__ import annotations

from dataclasses import dataclass

from miurafab.errors import GcodeError, InputError
from miurafab.findings import Finding
from miurafab.gcode.job import Job
from miurafab.gcode.program import Program
from miurafab.machine.judge_job import JudgedJob, judge_job
from miurafab.machine.preflight import raise_findings, require_known
from miurafab.machine.resume import Resumption
from miurafab.profiles import MachineProfile

_NO_CHECK_MODE = ("marlin", "hpgl")


@dataclass(frozen=True)
class JobPlan:
    """A job that passed the checks which need no controller.

    ``program`` is None where it could not be read and that was forced or is left to check mode;
    ``forced`` are the refusals that were overridden.
    """

    job: Job
    machine: MachineProfile
    lines: int
    program: Program | None
    force: frozenset[str]
    check_mode: bool
    home: bool
    at: tuple[float, float] | None
    resumption: Resumption | None
    forced: tuple[Finding, ...]


def plan_job(
    job: Job,
    machine: MachineProfile,
    *,
    force: frozenset[str] = frozenset(),
    allow_m3: bool = False,
    check_mode: bool = False,
    home: bool = False,
    at: tuple[float, float] | None = None,
    resumption: Resumption | None = None,
    most_power: float = 1.0,
    judged: JudgedJob | None = None,
) -> JobPlan:
    """Check ``job`` by itself; raises :class:`~miurafab.errors.InputError` for what is wrong.

    ``force`` names checks to override (:data:`~miurafab.machine.preflight.CHECKS`). With
    ``check_mode`` the controller only reads the job (``$C``): nothing moves, and the result lists
    the refused lines. With ``home`` the machine is homed first, in the same conversation: most
    boards forget where they are when the port is opened. ``at`` states where the head stands (X, Y
    in mm, in the job's coordinates), for a machine without homing switches. With ``resumption``
    the rest of ``job`` is sent; it needs ``home`` or ``at``. ``most_power`` is the most that the
    material takes, as a fraction of full power. ``judged`` is ``job`` as
    :func:`~miurafab.machine.judge_job.judge_job` read it for ``machine``, if that is known.
    """
    if resumption is not None:
        if check_mode:
            raise InputError("A job is resumed or read in check mode, not both.")
        if not home and at is None:
            raise InputError(
                f"To go on with {job.name} the machine must know where it is: home it first "
                "(`home`), or put the head at a known place and state it (`at` 0,0 is the origin "
                "of the job)."
            )
        job, judged = resumption.job, None
    require_known(force)
    if check_mode and machine.dialect in _NO_CHECK_MODE:
        raise InputError(
            f"{machine.name} speaks {machine.dialect}, which has no check mode; a `dry_run` reads "
            "the job without a machine."
        )
    if (home or at is not None) and machine.dialect == "hpgl":
        raise InputError(
            f"{machine.name} speaks hpgl, which starts at the origin set at the cutter's panel; "
            "leave `home` and `at` out."
        )
    if judged is None:
        judged = judge_job(job, machine, most_power=most_power)
    # In check mode the controller itself is asked what it thinks of every line.
    passed = {"m3", "program"} if check_mode else {"m3"} if allow_m3 else set()
    findings = [finding for finding in judged.findings if finding.code not in passed]
    forced = raise_findings(findings, force, GcodeError)
    return JobPlan(
        job, machine, judged.lines, judged.program, force, check_mode, home, at, resumption, forced
    )
