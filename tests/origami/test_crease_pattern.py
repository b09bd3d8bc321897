"""A pattern of several pieces: what it takes, what it refuses, which vertices meet at a seam."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from miurafab.errors import PatternError
from miurafab.origami.crease_pattern import CreasePattern


def two_squares(**changes: object) -> CreasePattern:
    """Two unit squares, a gap apart when flat, side by side when folded: edges 1 and 7 meet."""
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    ring = np.array([[0, 1], [1, 2], [2, 3], [3, 0]])
    pattern = CreasePattern(
        vertices_coords=np.concatenate([square, square + np.array([1.5, 0.0])]),
        edges_vertices=np.concatenate([ring, ring + 4]),
        edges_assignment=np.full(8, "B"),
        edges_fold_angle=np.zeros(8),
        faces_vertices=np.array([[0, 1, 2, 3], [4, 5, 6, 7]]),
        folded_coords=np.pad(
            np.concatenate([square, square + np.array([1.0, 0.0])]), ((0, 0), (0, 1))
        ),
        pieces=np.array([0, 1]),
        seams=np.array([[1, 7]]),
        cells=np.array([[0, 0], [1, 0]]),
    )
    return replace(pattern, **changes)


def test_the_vertices_of_a_seam_are_those_that_meet() -> None:
    pattern = two_squares()
    assert pattern.pieces_count == 2
    assert pattern.seam_vertices.tolist() == [[[1, 4], [2, 7]]]
    assert pattern.folded_coords is not None
    ends = pattern.folded_coords[pattern.seam_vertices]
    assert np.array_equal(ends[:, :, 0], ends[:, :, 1])
    assert "2 facets in 2 pieces" in repr(pattern)


def test_the_direction_of_an_edge_does_not_matter_to_its_seam() -> None:
    turned = two_squares()
    edges = turned.edges_vertices.copy()
    edges[7] = edges[7, ::-1]
    pairs = two_squares(edges_vertices=edges).seam_vertices
    assert pairs.tolist() == [[[1, 4], [2, 7]]]


def test_a_pattern_without_pieces_is_one_piece_without_seams() -> None:
    pattern = two_squares(pieces=None, seams=None, cells=None)
    assert pattern.pieces_count == 1
    assert pattern.seam_vertices.shape == (0, 2, 2)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"pieces": np.array([0])}, "one number for each facet"),
        ({"pieces": np.array([0, 2])}, "numbered from 0 without a gap"),
        ({"pieces": np.array([-1, 0])}, "numbered from 0 without a gap"),
        (
            {"faces_vertices": np.array([[0, 1, 2, 3], [2, 5, 6, 7]])},
            "Vertex 2 belongs to facets of two pieces",
        ),
        ({"seams": np.array([1, 7])}, "two edges each"),
        ({"seams": np.array([[1, 8]])}, "edge that does not exist"),
        ({"seams": np.array([[1, -1]])}, "edge that does not exist"),
        ({"seams": np.array([[1, 7], [1, 5]])}, "Edge 1 is in two seams"),
        ({"seams": np.array([[1, 1]])}, "Edge 1 is in two seams"),
        ({"edges_assignment": np.array(list("BVBBBBBB"))}, "Edge 1 is in a seam and is no border"),
        ({"cells": np.array([[0, 0]])}, "one column and row for each facet"),
        ({"folded_coords": np.zeros((7, 3))}, "does not have one 3D point for each vertex"),
        ({"edges_assignment": np.full(7, "B")}, "one assignment and angle for each edge"),
        ({"edges_fold_angle": np.zeros(9)}, "one assignment and angle for each edge"),
        ({"edges_vertices": np.array([[0, 8]] * 8)}, "edges_vertices refers to a vertex that"),
        ({"faces_vertices": np.array([[0, 1, 2, -2]] * 2)}, "faces_vertices refers to a vertex"),
        ({"grid": (3, 3)}, r"The grid \(3, 3\) does not have 8 vertices"),
    ],
)
def test_arrays_that_do_not_fit_are_refused_by_name(changes: dict[str, object], says: str) -> None:
    with pytest.raises(PatternError, match=says):
        two_squares(**changes)


def test_a_seam_between_two_facets_of_one_side_is_refused() -> None:
    edges = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [0, 2]])
    pattern = CreasePattern(
        vertices_coords=np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]),
        edges_vertices=edges,
        edges_assignment=np.full(5, "B"),
        edges_fold_angle=np.zeros(5),
        faces_vertices=np.array([[0, 1, 2], [0, 2, 3]]),
        seams=np.array([[0, 4]]),
    )
    with pytest.raises(PatternError, match="edges 0 and 4 does not join two borders"):
        _ = pattern.seam_vertices
