"""The byte accounting of the connection, against a simple model of it."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from miurafab.gcode.job import SendLine
from miurafab.grbl.connection import (
    FEED_HOLD,
    SOFT_RESET,
    STATUS_QUERY,
    Connection,
    ProtocolMisuse,
)
from miurafab.grbl.events import Closed, Error, Event, Ok, Unknown
from miurafab.grbl.lines import dwell_seconds, is_system, writes_eeprom, writes_setting
from miurafab.grbl.states import State

BANNER = b"\r\nGrbl 1.1h ['$' for help]\r\n"
TALK = (
    b"ok\r\nerror:20\r\n<Run|MPos:1.000,2.000,0.000|FS:500,0|Ov:100,100,100>\r\n"
    b"[MSG:Caution: Unlocked]\r\n[OPT:V,15,128]\r\n$110=6000.000\r\n\xff\xfe\r\nALARM:1\r\n"
)


def greeted(rx_bytes: int = 128) -> Connection:
    connection = Connection(rx_bytes)
    connection.receive_data(BANNER)
    list(connection.events())
    return connection


def line(text: str, number: int = 1) -> SendLine:
    return SendLine(number, text.encode())


def hear(connection: Connection, data: bytes) -> list[Event]:
    connection.receive_data(data)
    return list(connection.events())


@given(st.lists(st.integers(0, len(TALK)), max_size=30))
@settings(max_examples=200)
def test_the_chunking_of_the_stream_does_not_matter(cuts: list[int]) -> None:
    whole, cut = greeted(), greeted()
    places = [0, *sorted(cuts), len(TALK)]
    events: list[Event] = []
    for begin, end in itertools.pairwise(places):
        if begin < end:
            events += hear(cut, TALK[begin:end])
    assert events == hear(whole, TALK)
    assert cut.state is whole.state is State.ALARMED


def test_answers_name_the_lines_in_order() -> None:
    connection = greeted()
    lines = [line("G1X1", 3), line("G1X2", 5), line("G99", 8)]
    for item in lines:
        connection.send_line(item)
    assert connection.in_flight_bytes == 5 + 5 + 4
    events = hear(connection, b"ok\r\nok\r\nerror:20\r\n")
    assert events == [Ok(lines[0]), Ok(lines[1]), Error(20, "20", lines[2])]
    assert (connection.in_flight_bytes, len(connection.in_flight)) == (0, 0)


def test_the_newline_counts_and_the_buffer_is_filled_to_the_byte() -> None:
    connection = greeted(128)
    for _ in range(12):
        connection.send_line(line("X12345678"))  # 10 bytes each with the newline
    assert connection.may_send(line("X123456"))
    assert not connection.may_send(line("X1234567"))
    with pytest.raises(ProtocolMisuse):
        connection.send_line(line("X1234567"))


def test_the_realtime_bytes_are_those_of_the_firmware() -> None:
    """``CMD_RESET``, ``CMD_STATUS_REPORT`` and ``CMD_FEED_HOLD`` of GRBL 1.1's ``config.h``."""
    assert (SOFT_RESET, STATUS_QUERY, FEED_HOLD) == (b"\x18", b"?", b"!")


def test_realtime_bytes_never_count() -> None:
    connection = greeted(16)
    connection.send_line(line("G1X12345678901"))
    for byte in (b"?", b"!", b"~", b"\x85", b"\x91"):
        assert connection.send_realtime(byte) == byte
    assert connection.in_flight_bytes == 15


def test_the_smaller_of_profile_and_report_bounds_the_buffer() -> None:
    small, large = greeted(128), greeted(128)
    hear(small, b"[OPT:V,15,64]\r\n")
    hear(large, b"[OPT:V,100,1024]\r\n")
    assert (small.rx_bytes, large.rx_bytes) == (64, 128)
    hear(small, b"[OPT:VL]\r\n")  # FluidNC tells no number
    assert small.rx_bytes == 64


def test_a_new_connection_has_the_buffer_of_a_stock_controller_and_nothing_in_it() -> None:
    """``RX_BUFFER_SIZE`` of GRBL 1.1's ``serial.h``."""
    connection = Connection()
    assert (connection.rx_bytes, connection.in_flight_bytes) == (128, 0)
    assert not connection.writing_eeprom


