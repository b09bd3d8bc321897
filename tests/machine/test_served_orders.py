"""The two ends of a session in another process, each in this one: orders, stops and silences."""

from __future__ import annotations

import contextlib
import pickle
import signal
import socket
import subprocess
import sys
from collections import deque
from dataclasses import replace
from pathlib import Path

import pytest
from session_walk import JOB, MACHINE

from miurafab.errors import InputError, JobStopped, MachineError, PortError, ProfileError
from miurafab.gcode.job import Job
from miurafab.machine import job_process, session_process, virtual_server
from miurafab.machine.journal import read_journal
from miurafab.machine.known_controller import KnownController, PortSetup
from miurafab.machine.machine_session import MachineSession
from miurafab.machine.modes import ControllerModes
from miurafab.machine.owner import Owner, claim
from miurafab.machine.planning import plan_job
from miurafab.machine.session_process import (
    Outcome,
    SessionOrder,
    SessionProcess,
    _carry_out,
    _next,
    _serve,
    suspending_signals,
)
from miurafab.machine.signals import StopSignals
from miurafab.machine.transport import SerialTransport, VirtualTransport
from miurafab.machine.virtual_server import TcpWire, load_controller, serve_virtual
from miurafab.machine.watchdog import BEAT, STOPS, SUSPENDED, GivenOrder, ParentWatch
from miurafab.profiles import load_machine
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings


class Parent:
    """The starting program: what it orders when it is asked (None: nothing yet), and its keys."""

    resets = 0

    def __init__(self, *orders: SessionOrder | None, keys: str = "") -> None:
        self._orders, self._keys = deque(orders), keys

    def next_order(self, timeout: float) -> GivenOrder | None:
        order = self._orders.popleft()
        return None if order is None else GivenOrder(pickle.dumps(order), 0)

    def pressed(self) -> str:
        keys, self._keys = self._keys, ""
        return keys


def opened(parent: Parent) -> MachineSession:
    wire = VirtualTransport(VirtualGrbl(virtual_settings(MACHINE)))
    return MachineSession(wire, StopSignals(), PortSetup.of(MACHINE), parent)


def test_orders_are_waited_for_before_and_after_the_port_is_open() -> None:
    close = SessionOrder("close", {})
    parent = Parent(None, None, SessionOrder("open", {}), None, close)
    session, told = opened(parent), []
    _serve(session, parent, StopSignals(), told.append)
    assert [each.action for each in told if isinstance(each, Outcome)] == ["open"]
    assert session.known.opened
    assert _next(Parent(None, None, close), StopSignals()) == close


def test_a_reset_key_in_an_action_that_leaves_nothing_running_resets() -> None:
    parent = Parent(keys="")
    session, told = opened(parent), []
    session.open()
    before, parent._keys = session.conversation.starts, "\x18"
    _carry_out(SessionOrder("look", {}), session, StopSignals(), told.append)
    outcome = told[-1]
    assert isinstance(outcome.error, JobStopped)
    assert str(outcome.error) == "The machine was stopped at a key."
    assert session.conversation.starts > before


def test_ctrl_c_in_an_action_closes_the_port_and_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    session, told, signals = opened(Parent()), [], StopSignals()
    signals.caught = "SIGTERM"

    def interrupted(self: MachineSession) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(MachineSession, "look", interrupted)
    with pytest.raises(KeyboardInterrupt):
        _carry_out(SessionOrder("look", {}), session, signals, told.append)
    (outcome,) = told
    assert str(outcome.error) == "Stopped by a request to terminate (SIGTERM)."


@pytest.fixture
def deaf(monkeypatch: pytest.MonkeyPatch) -> None:
    """The process that is started hears nothing and ends by no wish."""
    command = [sys.executable, "-S", "-c", "import time; time.sleep(60)"]
    monkeypatch.setattr(session_process, "python_command", lambda module: command)
    monkeypatch.setattr(session_process, "_STOP_S", 0.05)


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="kills as POSIX does")
@pytest.mark.parametrize("how", ["a signal", "the end"])
def test_a_process_that_stops_at_no_wish_is_killed(deaf: None, how: str) -> None:
    signals = StopSignals()
    process = SessionProcess(MACHINE, "virtual", signals)
    if how == "a signal":
        signals.caught = "SIGINT"
        while not process.over:
            process.poll()
    process.end()
    assert process.death == "was killed by signal 9"
    assert process.make_safe() == "it had not opened the port"


