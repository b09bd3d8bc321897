"""``miurafab machine open``: its words and its screen, with the session in this process."""

from __future__ import annotations

import io
import json
import os
import signal
import sys
from collections import deque
from dataclasses import replace

import pytest
from command_line import sentence

from miurafab.cli.session_screen import HELP, SessionScreen
from miurafab.errors import ControllerError, JobStopped, MiurafabError
from miurafab.machine import session_process
from miurafab.machine.keys import DOWN, LEFT, PAGE_DOWN, PAGE_UP, RIGHT, UP
from miurafab.machine.known_controller import PortSetup
from miurafab.machine.machine_session import MachineSession
from miurafab.machine.session_process import Heard, Outcome
from miurafab.machine.signals import StopSignals
from miurafab.machine.transport import VirtualTransport
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings
from miurafab.workflow.at_machine import Operator
from miurafab.workflow.cut import prepare
from miurafab.workflow.cut_options import CutOptions

LINE = "M4 S0\nG0 X5\nG1 X15 S500 F3000\nM5\nG0X0Y0\n"


class InThread:
    """Carries out orders at once, in place of the process that holds the port.

    ``holds``: a cut stands in a hold until it is stopped.
    """

    death = "ended with code 0"
    made: InThread
    holds = False

    def __init__(self, machine, port, signals, speed=None):
        type(self).made = self
        self.over, self.keys, self.asked = False, "", []
        self._messages = deque()
        wire = VirtualTransport(VirtualGrbl(virtual_settings(machine)))
        self.device, self._signals = wire.device, signals
        self.session = MachineSession(wire, StopSignals(), PortSetup.of(machine))
        self.session.lines.on_line = lambda text: self._messages.append(Heard(text))

    @property
    def state(self):
        state = self.session.state
        return replace(state, state="Hold:0") if self.holds and self._cuts else state

    @property
    def _cuts(self):
        return bool(self.asked) and self.asked[-1] == "cut" and "q" not in self.keys

    def order(self, action, **options):
        self.asked.append(action)
        if action == "cut" and self.holds:
            return
        try:
            outcome = Outcome(action, getattr(self.session, action)(**options))
        except MiurafabError as error:
            outcome = Outcome(action, error=error)
        self._messages.append(outcome)

    def poll(self):
        if self._signals.caught is not None:
            self.over = True
        return self._messages.popleft() if self._messages else None

    def press(self, keys):
        self.keys += keys
        if self.holds and keys == "q":
            self._messages.append(Outcome("cut", error=JobStopped("line.nc was stopped.")))

    def stop(self):
        self.press("stop")

    def close(self):
        assert self.session.close()


@pytest.fixture
def words(run, monkeypatch, tmp_path):
    """``machine open`` with lines of words on its standard input."""
    monkeypatch.setattr(session_process, "SessionProcess", InThread)
    (tmp_path / "line.nc").write_text(LINE)

    def call(lines, *arguments):
        read, write = os.pipe()
        os.write(write, lines.encode())
        os.close(write)
        with os.fdopen(read) as stdin:
            monkeypatch.setattr(sys, "stdin", stdin)
            return run("machine", "open", *arguments)

    return call


def test_each_word_is_answered_in_a_line_and_nothing_follows_quit(words):
    lines = "jog to x5 y6 f3000\nfeed +\n\n  say   G4 P0\nunlock\ngo\nstatus\nquit\njog x9"
    done = words(lines, "virtual")
    assert (done.returncode, done.stderr) == (0, "")
    assert [" ".join(line.split()) for line in done.stdout.splitlines()] == [
        "Grbl 1.1h ['$' for help]",
        "Grbl 1.1h at virtual.",
        "jog to x5 y6 f3000: Idle, work X5.000 Y6.000, machine X5.000 Y6.000",
        "feed +: Idle, work X5.000 Y6.000, machine X5.000 Y6.000",
        "ok",
        "say G4 P0: Idle, work X5.000 Y6.000, machine X5.000 Y6.000",
        "Unlocked.",
        "unlock: Idle, work X5.000 Y6.000, machine X5.000 Y6.000",
        "go: Idle, work X0.000 Y0.000, machine X0.000 Y0.000",
        "status: Idle, work X0.000 Y0.000, machine X0.000 Y0.000",
    ]
    assert InThread.made.keys == "+"


