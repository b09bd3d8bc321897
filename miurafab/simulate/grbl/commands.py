"""The ``$`` commands of the simulated controller (``system.c``)."""

from __future__ import annotations

import re
from collections.abc import Callable, Generator

from miurafab.gcode.numbers import read_single, whole_byte
from miurafab.simulate.grbl import report
from miurafab.simulate.grbl.eeprom import LINE_SIZE, STARTUP_LINES
from miurafab.simulate.grbl.homing import home
from miurafab.simulate.grbl.motion_control import offsets_changed, remember, run_gcode
from miurafab.simulate.grbl.output import rest_motors, say
from miurafab.simulate.grbl.realtime import synchronize
from miurafab.simulate.grbl.state import FirmwareState, Machine, RealtimeRequest, Routine, Wait
from miurafab.units import DECIMAL

_BAD_NUMBER, _UNKNOWN, _HOMING_OFF, _READ_FAILED, _NOT_IDLE = 2, 3, 5, 7, 8
TextRoutine = Generator[Wait, None, str | None]
_NUMBER = re.compile(rf"[-+]?{DECIMAL}", re.ASCII)
_LARGEST_SETTING = 255


def command(machine: Machine, line: str) -> Routine:
    """Execute ``line``, which begins with ``$``; its code goes to :attr:`Machine.answer`."""
    machine.answer = 0
    kind = line[1:2]
    if kind == "":
        yield from say(machine, report.HELP)
    elif kind == "J" and machine.dialect.jogs:
        yield from _jog(machine, line)
    elif kind in "$GCX":
        if len(line) > 2:
            machine.answer = _UNKNOWN
        else:
            yield from _AT_ANY_TIME[kind](machine)
    elif machine.state not in (FirmwareState.IDLE, FirmwareState.ALARM):
        machine.answer = _NOT_IDLE
    elif kind == "S" and not machine.dialect.sleeps:
        yield from _setting(machine, line)
    else:
        yield from _AT_REST.get(kind, _setting)(machine, line)


def run_startup_lines(machine: Machine) -> Routine:
    """Run the lines that ``$N`` stored, after a reset and after homing."""
    for index in range(STARTUP_LINES):
        text = yield from _startup_text(machine, index)
        if text is None:
            yield from say(machine, f">:{report.status_code(machine, _READ_FAILED)}")
        elif text:
            yield from run_gcode(machine, text)
            yield from say(machine, f">{text}:{report.status_code(machine, machine.answer)}")


def _startup_text(machine: Machine, index: int) -> TextRoutine:
    settings = machine.settings
    return (
        yield from _recall(
            machine,
            settings.startup_line(index),
            lambda buffer: settings.store_startup_line(index, buffer),
        )
    )


def _recall(machine: Machine, stored: bytes | None, store: Callable[[bytes], int]) -> TextRoutine:
    """Read a stored text into the line buffer; a damaged text gives None and is cleared."""
    if stored is None:
        machine.line[0] = 0
        yield from remember(machine, store(bytes(machine.line[:LINE_SIZE])))
        return None
    machine.line[:LINE_SIZE] = stored
    return stored.partition(b"\0")[0].decode("latin-1")


def _jog(machine: Machine, line: str) -> Routine:
    if machine.state not in (FirmwareState.IDLE, FirmwareState.JOG):
        machine.answer = _NOT_IDLE
    elif line[2:3] != "=":
        machine.answer = _UNKNOWN
    else:
        yield from run_gcode(machine, line[3:], jog=True)


def _list_settings(machine: Machine) -> Routine:
    if machine.state in (FirmwareState.CYCLE, FirmwareState.HOLD):
        machine.answer = _NOT_IDLE
    else:
        yield from say(machine, report.settings_list(machine))


def _list_modes(machine: Machine) -> Routine:
    yield from say(machine, report.modes(machine))


def _check_mode(machine: Machine) -> Routine:
    if machine.state is FirmwareState.CHECK:
        machine.reset()
        yield from say(machine, report.message(machine, "Disabled"))
    elif machine.state is not FirmwareState.IDLE:
        machine.answer = _NOT_IDLE
    else:
        machine.state = FirmwareState.CHECK
        yield from say(machine, report.message(machine, "Enabled"))


def _unlock(machine: Machine) -> Routine:
    if machine.state is FirmwareState.ALARM:
        yield from say(machine, report.message(machine, "Caution: Unlocked"))
        machine.state = FirmwareState.IDLE


