"""A random walk of actions through one session with the virtual controller, and what must hold.

After each action the session's state is compared with the controller's own, and the beam log is
looked through for a beam that was on and stood. ``benchmarks/session_hour.py`` walks for an hour.
"""

from __future__ import annotations

import itertools
import random
from collections import Counter
from collections.abc import Callable

import pytest

from miurafab.errors import ControllerError, MiurafabError, PortError
from miurafab.gcode.job import Job
from miurafab.machine.known_controller import MachineState, PortSetup
from miurafab.machine.machine_session import MachineSession
from miurafab.machine.planning import plan_job
from miurafab.machine.signals import StopSignals
from miurafab.machine.trace_box import frame_job
from miurafab.machine.transport import VirtualTransport
from miurafab.profiles import load_machine
from miurafab.simulate.beam import standing_seconds
from miurafab.simulate.grbl import report
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings

MACHINE = load_machine("grbl-laser-400")
HOMING = {22: 1, 24: 500, 25: 3000, 27: 3, 1: 255}
JOB = plan_job(
    Job(
        "rows.nc",
        "M4 S0\n" + "".join(f"G0 X5 Y{n}\nG1 X15 S500 F3000\n" for n in range(6)) + "M5\nG0X0Y0\n",
    ),
    MACHINE,
)
FRAME = plan_job(frame_job("rows.nc", (5, 0, 15, 6), MACHINE), MACHINE)
LINES = (
    "G91",
    "G20",
    "G55",
    "G92X3Y4",
    "M8",
    "G1X4F600",
    "G18",
    "$10=1",
    "$10=0",
    "G10L2P1X7",
    "G99",
    "$X",
)


class Cable(VirtualTransport):
    """A wire that can be pulled out."""

    pulled = False

    def _require_cable(self) -> None:
        if self.pulled:
            raise PortError("The port of the walk went away.")


