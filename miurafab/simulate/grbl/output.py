"""The outputs of the simulated controller: text, spindle, coolant and motors."""

from __future__ import annotations

from miurafab.motion import cpu
from miurafab.simulate.grbl.state import FirmwareState, Machine, Routine, Until

_DIGIT_PRINTED = 620
"""The cycles for each digit of a number: a 32-bit division by ten."""


def say(machine: Machine, text: str) -> Routine:
    """Print ``text``; wait while the transmit ring is full."""
    data = text.encode("latin-1")
    done = machine.uart.write(machine.now, data)
    digits = sum(byte in b"0123456789" for byte in data)
    yield float(len(data) * cpu.ANSWER_BYTE + digits * _DIGIT_PRINTED)
    if done > machine.now:
        yield Until(done)


def prepare(machine: Machine) -> Routine:
    """Fill the segment queue."""
    stepper, generator = machine.stepper, machine.generator
    while stepper.room:
        segment = generator.next()
        if generator.cycles:
            cycles, generator.cycles = generator.cycles, 0
            yield float(cycles)
        if segment is None:
            return
        stepper.queue.append(segment)


def set_spindle(machine: Machine, spindle: int, word: float) -> None:
    """Run the spindle as M3, M4 or off (0); in laser mode M4 leaves the beam off at rest."""
    if machine.abort:
        return
    if spindle == 0:
        machine.spindle_speed = 0.0
        machine.set_pwm(0)
    else:
        machine.clockwise = spindle == 3
        dark = machine.settings.laser and spindle == 4
        machine.set_pwm(machine.to_pwm(0.0 if dark else word))
    machine.override_count = 0


def set_flood(machine: Machine, on: bool) -> None:
    """Switch the coolant output."""
    if not machine.abort:
        machine.flood = on
        machine.override_count = 0


def rest_motors(machine: Machine) -> Routine:
    """Stop the step interrupt and hold the motors for the idle lock time."""
    machine.stop_motors()
    locks = machine.settings.idle_lock is not None or machine.alarm
    if (
        locks or machine.state is FirmwareState.SLEEP
    ) and machine.state is not FirmwareState.HOMING:
        yield machine.settings.values[1] * 1e-3 * cpu.CLOCK


def reset_motors(machine: Machine) -> Routine:
    """Stop, and drop all prepared segments."""
    yield from rest_motors(machine)
    machine.generator.reset()


def sync_positions(machine: Machine) -> None:
    """Set the positions of parser and planner to the stepper's."""
    machine.parser.position = machine.millimetres(machine.position)
    machine.planner.position = machine.position
