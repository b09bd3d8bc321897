"""The simulated cutter: its buffer, its flow control and its tool."""

from __future__ import annotations

import pytest

from miurafab.plotter.stream import DROP_ALL, XOFF, XON
from miurafab.simulate.plotter import DrawnSegment, VirtualPlotter


def test_each_line_is_drawn_at_its_speed_and_with_its_force() -> None:
    """``VS`` is in cm/s with the pen down; a plotter unit is 0.025 mm."""
    device = VirtualPlotter()
    device.receive(b"IN;SP1;VS5;FS80;PU400,0;PD400,400;PU;")
    device.advance(10.0)
    (drawn,) = device.beam_log
    assert isinstance(drawn, DrawnSegment)
    assert (drawn.x0, drawn.y0, drawn.x1, drawn.y1) == (10.0, 0.0, 10.0, 10.0)
    assert drawn.t1 - drawn.t0 == pytest.approx(10.0 / 50.0)
    assert drawn.force == 80.0
    assert (device.pen, device.pen_down) == (1, False)


def test_relative_coordinates_add_up() -> None:
    device = VirtualPlotter()
    device.receive(b"PA;PU40,40;PR;PD40,0,0,40;PA;PU0,0;")
    device.advance(10.0)
    ends = [(segment.x1, segment.y1) for segment in device.beam_log]
    assert ends == [(2.0, 1.0), (2.0, 2.0)]
    assert device.position == (0.0, 0.0)


def test_it_says_xoff_at_four_fifths_and_xon_at_two_fifths_of_its_buffer() -> None:
    device = VirtualPlotter(rx_bytes=100)
    device.freeze(1.0)
    device.receive(b"PU;" * 26 + b"PU")
    device.advance(0.5)
    assert device.take_output() == bytes([XOFF])
    device.advance(10.0)
    assert device.take_output() == bytes([XON])
    assert device.lost_bytes == 0


def test_a_sender_that_ignores_xoff_loses_bytes() -> None:
    device = VirtualPlotter(rx_bytes=100)
    device.freeze(1.0)
    device.receive(b"PU;" * 40)
    device.advance(0.5)
    assert device.lost_bytes == 20


@pytest.mark.parametrize("knows_abort", [True, False])
def test_an_abort_drops_the_buffer_if_it_is_known(knows_abort: bool) -> None:
    device = VirtualPlotter()
    device.knows_abort = knows_abort
    device.receive(b"VS1;PD400,0;PD400,400;")
    device.advance(0.01)
    device.receive(DROP_ALL + b"PU;")
    device.advance(60.0)
    assert device.position == ((10.0, 0.0) if knows_abort else (10.0, 10.0))
    assert not device.pen_down
