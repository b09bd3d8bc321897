"""One session with the virtual controller: what it remembers, what it asks, how it jogs."""

from __future__ import annotations

import itertools
import math
import os
import re
import subprocess
import sys
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from session_walk import HOMING, JOB, MACHINE, Cable, Walk

from miurafab.errors import (
    ControllerError,
    GcodeError,
    InputError,
    JobStopped,
    MachineError,
    PersonNeeded,
)
from miurafab.machine.jog_pad import JogPad
from miurafab.machine.keys import JOG_CANCEL
from miurafab.machine.known_controller import Burnt, PortSetup
from miurafab.machine.machine_session import MachineSession
from miurafab.machine.owner import Owner, claim, holder_of, owner_of, this_owner
from miurafab.machine.progress import Progress
from miurafab.machine.resume import Resumption
from miurafab.machine.signals import StopSignals
from miurafab.simulate.beam import standing_seconds
from miurafab.simulate.faults import parse_faults
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings


class Wire(Cable):
    """Keeps what was sent."""

    def __init__(self, device: VirtualGrbl) -> None:
        super().__init__(device)
        self.sent = b""
        self.lose_resets = 0

    def write(self, data: bytes) -> None:
        self.sent += data.replace(b"?", b"")
        if data == b"\x18" and self.lose_resets:
            self.lose_resets -= 1
        else:
            super().write(data)

    def write_now(self, data: bytes) -> None:
        self.reset_at = self.now()
        self.write(data)


def session(**changes: float) -> tuple[MachineSession, Wire]:
    values = virtual_settings(MACHINE) | {int(name[1:]): value for name, value in changes.items()}
    wire = Wire(VirtualGrbl(values, baud=115_200))
    return MachineSession(wire, StopSignals(), PortSetup.of(MACHINE)), wire


def light(here: MachineSession) -> None:
    """Have the beam on at rest, which has to be asked for twice."""
    with pytest.raises(GcodeError, match=r"After M3S500 .* Send the same line again"):
        here.say("M3 S500")
    here.say("M3 S500")


def rest(here: MachineSession) -> None:
    """Wait for the end of a motion, dark or not."""
    while here.look().moves:
        here.conversation.pause(0.02)


def test_unlock_home_and_cut_in_one_session_on_a_board_that_locks() -> None:
    here, wire = session(**{f"s{number}": value for number, value in HOMING.items()})
    assert here.open().state == "Alarm"
    with pytest.raises(ControllerError, match=r"locked until it is homed; .* 'home' it"):
        here.cut(JOB)
    assert here.unlock().state == "Idle"
    assert here.home().state == "Idle"
    here.jog(x=-300, y=-300)
    here.set_origin()
    assert here.cut(JOB).lines == 15
    assert here.close()
    assert wire.sent.count(b"\x18") == 0
    assert min(s.x0 for s in wire.device.beam_log) == pytest.approx(-303 + 5, abs=0.1)


def test_a_controller_is_asked_once_and_again_only_where_it_may_have_changed() -> None:
    here, wire = session()
    here.open()
    assert wire.sent == b"$I\n$$\n$#\n$G\n$N\n"
    wire.sent = b""
    here.jog(x=5)
    here.jog(y=5)
    assert wire.sent.replace(b"F1000\n", b"\n") == b"$J=G21G91X5.000\n$J=G21G91Y5.000\n"
    wire.sent = b""
    here.set_origin()
    assert wire.sent == b"G21G90G17G94G54\nG92X0.000Y0.000\n$#\n$G\n"
    wire.sent = b""
    here.cut(JOB)
    lines = b"".join(line.data + b"\n" for line in JOB.job.send_lines())
    assert wire.sent == b"\x90\x95\x99" + lines
    wire.sent = b""
    here.watch(0.5)
    assert wire.sent == b"$#\n$G\n"


def test_what_a_person_typed_is_set_right_before_the_next_job() -> None:
    here, wire = session()
    here.say("G20 G91 G55 M8")
    assert {"G20", "G91", "G55", "M8"} <= set(here.state.modes)
    here.cut(JOB)
    assert max(s.x1 for s in wire.device.beam_log) == pytest.approx(15, abs=0.1)


