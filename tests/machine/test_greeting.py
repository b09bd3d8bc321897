"""A controller is greeted without a reset where it proves that it rests; a reset is proven too."""

from __future__ import annotations

import random
from typing import Any

import pytest
from dashes import dashes
from wires import FakeWire

from miurafab.errors import ControllerError, JobStopped, MiurafabError, PortError
from miurafab.gcode.job import Job
from miurafab.grbl.connection import Connection
from miurafab.grbl.events import Banner
from miurafab.grbl.replies import parse_reply
from miurafab.grbl.states import State
from miurafab.machine.planning import SendOptions, plan_job
from miurafab.machine.sender import deliver
from miurafab.machine.session import Session
from miurafab.machine.signals import StopSignals
from miurafab.profiles import load_machine
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings
from miurafab.simulate.grbl.dialect import DIALECTS

MACHINE = load_machine("grbl-laser-400")


def board(*lines: str, greets: bool = True, dialect: str = "grbl-1.1") -> VirtualGrbl:
    """A board that started before its port was opened; another program sent it ``lines``."""
    device = VirtualGrbl(virtual_settings(MACHINE), baud=115_200, dialect=dialect, greets=greets)
    device.advance(0.1)
    device.receive("".join(lines).encode())
    device.advance(0.2)
    device.take_output()
    return device


def greeted(device: VirtualGrbl, **options: bool) -> tuple[Session, FakeWire]:
    wire = FakeWire(device)
    session = Session(wire, Connection())
    session.greet(**options)
    return session, wire


@pytest.mark.parametrize("greets", [True, False])
@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_board_at_rest_is_known_by_its_answers(dialect: str, greets: bool) -> None:
    session, wire = greeted(board(greets=greets, dialect=dialect))
    assert wire.commands == b"$I\n"
    assert not session.restarted
    versions = {"grbl-1.1": "1.1h", "grbl-0.9": "0.9j", "grblhal": "1.1f", "fluidnc": "3.7"}
    assert session.banner == Banner("Grbl", versions[dialect])
    assert session.command("$G")


@pytest.mark.parametrize("reset", [True, False])
def test_a_silent_board_is_reset_only_if_asked_and_that_is_proven(reset: bool) -> None:
    device = board("G92X5\n", greets=False)
    session, wire = greeted(device, reset=reset)
    assert wire.commands == (b"\x18$I\n" if reset else b"$I\n")
    assert session.status is not None
    x = session.position
    session.ask("$#")
    assert (x is not None and x[0] != 0.0) is not reset  # a reset forgets the origin


def test_half_a_line_of_another_program_is_never_run() -> None:
    device = board("G1X5F600")
    _, wire = greeted(device)
    assert wire.commands == b"$I\n$I\n"
    device.advance(1.0)
    assert device.position == (0.0, 0.0, 0.0)


def test_lines_of_another_program_are_dropped_by_a_reset() -> None:
    """In a dwell the state is Idle, though the lines behind it wait in the buffer."""
    device = board("M3S500\n", "G4P1\n", "G1X50F3000\n")
    _, wire = greeted(device)
    assert wire.commands == b"$I\n\x18"
    device.advance(5.0)
    assert device.position == (0.0, 0.0, 0.0)
    assert not device.beam_on


class Deaf(FakeWire):
    """A wire that loses every reset."""

    def write(self, data: bytes) -> None:
        super().write(data.replace(b"\x18", b""))


@pytest.mark.parametrize("greets", [True, False])
@pytest.mark.parametrize("busy", ["G4P30\n", "G4P1\nG1X9F100\n", "G1X300F1000\n"])
def test_a_reset_that_was_not_heard_is_not_confirmed(busy: str, greets: bool) -> None:
    session = Session(Deaf(board(busy, greets=greets)), Connection())
    assert session.stop() is False


@pytest.mark.parametrize("at", [2.0, 4.0])
def test_a_job_on_a_silent_board_is_stopped_and_the_beam_is_known_to_be_off(at: float) -> None:
    device = VirtualGrbl(virtual_settings(MACHINE), baud=115_200, greets=False)
    wire, signals = FakeWire(device), StopSignals()
    wire.before_call = lambda call: setattr(
        signals, "caught", "SIGINT" if device.now > at + 2.0 else None
    )
    with pytest.raises(JobStopped, match=r"the controller was reset and reports the beam off\.$"):
        deliver(plan_job(dashes("absolute"), MACHINE), wire, signals)
    assert wire.commands.endswith(b"\x18$I\n")
    stopped = next(when for when, data in wire.written if b"\x18" in data)
    device.advance(60.0)
    assert all(segment.t1 <= stopped + 0.01 for segment in device.beam_log)


