"""The simulated cable: bytes keep their order, and each fault touches the named bytes only."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from miurafab.simulate.cable import Cable, Channel
from miurafab.simulate.faults import Fault, parse_faults

SECOND = 1000


def cable(*faults: str) -> tuple[Cable, list[Fault]]:
    """A cable with a tick of 1 ms, and the faults that it hands on to the machine."""
    handed: list[Fault] = []
    return Cable(parse_faults(faults), lambda fault, now: handed.append(fault), SECOND), handed


@given(st.lists(st.tuples(st.integers(0, 9), st.binary(max_size=5)), max_size=10))
def test_an_unharmed_channel_gives_all_bytes_in_order(pieces: list[tuple[int, bytes]]) -> None:
    channel, now, late = Channel(1), 0, 3
    channel.late = late
    for pause, data in pieces:
        now += pause
        channel.carry(now, data)
    assert channel.take(now + late) == b"".join(data for _, data in pieces)
    assert channel.next_after(-1) is None


def test_a_byte_that_is_held_up_holds_up_those_behind_it() -> None:
    channel = Channel(1)
    channel.held_until = 50
    channel.carry(0, b"a")
    channel.held_until = 0
    channel.carry(1, b"b\n")
    assert channel.take(49) == b""
    assert channel.next_line() == 50
    assert channel.take(50) == b"ab\n"


@pytest.mark.parametrize(
    ("fault", "arrives"), [("drop@3", b"abd"), ("delay=1s@3", b"ab"), ("disconnect@3", b"")]
)
def test_a_fault_strikes_just_before_its_byte(fault: str, arrives: bytes) -> None:
    wire, _ = cable(fault)
    wire.send(0, b"abcd")
    assert wire.happen(0) == arrives


def test_a_corrupt_byte_has_one_bit_changed() -> None:
    wire, _ = cable("corrupt@3")
    wire.send(0, b"abcd")
    arrived = wire.happen(0)
    assert (arrived[:2], arrived[3:]) == (b"ab", b"d")
    assert (arrived[2] ^ ord("c")).bit_count() == 1


def test_the_cable_goes_in_again_and_the_clock_begins_with_the_first_byte() -> None:
    wire, _ = cable("disconnect=2s@1s")
    assert wire.next_due(0) is None
    wire.send(500, b"a")
    assert wire.happen(500) == b"a"
    assert wire.next_due(500) == 1500
    wire.happen(1500)
    assert not wire.connected
    wire.send(2000, b"lost")
    assert wire.next_due(2000) == 3500
    assert wire.happen(3500) == b""
    assert wire.connected


def test_a_fault_of_the_machine_is_handed_on() -> None:
    wire, handed = cable("hang@2", "reset@1s")
    wire.send(0, b"ab")
    wire.happen(1000)
    assert handed == [Fault("hang", math.inf, at_byte=2), Fault("reset", 0.0, at_s=1.0)]