class Restarting(Wire):
    """From the first ``ok`` behind ``$RST=#`` on it is ``mute``, or its banner alone is lost; the
    report before that is.
    """

    mute = over = False

    def read(self, timeout: float) -> bytes:
        said = super().read(timeout)
        if b"$RST=#" not in self.sent:
            return said
        if self.over:
            return b"" if self.mute or b"Grbl" in said else said
        self.over = said == b"ok\r\n"
        return b"" if b"<" in said else said


@pytest.mark.parametrize("mute", [False, True])
def test_a_restart_behind_a_line_is_known_without_its_banner_and_a_missing_one_told(
    mute: bool,
) -> None:
    wire = Restarting(VirtualGrbl(virtual_settings(MACHINE), baud=115_200))
    here = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE))
    here.open()
    wire.mute = mute
    says = r"did not start again after '\$RST=#'\.$"
    here.conversation.ask_status()
    with pytest.raises(ControllerError, match=says) if mute else nullcontext():
        here.conversation.command("$RST=#")
    assert wire.over


def test_a_refused_line_or_jog_costs_no_origin() -> None:
    here, wire = session(s20=1, **{f"s{number}": value for number, value in HOMING.items()})
    here.unlock()
    here.home()
    here.set_origin()
    with pytest.raises(ControllerError, match=r"error:15"):
        here.jog(x=900)
    with pytest.raises(ControllerError, match=r"error:20"):
        here.say("G99")
    assert here.look().shift != (0.0, 0.0, 0.0)
    assert wire.sent.count(b"\x18") == 0


class Pressed:
    """Ctrl-X, pressed when the controller's clock has come to its time."""

    def __init__(self, wire: Wire) -> None:
        self._wire, self._at = wire, math.inf

    def press(self, at: float) -> None:
        self._at = at

    def pressed(self) -> str:
        due = self._wire.now() >= self._at
        self._at = math.inf if due else self._at
        return "\x18" * due


@pytest.mark.parametrize("action", ["home", "go_to_origin"])
def test_ctrl_x_resets_within_10_ms_whatever_is_waited_for(action: str) -> None:
    """GRBL says nothing while it homes; while it jogs it is asked ten times a second."""
    wire = Wire(VirtualGrbl(virtual_settings(MACHINE) | HOMING, baud=115_200))
    keys = Pressed(wire)
    here = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE), keys)
    here.unlock()
    here.jog(x=-100, y=-100, feed_mm_min=6000)
    begun, wire.sent = wire.now(), b""
    keys.press(begun + 0.333)
    with pytest.raises(JobStopped, match="stopped at a key"):
        getattr(here, action)()
    assert b"\x18" in wire.sent
    assert b"!" not in wire.sent
    assert 0 <= wire.reset_at - begun - 0.333 <= 0.011


def test_ctrl_x_ends_the_homing_before_a_job_at_once() -> None:
    wire = Wire(VirtualGrbl(virtual_settings(MACHINE) | HOMING, baud=115_200))
    keys = Pressed(wire)
    here = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE), keys)
    here.unlock()
    here.jog(x=-100, y=-100, feed_mm_min=6000)
    begun = wire.now()
    keys.press(begun + 0.5)
    with pytest.raises(JobStopped, match="stopped at the keyboard"):
        here.cut(replace(JOB, options=replace(JOB.options, home=True)))
    assert b"$H\n\x18" in wire.sent
    assert 0 <= wire.reset_at - begun - 0.5 <= 0.011
    assert here.state.state in ("Alarm", "Idle")


class Blow(Pressed):
    """Something that happens to the controller at its time, or a key that is none of the list."""

    def __init__(self, wire: Wire, blow: Callable[[], object]) -> None:
        super().__init__(wire)
        self._blow = blow

    def pressed(self) -> str:
        if super().pressed():
            self._blow()
            return "z"
        return ""


