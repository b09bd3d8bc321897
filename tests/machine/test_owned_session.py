"""The session that owns a port, with the virtual controller: what it sends, knows and leaves."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from session_walk import FRAME, HOMING, JOB, MACHINE
from wires import FakeWire

from miurafab.errors import ControllerError, GcodeError, JobStopped, MachineError, PortError
from miurafab.gcode.job import Job, SendLine
from miurafab.grbl.settings import Settings
from miurafab.machine.journal import read_journal
from miurafab.machine.known_controller import MachineState, PortSetup
from miurafab.machine.machine_session import MachineSession
from miurafab.machine.owner import Owner, owner_of, this_owner
from miurafab.machine.planning import plan_job
from miurafab.machine.progress import Progress
from miurafab.machine.resting_beam import resting_power
from miurafab.machine.signals import StopSignals
from miurafab.simulate.faults import parse_faults
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings


def here(**changes: float) -> tuple[MachineSession, FakeWire]:
    """A session with the virtual controller."""
    values = virtual_settings(MACHINE) | {int(name[1:]): value for name, value in changes.items()}
    wire = FakeWire(VirtualGrbl(values, baud=115_200))
    return MachineSession(wire, StopSignals(), PortSetup.of(MACHINE)), wire


def sent_by(wire: FakeWire, action: object) -> bytes:
    """What goes over the wire in ``action``, without the status queries."""
    assert callable(action)
    before = len(wire.commands)
    action()
    return wire.commands[before:]


def test_all_that_is_known_of_a_machine_at_rest() -> None:
    session, wire = here()
    state = session.open()
    assert state == MachineState(
        port="the fake wire",
        firmware="Grbl 1.1h",
        state="Idle",
        position=(0.0, 0.0, 0.0),
        machine_position=(0.0, 0.0, 0.0),
        work_offset=(0.0, 0.0, 0.0),
        shift=(0.0, 0.0, 0.0),
        modes=("G0", "G54", "G17", "G21", "G90", "G94", "M5", "M9", "T0", "F0", "S0"),
        overrides=state.overrides,
        beam_on=False,
        beam_off=True,
        pins="",
        loaded=None,
        settings=state.settings,
    )
    assert state.overrides == (100, 100, 100)
    assert state.settings.values == pytest.approx(wire.device.settings, abs=5e-4)
    session.realtime(b"\x91")
    wire.device.press_limit("X")
    session.say("M8")
    session.watch(1.5)
    after = session.look()
    assert after.overrides.feed == 110
    assert after.pins == "X"
    assert "M8" in after.modes


def test_what_is_known_is_known_no_more_after_a_reset() -> None:
    session, wire = here()
    session.set_origin()
    assert sent_by(wire, session.set_origin) == b"G92X0.000Y0.000\n$#\n"
    assert sent_by(wire, session.abort) == b"\x18"
    assert sent_by(wire, session.set_origin) == (
        b"$#\n$G\nG21G90G17G94G54\nG92X0.000Y0.000\n$#\n$G\n"
    )


def test_the_offset_of_a_job_is_that_of_g54_with_the_shift() -> None:
    session, _ = here()
    session.say("G10L2P1X7Y-2")
    session.say("G92X3")
    assert session.known.job_offset() == pytest.approx((-3.0, -2.0, 0.0))


def test_a_session_that_is_dark_and_at_rest_is_left_without_a_reset() -> None:
    session, wire = here()
    session.open()
    assert sent_by(wire, session.abort) == b"\x18"
    assert sent_by(wire, session.close) == b""
    session, wire = here()
    session.say("$C")
    assert session.look().state == "Check"
    assert sent_by(wire, session.close) == b""
    session, wire = here(s22=1, s24=500, s25=3000)
    assert session.open().state == "Alarm"
    session.look()
    assert sent_by(wire, session.close) == b""


def test_a_stop_that_was_not_confirmed_is_tried_again_at_the_end() -> None:
    session, wire = here(s32=0)
    session.open()
    write = wire.write
    lost = (b"\x18", b"M5\n")
    wire.write = lambda data: write(b"" if data in lost else data)  # type: ignore[method-assign]
    wire.device.receive(b"M3S500\n")
    assert session.abort() is False
    wire.write = write  # type: ignore[method-assign]
    assert sent_by(wire, session.close) == b"\x18"
    wire.settle()
    assert not wire.device.beam_on


def test_a_refused_line_takes_no_reset() -> None:
    session, wire = here()
    session.set_origin()

    def refused() -> None:
        with pytest.raises(ControllerError, match="error:20"):
            session.say("G99")

    assert b"\x18" not in sent_by(wire, refused)


def jogging() -> tuple[MachineSession, FakeWire]:
    """A session whose head is on its way over 50 mm."""
    session, wire = here()
    session.open()
    session.nudge(50.0, 0.0)
    session.watch(0.2)
    assert session.state.state == "Jog"
    return session, wire


def test_a_dark_jog_comes_to_rest_before_the_reset_unless_it_is_to_be_at_once() -> None:
    session, wire = jogging()
    assert sent_by(wire, session.abort) == b"!\x18"
    assert session.look().state == "Idle"  # no alarm: the position is not lost
    assert b"$J" not in sent_by(wire, lambda: session.watch(1.0))
    session, wire = jogging()
    assert sent_by(wire, lambda: session.abort(at_once=True)) == b"\x18"


def test_a_jog_that_burns_is_reset_at_once() -> None:
    session, wire = jogging()
    status = session.conversation.status
    assert status is not None
    session.conversation.status = replace(status, speed=500.0)
    assert sent_by(wire, session.abort) == b"\x18"


def test_a_beam_of_which_nothing_is_known_is_disarmed_before_a_jog() -> None:
    session, wire = here()
    session.open()
    assert "M5" in session.state.modes
    status = session.look() and session.conversation.status
    assert status is not None
    session.known.may_differ()
    session.conversation.status = replace(status, state="Run")  # it tells no modes meanwhile
    assert sent_by(wire, session.known.disarm) == b"M5\n"


def test_modes_of_which_the_answer_was_lost_are_not_known_before_a_jog() -> None:
    session, wire = here()
    session.open()
    assert "M5" in session.state.modes
    read = wire.read

    def lossy(timeout: float) -> bytes:
        data = read(timeout)
        return b"" if wire.commands.endswith(b"M4S500\n$#\n$G\n") else data

    wire.read = lossy  # type: ignore[method-assign]
    with pytest.raises(ControllerError, match=r"did not answer '\$G' within 3 s"):
        session.say("M4S500")
    assert session.state.modes == ()
    session.jog(x=2.0)
    assert wire.device.beam_log == []


def test_an_origin_set_in_mid_move_is_no_word_on_the_modes_of_a_job() -> None:
    session, wire = here()
    session.open()
    session.say("G1M4S300X2F1000")
    assert session.state.state == "Run"
    session.set_origin()
    session.watch(1.0)
    wire.device.beam_log.clear()
    job = Job("dark.nc", "G21\nG90\nM4\nG1X9F3000\nM5\n")  # burns nothing, by its dry run
    session.cut(plan_job(job, MACHINE))
    assert wire.device.beam_log == []


def test_a_broken_account_at_rest_is_told_and_asks_nothing() -> None:
    session, wire = here()
    session.say("G92X1")
    wire.lies = [(wire.now() + 0.1, b"ok\r\n")]
    session.watch(0.3)
    session.known.may_differ()
    assert sent_by(wire, session.look) == b""
    with pytest.raises(ControllerError, match=r"not ready for 'M8' \(it is unsynced\); reset it"):
        session.say("M8")


def test_a_hold_pressed_at_the_machine_is_no_pause_of_the_program() -> None:
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=115_200))
    session = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE))
    orders = [(1.0, b"!"), (4.0, b"~")]

    def press(call: int) -> None:
        if orders and wire.now() >= orders[0][0]:
            wire.device.receive(orders.pop(0)[1])

    wire.before_call = press
    assert session.cut(replace(JOB, at_pause="go on")).seconds > 4
    assert not orders
    assert b"~" not in wire.commands


@pytest.mark.parametrize(
    ("lines", "laser_mode", "power"),
    [
        ("M3 S500", False, 500.0),
        ("M4 S500", False, 500.0),
        ("M3 S500", True, 0.0),
        ("G1 M3 S500", True, 500.0),
        ("G2 M3 S500", True, 500.0),
        ("G3 M3 S500", True, 500.0),
        ("G1 M4 S500", True, 0.0),
        ("G1 M3 S500 G0", True, 0.0),
        ("G1 M3 S500 G80", True, 0.0),
        ("G1 M3 S500 G38.2", True, 0.0),
        ("G1 M3 S500 G4", True, 500.0),
        ("M3 S500 M2", False, 0.0),
        ("M3 S500 M5", False, 0.0),
        ("M3 S500 M30", False, 0.0),
        ("M3 S500 M8", False, 500.0),
        ("M3 S500 S0", False, 0.0),
    ],
)
def test_the_power_of_a_beam_at_rest(lines: str, laser_mode: bool, power: float) -> None:
    words = [(word[0], float(word[1:])) for word in lines.split()]
    assert resting_power(words, laser_mode=laser_mode) == power


def test_what_was_typed_counts_no_more_once_the_modes_are_told() -> None:
    session, wire = here(s32=1)
    session.say("G1 X1 F600")
    session.settle()
    session.set_origin()  # which leaves G1
    session.say("M3 S500")
    assert not wire.device.beam_on
    with pytest.raises(GcodeError, match="would be on, with S500"):
        session.say("G1 X2 F600")


def test_an_abort_forgets_the_arrows_that_are_still_held() -> None:
    session, wire = jogging()
    session.nudge(50.0, 0.0)
    session.nudge(0.0, 50.0)
    session.abort()
    assert b"$J" not in sent_by(wire, lambda: session.watch(1.0))


class Once:
    """A keyboard whose keys are pressed once."""

    keys = ""

    def pressed(self) -> str:
        keys, self.keys = self.keys, ""
        return keys


@pytest.mark.parametrize(("key", "sent"), [("q", b"!\x18"), ("\x18", b"\x18")])
def test_a_key_that_aborts_a_watched_jog(key: str, sent: bytes) -> None:
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=115_200))
    keys = Once()
    session = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE), keys)
    session.open()
    session.nudge(50.0, 0.0)
    session.watch(0.2)
    keys.keys = key
    assert sent_by(wire, lambda: session.watch(0.1)) == sent


def test_what_is_ordered_at_once_is_ended_at_the_close() -> None:
    session, wire = here()
    session.open()
    session.realtime(b"!")
    assert sent_by(wire, session.close) == b"\x18"


def test_a_step_that_was_just_sent_is_ended_at_the_close() -> None:
    session, wire = here()
    session.nudge(50.0, 0.0)
    assert sent_by(wire, session.close) == b"\x18"
    session, wire = here()
    session.nudge(5.0, 0.0)
    session.watch(2.0)
    assert sent_by(wire, session.close) == b""


def test_a_controller_that_sleeps_is_left_asleep() -> None:
    session, wire = here()
    session.say("$SLP")
    assert session.look().state == "Sleep"
    assert sent_by(wire, session.close) == b""


@pytest.mark.parametrize(
    "action",
    [
        lambda session: session.home(),
        lambda session: session.jog(x=900.0),
        lambda session: session.say("G99"),
    ],
    ids=["home", "jog", "say"],
)
def test_silence_after_a_refusal_is_no_rest(action: Callable[[MachineSession], object]) -> None:
    session, wire = here(s20=1, s22=1, s24=500, s25=3000)
    session.unlock()
    session.home()
    session.set_origin()
    write = wire.write

    def deaf(data: bytes) -> None:
        if b"$H" in data:
            data = b"$Q\n"
        write(
            b""
            if data == b"?" and wire.commands.endswith((b"$Q\n", b"F1000\n", b"G99\n"))
            else data
        )

    wire.write = deaf  # type: ignore[method-assign]
    with pytest.raises(ControllerError, match="refused"):
        action(session)
    assert b"\x18" in wire.bytes_written


def test_nothing_is_asked_while_a_line_is_unanswered() -> None:
    session, wire = here()
    session.open()
    connection = session.conversation.connection
    session.conversation.write(connection.send_line(SendLine(1, b"G4P1")))
    session.known.may_differ()
    assert sent_by(wire, lambda: session.watch(0.5)) == b""
    assert sent_by(wire, session.look) == b""
    assert sent_by(wire, lambda: session.watch(1.0)) == b"$#\n$G\n"


@pytest.mark.parametrize(
    ("key", "order"), [(" ", b"!"), ("r", b"~"), ("+", b"\x91"), ("c", b"\x85")]
)
def test_a_key_acts_while_no_job_runs(key: str, order: bytes) -> None:
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=115_200))
    keys = Once()
    session = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE), keys)
    session.open()
    keys.keys = key
    assert sent_by(wire, lambda: session.watch(0.1)) == order


def test_a_key_waits_for_a_controller_that_is_deaf_while_it_stores() -> None:
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=115_200))
    keys = Once()
    session = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE), keys)
    session.open()
    stores = session.conversation.connection
    deaf: list[bool] = []

    def press(call: int) -> None:
        deaf.append(stores.writing_eeprom)
        if deaf[-1] and not any(deaf[:-1]):
            keys.keys = "+"
        if wire.commands.endswith(b"\x91"):
            assert not stores.writing_eeprom
            wire.before_call = lambda call: None

    wire.before_call = press
    session.say("G10 L2 P1 X1")
    assert wire.commands.count(b"\x91") == 1
    assert any(deaf)


def test_another_arrow_cancels_a_step_and_moves_at_rest() -> None:
    session, wire = here()
    session.open()
    session.nudge(200.0, 0.0)
    session.watch(0.5)
    session.nudge(0.0, 10.0)
    assert wire.commands.endswith(b"\x85")
    sent = sent_by(wire, lambda: session.watch(2.0))
    assert sent.startswith(b"$J=G21G91Y10.000F")
    assert wire.device.position[0] < 200
    assert wire.device.position[1] == pytest.approx(10.0, abs=0.01)


@pytest.mark.parametrize(("key", "sent"), [("q", b"!\x18"), ("\x18", b"\x18")])
def test_a_key_that_aborts_a_jog_that_is_waited_for(key: str, sent: bytes) -> None:
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=115_200))
    keys = Once()
    session = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE), keys)
    session.open()

    def press(call: int) -> None:
        if wire.device.position[0] > 1.0:
            keys.keys, wire.before_call = key, lambda call: None

    wire.before_call = press
    with pytest.raises(JobStopped, match="stopped at a key") as caught:
        session.jog(x=50.0)
    assert type(caught.value) is JobStopped
    assert wire.commands.partition(b"F1000\n")[2] == sent


@pytest.mark.parametrize(
    "action",
    [
        lambda session: session.jog(x=1.0),
        lambda session: session.nudge(1.0, 0.0),
        lambda session: session.set_origin(),
        lambda session: session.go_to_origin(),
        lambda session: session.command("M8"),
        lambda session: session.say("M8"),
    ],
)
def test_whatever_is_done_first_greets_the_machine(
    action: Callable[[MachineSession], object],
) -> None:
    session, wire = here()
    assert sent_by(wire, lambda: action(session)).startswith(b"$I\n$$\n")
    assert session.known.opened


def test_a_session_is_opened_with_a_reset_where_one_is_asked_for() -> None:
    session, wire = here()
    session.conversation.pause(0.5)
    session.open(reset=True)
    assert wire.commands.startswith(b"\x18")


@pytest.mark.parametrize("way", [MachineSession.home, lambda session: session.say("$h")])
def test_homing_tells_where_the_machine_stands_after_a_restart(
    way: Callable[[MachineSession], object],
) -> None:
    """A stored offset outlives the restart, so that nothing but the homing is said after it."""
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE) | HOMING, baud=115_200))
    session = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE))
    assert sent_by(wire, session.home).startswith(b"$I\n$$\n")
    session.say("G10 L2 P1 X-300 Y-300")
    wire.device.power_cycle()
    assert session.watch(1.0).state == "Alarm"
    session.unlock()
    with pytest.raises(ControllerError, match="restarted by itself since the last job"):
        session.cut(JOB)
    way(session)
    assert session.cut(JOB).lines == 15


def test_the_origin_of_jobs_is_gone_to_from_any_place_and_system() -> None:
    session, wire = here()
    session.say("G10 L2 P2 X7 Y8")
    session.say("G55")
    session.jog(x=20.0, y=30.0)
    session.go_to_origin()
    assert wire.device.position[:2] == pytest.approx((0.0, 0.0), abs=0.01)
    assert "G54" in session.state.modes


@pytest.mark.parametrize("action", ["jog", "settle"])
def test_a_motion_that_is_waited_for_is_asked_about_ten_times_a_second(action: str) -> None:
    session, wire = jogging() if action == "settle" else here()
    session.open()
    begun, before = wire.now(), wire.bytes_written.count(b"?")
    if action == "settle":
        session.settle()
    else:
        session.jog(x=50.0)
    seconds = wire.now() - begun
    assert seconds > 0.5
    assert wire.bytes_written.count(b"?") - before <= 10 * seconds + 3


def test_settling_leaves_a_motion_that_burns_to_whoever_ordered_it() -> None:
    session, wire = here()
    session.say("M4 S500")
    session.say("G1 X50 F600")
    begun = wire.now()
    state = session.settle()
    assert (state.state, state.beam_on) == ("Run", True)
    assert wire.now() - begun < 0.5


def test_a_step_that_is_refused_is_told_and_the_next_begins_afresh() -> None:
    session, wire = here(s20=1, **{f"s{number}": value for number, value in HOMING.items()})
    session.home()
    with pytest.raises(ControllerError, match="error:15"):
        session.nudge(900.0, 0.0)
    assert sent_by(wire, lambda: session.nudge(-5.0, 0.0)).startswith(b"$J=G21G91X-5.000F")
    session.watch(1.0)
    assert session.state.state == "Idle"


def test_a_session_leaves_a_board_that_rests_as_it_is() -> None:
    session, wire = here()
    wire.device.advance(0.5)
    wire.device.take_output()
    session.conversation.pause(0.5)
    session.open()
    assert wire.commands.startswith(b"$I\n")


def test_a_silent_board_is_waited_for_as_long_as_was_asked() -> None:
    def seconds(wait: float) -> float:
        wire = FakeWire(VirtualGrbl(baud=115_200, faults=parse_faults(["drop-reply=all@0s"])))
        with pytest.raises(PortError, match="Nothing that speaks GRBL"):
            MachineSession(wire, StopSignals(), PortSetup.of(MACHINE)).open(wait)
        return wire.now()

    assert 8 < seconds(9.0) - seconds(4.0) <= 10  # for a word, and once more after a reset


def test_nothing_is_asked_by_an_old_report_while_a_step_is_made() -> None:
    """What GRBL is asked in mid-jog it refuses; the disarming left its modes untold."""
    session, wire = here()
    session.say("M4")
    session.nudge(50.0, 0.0)
    wire.lies = [(wire.now() + 0.01, b"<Idle|MPos:0.000,0.000,0.000|FS:0,0>\r\n")]
    assert sent_by(wire, lambda: session.watch(0.1)) == b""
    assert sent_by(wire, lambda: session.watch(5.0)) == b"$G\n"


def test_a_watch_looks_at_the_wire_fifty_times_a_second() -> None:
    """A key that is held makes its next step as soon as it is due."""
    session, wire = here()
    session.open()
    waits: list[float] = []
    read = wire.read

    def reading(timeout: float) -> bytes:
        waits.append(timeout)
        return read(timeout)

    wire.read = reading  # type: ignore[method-assign]
    session.watch(0.5)
    assert max(waits) == pytest.approx(0.02)


def test_the_state_is_told_once_a_report_and_asked_for_ten_times_a_second() -> None:
    session, wire = here()
    states: list[str] = []
    session.on_state = lambda state: states.append(state.state)
    session.open()

    def asked(seconds: float) -> int:
        session.watch(0.2)
        before, told = wire.bytes_written.count(b"?"), len(states)
        begun = wire.now()
        session.watch(seconds)
        assert wire.now() - begun == pytest.approx(seconds)
        count = wire.bytes_written.count(b"?") - before
        assert abs(len(states) - told - count) <= 1
        return count

    assert 9 <= asked(1.005) <= 11
    session.nudge(200.0, 0.0)
    assert 15 <= asked(1.005) <= 20
    assert set(states) == {"Idle", "Jog"}


def test_the_head_goes_to_the_origin_at_a_rate_of_ours_where_none_is_told() -> None:
    session, wire = here()
    session.open()
    assert b"F6000\n" in sent_by(wire, session.go_to_origin)
    session.known.settings = Settings({})
    assert b"F3000\n" in sent_by(wire, session.go_to_origin)


def test_a_lid_that_is_shut_again_is_the_only_one_that_new_material_resumes() -> None:
    session, wire = here()
    session.open()
    assert sent_by(wire, session.load) == b""
    wire.device.receive(b"\x84")
    assert session.look().state == "Door:1"
    assert sent_by(wire, session.load) == b""
    assert session.watch(1.0).state == "Door:0"
    assert sent_by(wire, session.load) == b"~"
    assert session.state.state == "Idle"


def test_an_unlocking_behind_a_hard_limit_says_at_once_that_a_reset_comes_first() -> None:
    session, wire = here()
    session.command("$22=1")
    session.command("$21=1")
    session.say("G1X50F600")
    wire.device.press_limit("X")
    wire.device.press_limit("X", False)
    assert session.watch(0.5).state == "Alarm"
    with pytest.raises(ControllerError, match="it is alarmed"):
        assert sent_by(wire, session.unlock) == b""
    assert wire.commands.count(b"\x18") == 0
    session.abort()
    assert session.unlock().idle


def test_new_material_goes_on_with_no_program_that_the_lid_interrupted() -> None:
    session, wire = here()
    session.say("M4S500")
    session.say("G1X5F1000")
    wire.device.receive(b"\x84")
    assert session.watch(0.5).state == "Door:0"
    wire.device.beam_log.clear()
    with pytest.raises(ControllerError, match="running when the lid was opened, and would go on"):
        session.load()
    session.watch(0.5)
    assert wire.device.beam_log == []
    session.abort()
    assert sent_by(wire, session.load) == b""
    assert session.state.state == "Idle"


def test_settling_waits_for_a_jog() -> None:
    session, wire = jogging()
    assert session.settle().state == "Idle"
    assert wire.device.state == "Idle"


def test_realtime_bytes_of_a_person_are_no_lines() -> None:
    session, wire = here()
    session.open()
    for text in "!~":
        assert sent_by(wire, lambda text=text: session.say(text)) == text.encode()
    before = wire.bytes_written.count(b"?")
    told: list[str] = []
    session.lines.on_line = told.append
    session.say("?")
    assert wire.bytes_written.count(b"?") > before
    assert [line for line in told if line.startswith("<Idle")] != []
    assert sent_by(wire, lambda: session.say(" reset ")) == b"\x18"
    assert sent_by(wire, lambda: session.say("(a comment)")) == b""


def test_fresh_material_is_told_before_a_word_and_at_rest() -> None:
    session, _ = here()
    assert session.load().state == ""
    session.open()
    assert session.load().state == "Idle"


def test_a_frame_leaves_the_sheet_fresh_and_a_cut_does_not() -> None:
    session, _ = here()
    progress: list[Progress] = []
    session.frame(FRAME, on_progress=progress.append)
    assert progress[-1].lines_acknowledged == FRAME.lines
    assert session.state.loaded is None
    session.cut(JOB)
    assert str(session.state.loaded) == "rows.nc"


def test_after_a_restart_of_its_own_a_job_begins_where_somebody_says() -> None:
    session, wire = here()
    session.cut(JOB)
    wire.device.power_cycle()
    session.watch(2.0)
    with pytest.raises(ControllerError, match="restarted by itself since"):
        session.cut(JOB)
    assert session.cut(replace(JOB, at=(0.0, 0.0))).lines == 15


def test_a_journal_knows_how_far_the_controller_plans_ahead(tmp_path: Path) -> None:
    session, _ = here()
    session.cut(JOB, journal_path=tmp_path / "rows.journal")
    (record,) = read_journal(tmp_path / "rows.journal")
    assert (record.blocks, record.from_line, record.ended) == (15, 1, "done")


def test_a_job_that_is_only_read_burns_no_sheet() -> None:
    session, _ = here()
    session.cut(replace(JOB, options=replace(JOB.options, check_mode=True)))
    assert session.state.loaded is None


def test_the_transcript_of_a_job_ends_with_it(tmp_path: Path) -> None:
    session, _ = here()
    session.cut(JOB, transcript_path=tmp_path / "rows.transcript")
    kept = (tmp_path / "rows.transcript").read_text()
    assert session.conversation.transcript is None
    session.say("M8")
    assert "M8" not in kept
    assert (tmp_path / "rows.transcript").read_text() == kept


def test_who_is_said_to_own_a_port_owns_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE)))
    wire.name = "socket://of-a-test"
    mine = this_owner()
    told = Owner("miurafab cut x", mine.process, mine.since, mine.holder)
    session = MachineSession(wire, StopSignals(), owner=told)
    assert owner_of(wire.name) == told
    session.close()
    assert owner_of(wire.name) is None
    session = MachineSession(wire, StopSignals())
    named = owner_of(wire.name)
    assert named is not None
    assert (named.process, named.holder) == (mine.process, mine.holder)
    session.close()
    assert owner_of(wire.name) is None


def test_a_signal_ends_the_homing_before_a_job() -> None:
    class Untouched:
        def pressed(self) -> str:
            return ""

    signals = StopSignals()
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE) | HOMING, baud=115_200))
    session = MachineSession(wire, signals, PortSetup.of(MACHINE), Untouched())
    session.unlock()
    session.jog(x=-100.0)

    def stop(call: int) -> None:
        if b"$H" in wire.commands:
            signals.caught = "SIGINT"

    wire.before_call = stop
    with pytest.raises(JobStopped, match="stopped by"):
        session.cut(replace(JOB, options=replace(JOB.options, home=True)))
    begun, reset = (next(t for t, sent in wire.written if d in sent) for d in (b"$H\n", b"\x18"))
    assert reset - begun < 0.2


def test_a_key_ends_the_homing_before_a_job_at_once() -> None:
    """GRBL hears no hold meanwhile, and answers nothing."""
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE) | HOMING, baud=115_200))

    class Stops:
        def pressed(self) -> str:
            return "q" if b"$H" in wire.commands else ""

    session = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE), Stops())
    session.unlock()
    session.jog(x=-100.0)
    with pytest.raises(JobStopped, match="stopped at the keyboard"):
        session.cut(replace(JOB, options=replace(JOB.options, home=True)))
    begun, reset = (next(t for t, sent in wire.written if d in sent) for d in (b"$H\n", b"\x18"))
    assert reset - begun < 0.2


def test_a_signal_ends_a_session_with_the_reset_first() -> None:
    signals = StopSignals()
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=115_200))
    session = MachineSession(wire, signals, PortSetup.of(MACHINE))
    session.open()
    calls = itertools.count()

    def stop(call: int) -> None:
        if next(calls) == 20:
            signals.caught = "SIGINT"

    wire.before_call = stop
    with pytest.raises((KeyboardInterrupt, JobStopped, MachineError, PortError)):
        session.jog(x=50.0)
    at = wire.commands.index(b"\x18")
    assert b"$J" not in wire.commands[at:]
    assert session.close()
