"""Areas that polygons share, against areas known by hand and a search over all pairs."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapely

from miurafab.geometry import overlaps
from miurafab.geometry.overlaps import crossing, polygons_of, shared_areas


def boxes(*corners: tuple[float, float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Rectangles from (left, bottom, right, top), as corners and faces."""
    points = [[(a, b), (c, b), (c, d), (a, d)] for a, b, c, d in corners]
    return np.array(points, float), np.arange(4 * len(points)).reshape(-1, 4)


def test_polygons_that_only_touch_share_no_area() -> None:
    points, faces = boxes((0, 0, 2, 2), (1, 1, 3, 3), (2, 0, 4, 1), (2 - 1e-9, 2, 5, 9))
    found = shared_areas(points, faces, 1e-6)
    assert found.pairs.tolist() == [[0, 1], [1, 3]]
    assert shapely.area(found.areas).tolist() == [1.0, 1.0 + 1e-9]
    assert found.place_of(np.array([3, 0, 0]), np.array([1, 3, 7])).tolist() == [1, -1, -1]


def test_where_nothing_overlaps_no_pair_has_a_place() -> None:
    found = shared_areas(*boxes((0, 0, 1, 1), (2, 0, 3, 1)), 1e-6)
    assert found.pairs.shape == (0, 2)
    assert found.place_of(np.array([0, 1]), np.array([1, 1])).tolist() == [-1, -1]


def test_pairs_and_triples_are_those_of_a_search_over_all() -> None:
    rng = np.random.default_rng(5)
    low = rng.random((24, 2)) * 6
    size = 0.5 + 2 * rng.random((24, 2))
    points, faces = boxes(*np.concatenate([low, low + size], axis=1).tolist())
    part = np.arange(24) % 2
    found = shared_areas(points, faces, 1e-6, among=part)
    shapes = polygons_of(points, faces)

    def common(*chosen: int) -> float:
        return float(shapely.intersection_all(shapes[list(chosen)]).area)

    pairs = [p for p in itertools.combinations(range(24), 2) if part[p[0]] == part[p[1]]]
    assert found.pairs.tolist() == [list(p) for p in pairs if common(*p) > 0]
    triples = [
        [a, b, c]
        for (a, b), c in itertools.product(pairs, range(24))
        if b < c and part[b] == part[c] and common(a, b, c) > 0
    ]
    assert len(triples) > 10
    assert sorted(found.triples(shapes, 1e-6).tolist()) == triples


@pytest.mark.parametrize("at_once", [1, 7, 1_000])
def test_more_triples_than_a_number_are_told_without_all(
    at_once: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(overlaps, "_AT_ONCE", at_once)
    found = shared_areas(*boxes(*[(0, 0, 1, 1)] * 9), 1e-6)
    count = 9 * 8 * 7 // 6
    assert len(found.mutual()[0]) == count
    assert found.has_more_triples(count - 1)
    assert not found.has_more_triples(count)


def test_a_line_on_the_border_does_not_cross() -> None:
    points, faces = boxes((0, 0, 4, 4))
    shapes = polygons_of(points, faces)
    lines = np.array([[[0, 0], [4, 0]], [[1, -1], [1, 1]], [[5, 0], [5, 4]], [[3.9, -1], [5, 0.2]]])
    assert crossing(lines, shapes, np.zeros(4, dtype=np.int64), 0.01).tolist() == [
        False,
        True,
        False,
        False,
    ]
