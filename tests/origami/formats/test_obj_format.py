"""A pattern read from a flat and a folded OBJ file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from problems import fitted, regular

from miurafab.errors import PatternError
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.formats.obj import pattern_from_obj_pair
from miurafab.origami.verify import audit

DATA = Path(__file__).parents[2] / "data"


def obj(points: np.ndarray, faces: np.ndarray) -> str:
    places = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in points.tolist())
    corners = "".join(f"f {' '.join(str(v + 1) for v in f if v >= 0)}\n" for f in faces.tolist())
    return places + corners


def written(tmp_path: Path, pattern: CreasePattern, *, turned: bool = False) -> tuple[Path, Path]:
    flat = np.concatenate([pattern.vertices_coords, np.zeros((len(pattern.vertices_coords), 1))], 1)
    faces = pattern.faces_vertices[:, ::-1] if turned else pattern.faces_vertices
    paths = tmp_path / "flat.obj", tmp_path / "folded.obj"
    paths[0].write_text(obj(flat, faces))
    assert pattern.folded_coords is not None
    paths[1].write_text(obj(pattern.folded_coords, faces))
    return paths


@pytest.mark.parametrize("turned", [False, True])
def test_what_was_written_is_read_with_its_folds(tmp_path, turned):
    pattern = fitted("hypar").pattern
    read = pattern_from_obj_pair(*written(tmp_path, pattern, turned=turned))
    assert (read.vertices_coords == pattern.vertices_coords).all()
    assert (read.folded_coords == pattern.folded_coords).all()
    ends = [tuple(sorted(edge)) for edge in pattern.edges_vertices.tolist()]
    values = zip(pattern.edges_assignment, pattern.edges_fold_angle, strict=True)
    folds = dict(zip(ends, values, strict=True))
    for edge, letter, angle in zip(
        read.edges_vertices.tolist(), read.edges_assignment, read.edges_fold_angle, strict=True
    ):
        assert folds[tuple(edge)][0] == letter
        assert folds[tuple(edge)][1] == pytest.approx(angle, abs=1e-9)
    assert audit(read).valid


def test_the_flat_form_may_stand_in_any_plane_of_the_axes(tmp_path):
    pattern = regular()
    flat, folded = written(tmp_path, pattern)
    points = np.pad(pattern.vertices_coords, ((0, 0), (0, 1)), constant_values=1.0)
    for shift in (1, 2):
        flat.write_text(obj(np.roll(points, shift, axis=1), pattern.faces_vertices))
        assert audit(pattern_from_obj_pair(flat, folded)).valid


def test_the_published_pair_is_developable_and_cannot_be_made():
    """Residuals as the files give them: planarity 1.2e-13, developability 2.7e-15 rad, edges equal
    to 2.2e-8 of their length; two edges have no length."""
    pattern = pattern_from_obj_pair(DATA / "peaks_coarse_flat.obj", DATA / "peaks_coarse_fold.obj")
    result = audit(pattern)
    measured = result.measurements
    assert (measured.facets, measured.vertices) == (1320, 1394)
    assert measured.max_planarity < 1e-12
    assert measured.max_developability < 1e-14
    assert measured.max_isometry < 1e-7
    assert measured.min_edge_mm < 1e-15
    assert measured.self_intersections == 0
    assert measured.overlaps == 0
    found = {finding.code: finding for finding in result.findings}
    assert set(found) == {"bow-tie", "degenerate-edge", "isometry"}
    edges = pattern.edges_vertices[list(found["degenerate-edge"].where)]
    assert edges.tolist() == [[1364, 1365], [1381, 1382]]
    assert "cannot be made" in found["degenerate-edge"].sentence


@pytest.mark.parametrize(
    ("flat", "folded", "words"),
    [
        ("", None, "holds no vertices"),
        ("v 0 0 0\n", None, "holds no facets"),
        ("v 0 0\nf 1 1 1\n", None, r"line 1: 'v 0 0' cannot be read"),
        ("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", None, "not a finite number"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", None, "does not exist"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0\n", None, "line 4"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 1\nv 1 1 0\nf 1 2 3\nf 2 4 3\n", None, "is not flat"),
        (
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 1 0\nf 1 2 3\n",
            "one mesh in two forms",
        ),
        (
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 3 2\n",
            "same facets in the same order",
        ),
    ],
)
def test_one_sentence_for_each_fault(tmp_path, flat, folded, words):
    first, second = tmp_path / "a.obj", tmp_path / "b.obj"
    first.write_text(flat)
    second.write_text(flat if folded is None else folded)
    with pytest.raises(PatternError, match=words):
        pattern_from_obj_pair(first, second)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(PatternError, match=r"nowhere\.obj does not exist"):
        pattern_from_obj_pair(tmp_path / "nowhere.obj", tmp_path / "nowhere.obj")
    (tmp_path / "picture.obj").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(PatternError, match="not UTF-8"):
        pattern_from_obj_pair(tmp_path / "picture.obj", tmp_path / "picture.obj")


def test_slashes_and_negative_indices_are_read(tmp_path):
    text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nf -4/1 -3/1/1 3//2 4 # quad\n"
    path = tmp_path / "quad.obj"
    path.write_text(text)
    assert pattern_from_obj_pair(path, path).faces_vertices.tolist() == [[0, 1, 2, 3]]
