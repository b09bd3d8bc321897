"""Programs read back: where the machine would go, what it would burn, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from miurafab.errors import GcodeError
from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.job import Job
from miurafab.gcode.program import DWELL, END, PAUSE, SYNC, Context, Program, strokes


def read(text: str, **options: object) -> Program:
    return parse_program(Job("job.nc", text), **options)


def ends(text: str) -> list[list[float]]:
    return read(text).end.round(6).tolist()


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("G0 X1 Y2\nZ3", [[1, 2, 0], [1, 2, 3]]),
        ("G20 G0 X1\nG21 X1", [[25.4, 0, 0], [1, 0, 0]]),
        ("G91 G0 X1\nX1\nG90 X1", [[1, 0, 0], [2, 0, 0], [1, 0, 0]]),
        ("G0 X5\nG92 X0\nX1\nG92.1\nX1", [[5, 0, 0], [6, 0, 0], [1, 0, 0]]),
        ("G10 L2 P1 X10\nG0 X1\nG53 X1", [[11, 0, 0], [1, 0, 0]]),
        ("G10 L2 P2 X10\nG0 X1\nG55 X1\nG54 X2", [[1, 0, 0], [11, 0, 0], [2, 0, 0]]),
        ("G0 X5\nG10 L20 P0 X2\nX3", [[5, 0, 0], [6, 0, 0]]),
        ("G0 X4\nG28.1\nX9\nG28 Y2\nG28", [[4, 0, 0], [9, 0, 0], [9, 2, 0], [9, 0, 0], [4, 0, 0]]),
        ("G0 X4\nG30.1\nX9\nG30", [[4, 0, 0], [9, 0, 0], [4, 0, 0]]),
        ("G43.1 Z2\nG0 Z1\nG49\nG0 Z1", [[0, 0, 3], [0, 0, 1]]),
        ("G43.1 Z2\nG0 Z5\nG10 L20 P1 Z1\nG0 Z3\nG49\nG0 Z3", [[0, 0, 7], [0, 0, 9], [0, 0, 7]]),
        ("g0x1(inline)y2;rest", [[1, 2, 0]]),
        ("/G0 X1", [[1, 0, 0]]),
    ],
)
def test_every_mode_that_moves_the_origin_is_followed(text: str, where: list[list[float]]) -> None:
    assert ends(text) == where


def test_moves_follow_one_another_without_a_gap() -> None:
    program = read("G0 X1\nG1 X2 F100\nG0 X2\nG2 X4 I1\nG0 X0")
    assert np.array_equal(program.start[1:], program.end[:-1])
    assert (program.lengths > 0).all()


def test_power_and_feed_are_what_reaches_the_beam() -> None:
    program = read("M4 S100\nG1 X1 F600\nG0 X2\nG1 X3\nS0 X4\nM5\nX5 S9\nM3\nX6")
    assert program.power.tolist() == [100, 0, 100, 0, 0, 9]
    assert program.beam_on.tolist() == [True, False, True, False, False, True]
    assert program.spindle.tolist() == [4, 4, 4, 4, 0, 3]
    assert program.feed_mm_min.tolist() == [600, 0, 600, 600, 600, 600]
    assert program.line.tolist() == [2, 3, 4, 5, 7, 9]


def test_without_laser_mode_a_rapid_keeps_its_power() -> None:
    text = "M3 S100\nG1 X1 F600\nG0 X2"
    assert read(text).power.tolist() == [100, 0]
    assert read(text, laser=False).power.tolist() == [100, 100]


def test_inverse_time_is_a_feed() -> None:
    assert read("G93 G1 X10 F2").feed_mm_min.tolist() == [20]
    arc = read("G93 G2 X4 I2 F3")  # the firmware's own: F times the chords, as mm/min
    assert len(arc) > 10
    assert set(arc.feed_mm_min.tolist()) == {3 * len(arc)}


def test_events_say_where_motion_stops() -> None:
    program = read("G0 X1\nM3 S5\nG4 P0.5\nG1 X2 F60\nM0\nM5\nM2")
    assert program.event_kind.tolist() == [SYNC, DWELL, PAUSE, SYNC, END]
    assert program.event_move.tolist() == [1, 1, 2, 2, 2]
    assert program.event_line.tolist() == [2, 3, 5, 6, 7]
    assert program.event_seconds.tolist() == [0, 0.5, 0, 0, 0]
    # M3 waits dark while the motion mode is G0; M5 and M2 put the beam out.
    assert program.event_power[[0, 3, 4]].tolist() == [0, 0, 0]
    assert read("G1 F60\nM3 S5").event_power.tolist() == [5]
    assert read("G1 F60\nM4 S5").event_power.tolist() == [0]


def test_a_long_program_without_regular_lines_loses_none() -> None:
    count = 5000  # more rows than are gathered before they are filed
    program = read("G91 G1 F60\n" + "X1 Z2 S3\n" * count)
    assert program.end[:, ::2].tolist() == [[n, 2 * n] for n in range(1, count + 1)]
    assert program.line.tolist() == program.line_number[1:].tolist() == [*range(2, count + 2)]


def test_lines_sent_are_counted_with_their_newline() -> None:
    program = read("(comment)\nG0 X1.5 ; c\n\nG1 Y-2 F600\n")
    assert program.line_number.tolist() == [2, 4]
    assert program.line_bytes.tolist() == [len("G0X1.5\n"), len("G1Y-2F600\n")]
    assert program.line_words.tolist() == [2, 3]
    assert program.line_points.tolist() == [1, 0]


def test_an_arc_is_as_long_as_it_should_be() -> None:
    program = read("G0 X10\nG3 X-10 I-10 F600\nG3 X10 R10")
    arc = program.lengths[1:].sum()
    assert arc == pytest.approx(2 * math.pi * 10, rel=1e-3)
    assert np.hypot(*program.end[:, :2].T) == pytest.approx(10, abs=1e-9)
    fine = read("G0 X10\nG3 X-10 I-10 F600", arc_tolerance_mm=1e-5)
    assert len(fine) > 5 * len(program)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("G0 X1\nG1 X2", "job.nc, line 2: the move needs a feed, and F is missing (error:22)."),
        ("G0 X1\n\nG99", "job.nc, line 3: G99 is not a word that the controller knows (error:20)."),
        ("$H", "job.nc, line 1: '$H' is a command to the controller"),
        ("G0 X1?", "job.nc, line 1: '?' is the status query"),
        (
            "M64 P1",
            "job.nc, line 1: M64 is not a word that the controller knows (error:20); grblHAL and "
            "FluidNC know M64; here, leave it out.",
        ),
    ],
)
def test_what_the_controller_would_refuse_is_named(text: str, sentence: str) -> None:
    with pytest.raises(GcodeError) as caught:
        read(text)
    assert str(caught.value).startswith(sentence)


def test_a_word_of_another_dialect_is_told_on_a_dialect_that_has_words_of_its_own() -> None:
    with pytest.raises(GcodeError, match=r"; FluidNC knows M7\.1; here, switch it off by M9\.$"):
        read("G0 X1\nM7.1\n", dialect="grblhal")
    with pytest.raises(GcodeError, match=r"on FluidNC M7\.1 switches a coolant off; the effect"):
        read("G0 X1\nM7.1\n", dialect="fluidnc")


def test_strokes_join_what_burns_and_know_where_they_belong() -> None:
    program = read(
        "(sheet A)\n(patch 1)\n(operation perforate)\nM4 S9\nG0 X1\nG1 X2 F60\nX3\nG0 X4\nG1 X5\n"
        "(operation cut)\nX6\n( patch  Two words )\nG0 X0\nG1 X1 (operation inline)\nM5\n"
    )
    burnt = strokes(program)
    assert [burnt.stroke(i)[:, 0].tolist() for i in range(len(burnt))] == [
        [1, 2, 3],
        [4, 5],
        [5, 6],
        [0, 1],
    ]
    assert [burnt.contexts[burnt.context[i]] for i in range(4)] == [
        Context("A", "1", "perforate"),
        Context("A", "1", "perforate"),
        Context("A", "1", "cut"),
        Context("A", "Two words", "cut"),
    ]
    assert [program.end[i, 0] for i in burnt.last_move] == [3, 5, 6, 1]


@pytest.mark.parametrize("text", ["", "(nothing)\n", "G0 X1\nM5\n"])
def test_a_program_that_burns_nothing_has_no_strokes(text: str) -> None:
    burnt = strokes(read(text))
    assert len(burnt) == 0
    assert burnt.points.shape == (0, 3)


point = st.tuples(st.integers(-9999, 9999), st.integers(-9999, 9999))


@given(st.lists(st.lists(point, min_size=2, max_size=5), max_size=8), st.booleans())
def test_polylines_written_are_the_strokes_read(
    lines: list[list[tuple[int, int]]], relative: bool
) -> None:
    text, at = ["M4 S500", "G91" if relative else "G90"], (0, 0)
    expected = []
    for line in lines:
        line = [p for i, p in enumerate(line) if i == 0 or p != line[i - 1]]
        for index, (x, y) in enumerate(line):
            dx, dy = (x - at[0], y - at[1]) if relative else (x, y)
            word = "G0" if index == 0 else "G1"
            text.append(f"{word} X{dx / 1000:.3f} Y{dy / 1000:.3f} F3000")
            at = (x, y)
        if len(line) > 1:
            if expected and expected[-1][-1] == line[0]:
                expected[-1] += line[1:]
            else:
                expected.append(list(line))
    burnt = strokes(read("\n".join(text)))
    found = [burnt.stroke(i)[:, :2] for i in range(len(burnt))]
    assert len(found) == len(expected)
    for a, b in zip(found, expected, strict=True):
        assert a == pytest.approx(np.array(b) / 1000, abs=1e-6)
