"""Pieces that lie loose, outlines that do not close: found where they are, and nowhere else."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from miurafab.errors import GcodeError
from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.job import Job
from miurafab.machine.loose_parts import burnt_on_loose_pieces, open_outlines
from miurafab.machine.planning import SendOptions, plan_job
from miurafab.machine.preflight import CHECKS
from miurafab.profiles import load_machine

MACHINE = load_machine("grbl-laser-400")
Points = Sequence[tuple[float, float]]


def polyline(points: Points) -> str:
    (x, y), *others = points
    moves = "".join(f"G1 X{x:.3f} Y{y:.3f} S500 F1000\n" for x, y in others)
    return f"G0 X{x:.3f} Y{y:.3f}\n{moves}"


def square(x: float, y: float, side: float) -> Points:
    return [(x, y), (x + side, y), (x + side, y + side), (x, y + side), (x, y)]


def job(*parts: tuple[str, Points], passes: int = 1) -> Job:
    """Strokes by operation; an operation of no name is not said."""
    text = "G21\nG90\nM4 S0\n"
    for operation, points in parts:
        said = f"(operation {operation})\n" if operation else ""
        text += said + polyline(points) * (passes if operation == "cut" else 1)
    return Job("pieces.nc", text + "M5\n")


def islands(made: Job) -> list[tuple[int, int]]:
    return [(f.line, f.outline_line) for f in burnt_on_loose_pieces(parse_program(made))]


def gaps(made: Job) -> list[float]:
    return [round(f.gap_mm, 3) for f in open_outlines(parse_program(made))]


BIG, HOLE, AWAY = square(10, 10, 50), square(20, 20, 5), square(100, 10, 50)
DASH = [(30.0, 30.0), (40.0, 30.0)]


def test_a_stroke_inside_an_outline_that_is_cut_already_is_found() -> None:
    assert islands(job(("cut", BIG), ("cut", HOLE))) == [(12, 6)]
    assert islands(job(("cut", BIG), ("engrave", DASH))) == [(12, 6)]
    assert islands(job(("cut", BIG), ("cut", AWAY), ("score", DASH), ("cut", HOLE))) == [(18, 6)]


def test_the_right_order_is_no_fault() -> None:
    assert islands(job(("engrave", DASH), ("cut", HOLE), ("cut", BIG))) == []
    assert islands(job(("cut", BIG), ("cut", AWAY))) == []
    assert islands(job(("cut", BIG), ("cut", [(5, 35), (9.9, 35)]))) == []


def test_what_only_marks_leaves_nothing_loose() -> None:
    assert islands(job(("engrave", BIG), ("engrave", HOLE))) == []
    assert islands(job(("score", BIG), ("cut", HOLE))) == []


def test_only_the_last_pass_cuts_through() -> None:
    assert islands(job(("cut", HOLE), ("cut", BIG), passes=3)) == []
    again = job(("cut", HOLE), ("cut", BIG), ("cut", HOLE), ("cut", BIG))
    assert islands(again) == []
    assert islands(job(("cut", BIG), ("cut", HOLE), passes=2)) != []


def test_an_outline_in_several_strokes_is_one() -> None:
    halves = [("cut", BIG[:3]), ("perforate", [(80, 80), (85, 80)]), ("cut", BIG[2:])]
    assert islands(job(*halves, ("cut", HOLE))) == [(17, 6)]
    assert gaps(job(*halves)) == []


def test_an_outline_held_by_bridges_is_neither() -> None:
    bridged = [
        ("cut", [(35.5, 10), (60, 10), (60, 34.5)]),
        ("cut", [(60, 35.5), (60, 60), (10, 60), (10, 10), (34.5, 10)]),
    ]
    assert islands(job(*bridged, ("cut", HOLE))) == []
    assert gaps(job(*bridged)) == []


@pytest.mark.parametrize("gap", [0.05, 0.5, 3.0])
def test_an_outline_that_does_not_close_is_found(gap: float) -> None:
    left_open = [*BIG[:-1], (10, 10 + gap)]
    assert gaps(job(("cut", left_open))) == [gap]
    assert gaps(job(("cut", left_open), ("cut", AWAY))) == [gap]
    assert gaps(job(("engrave", left_open))) == []
    assert gaps(job(("", left_open))) == []


def test_a_cut_that_is_no_outline_is_none() -> None:
    zigzag = [(10 + 5 * n, 10 + 3 * (n % 2)) for n in range(20)]
    assert gaps(job(("cut", zigzag))) == []
    assert gaps(job(("cut", DASH))) == []
    assert gaps(job(("cut", [*BIG[:-1], (10.0, 10.01)]))) == []  # closed to the last decimals


@given(
    st.lists(st.tuples(st.integers(0, 8), st.integers(0, 8), st.integers(1, 3)), max_size=12),
    st.randoms(use_true_random=False),
)
def test_any_nest_of_squares(placed: list[tuple[int, int, int]], random: object) -> None:
    """Square k holds square n if it is larger and its corners lie around."""
    squares = [
        square(10 + 10 * i + s / 3, 10 + 10 * j + s / 3, 9 - 2.0 * s)
        for i, j, s in dict.fromkeys(placed)
    ]
    random.shuffle(squares)
    found = islands(job(*(("cut", points) for points in squares)))
    loose = 0
    for index, outer in enumerate(squares):
        low, high = outer[0], outer[2]
        loose += any(
            low[0] < p[0][0] < high[0] and low[1] < p[0][1] < high[1] for p in squares[index + 1 :]
        )
    assert len(found) == loose


@pytest.mark.parametrize(
    ("check", "made"),
    [
        ("islands", job(("cut", BIG), ("cut", HOLE))),
        ("outlines", job(("cut", [*BIG[:-1], (10, 10.4)]))),
    ],
)
def test_each_is_refused_by_its_name_and_forced_by_it(check: str, made: Job) -> None:
    with pytest.raises(GcodeError, match=rf"pieces\.nc, line \d+ .*'force' {check} ") as caught:
        plan_job(made, MACHINE)
    assert caught.value.exit_code == 2
    assert len(plan_job(made, MACHINE, SendOptions(force=frozenset({check}))).forced) == 1
    with pytest.raises(GcodeError, match=f"'force' {check} "):
        plan_job(made, MACHINE, SendOptions(force=frozenset(CHECKS) - {check}))


def test_where_no_operation_is_said_nothing_is_refused() -> None:
    made = job(("", BIG), ("", HOLE))
    assert plan_job(made, MACHINE).forced == ()
    assert islands(made) != []