@pytest.mark.parametrize("resets", [False, True])
def test_a_question_stands_for_a_missing_banner(resets: bool) -> None:
    connection = greeted() if resets else Connection()
    if resets:
        connection.send_line(line("G1X1"))
        with pytest.raises(ProtocolMisuse, match=r"cannot send b'\$I\\n' in READY"):
            connection.probe()
        connection.send_realtime(SOFT_RESET)
    state = connection.state
    assert connection.awaits_proof
    assert connection.probe() == b"$I\n"
    assert hear(connection, b"[VER:1.1h.20190830:]\r\nok\r\n")[-1] == Ok(None)
    assert connection.state is state
    assert not connection.may_send(line("G1X1"))
    connection.prove()
    assert connection.state is State.READY
    assert not connection.awaits_proof
    assert connection.may_send(line("G1X1"))
    with pytest.raises(ProtocolMisuse):
        connection.probe()


@pytest.mark.parametrize(
    "text",
    [
        "$110=500",
        "$N0=G54",
        "$RST=*",
        "$I=mine",
        "G10L2P1X0",
        "$N00=G20",
        "$N+0.5=",
        "$32.0=1",
        "G28.1",
        "G30.1",
        "g10l20p1x0",
        "G90G28.1",
        "G010L2P0",
        "/$32=0",
        "$3/2=0",
        "G1/0L2P1X0",
        "G10.0L2P1X0",
        "G+10.L2P1X0",
        "G+28.1",
    ],
)
def test_a_line_that_writes_eeprom_travels_alone(text: str) -> None:
    assert writes_eeprom(text.encode())
    connection = greeted()
    connection.send_line(line("G1X1"))
    assert not connection.may_send(line(text))
    hear(connection, b"ok\r\n")
    connection.send_line(line(text))
    assert connection.writing_eeprom
    assert not connection.may_send(line("G1X2"))
    hear(connection, b"ok\r\n")
    assert connection.may_send(line("G1X2"))


@pytest.mark.parametrize("text", ["$32=0", "/$32=0", "$/N1=M5", "$rst=#", "$I=mine"])
def test_what_is_stored_is_known_behind_the_sign_of_block_delete(text: str) -> None:
    """GRBL 1.1 drops it wherever it stands, and stores the setting (gnea/grbl, ``protocol.c``)."""
    assert is_system(text.encode())
    assert writes_setting(text.encode())


@pytest.mark.parametrize("text", ["$J=G91X1F600", "/$j=G91X1F600", "G10L2P1X0", "X32=0"])
def test_a_motion_and_a_place_are_no_settings(text: str) -> None:
    assert not is_system(text.encode())
    assert not writes_setting(text.encode())


@pytest.mark.parametrize("text", ["G1X10", "G28", "G30", "$$", "$I", "$N", "G100", "G0X28.1", "$H"])
def test_other_lines_do_not_write_eeprom(text: str) -> None:
    assert not writes_eeprom(text.encode())


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("G4P1.5", 1.5),
        ("G04P2", 2.0),
        ("g4p+.5", 0.5),
        ("G1X4P3", 0),
        ("G4", 0),
        ("G40P1", 0),
        ("/G4P/2", 2.0),
        ("G4P-2", 0),  # refused, and no time comes off what is waited for the others
        ("G4.0P2", 2.0),
        ("G+04.P2", 2.0),
        ("G4.1P2", 0),
        ("G4P.", 0),
        ("G4P1.5.2", 1.5),
    ],
)
def test_dwell(text: str, seconds: float) -> None:
    assert dwell_seconds(text.encode()) == seconds


@pytest.mark.parametrize(
    ("said", "state"),
    [(BANNER, State.UNSYNCED), (b"ALARM:1\r\n", State.ALARMED), (b"", State.CLOSED)],
)
def test_what_clears_the_byte_accounting(said: bytes, state: State) -> None:
    connection = greeted()
    connection.send_line(line("G1X1"))
    hear(connection, said)
    assert connection.state is state
    assert (connection.in_flight_bytes, len(connection.in_flight)) == (0, 0)
    assert not connection.may_send(line("G1X2"))
    assert not connection.may_send(line("$X"))


def test_only_a_connection_that_waits_for_proof_asks_for_it() -> None:
    with pytest.raises(ProtocolMisuse, match=r"cannot send b'\$I\\n' in GREETED"):
        greeted().probe()
    assert Connection().probe() == b"$I\n"


def test_an_answer_without_a_line_breaks_the_byte_accounting() -> None:
    connection = greeted()
    assert hear(connection, b"ok\r\n") == [Ok(None)]
    assert connection.state is State.UNSYNCED


