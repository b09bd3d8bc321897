"""The state of the simulated controller, and its interrupts.

The main program of the firmware (the other modules here) is written as generators. A generator
yields what it waits for: a number of processor cycles of work, :class:`Until` a time, or None for
the next event. The interrupts (bytes, switches, the end of motion) change the state at once, and
the main program sees their flags later.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace
from enum import Enum, auto

from miurafab.gcode.numbers import single
from miurafab.gcode.parser import ModalState
from miurafab.motion import cpu
from miurafab.motion.parameters import MotionParameters
from miurafab.motion.planner import Planner
from miurafab.motion.segments import Segment, SegmentGenerator
from miurafab.motion.stepper import Stepper, steps_taken
from miurafab.simulate.beam import BeamLog
from miurafab.simulate.grbl.dialect import Dialect
from miurafab.simulate.grbl.eeprom import LINE_SIZE, FirmwareSettings
from miurafab.simulate.grbl.uart import Uart

AXES = "XYZ"


@dataclass(frozen=True, slots=True)
class Until:
    """Wait without work until the cycle ``time``."""

    time: int


Wait = float | Until | None
Routine = Generator[Wait, None, None]


class FirmwareState(Enum):
    """The state of the controller, named as in its status report."""

    IDLE = "Idle"
    ALARM = "Alarm"
    CHECK = "Check"
    HOMING = "Home"
    CYCLE = "Run"
    HOLD = "Hold"
    JOG = "Jog"
    DOOR = "Door"
    SLEEP = "Sleep"

    __hash__ = object.__hash__  # of Enum it is a call in Python, thousands of times a second


class RealtimeRequest(Enum):
    """A request of an interrupt to the main program."""

    STATUS = auto()
    START = auto()
    HOLD = auto()
    RESET = auto()
    DOOR = auto()
    CANCEL = auto()
    SLEEP = auto()

    __hash__ = object.__hash__


class Suspend(Enum):
    """The progress of a hold, a door stop or a cancelled motion."""

    HELD = auto()
    RETRACTED = auto()
    RESTORING = auto()
    RESTORED = auto()
    DOOR_AJAR = auto()
    MOTION_CANCEL = auto()
    JOG_CANCEL = auto()

    __hash__ = object.__hash__


class StopOverride(Enum):
    """The spindle stop during a hold."""

    OFF = auto()
    BEGIN = auto()
    ON = auto()
    RESTORE = auto()
    RESTORE_AND_START = auto()


HARD_LIMIT, SOFT_LIMIT, RESET_IN_MOTION, PROBE_BEFORE, PROBE_NOTHING = 1, 2, 3, 4, 5
HOMING_RESET, HOMING_DOOR, HOMING_PULL_OFF, HOMING_NO_SWITCH = 6, 7, 8, 9
"""``ALARM:`` codes."""
SPINDLE_STOP = 0x9E
_COMMANDS = {
    "status": RealtimeRequest.STATUS,
    "start": RealtimeRequest.START,
    "hold": RealtimeRequest.HOLD,
    "door": RealtimeRequest.DOOR,
}
_PIN_REQUESTS = {"hold": RealtimeRequest.HOLD, "start": RealtimeRequest.START}


class Machine:
    """The controller's state. ``now`` is in processor cycles since power-up.

    ``position`` is the stepper's count of motor steps. ``switches`` holds, for each homed axis,
    the direction (1 or -1) and the position of its homing switch; before homing the switch is half
    the travel away from the position at power-up. ``limit_pins`` and ``control_pins`` are the
    pressed switches. ``line`` is the line buffer with the rests of earlier lines, and ``answer``
    the ``error:`` code of the last line; ``booting`` lasts from power-up until the banner.
    """

    def __init__(
        self, settings: FirmwareSettings, baud: int | None, homing_switches: bool, dialect: Dialect
    ) -> None:
        self.now = 0
        self.dialect = dialect
        self.settings = settings
        self.homing_switches = homing_switches
        self.uart = Uart(baud, dialect, self.realtime_byte)
        self.planner = Planner(self.motion())
        self.generator = SegmentGenerator(self.planner, self.to_pwm)
        self.stepper = Stepper()
        self.stepper.on_segment = self._on_segment
        self.stepper.on_end = self._on_end
        self.stepper.on_settled = self._on_settled
        self.parser = ModalState()
        self.beam = BeamLog()
        self.position: tuple[int, ...] = (0, 0, 0)
        self.limit_pins: set[str] = set()
        self.control_pins: set[str] = set()
        self.probe_pin = False
        self.answer = 0
        self.booting = False
        self.power_up()

    def power_up(self) -> None:
        """Switch on: only the EEPROM and the switches keep their state."""
        self.set_pwm(0)
        self.stepper.halt()
        self.count_from((0, 0, 0))
        homing = bool(self.settings.values[22])
        self.state = FirmwareState.ALARM if homing else FirmwareState.IDLE
        self.switches: list[tuple[int, int] | None] = [None, None, None]
        self.line = bytearray(max(self.dialect.line_chars + 1, LINE_SIZE))
        self.clockwise = True
        self._follows = False
        self.flood = False
        self.clear()

    def clear(self) -> None:
        """Clear what every reset clears, except ``state`` (``main.c``)."""
        self.abort = False
        self.suspend: set[Suspend] = set()
        self.soft_limit = False
        self.probing = self.probe_seen = False
        self.probe_away = False
        self.probe_succeeded = False
        self.probe_position: tuple[int, ...] = (0, 0, 0)
        self.spindle_speed = 0.0
        self.spindle_override = 100
        self.stop_override = StopOverride.OFF
        self.override_count = 0
        self.offset_count = 0
        self.requests: set[RealtimeRequest] = set()
        self.alarm = 0
        self.motion_overrides: set[int] = set()
        self.accessory_overrides: set[int] = set()
        self.planner.feed_override = self.planner.rapid_override = 100
        self.interrupt_delay = 0

    def motion(self) -> MotionParameters:
        """The parameters of motion, from settings and firmware."""
        blocks = self.dialect.planner_blocks
        return replace(self.settings.motion(), planner_blocks=blocks)

    # The interrupts

    def realtime_byte(self, now: int, byte: int) -> None:
        """The receive interrupt takes ``byte`` out of the stream."""
        self.now = now
        command = self.dialect.realtime[byte]
        if command == "reset":
            self.reset()
        elif command in _COMMANDS:
            self.requests.add(_COMMANDS[command])
        elif command == "cancel jog":
            if self.state is FirmwareState.JOG:
                self.requests.add(RealtimeRequest.CANCEL)
        elif command == "motion override":
            self.motion_overrides.add(byte)
        else:
            self.accessory_overrides.add(byte)

    def reset(self) -> None:
        """Turn off beam, coolant and moving motors; the main program restarts (``mc_reset``)."""
        if RealtimeRequest.RESET in self.requests:
            return
        self.requests.add(RealtimeRequest.RESET)
        self.uart.cut(self.now)
        self.set_pwm(0)
        self.flood = False
        generator = self.generator
        moving = self.state in (FirmwareState.CYCLE, FirmwareState.HOMING, FirmwareState.JOG)
        if moving or generator.holding or generator.system_move is not None:
            if self.state is not FirmwareState.HOMING:
                self.alarm = RESET_IN_MOTION
            elif not self.alarm:
                self.alarm = HOMING_RESET
            self.stop_motors()
            self.interrupt_delay = self.idle_cycles

    def stop_motors(self) -> None:
        """Stop the step interrupt at the present position."""
        self.position = self.position_now()
        self.stepper.halt()
        self.set_pwm(self.beam.pwm)

    def change_limit_pin(self, axis: str, pressed: bool) -> None:
        """A limit switch changes; with hard limits any change is an alarm ($21, ``limits.c``)."""
        (self.limit_pins.add if pressed else self.limit_pins.discard)(axis)
        watched = self.settings.values[21] and self.state is not FirmwareState.HOMING
        if watched and self.state is not FirmwareState.ALARM and not self.alarm:
            self.reset()
            self.alarm = HARD_LIMIT

    def change_control_pin(self, name: str, pressed: bool) -> None:
        """The ``reset``, ``hold`` or ``start`` button changes."""
        (self.control_pins.add if pressed else self.control_pins.discard)(name)
        if "reset" in self.control_pins:
            self.reset()
        for pin in self.control_pins & _PIN_REQUESTS.keys():
            self.requests.add(_PIN_REQUESTS[pin])

    def watch_probe(self) -> None:
        """The step interrupt checks the probe from now on."""
        self.probing, self.probe_seen = True, False

    def change_probe_pin(self, touched: bool) -> None:
        """The probe changes; the step interrupt records the position."""
        self.probe_pin = touched
        if self.probing and self.stepper.running and self.probe_triggered:
            self.probing, self.probe_seen = False, True
            self.probe_position = self.position_now()
            self.requests.add(RealtimeRequest.CANCEL)

    @property
    def probe_triggered(self) -> bool:
        """Whether the probe triggers, inverted by $6 and by a move away from contact."""
        inverted = bool(self.settings.values[6]) != self.probe_away
        return self.probe_pin != inverted

    def home_switch(self, axis: int) -> tuple[int, int]:
        """The homing direction of ``axis`` (1 or -1, $23) and its switch position in steps."""
        values = self.settings.values
        direction = -1 if int(values[23]) >> axis & 1 else 1
        known = self.switches[axis]
        if known is not None and known[0] == direction:
            return known
        return direction, direction * round(0.5 * values[130 + axis] * values[100 + axis])

    def engaged_limits(self) -> set[str]:
        """The axes whose limit pin reads as pressed, with $5.

        The homing switches act in homing only, so a job may use the whole bed of a machine that was
        never homed.
        """
        position = self.position_now()
        homing = self.homing_switches and self.state is FirmwareState.HOMING
        inverted = bool(self.settings.values[5])
        engaged = set()
        for axis, name in enumerate(AXES):
            direction, switch = self.home_switch(axis)
            reached = homing and direction * (position[axis] - switch) >= 0
            if (reached or name in self.limit_pins) != inverted:
                engaged.add(name)
        return engaged

    def _on_segment(self, now: int, segment: Segment) -> None:
        self.now = now
        self._follows = segment.follows
        self.position = steps_taken(segment.move, segment.done + segment.ticks * segment.stride)
        self.set_pwm(segment.power)

    def _on_end(self, now: int) -> None:
        self.now = now
        self.set_pwm(self.beam.pwm)

    def _on_settled(self, now: int) -> None:
        """At rest the beam of M4 goes off; the constant power of M3 stays on."""
        self.now = now
        if self._follows:
            self.set_pwm(0)

    def count_from(self, position: tuple[int, ...]) -> None:
        """Rename the present position to ``position``; nothing moves."""
        self.set_pwm(self.beam.pwm)
        self.position = position
        self.set_pwm(self.beam.pwm)

    # The view of the main program

    @property
    def idle_cycles(self) -> int:
        """The cycles for which the motors are held at a stop."""
        return round((self.settings.idle_lock or 0.0) * cpu.CLOCK)

    def position_now(self) -> tuple[int, ...]:
        """The present motor position in steps."""
        progress = self.stepper.progress(self.now)
        return self.position if progress is None else steps_taken(*progress)

    def millimetres(self, steps: tuple[int, ...]) -> list[float]:
        """Motor steps as machine millimetres, in 32-bit floats; NaN for an axis without steps."""
        return [
            single(n / k) if k else float("nan")
            for n, k in zip(steps, self.settings.steps_per_mm, strict=True)
        ]

    def to_pwm(self, word: float | None) -> int:
        """The PWM value of an S word, or of None, with the override (``spindle_control.c``)."""
        values = self.settings.values
        low, high = values[31], values[30]
        if word is None:
            self.spindle_speed = 0.0
            return 0
        speed = word * 0.01 * self.spindle_override
        if low >= high or speed >= high:
            self.spindle_speed = high
            return 255
        if speed <= low:
            self.spindle_speed = low if speed else 0.0
            return 1 if speed else 0
        self.spindle_speed = speed
        return int((speed - low) * 254.0 / (high - low)) + 1

    def set_pwm(self, pwm: int) -> None:
        """Set the PWM of the beam now."""
        if pwm or self.beam.pwm:
            self.beam.mark(self.now / cpu.CLOCK, self.point_now(), pwm)

    def point_now(self) -> tuple[float, float]:
        """The beam position in machine mm, interpolated between motor steps."""
        stepper, (per_x, per_y, _) = self.stepper, self.settings.steps_per_mm
        x: float
        y: float
        if stepper.running:
            segment = stepper.queue[0]
            move, part = segment.move, 0.0
            if segment.cycles:
                part = (self.now - stepper.began) / segment.cycles
            made = (segment.done + segment.ticks * segment.stride * part) / (8 * move.events)
            x, y = move.origin[0] + move.steps[0] * made, move.origin[1] + move.steps[1] * made
        else:
            x, y = self.position[:2]
        return x / per_x if per_x else 0.0, y / per_y if per_y else 0.0

    def is_in(self, *states: FirmwareState) -> bool:
        """Whether the state is one of ``states`` now; the state may change in every wait."""
        return self.state in states

    def pending(self) -> bool:
        """Whether an interrupt left work for the main program."""
        return bool(
            self.requests
            or self.alarm
            or self.stepper.stopped
            or self.motion_overrides
            or self.accessory_overrides
        )
