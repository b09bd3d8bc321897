"""The look-ahead: cornering speeds in closed form, and a plan that can always be kept."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from miurafab.motion.parameters import MotionParameters
from miurafab.motion.planner import Planner, along, to_steps

ACCELERATION = 1000.0
DEVIATION = 0.01
SINGLE = 1e-6


def machine(**changes: object) -> MotionParameters:
    values: dict[str, object] = {
        "steps_per_mm": (80.0, 80.0, 80.0),
        "max_rate_mm_min": (12000.0, 12000.0, 12000.0),
        "acceleration": (ACCELERATION, ACCELERATION, ACCELERATION),
        "junction_deviation": DEVIATION,
        "arc_tolerance": 0.002,
        "idle_lock": 0.025,
        "laser": True,
        "s_max": 1000.0,
        "s_min": 0.0,
    }
    return MotionParameters(**(values | changes))


def test_a_right_angle_is_cornered_at_the_speed_of_its_circle() -> None:
    planner = Planner(machine())
    planner.append((10, 0, 0), 6000)
    corner = planner.append((10, 10, 0), 6000)
    assert corner is not None
    # The change of direction is diagonal, and each axis may give its acceleration.
    half = math.sin(math.radians(45))
    expected = 3600 * ACCELERATION * math.sqrt(2) * DEVIATION * half / (1 - half)
    assert corner.junction_sqr == pytest.approx(expected, rel=3e-6)
    assert corner.entry_sqr == pytest.approx(expected, rel=3e-6)


def test_straight_on_is_not_slowed_and_back_is_a_stop() -> None:
    planner = Planner(machine())
    planner.append((10, 0, 0), 6000)
    on = planner.append((30, 0, 0), 6000)
    back = planner.append((0, 0, 0), 6000)
    assert on is not None
    assert back is not None
    assert on.limit_sqr == 6000**2
    assert back.entry_sqr == 0


def test_the_slowest_axis_rules_a_slanted_move() -> None:
    planner = Planner(machine(acceleration=(1000.0, 250.0, 1000.0)))
    move = planner.append((3, 4, 0), 6000)
    assert move is not None
    assert move.acceleration == pytest.approx(3600 * 250 / 0.8)
    assert along((1000, 250, 1), (0.6, 0.8, 0)) == pytest.approx(312.5)


def test_a_move_below_half_a_step_is_none() -> None:
    planner = Planner(machine())
    assert planner.append((0.006, 0, 0), 6000) is None
    assert planner.append((0.0063, 0, 0), 6000) is not None
    assert planner.position == (1, 0, 0)


@pytest.mark.parametrize(
    ("value", "steps"),
    [(0.5, 1), (-0.5, -1), (0.49, 0), (math.nan, 0), (math.inf, 2**31 - 1), (-1e30, 1 - 2**31)],
)
def test_steps_round_half_away_and_stay_within_32_bits(value: float, steps: int) -> None:
    assert to_steps(value, 1.0) == steps


moves = st.lists(
    st.tuples(
        st.integers(-400, 400), st.integers(-400, 400), st.sampled_from([300, 3000, 6000, 12000])
    ),
    min_size=1,
    max_size=15,
)


def plan(lines: list[tuple[int, int, int]]) -> Planner:
    planner = Planner(machine())
    for x, y, feed in lines:
        planner.append((x / 100, y / 100, 0), feed)
    return planner


@given(moves)
def test_every_plan_can_be_kept(lines: list[tuple[int, int, int]]) -> None:
    planned = plan(lines).moves
    if not planned:
        return
    assert planned[0].entry_sqr == 0
    exits = [move.entry_sqr for move in planned[1:]] + [0.0]
    for move, exit_sqr in zip(planned, exits, strict=True):
        room = 2 * move.acceleration * move.length * (1 + SINGLE)
        assert move.entry_sqr <= move.limit_sqr
        assert abs(exit_sqr - move.entry_sqr) <= room


@given(moves)
def test_planning_only_what_is_open_finds_the_plan_of_planning_all(
    lines: list[tuple[int, int, int]],
) -> None:
    planner = plan(lines)
    found = [move.entry_sqr for move in planner.moves]
    planner.restart()
    assert [move.entry_sqr for move in planner.moves] == pytest.approx(found, rel=SINGLE)


@given(moves, st.integers(10, 200), st.sampled_from([25, 50, 100]))
def test_overrides_are_kept_by_plan(
    lines: list[tuple[int, int, int]], feed: int, rapid: int
) -> None:
    planner = plan(lines)
    planner.override(feed, rapid)
    for before, move in zip(planner.moves, planner.moves[1:], strict=False):
        slower = min(planner.nominal_speed(before), planner.nominal_speed(move))
        assert math.sqrt(move.entry_sqr) <= slower * (1 + SINGLE)
        assert planner.nominal_speed(move) <= move.rapid_rate
