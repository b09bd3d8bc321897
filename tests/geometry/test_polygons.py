"""Runs in one array, and polygons of mixed size against one polygon at a time."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from miurafab.geometry.arrays import places_in_runs, run_starts
from miurafab.geometry.polygons import (
    edge_lengths,
    facet_means,
    facet_normals,
    filled,
    next_corners,
    previous_corners,
    principal_axes,
    reversed_faces,
    sides_and_diagonals,
    signed_areas,
    smallest_box,
)
from miurafab.geometry.shapes import common_area

FACES = np.array([[0, 1, 2, -1, -1], [0, 2, 3, 4, 5], [5, 4, 6, 7, -1]])


def corners(face):
    return [v for v in face.tolist() if v >= 0]


@given(st.lists(st.integers(0, 6), max_size=12))
def test_places_in_runs_count_each_run_from_0(lengths):
    counts = np.array(lengths, dtype=np.int64)
    places = [place for length in lengths for place in range(length)]
    assert places_in_runs(counts).tolist() == places
    assert run_starts(counts).tolist() == [sum(lengths[:n]) for n in range(len(lengths))]


def test_walks_over_the_corners_of_each_face():
    ahead = np.take_along_axis(FACES, next_corners(FACES), axis=1)
    behind = np.take_along_axis(FACES, previous_corners(FACES), axis=1)
    back = reversed_faces(FACES)
    for row, face in enumerate(FACES):
        ring = corners(face)
        assert ahead[row, : len(ring)].tolist() == ring[1:] + ring[:1]
        assert behind[row, : len(ring)].tolist() == ring[-1:] + ring[:-1]
        assert corners(back[row]) == ring[::-1]
    pairs = [tuple(pair) for faces, ends in sides_and_diagonals(FACES) for pair in ends.tolist()]
    assert len(pairs) == 3 + 10 + 6
    assert all(face >= 0 for pair in pairs for face in pair)


def test_means_and_normals_of_faces_of_any_size():
    """Faces of a plane have its normal whatever their size, and a mean of their own corners."""
    random = np.random.default_rng(1)
    angle = np.arange(5) * 2 * np.pi / 5
    flat = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
    points = flat @ turn.T
    normal = np.cross(turn[:, 0], turn[:, 1])
    for width in (3, 4, 5):
        face = np.arange(width)[None]
        padded = np.pad(face, ((0, 0), (0, 5 - width)), constant_values=-1)
        for faces in (face, padded):
            assert facet_normals(points, faces)[0] == pytest.approx(normal)
            assert facet_means(points, faces)[0] == pytest.approx(points[:width].mean(axis=0))
    assert np.isnan(facet_normals(points, np.array([[0, 0, 1]]))).all()


def test_areas_are_positive_counter_clockwise_and_lengths_are_those_of_edges():
    square = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0], [0.0, 4.0]])
    faces = np.array([[0, 1, 2, 3], [3, 2, 1, 0], [0, 1, 2, -1]])
    assert signed_areas(square[filled(faces)]).tolist() == [12.0, -12.0, 6.0]
    assert edge_lengths(square, np.array([[0, 1], [0, 2]])).tolist() == [3.0, 5.0]
    assert common_area(shapely.Polygon(square), shapely.box(2, 1, 9, 9)) == pytest.approx(3.0)
    assert common_area(shapely.Polygon(square), shapely.box(3, 0, 9, 9)) == 0.0


@given(st.floats(0, 2 * np.pi), st.integers(0, 10**6))
def test_principal_axes_point_in_the_positive_direction(angle, seed):
    spread = np.random.default_rng(seed).normal(size=(40, 2)) * [5.0, 0.5]
    c, s = np.cos(angle), np.sin(angle)
    axes = principal_axes(spread @ np.array([[c, s], [-s, c]]))
    assert abs(axes[:, 1] @ [c, s]) > 0.9
    assert axes.T @ axes == pytest.approx(np.eye(2))
    assert (axes[np.abs(axes).argmax(axis=0), [0, 1]] > 0).all()


@pytest.mark.parametrize("angle", [-1.4, -0.3, 0.3, 1.2])
def test_the_smallest_box_of_a_turned_rectangle_is_the_rectangle(angle):
    c, s = np.cos(angle), np.sin(angle)
    rectangle = np.array([[0, 0], [40, 0], [40, 25], [0, 25], [13, 7]]) @ [[c, s], [-s, c]]
    found, sizes = smallest_box(rectangle)
    assert sorted(sizes) == pytest.approx([25.0, 40.0])
    assert np.sin(2 * (found - angle)) == pytest.approx(0.0, abs=1e-8)


def test_no_turn_gives_a_smaller_box():
    points = np.random.default_rng(3).normal(size=(30, 2))
    angle, sizes = smallest_box(points)
    angles = np.append(np.linspace(0, np.pi / 2, 2001), angle)
    along = points @ np.stack([np.cos(angles), np.sin(angles)])
    across = points @ np.stack([-np.sin(angles), np.cos(angles)])
    areas = np.ptp(along, axis=0) * np.ptp(across, axis=0)
    assert areas[-1] == pytest.approx(sizes.prod())
    assert areas[-1] <= 1.0001 * areas.min()
    line = np.outer(np.arange(4.0), [3.0, 4.0])
    assert smallest_box(line)[1] == pytest.approx([15.0, 0.0], abs=1e-7)
