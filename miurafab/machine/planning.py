"""What can be said of a job before any port is opened: its lines, its program, and its hazards.

A :class:`JobPlan` is a job that passed, with how it is to be sent.
"""

from __future__ import annotations

from dataclasses import dataclass

from miurafab.errors import GcodeError, InputError
from miurafab.gcode.job import Job
from miurafab.gcode.program import Program
from miurafab.gcode.reading import read_program
from miurafab.machine.preflight import (
    Finding,
    check_lines,
    check_program,
    raise_findings,
    require_known,
)
from miurafab.machine.resume import Resumption
from miurafab.marlin.connection import FRAME
from miurafab.profiles import MachineProfile

_NO_CHECK_MODE = ("marlin", "hpgl")


@dataclass(frozen=True)
class JobPlan:
    """A job that passed the checks which need no controller.

    ``program`` is None where it could not be read and that was forced or is left to check mode;
    ``remarks`` say what was forced.
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
    remarks: tuple[str, ...]


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
    program: Program | None = None,
) -> JobPlan:
    """Check ``job`` by itself; raises :class:`~miurafab.errors.InputError` for what is wrong.

    ``force`` names checks to override (:data:`~miurafab.machine.preflight.CHECKS`). With
    ``check_mode`` the controller will only read the job (``$C``): nothing moves, and refused lines
    are gathered in the result. With ``home`` the machine is homed first, in the same conversation:
    most boards forget where they are when the port is opened. ``at`` states where the head stands
    (X, Y in mm, in the job's coordinates), for a machine without homing switches. With
    ``resumption`` the rest of ``job`` is sent; it needs one of the two. ``most_power`` is the most
    that the material takes, as a fraction of full power. ``program`` is ``job`` as
    :func:`~miurafab.gcode.reading.read_program` read it for ``machine``, if somebody has done so.
    """
    if resumption is not None:
        if check_mode:
            raise InputError("A job is resumed or read in check mode, not both.")
        if not home and at is None:
            raise InputError(
                f"To go on with {job.name} the machine must know where it is: home it first "
                "(--home), or put the head at a known place and state it (--at 0,0 is the origin "
                "of the job)."
            )
        job, program = resumption.job, None
    require_known(force)
    if check_mode and machine.dialect in _NO_CHECK_MODE:
        raise InputError(
            f"{machine.name} speaks {machine.dialect}, which has no check mode; a --dry-run reads "
            "the job without a machine."
        )
    if (home or at is not None) and machine.dialect == "hpgl":
        raise InputError(
            f"{machine.name} speaks hpgl, which starts at the origin set at the cutter's panel; "
            "leave --home and --at out."
        )
    count, program, findings = examine_job(
        job,
        machine,
        allow_m3=allow_m3,
        check_mode=check_mode,
        most_power=most_power,
        program=program,
    )
    remarks = raise_findings(findings, force)
    return JobPlan(job, machine, count, program, force, check_mode, home, at, resumption, remarks)


def examine_job(
    job: Job,
    machine: MachineProfile,
    *,
    allow_m3: bool = False,
    check_mode: bool = False,
    most_power: float = 1.0,
    program: Program | None = None,
) -> tuple[int, Program | None, list[Finding]]:
    """The number of lines of ``job``, what it does, and all that speaks against starting it.

    ``program`` as for :func:`plan_job`.

    Raises :class:`~miurafab.errors.GcodeError` for a line that cannot be sent at all.
    """
    count, findings = 0, list[Finding]()
    if machine.dialect != "hpgl":
        lines = job.send_lines(longest_line(machine))
        count, findings = check_lines(job.name, lines, machine, allow_m3=allow_m3 or check_mode)
    try:
        program = read_program(job, machine) if program is None else program
    except GcodeError as error:
        # In check mode the controller itself is asked what it thinks of every line.
        if not check_mode:
            findings.append(Finding("program", error))
    else:
        findings.extend(check_program(program, machine, most_power=most_power))
        count = len(program.line_number)
    return count, program, findings


def longest_line(machine: MachineProfile) -> int:
    """How many characters of code a line may have, besides what the dialect adds to it."""
    return machine.controller.line_chars - (FRAME if machine.dialect == "marlin" else 0)
