"""The estimate and the virtual controller against jobs timed on the firmware's own binary."""

from __future__ import annotations

import pytest
from firmware_jobs import TIMED
from virtual_player import ready, stream

from miurafab.gcode.job import Job, prepare
from miurafab.gcode.program import parse_program
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
    assert stream(device, [line.data for line in prepare(Job(name, text))]) == pytest.approx(
        seconds, rel=0.01
    )
    burnt = sum(segment.t1 - segment.t0 for segment in device.beam_log)
    assert burnt == pytest.approx(beam_on, rel=0.01)
