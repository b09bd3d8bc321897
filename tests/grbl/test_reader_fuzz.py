"""Random programs, read and run: the reader and the beam log agree on what is burnt."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from miurafab.errors import GcodeError
from miurafab.gcode import interpreter as reader
from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.job import Job
from miurafab.gcode.program import Program
from miurafab.profiles import load_machine
from miurafab.simulate.beam import BeamSegment
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings

LASER = virtual_settings(load_machine("grbl-laser-400")) | {12: 0.01}
STEP_MM = 1 / 80

places = st.integers(0, 240).map(lambda n: f"{n / 8:g}")
offsets = st.integers(-40, 40).map(lambda n: f"{n / 8:g}")


def arc(word: str, x: str, y: str, radius: float, close: bool) -> str:
    """An arc by its radius, large enough for any end on the field; or a full circle."""
    if close:
        return f"G91{word}I{radius / 20:g}J0X0\nG90G1"
    return f"{word}X{x}Y{y}R{radius:g}\nG1"


lines = st.one_of(
    st.builds("G1X{}Y{}".format, places, places),
    st.builds("X{}Y{}S{}".format, places, places, st.integers(500, 1000)),
    st.builds("G0X{}Y{}".format, places, places),
    st.builds("G91G1X{}Y{}\nG90".format, offsets, offsets),
    st.builds(
        arc,
        st.sampled_from(["G2", "G3"]),
        places,
        places,
        st.sampled_from([30.0, 45.0, 80.0]),
        st.booleans(),
    ),
    st.builds("G92X{}Y{}".format, offsets, offsets),
    st.builds("G20\nG1X{}\nG21".format, st.integers(0, 8).map(lambda n: f"{n / 8:g}")),
    st.sampled_from(["M3", "M4", "M5", "G92.1", "G4P0.02", "F3000", "F1200", "S0", "S900", "M8"]),
)
faults = st.sampled_from(
    ["X1X2", "G2X5Y5", "G1G0X1", "G5", "Q1", "X", "G1X1F-5", "G2X1Y1I9J9", "G43Z1", "M3M4", "G28.2"]
)


def run(text: str) -> tuple[list[BeamSegment], int | None]:
    """What the controller burns, and the code of the first line that it refuses."""
    device = VirtualGrbl(LASER)
    device.advance(0.5)
    device.take_output()
    for line in Job("fuzz.nc", text).send_lines():
        device.receive(line.data + b"\n")
        said = b""
        while b"\n" not in said:
            device.advance_to_line(10.0)
            said += device.take_output()
        refused = re.match(rb"error:(\d+)", said)
        if refused is not None:
            return list(device.beam_log), int(refused[1])
        assert said == b"ok\r\n"
    while device.state != "Idle":
        device.advance(0.2)
    return list(device.beam_log), None


def segments(program: Program) -> NDArray[np.float64]:
    """(n, 4) x0 y0 x1 y1 of the moves that burn."""
    burns = program.beam_on
    return np.hstack([program.start[burns, :2], program.end[burns, :2]])


def far(points: NDArray[np.float64], lines: NDArray[np.float64]) -> float:
    """How far the farthest of ``points`` is from the nearest of ``lines``."""
    a, way = lines[:, :2], lines[:, 2:] - lines[:, :2]
    square = np.maximum((way**2).sum(axis=1), 1e-12)
    gap = points[:, None, :] - a
    part = np.clip((gap * way).sum(axis=2) / square, 0.0, 1.0)
    distance = np.linalg.norm(gap - part[:, :, None] * way, axis=2)
    return float(distance.min(axis=1).max())


@settings(derandomize=True, deadline=None, max_examples=120)
@given(st.lists(lines, min_size=1, max_size=14), st.lists(faults, max_size=3), st.integers(0, 14))
@example(["M3S900", "G1X5F600", "G91G2I2J0X0\nG90"], [], 0)
def test_what_is_read_is_what_is_burnt(body: list[str], fault: list[str], at: int) -> None:
    body = [*body[:at], *fault[2:], *body[at:]]  # one in four has a fault
    text = "\n".join(["G21G90", "M3S600", "G1X1Y1F3000", *body, "M5", ""])
    log, refused = run(text)
    if refused is not None:
        with pytest.raises(GcodeError, match=rf"\(error:{refused}\)"):
            parse_program(Job("fuzz.nc", text), arc_tolerance_mm=0.01)
        return
    read = parse_program(Job("fuzz.nc", text), arc_tolerance_mm=0.01)
    moving = np.array([[s.x0, s.y0, s.x1, s.y1] for s in log if not s.standing]).reshape(-1, 4)
    told = segments(read)
    told = told[(told[:, :2] != told[:, 2:]).any(axis=1)]
    if not len(told) or not len(moving):
        assert np.linalg.norm(told[:, 2:] - told[:, :2], axis=1).sum() < 0.1
        assert len(moving) == 0 or far(moving[:, 2:], np.array([[0, 0, 1, 1.0]])) < 0.1
        return
    assert far(np.vstack([moving[:, :2], moving[:, 2:]]), told) < 2 * STEP_MM
    # With M4 the power follows the speed, and ends short of a stop.
    follows = read.spindle[read.beam_on] == 4
    ends = np.vstack([told[:, :2], (told[:, :2] + told[:, 2:]) / 2, told[:, 2:]])
    assert far(ends, moving) < (0.4 if follows.any() else 2 * STEP_MM)
    length = np.linalg.norm(told[:, 2:] - told[:, :2], axis=1).sum()
    burnt = np.linalg.norm(moving[:, 2:] - moving[:, :2], axis=1).sum()
    allowed = (2 * STEP_MM + 0.5 * bool(follows.any())) * (len(told) + 1)
    assert abs(length - burnt) < allowed


def test_a_long_run_of_regular_lines_is_burnt_as_read() -> None:
    count = 3 * reader.LEAST_RUN
    text = "M3S600\nG1X1Y1F6000\n" + "".join(
        f"G0X{5 + n % 20}Y{5 + n // 20}\nG1X{5.5 + n % 20}S{500 + n}\n" for n in range(count)
    )
    log, refused = run(text + "M5\n")
    assert refused is None
    read = segments(parse_program(Job("long.nc", text)))
    moving = np.array([[s.x0, s.y0, s.x1, s.y1] for s in log if not s.standing])
    assert far(np.vstack([moving[:, :2], moving[:, 2:]]), read) < 2 * STEP_MM
    assert far(np.vstack([read[:, :2], read[:, 2:]]), moving) < 2 * STEP_MM