@pytest.mark.parametrize(
    ("blow", "told"),
    [
        (lambda wire: wire.device.receive(b"\x84"), "The jog ended in state Door"),
        (lambda wire: wire.device.press_limit("X"), "did not answer a status query"),
    ],
    ids=["a lid", "a limit"],
)
def test_a_jog_that_ends_elsewhere_is_told_and_not_left_to_go_on(
    blow: Callable[[Wire], object], told: str
) -> None:
    """It would go on when the lid is shut; after a hard limit GRBL is deaf until a reset."""
    wire = Wire(VirtualGrbl(virtual_settings(MACHINE) | {21: 1}, baud=115_200))
    keys = Blow(wire, lambda: blow(wire))
    here = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE), keys)
    here.open()
    keys.press(wire.now() + 0.5)
    with pytest.raises(ControllerError, match=told):
        here.jog(x=30, feed_mm_min=1000)
    assert wire.sent.count(b"\x18") == 1
    wire.device.advance(30.0)
    assert wire.device.position[0] < 20


def test_a_controller_that_hangs_in_a_line_is_reset() -> None:
    device = VirtualGrbl(virtual_settings(MACHINE), baud=115_200, faults=parse_faults(["hang@10s"]))
    here = MachineSession(wire := Wire(device), StopSignals(), PortSetup.of(MACHINE))
    here.open()
    here.conversation.pause(10.5)
    with pytest.raises(ControllerError, match="did not answer 'G4P1' within 180 s"):
        here.say("G4 P1")
    assert b"\x18" in wire.sent


def test_nothing_typed_and_keys_that_are_none_send_nothing() -> None:
    here, wire = session()
    here._keys = Blow(wire, lambda: None)
    here.open()
    wire.sent = b""
    here.say("  ")
    here._keys.press(wire.now())
    here.watch(0.3)
    assert wire.sent == b""


class Reticent(Wire):
    """To a board whose reports never tell the overrides."""

    def read(self, timeout: float) -> bytes:
        return re.sub(rb"\|Ov:[0-9,]*", b"", super().read(timeout))


def test_a_board_that_never_tells_its_overrides_is_opened_and_taken_as_written() -> None:
    wire = Reticent(VirtualGrbl(virtual_settings(MACHINE), baud=115_200, greets=False))
    here = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE))
    assert here.open().overrides == (100, 100, 100)
    assert here.jog(x=5).position[0] == 5.0


class Hammered(Pressed):
    """... and pressed again at each look from then on."""

    def pressed(self) -> str:
        return "\x18" * (self._wire.now() >= self._at)


def test_a_reset_that_a_resting_controller_missed_is_sent_again() -> None:
    here, wire = session(s32=0)
    light(here)
    wire.lose_resets = 2
    assert here.abort(at_once=True)
    assert wire.sent.count(b"\x18") == 3
    assert not wire.device.beam_on


def test_a_second_press_does_not_end_a_stop_that_the_controller_has_not_heard() -> None:
    """The first reset is lost; the repetition must come, however often somebody presses."""
    wire = Wire(VirtualGrbl(virtual_settings(MACHINE) | {32: 0}, baud=115_200))
    keys = Hammered(wire)
    here = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE), keys)
    light(here)
    assert here.watch(0.2).beam_on
    wire.lose_resets = 1
    keys.press(wire.now())
    here.watch(0.1)
    assert wire.lose_resets == 0
    assert wire.sent.count(b"\x18") == 2
    assert not wire.device.beam_on
    assert here.state.beam_off
    keys.press(math.inf)
    assert here.close()


TYPED = st.sampled_from(
    ["M3 S500", "M3", "M4", "M4S20", "M5", "S300", "S0", "S9", "G1 X1 F6000", "G0 X0", "G80",
     "G1 F6000 S40", "G0 M3 S5", "G1 X2 F6000 M3 S60", "(M3) S7", "$32=0", "$32=1", "M30",
     "$N0=M3S30", "$N1=G1F600M3", "$RST=$", "$J=G91X1F6000", "reset", "]"]
)  # fmt: skip


