"""A plan: a job that passed the checks which need no machine, with how it is to be sent."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

from miurafab.errors import GcodeError, InputError
from miurafab.findings import Finding
from miurafab.gcode.job import Job
from miurafab.gcode.program import Program
from miurafab.machine.judge_job import JudgedJob, judge_job
from miurafab.machine.preflight import raise_findings, require_known
from miurafab.machine.resume import Resumption
from miurafab.machine.room import fits_bed
from miurafab.options import (
    Choice,
    Either,
    Flag,
    Pair,
    Several,
    Text,
    check_options,
    declared,
    length,
    option,
)
from miurafab.profiles import MachineProfile
from miurafab.profiles.machine import Controller

_WAIT, _RESET = (declared(Controller)[name] for name in ("wait", "reset"))
AtPause = Literal["wait", "go on", "stop"]
Head = tuple[float, float]
"""A position of the head in the job's coordinates, mm."""
Box = tuple[float, float, float, float]
"""x0, y0, x1, y1 of what a job burns, mm."""
PLACES = {
    "front-left": (0.0, 0.0),
    "front": (0.5, 0.0),
    "front-right": (1.0, 0.0),
    "left": (0.0, 0.5),
    "centre": (0.5, 0.5),
    "right": (1.0, 0.5),
    "back-left": (0.0, 1.0),
    "back": (0.5, 1.0),
    "back-right": (1.0, 1.0),
}
"""The named places of a box: shares of its width (to the right) and of its height (to the back)."""
_HAS_OFFSETS = ("grbl-1.1", "grbl-0.9", "grblhal", "fluidnc")
_NO_CHECK_MODE = ("marlin", "hpgl")


@dataclass(frozen=True)
class SendOptions:
    """How a job is sent."""

    home: bool = option(
        Flag(), "Home the machine first, in the same conversation.", default=False, group="Start"
    )
    at: Head | str | None = option(
        Either(Choice(tuple(PLACES)), Pair(length(-math.inf), "X,Y", "0,0 or 10mm,5mm")),
        "Where the head stands: X,Y in the job's coordinates (0,0 is the job's origin), or a "
        "PLACE, which is X,Y of that place of the box around what the first sheet burns "
        f"({', '.join(PLACES)}).",
        group="Start",
        default_text="the controller's own work coordinates",
    )
    wait: float | None = option(
        _WAIT.kind, _WAIT.help, None, group="Start", default_text="as the machine's profile says"
    )
    reset: bool = option(_RESET.kind, _RESET.help, False, group="Start")
    check_mode: bool = option(
        Flag(), "Let the controller read the job without moving ($C).", False, group="Safety"
    )
    allow_m3: bool = option(
        Flag(), "Cut with M3: the beam stays on if the connection is lost.", False, group="Safety"
    )
    force: frozenset[str] = option(
        Several(Text("CODE"), frozenset),
        "Override the refusals with these codes.",
        frozenset(),
        group="Safety",
    )

    def __post_init__(self) -> None:
        check_options(self)


@dataclass(frozen=True)
class JobPlan:
    """A job that passed the checks which need no controller.

    ``at`` is where the head stands (None: the controller knows), ``sha256`` that of the file whose
    job this is, and ``back`` that of the job for the back of its sheet, None for a sheet that is
    worked from one side. ``program`` is None where it could not be read and that was forced or is
    left to check mode; ``forced`` are the refusals that were overridden. ``at_pause`` is what is
    done where the program waits for a person (``M0``): a person at the keys goes on (``wait``), the
    job goes on by itself (``go on``), or it ends, since nobody is there (``stop``). With ``homed``
    the job may lie anywhere within the machine's travel, from the origin that the controller tells.
    """

    job: Job
    machine: MachineProfile
    lines: int
    program: Program | None
    options: SendOptions
    resumption: Resumption | None
    forced: tuple[Finding, ...]
    at: Head | None
    sha256: str
    at_pause: AtPause = "stop"
    homed: bool = False
    back: str | None = None

    @property
    def wait(self) -> float:
        """The seconds that the board may take to start."""
        asked = self.options.wait
        return self.machine.controller.wait if asked is None else asked

    @property
    def reset(self) -> bool:
        """Whether the controller is reset even if it is at rest."""
        return self.options.reset or self.machine.controller.reset

    def with_head_at(self, at: Head | None) -> JobPlan:
        """The same for a head that stands ``at``."""
        return replace(self, at=at)


