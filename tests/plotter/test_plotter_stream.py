"""HPGL under flow control: nothing is lost, no instruction is cut short, and the tool ends up."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from miurafab.errors import GcodeError
from miurafab.gcode.job import Job
from miurafab.plotter.stream import DROP_ALL, XOFF, XON, PlotterStream, send_instructions
from miurafab.simulate.plotter import VirtualPlotter

TEXT = "IN;PA;\nPU;SP4;VS5;FS120;\nPU400,400;PD800,400,800,800;\nPU;PU0,0;SP0;\n"


def all_of(stream: PlotterStream, piece: int) -> bytes:
    sent = b""
    while not stream.finished:
        data = stream.next_bytes(piece)
        stream.took(len(data))
        sent += data
    return sent


@given(st.integers(1, 80))
def test_pieces_of_any_size_make_the_whole_file(piece: int) -> None:
    stream = PlotterStream(Job("a.plt", TEXT))
    sent = all_of(stream, piece)
    assert sent == TEXT.replace("\n", "").encode() + b"PU;SP0;\n"
    assert (stream.lines, stream.line) == (4, 4)


def test_what_is_no_hpgl_is_refused_by_name() -> None:
    with pytest.raises(GcodeError, match=r"a.plt, line 2: 'G1 X5' is not HPGL"):
        list(send_instructions(Job("a.plt", "IN;\nG1 X5\n")))


def test_xoff_stops_and_xon_goes_on() -> None:
    stream = PlotterStream(Job("a.plt", TEXT))
    assert stream.next_bytes(9) == b"IN;"
    stream.hear(bytes([XOFF]))
    assert stream.next_bytes(9) == b""
    stream.hear(b"x" + bytes([XON]))
    assert stream.next_bytes(9) == b"IN;"


@given(st.integers(0, 60), st.integers(1, 20), st.booleans())
def test_an_abort_completes_the_instruction_begun_and_lifts(
    steps: int, piece: int, knows: bool
) -> None:
    """Wherever it ends, the tool goes nowhere that the file does not send it, and ends up."""
    stream = PlotterStream(Job("a.plt", TEXT))
    device = VirtualPlotter()
    device.knows_abort = knows
    for _ in range(steps):
        data = stream.next_bytes(piece)
        stream.took(len(data))
        device.receive(data)
        device.advance(0.003)
    device.receive(stream.abort())
    device.advance(60.0)
    assert not device.pen_down
    corners = {(0.0, 0.0), (10.0, 10.0), (20.0, 10.0), (20.0, 20.0)}
    assert device.position in corners
    assert {(line.x1, line.y1) for line in device.beam_log} <= corners
    assert stream.abort() == b"PU;" + DROP_ALL + b"PU;SP0;\n"
    assert stream.finished
    assert stream.next_bytes(piece) == b""