@settings(deadline=None, max_examples=60)
@given(st.lists(TYPED, max_size=8), st.booleans())
def test_no_line_of_a_person_lights_a_resting_beam_unless_it_is_sent_twice(
    lines: list[str], laser_mode: bool
) -> None:
    here, wire = session(s32=laser_mode)
    here.open()
    wanted = False
    for line in lines:
        sent = wire.sent
        try:
            here.realtime(b"\x9a") if line == "]" else here.say(line)
        except GcodeError as held:
            assert wire.sent.replace(sent, b"").strip() in (b"", b"$G")  # it was not sent
            here.say(line)
            rest(here)
            # And would indeed have done that, but for what was armed in laser mode.
            later = "the next reset" in str(held) or "$32=0" in lines
            assert wire.device.beam_on or later, line
            wanted = True
        rest(here)
        wanted &= wire.device.beam_on
        assert wanted or not wire.device.beam_on, line
    assert here.close()
    assert not wire.device.beam_on


@pytest.mark.parametrize(
    ("laser_mode", "before", "lights"),
    [
        (True, ["S900", "G1 X30 F600"], "M3"),  # it moves, and does not tell its modes
        (False, ["S900", "G1 X30 F600"], "M3"),
        (True, ["M3 S900", "$32=0"], "G1 X1 F600"),  # what is armed and dark
        (False, [], "$N0=M3S900"),
    ],
)
def test_a_beam_that_would_rest_is_asked_for_whatever_came_before(
    laser_mode: bool, before: list[str], lights: str
) -> None:
    here, wire = session(s32=laser_mode)
    for line in before:
        here.say(line)
    with pytest.raises(GcodeError, match=r"would be on, with S900"):
        here.say(lights)
    here.settle()
    assert not wire.device.beam_log
    assert not wire.device.beam_on


def test_an_abort_ends_what_a_startup_block_lights_after_each_reset() -> None:
    here, wire = session(s32=0)
    with pytest.raises(GcodeError, match="M5, and again after each reset"):
        here.say("$N0=M3S500")
    here.say("$N0=M3S500")
    assert wire.device.beam_on
    assert here.abort()
    assert not wire.device.beam_on
    light(here)
    assert here.close()
    assert not wire.device.beam_on


@pytest.mark.parametrize("armed", ["M3 S900", "M4 S900"])
def test_a_jog_with_an_armed_beam_is_dark(armed: str) -> None:
    """GRBL moves a jog with the beam that is armed, as a cut."""
    here, wire = session(s32=1)
    here.say(armed)
    here.jog(x=10.0)
    here.say(armed)
    here.nudge(1.0, 0.0)
    here.watch(1.0)
    here.say(armed)
    here.go_to_origin()
    assert not wire.device.beam_log
    assert here.state.position == (0.0, 0.0, 0.0)


def test_a_session_that_is_left_with_the_beam_on_goes_dark() -> None:
    here, wire = session(s32=0)
    light(here)
    assert wire.device.beam_on
    assert here.close()
    assert b"\x18" in wire.sent
    assert not wire.device.beam_on


@pytest.mark.parametrize("when", ["waits", "second sheet"])
@pytest.mark.parametrize(
    "fault", ["reset", "power", "alarm", "disconnect", "hang", "drop-reply=all"]
)
def test_a_fault_between_two_sheets_or_in_the_second_ends_dark(fault: str, when: str) -> None:
    """What ``test_one_session`` does with real processes and a pty, in the controller's time."""
    whole, wire = session()
    whole.cut(JOB)
    first = wire.device.now
    whole.load()
    whole.cut(JOB)
    second = wire.device.now - first
    assert whole.close()
    at = first + 2.0 if when == "waits" else first + 5.0 + 0.5 * second
    device = VirtualGrbl(
        virtual_settings(MACHINE), baud=115_200, faults=parse_faults([f"{fault}@{at:.2f}s"])
    )
    wire = Wire(device)
    here = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE))
    here.cut(JOB)
    burnt = len(device.beam_log)

    def wait_and_cut() -> None:
        end = device.now + 5.0
        while device.now < end:
            here.watch(0.1)
        here.load()
        here.cut(JOB)

    lost = when == "waits" and fault in ("reset", "power")
    with pytest.raises(MachineError, match="restarted by itself since" if lost else "."):
        wait_and_cut()
    if lost:  # a person says where the head stands, or that the place does not matter
        forced = replace(JOB, options=replace(JOB.options, force=frozenset({"position"})))
        if fault == "power":
            here.set_origin()
        assert here.cut(JOB if fault == "power" else forced).lines == 15
        burnt = len(device.beam_log)
    here.close()
    device.advance(30.0)
    assert not device.beam_on
    assert standing_seconds(device.beam_log) == 0.0
    assert (len(device.beam_log) == burnt) == (when == "waits")


