"""The estimate and the simulated controller against jobs timed on the firmware's own binary."""

from __future__ import annotations

import re

import pytest
from firmware_jobs import TIMED
from virtual_player import ready, stream

from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.job import Job
from miurafab.motion.estimate import estimate
from miurafab.motion.parameters import MotionParameters


@pytest.mark.parametrize("name", TIMED)
def test_the_estimate_is_within_one_percent(name: str) -> None:
    text, settings, seconds, beam_on = TIMED[name]
    parameters = MotionParameters.from_settings(ready(settings).settings)
    foretold = estimate(parse_program(Job(name, text)), parameters)
    assert foretold.seconds == pytest.approx(seconds, rel=0.01)
    assert foretold.beam_on_seconds == pytest.approx(beam_on, rel=0.01)


@pytest.mark.parametrize(
    "name", ["dashes of 0.2 mm", "slanted dashes", "a fine circle", "grey scale"]
)
def test_the_virtual_controller_takes_as_long(name: str) -> None:
    text, settings, seconds, beam_on = TIMED[name]
    device = ready(settings)
    assert stream(device, [line.data for line in Job(name, text).send_lines()]) == pytest.approx(
        seconds, rel=0.01
    )
    burnt = sum(segment.t1 - segment.t0 for segment in device.beam_log)
    assert burnt == pytest.approx(beam_on, rel=0.01)


# The position and the speed that the firmware told after a hold of 1.05 s, and while it went on.
HELD = {
    0.09: [(0.168, 0), (0.592, 142), (0.828, 82), (0.964, 16), (1.0, 0)],
    0.11: [(0.224, 0), (0.640, 136), (0.860, 76), (0.976, 0), (1.0, 0)],
    0.13: [(0.288, 0), (0.708, 116), (0.900, 56), (0.992, 0), (1.0, 0)],
    0.15: [(0.360, 0), (0.508, 132), (0.728, 111), (0.912, 51), (0.992, 0)],
    0.20: [(0.576, 0), (0.932, 43), (0.996, 0), (1.0, 0), (1.0, 0)],
    0.25: [(0.840, 0), (0.984, 0), (1.0, 0), (1.0, 0), (1.0, 0)],
}


@pytest.mark.parametrize("held_after", HELD)
def test_it_stops_and_goes_on_as_the_firmware_did(held_after: float) -> None:
    device = ready()
    for line in (b"G91\n", b"G1 X1 F300\n"):
        device.receive(line)
        device.advance_to_line(1.0)
        assert device.take_output() == b"ok\r\n"
    waits = [(held_after, b"!"), (1.05, b"?"), (0.03, b"~"), (0.3, b"?"), *[(0.1, b"?")] * 3]
    told = b""
    for seconds, byte in waits:
        device.advance(seconds)
        told += device.take_output()
        device.receive(byte)
    device.advance(0.05)
    told += device.take_output()
    reports = re.findall(r"MPos:([\d.]+),.*?FS:(\d+)", told.decode())
    for found, (at, speed) in zip(reports, HELD[held_after], strict=True):
        assert float(found[0]) == pytest.approx(at, abs=0.0085)  # two motor steps
        assert float(found[1]) == pytest.approx(speed, abs=6.5)  # one segment of 10 ms
