"""Turning an outline into a rectangle."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from miurafab.fabrication.partition.fit_box import best_turn, fan, fits, support

clouds = st.tuples(st.integers(3, 12), st.integers(0, 10_000)).map(
    lambda t: np.random.default_rng(t[1]).normal(size=(t[0], 2)) * [80.0, 30.0]
)
sides = st.floats(20.0, 300.0)


def extents(points: np.ndarray, angle: float | np.ndarray) -> np.ndarray:
    c, s = np.cos(angle)[..., None], np.sin(angle)[..., None]
    x, y = points.T
    return np.stack([np.ptp(c * x + s * y, axis=-1), np.ptp(c * y - s * x, axis=-1)], axis=-1)


@settings(derandomize=True, max_examples=150, deadline=None)
@given(clouds, sides, sides)
def test_best_turn_is_the_smallest_box_of_all_angles_that_fit(points, width, height):
    angle = best_turn(points, width, height)
    tried = extents(points, np.linspace(0, np.pi, 1441))
    fitting = tried[(tried <= [width, height]).all(axis=1)]
    if angle is None:
        assert not len(fitting)
        return
    found = extents(points, angle)
    assert (found <= np.array([width, height]) + 1e-6).all()
    if len(fitting):
        assert found.prod() <= fitting.prod(axis=1).min() + 1e-6


def test_a_strip_that_fits_only_askew_is_found():
    strip = np.array([[0, 0], [100, 0], [100, 1], [0, 1]], dtype=float)
    assert best_turn(strip, 72.0, 72.0) is not None
    # Turned by 45 degrees it is 101 / sqrt 2 = 71.418 mm both ways.
    assert best_turn(strip, 71.419, 71.419) is not None
    assert best_turn(strip, 71.417, 71.417) is None


@settings(derandomize=True, max_examples=100, deadline=None)
@given(clouds, clouds, sides, sides)
def test_support_values_of_a_union_are_maxima_and_never_invent_a_fit(one, other, width, height):
    directions = fan(30)

    def values(points):
        return support(points[None], np.ones((1, len(points)), dtype=bool), directions)[0]

    union = np.concatenate([one, other])
    np.testing.assert_array_equal(np.maximum(values(one), values(other)), values(union))
    tried = extents(union, np.radians(np.arange(30) * 3))

    def inside(room):
        limits = np.array([width, height]) + room
        along, across = (tried <= limits).all(axis=1), (tried[:, ::-1] <= limits).all(axis=1)
        return (along | across).any()

    if fits(values(union), width, height):
        assert inside(1e-6)
    else:
        assert not inside(-0.01)


def test_an_absent_polygon_is_neutral_in_a_union():
    absent = support(np.zeros((1, 4, 2)), np.zeros((1, 4), dtype=bool), fan(3))
    assert np.isneginf(absent).all()
