"""What the driver of GRBL takes for silence, for a loss and for a pause, and what for none."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from session_walk import HOMING, MACHINE
from wires import FakeWire

from miurafab.errors import ControllerError, JobStopped, PersonNeeded
from miurafab.gcode.job import Job
from miurafab.machine.dialects import virtual_machine
from miurafab.machine.known_controller import PortSetup
from miurafab.machine.machine_session import MachineSession
from miurafab.machine.planning import SendOptions, plan_job
from miurafab.machine.progress import Progress
from miurafab.machine.sender import deliver
from miurafab.machine.signals import StopSignals
from miurafab.profiles import MachineProfile, load_machine
from miurafab.simulate.beam import standing_seconds
from miurafab.simulate.faults import parse_faults
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings


def new_wire(*faults: str, latency: float = 0.0) -> FakeWire:
    values = virtual_settings(MACHINE)
    device = VirtualGrbl(values, baud=115_200, faults=parse_faults(faults))
    return FakeWire(device, latency=latency, seed=1)


def dawdling(
    wire: FakeWire, seconds: float, when: Callable[[Progress], bool]
) -> Callable[[Progress], None]:
    """Takes ``seconds`` to show the first progress that is so, as a terminal does at Ctrl-S."""
    left = [seconds]

    def show(now: Progress) -> None:
        if left and when(now):
            wire.device.advance(left.pop())

    return show


def within_a_minute(wire: FakeWire) -> None:
    """What would go on for ever fails."""

    def look(call: int) -> None:
        assert wire.now() < 60

    wire.before_call = look


def test_who_dawdles_while_the_controller_dwells_loses_no_answer() -> None:
    """It idles while it dwells; what the program misses meanwhile is no loss."""
    wire = new_wire()
    job = Job("dwell.nc", "M4 S0\nG1 X20 S500 F3000\nG4 P1\nG1 X30\nM5\n")
    show = dawdling(wire, 9.0, lambda now: now.state == "Idle" and now.in_flight > 0)
    assert deliver(plan_job(job, MACHINE), wire, StopSignals(), on_progress=show).seconds > 9
    assert sum(abs(s.x1 - s.x0) for s in wire.device.beam_log) == pytest.approx(30, abs=0.2)
    assert b"\x18" not in wire.commands


def test_who_dawdles_until_a_dwell_begins_loses_no_answer() -> None:
    """The last answer came long before, as the moves before the dwell are slow."""
    wire = new_wire()
    job = Job("dwell.nc", "M4 S0\nG1 X20 S500 F120\nG4 P2\nG1 X30 F3000\nM5\n")
    show = dawdling(wire, 9.0, lambda now: now.seconds_elapsed > 1)
    result = deliver(plan_job(job, MACHINE), wire, StopSignals(), on_progress=show)
    assert 10 < result.seconds < 15
    assert b"\x18" not in wire.commands


@pytest.mark.parametrize("seconds", [4.0, 4.1, 4.2, 4.3])
def test_an_answer_that_comes_with_a_report_of_the_dwell_is_no_loss(seconds: float) -> None:
    """As over a network: the report was made before the answer, and both are read at once."""

    class Coarse(FakeWire):
        kept, due = b"", 0.0

        def read(self, timeout: float) -> bytes:
            self.kept += super().read(timeout)
            if self.now() < self.due:
                return b""
            said, self.kept, self.due = self.kept, b"", self.now() + 0.5
            return said

    wire = Coarse(new_wire().device)
    moves = "".join(f"G1 X{20 + n % 2}\n" for n in range(9))
    job = Job("dwell.nc", f"M4 S0\nG1 X20 S500 F3000\nG4 P{seconds}\n{moves}M5\n")
    assert deliver(plan_job(job, MACHINE), wire, StopSignals()).lines == 13
    assert b"\x18" not in wire.commands


def test_who_dawdles_hears_no_silence_of_a_slow_line() -> None:
    wire = new_wire(latency=0.5)
    job = Job("slow.nc", "M4 S0\nG1 X20 S500 F60\nM5\n")
    show = dawdling(wire, 9.0, lambda now: now.seconds_elapsed > 5)
    assert deliver(plan_job(job, MACHINE), wire, StopSignals(), on_progress=show).lines == 3
    assert b"\x18" not in wire.commands


@pytest.mark.parametrize("latency", [0.0, 0.05])
def test_a_silent_controller_is_reset_within_the_patience(latency: float) -> None:
    wire = new_wire("drop-reply=all@2s", latency=latency)
    job = Job("slow.nc", "M4 S0\nG1 X20 S500 F60\nM5\n")
    with pytest.raises(ControllerError, match=r"said nothing for 3 s"):
        deliver(plan_job(job, MACHINE), wire, StopSignals())
    (reset, *_) = [at for at, data in wire.written if b"\x18" in data]
    assert 4.8 <= reset <= 5.4


def test_a_lost_answer_is_told_before_the_progress_is_shown() -> None:
    wire = new_wire("drop-reply=4@1500ms")
    moves = "".join(f"G1 X{20 + n % 2}\n" for n in range(60))
    job = Job("lost.nc", f"M4 S500 F3000\n{moves}M5\n")
    shown: list[Progress] = []
    with pytest.raises(ControllerError, match=r"idle but has not answered line \d+ of lost"):
        deliver(plan_job(job, MACHINE), wire, StopSignals(), on_progress=shown.append)
    moved = max(now.seconds_elapsed for now in shown if now.state == "Run")
    idle = [now.seconds_elapsed - moved for now in shown if now.seconds_elapsed > moved]
    assert 2.9 <= idle[-1] <= 3.0
    (told, *_) = [at for at, data in wire.written if b"\x18" in data]
    asked = [at for at, data in wire.written if data == b"?" and at < told]
    assert 0.0 <= told - asked[-1] < 0.1


def test_an_answer_that_is_lost_in_check_mode_ends_the_reading() -> None:
    """The controller then stays in the state Check, whatever it waits for."""
    wire = new_wire("drop-reply=4@1500")
    within_a_minute(wire)
    moves = "".join(f"G1 X{20 + n % 2}\n" for n in range(400))
    plan = plan_job(
        Job("read.nc", f"M4 S500 F3000\n{moves}M5\n"), MACHINE, SendOptions(check_mode=True)
    )
    with pytest.raises(ControllerError, match=r"not answered line 402 of read\.nc for 3 s"):
        deliver(plan, wire, StopSignals())
    assert wire.commands.endswith(b"\x18")
    wire.settle()
    assert not wire.device.beam_log


def test_a_controller_that_is_silent_from_the_first_line_on_is_reset() -> None:
    class Mute(FakeWire):
        def read(self, timeout: float) -> bytes:
            said = super().read(timeout)
            return b"" if b"M4S0\n" in self.commands else said

    wire = Mute(new_wire().device)
    with pytest.raises(ControllerError, match="said nothing for 3 s"):
        deliver(plan_job(Job("a.nc", "M4 S0\nG1 X20 S500 F60\nM5\n"), MACHINE), wire, StopSignals())
    (first,) = [at for at, data in wire.written if b"M4S0" in data]
    (reset, *_) = [at for at, data in wire.written if b"\x18" in data]
    assert 2.9 <= reset - first <= 3.3


def test_a_status_is_asked_for_five_times_a_second_and_ten_times_at_the_end() -> None:
    wire = new_wire()
    lines = "".join(f"G1 X{n % 2} S500 F60\n" for n in range(30)) + "G1 X20 F120\n"
    job = Job("slow.nc", f"M4 S0\n{lines}")
    seen: list[Progress] = []
    deliver(plan_job(job, MACHINE), wire, StopSignals(), on_progress=seen.append)
    flows = [now.seconds_elapsed for now in seen if now.in_flight]
    ends = [now.seconds_elapsed for now in seen if not now.in_flight]
    assert flows[-1] > 10
    assert len(flows) == pytest.approx(5 * flows[-1], rel=0.05)
    assert len(ends) == pytest.approx(10 * (ends[-1] - ends[0]), rel=0.05)


# Pauses and holds


def pressed_at_the_machine(wire: FakeWire, *orders: tuple[float, bytes]) -> None:
    """What somebody presses at the machine itself, and when."""
    due = list(orders)

    def press(call: int) -> None:
        while due and wire.now() >= due[0][0]:
            wire.device.receive(due.pop(0)[1])

    wire.before_call = press


def burnt(wire: FakeWire) -> float:
    return sum(abs(s.x1 - s.x0) for s in wire.device.beam_log)


@pytest.mark.parametrize("end", ["", "G1 X20\n" * 3])
def test_a_hold_in_the_last_moves_before_a_pause_is_not_that_pause(end: str) -> None:
    """Which goes on by itself, and the hold does not."""
    job = Job("paused.nc", f"M4 S0\nG1 X20 S500 F300\n{end}M0\nG1 X30\nM5\n")
    wire = new_wire()
    pressed_at_the_machine(wire, (2.0, b"!"), (9.0, b"~"))
    deliver(replace(plan_job(job, MACHINE), at_pause="go on"), wire, StopSignals())
    (resumed,) = [at for at, data in wire.written if b"~" in data]
    assert resumed > 9.0
    assert wire.device.position[0] == pytest.approx(30.0)
    assert burnt(wire) == pytest.approx(30, abs=0.2)


def test_a_hold_close_before_the_place_of_a_pause_is_not_that_pause() -> None:
    wire = new_wire()
    held: list[float] = []

    def press(call: int) -> None:
        if not held and wire.device.position[0] > 19.2:
            held.append(wire.now())
            wire.device.receive(b"!")
        elif held and wire.now() > held[0] + 5.0:
            wire.device.receive(b"~")
            held[0] = 1e9

    wire.before_call = press
    job = Job("paused.nc", "M4 S0\nG1 X20 S500 F120\nM0\nG1 X30 F3000\nM5\n")
    places: list[float] = []

    def show(now: Progress) -> None:
        if now.state == "Hold" and now.position:
            places.append(now.position[0])

    plan = replace(plan_job(job, MACHINE), at_pause="go on")
    assert deliver(plan, wire, StopSignals(), on_progress=show).seconds > 14
    assert 19.2 < max(places) < 19.85
    assert wire.commands.count(b"~") == 1


def test_a_hold_before_a_pause_ends_no_job_that_stops_at_pauses() -> None:
    job = Job("paused.nc", "M4 S0\nG1 X20 S500 F300\nM0\nG1 X30\nM5\n")
    wire = new_wire()
    pressed_at_the_machine(wire, (2.0, b"!"), (9.0, b"~"))
    with pytest.raises(PersonNeeded, match=r"line 3 waits for a person \(M0\)"):
        deliver(replace(plan_job(job, MACHINE), at_pause="stop"), wire, StopSignals())
    assert burnt(wire) == pytest.approx(20, abs=0.2)


@pytest.mark.parametrize(
    ("before", "moves"),
    [
        ("", "G1 X20 S500 F3000\n"),
        ("", "G20\nG1 X0.7874 S500 F100\nG21\n"),
        ("", "G91\nG1 X20 S500 F3000\nG90\n"),
        ("G0X5\n", "G+91\nG1 X20 S500 F3000\nG90\n"),
        ("G0X5\n", "g91\nG1 X20 S500 F3000\nG90\n"),
        ("", "G92 X5\nG1 X25 S500 F3000\n"),
        ("", "G1 X20 S500 F3000\nG53 G0 X0\nG0 X20\n"),
        ("", "G1 X10 S500 F3000\nG2 X20 I5\n"),
        ("G0X0Y7\n", "G1 X20 S500 F3000\n"),
        ("G0X0Y7\n", "G1 X10 S500 F3000\nG2 X20 I5\n"),
        ("G0X0Y7\n", "G1 X10 S500 F3000\nG3 X0 R5\nG1 X20\n"),
        ("G0X0Y7\n", "G1 X20 S500 F3000\nG2 X20 J5\n"),
        ("G10L2P1X3Y4\n", "G1 X20 S500 F3000\n"),
    ],
)
def test_a_pause_is_known_wherever_the_program_says_that_it_is(before: str, moves: str) -> None:
    job = Job("paused.nc", f"M4 S0\n{moves}M0\nG4 P0.1\nM5\n")
    wire = new_wire()
    if before:
        wire.device.receive(before.encode())
        wire.device.advance(5.0)
        wire.device.take_output()
    within_a_minute(wire)
    deliver(replace(plan_job(job, MACHINE), at_pause="go on"), wire, StopSignals())
    assert wire.commands.count(b"~") == 1


@pytest.mark.parametrize("place", [b"", rb"\1,0.000"], ids=["none", "four axes"])
def test_a_pause_is_known_whatever_of_the_place_is_reported(place: bytes) -> None:
    class Retold(FakeWire):
        def read(self, timeout: float) -> bytes:
            return re.sub(rb"(\|MPos:[^|>]*)", place, super().read(timeout))

    wire = Retold(new_wire().device)
    job = Job("paused.nc", "M4 S0\nG1 X20 S500 F3000\nM0\nG4 P0.1\nM5\n")
    deliver(replace(plan_job(job, MACHINE), at_pause="go on"), wire, StopSignals())
    assert wire.commands.count(b"~") == 1


@pytest.mark.parametrize("at_pause", ["go on", "stop"])
def test_a_pause_is_known_to_a_controller_that_does_not_tell_how_it_holds(at_pause: str) -> None:
    """GRBL 0.9 says Hold from the first braking on, and the head stands where the pause is."""
    old = load_machine("grbl09-laser-300")
    options = SendOptions(allow_m3=True)
    job = Job("paused.nc", "G0 X5 Y5\nM3 S0\nG1 X20 S500 F300\nM5\nM0\nG0 X30\n")
    plan = replace(plan_job(job, old, options), at_pause=at_pause)
    wire = FakeWire(virtual_machine(old))
    within_a_minute(wire)
    if at_pause == "stop":
        with pytest.raises(PersonNeeded, match=r"line 5 waits for a person \(M0\)"):
            deliver(plan, wire, StopSignals())
    else:
        deliver(plan, wire, StopSignals())
        assert wire.commands.count(b"~") == 1
    assert burnt(wire) == pytest.approx(15, abs=0.2)


def test_a_pause_before_any_move_is_one() -> None:
    wire = new_wire()
    job = Job("paused.nc", "M0\nM4 S0\nG1 X20 S500 F3000\nM5\n")
    deliver(replace(plan_job(job, MACHINE), at_pause="go on"), wire, StopSignals())
    assert burnt(wire) == pytest.approx(20, abs=0.2)


@pytest.mark.parametrize(
    ("text", "force"),
    [("M4 S0\nG1 X20 S500 F300\n", ""), ("M4 S0\nG1 X20 S500 F300\nM0\n$X\n", "program")],
    ids=["nothing is owed", "nobody knows the program"],
)
def test_a_hold_where_no_pause_is_known_is_left_alone(text: str, force: str) -> None:
    wire = new_wire()
    options = SendOptions(force=frozenset({force} - {""}))
    plan = replace(plan_job(Job("held.nc", text), MACHINE, options), at_pause="go on")
    pressed_at_the_machine(wire, (2.0, b"!"), (9.0, b"~"), (20.0, b"~"))
    seen: list[Progress] = []
    deliver(plan, wire, StopSignals(), on_progress=seen.append)
    assert wire.now() > 9.0
    assert "Hold" in {now.state for now in seen}
    assert b"~" not in wire.commands


def test_a_hold_that_is_pressed_as_the_job_begins_is_left_alone() -> None:
    wire = new_wire()
    orders = [b"!"]

    def press(call: int) -> None:
        if orders and b"G1X20" in wire.commands:
            wire.device.receive(orders.pop())
        if wire.now() > 6.0:
            wire.device.receive(b"~")

    wire.before_call = press
    job = Job("held.nc", "M4 S0\nG1 X20 S500 F3000\nM5\n")
    assert deliver(plan_job(job, MACHINE), wire, StopSignals()).seconds > 4
    assert b"~" not in wire.commands


class Scripted(FakeWire):
    """From the fourth second on, keys are pressed and reports tell states as ``script`` says; where
    a report is ``late``, the keys before it are pressed while its query is unanswered.
    """

    def __init__(self, *script: str, late: bool) -> None:
        super().__init__(new_wire().device)
        self.script, self.late, self.kept = list(script), late, b""

    @property
    def keys_are_next(self) -> bool:
        return self.script != [] and set(self.script[0]) <= set(" r-")

    def pressed(self) -> str:
        due = self.now() > 4.0 and self.keys_are_next and (self.kept or not self.late)
        return self.script.pop(0) if due else ""

    def read(self, timeout: float) -> bytes:
        said, self.kept = self.kept + super().read(timeout), b""
        if self.now() < 4.0 or b"<" not in said or not self.script:
            return said
        if self.keys_are_next:
            self.kept = said
            return b""
        states = self.script.pop(0).split()
        return b"".join(re.sub(rb"<\w+(:\d)?", b"<" + each.encode(), said) for each in states)


@pytest.mark.parametrize(
    ("script", "late", "resumes"),
    [
        ((" r", "Hold:1", "Hold:0"), False, 2),
        ((" r", "Hold:0 Hold:0"), False, 2),
        ((" -r", "Hold:1", "Hold:0"), False, 2),
        ((" r", "Run", "Hold:0"), False, 1),
        ((" r", "Run", "Hold:0"), True, 2),
        ((" r", "Run", "Run", "Hold:0"), True, 1),
        ((" ", "Hold:0", "r", "Hold:0"), True, 1),
        (("r", "Hold:0"), False, 1),
        (("  ", "Hold:1", "Hold:0"), False, 0),
    ],
    ids=[
        "forgotten",
        "told twice",
        "slower meanwhile",
        "heard",
        "told of before",
        "told of before, and heard",
        "heard at rest",
        "no hold",
        "no resume",
    ],
)
def test_a_resume_is_sent_again_only_if_it_came_too_early(
    script: tuple[str, ...], late: bool, resumes: int
) -> None:
    """A hold after it was heard is that of somebody at the machine."""
    wire = Scripted(*script, late=late)
    pressed_at_the_machine(wire, (9.0, b"~"))
    job = Job("slow.nc", "M4 S0\nG1 X20 S500 F120\nM5\n")
    deliver(plan_job(job, MACHINE), wire, StopSignals(), keys=wire)
    assert wire.script == []
    assert wire.commands.count(b"~") == resumes


def test_a_key_that_changes_the_power_of_m3_waits_until_the_axes_move() -> None:
    """In a dwell GRBL would light the beam, which the motion mode keeps dark (``protocol.c``)."""
    job = Job("dwell.nc", "M3 S500\nG0 X5\nG4 P3\nG1 X40 F600\nG0 X0\nM5\n")
    wire = new_wire()
    keys = Pressed(wire, 2.0, "]")
    plan = plan_job(job, MACHINE, SendOptions(allow_m3=True))
    deliver(plan, wire, StopSignals(), keys=keys)
    (at,) = [at for at, data in wire.written if data == b"\x9a"]
    assert at > 3.0
    assert standing_seconds(wire.device.beam_log) == 0.0
    assert max(segment.power for segment in wire.device.beam_log) == pytest.approx(0.55, abs=0.01)


def test_a_key_that_changes_the_power_waits_for_a_dwell_that_no_report_has_told() -> None:
    """The beam burnt one spot for the whole dwell, if the key came in its first fifth of a second;
    the dwell begins at 0.96 s here.
    """
    job = Job("dwell.nc", "M3 S0\nG1 X5 S500 F600\nG0 X30\nG4 P3\nG1 X40 F600\nG0 X0\nM5\n")
    wire = new_wire()
    plan = plan_job(job, MACHINE, SendOptions(allow_m3=True))
    deliver(plan, wire, StopSignals(), keys=Pressed(wire, 1.0, "]"))
    assert wire.commands.count(b"\x9a") == 1
    assert standing_seconds(wire.device.beam_log) < 0.03


class Pressed:
    """A key, pressed once when so many seconds have passed."""

    def __init__(self, wire: FakeWire, at: float, key: str) -> None:
        self.wire, self.at, self.key = wire, at, key

    def pressed(self) -> str:
        key, self.key = (self.key, "") if self.wire.now() > self.at else ("", self.key)
        return key


# What is sent and told


def test_a_controller_that_wants_its_answers_gets_one_line_at_a_time() -> None:
    machine = replace(MACHINE, controller=replace(MACHINE.controller, streaming="send-response"))
    wire = new_wire()
    job = Job("a.nc", "M4 S0\n" + "".join(f"G1 X{n} S500 F3000\n" for n in range(20)) + "M5\n")
    seen: list[Progress] = []
    deliver(plan_job(job, machine), wire, StopSignals(), on_progress=seen.append)
    assert max(data.count(b"\n") for _, data in wire.written) == 1
    assert max(now.in_flight for now in seen) <= len("G1X10S500F3000\n")


def test_before_the_first_answer_no_line_is_taken() -> None:
    wire = new_wire()
    seen: list[Progress] = []
    job = Job("dwell.nc", "\n\nG4 P1\nG0 X1\n")
    deliver(plan_job(job, MACHINE), wire, StopSignals(), on_progress=seen.append)
    assert (seen[0].lines_acknowledged, seen[0].line) == (0, 0)
    assert (seen[-1].lines_acknowledged, seen[-1].line) == (2, 4)


def test_a_machine_that_was_homed_and_then_refused_keeps_its_place() -> None:
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE) | HOMING | {30: 255}, baud=115_200))
    plan = plan_job(Job("a.nc", "G0 X1\n"), MACHINE, SendOptions(home=True))
    with pytest.raises(ControllerError, match="largest S value") as caught:
        deliver(plan, wire, StopSignals())
    assert "reset" not in str(caught.value)
    assert b"$H\n" in wire.commands
    assert b"\x18" not in wire.commands


def test_a_pen_that_a_job_leaves_down_is_no_armed_laser() -> None:
    """Its servo is driven by the S of a spindle that stays on."""
    pen = load_machine("grbl-pen-a4")
    wire = FakeWire(VirtualGrbl(virtual_settings(pen), baud=115_200))
    plan = plan_job(Job("pen.nc", "M3 S500\nG1 X20 F3000\n"), pen)
    assert deliver(plan, wire, StopSignals()).findings == ()
    assert b"\x18" not in wire.commands


def test_what_may_have_changed_is_asked_before_a_job_though_the_last_word_was_of_a_motion() -> None:
    wire = new_wire()
    session = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE))
    session.say("G1 X10 F600")
    assert session.state.state == "Run"
    session.known.may_differ("$110=4000")
    wire.device.advance(5.0)
    sent = len(wire.commands)
    session.cut(plan_job(Job("a.nc", "G0 X1\n"), MACHINE))
    assert b"$$\n" in wire.commands[sent:]


def test_a_journal_leaves_out_how_far_a_controller_plans_that_does_not_tell(tmp_path: Path) -> None:
    class Reticent(FakeWire):
        def read(self, timeout: float) -> bytes:
            return re.sub(rb"\[OPT:(\w*),[\d,]*\]", rb"[OPT:\1]", super().read(timeout))

    path = tmp_path / "journal"
    wire = Reticent(new_wire().device)
    plan = plan_job(Job("a.nc", "G0 X1\n"), MACHINE)
    deliver(plan, wire, StopSignals(), journal_path=path)
    assert b"blocks" not in path.read_bytes()
    deliver(plan, new_wire(), StopSignals(), journal_path=path)
    assert b'"blocks":15' in path.read_bytes().replace(b" ", b"")


def test_each_refusal_that_was_forced_is_told() -> None:
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE) | {110: 500.0}, baud=115_200))
    session = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE))
    session.open()
    wire.device.power_cycle()
    session.watch(1.0)
    plan = plan_job(
        Job("a.nc", "G0 X-1\n"),
        MACHINE,
        SendOptions(force=frozenset({"bounds", "position", "settings"})),
    )
    assert [each.code for each in session.cut(plan).findings] == ["bounds", "position", "settings"]


class Abort:
    """q, pressed after two seconds."""

    def __init__(self, wire: FakeWire) -> None:
        self._wire = wire

    def pressed(self) -> str:
        return "q" * (self._wire.now() > 2.0)


@pytest.mark.parametrize(
    ("machine", "text", "end"),
    [
        ("grbl-pen-a4", "M3 S500\nG1 X20 F300\n", b"!\x18"),
        ("grbl-laser-400", "M4 S500\nG1 X20 F300\nG99\n", b"\x18"),
    ],
    ids=["a pen", "a program that nobody knows"],
)
def test_an_abort_holds_first_where_no_beam_can_stand(machine: str, text: str, end: bytes) -> None:
    profile = load_machine(machine)
    wire = FakeWire(VirtualGrbl(virtual_settings(profile), baud=115_200))
    job = Job("a.nc", text.replace("G99\n", "G4 P9\nG99\n"))
    plan = plan_job(job, profile, SendOptions(force=frozenset({"program"})))
    with pytest.raises(JobStopped, match="stopped at the keyboard"):
        deliver(plan, wire, StopSignals(), keys=Abort(wire))
    assert wire.commands.rpartition(b"\n")[2] == end


# Holds that burn


FORCED = SendOptions(allow_m3=True, force=frozenset({"laser-mode"}))


def without_laser_mode(dialect: str) -> tuple[MachineProfile, FakeWire]:
    if dialect == "grbl-0.9":
        machine = load_machine("grbl09-laser-300")
        return machine, FakeWire(virtual_machine(machine))
    return MACHINE, FakeWire(VirtualGrbl(virtual_settings(MACHINE) | {32: 0.0}, baud=115_200))


WAYS = {
    "grbl-0.9": "stop a job there by q or a reset, never by a hold",
    "grbl-1.1": r"with \$32=1 \(laser mode\) it holds dark",
}


@pytest.mark.parametrize("dialect", WAYS)
def test_a_job_that_burns_without_laser_mode_is_stopped_in_place_of_a_hold(dialect: str) -> None:
    """GRBL leaves the spindle on in a hold, and so the beam, on one spot."""
    machine, wire = without_laser_mode(dialect)
    job = Job("slow.nc", "G0 X5 Y5\nM3 S0\nG1 X60 S500 F600\nM5\n")
    says = f"not held: the controller leaves the beam on in a hold; {WAYS[dialect]}; "
    with pytest.raises(JobStopped, match=says) as caught:
        deliver(plan_job(job, machine, FORCED), wire, StopSignals(), keys=Pressed(wire, 3.0, " "))
    assert re.search(
        r"lines were acknowledged, and the controller (was reset|did not)", str(caught.value)
    )
    assert b"!" not in wire.commands
    wire.settle()
    assert not wire.device.beam_on
    assert standing_seconds(wire.device.beam_log) < 0.03


@pytest.mark.parametrize("dialect", WAYS)
def test_a_hold_at_the_machine_that_leaves_the_beam_on_ends_the_job(dialect: str) -> None:
    machine, wire = without_laser_mode(dialect)
    pressed_at_the_machine(wire, (3.0, b"!"))
    job = Job("slow.nc", "G0 X5 Y5\nM3 S0\nG1 X60 S500 F600\nM5\n")
    says = rf"slow\.nc was held .* leaves the beam on in a hold; {WAYS[dialect]}; "
    with pytest.raises(ControllerError, match=says):
        deliver(plan_job(job, machine, FORCED), wire, StopSignals())
    assert not wire.device.beam_on
    assert standing_seconds(wire.device.beam_log) < 0.3


@pytest.mark.parametrize("dialect", ["grbl-0.9", "grbl-1.1"])
def test_a_dark_job_may_be_held_without_laser_mode(dialect: str) -> None:
    machine, wire = without_laser_mode(dialect)
    pressed_at_the_machine(wire, (6.0, b"~"))
    job = Job("dark.nc", "G0 X5 Y5\nG1 X60 F600\n")
    keys = Pressed(wire, 3.0, " ")
    assert deliver(plan_job(job, machine, FORCED), wire, StopSignals(), keys=keys).lines == 2
    assert b"!" in wire.commands


# What would never end


class Losing(FakeWire):
    """Loses the answers of so many lines, from the first on that has gone out behind ``since``."""

    since, count = b"", 0

    def read(self, timeout: float) -> bytes:
        said = super().read(timeout)
        while self.count and b"ok\r\n" in said and self.since in self.commands:
            said, self.count = said.replace(b"ok\r\n", b"", 1), self.count - 1
        return said


def losing(since: bytes, count: int, values: dict[int, float] | None = None) -> Losing:
    wire = Losing(VirtualGrbl(virtual_settings(MACHINE) | (values or {}), baud=115_200))
    wire.since, wire.count = since, count
    within_a_minute(wire)
    return wire


@pytest.mark.parametrize("at_pause", ["go on", "stop", "wait"])
@pytest.mark.parametrize("count", [1, 3])
def test_answers_that_are_lost_before_a_pause_end_the_job(at_pause: str, count: int) -> None:
    """The controller holds at the M0, and the line that is owed is none: that lasted for ever."""
    job = Job("paused.nc", "M4 S0\nG1 X20 S500 F3000\nG0 X25\nM8\nM0\nG1 X30\nM5\n")
    wire = losing(b"G1X20", count)
    plan = replace(plan_job(job, MACHINE), at_pause=at_pause)
    with pytest.raises(
        ControllerError, match=r"waits at line 5 of paused\.nc \(M0\) but has not answered line \d "
    ) as caught:
        deliver(plan, wire, StopSignals())
    assert str(caught.value).endswith("reset and reports the beam off.")
    wire.settle()
    assert burnt(wire) == pytest.approx(20, abs=0.2)


def test_a_lost_answer_of_a_pause_ends_the_job_at_the_next() -> None:
    job = Job("paused.nc", "M4 S0\nG1 X20 S500 F3000\nM0\nG0 X25\nM0\nG1 X30\nM5\n")
    wire = losing(b"~", 1)
    with pytest.raises(ControllerError, match=r"waits at line 5 .* not answered line [34] "):
        deliver(replace(plan_job(job, MACHINE), at_pause="go on"), wire, StopSignals())


def test_an_answer_that_is_lost_before_a_dwell_and_a_pause_ends_the_job() -> None:
    job = Job("paused.nc", "M4 S0\nG1 X20 S500 F3000\nG0 X25\nM8\nG4 P2\nM0\nG1 X30\nM5\n")
    says = r"waits at line 6 of paused\.nc \(M0\) but has not answered line 5 before it for 3 s"
    with pytest.raises(ControllerError, match=says):
        deliver(
            replace(plan_job(job, MACHINE), at_pause="go on"), losing(b"G1X20", 1), StopSignals()
        )


def test_a_hold_in_a_dwell_before_a_pause_is_no_loss() -> None:
    job = Job("paused.nc", "M4 S0\nG1 X20 S500 F3000\nG4 P4\nM0\nG1 X30\nM5\n")
    wire = new_wire()
    pressed_at_the_machine(wire, (2.0, b"!"), (22.0, b"~"))
    deliver(replace(plan_job(job, MACHINE), at_pause="go on"), wire, StopSignals())
    assert wire.commands.count(b"~") == 1
    assert burnt(wire) == pytest.approx(30, abs=0.2)


@pytest.mark.parametrize(("at_pause", "order"), [("go on", b"!"), ("stop", b"\x84")])
def test_a_stop_that_nobody_ends_ends_the_job_after_ten_minutes(
    at_pause: str, order: bytes
) -> None:
    """A digit 1 with one bit changed is a feed hold, too."""
    job = Job("held.nc", "M4 S0\nG1 X20 S500 F300\nM5\n")
    wire = new_wire()
    pressed_at_the_machine(wire, (2.0, order))
    says = r"held\.nc was stopped at the machine \((Hold|Door)\) for 10 minutes "
    with pytest.raises(PersonNeeded, match=says):
        deliver(replace(plan_job(job, MACHINE), at_pause=at_pause), wire, StopSignals())
    assert 600 < wire.now() < 610
    assert b"\x18" in wire.commands
    assert not wire.device.beam_on


class Told(FakeWire):
    """Each hold is told with ``becomes`` in place of ``was``, ``count`` times."""

    was, becomes, count = b"", b"", 0

    def read(self, timeout: float) -> bytes:
        said = super().read(timeout)
        if self.count and b"<Hold:0" in said:
            said, self.count = said.replace(self.was, self.becomes), self.count - 1
        return said


def told(was: bytes, becomes: bytes, count: int) -> Told:
    wire = Told(new_wire().device)
    wire.was, wire.becomes, wire.count = was, becomes, count
    pressed_at_the_machine(wire, (2.0, b"!"), (22.0, b"~"))
    return wire


def test_a_change_of_the_tool_that_nobody_ends_ends_the_job(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("miurafab.machine.grbl_driver._HELD_S", 10.0)
    job = Job("held.nc", "M4 S0\nG1 X20 S500 F300\nM5\n")
    with pytest.raises(PersonNeeded, match=r"held\.nc was stopped at the machine \(Tool\) "):
        deliver(plan_job(job, MACHINE), told(b"<Hold:0", b"<Tool", 999), StopSignals())


def test_a_hold_that_stays_lit_in_laser_mode_ends_the_job() -> None:
    """The beam goes out a moment after the hold is told, so two reports may tell it on."""
    job = Job("held.nc", "M4 S0\nG1 X20 S500 F300\nM5\n")
    assert deliver(plan_job(job, MACHINE), told(b">", b"|A:S>", 2), StopSignals()).lines == 3
    says = "the controller leaves the beam on in a hold; stop a job there by q or a reset"
    wire = told(b">", b"|A:S>", 3)
    with pytest.raises(ControllerError, match=says):
        deliver(plan_job(job, MACHINE), wire, StopSignals())
    assert b"\x18" in wire.commands


def test_a_hold_that_the_first_report_tells_may_be_lit_twice() -> None:
    wire = told(b">", b"|A:S>", 2)
    due = [b"!"]

    def press(call: int) -> None:
        if due and b"M4S0" in wire.commands:
            wire.device.receive(due.pop())
        if wire.now() > 9.0:
            wire.device.receive(b"~")

    wire.before_call = press
    job = Job("held.nc", "M4 S0\nG1 X20 S500 F3000\nM5\n")
    assert deliver(plan_job(job, MACHINE), wire, StopSignals()).lines == 3
    assert wire.count == 0


def test_a_first_answer_that_is_lost_is_waited_for_three_seconds() -> None:
    wire = losing(b"M5", 1)
    with pytest.raises(
        ControllerError, match=r"is idle but has not answered line 1 of a\.nc for 3 s"
    ):
        deliver(plan_job(Job("a.nc", "M5\n"), MACHINE), wire, StopSignals())
    assert 3.0 < wire.now() < 4.0


def test_who_is_at_the_keys_may_hold_as_long_as_it_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("miurafab.machine.grbl_driver._HELD_S", 10.0)
    job = Job("held.nc", "M4 S0\nG1 X20 S500 F300\nM5\n")
    wire = new_wire()
    pressed_at_the_machine(wire, (2.0, b"!"), (30.0, b"~"))
    deliver(replace(plan_job(job, MACHINE), at_pause="wait"), wire, StopSignals())
    assert wire.now() > 30


def test_what_a_key_holds_lasts_until_a_key_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where nobody was expected."""
    monkeypatch.setattr("miurafab.machine.grbl_driver._HELD_S", 10.0)
    job = Job("held.nc", "M4 S0\nG1 X20 S500 F300\nM5\n")
    wire = new_wire()
    keys = Pressed(wire, 2.0, " ")
    pressed_at_the_machine(wire, (30.0, b"~"))
    plan = replace(plan_job(job, MACHINE), at_pause="stop")
    deliver(plan, wire, StopSignals(), keys=keys)
    assert wire.now() > 30


