"""Keys while a job runs, proved on the bytes of the wire; the frame; dwells with the beam on."""

from __future__ import annotations

import os
import random
import select
import signal
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from subprocess import PIPE, Popen

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from wires import FakeWire

from miurafab.errors import GcodeError, InputError, JobStopped, PersonNeeded
from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.job import Job
from miurafab.machine.actions import talk
from miurafab.machine.journal import read_journal
from miurafab.machine.judge_job import judge_job
from miurafab.machine.keys import (
    DOWN,
    KEYS,
    LEFT,
    PAGE_UP,
    RIGHT,
    UP,
    ConsoleKeys,
    NoKeys,
    Typed,
    suspend_here,
    terminal_keys,
)
from miurafab.machine.planning import SendOptions, plan_job
from miurafab.machine.progress import Progress, StreamResult
from miurafab.machine.sender import deliver
from miurafab.machine.signals import StopSignals
from miurafab.machine.trace_box import frame_job
from miurafab.profiles import load_machine
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings

MACHINE = load_machine("grbl-laser-400")
JOB = Job(
    "rows.nc",
    "M4 S0\n" + "".join(f"G0 X5 Y{n}\nG1 X25 S500 F3000\n" for n in range(30)) + "M5\nG0X0Y0\n",
)


class Script:
    """Keys pressed at given times of the controller's clock."""

    def __init__(self, device: VirtualGrbl, keys: list[tuple[float, str]]) -> None:
        self._device = device
        self._keys = keys

    def pressed(self) -> str:
        keys = ""
        while self._keys and self._device.now >= self._keys[0][0]:
            keys += self._keys.pop(0)[1]
        return keys


def run(*keys: tuple[float, str]) -> tuple[FakeWire, StreamResult | str]:
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=MACHINE.controller.baud))
    plan = plan_job(JOB, MACHINE)
    try:
        return wire, deliver(plan, wire, StopSignals(), keys=Script(wire.device, list(keys)))
    except JobStopped as stopped:
        return wire, str(stopped)


def burnt(wire: FakeWire) -> float:
    return sum(abs(s.x1 - s.x0) for s in wire.device.beam_log)


def test_a_hold_is_dark_and_a_resume_loses_nothing() -> None:
    plain, undisturbed = run()
    wire, held = run((4.0, " "), (24.0, "r"))
    assert isinstance(undisturbed, StreamResult)
    assert isinstance(held, StreamResult)
    assert held.seconds == pytest.approx(undisturbed.seconds + 20, abs=0.6)
    assert burnt(wire) == pytest.approx(burnt(plain), abs=0.1)
    assert not any(segment.standing for segment in wire.device.beam_log)
    hold = next(at for at, data in wire.written if b"!" in data)
    resume = next(at for at, data in wire.written if b"~" in data)
    assert 0 <= hold - 4.0 <= 0.02
    assert not any(hold + 0.2 < s.t1 and s.t0 < resume for s in wire.device.beam_log)


@pytest.mark.parametrize("keys", [[(4.0, " r")], [(4.0, " "), (4.005, "r")]])
def test_a_resume_while_the_hold_still_brakes_is_not_lost(keys: list[tuple[float, str]]) -> None:
    """GRBL forgets a cycle start that comes with the hold or before its end (``protocol.c``)."""
    _, undisturbed = run()
    wire, result = run(*keys)
    assert isinstance(undisturbed, StreamResult)
    assert isinstance(result, StreamResult)
    assert result.seconds == pytest.approx(undisturbed.seconds + 0.3, abs=0.4)
    assert wire.commands.count(b"!") == 1
    assert wire.commands.count(b"~") == 2


@pytest.mark.parametrize("after", [0.12, 0.25])
def test_a_resume_after_the_hold_came_to_rest_is_sent_once(after: float) -> None:
    """Although the last report was of the braking."""
    wire, result = run((4.0, " "), (4.0 + after, "r"))
    assert isinstance(result, StreamResult)
    assert wire.commands.count(b"~") == 1


