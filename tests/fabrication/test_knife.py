"""The knife, held against a simulated caster: the tip that trails cuts what was asked for."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from miurafab.errors import LayoutError
from miurafab.fabrication.knife import ALIGNING_OFFSETS, axis_way, tip_way
from miurafab.fabrication.knife_tip import overcuts, tip_moves
from miurafab.fabrication.toolpath import Toolpath
from miurafab.profiles import OPERATIONS, Knife

CUT = OPERATIONS.index("cut")
KNIFE = Knife(0.25, math.radians(20), 0.0, None, ())
MARGIN = 5.0
TOLERANCE = 0.02


def test_a_knife_without_offset_cuts_where_its_axis_goes():
    start = np.array([[0.0, 0.0], [5.0, 0.0], [20.0, 1.0]])
    end = np.array([[5.0, 0.0], [5.0, 9.0], [30.0, 1.0]])
    moves, stroke = tip_moves(start, end, 0.0)
    assert np.array_equal(moves, np.concatenate([start, end], axis=1))
    assert stroke.tolist() == [0, 0, 1]


def test_a_stroke_that_touches_its_start_on_its_way_is_not_closed():
    """A 6 goes round and on; a square ends where it began, and goes on by the overcut."""
    square = [(0, 0), (9, 0), (9, 9), (0, 9), (0, 0)]
    for after, closed, short in (((-20, 0), 0, []), ((2, 0), 1, []), ((0.5, 0), 0, [0])):
        points = np.array([*square, after], dtype=float)
        moves = np.concatenate([points[:-1], points[1:]], axis=1)
        beyond, found = overcuts(moves, np.zeros(5, dtype=np.int64), 2.0, 0.05)
        assert beyond.sum() == closed
        assert found.tolist() == short


def toolpath(polylines: Sequence[Sequence[tuple[float, float]]]) -> Toolpath:
    count = len(polylines)
    return Toolpath(
        sheet="sheet-01",
        width_mm=200.0,
        height_mm=200.0,
        points=np.array([p for line in polylines for p in line], dtype=float).reshape(-1, 2),
        offsets=np.cumsum([0, *map(len, polylines)], dtype=np.int64),
        operation=np.full(count, CUT),
        patch=np.zeros(count, dtype=np.int64),
        edge=np.zeros(count, dtype=np.int64),
    )


def trailing(path: Toolpath, knife: Knife, margin: float) -> Toolpath:
    return axis_way(tip_way(path, knife, margin), knife)


def drag(way: np.ndarray, angle: float, d: float, step: float = 0.01) -> tuple[np.ndarray, float]:
    """(k, 2) the tip's way while the axis goes along ``way``, and the blade's angle after it.

    The tip can move only along the blade: while the axis moves by ds in direction b, the blade's
    angle a obeys d a' = sin(b - a), which has the solution tan((b - a)/2) = C exp(-s/d).
    """
    tips = [way[0] - d * np.array([math.cos(angle), math.sin(angle)])]
    for begin, end in itertools.pairwise(way):
        length = math.dist(begin, end)
        towards = math.atan2(*(end - begin)[::-1])
        count = max(1, math.ceil(length / step))
        s = length * np.arange(1, count + 1) / count
        left = 2 * np.arctan(math.tan((towards - angle) / 2) * np.exp(-s / d))
        angles = towards - left
        axis = begin + (end - begin) * (s / length)[:, None]
        tips.extend(axis - d * np.stack([np.cos(angles), np.sin(angles)], axis=1))
        angle = float(angles[-1])
    return np.array(tips), angle


def distance(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """(k,) how far each point is from a polyline."""
    best = np.full(len(points), np.inf)
    for a, b in itertools.pairwise(line):
        share = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        best = np.minimum(best, np.linalg.norm(points - a - share[:, None] * (b - a), axis=1))
    return best


def cuts(path: Toolpath, knife: Knife, blade: float) -> list[np.ndarray]:
    """The tip's way in each stroke, the blade standing at the angle ``blade`` at first, and the
    file's micrometres allowed for.
    """
    way = trailing(path, knife, MARGIN)
    made = []
    for index in range(len(way)):
        tips, blade = drag(np.round(way.stroke(index), 3), blade, knife.offset_mm)
        made.append(tips)
    return made


def assert_cut_as_asked(path: Toolpath, knife: Knife, blade: float) -> None:
    made = cuts(path, knife, blade)
    assert len(made) == len(path) + 1
    for index, tips in enumerate(made[1:]):
        line = path.stroke(index)
        assert distance(tips, line).max() <= TOLERANCE
        # And the other way round: no part of the stroke is left uncut.
        assert cKDTree(tips).query(line)[0].max() <= TOLERANCE


SQUARE = [(20.0, 20.0), (40.0, 20.0), (40.0, 40.0), (20.0, 40.0), (20.0, 20.0)]
ZIGZAG = [(20.0, 60.0), (21.0, 63.0), (22.0, 60.0), (23.0, 63.0), (22.9, 60.0)]
BACK = [(60.0, 20.0), (70.0, 20.0), (61.0, 20.0)]
ARC = [(100 + 3 * math.cos(t), 100 + 3 * math.sin(t)) for t in np.linspace(0, 6, 60)]
DASHES = [[(50.0 + 2 * k, 80.0 + k), (51.2 + 2 * k, 80.6 + k)] for k in range(5)]


@pytest.mark.parametrize("offset", [0.1, 0.25, 0.6, 1.0])
@pytest.mark.parametrize("blade", [0.0, 1.0, 3.0, -2.0])
def test_the_tip_goes_where_the_strokes_are(offset: float, blade: float) -> None:
    path = toolpath([SQUARE, ZIGZAG, BACK, ARC, *DASHES])
    assert_cut_as_asked(path, Knife(offset, math.radians(20), 0.0, None, ()), blade)


coordinate = st.floats(10, 40)
point = st.tuples(coordinate, coordinate)


@given(st.lists(st.lists(point, min_size=2, max_size=6), min_size=1, max_size=4))
@settings(max_examples=60, derandomize=True, deadline=None)
def test_any_strokes_are_cut_as_asked(lines: list[list[tuple[float, float]]]) -> None:
    assume(all(math.dist(a, b) > 0.3 for line in lines for a, b in itertools.pairwise(line)))
    assert_cut_as_asked(toolpath(lines), KNIFE, 2.5)


def test_without_correction_the_corners_would_be_rounded() -> None:
    tips, _ = drag(np.array(SQUARE), 0.0, KNIFE.offset_mm)
    assert cKDTree(tips).query(SQUARE[1])[0] > 5 * TOLERANCE


def test_a_sharp_corner_is_a_fan_about_it_and_a_slight_one_a_chord() -> None:
    way = trailing(toolpath([[(20.0, 20.0), (40.0, 20.0), (40.0, 40.0)]]), KNIFE, MARGIN).stroke(1)
    fan = way[1:-1]
    assert np.allclose(np.linalg.norm(fan - (40.0, 20.0), axis=1), 0.25)
    assert len(fan) >= 8
    assert way[-1] == pytest.approx((40.0, 40.25))
    slight = trailing(toolpath([[(20.0, 20.0), (40.0, 20.0), (60.0, 25.0)]]), KNIFE, MARGIN)
    assert len(slight.stroke(1)) == 4


def test_the_blade_is_turned_in_the_margin_first() -> None:
    way = trailing(toolpath([SQUARE]), KNIFE, MARGIN)
    assert way.patch[0] == -1
    assert way.stroke(0)[:, 1] == pytest.approx(MARGIN / 2)
    tips, angle = drag(way.stroke(0), 3.1, KNIFE.offset_mm)
    assert abs(angle) < 1e-5
    assert tips[:, 0].max() <= MARGIN / 2 + ALIGNING_OFFSETS * KNIFE.offset_mm + 1e-9
    with pytest.raises(LayoutError, match=r"margin of 0.5 mm .* at least 1 mm"):
        trailing(toolpath([SQUARE]), KNIFE, 0.5)


def test_a_closed_stroke_is_cut_on_over_its_beginning() -> None:
    knife = Knife(0.25, math.radians(20), 1.5, None, ())
    closed, open_ = cuts(toolpath([SQUARE, ZIGZAG]), knife, 0.0)[1:]
    assert closed[-1] == pytest.approx((21.5, 20.0), abs=2e-3)
    assert open_[-1] == pytest.approx(ZIGZAG[-1], abs=2e-3)
    past_a_corner = trailing(
        toolpath([[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 0.0)]]),
        Knife(0.0, 0.3, 1.5, None, ()),
        MARGIN,
    )
    assert past_a_corner.points[3:] == pytest.approx(np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 0.5)]))


def test_a_machine_that_corrects_for_its_blade_gets_the_strokes() -> None:
    path = toolpath([SQUARE, ZIGZAG])
    way = trailing(path, Knife(0.0, 0.3, 0.0, None, ()), MARGIN)
    assert np.array_equal(way.points, path.points)
    assert np.array_equal(way.offsets, path.offsets)
    assert len(trailing(toolpath([]), KNIFE, MARGIN)) == 0


def test_a_stroke_without_length_is_named() -> None:
    with pytest.raises(LayoutError, match="Stroke 2 of sheet-01 is shorter"):
        trailing(toolpath([SQUARE, [(1.0, 1.0), (1.0, 1.0)]]), KNIFE, MARGIN)


def test_many_dashes_are_an_array_operation() -> None:
    start = np.random.default_rng(1).uniform(10, 190, (50_000, 2))
    path = toolpath([])
    path = Toolpath(
        path.sheet, 200.0, 200.0,
        np.stack([start, start + np.array([0.7, 0.3])], axis=1).reshape(-1, 2),
        np.arange(0, 100_001, 2), *[np.full(50_000, CUT)] * 3,
    )  # fmt: skip
    way = trailing(path, KNIFE, MARGIN)
    # All dashes lie alike, so that only the first has to turn the blade.
    assert len(way.points) <= 2 * 50_001 + 5