@pytest.mark.parametrize("text", ["Grbl 1.1h ['$' for help]  ", "Grbl 1.1h ['$' for help]\t"])
def test_blanks_behind_a_banner_say_nothing(text: str) -> None:
    assert parse_reply(text) == Banner("Grbl", "1.1h")


@pytest.mark.parametrize(("state", "waits"), [("Starting", True), ("Tool", False)])
def test_words_of_other_firmwares(state: str, waits: bool) -> None:
    """FluidNC says that it starts; grblHAL waits for a tool, and is left alone."""

    class Saying(FakeWire):
        def read(self, timeout: float) -> bytes:
            data = super().read(timeout)
            return data.replace(b"<Idle|", f"<{state}|".encode()) if self.calls < 4 else data

    session = Session(wire := Saying(board(dialect="fluidnc")), Connection())
    if waits:
        session.greet()
        assert wire.commands == b"$I\n"
    else:
        with pytest.raises(ControllerError, match=r"is at work \(Tool\)"):
            session.greet()
        assert wire.commands == b""


@pytest.mark.parametrize("options", [{}, {"at": (0.0, 0.0)}, {"home": True}])
@pytest.mark.parametrize("resets", [True, False])
def test_a_job_says_what_the_opening_of_its_port_undid(
    resets: bool, options: dict[str, Any]
) -> None:
    class Port(FakeWire):
        blocks = True

    homing = {22: 1, 24: 500, 25: 3000} if "home" in options else {}
    device = VirtualGrbl(virtual_settings(MACHINE) | homing, baud=115_200)
    if not resets:
        device.advance(0.1)
        device.take_output()
    way = -5 if homing else 1  # a homed machine stands near 0 of -400 to 0
    text = f"M4 S0\nG1 X{way} Y{way} S9 F600\nM5\n"
    plan = plan_job(Job("a.nc", text), MACHINE, SendOptions(**options))
    findings = deliver(plan, Port(device), StopSignals()).findings
    assert [f.code for f in findings] == (["restarted"] if resets and not options else [])


SAID = (
    b"<Idle|MPos:0.000,0.000,0.000|FS:0,0>\r\n",
    b"<Alarm|MPos:0.000,0.000,0.000|FS:0,0>\r\n",
    b"<Run|MPos:0.000,0.000,0.000|FS:100,5>\r\n",
    b"\r\nGrbl 1.1h ['$' for help]\r\n",
    b"[MSG:'$H'|'$X' to unlock]\r\n",
    b"[VER:1.1h.20190830:]\r\n[OPT:V,15,128]\r\nok\r\n",
    b"ok\r\n",
    b"error:8\r\n",
    b"ALARM:1\r\n",
    b"[VER:1.1h.201",
    b"\xff\x00o\x80k\r\n",
)


class Babbling:
    """A wire at whose other end anything may be said at any time, in any pieces."""

    name, blocks, time = "babble", False, 0.0

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self.written = b""

    def now(self) -> float:
        return self.time

    def write(self, data: bytes) -> None:
        self.written += data

    write_now = write

    def read(self, timeout: float) -> bytes:
        self.time += min(max(timeout, 0.01), 0.3)
        return b"".join(self._random.choices(SAID, k=self._random.choice((0, 0, 1, 1, 2, 3))))

    def close(self) -> None:
        pass


def test_whatever_is_said_a_greeting_ends_in_a_state_that_is_known_or_a_sentence() -> None:
    ends = set()
    for seed in range(1500):
        wire = Babbling(seed)
        session = Session(wire, Connection())
        try:
            session.greet(1.0)
            ends.add(session.connection.state)
            assert session.banner != Banner("", "")
        except MiurafabError as error:
            ends.add(type(error))
        assert set(wire.written) <= set(b"?$I\n\x18")
        session.stop()  # never raises
    assert {State.GREETED, State.READY, State.LOCKED, ControllerError, PortError} <= ends