class Walk:
    """One walk; also the keyboard of its session."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.device = VirtualGrbl(virtual_settings(MACHINE) | HOMING, baud=115_200)
        self.done: Counter[str] = Counter()
        self.refused: Counter[str] = Counter()
        self._keys: list[tuple[float, str]] = []
        self._open()

    def _open(self) -> None:
        self.cable = Cable(self.device)
        self.session = MachineSession(self.cable, StopSignals(), PortSetup.of(MACHINE), keys=self)
        self.session.open()

    def pressed(self) -> str:
        """The keys that are due."""
        due = "".join(key for at, key in self._keys if at <= self.device.now)
        self._keys = [pair for pair in self._keys if pair[0] > self.device.now]
        return due

    def press(self, keys: str, within: float) -> None:
        """``keys`` at random moments of the next seconds, in their order."""
        moments = sorted(self.random.uniform(0, within) for _ in keys)
        self._keys += [(self.device.now + at, key) for at, key in zip(moments, keys, strict=True)]

    # One action and what must hold after it

    def step(self) -> None:
        """A random action, and the proof; a lock is mostly opened first, as a person does."""
        action = self.random.choice(sorted(name for name in vars(Walk) if name.startswith("do_")))
        self.done[action[3:]] += 1
        try:
            if self.device.state == "Alarm" and self.random.random() < 0.8:
                self.random.choice((self.session.unlock, self.session.home))()
            getattr(self, action)()
        except PortError:
            self._plug_in_again()
        except MiurafabError as error:
            self.refused[str(error)[:40]] += 1
            self.session._signals.release()
        self._keys.clear()
        self.check()

    def check(self) -> None:
        """The state is the controller's own, and no beam stood."""
        try:
            state = self.session.look()
            if state.state.startswith(("Hold", "Door")):
                self.session.realtime(b"~")
            if not state.idle:
                state = self.session.settle()
        except ControllerError:
            assert self.device.state == "Alarm"  # a hard limit: deaf until a reset
            assert self.session.state.state == "Alarm"
            self.session.abort()
            state = self.session.look()
        assert_true(state, self.device)
        assert standing_seconds(self.device.beam_log) == 0.0
        assert not (self.device.beam_on and state.idle)
        self.device.beam_log.clear()

    def _plug_in_again(self) -> None:
        self.session.close()
        self.device.advance(30)  # what it holds runs out
        assert not self.device.beam_on
        self.device.take_output()
        if self.random.random() < 0.5:
            self.device.power_cycle()
        self._open()

    # The actions

    def do_jog(self) -> None:
        way = [self.random.choice((None, self.random.uniform(-20, 20))) for _ in "xy"]
        self.session.jog(x=way[0], y=way[1] or 1.0, feed_mm_min=3000)

    def do_jog_to(self) -> None:
        self.session.jog(x=self.random.uniform(0, 30), y=5.0, feed_mm_min=6000, absolute=True)

    def do_nudge(self) -> None:
        for _ in range(self.random.randrange(1, 12)):
            x, y = self.random.choice(((1, 0), (0, 1), (-1, 0), (0, -1), (1, 0), (1, 0)))
            self.session.nudge(10.0 * x, 10.0 * y)
            self.session.watch(self.random.choice((0.03, 0.03, 0.3)))
        self.session.watch(1.5)

    def do_origin(self) -> None:
        self.session.set_origin()

    def do_go(self) -> None:
        self.session.go_to_origin()

    def do_home(self) -> None:
        self.session.home()

    def do_unlock(self) -> None:
        self.session.unlock()

    def do_frame(self) -> None:
        self.session.frame(FRAME)

    def do_cut(self) -> None:
        self.session.cut(JOB)

    def do_hold_in_a_cut(self) -> None:
        self.press(" r", 3.0)
        self._keys.append((self.device.now + 20, "r"))  # one at once after the hold is not heard
        self.session.cut(JOB)

    def do_override_in_a_cut(self) -> None:
        self.press("+-]]0[", 3.0)
        self.session.cut(JOB)

    def do_abort_a_cut(self) -> None:
        self.press("q", 5.0)
        self.session.cut(JOB)

    def do_abort_a_jog(self) -> None:
        self.press(self.random.choice("qc "), 0.4)
        self.session.jog(x=20.0, feed_mm_min=3000)

    def do_hold_at_rest(self) -> None:
        self.session.realtime(b"!")
        self.session.watch(0.2)
        self.session.realtime(b"~")
        self.session.watch(0.2)

    def do_override(self) -> None:
        for order in self.random.choices((b"\x91", b"\x92", b"\x9a", b"\x9b", b"\x96"), k=3):
            self.session.realtime(order)
        self.session.watch(1.0)

    def do_line(self) -> None:
        self.session.say(self.random.choice(LINES))

    def do_abort(self) -> None:
        assert self.session.abort()

    def do_reset_button(self) -> None:
        self._push_reset()
        self.session.watch(0.5)

    def do_reset_in_a_cut(self) -> None:
        self._strike(self._push_reset)

    def do_limit_switch(self) -> None:
        self.device.press_limit("X")
        self.device.press_limit("X", False)
        self.session.watch(1.5)

    def do_unplug(self) -> None:
        self._pull()
        self.session.watch(0.5)

    def do_unplug_in_a_cut(self) -> None:
        self._strike(self._pull)

    def do_watch(self) -> None:
        self.session.watch(self.random.uniform(0.1, 3.0))

    def _strike(self, blow: Callable[[], None]) -> None:
        """A cut, and a blow in its midst."""
        at, count = self.random.randrange(3, 30), itertools.count(1)
        self.session.cut(JOB, on_progress=lambda now: blow() if next(count) == at else None)

    def _push_reset(self) -> None:
        self.device.press_button("reset")
        self.device.press_button("reset", False)

    def _pull(self) -> None:
        self.cable.pulled = True


def assert_true(state: MachineState, device: VirtualGrbl) -> None:
    """The session's state is the controller's own."""
    machine = device._machine
    assert state.state.partition(":")[0] == device.state
    # Either position may be a sum of two that were told, each rounded to 0.001 mm.
    assert state.machine_position == pytest.approx(device.position, abs=1.6e-3)
    parser = machine.parser
    offset = [a + b for a, b in zip(parser.coord_system, parser.coord_offset, strict=True)]
    assert state.work_offset == pytest.approx(offset, abs=6e-4)
    want = [m - o for m, o in zip(device.position, offset, strict=True)]
    assert state.position == pytest.approx(want, abs=1.6e-3)
    planner = machine.planner
    assert state.overrides == (
        planner.feed_override,
        planner.rapid_override,
        machine.spindle_override,
    )
    assert state.beam_on == device.beam_on
    if device.state in ("Idle", "Alarm"):
        assert state.shift == pytest.approx(tuple(parser.coord_offset), abs=6e-4)
        assert f"[GC:{' '.join(state.modes)}]" == report.modes(machine).strip()
        assert state.settings.values == pytest.approx(device.settings, abs=5e-4)
