"""A program turned and shifted: every burnt point is the moved point, and nothing else changes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from miurafab.errors import GcodeError
from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.job import Job
from miurafab.gcode.rigid_motion import RigidMotion, moved

SQUARE = """G21 G90
M4 S0 (armed)
G0 X10 Y10
G1 X30 S500 F1200 ; first side
Y30
X10
Y10
M5
G0 X0 Y0
"""
ARCS = """(sheet arcs)
G90 G21
M4 S300
G0 X20 Y10.00049
G2 X30 Y20.00049 I10 J0 F1000
G3 X40 R5
G2 X50 Y30.00049 R-10
G91 G1 X2 S400
X1.5Y.5
G3 X4 Y0 I2 J0
G1 X2 S0
G90 G0 Z-1
G1 X60 Y40 S100
M5
G0X0Y0
"""


def quarter(dx: float = 0.0, dy: float = 0.0) -> RigidMotion:
    """A turn by 90 degrees about the origin, then a shift."""
    return RigidMotion(0.0, 1.0, dx, dy)


def turn(angle: float, dx: float, dy: float) -> RigidMotion:
    return RigidMotion(math.cos(angle), math.sin(angle), dx, dy)


def after(text: str, motion: RigidMotion, dialect: str = "grbl-1.1") -> str:
    job = Job("a.nc", text)
    program = parse_program(job, inline=dialect == "marlin", dialect=dialect)
    return moved(job, program, motion, dialect).text


@pytest.mark.parametrize("text", [SQUARE, ARCS, SQUARE.replace("\n", "\r\n")])
def test_no_motion_changes_no_byte(text):
    places = ((11.3, 7.0), (211.7, 93.1))
    assert after(text, RigidMotion.between(places, places)) == text


def test_a_square_turned_by_a_quarter_is_burnt_beside_itself():
    text = after(SQUARE, quarter(50, 5))
    program = parse_program(Job("a.nc", text))
    burnt = program.end[program.beam_on, :2]
    assert burnt.min(axis=0).tolist() == [20, 15]
    assert burnt.max(axis=0).tolist() == [40, 35]
    assert "(armed)" in text
    assert "; first side" in text
    assert text.endswith("M5\nG0 X0 Y0\n")  # the way back is the machine's
    assert text.count("\n") == SQUARE.count("\n")


def test_random_motions_move_every_burnt_point_and_leave_arcs_arcs():
    rng = np.random.default_rng(13)
    before = parse_program(Job("a.nc", ARCS))
    for _ in range(20):
        motion = turn(rng.uniform(-math.pi, math.pi), *rng.uniform(-50, 300, 2))
        text = after(ARCS, motion)
        program = parse_program(Job("a.nc", text))
        on = before.beam_on
        assert (program.beam_on == on).all()
        for was, now in ((before.end, program.end), (before.start, program.start)):
            assert np.abs(now[on, :2] - motion.of(was[on, :2])).max() < 2e-4
        assert np.allclose(program.lengths[on], before.lengths[on], atol=3e-4)
        assert (program.power == before.power).all()
        assert (program.feed_mm_min == before.feed_mm_min).all()
        assert (program.end[:, 2] == before.end[:, 2]).all()
        assert [text.count(word) for word in ("G2", "G3")] == [3, 2]  # G2 stands in G21 too


def test_relative_steps_do_not_add_up_their_rounding():
    text = "G90 G21\nM4 S0\nG0 X5 Y5\nG91\n" + "G1 X.1 S9 F900\nX.1 S0\n" * 500 + "G90\nM5\n"
    motion = turn(1.0, 3, 4)
    before = parse_program(Job("a.nc", text))
    program = parse_program(Job("a.nc", after(text, motion)))
    on = before.beam_on
    assert np.abs(program.end[on, :2] - motion.of(before.end[on, :2])).max() < 1e-4


def test_a_job_that_burns_nothing_stays_as_it_is():
    text = "G90 G21\nG0 X10 Y10\nM5\n"
    assert after(text, quarter(1, 2)) == text


def test_marlin_says_its_words_again():
    text = "G21\nM4 I S0\nG0 X10 Y10 S0 F3000\nG1 X20 S100 F1000\nM5 I\nG0 X0 Y0 S0\n"
    assert after(text, quarter(), dialect="marlin").splitlines()[2:4] == [
        "G0 X-10 Y10 S0 F3000",
        "G1 X-10 Y20 S100 F1000",
    ]


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("G20 G1 X1 S9 F9", "moves in inches"),
        ("G92 X0", "moves the origin"),
        ("G53 G0 X0", "does not count from it"),
        ("G28", "does not count from it"),
        ("G55", "moves the origin"),
        ("G38.2 X90 F9", "measures"),
        ("G18 G2 X30 Z0 I10 F9", "outside the XY plane"),
    ],
)
def test_what_has_no_place_on_the_sheet_is_refused(line, why):
    text = f"G90 G21\nM4 S9\nG0 X10 Y10\n{line}\nG21 G17 G1 X99 Y99 F9\n"
    with pytest.raises(GcodeError, match=rf"a\.nc, line 4 .*{why}.*'align'"):
        after(text, quarter())


def test_a_stroke_from_where_the_head_stands_is_refused():
    with pytest.raises(GcodeError, match="write a G0 to its beginning"):
        after("G90 G21\nM4 S9\nG1 X10 F900\n", quarter(1, 1))
    assert after("M4 S9\nG1 X10 F900\n", turn(0, 0, 0)) == "M4 S9\nG1 X10 F900\n"


def test_the_frame_of_a_file_and_the_words_of_a_dialect_stay_as_they_are() -> None:
    text = "%\nO1001\nM4 S0\nM62 P1\nG0 X10 Y10\nG1 X20 S100 F1000\n"
    assert after(text, quarter(), "grblhal").splitlines() == [
        *text.splitlines()[:4],
        "G0 X-10 Y10",
        "G1 X-10 Y20 S100 F1000",
    ]
