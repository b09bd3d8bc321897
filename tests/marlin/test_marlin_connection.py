"""Lines counted and with a checksum, one in flight, sent again when the controller asks."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from miurafab.gcode.job import SendLine
from miurafab.marlin.connection import EMERGENCY, MOST_TRIES, MarlinConnection, framed
from miurafab.marlin.replies import (
    Killed,
    MarlinError,
    MarlinOk,
    Reply,
    Resend,
    Started,
    parse_reply,
)
from miurafab.motion.parameters import MotionParameters
from miurafab.profiles import load_machine
from miurafab.simulate.marlin.controller import VirtualMarlin

LINE = SendLine(7, b"G1X10")
PARAMETERS = MotionParameters.from_profile(load_machine("marlin-laser-220"))


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("ok", MarlinOk),
        ("ok N12 P15 B3", MarlinOk),
        ("ok T:20.0 /0.0", MarlinOk),
        ("Resend: 12", Resend),
        ("rs 12", Resend),
        ("echo:busy: processing", Reply),
        ("busy: paused for user", Reply),
        ("start", Started),
        ("Error:Printer halted. kill() called!", Killed),
        ("!! KILLED", Killed),
        ("Error:checksum mismatch, Last Line: 4", Reply),
        ("Error:Line Number is not Last Line Number+1, Last Line: 4", Reply),
        ("Error:Heating failed", MarlinError),
        ('echo:Unknown command: "G17"', MarlinError),
        ("echo:  G21    ; Units in mm", Reply),
        ("oksana", Reply),
    ],
)
def test_each_reply_is_known_by_its_words(text: str, kind: type[Reply]) -> None:
    assert type(parse_reply(text)) is kind


def test_a_frame_is_what_marlin_documents() -> None:
    assert framed(3, b"T0") == b"N3 T0*57\n"
    assert framed(4, b"G92 E0") == b"N4 G92 E0*67\n"


def heard(connection: MarlinConnection, text: str) -> list[Reply]:
    connection.receive_data(text.encode())
    return list(connection.replies())


def test_the_count_begins_anew_and_runs_on() -> None:
    connection = MarlinConnection()
    assert connection.restart_count().startswith(b"N0 M110N0*")
    assert not connection.idle
    heard(connection, "ok\n")
    assert connection.send_line(LINE).startswith(b"N1 G1X10*")
    assert heard(connection, "ok\r\n") == [MarlinOk("ok", LINE)]
    assert connection.send_line(LINE).startswith(b"N2 ")


def test_a_line_asked_for_again_is_sent_again_and_answered_once() -> None:
    connection = MarlinConnection()
    connection.restart_count()
    heard(connection, "ok\n")
    sent = connection.send_line(LINE)
    heard(connection, "Error:checksum mismatch, Last Line: 0\nResend: 1\n")
    assert not connection.wants_again  # its ok frees the wire
    assert heard(connection, "ok\n") == []
    assert connection.wants_again
    assert connection.send_again() == b"\n" + sent
    assert not connection.wants_again
    assert heard(connection, "ok\n") == [MarlinOk("ok", LINE)]


def test_a_line_that_was_taken_though_its_ok_was_lost_is_not_made_twice() -> None:
    connection = MarlinConnection()
    connection.restart_count()
    heard(connection, "ok\n")
    connection.send_line(LINE)
    connection.send_again()
    said = "Error:Line Number is not Last Line Number+1, Last Line: 1\nResend: 2\nok\n"
    assert heard(connection, said)[-1] == MarlinOk("ok", LINE)
    assert connection.idle


def test_a_line_of_long_ago_is_a_fault_and_tries_are_counted() -> None:
    connection = MarlinConnection()
    connection.restart_count()
    heard(connection, "ok\n")
    connection.send_line(LINE)
    assert isinstance(heard(connection, "Resend: 0\n")[0], MarlinError)
    for _ in range(MOST_TRIES - 1):
        assert connection.send_again()
    assert connection.send_again() == b""


def test_only_one_line_is_in_flight_and_a_restart_drops_it() -> None:
    connection = MarlinConnection()
    connection.send_line(LINE)
    with pytest.raises(AssertionError):
        connection.send_line(LINE)
    assert heard(connection, "start\n") == [Started("start")]
    assert connection.idle
    assert connection.send_again() == b""


def test_the_emergency_stop_is_read_behind_half_a_line() -> None:
    for emergency_parser in (True, False):
        device = VirtualMarlin(PARAMETERS, emergency_parser=emergency_parser)
        device.receive(b"N1 G1 X50 F6" + EMERGENCY)
        device.advance(1.0)
        assert device.killed


@given(st.binary(max_size=300), st.integers(1, 20))
def test_noise_in_any_chunks_never_breaks_the_connection(noise: bytes, size: int) -> None:
    connection = MarlinConnection()
    connection.send_line(LINE)
    for begin in range(0, len(noise), size):
        connection.receive_data(noise[begin : begin + size])
    assert all(reply.text for reply in connection.replies())