@pytest.mark.parametrize("keys", [[(4.0, "q")], [(4.0, " "), (6.0, "q")]])
def test_an_abort_comes_to_rest_and_resets(keys: list[tuple[float, str]]) -> None:
    wire, said = run(*keys)
    assert isinstance(said, str)
    assert "stopped at the keyboard" in said
    assert said.endswith("reports the beam off.")
    assert wire.commands.endswith(b"\x18")
    assert b"!" in wire.commands
    at = next(at for at, data in wire.written if b"!" in data)
    assert 0 <= at - keys[0][0] <= 0.02
    wire.settle()
    assert not wire.device.beam_on
    assert all(s.t1 <= at + 0.2 for s in wire.device.beam_log)


def test_ctrl_x_resets_at_once() -> None:
    wire, said = run((4.0, "\x18"))
    assert isinstance(said, str)
    assert said.endswith("reports the beam off.")
    assert b"!" not in wire.commands
    at = next(at for at, data in wire.written if b"\x18" in data)
    assert 0 <= at - 4.0 <= 0.02
    wire.settle()
    assert all(s.t1 <= at + 0.01 for s in wire.device.beam_log)


def test_a_job_that_is_stopped_while_it_is_prepared_sends_no_line() -> None:
    wire, said = run((0.0, "\x18"))
    assert said == "rows.nc was stopped at the keyboard before a line of it was sent."
    assert b"M4" not in wire.commands


def test_an_abort_of_an_m3_job_is_dark_at_once() -> None:
    """A feed hold would leave the full power standing for $1."""
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=MACHINE.controller.baud))
    plan = plan_job(Job("m3.nc", JOB.text.replace("M4", "M3")), MACHINE, SendOptions(allow_m3=True))
    with pytest.raises(JobStopped, match="stopped at the keyboard"):
        deliver(plan, wire, StopSignals(), keys=Script(wire.device, [(4.0, "q")]))
    assert b"!" not in wire.commands
    wire.settle()
    assert not any(segment.standing for segment in wire.device.beam_log)
    assert wire.device.beam_log[-1].t1 <= 4.03


def test_the_feed_follows_the_keys() -> None:
    wire, slow = run((1.0, "-----"), (1.1, "x"))
    _, plain = run()
    assert isinstance(slow, StreamResult)
    assert isinstance(plain, StreamResult)
    assert wire.commands.count(b"\x92") == 5
    assert slow.seconds > 1.3 * plain.seconds


SEQUENCES = (
    *(f"\x1b[{final}" for final in "ABCDHFZ"),  # arrows, Home, End, Shift-Tab
    *(f"\x1bO{final}" for final in "ABCDPQRSHFM"),  # the same in application mode; F1 to F4
    *(f"\x1b[{number}~" for number in (1, 2, 3, 5, 6, 15, 17, 20, 21, 24, "15;2", "3;5")),
    *(f"\x1b[[{final}" for final in "ABCDE"),  # F1 to F5 of a Linux console
    *("\x1b[1;5C", "\x1b[I", "\x1b[<0;10;20M", "\x1b[M !]"),
    *("\x1bq", "\x1b ", "\x1b-", "\x1b\x1b[A", "\x1bOq"),  # Alt with a key
    *("\x1b]0;q -\x07", "\x1bP1$r0q\x1b\\", "\x1b_[-]\x1b\\"),  # answers of the terminal
    *("\x9b20~", "\x9bA"),
)


@pytest.mark.parametrize("sequence", SEQUENCES)
def test_a_key_that_is_not_listed_is_dropped_whole(sequence: str) -> None:
    data = sequence.encode()
    assert Typed().keys(data + b"r") == "r"
    slow = Typed()
    assert [slow.keys(data[n : n + 1]) for n in range(len(data))] == [""] * len(data)
    assert slow.keys(b"r") == "r"


