"""The main program of the simulated controller: read lines, execute them (``protocol.c``)."""

from __future__ import annotations

from miurafab.gcode.parser import ModalState
from miurafab.motion import cpu
from miurafab.simulate.grbl import report
from miurafab.simulate.grbl.commands import command, run_startup_lines, take_settings
from miurafab.simulate.grbl.motion_control import run_gcode
from miurafab.simulate.grbl.output import reset_motors, say, sync_positions
from miurafab.simulate.grbl.realtime import realtime, start_when_idle
from miurafab.simulate.grbl.state import FirmwareState, Machine, Routine

_LOCKED, _TOO_LONG = 9, 11
_ENDS = (0x0A, 0x0D)


def firmware(machine: Machine) -> Routine:
    """The endless program from power-up; each reset leads back to its start."""
    while True:
        yield from _restart(machine)
        machine.booting = False
        yield from say(machine, report.banner(machine))
        yield from _serve(machine)


def _restart(machine: Machine) -> Routine:
    """Clear the state after a reset; the machine's position survives."""
    machine.clear()
    machine.uart.ring.clear()
    machine.parser = ModalState()
    machine.parser.coord_system = list(machine.settings.position(0))
    machine.set_pwm(0)
    machine.flood = False
    take_settings(machine)
    machine.planner.reset(machine.position)
    yield from reset_motors(machine)
    sync_positions(machine)


def _serve(machine: Machine) -> Routine:
    if machine.settings.values[21] and machine.engaged_limits():
        machine.state = FirmwareState.ALARM
        yield from say(machine, report.message(machine, "Check Limits"))
    if machine.state in (FirmwareState.ALARM, FirmwareState.SLEEP):
        yield from say(machine, report.message(machine, "'$H'|'$X' to unlock"))
        machine.state = FirmwareState.ALARM
    else:
        machine.state = FirmwareState.IDLE
        yield from run_startup_lines(machine)
    reader = _LineBuffer(machine.line)
    ring = machine.uart.ring
    while True:
        while ring:
            taken = 0
            complete = False
            while ring and not complete:
                taken += 1
                complete = reader.take(ring.popleft())
            yield float(taken * cpu.CHARACTER)
            if complete:
                yield from realtime(machine)
                if machine.abort:
                    return
                yield from _line(machine, reader)
        start_when_idle(machine)
        yield from realtime(machine)
        if machine.abort:
            return
        if not ring and not machine.pending():
            yield None


def _line(machine: Machine, reader: _LineBuffer) -> Routine:
    """Execute the line in ``reader``, and answer it."""
    text, too_long = reader.finish()
    if too_long:
        machine.answer = _TOO_LONG
    elif not text:
        machine.answer = 0
    elif text.startswith("$"):
        yield from command(machine, text)
    elif machine.state in (FirmwareState.ALARM, FirmwareState.JOG):
        machine.answer = _LOCKED
    else:
        yield from run_gcode(machine, text)
    yield from say(machine, report.status_code(machine, machine.answer))


class _LineBuffer:
    """Collects a line in upper case, at most 79 characters, without blanks, comments, slashes."""

    def __init__(self, buffer: bytearray) -> None:
        self.buffer = buffer
        self.length = 0
        self.skipping = ""

    def take(self, byte: int) -> bool:
        """Read a byte; True at the end of the line."""
        if byte in _ENDS:
            return True
        character = chr(byte)
        if self.skipping:
            if character == ")" and self.skipping == "(":
                self.skipping = ""
        elif byte <= 0x20 or character == "/":
            pass
        elif character in "(;":
            self.skipping = character
        elif self.length >= len(self.buffer) - 1:
            self.skipping = "too long"
        else:
            self.buffer[self.length] = ord(character.upper())
            self.length += 1
        return False

    def finish(self) -> tuple[str, bool]:
        """The line, and whether it was too long; the next line begins."""
        self.buffer[self.length] = 0
        text = self.buffer[: self.length].decode("latin-1")
        too_long = self.skipping == "too long"
        self.length, self.skipping = 0, ""
        return text, too_long
