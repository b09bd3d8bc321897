"""A session with a controller that is told what to answer: what is sent then, and what counts."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import pytest
from wires import BANNER

from miurafab.errors import ControllerError, PortError
from miurafab.gcode.job import SendLine
from miurafab.grbl.connection import Connection
from miurafab.grbl.events import Banner
from miurafab.grbl.states import State
from miurafab.machine.greeting import restarts
from miurafab.machine.progress import AS_WRITTEN
from miurafab.machine.session import Session
from miurafab.machine.transcript import Transcript

DARK = b"<Idle|MPos:0.000,0.000,0.000|FS:0,0>\r\n"
LIT = b"<Idle|MPos:0.000,0.000,0.000|FS:0,500>\r\n"
UNTOLD = b"<Idle|MPos:0.000,0.000,0.000|F:0>\r\n"


class Scripted:
    """A wire at whose other end each thing that is sent has its answers, one after the other, the
    last of them for ever; what comes ``late`` comes at its time.
    """

    name, blocks = "the script", False

    def __init__(self, late: Sequence[tuple[float, bytes]] = (), **answers: Sequence[bytes]):
        names = {"query": b"?", "reset": b"\x18", "hold": b"!"}
        self.time = 0.0
        self.sent: list[tuple[float, bytes]] = []
        self._late = sorted(late)
        self._answers = {
            names.get(key, key.encode() + b"\n"): list(said) for key, said in answers.items()
        }
        self._said = b""

    @property
    def commands(self) -> bytes:
        return b"".join(data for _, data in self.sent).replace(b"?", b"")

    def now(self) -> float:
        return self.time

    def write(self, data: bytes) -> None:
        self.sent.append((self.time, data))
        said = self._answers.get(data, [b""])
        self._said += said[0] if len(said) == 1 else said.pop(0)

    write_now = write

    def read(self, timeout: float) -> bytes:
        said, self._said = self._said, b""
        self.time += 0.02 if said else max(min(timeout, 0.1), 0.001)
        while self._late and self._late[0][0] <= self.time:
            said += self._late.pop(0)[1]
        return said

    def close(self) -> None:
        pass


def greeted(**script: Sequence[bytes]) -> tuple[Session, Scripted]:
    wire = Scripted(**script)
    session = Session(wire, Connection())
    session.connection.receive_data(BANNER)
    list(session.connection.events())
    return session, wire


def test_a_session_that_has_heard_nothing_knows_nothing() -> None:
    wire = Scripted()
    wire.time = 100.0
    session = Session(wire, Connection())
    told = (session.restarted, session.restarted_itself, session.overrides_told)
    assert told == (False, False, False)
    assert session.now() == 0.0


def test_a_restart_by_the_port_is_told_once() -> None:
    session, wire = greeted()
    session.restarted = wire.blocks = True
    assert [session.take_restart(), session.take_restart()] == [True, False]


@pytest.mark.parametrize(
    ("said", "overrides", "told"),
    [
        (b"<Idle|Ov:120,50,90>\r\n", (120, 50, 90), True),
        (b"<Idle|Ov:120,50>\r\n", AS_WRITTEN, False),
        (b"<Idle|Ov:120,50,90,1>\r\n", AS_WRITTEN, False),
        (b"<Idle|Ov:120,50,90>\r\n" + BANNER, AS_WRITTEN, True),
    ],
)
def test_overrides_are_three_numbers_of_a_report_and_end_at_a_start(
    said: bytes, overrides: tuple[int, ...], told: bool
) -> None:
    session = Session(Scripted(late=[(0.1, said)]), Connection())
    session.pause(0.2)
    assert session.overrides == overrides
    assert session.overrides_told is told


def test_a_banner_that_no_reset_asked_for_is_a_start_of_its_own() -> None:
    wire = Scripted(late=[(0.5, BANNER)])
    session = Session(wire, Connection())
    session.pause(1.0)
    assert (session.starts, session.restarted_itself) == (1, True)


def test_a_query_that_is_lost_is_asked_again_after_a_second() -> None:
    session, wire = greeted(query=[b"", b"", DARK])
    assert session.wait_status().beam_off
    assert [when for when, _ in wire.sent] == pytest.approx([0.0, 1.0, 2.0], abs=0.11)
    assert session.ask_status()
    asked = wire.time
    wire.time = asked + 0.99
    assert not session.ask_status()
    wire.time = asked + 1.0
    assert session.ask_status()


def test_a_report_that_was_asked_for_before_answers_no_question_of_now() -> None:
    session, wire = greeted(late=[(0.1, LIT)], query=[b"", DARK])
    assert session.ask_status()
    assert session.wait_status().beam_off
    assert wire.sent.count((0.0, b"?")) == 1
    assert len(wire.sent) == 2


@pytest.mark.parametrize(
    "wait",
    [
        lambda session: session.pause(0.05),
        lambda session: session.fresh_status(0.05),
        lambda session: session.wait_banner(0.05),
        lambda session: session.command("M8", 0.05),
    ],
    ids=["pause", "status", "banner", "answer"],
)
def test_a_wait_in_silence_ends_at_its_time(wait: Callable[[Session], object]) -> None:
    session, wire = greeted()
    session.pause(5.0)
    begun = wire.time
    with suppress(ControllerError):
        wait(session)
    assert wire.time - begun == pytest.approx(0.05)


def test_a_controller_that_is_deaf_while_it_stores_is_asked_nothing() -> None:
    session, wire = greeted()
    session.write(session.connection.send_line(SendLine(1, b"G10L2P1X1")))
    assert session.ask_status() is False
    assert session.fresh_status(1.0) is None
    assert wire.sent == [(0.0, b"G10L2P1X1\n")]


def test_what_was_told_in_inches_is_mm_and_back() -> None:
    session, wire = greeted()
    wire._said = b"<Idle|MPos:3.000,2.000,0.000|WCO:1.000,0.000,0.000>\r\n"
    for inches, unit in ((0, 1.0), (1, 25.4), (1, 25.4), (0, 1.0)):
        wire._said += f"$13={inches}\r\n".encode()
        session.pause(0.01)
        assert session.machine_position == pytest.approx((3 * unit, 2 * unit, 0))
        assert session.work_offset == pytest.approx((unit, 0, 0))


# Stopping


@pytest.mark.parametrize(
    ("reports", "after_m5", "dark", "sent"),
    [
        ([DARK], b"ok\r\n", True, b"\x18"),
        ([LIT, LIT, DARK], b"ok\r\n", True, b"\x18\x18\x18"),
        ([LIT, LIT, LIT, DARK], b"ok\r\n", True, b"\x18\x18\x18M5\n"),
        ([LIT], b"ok\r\n", False, b"\x18\x18\x18M5\n"),
        ([LIT, LIT, LIT, b""], b"ok\r\n", False, b"\x18\x18\x18M5\n"),
        ([LIT, LIT, LIT, UNTOLD], b"ok\r\n", False, b"\x18\x18\x18M5\n"),
        ([LIT, LIT, LIT, DARK], b"error:9\r\n", False, b"\x18\x18\x18M5\n"),
        ([UNTOLD], b"ok\r\n", False, b"\x18"),
        ([b""], b"ok\r\n", False, b"\x18"),
    ],
)
def test_a_stop_is_confirmed_by_nothing_but_a_report_that_the_beam_is_off(
    reports: list[bytes], after_m5: bytes, dark: bool, sent: bytes
) -> None:
    session, wire = greeted(reset=[BANNER], query=reports, M5=[after_m5])
    assert session.stop() is dark
    assert wire.commands == sent


def test_a_reset_that_is_not_heard_is_sent_three_times_and_no_line_after_it() -> None:
    session, wire = greeted()
    assert session.stop() is False
    assert wire.commands == 3 * b"\x18"
    session, wire = greeted(reset=[b"", BANNER], query=[b"", b"", DARK])
    assert session.stop() is True
    assert wire.commands == 2 * b"\x18"


def test_a_hold_comes_before_the_reset_of_a_refused_job_in_one_piece() -> None:
    session, wire = greeted(query=[DARK])
    wire._answers[b"!\x18"] = [BANNER]
    assert session.stop(hold_first=True) is True
    assert wire.sent[0][1] == b"!\x18"


HOLDING = b"<Hold:1|MPos:1.000,0.000,0.000|FS:100,0>\r\n"
HELD = b"<Hold:0|MPos:1.000,0.000,0.000|FS:0,0>\r\n"


@pytest.mark.parametrize(
    ("before", "seconds"),
    [
        ([HELD], (0.0, 0.2)),
        ([HOLDING, HOLDING, HELD], (0.0, 0.5)),
        ([DARK.replace(b"Idle", b"Jog"), DARK], (0.0, 0.5)),
        ([DARK.replace(b"Idle", b"Run"), DARK], (0.1, 0.5)),
        ([DARK.replace(b"Idle", b"Home")], (0.0, 0.2)),  # which no hold ends
        ([HOLDING], (0.99, 1.03)),
        ([b"", b"", DARK], (0.99, 1.03)),
    ],
)
def test_a_hold_is_waited_for_a_second_at_most_and_then_comes_the_reset(
    before: list[bytes], seconds: tuple[float, float]
) -> None:
    session, wire = greeted(query=before, reset=[BANNER])
    session.pause(5.0)
    session.hold_and_stop()
    assert wire.commands.startswith(b"!\x18")
    (begun, first), *_ = wire.sent
    assert first == b"!"
    at = next(when for when, data in wire.sent if data == b"\x18")
    assert seconds[0] <= at - begun <= seconds[1]
    asked = [when for when, data in wire.sent if data == b"?" and when < at]
    assert all(b - a >= 0.1 for a, b in itertools.pairwise(asked))


def test_a_hold_over_a_wire_that_is_gone_confirms_nothing() -> None:
    session, wire = greeted(query=[HELD], reset=[BANNER])

    def gone(data: bytes) -> None:
        raise PortError("The port of the script went away.")

    wire.write_now = gone  # type: ignore[method-assign]
    assert session.hold_and_stop() is False


def test_a_hold_before_a_reset_is_recorded(tmp_path: Path) -> None:
    session, _ = greeted(query=[HELD], reset=[BANNER])
    session.transcript = Transcript(tmp_path / "t", "a test")
    session.hold_and_stop()
    session.transcript.close()
    lines = (tmp_path / "t").read_text().splitlines()[1:]
    sent = [line.partition(" > ")[2] for line in lines if " > " in line]
    assert sent[:3] == ["!", "?", r"\x18"]
    assert lines[0] == "0.000000 > !"


def test_a_slow_board_has_its_whole_patience_to_come_back() -> None:
    session, wire = greeted(late=[(2.0, BANNER)])
    session.write(session.connection.send_realtime(b"\x18"))
    assert restarts(session, 3.0)
    assert 2.0 <= wire.time < 2.2
    session, wire = greeted(late=[(5.0, BANNER)])
    session.write(session.connection.send_realtime(b"\x18"))
    assert not restarts(session, 3.0)
    assert 3.0 <= wire.time < 4.5


@pytest.mark.parametrize("state", ["Run", "Jog", "Home", "Hold:0", "Door:1", "Tool"])
def test_a_controller_at_work_is_left_alone(state: str) -> None:
    wire = Scripted(query=[f"<{state}|MPos:0.000,0.000,0.000|FS:0,0>\r\n".encode()])
    word = state.partition(":")[0]
    with pytest.raises(ControllerError, match=rf"is at work \({word}\)"):
        Session(wire, Connection()).greet(1.0)
    assert wire.commands == b""


@pytest.mark.parametrize("state", ["Sleep", "Check", "Run"])
def test_a_controller_that_neither_works_nor_rests_is_reset(state: str) -> None:
    wire = Scripted(query=[DARK.replace(b"Idle", state.encode()), DARK], reset=[BANNER])
    session = Session(wire, Connection())
    session.greet(1.0, reset=state == "Run")
    assert wire.commands == b"\x18"
    assert session.banner == Banner("Grbl", "1.1h")
    assert not session.restarted


# Lines


@pytest.mark.parametrize(
    ("said", "sentence"),
    [
        (b"ALARM:8\r\n", r"stopped at 'M8': ALARM:8, "),
        (BANNER, r"restarted at 'M8'\."),
        (b"error:20\r\n", r"refused 'M8': error:20, "),
        (b"", r"The controller at the script did not answer 'M8' within 3 s\."),
        (b"[MSG:hello]\r\n", r"did not answer 'M8' within 3 s\."),
    ],
)
def test_a_line_ends_by_ok_alone(said: bytes, sentence: str) -> None:
    session, wire = greeted(M8=[said])
    with pytest.raises(ControllerError, match=sentence):
        session.command("M8")
    assert wire.commands == b"M8\n"


def test_what_is_said_before_the_ok_is_the_answer_and_is_recorded(tmp_path: Path) -> None:
    session, _ = greeted(M8=[b"[MSG:hello]\r\n" + DARK + b"ok\r\n"])
    session.transcript = Transcript(tmp_path / "t", "a test")
    assert [type(event).__name__ for event in session.command("M8")] == ["Feedback", "StatusReport"]
    session.transcript.close()
    sent, came = (tmp_path / "t").read_text().splitlines()[1:3]
    assert sent.endswith(r"> M8\n")
    assert came.endswith(r"< [MSG:hello]\r\n")


def test_homing_makes_a_position_known_again() -> None:
    session, wire = greeted(**{"$H": [b"ok\r\n"], "query": [DARK]})
    session.restarted_itself = True
    heeded: list[float] = []
    session.home(lambda: heeded.append(wire.time))
    assert session.restarted_itself is False
    assert heeded
    assert wire.commands == b"$H\n"
    session, wire = greeted(**{"$H": [b"ALARM:9\r\n"], "query": [DARK]})
    session.restarted_itself = True
    with pytest.raises(ControllerError, match="ALARM:9"):
        session.home()
    assert session.restarted_itself


def test_each_start_is_counted_and_one_that_nobody_sent_is_told() -> None:
    session, wire = greeted(reset=[BANNER], query=[DARK])
    assert session.stop()
    assert session.starts == 2
    assert session.restarted_itself is False
    assert session.stop()
    assert session.starts == 4
    wire._said += BANNER
    session.pause(0.2)
    assert session.starts == 5
    assert session.restarted_itself
    assert session.connection.state is State.GREETED


@pytest.mark.parametrize(
    ("said", "position", "machine_position"),
    [
        ([], None, None),
        (["MPos:5.000,6.000,0.000"], (5, 6, 0), (5, 6, 0)),
        (["WPos:5.000,6.000,0.000"], (5, 6, 0), None),
        (["MPos:5.000,6.000,0.000|WCO:1.000,2.000,0.000"], (4, 4, 0), (5, 6, 0)),
        (["WPos:5.000,6.000,0.000|WCO:1.000,2.000,0.000"], (5, 6, 0), (6, 8, 0)),
        (["WPos:0.000,0.000,0.000|WCO:1.000,2.000,0.000", "WPos:1,1,0"], (1, 1, 0), (2, 3, 0)),
        (["FS:0,0"], None, None),
        (["WPos:0.000,0.000,0.000|WCO:1.000,2.000,0.000", "FS:0,0"], None, None),
    ],
)
def test_a_position_is_told_or_is_the_sum_of_what_is_told(
    said: list[str],
    position: tuple[float, ...] | None,
    machine_position: tuple[float, ...] | None,
) -> None:
    session, wire = greeted()
    for fields in said:
        wire._said = f"<Idle|{fields}>\r\n".encode()
        session.pause(0.01)
    assert session.position == position
    assert session.machine_position == machine_position


def test_a_query_from_before_a_reset_keeps_none_back_after_it() -> None:
    """Of a board that does not greet: the first question is due as soon as a banner is not."""
    session, wire = greeted(query=[b"", DARK], **{"$I": [b"[VER:1.1h.20190830:]\r\nok\r\n"]})
    session.ask_status()
    assert session.stop()
    asked = [when for when, data in wire.sent if data == b"?"]
    assert asked[1] == pytest.approx(0.8, abs=0.05)