@pytest.mark.parametrize("unlocked", ["[MSG:Caution: Unlocked]", "<Idle|MPos:0,0,0|FS:0,0>"])
def test_after_a_reset_of_ours_leftovers_are_strays_until_the_banner(unlocked: str) -> None:
    connection = greeted()
    connection.send_line(line("G1X1"))
    connection.send_realtime(SOFT_RESET)
    assert hear(connection, b"ok\r\nALARM:3\r\n")[0] == Ok(None)
    assert connection.state is State.RESETTING
    hear(connection, BANNER + b"[MSG:'$H'|'$X' to unlock]\r\n")
    assert connection.state is State.LOCKED
    assert not connection.may_send(line("G1X1"))
    assert not connection.may_send(line("$J=G91X1F100"))
    connection.send_line(line("$X"))
    hear(connection, f"{unlocked}\r\nok\r\n".encode())
    assert connection.state is State.READY
    assert connection.may_send(line("G1X1"))


@pytest.mark.parametrize(
    ("text", "said"), [("$C", "[MSG:Disabled]"), ("$RST=*", "[MSG:Restoring defaults]")]
)
def test_leaving_check_mode_and_restoring_are_restarts_that_were_asked_for(
    text: str, said: str
) -> None:
    connection = greeted()
    connection.send_line(line(text))
    hear(connection, f"{said}\r\nok\r\n".encode())
    assert connection.state is State.RESETTING
    hear(connection, BANNER)
    assert connection.state is State.GREETED


def test_nothing_is_heard_or_sent_after_the_end() -> None:
    connection = greeted()
    assert hear(connection, b"") == [Closed()]
    assert hear(connection, b"ok\r\n") == []
    for byte in (STATUS_QUERY, SOFT_RESET):
        with pytest.raises(ProtocolMisuse, match="the wire is closed"):
            connection.send_realtime(byte)


def test_a_stream_without_line_ends_takes_no_memory() -> None:
    connection = greeted()
    events = hear(connection, b"\x55" * 5000)
    assert len(events) == 1
    assert isinstance(events[0], Unknown)
    assert hear(connection, b"\r\nok\r\n")[-1] == Ok(None)


class Accounting(RuleBasedStateMachine):
    """The byte accounting holds in any order of lines, replies, realtime bytes and resets."""

    def __init__(self) -> None:
        super().__init__()
        self.connection = greeted(64)
        self.sent: list[SendLine] = []
        self.number = 0

    @rule(text=st.sampled_from(["G1X1", "G0X10Y10", "$$", "$110=5", "G10L2P1X0", "X" * 40, "$X"]))
    def send(self, text: str) -> None:
        self.number += 1
        item = line(text, self.number)
        if self.connection.may_send(item):
            assert self.connection.send_line(item) == text.encode() + b"\n"
            self.sent.append(item)
        else:
            with pytest.raises(ProtocolMisuse):
                self.connection.send_line(item)

    @rule(answer=st.sampled_from([b"ok\r\n", b"error:9\r\n"]))
    def answer(self, answer: bytes) -> None:
        (event,) = hear(self.connection, answer)
        assert isinstance(event, Ok | Error)
        assert event.line == (self.sent.pop(0) if self.sent else None)

    @rule(
        talk=st.sampled_from(
            [
                BANNER,
                b"ALARM:2\r\n",
                b"[MSG:'$H'|'$X' to unlock]\r\n",
                b"[MSG:Sleeping]\r\n",
                b"[MSG:Caution: Unlocked]\r\n",
                b"<Idle|MPos:0,0,0|FS:0,0>\r\n",
                b"noise\r\n",
            ]
        )
    )
    def talk(self, talk: bytes) -> None:
        hear(self.connection, talk)
        self._forget_if_void()

    @rule(byte=st.sampled_from([b"?", b"!", b"~", SOFT_RESET]))
    def realtime(self, byte: bytes) -> None:
        self.connection.send_realtime(byte)
        self._forget_if_void()

    @precondition(lambda self: self.connection.state is State.RESETTING)
    @rule()
    def restart(self) -> None:
        hear(self.connection, BANNER)

    def _forget_if_void(self) -> None:
        if self.connection.state not in (State.READY, State.LOCKED):
            self.sent.clear()

    @invariant()
    def the_accounts_of_connection_and_model_agree(self) -> None:
        connection = self.connection
        assert list(connection.in_flight) == self.sent
        assert connection.in_flight_bytes == sum(len(item.data) + 1 for item in self.sent)
        assert connection.in_flight_bytes <= connection.rx_bytes

    @invariant()
    def eeprom_lines_are_alone(self) -> None:
        if any(writes_eeprom(item.data) for item in self.sent):
            assert len(self.sent) == 1


TestAccounting = Accounting.TestCase
TestAccounting.settings = settings(max_examples=100, stateful_step_count=40)
