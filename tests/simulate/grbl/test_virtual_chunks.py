"""No input makes the simulated controller raise, and the chunking of its input does not matter."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from miurafab.simulate.grbl.controller import VirtualGrbl

LINES = [
    b"G0X1", b"G1X5F500", b"G1X-3Y2F300S500", b"G2X1Y1R1F500", b"G2X5I2", b"G91", b"G90", b"G20",
    b"G93", b"G94", b"G28", b"G30.1", b"G55", b"G43.1Z1", b"G92X1", b"G10L2P1X3", b"G4P0.2", b"M0",
    b"M2", b"M3S500", b"M4", b"M5", b"M8", b"M9", b"G38.2Z-1F100", b"G38.3X2F100", b"G0Z1Y3", b"$$",
    b"$#", b"$G", b"$I", b"$I=x", b"$N", b"$N0=G0X1", b"$N1=", b"$N3=G0", b"$H", b"$X", b"$C",
    b"$SLP", b"$J=G91X5F300", b"$RST=$", b"$RST=*", b"$1=255", b"$1=25", b"$5=1", b"$6=1", b"$10=0",
    b"$10=3", b"$11=0", b"$12=0", b"$13=1", b"$20=1", b"$21=1", b"$22=1", b"$24=0", b"$27=0",
    b"$30=0", b"$32=1", b"$100=0", b"$100=80", b"$110=0", b"$110=6000", b"$120=0", b"$120=100",
    b"$130=0", b"(abc", b";x", b"x" * 100, b"",
]  # fmt: skip
realtime = st.sampled_from([bytes([b]) for b in b"?!~\x18\x84\x85\x90\x91\x92\x96\x9a\x9e\xa0"])
pieces = st.sampled_from(LINES).map(lambda line: line + b"\n") | realtime | st.binary(max_size=30)
waits = st.sampled_from([0, 0, 1, 50, 500])
scripts = st.lists(st.tuples(pieces, waits), max_size=20)
bauds = st.sampled_from([None, 9600, 115_200])
TICK = 1 / 1024
"""A wait of whole ticks adds up exactly, however it is cut."""

ACTS: list[Callable[[VirtualGrbl], object]] = [
    lambda d: d.press_limit("X"),
    lambda d: d.press_limit("X", False),
    lambda d: d.press_button("hold"),
    lambda d: d.press_button("hold", False),
    lambda d: d.press_button("start"),
    lambda d: d.press_button("reset"),
    lambda d: d.press_button("reset", False),
    lambda d: d.touch_probe(),
    lambda d: d.touch_probe(False),
    lambda d: d.power_cycle(),
    lambda d: d.freeze(),
]


BURNING = [(b"M3S500\n", 50), (b"G1X1F3000\n", 500), (b"S300\nX2\n", 500), (b"M5\n", 50)]
"""Random scripts hardly ever burn twice."""


def test_the_script_that_burns_burns_twice() -> None:
    device = VirtualGrbl()
    for data, ticks in BURNING:
        device.receive(data)
        device.advance(ticks * TICK)
    assert len({segment.power for segment in device.beam_log}) == 2


@given(scripts, bauds, st.lists(st.sampled_from(ACTS), max_size=20), st.booleans())
@example(BURNING, None, [], True)
def test_it_never_raises_and_time_goes_on(
    script: list[tuple[bytes, int]],
    baud: int | None,
    acts: list[Callable[[VirtualGrbl], object]],
    switches: bool,
) -> None:
    device = VirtualGrbl(baud=baud, homing_switches=switches)
    for index, (data, ticks) in enumerate(script):
        device.receive(data)
        device.advance(ticks * TICK)
        if index < len(acts):
            acts[index](device)
        assert (device.next_event_in() or 0.0) >= 0.0
        device.take_output().decode("ascii")
        log = device.beam_log
        assert all(a.t1 <= b.t0 for a, b in pairwise(log))
        assert device.beam_on or not log or log[-1].t1 <= device.now
    assert device.now == pytest.approx(sum(ticks for _, ticks in script) * TICK)


@given(scripts, bauds, st.randoms(use_true_random=False))
def test_chunks_make_no_difference(
    script: list[tuple[bytes, int]], baud: int | None, random: object
) -> None:
    whole, cut = VirtualGrbl(baud=baud), VirtualGrbl(baud=baud)
    for data, ticks in script:
        whole.receive(data)
        whole.advance(ticks * TICK)
        while data:
            size = random.randint(1, len(data))
            cut.receive(data[:size])
            data = data[size:]
        while ticks:
            step = random.randint(1, ticks)
            cut.advance(step * TICK)
            ticks -= step
        assert cut.take_output() == whole.take_output()
    assert cut.lost_bytes == whole.lost_bytes
    assert cut.state == whole.state
    assert repr(cut.position) == repr(whole.position)


def test_going_from_event_to_event_is_the_same_as_waiting() -> None:
    whole, stepped = VirtualGrbl(baud=115_200), VirtualGrbl(baud=115_200)
    for device in (whole, stepped):
        device.receive(b"G91\nG1X2F500\nG1Y1\n$G\n")
    whole.advance(3.0)
    while (pause := stepped.next_event_in()) is not None:
        stepped.advance(pause)
    assert stepped.now < 3.0
    assert stepped.take_output() == whole.take_output()
    assert stepped.position == whole.position == (2, 1, 0)