@given(st.lists(st.sampled_from([*SEQUENCES, *KEYS, "x", "\u015b"])), st.randoms())
@settings(max_examples=50)
def test_a_storm_of_keys_holds_those_listed_and_no_other(
    pressed: list[str], chance: random.Random
) -> None:
    """However the bytes are torn between two reads."""
    data, typed, keys = "".join(pressed).encode(), Typed(), ""
    while data:
        size = chance.randint(1, 5)
        keys += typed.keys(data[:size])
        data = data[size:]
    assert keys == "".join(key for key in pressed if len(key) == 1)


def test_escape_alone_swallows_no_later_key() -> None:
    now = [0.0]
    typed = Typed(lambda: now[0])
    assert typed.keys(b"\x1b") == ""
    now[0] = 0.2
    assert typed.keys(b"") == ""
    assert typed.keys(b"q") == "q"


def test_a_windows_console_gives_two_characters_for_a_key_without_one() -> None:
    typed = list("\0q r\xe0H+")
    keys = ConsoleKeys(lambda: bool(typed), lambda: typed.pop(0))
    assert keys.pressed() == " r+"
    assert keys.pressed() == ""


def test_overrides_are_shown_journalled_named_and_taken_back(tmp_path: Path) -> None:
    seen: list[str] = []
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=MACHINE.controller.baud))
    result = deliver(
        plan_job(JOB, MACHINE),
        wire,
        StopSignals(),
        keys=Script(wire.device, [(1.0, "--"), (1.5, "[[["), (2.0, "]")]),
        journal_path=tmp_path / "journal",
        on_progress=lambda now: seen.append(now.overrides.words),
    )
    shown = ["", "feed 80 %", "feed 80 %, power 70 %", "feed 80 %, power 80 %"]
    assert list(dict.fromkeys(seen)) == shown
    (finding,) = result.findings
    assert finding.sentence == (
        "While the job ran, the feed was between 80 and 100 % and the power was between 70 and "
        "100 % of what is written in it."
    )
    (run,) = read_journal(tmp_path / "journal")
    assert run.overrides == [80, 100, 80]
    # The controller does not restart, and the next job is cut as it is written.
    wire = FakeWire(wire.device)
    again = deliver(plan_job(JOB, MACHINE), wire, StopSignals())
    assert again.findings == ()


def test_without_a_terminal_there_are_no_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    with Path(os.devnull).open() as nothing:
        monkeypatch.setattr(sys, "stdin", nothing)
        with terminal_keys() as keys:
            assert isinstance(keys, NoKeys)


@pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals")
def test_the_terminal_is_left_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    import termios

    master, terminal = os.openpty()
    with os.fdopen(terminal) as stdin, os.fdopen(master, "rb", buffering=0):
        monkeypatch.setattr(sys, "stdin", stdin)
        monkeypatch.setattr(os, "tcgetpgrp", lambda descriptor: os.getpgrp())
        before = termios.tcgetattr(terminal)
        with terminal_keys() as keys:
            assert keys.pressed() == ""
            os.write(master, b" r")
            assert keys.pressed() == " r"
            assert termios.tcgetattr(terminal)[3] != before[3]
        assert termios.tcgetattr(terminal) == before


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Standard input is a terminal, in the foreground."""
    master, descriptor = os.openpty()
    with os.fdopen(descriptor) as stdin, os.fdopen(master, "rb", buffering=0):
        monkeypatch.setattr(sys, "stdin", stdin)
        monkeypatch.setattr(os, "tcgetpgrp", lambda descriptor: os.getpgrp())
        yield descriptor


@pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals")
def test_in_the_background_and_after_the_end_no_key_is_read(
    terminal: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Reading in the background would stop the whole process."""
    with terminal_keys() as keys:
        monkeypatch.setattr(os, "read", lambda descriptor, size: b"")
        monkeypatch.setattr(select, "select", lambda *ready: ready)
        assert keys.pressed() == ""
        monkeypatch.setattr(os, "read", lambda descriptor, size: pytest.fail("it was read"))
        monkeypatch.setattr(os, "tcgetpgrp", lambda descriptor: -1)
        assert keys.pressed() == ""


@pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals")
@pytest.mark.parametrize("foreground", [True, False])
def test_a_suspended_program_leaves_the_terminal_as_shells_want_it(
    terminal: int, monkeypatch: pytest.MonkeyPatch, foreground: bool
) -> None:
    import termios

    seen = []

    def stop(process: int, number: int) -> None:
        seen.append((process, number, termios.tcgetattr(terminal)[3] & termios.ECHO))

    monkeypatch.setattr(os, "kill", stop)
    with terminal_keys():
        raw = termios.tcgetattr(terminal)
        if not foreground:  # bg: the terminal is another program's by now
            monkeypatch.setattr(os, "tcgetpgrp", lambda descriptor: -1)
        suspend_here()
        assert seen == [(os.getpid(), signal.SIGSTOP, termios.ECHO)]
        assert (termios.tcgetattr(terminal) == raw) == foreground
    with Path(os.devnull).open() as nothing:
        monkeypatch.setattr(sys, "stdin", nothing)
        suspend_here()
    assert len(seen) == 2


def test_a_dark_frame_never_arms_and_a_pointer_is_weak() -> None:
    bounds = (5.0, 6.0, 80.0, 90.0)
    dark = parse_program(frame_job("a.nc", bounds, MACHINE))
    assert not dark.beam_on.any()
    assert not dark.spindle.any()
    assert dark.end[:, :2].tolist() == [[5, 6], [80, 6], [80, 90], [5, 90], [5, 6], [0, 0]]
    weak = parse_program(frame_job("a.nc", bounds, MACHINE, pointer=0.02, back_to=(3, 4)))
    assert weak.power.max() == 20
    assert weak.end[-1, :2].tolist() == [3, 4]
    assert not weak.beam_on[-1]
    for power in (0.06, -0.01):
        with pytest.raises(InputError, match="could burn"):
            frame_job("a.nc", bounds, MACHINE, pointer=power)
    for name in ("grbl-pen-a4", "marlin-laser-220"):
        with pytest.raises(InputError, match=f"{name} has no laser that could point"):
            frame_job("a.nc", bounds, load_machine(name), pointer=0.02)
    with pytest.raises(InputError, match="hpgl-cutter-a3 speaks hpgl, in which a frame is not"):
        frame_job("a.nc", bounds, load_machine("hpgl-cutter-a3"))


@pytest.mark.parametrize(
    ("text", "burns"),
    [
        ("G1 F600 X1\nM3 S500\nG4 P1\nM5\n", True),
        ("M3\nG1 X5 S500 F600\nG4 P1\nM5\n", True),
        ("M4\nG1 X5 S500 F600\nG4 P1\nM5\n", False),
        ("M3\nG1 X5 S500 F600\nM5\nG4 P1\n", False),
        ("M3\nG1 X5 S500 F600\nG0 X9\nG4 P1\nM5\n", False),
    ],
)
def test_a_dwell_with_the_beam_on_is_refused(text: str, burns: bool) -> None:
    job = Job("dwell.nc", text)
    if not burns:
        plan_job(job, MACHINE, SendOptions(allow_m3=True))
        return
    with pytest.raises(GcodeError, match=r"waits with the beam on at S500.*'force' dwell"):
        plan_job(job, MACHINE, SendOptions(allow_m3=True))
    # The virtual controller agrees: there is a standing beam.
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=MACHINE.controller.baud))
    plan = plan_job(job, MACHINE, SendOptions(allow_m3=True, force=frozenset({"dwell"})))
    deliver(plan, wire, StopSignals())
    assert any(segment.standing for segment in wire.device.beam_log)


def test_more_than_the_material_takes_is_refused() -> None:
    job = Job("hot.nc", "M4 S950\nG1 X5 F600\nM5\n")
    plan_job(job, MACHINE)
    with pytest.raises(GcodeError, match=r"S950, more than the S900 .*'force' material"):
        plan_job(job, MACHINE, most_power=0.9)


