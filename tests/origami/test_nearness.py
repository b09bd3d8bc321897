"""The distances that a report gives, computed again from dense samples by code of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from problems import fitted
from scipy.spatial import cKDTree

from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.nearness import Nearness, nearness
from miurafab.surfaces.catalogue import make_surface

BARYCENTRIC = np.array(
    [(i / 16, j / 16, 1 - (i + j) / 16) for i in range(17) for j in range(17 - i)]
)


def dense_sheet(pattern: CreasePattern) -> np.ndarray:
    """153 points of each half of each facet."""
    p = pattern.folded_coords[pattern.faces_vertices]
    halves = np.concatenate([p[:, [0, 1, 2]], p[:, [0, 2, 3]]])
    return (BARYCENTRIC @ halves).reshape(-1, 3)


def dense_target(name: str, count: int = 500) -> np.ndarray:
    surface, _ = make_surface(name, {})
    d = surface.domain
    u, v = np.meshgrid(np.linspace(d.u0, d.u1, count), np.linspace(d.v0, d.v1, count))
    return surface.point(np.stack([u, v], axis=-1)).reshape(-1, 3)


def measured(pattern: CreasePattern, name: str) -> Nearness:
    surface = make_surface(name, {})[0]
    return nearness(pattern, surface, surface.tiles())


@pytest.mark.parametrize("name", ["hypar", "vase", "sphere", "cylinder"])
def test_both_distances_are_those_of_dense_samples(name):
    pattern = fitted(name, 8, 8).pattern
    found = measured(pattern, name)
    sheet, target = dense_sheet(pattern), dense_target(name) * pattern.scale
    there = cKDTree(target).query(sheet)[0].max()
    back = cKDTree(sheet).query(target)[0].max()
    assert found.sheet_to_target == pytest.approx(there, rel=0.01)
    assert found.target_to_sheet == pytest.approx(back, rel=0.02)
    assert found.hausdorff == max(found.sheet_to_target, found.target_to_sheet)


@pytest.mark.parametrize("shift", [0.0, 40.0])
def test_over_a_rectangle_the_farthest_point_is_a_vertex(shift):
    """The distance from a convex set is convex; that from a rectangle has a closed form."""
    pattern = fitted("plane", 6, 6).pattern
    points = pattern.folded_coords + np.array([shift, 0.0, 0.0])
    surface = make_surface("plane", {})[0]
    half = np.array([surface.domain.u1, surface.domain.v1]) * pattern.scale
    outside = np.maximum(np.abs(points[:, :2]) - half, 0.0)
    far = np.linalg.norm(np.append(outside, points[:, 2:], axis=1), axis=1).max()
    found = measured(replace(pattern, folded_coords=points), "plane")
    assert found.sheet_to_target == pytest.approx(far, rel=1e-9)
    assert found.target_to_sheet > shift


def test_half_a_sheet_leaves_half_of_the_target_far_away():
    whole = fitted("hypar", 12, 12).pattern
    columns = whole.grid[0]
    kept = whole.faces_vertices % columns
    half = replace(
        whole,
        faces_vertices=whole.faces_vertices[(kept.max(axis=1) <= columns // 2)],
        grid=None,
    )
    surface = make_surface("hypar", {})[0]
    before, after = measured(whole, "hypar"), measured(half, "hypar")
    assert after.sheet_to_target == pytest.approx(before.sheet_to_target, rel=0.2)
    width = surface.domain.width * whole.scale
    assert after.target_to_sheet > 0.45 * width