def _list_parameters(machine: Machine, line: str) -> Routine:
    if len(line) > 2:
        machine.answer = _UNKNOWN
    else:
        yield from say(machine, report.parameters(machine))


def _home(machine: Machine, line: str) -> Routine:
    if not machine.settings.values[22]:
        machine.answer = _HOMING_OFF
        return
    machine.state = FirmwareState.HOMING
    if len(line) > 2:
        machine.answer = _UNKNOWN
        return
    yield from home(machine)
    if not machine.abort:
        machine.state = FirmwareState.IDLE
        yield from rest_motors(machine)
        yield from run_startup_lines(machine)
        machine.answer = 0


def _sleep(machine: Machine, line: str) -> Routine:
    if line != "$SLP":
        machine.answer = _UNKNOWN
    else:
        machine.requests.add(RealtimeRequest.SLEEP)
    yield from ()


def _build_info(machine: Machine, line: str) -> Routine:
    settings = machine.settings
    if len(line) == 2:
        note = yield from _recall(machine, settings.build_note(), settings.store_build_note)
        yield from say(machine, report.build_info(machine, note or ""))
    elif line[2] != "=":
        machine.answer = _UNKNOWN
    else:
        _shift(machine, 3)
        yield from remember(machine, settings.store_build_note(bytes(machine.line[:LINE_SIZE])))


def _restore(machine: Machine, line: str) -> Routine:
    if not re.fullmatch(r"\$RST=[$#*]", line):
        machine.answer = _UNKNOWN
        return
    yield from remember(machine, machine.settings.wipe(line[5]))
    take_settings(machine)
    yield from say(machine, report.message(machine, "Restoring defaults"))
    machine.reset()


def _startup(machine: Machine, line: str) -> Routine:
    if len(line) == 2:
        for index in range(STARTUP_LINES):
            text = yield from _startup_text(machine, index)
            shown = (
                report.status_code(machine, _READ_FAILED)
                if text is None
                else f"$N{index}={text}\r\n"
            )
            yield from say(machine, shown)
        return
    if machine.state is not FirmwareState.IDLE:
        machine.answer = _NOT_IDLE
        return
    number = _NUMBER.match(line, 2)
    if number is None:
        machine.answer = _BAD_NUMBER
        return
    if line[number.end() : number.end() + 1] != "=":
        machine.answer = _UNKNOWN
        return
    start = number.end() + 1
    _shift(machine, start)
    block = line[start:]
    if block.startswith("$"):
        yield from run_gcode(machine, block[3:], jog=True)
    else:
        yield from run_gcode(machine, block)
    if machine.answer == 0:
        yield from synchronize(machine)
        index = whole_byte(read_single(number[0]))
        waits = machine.settings.store_startup_line(index, bytes(machine.line[:LINE_SIZE]))
        yield from remember(machine, waits)


def _setting(machine: Machine, line: str) -> Routine:
    name = _NUMBER.match(line, 1)
    if name is None:
        machine.answer = _BAD_NUMBER
        return
    if line[name.end() : name.end() + 1] != "=":
        machine.answer = _UNKNOWN
        return
    value = _NUMBER.match(line, name.end() + 1)
    if value is None:
        machine.answer = _BAD_NUMBER
        return
    parameter = read_single(name[0])
    if value.end() != len(line) or parameter > _LARGEST_SETTING:
        machine.answer = _UNKNOWN
        return
    number = whole_byte(parameter)
    listed = machine.dialect.settings
    if listed is not None and number not in listed:
        machine.answer = _UNKNOWN
        return
    machine.answer, waits = machine.settings.store(number, read_single(value[0]))
    if machine.answer == 0:
        take_settings(machine)
        if number == 13:
            yield from offsets_changed(machine)
        elif number in (30, 31):
            machine.set_pwm(0)
        yield from remember(machine, waits)


def take_settings(machine: Machine) -> None:
    """Give changed settings to planner and stepper."""
    machine.planner.configure(machine.motion())
    machine.stepper.idle_lock = machine.idle_cycles


def _shift(machine: Machine, start: int) -> None:
    """Move a stored text, including its end, to the front of the line buffer."""
    line = machine.line
    end = line.index(0, start) + 1 if 0 in line[start:] else len(line)
    line[: end - start] = line[start:end]


_AT_ANY_TIME = {"$": _list_settings, "G": _list_modes, "C": _check_mode, "X": _unlock}
_AT_REST = {
    "#": _list_parameters,
    "H": _home,
    "S": _sleep,
    "I": _build_info,
    "R": _restore,
    "N": _startup,
}