def test_the_console_tells_what_is_answered_and_goes_on_after_a_refusal() -> None:
    said: list[str] = []
    talk("virtual", ["?\n", "G1 X5\n", "G0 X3 (there)\n", "oh!\n", *["M3 S10\n"] * 2], said.append)
    assert said[0] == "Modes in force: G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0"
    assert said[1].startswith("<Idle|")
    assert "error:22" in said
    assert any("refused 'G1X5'" in line for line in said)
    assert any("feed hold" in line for line in said)
    assert any(line.startswith("Grbl 1.1h") for line in said)  # the reset of an armed laser


@pytest.mark.skipif(os.name != "posix", reason="signals as a terminal sends them on POSIX")
def test_ctrl_c_ends_a_console_that_waits_for_a_line():
    command = [sys.executable, "-m", "miurafab", "machine", "console", "--port", "virtual"]
    with Popen(command, stdin=PIPE, stdout=PIPE, stderr=PIPE, text=True, bufsize=1) as process:
        process.stdin.write("?\n")
        assert process.stdout.readline().startswith("Modes in force: G0 G54")
        assert process.stdout.readline().startswith("<Idle|")
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == JobStopped.exit_code
        assert process.stderr.read() == "miurafab: Stopped by Ctrl-C.\n"


PAUSED = Job(
    "paused.nc",
    "M4 S0\nG0 X10 Y10\nG1 X20 S500 F3000\nM0\nG1 X30\nM5\n",
)


def at_the_pause(at_pause: str, *keys: tuple[float, str]) -> tuple[FakeWire, list[str]]:
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=MACHINE.controller.baud))
    seen: list[str] = []
    plan = replace(plan_job(PAUSED, MACHINE), at_pause=at_pause)
    deliver(
        plan,
        wire,
        StopSignals(),
        keys=Script(wire.device, list(keys)),
        on_progress=lambda now: seen.append(now.state),
    )
    return wire, seen


def test_a_program_that_pauses_says_so_and_a_key_goes_on() -> None:
    wire, seen = at_the_pause("wait", (0.2, "+"), (5.0, "r"))
    assert "waiting at paused.nc, line 4 (M0): r goes on" in seen
    assert "Run" in seen
    assert burnt(wire) == pytest.approx(20, abs=0.2)
    assert wire.device.now > 5.0
    assert not any(segment.standing for segment in wire.device.beam_log)


def test_a_pause_goes_on_by_itself_where_the_machine_does() -> None:
    wire, _ = at_the_pause("go on")
    assert burnt(wire) == pytest.approx(20, abs=0.2)
    assert wire.device.now < 5.0


def test_a_pause_where_nobody_is_ends_the_job_dark() -> None:
    with pytest.raises(
        PersonNeeded, match=r"paused\.nc, line 4 waits for a person \(M0\).*beam off"
    ):
        at_the_pause("stop")


def test_a_hold_of_ones_own_is_no_pause_of_the_program() -> None:
    wire, seen = at_the_pause("go on", (0.5, " "), (3.0, "r"))
    assert burnt(wire) == pytest.approx(20, abs=0.2)
    assert wire.device.now > 3.0
    assert "Hold" in seen


def told_by_the_machine(wire: FakeWire, *orders: tuple[float, bytes]) -> None:
    """What somebody presses at the machine itself, and when."""
    due = list(orders)

    def press(call: int) -> None:
        while due and wire.device.now >= due[0][0]:
            wire.device.receive(due.pop(0)[1])

    wire.before_call = press


@pytest.mark.parametrize(("lid", "keys"), [([(1.0, b"\x84")], []), ([], [(1.0, " "), (2.0, "+")])])
def test_neither_a_lid_that_is_shut_again_nor_a_hold_is_a_pause_of_the_program(
    lid: list[tuple[float, bytes]], keys: list[tuple[float, str]]
) -> None:
    """Which would go on by itself."""
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=MACHINE.controller.baud))
    told_by_the_machine(wire, *lid)
    job = Job("paused.nc", "M4 S0\nG1 X20 S500 F300\nM0\nG1 X30\nM5\n")
    plan = replace(plan_job(job, MACHINE), at_pause="go on")
    deliver(plan, wire, StopSignals(), keys=Script(wire.device, [*keys, (9.0, "r")]))
    assert min(at for at, data in wire.written if b"~" in data) >= 9.0
    assert burnt(wire) == pytest.approx(30, abs=0.2)


