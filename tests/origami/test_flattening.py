"""Sheets unfolded from their folded form alone: their own flat pattern comes back, or why not."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from problems import fitted, regular

import miurafab as mf
from miurafab.errors import PatternError
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.formats.fold import fold_text, parse_fold, read_further_frames
from miurafab.origami.invariants import corner_angles


def form(points, faces, **keys) -> dict:
    """A FOLD document of a folded form alone."""
    return {
        "file_spec": 1.1,
        "frame_classes": ["foldedForm"],
        "vertices_coords": np.asarray(points).tolist(),
        "faces_vertices": [list(map(int, face)) for face in faces],
        **keys,
    }


def form_of(pattern: CreasePattern, *, decimals: int | None = None, **keys) -> dict:
    points = pattern.folded_coords
    points = points if decimals is None else points.round(decimals)
    faces = [face[face >= 0] for face in pattern.faces_vertices]
    return form(points, faces, edges_vertices=pattern.edges_vertices.tolist(), **keys)


def apart(points: np.ndarray) -> np.ndarray:
    return np.linalg.norm(points[:, None] - points[None], axis=2)


def curved() -> CreasePattern:
    found = fitted("hypar", 8, 8).pattern
    assert found is not None
    return found


@pytest.mark.parametrize("sheet", [regular, curved])
@pytest.mark.parametrize("letters", [True, False])
def test_the_flat_pattern_of_an_exact_sheet_comes_back(sheet, letters: bool) -> None:
    pattern = sheet()
    keys = {"edges_assignment": pattern.edges_assignment.tolist()} if letters else {}
    read = parse_fold(form_of(pattern, **keys))
    size = np.ptp(pattern.vertices_coords)
    assert np.abs(apart(read.vertices_coords) - apart(pattern.vertices_coords)).max() < 1e-11 * size
    assert read.edges_assignment.tolist() == pattern.edges_assignment.tolist()
    assert read.edges_fold_angle == pytest.approx(pattern.edges_fold_angle, abs=1e-9)
    assert [finding.code for finding in read.told] == ["unfolded"]
    audit = mf.check(read)
    assert audit.valid
    assert "unfolded" in [finding.code for finding in audit.findings]


def test_a_file_of_four_decimals_is_unfolded_to_its_digits(tmp_path) -> None:
    pattern = curved()
    read = parse_fold(form_of(pattern, decimals=4))
    error = np.abs(apart(read.vertices_coords) - apart(pattern.vertices_coords)).max()
    assert 1e-6 < error < 2e-3  # mm
    assert 1e-7 < read.unfolded < 1e-4
    assert mf.check(read).valid
    (tmp_path / "a.fold").write_text(fold_text(read))
    again = mf.load(tmp_path / "a.fold")
    assert again.unfolded == read.unfolded
    assert mf.check(again).valid
    assert mf.fold(again, steps=4).motion.frames.shape[0] == 5
    assert len(mf.sheets(again).layout.patches) >= 1
    # what is wrong by more than that is still found
    moved = again.folded_coords.copy()
    moved[10] += 0.05
    worse = json.loads(fold_text(again))
    worse["file_frames"][0]["vertices_coords"] = moved.tolist()
    assert not mf.check(parse_fold(worse)).valid


def test_evening_brings_the_sheet_nearer_to_its_folded_form(monkeypatch) -> None:
    document = form_of(regular(7, 7), decimals=3)
    usual = parse_fold(document).unfolded
    monkeypatch.setattr("miurafab.origami.flattening._ROUNDS", 1)
    assert parse_fold(document).unfolded > usual


def test_letters_tell_from_which_side_a_sheet_is_seen() -> None:
    """A ridge whose letter says valley is a valley seen from below."""
    points = [[0, 0, 0], [1, 0, 0], [1, 1, 0.4], [0, 1, 0]]
    keys = {
        "edges_vertices": [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2]],
        "edges_assignment": ["B", "B", "B", "B", "V"],
    }
    faces = [[0, 1, 2], [0, 2, 3]]
    valley = parse_fold(form(points, faces, **keys))
    assert valley.edges_assignment.tolist() == keys["edges_assignment"]
    assert mf.check(valley).valid
    keys["edges_assignment"][-1] = "U"
    ridge = parse_fold(form(points, faces, **keys))
    assert ridge.edges_assignment[-1] == "M"
    assert ridge.edges_fold_angle[-1] == pytest.approx(-valley.edges_fold_angle[-1])
    # facets that do not run the same way round are made to
    assert parse_fold(form(points, [[0, 1, 2], [3, 2, 0]], **keys)).edges_assignment[-1] == "M"


def test_a_sheet_that_is_folded_flat_takes_its_signs_from_the_file() -> None:
    points = [[0, 0], [1, 0], [0, 0], [0, 1]]  # a square folded over its diagonal
    faces = [[0, 1, 3], [1, 2, 3]]
    edges = [[0, 1], [1, 2], [2, 3], [3, 0], [3, 1]]
    read = parse_fold(form(points, faces, edges_vertices=edges, edges_assignment=list("BBBBM")))
    assert read.edges_assignment[-1] == "M"
    assert read.edges_fold_angle[-1] == -math.pi
    assert apart(read.vertices_coords).max() == pytest.approx(math.sqrt(2))
    audit = mf.check(read)
    assert audit.valid
    assert any("lie on each other" in finding.sentence for finding in audit.findings)
    assert not any("No facets meet" in sentence for sentence in audit.proved)
    for side, letter in ((1, "V"), (-1, "M")):
        orders = {"faceOrders": [[1, 0, side]], "edges_vertices": edges}
        assert parse_fold(form(points, faces, **orders)).edges_assignment[-1] == letter


def ring(count: int, height: float = 1.0, turned: bool = False):
    """A prism without ends: ``count`` quads in a ring."""
    angle = 2 * np.pi * np.arange(count) / count
    low = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    points = np.concatenate([low, low + np.array([0, 0, height])])
    after = (np.arange(count) + 1) % count
    if turned:
        faces = [(i, i + 1, count + i + 1, count + i) for i in range(count - 1)]
        faces.append((count - 1, count, 0, 2 * count - 1))
    else:
        faces = [(i, j, count + j, count + i) for i, j in zip(range(count), after, strict=True)]
    return points, faces


def test_a_ring_is_opened_and_that_is_told() -> None:
    read = parse_fold(form(*ring(7)))
    assert [finding.code for finding in read.told] == ["opened", "unfolded"]
    assert len(read.vertices_coords) == 16
    side = 2 * math.sin(math.pi / 7)
    assert sorted(np.ptp(read.vertices_coords, axis=0)) == pytest.approx([1.0, 7 * side])
    assert (read.edges_assignment == "B").sum() == 16
    folds = read.edges_fold_angle[read.edges_assignment == "M"]  # facets show their outer side
    assert folds == pytest.approx([-2 * np.pi / 7] * 6)
    assert mf.check(read).valid


def test_a_state_with_an_order_of_layers_and_no_class_is_a_folded_form() -> None:
    """Of eight such states of Line Folder, `check` said that facets lie turned over."""
    corners = [[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0], [0.5, 1]]
    state = {
        "vertices_coords": [[min(x, 1 - x), y] for x, y in corners],
        "faces_vertices": [[0, 4, 5, 3], [4, 1, 2, 5]],
        "faceOrders": [[1, 0, 1]],
    }
    read = parse_fold(state)
    assert [finding.code for finding in read.told] == ["unfolded"]
    assert np.ptp(read.vertices_coords, axis=0) == pytest.approx([1, 1])
    assert sorted(np.unique(read.edges_assignment)) in (["B", "M"], ["B", "V"])
    assert mf.check(read).valid
    assert not mf.check(parse_fold({**state, "faceOrders": []})).valid


def test_several_sheets_and_a_sheet_with_a_hole() -> None:
    square = np.array([[x, y, 0.0] for y in range(4) for x in range(4)])
    faces = [
        (i, i + 1, i + 5, i + 4) for i in (0, 1, 2, 4, 6, 8, 9, 10)
    ]  # without the one in the middle
    bent = square.copy()
    bent[:, 2] = np.maximum(0, bent[:, 0] - 1)
    bent[:, 0] = np.minimum(bent[:, 0], 1)
    read = parse_fold(form(np.concatenate([bent, bent + np.array([9, 0, 0])]),
                           faces + [tuple(v + 16 for v in face) for face in faces]))  # fmt: skip
    assert read.pieces_count == 2
    assert [finding.code for finding in read.told] == ["unfolded"]
    own = read.vertices_coords[:16]
    assert apart(own) == pytest.approx(apart(square), abs=1e-12)
    assert (np.abs(read.edges_fold_angle) > 1).sum() == 4
    assert mf.check(read).valid


@pytest.mark.parametrize(
    ("document", "words"),
    [
        (form([[0, 0, 0.5], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]],
              [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 1)]),
         r"vertex 0 add up to 313\.852 degrees"),
        (form([[0, 0, 0], [1, 0, 0], [1, 1, 0.4], [0, 1, 0]], [(0, 1, 2, 3)]), "is not flat"),
        (form(*ring(9, turned=True)), "with a twist|is not flat"),
        (form([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, -1, 0]],
              [(0, 1, 2), (0, 1, 3), (0, 1, 4)]), "3 facets meet at the edge of vertices 0 and 1"),
        (form([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [0, 1, 1]],
              [(0, 1, 3), (0, 1, 2), (0, 3, 4)]), "no area"),
        ({"vertices_coords": [[0, 0, 0], [1, 0, 0], [1, 1, 0.4], [0, 1, 0]],
          "edges_vertices": [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2]]}, "faces_vertices"),
        (form([[0, 0, 0], [1, 0, 0], [1, 1, 0.4]], [(0, 1, 3)]), "'faces_vertices' refers to a"),
        (form([[0, 0, 0], [1, 0, 0.4], [1, 1, 0]], [(0, 1, 2)], edges_vertices=[[0, 3]]),
         "'edges_vertices' refers to a vertex that does not exist"),
        (form([[0, 0, 0], [math.inf, 0, 0.4], [1, 1, 0], [0, 1, 0]], [(0, 1, 2, 3)]),
         "'vertices_coords' holds a coordinate that is not a finite number"),
    ],
)  # fmt: skip
def test_what_does_not_lie_flat_is_refused_by_how_much(document: dict, words: str) -> None:
    with pytest.raises(PatternError, match=words):
        parse_fold(document)


def test_a_net_is_cut_where_the_file_says() -> None:
    """A corner of a cube, which is not developable, lies flat once it is cut open."""
    points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]]
    faces = [(0, 3, 2, 1), (0, 1, 5, 4), (0, 4, 6, 3)]
    with pytest.raises(PatternError, match="add up to 270 degrees"):
        parse_fold(form(points, faces))
    edges = [[0, 3], [3, 2], [2, 1], [1, 0], [1, 5], [5, 4], [4, 0], [4, 6], [6, 3]]
    letters = list("UBBUBBCBB")
    read = parse_fold(form(points, faces, edges_vertices=edges, edges_assignment=letters))
    assert len(read.vertices_coords) == 8
    assert [finding.code for finding in read.told] == ["opened", "unfolded"]
    assert np.ptp(read.vertices_coords, axis=0) == pytest.approx([2, 2])
    assert mf.check(read).valid


L_SHAPE = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2), (2, 2), (3, 0), (3, 1), (3, 2)]
L_FACETS = [(0, 1, 2, 3, 4, 5), (3, 2, 6, 4), (1, 7, 8, 2), (2, 8, 9, 6)]


def folded_over(points: list[tuple[float, float]], angle: float) -> np.ndarray:
    """``points`` with what is right of x = 2 turned up by ``angle`` about that line."""
    x, y = np.array(points, dtype=np.float64).T
    over = np.maximum(x - 2, 0)
    return np.stack([x - over + over * math.cos(angle), y, over * math.sin(angle)], axis=1)


def test_a_facet_with_a_corner_of_more_than_half_a_turn_lies_flat() -> None:
    """An L and the square in its corner, and two squares that are folded up beside them: the angles
    around the corner of the L are 270 and 90 degrees."""
    read = parse_fold(form(folded_over(L_SHAPE, 1.0), L_FACETS))
    flat = np.pad(np.array(L_SHAPE, dtype=np.float64), ((0, 0), (0, 1)))
    assert np.abs(apart(read.vertices_coords) - apart(flat[:, :2])).max() < 1e-12
    assert mf.check(read).valid
    corners = corner_angles(read.folded_coords, read.faces_vertices)
    assert corners.max() == pytest.approx(1.5 * math.pi)
    # the square in the corner of the L does not fold: the two are one facet
    assert mf.check(read).measurements.quality.sector_angles[1] == pytest.approx(0.5 * math.pi)
    motion = mf.fold(read, steps=4)
    assert motion.report()["rigid"]
    assert motion.report()["max_strain"] < 1e-12


def test_a_dent_that_does_not_close_is_told_by_its_whole_angle() -> None:
    """A quad with a corner of 240 degrees and four triangles of 60: with 120 that made 360."""
    out = (3 + math.sqrt(6)) / (4 * math.sqrt(3))
    ahead = 1 - math.sqrt(3) * out
    side = math.sqrt(3) / 2
    points = [(0, 0, 0), (0.5, side, 0), (-3, 0, 0), (0.5, -side, 0)]
    points += [(ahead, -out, 0.5), (0, 0, 1), (ahead, out, 0.5)]
    faces = [(0, 1, 2, 3), (0, 3, 4), (0, 4, 5), (0, 5, 6), (0, 6, 1)]
    for a, b in ((3, 4), (4, 5), (5, 6), (6, 1)):
        assert np.dot(points[a], points[b]) == pytest.approx(0.5)
    with pytest.raises(PatternError, match="vertex 0 add up to 480 degrees"):
        parse_fold(form(points, faces))


def test_a_facet_that_begins_with_three_corners_in_line_is_not_flat_for_that() -> None:
    points = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0.5], [1, 2, 0], [0, 1, 0.5]]
    with pytest.raises(PatternError, match="Facet 0 is not flat"):
        parse_fold(form(points, [(0, 1, 2, 3, 4, 5)]))


def test_a_file_of_a_folded_form_alone_is_checked_and_has_no_further_frames(tmp_path) -> None:
    path = tmp_path / "alone.fold"
    path.write_text(json.dumps(form_of(regular(5, 5))))
    assert read_further_frames(path) == ()
    checked = mf.check(path)
    assert checked.valid, checked.findings
    assert checked.measurements.facets == 16
    assert not any("further frames" in sentence for sentence in checked.proved)
