"""Patterns in any plane are laid into that of x and y, with the side that their facets show up."""

from __future__ import annotations

import named_patterns
import numpy as np
import pytest

from miurafab.errors import PatternError
from miurafab.geometry.polygons import signed_areas
from miurafab.origami.formats.any_plane import laid_in_plane
from miurafab.origami.formats.fold import parse_fold

SEEDS = range(4)


def document(points: np.ndarray, faces: list[list[int]]) -> dict:
    pattern = named_patterns.waterbomb_base()
    return {
        "file_spec": 1.1,
        "frame_classes": ["creasePattern"],
        "vertices_coords": points.tolist(),
        "edges_vertices": pattern.edges_vertices.tolist(),
        "edges_assignment": pattern.edges_assignment.tolist(),
        "faces_vertices": faces,
    }


@pytest.mark.parametrize("seed", SEEDS)
def test_a_pattern_in_any_plane_keeps_its_lengths_and_its_upper_side(seed: int) -> None:
    pattern = named_patterns.waterbomb_base()
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    flat = pattern.vertices_coords
    points = np.pad(flat, ((0, 0), (0, 1))) @ turn.T + [1.0, 2.0, 3.0]
    read = parse_fold(document(points, pattern.faces_vertices.tolist()))
    assert signed_areas(read.vertices_coords[read.faces_vertices]) == pytest.approx(
        signed_areas(flat[pattern.faces_vertices])
    )
    apart = np.linalg.norm(flat[:, None] - flat[None], axis=2)
    got = read.vertices_coords
    assert np.linalg.norm(got[:, None] - got[None], axis=2) == pytest.approx(apart, abs=1e-9)
    assert read.folded_coords is None


def test_a_pattern_in_the_plane_of_x_and_z_keeps_its_axes() -> None:
    """Facets that run counter-clockwise seen against y: x stays x, and z becomes y."""
    flat = named_patterns.waterbomb_base().vertices_coords
    points = np.column_stack([flat[:, 0], np.zeros(len(flat)), flat[:, 1]])
    faces = named_patterns.waterbomb_base().faces_vertices.tolist()
    assert laid_in_plane(points, faces) == pytest.approx(flat)


@pytest.mark.parametrize("faces", [None, [], [7], [["a", 1, 2]], [[0, 1, 99]]])
def test_facets_that_tell_no_side_leave_the_upper_one_up(faces: object) -> None:
    pattern = named_patterns.waterbomb_base()
    points = np.column_stack([pattern.vertices_coords, 0.5 * pattern.vertices_coords[:, 0]])
    laid = laid_in_plane(points, faces)
    assert laid is not None
    shown = signed_areas(pattern.vertices_coords[pattern.faces_vertices])
    assert signed_areas(laid[pattern.faces_vertices]) == pytest.approx(np.sqrt(1.25) * shown)


def test_what_is_in_no_plane_is_no_flat_pattern() -> None:
    pattern = named_patterns.waterbomb_base()
    bent = np.pad(pattern.vertices_coords, ((0, 0), (0, 1)))
    bent[0, 2] = 1.0
    assert laid_in_plane(bent) is None
    with pytest.raises(PatternError, match="not developable at 1 of 1"):
        parse_fold(document(bent, pattern.faces_vertices.tolist()))