def test_a_sheet_that_is_burnt_takes_no_second_job() -> None:
    here, wire = session()
    wire.blocks = True
    here.cut(JOB)
    assert here.state.loaded == Burnt("rows.nc", JOB.sha256)
    burnt = len(wire.device.beam_log)
    fresh = r"rows\.nc has burnt on the sheet in the machine; put in fresh material and say so"
    with pytest.raises(PersonNeeded, match=fresh):
        here.cut(JOB)
    assert len(wire.device.beam_log) == burnt
    rest = replace(JOB, resumption=Resumption(JOB.job, JOB.sha256, 1, 0, 0, 6))
    assert here.cut(rest).lines == 15  # which goes on where it is
    here.load()
    assert here.cut(JOB).lines == 15


def test_no_machine_turns_a_sheet_over_by_itself() -> None:
    here, wire = session()
    wire.blocks = True
    fed = replace(MACHINE, bed=replace(MACHINE.bed, roll_fed=True))
    front = replace(JOB, back="b")
    for machine in (MACHINE, fed):
        for burnt, which in (("b", "turn the sheet over"), ("other", "whose back is")):
            here.known.loaded = Burnt("sheet-01-back.nc", burnt)
            with pytest.raises(PersonNeeded, match=rf"{which}.* by its three holes and say so"):
                here.cut(replace(front, machine=machine))
    assert here.cut(replace(front, machine=fed, back=None)).lines == 15


def test_a_stop_that_a_job_did_not_get_through_is_sent_again_at_the_close() -> None:
    def fail(now: Progress) -> None:
        if now.line > 3:
            raise RuntimeError

    here, wire = session()
    here.open()
    wire.lose_resets = 3
    with pytest.raises(RuntimeError):
        here.cut(JOB, on_progress=fail)
    assert (wire.sent.count(b"\x18"), wire.lose_resets) == (3, 0)
    assert here.close()
    assert wire.sent.count(b"\x18") == 4


def test_a_key_acts_again_behind_a_job() -> None:
    class Asked:
        keys = ""

        def pressed(self) -> str:
            pressed, self.keys = self.keys, ""
            return pressed

    keys = Asked()
    wire = Wire(VirtualGrbl(virtual_settings(MACHINE), baud=115_200))
    here = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE), keys)
    here.cut(JOB)
    keys.keys = "q"
    here.watch(0.2)
    assert b"\x18" in wire.sent


@pytest.mark.parametrize("dialect", ["marlin", "hpgl"])
def test_a_machine_that_only_takes_jobs_says_so(dialect: str) -> None:
    wire = Wire(VirtualGrbl())
    with pytest.raises(InputError, match=f"speaks {dialect} only takes whole jobs"):
        MachineSession(wire, StopSignals(), PortSetup(dialect)).open()
    assert wire.sent == b""


@pytest.mark.parametrize("seed", [1, 2])
def test_the_state_is_true_and_no_beam_stands_after_each_of_many_actions(seed: int) -> None:
    """``benchmarks/session_hour.py`` walks 10,000."""
    walk = Walk(seed)
    for _ in range(120):
        walk.step()
    assert len(walk.done) > 20


# The jog pad


def run(here: MachineSession, wire: Wire, presses: list[tuple[float, float, float]]) -> float:
    """Press at times from now; the time of the last press."""
    begin = here.conversation.now()
    for at, x, y in presses:
        while here.conversation.now() < begin + at:
            here.watch(min(0.01, begin + at - here.conversation.now()))
        here.nudge(x, y)
    return here.conversation.now()


def test_a_tap_is_one_step() -> None:
    here, wire = session()
    for count in range(1, 4):
        run(here, wire, [(0.0, 10.0, 0.0)])
        here.watch(1.0)
        assert wire.device.position[0] == pytest.approx(10 * count, abs=0.01)