@pytest.mark.parametrize(
    ("machine", "stops"), [("grbl-laser-400", False), ("grbl09-laser-300", True)]
)
def test_a_suspended_program_holds_what_burns_or_stops_it(
    deaf: None, monkeypatch: pytest.MonkeyPatch, machine: str, stops: bool
) -> None:
    """A beam may stay on in the hold of a controller without a report of it."""
    signals, told = suspending_signals(), []
    monkeypatch.setattr(signals.suspension, "_here", lambda: told.append("suspended"))
    process = SessionProcess(load_machine(machine), "virtual", signals)
    process.order("cut", plan=JOB)
    monkeypatch.setattr(process, "_tell", told.append)
    signals.suspension.wish()
    assert told == []
    process.poll()
    process.end()
    what = STOPS["SIGTERM"] if stops else b" "
    assert [each for each in told if each in (what, SUSPENDED, "suspended")] == [
        *(what, SUSPENDED, "suspended")
    ]


@pytest.mark.parametrize("lit", [True, False])
def test_what_a_line_of_a_person_burns_is_ended_where_the_program_is_suspended(
    deaf: None, monkeypatch: pytest.MonkeyPatch, lit: bool
) -> None:
    """The watchdog waits for no beat meanwhile: a beam at rest would burn for as long."""
    signals, told = suspending_signals(), []
    monkeypatch.setattr(signals.suspension, "_here", lambda: told.append("suspended"))
    process = SessionProcess(MACHINE, "virtual", signals)
    process.state = replace(opened(Parent()).open(), beam_on=lit)
    monkeypatch.setattr(process, "_tell", told.append)
    signals.suspension.wish()
    process.poll()
    process.end()
    assert told == [b"q"] * lit + [SUSPENDED, "suspended"]


@pytest.mark.parametrize("last", ["told", "ended", "begun"])
def test_a_program_with_several_machines_is_silent_at_all_until_it_is_suspended(
    deaf: None, monkeypatch: pytest.MonkeyPatch, last: str
) -> None:
    """A beat after the wish was told would say that it is back: five seconds later it is hung."""
    signals, told = suspending_signals(), []
    monkeypatch.setattr(signals.suspension, "_here", lambda: told.append("suspended"))
    one, other = (SessionProcess(MACHINE, "virtual", signals) for _ in range(2))
    monkeypatch.setattr(one, "_tell", told.append)
    signals.suspension.wish()
    for _ in range(4):
        one.poll()
    assert told == [SUSPENDED]
    third = SessionProcess(MACHINE, "virtual", signals) if last == "begun" else other
    for each in {other, third} if last != "ended" else ():
        assert told == [SUSPENDED]
        each.poll()
    other.end()
    assert told == [SUSPENDED, "suspended"]
    third.end()
    one.poll()
    assert told == [SUSPENDED, "suspended", BEAT]
    one.end()


def test_a_program_that_is_suspended_holds_the_process_up_in_nothing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """It reads nothing, and what tells the progress would soon wait for it in a full pipe."""
    monkeypatch.setattr(SessionProcess, "_read", lambda self, pipe: None)
    process, journal = SessionProcess(MACHINE, "virtual", StopSignals()), tmp_path / "journal"
    process._tell(SUSPENDED)
    slow = plan_job(Job("slow.nc", "M4 S0\nG1 X30 S500 F30\nM5\n"), MACHINE)
    process.order("cut", plan=slow, journal_path=journal)
    process.order("close")
    with contextlib.suppress(subprocess.TimeoutExpired):
        process._process.wait(60)
    process.end()
    assert process.death.startswith("ended with code 0")
    (run,) = read_journal(journal)
    assert (run.ended, run.taken) == ("done", 3)


class Ended:
    """A process that ended before it had opened the port."""

    over, begun, death = True, False, "ended with code 1"

    def __init__(self, *given: object) -> None:
        self.asked = []

    def order(self, action: str, **options: object) -> None:
        self.asked.append(action)

    def close(self) -> None:
        pass

    def end(self) -> None:
        pass

    def make_safe(self) -> str:
        return "it had not opened the port"


