"""What must be true before the beam may be on: one named check for each way to ruin a sheet.

Every check has a name, says in one sentence what differs, and can be overridden by that name
(``force``). The checks of the job alone come before any port is opened; those of the controller
before a line of the job is sent. Nothing here changes anything: no setting is written, no lock
is opened.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from miurafab.errors import ControllerError, GcodeError, InputError, MiurafabError
from miurafab.gcode.job import SendLine
from miurafab.gcode.program import BEAM_M3, DWELL, Program
from miurafab.grbl.events import StatusReport
from miurafab.grbl.settings import Settings, profile_settings
from miurafab.machine.loose_parts import burnt_on_loose_pieces, open_outlines, says_operations
from miurafab.profiles import MachineProfile

CHECKS = {
    "m3": "the job arms the laser with M4, which goes dark whenever motion stops",
    "program": "the job is a program that GRBL 1.1 would run without an error",
    "bounds": "every move of the job lies on the bed",
    "islands": "nothing is burnt inside an outline that is cut through already",
    "outlines": "every outline that is cut through closes",
    "dwell": "the beam is off in every dwell (G4)",
    "power": "no S word is above the machine's largest",
    "material": "no S word is above the most that the material takes",
    "idle": "the controller is idle",
    "beam": "the beam is off",
    "laser-mode": "laser mode ($32) suits the tool",
    "s-range": "the controller's S range ($30, $31) is the profile's",
    "settings": "the other settings are those of the profile",
    "travel": "the job lies within the soft limits, from where the machine stands",
}
"""The names of the checks, and what each asserts."""

_TOLERANCE = 1e-3  # mm; G-code is written with three decimals
_M3 = re.compile(rb"M0*3(?:\.0*)?(?![\d.])", re.IGNORECASE)


@dataclass(frozen=True)
class Finding:
    """A check that failed: its ``name``, and the ``error`` that says what differs."""

    name: str
    error: MiurafabError


def raise_findings(findings: Iterable[Finding], force: frozenset[str]) -> tuple[str, ...]:
    """Raise the first finding that is not forced; returns the sentences of the forced ones."""
    forced = []
    for finding in findings:
        sentence = str(finding.error)
        if finding.name not in force:
            raise type(finding.error)(
                f"{sentence.rstrip('.')} (--force {finding.name} overrides this check)."
            )
        forced.append(sentence)
    return tuple(forced)


def require_known(force: frozenset[str]) -> None:
    """Raise :class:`~miurafab.errors.InputError` for a name that is no check."""
    for name in sorted(force - CHECKS.keys()):
        raise InputError(f"'{name}' is not a check that can be forced; {', '.join(CHECKS)} are.")


def check_lines(
    name: str, lines: Iterable[SendLine], machine: MachineProfile, *, allow_m3: bool
) -> tuple[int, list[Finding]]:
    """How many lines there are, and the check ``m3`` over them.

    Raises what ``lines`` raises: a line that cannot be sent is never let through.
    """
    findings: list[Finding] = []
    count = 0
    for line in lines:
        count += 1
        if not findings and not allow_m3 and machine.tool.kind == "laser" and _M3.search(line.data):
            error = GcodeError(
                f"{name}, line {line.number} arms the laser with M3, which keeps the beam on, "
                "standing still, if the link to the machine is lost; use M4, or allow M3 "
                "explicitly and stay beside the machine"
            )
            findings.append(Finding("m3", error))
    return count, findings


def check_program(
    program: Program, machine: MachineProfile, *, most_power: float = 1.0
) -> Iterator[Finding]:
    """The checks of what the job does, which need no controller.

    ``most_power`` is the most that the material takes, as a fraction of full power.
    """
    size = np.array([machine.bed.width_mm, machine.bed.height_mm])
    ends = program.end[:, :2]
    for index in _first_outside(ends, np.zeros(2), size):
        x, y = ends[index]
        yield Finding(
            "bounds",
            GcodeError(
                f"{program.name}, line {program.line[index]} moves to X{x:g} Y{y:g}, off the bed "
                f"of {machine.name} ({size[0]:g} x {size[1]:g} mm)"
            ),
        )
    full = machine.tool.s_max
    if machine.tool.kind == "laser":
        yield from _loose(program)
        yield from _dwells(program)
        if most_power < 1.0:
            most = f"S{most_power * full:.0f} that the material takes (its max_power)"
            yield from _power("material", program, most_power * full + 0.5, most)
    yield from _power("power", program, full, f"{full} that is full power on {machine.name}")


def _first_outside(
    ends: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
) -> list[int]:
    """The index of the first of ``ends`` (n, 2) that lies outside the box, if any."""
    outside = ((ends < low - _TOLERANCE) | (ends > high + _TOLERANCE)).any(axis=1)
    return [int(index) for index in np.flatnonzero(outside)[:1]]


def _power(name: str, program: Program, most: float, words: str) -> Iterator[Finding]:
    """The check ``name``: no move has more power than ``most``, which ``words`` tell."""
    for index in np.flatnonzero(program.power > most)[:1]:
        yield Finding(
            name,
            GcodeError(
                f"{program.name}, line {program.line[index]} asks for S{program.power[index]:g}, "
                f"more than the {words}"
            ),
        )


def _loose(program: Program) -> Iterator[Finding]:
    """The first stroke on a loose piece and the first outline that does not close, if any."""
    if not says_operations(program):
        return
    for fault in islice(burnt_on_loose_pieces(program), 1):
        yield Finding(
            "islands",
            GcodeError(
                f"{program.name}, line {fault.line} burns inside the outline that is cut through "
                f"from line {fault.outline_line} on: that piece lies loose by then and may catch "
                "fire; cut outlines last"
            ),
        )
    for fault in islice(open_outlines(program), 1):
        yield Finding(
            "outlines",
            GcodeError(
                f"{program.name}, line {fault.line} ends the outline begun in line "
                f"{fault.outline_line}, {fault.gap_mm:.2f} mm from where that began: the piece "
                "would hang on by a thread; close it"
            ),
        )


def _dwells(program: Program) -> Iterator[Finding]:
    """A dwell burns in place with what the last event set, or the last M3 move if it came later."""
    at, power = 0, 0.0
    for move, kind, new, line in zip(
        program.event_move.tolist(),
        program.event_kind.tolist(),
        program.event_power.tolist(),
        program.event_line.tolist(),
        strict=True,
    ):
        if move > at:
            at = move
            still = program.spindle[move - 1] == BEAM_M3
            power = float(program.power[move - 1]) if still else 0.0
        if new == new:  # NaN: as before
            power = new
        if kind == DWELL and power > 0:
            yield Finding(
                "dwell",
                GcodeError(
                    f"{program.name}, line {line} waits with the beam on at S{power:g}, which "
                    "burns a hole or starts a fire; switch it off (M5) before the G4"
                ),
            )
            return


def check_status(status: StatusReport) -> Iterator[Finding]:
    """The checks ``idle`` and ``beam``."""
    if status.state != "Idle":
        yield Finding(
            "idle",
            ControllerError(
                f"The controller is in state {status.state}, not Idle; wait until it is done, or "
                "look at the machine, then home or unlock it"
            ),
        )
    if status.beam_on:
        yield Finding(
            "beam",
            ControllerError(
                "The controller reports the beam on before the job has begun; switch the laser off "
                "at the machine and reset the controller"
            ),
        )


def check_settings(machine: MachineProfile, settings: Settings) -> Iterator[Finding]:
    """The checks ``laser-mode``, ``s-range`` and ``settings``."""
    expected = profile_settings(machine)
    names = {30: "s-range", 31: "s-range", 32: "laser-mode"}
    for name in ("laser-mode", "s-range", "settings"):
        wanted = {n: v for n, v in expected.items() if names.get(n, "settings") == name}
        differences = settings.differences(wanted)
        if differences:
            listed = ", ".join(map(str, differences))
            yield Finding(
                name,
                ControllerError(
                    f"The controller is not set up as {machine.name} says: {listed}; set it so, or "
                    "choose the profile of this machine"
                ),
            )


def check_travel(
    program: Program, settings: Settings, work_offset: tuple[float, ...] | None
) -> Iterator[Finding]:
    """The check ``travel``: with soft limits, GRBL's machine coordinates run from -travel to 0
    (``limits.c``). ``work_offset`` is what the controller adds to the job's coordinates.
    """
    values = settings.values
    if not values.get(20) or not len(program):
        return
    offset = np.array((work_offset or (0.0, 0.0))[:2])
    travel = np.array([values.get(130, np.inf), values.get(131, np.inf)])
    ends = program.end[:, :2] + offset
    for index in _first_outside(ends, -travel, np.zeros(2)):
        x, y = ends[index]
        yield Finding(
            "travel",
            ControllerError(
                f"{program.name}, line {program.line[index]} would move the machine to X{x:.3f} "
                f"Y{y:.3f} in its own coordinates, past its soft limits ($20); home it and set the "
                "work origin so that the sheet lies within the travel"
            ),
        )