@pytest.mark.parametrize("step", [0.1, 1.0, 10.0, 50.0])
def test_a_held_arrow_moves_on_and_rests_within_a_step_of_release(step: float) -> None:
    here, wire = session()
    states = []
    here.on_state = lambda state: states.append(state.state)
    run(here, wire, [(0.0, step, 0.0), *((0.5 + 0.033 * n, step, 0.0) for n in range(60))])
    released = wire.device.position[0]
    moving = states[len(states) // 3 :]
    here.watch(3.0)
    rest = wire.device.position[0]
    assert set(moving) == {"Jog"}
    assert released > 2 * step
    assert 0 <= rest - released <= step + 0.025  # two steps of the motor
    assert wire.device.state == "Idle"


def test_a_storm_of_arrows_queues_up_nothing_and_changes_nothing() -> None:
    here, wire = session()
    ways = itertools.cycle(((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)))
    run(here, wire, [(0.001 * n, *next(ways)) for n in range(2000)])
    jogs, overrides = wire.sent.count(b"$J="), here.state.overrides
    assert jogs < 100
    here.watch(1.0)
    assert wire.sent.count(b"$J=") <= jogs + 1
    assert wire.device.state == "Idle"
    assert max(abs(value) for value in wire.device.position) < 10
    assert overrides == (100, 100, 100)


def test_another_direction_cancels_first() -> None:
    pad = JogPad()
    pad.press(1.0, 0.0, 0.0)
    assert pad.next_order(0.0, None, True, {}) is None  # where it stands is not told yet
    order = pad.next_order(0.0, (0.0, 0.0), True, {})
    assert order is not None
    assert order.startswith(b"$J=G21G91X1.000F")
    pad.press(0.0, 1.0, 0.1)
    assert pad.next_order(0.1, (0.1, 0.0), False, {}) == JOG_CANCEL
    assert pad.next_order(0.2, (0.2, 0.0), False, {}) is None
    order = pad.next_order(0.5, (0.2, 0.0), True, {})
    assert order is not None
    assert order.startswith(b"$J=G21G91Y1.000")


# Who has the port


def test_the_owner_of_a_port_is_known_until_its_process_is_gone(
    tmp_path: os.PathLike[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setattr(sys, "argv", ["/usr/bin/miurafab", "machine", "jog"])
    port = "socket://127.0.0.1:4001"
    assert holder_of(port) == "; do it there"
    release = claim(port, Owner("miurafab machine open x", 7, this_owner().since, os.getpid()))
    assert "process 7 (miurafab machine open x), since " in holder_of(port)
    assert holder_of(port).endswith("jog it in that session with the arrow keys")
    release()
    assert owner_of(port) is None
    with subprocess.Popen([sys.executable, "-c", ""]) as gone:
        gone.wait()
    claim(port, Owner("miurafab cut x", gone.pid, this_owner().since, gone.pid))
    assert owner_of(port) is None
    claim(port, Owner("miurafab studio", 7, this_owner().since, os.getpid()))
    assert holder_of(port).endswith("; do it there, on the tab Machine")
    claim(port, Owner("miurafab cut x", 7, this_owner().since, os.getpid()))
    assert holder_of(port).endswith("; wait for its end, or stop it there")


def test_a_claim_that_another_session_made_meanwhile_stays(
    tmp_path: os.PathLike[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    port = "socket://127.0.0.1:4001"
    release = claim(port, Owner("first", 7, 1.0, os.getpid()))
    claim(port, second := Owner("second", 8, 2.0, os.getpid()))
    release()
    assert owner_of(port) == second


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="Linux tells who has a device open")
def test_whoever_else_has_the_device_open_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    port = str(tmp_path / "port")
    code = "import sys; held = open(sys.argv[1], 'w'); print(flush=True); sys.stdin.read()"
    command = [sys.executable, "-c", code, port]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen(command, **pipes) as other:
        assert other.stdout is not None
        other.stdout.readline()
        said = holder_of(port)
        other.communicate()
    assert said == f", process {other.pid} ({' '.join(command)[:100]}); do it there"
    assert holder_of(port) == "; do it there"
