"""The largest distance of a mesh from a set: closed forms, and dense samples of random meshes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from miurafab.geometry.hausdorff import WITHIN, farthest_from_map, farthest_from_mesh, in_four


def square(side: float, height: float = 0.0) -> np.ndarray:
    a, b, c, d = np.array(
        [[0, 0, height], [side, 0, height], [side, side, height], [0, side, height]], dtype=float
    )
    return np.array([[a, b, c], [a, c, d]])


def soup(seed: int, count: int, size: float) -> np.ndarray:
    random = np.random.default_rng(seed)
    return random.normal(size=(count, 1, 3)) + size * random.normal(size=(count, 3, 3))


def test_a_roof_is_farthest_at_its_ridge():
    """The middle of the square lies under a ridge of height 1 whose slopes fall at 45 degrees."""
    slope = [[[0, 0, 0], [0, 2, 0], [1, 2, 1]], [[0, 0, 0], [1, 2, 1], [1, 0, 1]]]
    other = [[[2, 0, 0], [2, 2, 0], [1, 2, 1]], [[2, 0, 0], [1, 2, 1], [1, 0, 1]]]
    roof = np.array(slope + other, dtype=float)
    assert farthest_from_mesh(roof, square(2.0)) == pytest.approx(1.0, rel=WITHIN)
    assert farthest_from_mesh(square(2.0), roof) == pytest.approx(math.sqrt(0.5), rel=WITHIN)


def test_a_square_is_farthest_from_a_point_at_its_far_corner():
    far = farthest_from_map(square(3.0), lambda points: np.zeros_like(points))
    assert far == pytest.approx(3 * math.sqrt(2), rel=1e-12)


def test_a_mesh_in_a_mesh_has_no_distance():
    whole = in_four(in_four(square(1.0)))
    assert farthest_from_mesh(whole[:7], whole) < 1e-12
    assert farthest_from_mesh(whole, whole[7:]) > 0.05


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.sampled_from([0.05, 0.5, 2.0]))
def test_no_sample_is_farther_and_one_is_nearly_as_far(seed, count, size):
    """Dense points of each triangle, and the exact distance of a point to each other triangle by
    a quadratic programme over its corners, solved by active sets.
    """
    one, other = soup(seed, count, size), soup(seed + 1, 4, 1.0)
    far = farthest_from_mesh(one, other)
    steps = np.linspace(0, 1, 41)
    s, t = (part.ravel() for part in np.meshgrid(steps, steps))
    inside = s + t <= 1 + 1e-12
    weights = np.stack([1 - s - t, s, t], axis=1)[inside]
    samples = (weights @ one).reshape(-1, 3)
    nearest = np.min([by_active_sets(samples, triangle) for triangle in other], axis=0)
    assert far >= nearest.max() * (1 - WITHIN) - 1e-9
    assert far <= nearest.max() + size / 40


def by_active_sets(points: np.ndarray, triangle: np.ndarray) -> np.ndarray:
    """(n,) distances from a triangle: the least over its corners, sides and inside of the distance
    from the affine hull, where the foot has no negative weight.
    """
    best = np.full(len(points), np.inf)
    for corners in ([0], [1], [2], [0, 1], [1, 2], [0, 2], [0, 1, 2]):
        base, spans = triangle[corners[0]], triangle[corners[1:]] - triangle[corners[0]]
        weights = (
            (points - base) @ np.linalg.pinv(spans) if len(spans) else np.zeros((len(points), 0))
        )
        feet = base + weights @ spans
        allowed = (weights >= -1e-12).all(axis=1) & (weights.sum(axis=1) <= 1 + 1e-12)
        gap = np.linalg.norm(points - feet, axis=1)
        best = np.where(allowed & (gap < best), gap, best)
    return best


def test_a_part_of_a_large_mesh_is_found_among_many_triangles():
    """One corner lifted out of a plane of 32,768 triangles."""
    plane = square(1.0)
    for _ in range(7):
        plane = in_four(plane)
    lifted = plane.copy()
    lifted[(lifted == lifted[123, 1]).all(axis=2)] += [0, 0, 0.25]
    assert farthest_from_mesh(lifted, square(1.0)) == pytest.approx(0.25, rel=WITHIN)