def test_a_word_before_the_port_is_open_is_answered_too(words, monkeypatch):
    monkeypatch.setattr(InThread, "state", None)
    done = words("hold\n", "virtual")
    assert "hold: the port is being opened\n" in done.stdout
    assert InThread.made.keys == " "


def test_a_sheet_is_chosen_framed_and_burnt_by_words(words):
    """The port by its option, and so the job by its place alone."""
    done = words("sheet 1\nfresh\nframe\nstart\n", "line.nc", "--port", "virtual")
    assert (done.returncode, done.stderr) == (0, "")
    assert "The sheet is in." in done.stdout
    assert "The frame was traced." in done.stdout
    assert "line.nc is done: 5 lines in 0:0" in done.stdout
    burnt = InThread.made.device.beam_log
    assert sum(each.x1 - each.x0 for each in burnt) == pytest.approx(10, abs=0.1)


def test_a_sheet_is_said_to_be_in_when_the_machine_has_taken_it(words, monkeypatch):
    def refused(session):
        raise ControllerError("A program was running when the lid was opened.")

    monkeypatch.setattr(MachineSession, "load", refused)
    done = words("fresh\nstart\n", "virtual", "line.nc")
    assert "A program was running when the lid was opened." in sentence(done, 3)
    assert "The sheet is in." not in done.stdout
    assert "cut" not in InThread.made.asked


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("dance", "'dance' is no action of a session; there are jog x10 y-5, jog to x0 y0, frame"),
        ("home now", "'home now' is no action of a session"),
        ("sheet two", "'sheet two' is no action of a session"),
        ("sheet 2", "line.nc has no sheet 2"),
        ("say", "'say' is no action of a session"),
        ("jog z5", "A jog is written 'jog x10 y-5' or 'jog to x0 y0', not 'z5'"),
        ("jog x5parsec", "'x5parsec' in 'jog x5parsec' cannot be read"),
        ("jog", "A jog needs a distance along X, along Y, or both"),
    ],
)
def test_a_word_that_is_not_understood_ends_the_session(words, line, said):
    done = words(f"{line}\njog x5\n", "virtual", "line.nc")
    assert said in sentence(done, 2)
    assert InThread.made.device.position[0] == 0.0


def test_what_needs_a_job_says_so_and_a_session_needs_a_port(words):
    assert "No job was named; open the session with one" in sentence(words("frame", "virtual"), 2)
    assert "Name the machine's --port ('virtual' needs no" in sentence(words(""), 2)


def test_a_job_in_a_hold_ends_with_the_input_since_nobody_can_resume_it(words, monkeypatch):
    monkeypatch.setattr(InThread, "holds", True)
    done = words("start\n", "virtual", "line.nc")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.endswith("  line.nc was stopped.\n")
    assert InThread.made.keys == "q"


def test_what_follows_a_stopped_job_is_carried_out(words, monkeypatch):
    monkeypatch.setattr(InThread, "holds", True)
    done = words("start\nstop\njog x3\n", "virtual", "line.nc", "--json")
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 0
    assert {"said": "line.nc was stopped."} in answers
    assert answers[-1]["line"] == "jog x3"
    assert answers[-1]["state"]["position"][0] == 3.0


def test_stop_overtakes_what_waits_for_the_end_of_a_job_and_makes_it_void(words, monkeypatch):
    monkeypatch.setattr(InThread, "holds", True)
    polls, poll = iter(range(1000)), InThread.poll
    monkeypatch.setattr(InThread, "poll", lambda self: poll(self) if next(polls) >= 0 else None)
    lines = "start\nstatus\nstart\nhold\nstop\njog x3\n"
    done = words(lines, "virtual", "line.nc", "--json")
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 0
    assert InThread.made.keys == " q"
    assert InThread.made.asked == ["open", "cut", "jog"]
    said = [answer["said"] for answer in answers if "said" in answer]
    assert "'status' was stopped before it was begun." in said
    assert [each["line"] for each in answers if "line" in each] == ["hold", "stop", "jog x3"]


def test_a_signal_that_ends_the_session_is_named(words, monkeypatch):
    poll = InThread.poll

    def interrupted(self):
        signal.raise_signal(signal.SIGTERM)
        return poll(self)

    monkeypatch.setattr(InThread, "poll", interrupted)
    said = sentence(words("status\n", "virtual"), 130)
    assert said == "miurafab: The session was ended by a request to terminate (SIGTERM)."


