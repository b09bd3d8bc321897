"""Covers: facets held by few free rectangles."""

from __future__ import annotations

import numpy as np
import pytest
from flat_patterns import miura
from hypothesis import given, settings
from hypothesis import strategies as st

from miurafab.fabrication.partition.cover import (
    Relaxation,
    brickwork,
    excess,
    nearest,
    rectangle_around,
)
from miurafab.fabrication.partition.cover_search import CoverSearch
from miurafab.fabrication.partition.fit_box import best_turn

clouds = st.tuples(st.integers(3, 12), st.integers(0, 10_000)).map(
    lambda t: np.random.default_rng(t[1]).normal(size=(t[0], 2)) * [80.0, 30.0] + [400.0, -70.0]
)
sides = st.floats(40.0, 400.0)


def squares(columns: int, rows: int, side: float, turn: float = 0.0) -> np.ndarray:
    """(columns * rows, 4, 2) squares side by side, turned as a whole."""
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
    row, column = np.indices((rows, columns))
    base = np.stack([column, row], axis=-1).reshape(-1, 1, 2)
    c, s = np.cos(turn), np.sin(turn)
    return (base + corner) * side @ np.array([[c, s], [-s, c]])


@settings(derandomize=True, max_examples=100, deadline=None)
@given(clouds, sides, sides)
def test_a_frame_holds_points_exactly_if_some_turn_fits_them(points, width, height):
    rectangle = rectangle_around(points, width, height)
    over = excess(points[None], rectangle, width, height)[0]
    fits = any(best_turn(points, *size) is not None for size in ((width, height), (height, width)))
    assert (over <= 1e-9) == fits


def test_a_row_of_rectangles_that_meets_no_facet_is_left_out():
    shapes = np.concatenate([squares(40, 1, 10.0), squares(40, 1, 10.0) + np.array([0.0, 60.0])])
    for rectangles in brickwork(shapes, (30.0, 20.0)):
        away = np.abs(rectangles[:, 1] - 35.0)
        assert away.min() > 10.0
        assert away.max() < 40.0


def test_a_cover_that_never_settles_is_none(monkeypatch):
    relaxation = Relaxation(squares(4, 3, 10.0), 60.0, 40.0)
    rectangle = np.array([[20.0, 15.0, 0.0]])
    assert relaxation.settled(rectangle)[1] < 1e-6
    left = iter(range(1, 9))
    monkeypatch.setattr(relaxation, "_left_out", lambda _: np.array([next(left)]))
    assert relaxation.settled(rectangle)[1] == np.inf
    assert next(left) == 5


def test_one_rectangle_holds_every_shape_alone():
    search = CoverSearch(squares(4, 3, 10.0), 60.0, 40.0)
    assert search.needed(np.array([[20.0, 15.0, 0.0]])).tolist() == [12.0]


def test_nearest_tells_the_frames_that_a_point_lies_deepest_in():
    rng = np.random.default_rng(1)
    rectangles = np.column_stack([rng.uniform(0, 900, (12, 2)), rng.uniform(0, 3, 12)])
    points = rng.uniform(0, 900, (200, 2))
    every = np.stack(
        [excess(points[:, None], rectangle, 300.0, 200.0) for rectangle in rectangles], axis=1
    )
    near, apart = nearest(points, rectangles, 300.0, 200.0, 12)
    np.testing.assert_allclose(apart, np.take_along_axis(every, near, axis=1))
    assert (np.sort(near, axis=1) == np.arange(12)).all()


def test_each_shape_goes_to_the_frame_with_the_least_excess():
    """More shapes than are compared at a time, and a margin within each frame."""
    rng = np.random.default_rng(3)
    relaxation = Relaxation(squares(40, 30, 10.0, 0.2), 130.0, 90.0)
    rectangles = np.column_stack([rng.uniform(0, 400, (15, 2)), rng.uniform(0, 3, 15)])
    relaxation.look(rectangles)
    assert len(relaxation.active) > 600
    relaxation.margin = 3.0
    best, over = relaxation.least(rectangles)
    shapes = relaxation.shapes[relaxation.sample][relaxation.active]
    each = [excess(shapes, rectangles[near], 124.0, 84.0) for near in relaxation.near.T]
    np.testing.assert_allclose(over, np.min(each, axis=0), atol=1e-9)
    np.testing.assert_allclose(over, excess(shapes, rectangles[best], 124.0, 84.0), atol=1e-9)


def test_the_gradient_of_the_loss_is_its_slope():
    rng = np.random.default_rng(5)
    relaxation = Relaxation(squares(40, 30, 10.0, 0.2), 130.0, 90.0)
    rectangles = brickwork(relaxation.shapes, (130.0, 90.0))[0]
    rectangles = rectangles + rng.normal(size=rectangles.shape) * [6.0, 6.0, 0.02]
    relaxation.look(rectangles)
    steps = (rectangles * [1.0, 1.0, 250.0]).ravel()
    _, slope = relaxation._loss(steps)
    for place in range(len(steps)):
        ahead, behind = steps.copy(), steps.copy()
        ahead[place] += 1e-5
        behind[place] -= 1e-5
        drawn = (relaxation._loss(ahead)[0] - relaxation._loss(behind)[0]) / 2e-5
        assert slope[place] == pytest.approx(drawn, rel=1e-3, abs=1e-2)


@pytest.mark.parametrize("turn", [0.0, 0.4, 1.3])
def test_brickwork_over_whole_rows_is_a_cover(turn):
    shapes = squares(48, 30, 10.0, turn)
    relaxation = Relaxation(shapes, 121.0, 101.0)
    counts = []
    for rectangles in brickwork(shapes, (121.0, 101.0)):
        _, loss = relaxation.relax(rectangles)
        counts.append(len(rectangles))
        assert loss <= 1.0
    assert 12 in counts


def test_a_needless_frame_is_found_and_left_out():
    shapes = squares(48, 20, 10.0)
    rectangles = np.array([[x, y, 0.0] for y in (50.0, 150.0) for x in (60.0, 180.0, 300.0, 420.0)])
    extra = np.vstack([rectangles, [200.0, 90.0, 0.7]])
    search = CoverSearch(shapes, 122.0, 102.0)
    cover = search.fewer([search.begin(extra)], 8, 200.0)
    assert cover is not None
    assert len(cover) == 8
    near, _ = nearest(shapes.mean(axis=1), cover, 122.0, 102.0, 8)
    over = [excess(shapes, cover[column], 122.0, 102.0) for column in near.T]
    assert np.min(over, axis=0).max() <= 0.8
    assert search.fewer([search.begin(cover)], 7, 100.0) is None, "7 are smaller than the whole"


def test_the_search_is_the_same_each_time():
    pattern = miura(40, 30)
    shapes = pattern.vertices_coords[pattern.faces_vertices]

    def searched() -> bytes:
        search = CoverSearch(shapes, 150.0, 110.0, seed=3)
        starts = [search.begin(each) for each in brickwork(shapes, (150.0, 110.0))]
        count = min(len(start.rectangles) for start in starts)
        cover = search.fewer(starts, count - 1, 60.0)
        return b"" if cover is None else cover.tobytes()

    assert searched() == searched()