@pytest.mark.parametrize("at", [1.0, 6.0])
def test_a_hold_at_the_machine_is_no_pause_before_or_after_one_of_the_program(at: float) -> None:
    """Which would go on by itself; the first is among 40 moves, the second in the dwell."""
    moves = "".join(f"G1 X{x / 2}\n" for x in range(1, 41))
    job = Job("paused.nc", f"M4 S500 F300\n{moves}M0\nG4 P4\nM0\nG1 X30\nM5\n")
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=MACHINE.controller.baud))
    told_by_the_machine(wire, (at, b"!"), (at + 9, b"~"))
    deliver(replace(plan_job(job, MACHINE), at_pause="go on"), wire, StopSignals())
    assert not any(at < when < at + 9 for when, data in wire.written if b"~" in data)
    assert wire.commands.count(b"~") == 2
    assert burnt(wire) == pytest.approx(30, abs=0.2)


def test_a_dwell_after_slow_moves_is_no_line_that_was_lost() -> None:
    """GRBL says nothing while the moves before it end, and then is idle for as long as it lasts."""
    job = Job("slow.nc", "M4 S0\nG1 X20 S500 F120\nG4 P0.5\nG1 X30 F3000\nM5\n")
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=MACHINE.controller.baud))
    assert deliver(plan_job(job, MACHINE), wire, StopSignals()).seconds > 10
    assert burnt(wire) == pytest.approx(30, abs=0.2)


@pytest.mark.parametrize("busy_s", [4.0, 9.0])
def test_a_program_that_is_slow_to_show_progress_is_no_silence_of_the_controller(
    busy_s: float,
) -> None:
    """As a terminal is that somebody holds with Ctrl-S."""
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=MACHINE.controller.baud))
    busy = [busy_s]

    def show(now: Progress) -> None:
        if now.lines_acknowledged > 5 and busy:
            wire.device.advance(busy.pop())

    result = deliver(plan_job(JOB, MACHINE), wire, StopSignals(), on_progress=show)
    assert result.lines == plan_job(JOB, MACHINE).lines
    assert not busy


def test_a_hold_at_the_machine_is_not_resumed_for_a_resume_that_was_heard() -> None:
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=MACHINE.controller.baud))
    told_by_the_machine(wire, (8.0, b"!"), (12.0, b"~"))
    keys = Script(wire.device, [(4.0, " "), (4.12, "r")])
    deliver(plan_job(JOB, MACHINE), wire, StopSignals(), keys=keys)
    assert wire.commands.count(b"~") == 1


def test_a_pause_is_a_finding() -> None:
    (finding,) = judge_job(PAUSED, MACHINE).findings
    assert (finding.code, finding.severity) == ("pauses", "note")


def test_the_keys_that_jog_are_told_only_to_who_asks() -> None:
    """In both forms of a terminal, over two reads, and as a Windows console codes them."""
    typed = b"\x1b[A\x1bOB\x1b[5~\x1b[1;5Cq\x1b[20~"
    assert Typed(arrows=True).keys(typed) == f"{UP}{DOWN}{PAGE_UP}q"
    assert Typed().keys(typed) == "q"
    halves = Typed(arrows=True)
    assert halves.keys(b"\x1b[") + halves.keys(b"C") == RIGHT
    for arrows, told in ((True, f"{LEFT}x"), (False, "x")):
        waiting = list("\xe0K\0Dx")
        keys = ConsoleKeys(lambda w=waiting: bool(w), lambda w=waiting: w.pop(0), arrows=arrows)
        assert keys.pressed() == told
