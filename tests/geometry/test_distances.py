"""Distances to meshes against all triangles, one by one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from miurafab.geometry.distances import MeshTrees, closest_on_triangle


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 80), st.floats(0, 4))
def test_the_nearest_of_all_triangles(seed, count, spread):
    """Triangles of sizes up to several orders apart, some without area."""
    random = np.random.default_rng(seed)
    triangles = random.normal(size=(count, 1, 3)) + random.normal(
        size=(count, 3, 3)
    ) * random.lognormal(-1, spread, (count, 1, 1))
    triangles[random.random(count) < 0.1, 2] = triangles[0, 0]
    assert_nearest(random.normal(scale=2, size=(30, 3)), triangles)


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.integers(1, 6))
def test_the_two_triangles_of_a_square_share_their_centre(seed, side):
    """The boxes of both have one centre, so that a tree of centres lists them in any order."""
    x, y = np.divmod(np.arange(side * side), side)
    halves = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]])
    low = np.stack([x, y, 0 * x], axis=1)[:, None, None]
    triangles = (low + halves).reshape(-1, 3, 3).astype(float)
    random = np.random.default_rng(seed)
    points = random.uniform([-1, -1, -1], [side + 1, side + 1, 1], (30, 3))
    assert_nearest(points, triangles)


def test_triangles_that_are_points_are_near_and_no_triangles_are_not() -> None:
    """Both told that each point lies on the mesh."""
    points = np.array([[3.0, 4.0, 0.0], [0.0, 0.0, 1.0]])
    assert_nearest(points, np.zeros((3, 3, 3)))
    with pytest.raises(ValueError, match="zero-size"):
        MeshTrees.of(np.zeros((0, 3, 3)))


def assert_nearest(points, triangles):
    nearest, triangle = MeshTrees.of(triangles).closest(points)
    each = np.stack(
        [closest_on_triangle(points, np.repeat(t[None], len(points), axis=0)) for t in triangles]
    )
    best = np.linalg.norm(each - points, axis=2).min(axis=0)
    gap = np.linalg.norm(nearest - points, axis=1)
    np.testing.assert_allclose(gap, best, rtol=1e-12, atol=1e-12)
    assert (nearest == closest_on_triangle(points, triangles[triangle])).all()
    near = MeshTrees.of(triangles).near(points)
    every = np.abs(each - near).max(axis=2).min(axis=0)
    assert every.max() == 0.0  # each is the nearest point of some triangle


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_no_sample_of_a_triangle_is_nearer_than_its_nearest_point(seed):
    random = np.random.default_rng(seed)
    triangle, point = random.normal(size=(3, 3)), random.normal(scale=2, size=3)
    weights = random.dirichlet((0.5, 0.5, 0.5), 500)
    best = np.linalg.norm(closest_on_triangle(point[None], triangle[None]) - point)
    assert np.linalg.norm(weights @ triangle - point, axis=1).min() >= best - 1e-12
