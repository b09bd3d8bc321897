"""The streamer against scripted answers: when each line is sent, and what ends a job."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from miurafab.errors import ControllerError, GcodeError
from miurafab.gcode.job import Job, SendLine
from miurafab.grbl.connection import Connection
from miurafab.grbl.lines import writes_eeprom
from miurafab.grbl.streamer import LineRefused, Streamer

BANNER = b"\r\nGrbl 1.1h ['$' for help]\r\n"


def greeted(rx_bytes: int = 128) -> Connection:
    connection = Connection(rx_bytes)
    connection.receive_data(BANNER)
    list(connection.events())
    return connection


def hear(connection: Connection, streamer: Streamer, data: bytes) -> None:
    connection.receive_data(data)
    for event in connection.events():
        streamer.take(event)


def numbered(count: int, length: int = 10) -> list[SendLine]:
    return [SendLine(n, f"G1X{n:0{length - 3}d}".encode()) for n in range(1, count + 1)]


def test_character_counting_fills_the_buffer_at_once() -> None:
    connection = greeted(128)
    streamer = Streamer(connection, "job", numbered(100, 9))
    assert len(streamer.pull()) == 120
    assert streamer.pull() == b""
    hear(connection, streamer, b"ok\r\nok\r\n")
    assert streamer.pull() == b"G1X000013\nG1X000014\n"
    assert streamer.acknowledged == 2


def test_send_response_waits_for_each_answer() -> None:
    connection = greeted(128)
    streamer = Streamer(connection, "job", numbered(3), send_response=True)
    for n in range(1, 4):
        assert streamer.pull() == f"G1X{n:07d}\n".encode()
        assert streamer.pull() == b""
        assert not streamer.finished
        hear(connection, streamer, b"ok\r\n")
    assert streamer.finished
    assert streamer.pull() == b""


def test_an_empty_job_is_finished() -> None:
    assert Streamer(greeted(), "job", []).finished


def test_a_line_that_no_buffer_holds_is_named() -> None:
    streamer = Streamer(greeted(16), "job.nc", [SendLine(1, b"G1X1"), SendLine(7, b"X" * 16)])
    with pytest.raises(GcodeError, match=r"job\.nc, line 7 .* 17 bytes, more than the 16"):
        streamer.pull()


def test_a_refused_line_is_named_with_its_text_and_reason() -> None:
    connection = greeted()
    streamer = Streamer(connection, "job.nc", Job("job.nc", "G21\n\n(cut)\nG1 X5\n").send_lines())
    streamer.pull()
    with pytest.raises(LineRefused) as caught:
        hear(connection, streamer, b"ok\r\nerror:22\r\n")
    assert "job.nc, line 4 ('G1X5'): error:22, a feed move" in str(caught.value)


def test_in_check_mode_refusals_are_gathered() -> None:
    connection = greeted()
    streamer = Streamer(connection, "job", numbered(3), collect_refusals=True)
    streamer.pull()
    hear(connection, streamer, b"error:20\r\nok\r\nerror:99\r\n")
    assert streamer.finished
    assert [str(refusal) for refusal in streamer.refusals] == [
        "line 1 ('G1X0000001'): error:20, the controller does not know this word or G-code",
        "line 3 ('G1X0000003'): error:99, a code that GRBL 1.1 does not have",
    ]


@pytest.mark.parametrize(
    ("said", "sentence"),
    [
        (b"ALARM:1\r\n", "stopped after it took line 1 of job: ALARM:1, a limit switch was hit"),
        (BANNER, "restarted by itself after it took line 1 of job"),
        (b"[MSG:Sleeping]\r\n", "went into a lock after it took line 1"),
        (b"<Sleep|MPos:0,0,0|FS:0,0>\r\n", "went into Sleep after it took line 1"),
        (b"<Alarm|MPos:0,0,0|FS:0,0>\r\n", "went into Alarm after it took line 1"),
        (b"ok\r\n" * 5, "answered a line that was never sent"),
        (b"ok\r\nok\r\nerror:9\r\n", "answered a line that was never sent"),
        (b"ALARM: Hard limit\r\n", r"stopped after it took line 1 of job: Hard limit\."),
        (b"error: Bad number format\r\n", r"line 2 \('G1X0000002'\): Bad number format\."),
    ],
)
def test_what_ends_a_job(said: bytes, sentence: str) -> None:
    connection = greeted()
    streamer = Streamer(connection, "job", numbered(3))
    streamer.pull()
    with pytest.raises(ControllerError, match=sentence):
        hear(connection, streamer, b"ok\r\n" + said)


@pytest.mark.parametrize(
    ("said", "sentence"),
    [
        (b"ALARM: Hard limit\r\n", "stopped before it took a line of job: Hard limit"),  # GRBL 0.9
        (b"error: Bad number format\r\n", r"refused job, line 1 \(.*\): Bad number format"),
        (b"ALARM:1\r\n", "stopped before it took a line of job: ALARM:1"),
        (BANNER, "restarted by itself before it took a line of job; what it held is lost"),
    ],
)
def test_what_ends_a_job_before_its_first_line(said: bytes, sentence: str) -> None:
    connection = greeted()
    streamer = Streamer(connection, "job", numbered(3))
    streamer.pull()
    with pytest.raises(ControllerError, match=sentence):
        hear(connection, streamer, said)


def test_talk_ends_no_job() -> None:
    connection = greeted()
    streamer = Streamer(connection, "job", numbered(2))
    talk = b"<Idle|MPos:0,0,0|FS:0,0>\r\n[MSG:hello]\r\n\xff\r\n"
    hear(connection, streamer, talk)
    streamer.pull()
    hear(connection, streamer, talk + b"ok\r\n" + talk + b"ok\r\n" + talk)
    assert streamer.finished
    assert streamer.acknowledged == 2


def test_dwell_in_flight_is_known() -> None:
    connection = greeted()
    streamer = Streamer(connection, "job", Job("job", "G4 P2\nG1X1\nG4P0.5\n").send_lines())
    streamer.pull()
    assert streamer.dwell_in_flight == 2.5
    hear(connection, streamer, b"ok\r\n")
    assert streamer.dwell_in_flight == 0.5


LINES = st.lists(
    st.sampled_from(["G1X1Y1", "G0", "G10L2P1X0", "X" * 30, "G4P0.1", "$110=500"]), max_size=40
)


@given(
    LINES, st.lists(st.integers(1, 4), min_size=1), st.sampled_from([40, 64, 128]), st.booleans()
)
def test_every_line_goes_once_in_order_and_never_too_early(
    texts: list[str], answers: list[int], rx_bytes: int, send_response: bool
) -> None:
    """A device that only counts: lines in its buffer, answers in bursts of any size."""
    connection = greeted(rx_bytes)
    lines = [SendLine(n, text.encode()) for n, text in enumerate(texts, 1)]
    streamer = Streamer(connection, "job", lines, send_response=send_response)
    seen: list[bytes] = []
    buffered: list[bytes] = []
    turn = 0
    while not streamer.finished:
        buffered += streamer.pull().split(b"\n")[:-1]
        assert buffered
        assert sum(len(item) + 1 for item in buffered) <= rx_bytes
        assert len(buffered) == 1 or not any(map(writes_eeprom, buffered))
        assert len(buffered) == 1 or not send_response
        count = min(answers[turn % len(answers)], len(buffered))
        turn += 1
        seen += buffered[:count]
        del buffered[:count]
        hear(connection, streamer, b"ok\r\n" * count)
    assert seen == [line.data for line in lines]
    assert streamer.acknowledged == len(lines)
