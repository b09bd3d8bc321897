"""The pre-flight: what must be true of the controller before the beam may be on.

Every check has a code, says in one sentence what differs, and can be overridden by that code
(``force``). These checks come before a line of the job is sent; those of the job alone
(:mod:`~miurafab.machine.judge_job`) come before any port is opened. Nothing here changes anything:
no setting is written, no lock is opened.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from miurafab.errors import InputError, MiurafabError
from miurafab.findings import RULES, Finding, refusals
from miurafab.gcode.job import Job
from miurafab.gcode.program import Program
from miurafab.grbl.events import StatusReport
from miurafab.grbl.settings import Settings, profile_settings
from miurafab.machine.judge_words import in_line, line_of_mist
from miurafab.machine.room import first_outside
from miurafab.profiles import MachineProfile

CHECKS = tuple(code for code, rule in RULES.items() if rule.forceable)
"""The codes that ``force`` takes."""


def raise_findings(
    findings: Iterable[Finding], force: frozenset[str], error: type[MiurafabError]
) -> tuple[Finding, ...]:
    """Raise ``error`` for the first refusal that is not forced; returns the forced refusals."""
    forced = []
    for finding in refusals(findings):
        if finding.code not in force:
            way = (
                f" (`force` {finding.code} overrides this check)" if finding.code in CHECKS else ""
            )
            raise error(f"{finding.sentence.rstrip('.')}{way}.")
        forced.append(finding)
    return tuple(forced)


def require_known(force: frozenset[str]) -> None:
    """Raise :class:`~miurafab.errors.InputError` for a code that cannot be forced."""
    for code in sorted(force.difference(CHECKS)):
        rule = RULES.get(code)
        if rule is None:
            raise InputError(
                f"'{code}' is not a check that can be forced; {', '.join(CHECKS)} are."
            )
        if rule.severity == "refusal":
            raise InputError(f"The check '{code}' cannot be forced: {rule.meaning}.")
        raise InputError(f"'{code}' is a {rule.severity} and stops nothing; leave it out.")


def check_status(
    status: StatusReport, *, restarted: bool = False, lost: bool = False
) -> Iterator[Finding]:
    """The checks ``idle``, ``beam`` and ``position``; ``restarted``: the opening of the port reset
    the board; ``lost``: it restarted by itself later, and nobody has said where it stands.
    """
    if status.state == "Alarm" and restarted:
        yield Finding(
            "idle",
            "The opening of the port restarted the board, which is locked until it is homed; an "
            "unlocking by another command is forgotten, so `home` it in the same conversation.",
        )
    elif status.state != "Idle":
        yield Finding(
            "idle",
            f"The controller is in state {status.state}, not Idle; wait until it is done, or look "
            "at the machine, then home or unlock it.",
        )
    if status.beam_on:
        yield Finding(
            "beam",
            "The controller reports the beam on before the job has begun; look for what lit it, "
            "such as a startup block ($N).",
        )
    if lost:
        yield Finding(
            "position",
            "The controller restarted by itself since the last job, and may have lost its place "
            "and its origin; `home` it, or say where the head stands (`at`).",
        )


def check_settings(machine: MachineProfile, settings: Settings) -> Iterator[Finding]:
    """The checks ``laser-mode``, ``s-range`` and ``settings``."""
    expected = profile_settings(machine)
    codes = {30: "s-range", 31: "s-range", 32: "laser-mode"}
    for code in ("laser-mode", "s-range", "settings"):
        differences = settings.differences(
            {n: value for n, value in expected.items() if codes.get(n, "settings") == code}
        )
        if differences:
            yield Finding(
                code,
                f"The controller is not set up as {machine.name} says: "
                f"{', '.join(map(str, differences))}; set it so, or choose the profile of this "
                "machine.",
            )


def check_build(job: Job, machine: MachineProfile, flags: str) -> Iterator[Finding]:
    """The check ``program`` for what the firmware was built with, by its answer to ``$I``.

    GRBL 1.1 knows M7 only if built with mist coolant, the flag M (``report.c``).
    """
    if machine.dialect != "grbl-1.1" or "M" in flags:
        return
    line = line_of_mist(job)
    if line is not None:
        yield Finding(
            "program",
            f"{in_line(job.name, line)} switches the air with M7, which this controller was built "
            "without; M8 is the air that it knows.",
            f"{job.name}:{line}",
        )


def check_travel(
    program: Program,
    settings: Settings,
    work_offset: tuple[float, ...] | None,
    *,
    homed: bool = False,
) -> Iterator[Finding]:
    """The check ``travel``: with soft limits, or once it is ``homed``, GRBL's machine coordinates
    run from -travel to 0 (``limits.c``). ``work_offset`` is what the controller adds to the job's
    coordinates.
    """
    values = settings.values
    if not (values.get(20) or homed) or not len(program):
        return
    # Homing need not touch Z; soft limits hold for every axis that moves.
    deep = values.get(20) and (program.end[:, 2] != program.start[0, 2]).any()
    axes = 3 if deep else 2
    offset = np.array((*(work_offset or ()), 0.0, 0.0, 0.0)[:axes])
    travel = np.array([values.get(130 + axis, np.inf) for axis in range(axes)])
    ends = program.end[:, :axes] + offset
    outside = first_outside(ends, -travel, np.zeros(axes))
    if outside is not None:
        index, count = outside
        line = int(program.line[index])
        place = " ".join(
            f"{axis}{value:.3f}" for axis, value in zip("XYZ", ends[index], strict=False)
        )
        yield Finding(
            "travel",
            f"{in_line(program.name, line, count)} would move the machine to {place} in its "
            "own coordinates, past its soft limits ($20) or its travel ($130 to $132); home it and "
            "set the work origin so that the sheet lies within the travel.",
            f"{program.name}:{line}",
        )