def head_at(at: Head | str, box: Box | None, name: str) -> Head:
    """Where the head stands, which is ``at`` or the place of that name of ``box``.

    Raises :class:`~miurafab.errors.InputError` for a place without a box.
    """
    if not isinstance(at, str):
        return at
    if box is None:
        raise InputError(
            f"{name} burns nothing, so it has no {at}; give `at` as X,Y, or leave it out."
        )
    (right, back), (x0, y0, x1, y1) = PLACES[at], box
    return x0 + right * (x1 - x0), y0 + back * (y1 - y0)


def put_in(burnt: str, back: str | None) -> str:
    """What somebody does before a job for a sheet with the job ``back`` on its back (None: none),
    where the job ``burnt`` has burnt on the sheet in the machine; both by their ``sha256``.
    """
    if back is None:
        return "put in fresh material"
    if back == burnt:
        return "turn the sheet over, left to right, and lay it by its three holes"
    return "put in the sheet whose back is burnt, turned over left to right, by its three holes"


def feeds_itself(machine: MachineProfile, back: str | None) -> bool:
    """Whether ``machine`` puts in the material of a job itself; see :func:`put_in`."""
    return machine.bed.roll_fed and back is None


def passed_checks(
    options: SendOptions, machine: MachineProfile, program: Program | None
) -> frozenset[str]:
    """The refusals of a job alone that ``options`` leave to somebody else: in check mode the
    controller is asked what it thinks of every line; once it is homed it says where the job's
    origin is, and whether all of it is there; and a person who puts the head at a place of the box
    says by that that the origin is no corner of the bed.
    """
    passed = {"m3", "program"} if options.check_mode else {"m3"} if options.allow_m3 else set()
    homed = options.home and machine.dialect in _HAS_OFFSETS
    if (homed or isinstance(options.at, str)) and fits_bed(program, machine):
        passed.add("bounds")
    return frozenset(passed)


def plan_job(
    job: Job,
    machine: MachineProfile,
    options: SendOptions | None = None,
    *,
    resumption: Resumption | None = None,
    most_power: float = 1.0,
    judged: JudgedJob | None = None,
    box: Box | None = None,
    sha256: str | None = None,
) -> JobPlan:
    """Check ``job`` by itself; raises :class:`~miurafab.errors.InputError` for what is wrong.

    In check mode the result lists the lines that the controller refuses. Most boards forget where
    they are when the port is opened: hence ``home``, and ``at`` for a machine without homing
    switches. With ``resumption`` the rest of ``job`` is sent; it needs ``home`` or ``at``.
    ``most_power`` is the most that the material takes, as a fraction of full power. ``judged`` is
    ``job`` as :func:`~miurafab.machine.judge_job.judge_job` read it for ``machine``, if that is
    known. ``box`` is that around what the whole sheet burns, where ``at`` names a place of it;
    ``sha256`` that of the file, if ``job`` is not its text.
    """
    options = options or SendOptions()
    placed = options.home or options.at is not None
    if resumption is not None and not resumption.chosen:
        if options.check_mode:
            raise InputError("A job is resumed or read in check mode, not both.")
        if not placed:
            raise InputError(
                f"To go on with {job.name} the machine must know where it is: home it first "
                "(`home`), or put the head at a known place and state it (`at` 0,0 is the origin "
                "of the job)."
            )
    if resumption is not None:
        job, judged, sha256 = resumption.job, None, resumption.sha256
    require_known(options.force)
    if options.check_mode and machine.dialect in _NO_CHECK_MODE:
        raise InputError(
            f"{machine.name} speaks {machine.dialect}, which has no check mode; a `dry_run` reads "
            "the job without a machine."
        )
    if placed and machine.dialect == "hpgl":
        raise InputError(
            f"{machine.name} speaks hpgl, which starts at the origin set at the cutter's panel; "
            "leave `home` and `at` out."
        )
    if judged is None:
        judged = judge_job(job, machine, most_power=most_power)
    passed = passed_checks(options, machine, judged.program)
    findings = [finding for finding in judged.findings if finding.code not in passed]
    forced = raise_findings(findings, options.force, GcodeError)
    return JobPlan(
        job,
        machine,
        judged.lines,
        judged.program,
        options,
        resumption,
        forced,
        None if options.at is None else head_at(options.at, box, job.name),
        sha256 or job.sha256,
        homed=options.home and "bounds" in passed,
    )
