"""A simulated GRBL controller: bytes in, bytes out, and time only by ``advance``.

It models the firmware in virtual time. The main program (:mod:`miurafab.simulate.grbl.protocol`) is
a coroutine that yields when it works or waits. The interrupts (received bytes, step segments,
switches) happen at their cycles of a 16 MHz clock. So ``ok`` comes when the planner has room, a
status report shows the machine at that moment, EEPROM writes lose bytes, and a job takes its real
time.

The same bytes at the same times give the same output, however the calls divide them. The firmware
is GRBL 1.1h or another dialect (:mod:`miurafab.simulate.grbl.dialect`). ``faults``
(:mod:`miurafab.simulate.faults`) strike the controller and its cable at their times.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

from miurafab.errors import ProfileError
from miurafab.grbl.settings import profile_settings
from miurafab.motion import cpu
from miurafab.motion.parameters import COMMON_STEPS
from miurafab.motion.stepper import Processor
from miurafab.profiles import MachineProfile
from miurafab.profiles.board import settings_of
from miurafab.simulate.beam import BeamSegment
from miurafab.simulate.cable import Cable
from miurafab.simulate.faults import Fault
from miurafab.simulate.grbl.dialect import DIALECTS
from miurafab.simulate.grbl.eeprom import FirmwareSettings
from miurafab.simulate.grbl.protocol import firmware
from miurafab.simulate.grbl.state import Machine, Until, Wait


def virtual_settings(machine: MachineProfile) -> dict[int, float]:
    """The settings that turn a simulated controller into ``machine``.

    These are what the profile stands for (:mod:`miurafab.profiles.board`), the motor steps that
    the time estimate assumes if it has no settings for them, laser mode, and what a job expects
    (:func:`~miurafab.grbl.settings.profile_settings`).
    """
    laser = machine.tool.kind == "laser" and machine.dialect != "grbl-0.9"
    pairs = dict.fromkeys((100, 101, 102), COMMON_STEPS) | settings_of(machine)
    pairs[32] = float(laser)
    return pairs | profile_settings(machine)


class VirtualGrbl:
    """The device side of a GRBL connection.

    ``settings`` maps ``$`` numbers to values and overrides the firmware's defaults; an unknown
    number raises :class:`~miurafab.errors.ProfileError`. A byte takes ten bit times at ``baud``, in
    both directions; with None it takes no time. With ``homing_switches`` False, ``$H`` finds no
    switch. ``dialect`` is a name in :data:`~miurafab.simulate.grbl.dialect.DIALECTS`. Each of the
    ``faults`` strikes once. At power-up the banner is in the output, unless ``greets`` is False, as
    of some boards.
    """

    resets_on_open = True

    def __init__(
        self,
        settings: Mapping[int, float] | None = None,
        *,
        baud: int | None = None,
        homing_switches: bool = True,
        dialect: str = "grbl-1.1",
        greets: bool = True,
        faults: Iterable[Fault] = (),
    ) -> None:
        stored = FirmwareSettings()
        unknown = sorted(set(settings or {}) - set(stored.values))
        if unknown:
            raise ProfileError(f"${unknown[0]} is not a setting of GRBL 1.1.")
        spoken = DIALECTS[dialect] if greets else replace(DIALECTS[dialect], banner="")
        stored.write({10: spoken.report_mask} | dict(settings or {}))
        self._machine = Machine(stored, baud, homing_switches, spoken)
        self._seconds = 0.0
        self._frozen = False
        self._thaws_at: int | None = None
        faults = tuple(faults)
        self._cable = Cable(faults, self._apply, cpu.CLOCK) if faults else None
        self._power_on()

    def _power_on(self) -> None:
        """Boot; the time until the banner is written is left out."""
        machine = self._machine
        machine.power_up()
        self._processor = Processor(machine.stepper)
        self._program = firmware(machine)
        self._wait: Wait = None
        machine.booting = True
        while machine.booting:
            self._wait = next(self._program)
        self._resume()

    # Time

    @property
    def now(self) -> float:
        """Virtual seconds since power-up."""
        return self._seconds

    def advance(self, seconds: float) -> None:
        """Let ``seconds`` of virtual time pass."""
        self._seconds += max(seconds, 0.0)
        self._run(round(self._seconds * cpu.CLOCK))

    def advance_to_line(self, seconds: float) -> None:
        """Let time pass until a complete line of output is out, at most ``seconds``."""
        target = round((self._seconds + max(seconds, 0.0)) * cpu.CLOCK)
        reached = self._run(target, stop_at_line=True)
        self._seconds = reached / cpu.CLOCK if reached < target else self._seconds + seconds

    def next_event_in(self) -> float | None:
        """Seconds until the next change without input; None if there is none.

        Output that waits to be taken is not a change.
        """
        machine = self._machine
        uart = machine.uart
        events = (
            machine.stepper.change,
            uart.next_arrival(),
            uart.next_departure(machine.now),
            self._due(),
            self._next_fault(),
        )
        event = min((event for event in events if event is not None), default=None)
        return None if event is None else max(event / cpu.CLOCK - self._seconds, 0.0)

    # The wire

    def receive(self, data: bytes) -> None:
        """Take bytes: they reach the UART now, or, with ``baud``, start on the wire now."""
        now, cable = self._machine.now, self._cable
        if cable is None:
            self._machine.uart.receive(now, data)
        else:
            self._pump()
            cable.send(now, data)
        self._run(now)

    def take_output(self) -> bytes:
        """The bytes that came out of the UART (and of the cable) since the last call."""
        now, cable = self._machine.now, self._cable
        if cable is None:
            return self._machine.uart.take(now)
        self._pump()
        return cable.outward.take(now)

    @property
    def connected(self) -> bool:
        """Whether the cable is plugged in; a fault may unplug it."""
        return self._cable is None or self._cable.connected

    @property
    def lost_bytes(self) -> int:
        """The number of bytes lost to a full receive ring or during an EEPROM write."""
        return self._machine.uart.lost

    # The state

    @property
    def beam_log(self) -> list[BeamSegment]:
        """The beam segments up to now, in order of time; clear the list to save memory."""
        machine = self._machine
        machine.set_pwm(machine.beam.pwm)
        return machine.beam.segments

    @property
    def beam_on(self) -> bool:
        """Whether the beam is on."""
        return self._machine.beam.pwm > 0

    @property
    def air_on(self) -> bool:
        """Whether the air or coolant is on."""
        return self._machine.flood

    @property
    def position(self) -> tuple[float, float, float]:
        """The machine position in mm."""
        x, y, z = self._machine.millimetres(self._machine.position_now())
        return x, y, z

    @property
    def state(self) -> str:
        """The state in a status report: Idle, Run, Hold, Jog, Home, Alarm, Check, Door, Sleep."""
        return self._machine.state.value

    @property
    def settings(self) -> dict[int, float]:
        """The ``$`` settings."""
        return dict(self._machine.settings.values)

    # Events from outside

    def power_cycle(self) -> None:
        """Switch off and on: only the EEPROM survives; output that was not taken is lost."""
        self._frozen = False
        self._thaws_at = None
        self._machine.uart.power_cycle(self._machine.now)
        self._power_on()

    def freeze(self, seconds: float = math.inf) -> None:
        """The main program hangs: it answers nothing, and the prepared motion runs out."""
        self._frozen = True
        self._thaws_at = None
        if seconds < math.inf:
            self._thaws_at = self._machine.now + round(seconds * cpu.CLOCK)

    def press_limit(self, axis: str, pressed: bool = True) -> None:
        """Press or release a limit switch, ``"X"``, ``"Y"`` or ``"Z"``."""
        self._machine.change_limit_pin(axis, pressed)
        self._run(self._machine.now)

    def press_button(self, name: str, pressed: bool = True) -> None:
        """Press or release a control button, ``"reset"``, ``"hold"`` or ``"start"``."""
        self._machine.change_control_pin(name, pressed)
        self._run(self._machine.now)

    def touch_probe(self, touching: bool = True) -> None:
        """The probe makes or loses contact."""
        self._machine.change_probe_pin(touching)
        self._run(self._machine.now)

    def _apply(self, fault: Fault, now: int) -> None:
        """Apply a fault of the controller itself."""
        machine = self._machine
        if fault.kind == "reset":
            machine.change_control_pin("reset", True)
            machine.change_control_pin("reset", False)
        elif fault.kind == "power":
            self.power_cycle()
        elif fault.kind == "alarm":
            machine.reset()
            machine.alarm = int(fault.value)
        else:
            machine.uart.deaf = fault.kind == "stall"
            self.freeze(fault.value)

    def _thaw(self) -> None:
        """End the hang: the main program continues."""
        now = self._machine.now
        self._frozen = False
        self._thaws_at = None
        self._machine.uart.hear(now)
        if isinstance(self._wait, Until):
            self._wait = Until(max(self._wait.time, now))
        else:
            self._processor.note(now)
        if self._wait is None:
            self._resume()

    def _next_fault(self) -> int | None:
        """The time when the next fault strikes or ends, or the cable releases a byte."""
        due = None if self._cable is None else self._cable.next_due(self._machine.now)
        if due is None or (self._thaws_at is not None and self._thaws_at < due):
            due = self._thaws_at
        return due

    # The event loop

    def _due(self) -> int | None:
        """The time when the main program continues, if no interrupt comes before."""
        wait = self._wait
        if wait is None or self._frozen:
            return None
        return wait.time if isinstance(wait, Until) else self._processor.finish()

    def _run(self, target: int, stop_at_line: bool = False) -> int:
        """Process all events up to ``target`` in order; returns the time reached.

        With ``stop_at_line`` it stops at the end of a line of output.
        """
        cable, machine = self._cable, self._machine
        while True:
            if cable is not None:
                self._pump()
                line = cable.outward.next_line()
                if stop_at_line and line is not None:
                    target = min(target, max(line, machine.now))
            due = self._next_fault()
            stop = target if due is None else min(target, max(due, machine.now))
            reached = self._run_events(stop, stop_at_line)
            if due is not None and due <= reached:
                self._apply_due(reached)
            elif reached == target or cable is None:
                return reached

    def _apply_due(self, now: int) -> None:
        """Start and end the faults that are due."""
        if self._thaws_at is not None and self._thaws_at <= now:
            self._thaw()
        if self._cable is not None:
            self._pump()
            self._machine.uart.receive(now, self._cable.happen(now))

    def _pump(self) -> None:
        """Move the output of the UART into the cable."""
        assert self._cable is not None
        self._cable.reply(self._machine.uart.take_dated(self._machine.now))

    def _run_events(self, target: int, stop_at_line: bool) -> int:
        """Process all events up to ``target``, without faults; returns the time reached."""
        machine, processor = self._machine, self._processor
        stepper, uart = machine.stepper, machine.uart
        if self._wait is None and machine.pending():
            self._resume()
        while True:
            if stop_at_line:
                line = uart.next_line()
                if line is not None:
                    target = min(target, max(line, machine.now))
            change, arrival, due = stepper.change, uart.next_arrival(), self._due()
            end = now = target + 1
            for event in (change, due):
                if event is not None and event < now:
                    end = now = event
            if arrival is not None and arrival <= now and arrival != change:
                now = arrival
            if now > target:
                break
            machine.now = now
            wakes = change == now
            if wakes:
                processor.note(now)
                stepper.run_to(now)
            elif arrival == now:
                uart.arrive()
                # A program that waits with bytes in the ring waits for something else.
                wakes = len(uart.ring) == 1 or machine.pending()
                if not wakes and uart.ring:
                    uart.fill(end)
            if due == now or (wakes and self._wait is None):
                self._resume()
        machine.now = max(machine.now, target)
        return target

    def _resume(self) -> None:
        """Run the main program until it waits."""
        machine = self._machine
        while not self._frozen:
            self._wait = next(self._program)
            if isinstance(self._wait, float):
                if self._wait <= 0.0:
                    continue
                self._processor.start(machine.now, self._wait)
            elif isinstance(self._wait, Until) and self._wait.time <= machine.now:
                continue
            return