# The screen


class Shown(io.StringIO):
    """A terminal that keeps what it is sent."""

    def isatty(self):
        return True


@pytest.fixture
def screen(tmp_path, monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    (tmp_path / "line.nc").write_text(LINE)
    prepared = prepare(tmp_path / "line.nc")
    process = InThread(prepared.machine, "virtual", StopSignals())
    return SessionScreen(Operator(process, prepared, CutOptions()), Shown())


def seen(screen):
    while screen._operator.take():
        pass
    return "\n".join(screen.lines(100))


@pytest.mark.parametrize(
    ("keys", "step"),
    [("", 1.0), (PAGE_UP, 10.0), (">>>>", 50.0), ("<<<", 0.1), (f">{PAGE_DOWN}", 1.0)],
)
def test_a_key_chooses_the_step_of_the_arrows(screen, keys, step):
    screen.press(keys)
    assert f"step     {step:g} mm" in seen(screen)
    screen.press(3 * RIGHT)  # at once: one press
    InThread.made.session.watch(3.0)
    screen.press(UP)
    InThread.made.session.watch(3.0)
    assert InThread.made.device.position[:2] == pytest.approx((step, step), abs=0.013)
    screen.press(LEFT)
    InThread.made.session.watch(3.0)
    screen.press(DOWN)
    InThread.made.session.watch(3.0)
    assert InThread.made.device.position[:2] == pytest.approx((0.0, 0.0), abs=0.013)


def test_keys_that_act_at_once_are_passed_on_and_help_is_hidden(screen):
    screen.press("+ r]")
    assert InThread.made.keys == "+ r]"
    assert HELP[0] in seen(screen)
    screen.press("?")
    assert seen(screen).endswith("\n? lists the keys")
    screen.press("?")
    assert HELP[0] in seen(screen)


def test_a_line_for_the_controller_is_typed_seen_and_sent(screen):
    screen.press(":G92 X70\x7f\x1b\u00e4")
    assert "line: G92 X7_   (Enter sends it)" in seen(screen)
    assert "> " not in seen(screen)
    screen.press("\r")
    assert "> G92 X7" in seen(screen)
    assert InThread.made.session.state.position[0] == 7.0
    asked = list(InThread.made.asked)
    screen.press(":  \n")
    assert InThread.made.asked == asked


def test_a_line_that_is_being_typed_keeps_no_reset_back(screen):
    screen.press(":G1 q\x18 X5")
    assert InThread.made.keys == "\x18"
    assert "line: G1 q X5_" in seen(screen)


def test_any_other_key_disarms(screen):
    assert "waits for a key" in seen(screen)
    screen.press("a")
    assert "ARMED: s burns this sheet, any other key does not" in seen(screen)
    screen.press("y")
    assert "ARMED" not in seen(screen)
    screen.press("s")
    assert "Nothing is armed; arm the sheet first" in seen(screen)
    assert not InThread.made.device.beam_log


def test_a_terminal_without_a_cursor_gets_each_new_line_once(screen, monkeypatch):
    operator = screen._operator
    for environment, out in (("dumb", Shown()), ("xterm", io.StringIO())):
        monkeypatch.setenv("TERM", environment)
        plain = SessionScreen(operator, out)
        plain.draw(last=True)
        screen.press("x")
        plain.press(">")
        plain.draw()  # too soon
        plain.draw(last=True)
        plain.draw(last=True)
        lines = out.getvalue().splitlines()
        assert "\x1b" not in out.getvalue()
        assert [line for line in lines if line.startswith("step")] == [
            "step     1 mm",
            "step     10 mm",
        ]
        assert len([line for line in lines if line.startswith("machine")]) == 1
    assert screen.done


def test_the_state_is_coloured_where_it_may_be(screen, monkeypatch):
    screen.draw(last=True)
    assert "\x1b[32mIdle\x1b[0m" in screen._out.getvalue()
    monkeypatch.setenv("NO_COLOR", "1")
    plain = SessionScreen(screen._operator, Shown())
    plain.draw(last=True)
    assert "[32m" not in plain._out.getvalue()
