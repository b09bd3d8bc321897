"""The faults of the simulated controller: their notation, and the effect of each."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from virtual_player import BANNER

from miurafab.errors import InputError
from miurafab.simulate.faults import KINDS, Fault, parse_fault, parse_faults
from miurafab.simulate.grbl.controller import VirtualGrbl

LASER = {30: 1000, 31: 0, 32: 1}


def device(*faults: str) -> VirtualGrbl:
    """A controller that has said its banner, with faults to come."""
    made = VirtualGrbl(LASER, baud=115_200, faults=parse_faults(faults))
    made.advance(0.1)
    assert made.take_output().decode() == BANNER
    return made


def said(made: VirtualGrbl, data: bytes, seconds: float = 0.1) -> bytes:
    made.receive(data)
    made.advance(seconds)
    return made.take_output()


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("drop@1200", Fault("drop", 1, at_byte=1200)),
        ("drop=all@3s", Fault("drop", math.inf, at_s=3.0)),
        ("corrupt-reply=3@250ms", Fault("corrupt-reply", 3, at_s=0.25)),
        ("disconnect@1", Fault("disconnect", math.inf, at_byte=1)),
        ("disconnect=.5s@1.5s", Fault("disconnect", 0.5, at_s=1.5)),
        ("alarm@0s", Fault("alarm", 1, at_s=0.0)),
        ("alarm=9@7", Fault("alarm", 9, at_byte=7)),
        (" reset@3s ", Fault("reset", 0, at_s=3.0)),
        ("slow=16ms@0s", Fault("slow", 0.016, at_s=0.0)),
    ],
)
def test_a_fault_is_read(text: str, fault: Fault) -> None:
    assert parse_fault(text) == fault


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("drop", "KIND@WHEN"),
        ("@3s", "KIND@WHEN"),
        ("drop@3s@4", "KIND@WHEN"),
        ("drop=@3", "KIND@WHEN"),
        ("Drop@3", "KIND@WHEN"),
        ("explode@3s", "no known kind.*drop, "),
        ("drop@0", "neither the number of a byte"),
        ("drop@-1", "neither the number of a byte"),
        ("drop@3m", "neither the number of a byte"),
        ("drop@1e3", "neither the number of a byte"),
        ("drop=0@3", "number of bytes"),
        ("drop=2s@3", "number of bytes"),
        ("noise=all@3", "number of bytes"),
        ("delay@3", "needs a time"),
        ("slow=3@3", "a time such as"),
        ("hang=0s@3", "a time such as"),
        ("alarm=10@3", "1 to 9"),
        ("reset=1@3", "takes none"),
    ],
)
def test_what_is_no_fault_is_named(text: str, named: str) -> None:
    with pytest.raises(InputError, match=named) as caught:
        parse_fault(text)
    assert f"'{text}'" in str(caught.value)
    assert str(caught.value).endswith(".")


def test_the_documentation_lists_the_kinds() -> None:
    page = (Path(__file__).parents[3] / "docs" / "machines.md").read_text(encoding="utf-8")
    table = page.partition("| KIND |")[2].partition("\n\n")[0]
    first_cells = [line.split("|")[1] for line in table.splitlines()[2:]]
    assert [name for cell in first_cells for name in re.findall(r"`(.+?)`", cell)] == list(KINDS)


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_can_be_written_and_strikes(name: str) -> None:
    value = {"bytes": "=2", "s": "=20ms", "code": "=3"}.get(KINDS[name].unit, "")
    histories = []
    for made in (device(f"{name}{value}@10"), device()):
        made.receive(b"G1X1F600S500M4\n")
        history = []
        for _ in range(1500):
            made.advance(1e-3)
            history.append((made.take_output(), made.connected, made.state))
        histories.append((history, made.beam_log))
    assert histories[0] != histories[1]


@pytest.mark.parametrize(("fault", "at", "count"), [("drop@3", 3, 1), ("drop=3@3", 3, 3)])
def test_exactly_the_named_bytes_are_lost(fault: str, at: int, count: int) -> None:
    whole = b"G90\nG0\n"
    expected = said(device(), whole[: at - 1] + whole[at - 1 + count :])
    assert said(device(fault), whole) == expected != said(device(), whole)


def test_one_bit_is_changed_and_the_same_one_each_time() -> None:
    answers = [said(device("corrupt@2"), b"G0\n") for _ in range(2)]
    assert answers[0] == answers[1] != b"ok\r\n"


def test_replies_are_lost_changed_and_held_up() -> None:
    assert said(device("drop-reply=2@1"), b"\n\n") == b"\r\nok\r\n"
    assert said(device("drop-reply=all@2"), b"\n\n") == b""
    garbled = said(device("corrupt-reply@1"), b"\n")
    assert len(garbled) == 4
    assert sum(bin(a ^ b).count("1") for a, b in zip(garbled, b"ok\r\n", strict=True)) == 1
    held = device("delay-reply=1s@1")
    assert said(held, b"\n", 0.99) == b""
    assert said(held, b"", 0.1) == b"ok\r\n"
    assert said(held, b"\n", 0.1) == b"ok\r\n"


def test_a_slow_host_is_late_both_ways() -> None:
    made = device("slow=100ms@0s")
    assert said(made, b"\n", 0.19) == b""
    assert said(made, b"", 0.03) == b"ok\r\n"
    assert said(made, b"\n", 0.19) == b""  # and stays so


def test_a_line_that_is_late_is_waited_for() -> None:
    made = device("delay-reply=1s@1")
    made.receive(b"\n")
    start = made.now
    made.advance_to_line(5.0)
    assert made.now - start == pytest.approx(1.0, abs=1e-3)
    assert made.take_output() == b"ok\r\n"


def test_the_cable_comes_out_and_goes_in_again() -> None:
    made = device("disconnect=1s@4")
    made.receive(b"G0\n?")
    assert not made.connected
    assert said(made, b"?\n", 0.9) == b""
    assert said(made, b"", 0.2) == b""
    assert made.connected
    assert said(made, b"?").startswith(b"<Idle|")
    gone = device("disconnect@1")
    gone.receive(b"?")
    gone.advance(1000)
    assert not gone.connected


def test_what_befalls_the_controller() -> None:
    cut = b"G1X50F600S500M4\n"
    assert b"ALARM:3\r\n" in said(device("reset@1s"), cut, 3.0)
    assert said(device("power@1s"), cut, 3.0).endswith(BANNER.encode())
    assert b"ALARM:1\r\n[MSG:Reset to continue]\r\n" in said(device("alarm@1s"), cut, 3.0)
    for fault in ("reset@1s", "power@1s", "alarm=2@1s"):
        struck = device(fault)
        said(struck, cut, 3.0)
        assert struck.beam_log[-1].t1 == pytest.approx(1.1, abs=2e-3)
        assert not any(segment.standing for segment in struck.beam_log)


def test_a_stall_is_deaf_and_a_hang_is_not() -> None:
    stalled, hung = device("stall=50ms@1"), device("hang=50ms@1")
    data = b"G0\n" * 20
    # The hardware holds two bytes and the one on its way: G, 0 and the last newline.
    assert said(stalled, data) == b"ok\r\n"
    assert stalled.lost_bytes == 60 - 3
    assert said(hung, data).count(b"ok") == 20
    forever = device("hang@1")
    assert said(forever, data, 60.0) == b""
    assert said(forever, b"\x18?", 60.0) == b""


@given(
    st.lists(st.sampled_from([b"G0X1\n", b"?", b"$G\n", b"!", b"~", b"\n"]), max_size=12),
    st.lists(
        st.builds(
            lambda kind, at, unit: f"{kind}@{at}{unit}",
            st.sampled_from(["drop=2", "corrupt", "noise-reply=3", "delay-reply=20ms", "reset"]),
            st.integers(1, 60),
            st.sampled_from(["", "ms"]),
        ),
        min_size=1,
        max_size=4,
    ),
    st.lists(st.floats(1e-4, 0.05), min_size=1, max_size=6),
)
def test_how_time_is_cut_into_calls_changes_nothing(
    pieces: list[bytes], faults: list[str], steps: list[float]
) -> None:
    outputs = []
    for cut in (steps, [sum(steps)]):
        made = device(*faults)
        out = b""
        for piece in pieces:
            made.receive(piece)
            for step in cut:
                made.advance(step)
                out += made.take_output()
        made.advance(2.0)
        outputs.append((out + made.take_output(), made.lost_bytes, made.position))
    assert outputs[0] == outputs[1]
