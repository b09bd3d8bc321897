"""Seams between rectangles: as short as they can be, and nothing stands out."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from flat_patterns import card, miura, without_grid

from miurafab.fabrication.partition.cover import rectangle_around
from miurafab.fabrication.partition.min_cut import Recut
from miurafab.fabrication.partition.region_growing import is_disk


def recut(pattern, patch, rectangles, size, tab=3.0):
    room = pattern.vertices_coords[pattern.faces_vertices]
    part = np.zeros_like(patch)
    return Recut(
        pattern,
        patch,
        rectangles,
        size,
        room,
        part,
        card(tab=tab),
        full_facet=False,
        alternate=False,
    )


def seam_mm(pattern, patch):
    pair = pattern.edges_faces
    seam = (pair >= 0).all(axis=1) & (patch[pair[:, 0]] != patch[pair[:, 1]])
    ends = pattern.vertices_coords[pattern.edges_vertices[seam]]
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()


@pytest.mark.parametrize("grid", [True, False])
def test_a_seam_with_fjords_is_cut_straight(grid):
    pattern = miura(20, 12, sector=np.pi / 2)
    if not grid:
        pattern = without_grid(pattern)
    row, column = np.divmod(np.arange(240), 20)
    patch = (column >= 10 + 2 * (row % 2)).astype(np.int64)
    points = pattern.vertices_coords
    size = (170.0, 150.0)
    rectangles = np.array(
        [
            rectangle_around(points[points[:, 0] <= 164], *size),
            rectangle_around(points[points[:, 0] >= 84], *size),
        ]
    )
    before = seam_mm(pattern, patch)
    cut = recut(pattern, patch, rectangles, size)
    assert cut.faults() == 0
    cut.run(3)
    assert cut.faults() == 0
    assert before == pytest.approx(12 * 12 + 11 * 24)
    assert seam_mm(pattern, cut.patch) == pytest.approx(12 * 12), "straight down"
    assert not cut.misshapen()


def test_a_cut_is_the_least_of_all_splits():
    """Against every assignment of the facets that both rectangles hold."""
    pattern = miura(7, 4, a=10.0, b=12.0, sector=1.1)
    row, column = np.divmod(np.arange(28), 7)
    patch = (column + (row % 2) > 3).astype(np.int64)
    size = (57.0, 49.0)
    left = pattern.vertices_coords[pattern.faces_vertices[column <= 3]].reshape(-1, 2)
    right = pattern.vertices_coords[pattern.faces_vertices[column >= 3]].reshape(-1, 2)
    rectangles = np.array([rectangle_around(left, *size), rectangle_around(right, *size)])
    cut = recut(pattern, patch, rectangles, size)
    free = np.intersect1d(*cut.held)
    assert 3 <= len(free) <= 12

    def cost(patch):
        cut.patch = patch
        return cut.seam_cost + 1e9 * cut.faults()

    tried = []
    for labels in itertools.product([0, 1], repeat=len(free)):
        here = patch.copy()
        here[free] = labels
        if all(is_disk(pattern, np.flatnonzero(here == p)) for p in (0, 1)):
            tried.append(cost(here))
    cut.patch = patch.copy()
    cut.run(2)
    assert cut.seam_cost + 1e9 * cut.faults() == pytest.approx(min(tried))


def test_frames_put_about_their_patches_hold_facets_and_tabs():
    pattern = miura(20, 12, sector=1.2)
    patch = (np.arange(240) % 20 >= 10).astype(np.int64)
    size = (180.0, 152.0)
    cut = recut(pattern, patch, np.zeros((2, 3)), size)
    assert cut.faults() > 0
    cut.refit()
    assert cut.faults() == 0
