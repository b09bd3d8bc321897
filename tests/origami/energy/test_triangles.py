"""Facets split into triangles: they cover the facet, and their diagonals lie inside it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from piece_problems import trimmed

from miurafab.geometry.polygons import signed_areas
from miurafab.origami.energy.triangles import _shapes, split_facets

TURN = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]


def in_space(flat: np.ndarray) -> np.ndarray:
    return np.pad(flat, ((0, 0), (0, 1))) @ TURN.T


@settings(max_examples=60)
@given(
    corners=st.integers(3, 9),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_star_shaped_facet_is_covered_once(corners: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    turn = np.sort(random.uniform(0, 2 * np.pi, corners))
    if np.diff(np.append(turn, turn[0] + 2 * np.pi)).max() > 3.0:
        turn = 2 * np.pi * np.arange(corners) / corners
    flat = random.uniform(0.3, 1.0, (corners, 1)) * np.column_stack([np.cos(turn), np.sin(turn)])
    face = np.arange(corners)[None]
    triangles, diagonals = split_facets(
        in_space(flat), np.pad(face, ((0, 0), (0, 1)), constant_values=-1)
    )
    assert len(triangles) == corners - 2
    assert len(diagonals) == corners - 3
    areas = signed_areas(flat[triangles])
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(signed_areas(flat[face])[0])


def test_a_facet_of_many_corners_is_weighed_run_by_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each pair of corners was weighed by itself: facets of 200 corners took a minute of `fold`."""
    calls = []

    def counted(*given: np.ndarray) -> np.ndarray:
        calls.append(given)
        return _shapes(*given)

    monkeypatch.setattr("miurafab.origami.energy.triangles._shapes", counted)
    turn = 2 * np.pi * np.arange(90) / 90
    flat = np.column_stack([np.cos(turn), np.sin(turn)]) * (1 + 0.3 * np.cos(3 * turn))[:, None]
    triangles, _ = split_facets(in_space(flat), np.arange(90)[None])
    assert len(calls) < 90
    areas = signed_areas(flat[triangles])
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(signed_areas(flat[None])[0])


def test_a_quad_is_split_on_its_shorter_diagonal_and_a_dart_inside() -> None:
    kite = np.array([[0.0, 0.0], [3.0, -1.0], [6.0, 0.0], [3.0, 1.0]])
    dart = np.array([[0.0, 0.0], [4.0, 0.0], [1.0, 1.0], [0.0, 4.0]])
    for flat, expected in ((kite, {1, 3}), (dart, {0, 2})):
        _, diagonals = split_facets(in_space(flat), np.arange(4)[None])
        assert set(diagonals[0].tolist()) == expected


def all_splits(corners: list[int]) -> Iterator[list[list[int]]]:
    """Every way to split a polygon into triangles."""
    if len(corners) < 3:
        yield []
        return
    for k in range(1, len(corners) - 1):
        for left in all_splits(corners[: k + 1]):
            for right in all_splits(corners[k:]):
                yield [*left, [corners[0], corners[k], corners[-1]], *right]


def worst_shape(flat: np.ndarray, triangles: np.ndarray) -> float:
    sides = np.linalg.norm(flat[triangles] - flat[np.roll(triangles, 1, axis=1)], axis=2)
    return float((2 * signed_areas(flat[triangles]) / sides.max(axis=1) ** 2).min())


@settings(max_examples=20, deadline=None)
@given(corners=st.integers(5, 7), seed=st.integers(0, 2**32 - 1))
def test_the_worst_triangle_is_the_best_of_all_splits(corners: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    turn = 2 * np.pi * (np.arange(corners) + random.uniform(0, 0.4, corners)) / corners
    flat = random.uniform(0.2, 1.0, (corners, 1)) * np.column_stack([np.cos(turn), np.sin(turn)])
    triangles, _ = split_facets(in_space(flat), np.arange(corners)[None])
    every = [worst_shape(flat, np.array(way)) for way in all_splits(list(range(corners)))]
    assert worst_shape(flat, triangles) == pytest.approx(max(every), abs=1e-12)


def test_corners_on_a_straight_side_leave_no_triangle_without_width() -> None:
    flat = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [3.0, 2.0], [0.0, 2.0]])
    triangles, _ = split_facets(in_space(flat), np.arange(6)[None])
    assert signed_areas(flat[triangles]).min() > 0.4
    quad = np.array([[0.0, 0.9], [0.04, 0.9], [0.09, 0.9], [0.0, 1.0]])  # a flat diagonal
    triangles, _ = split_facets(in_space(quad), np.arange(4)[None])
    assert signed_areas(quad[triangles]).min() > 1e-3


def test_the_facets_of_a_trimmed_sheet_are_covered() -> None:
    pattern = trimmed()
    triangles, diagonals = split_facets(pattern.folded_coords, pattern.faces_vertices)
    sizes = (pattern.faces_vertices >= 0).sum(axis=1)
    assert sizes.max() > 4
    assert len(triangles) == (sizes - 2).sum()
    assert len(diagonals) == (sizes - 3).sum()
    assert signed_areas(pattern.vertices_coords[triangles]).min() > 0