def test_a_pause_is_known_on_a_machine_of_few_steps() -> None:
    """Of 2 steps a mm it comes to X20.5 or X20 where the program says X20.2."""
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE) | {100: 2.0, 101: 2.0}, baud=115_200))
    within_a_minute(wire)
    job = Job("paused.nc", "M4 S0\nG1 X20.2 Y7.3 S500 F600\nM0\nG1 X30\nM5\n")
    deliver(replace(plan_job(job, MACHINE), at_pause="go on"), wire, StopSignals())
    assert wire.commands.count(b"~") == 1


@pytest.mark.parametrize("stop", ["M0", b"\x84"])
def test_a_sleep_while_the_machine_stands_for_a_person_ends_no_job(
    monkeypatch: pytest.MonkeyPatch, stop: str | bytes
) -> None:
    """At a pause of the program, or behind a lid that was opened."""
    wire = new_wire()
    wire.blocks = True
    monkeypatch.setattr("miurafab.machine.stream_driver.slept_s", lambda: 600 * (wire.now() > 4.0))
    pause = f"{stop}\n" if isinstance(stop, str) else ""
    pressed_at_the_machine(wire, *[(2.0, stop)] * (not pause), (6.0, b"~"))
    job = Job("slow.nc", f"M4 S0\nG1 X5 S500 F300\n{pause}G1 X20\nM5\n")
    assert deliver(replace(plan_job(job, MACHINE), at_pause="wait"), wire, StopSignals()).lines
    assert wire.device.position[0] == pytest.approx(20.0)