@pytest.mark.parametrize("caught", [None, "SIGINT"])
def test_a_job_that_was_stopped_before_its_first_line_says_so(
    monkeypatch: pytest.MonkeyPatch, caught: str | None
) -> None:
    monkeypatch.setattr(job_process, "SessionProcess", Ended)
    signals = StopSignals()
    signals.caught = caught
    kind, told = (
        (
            MachineError,
            "The process that sent rows.nc ended with code 1; it had not opened the port.",
        )
        if caught is None
        else (JobStopped, "rows.nc was stopped by Ctrl-C before a line of it was sent.")
    )
    with job_process.session_apart(MACHINE, "/dev/x", "rows.nc", signals=signals) as session:
        session.load()  # there is nothing to tell yet
        with pytest.raises(kind) as caught_error:
            session.cut(JOB)
    assert str(caught_error.value) == told


def test_after_its_end_a_watch_stops_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[object] = []
    monkeypatch.setattr(signal, "pthread_kill", lambda *what: sent.append(what), raising=False)
    monkeypatch.setattr(signal, "raise_signal", sent.append)
    watch = ParentWatch(0, StopSignals())
    watch._stop("SIGTERM")
    assert len(sent) == 1
    watch._over.set()
    watch._stop("SIGTERM")
    assert len(sent) == 1


# Ports


def test_a_port_of_the_network_is_in_use_by_its_owner(
    tmp_path: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    release = claim("loop://", Owner("miurafab cut x", 7, 1.0, 1))
    monkeypatch.setattr("miurafab.machine.owner.is_alive", lambda process: True)
    with pytest.raises(PortError, match=r"in use by another program, process 7 \(miurafab cut x\)"):
        SerialTransport("loop://", 115_200)
    release()
    transport = SerialTransport("loop://", 115_200)
    transport.write_now(b"?")  # this one tells nothing of what it has not sent
    assert transport.read(0.5) == b"?"
    transport.close()


def test_the_practice_machine_takes_one_sender_at_a_time() -> None:
    wire = TcpWire("127.0.0.1:0")
    host, _, port = wire.address.removeprefix("socket://").rpartition(":")
    with socket.create_connection((host, int(port)), 5) as first:
        assert wire.wait(5.0) == (b"", True)
        with socket.create_connection((host, int(port)), 5) as second:
            assert wire.wait(5.0) == (b"", False)
            second.settimeout(5)
            assert second.recv(1) == b""
        first.sendall(b"?")
        assert wire.wait(5.0) == (b"?", False)
    wire.close()


def test_what_cannot_be_served_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    for speed in (0.0, float("inf"), -1.0):
        with pytest.raises(InputError, match="does not run; give a positive number"):
            serve_virtual(speed=speed)
    with pytest.raises(ProfileError, match="may be silent at a start; leave 'silent_greeting' out"):
        load_controller("marlin-laser-220", greets=False)


def test_a_cutter_is_not_switched_off_as_its_port_opens(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[object] = []
    monkeypatch.setattr(virtual_server, "_serve", lambda *given: seen.append(given[-1]))
    for settings in ("hpgl-cutter-a3", "marlin-laser-220"):
        serve_virtual(tcp="127.0.0.1:0", settings=settings, announce=lambda address: None)
    assert seen == ["never", "edge"]


class Replugged:
    address = "/dev/pts/1"

    def plug(self) -> None:
        self.address = "/dev/pts/2"


def test_an_address_that_is_another_after_the_cable_was_out_is_told() -> None:
    told: list[str] = []
    virtual_server._replug(Replugged(), True, told.append)
    assert told == ["/dev/pts/2"]


# What a controller says of itself


def test_startup_blocks_alone_are_told() -> None:
    (finding,) = ControllerModes((), {0: "G20", 1: ""}).findings()
    assert finding.sentence.startswith("The controller runs $N0=G20 after each reset; G21")
    assert list(ControllerModes((), {0: "", 1: ""}).findings()) == []


def test_a_board_that_tells_no_offsets_has_none_that_is_known() -> None:
    session = opened(Parent())
    assert KnownController(session.conversation, MACHINE.dialect)._offset_in_force() is None
    session.conversation._report_in(25.4)  # $13 is told before any place
    assert session.conversation.mm_per_unit == 25.4
