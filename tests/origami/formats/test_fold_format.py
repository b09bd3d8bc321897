"""FOLD files: what we write is read back bit for bit, and what others write is understood."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from named_patterns import waterbomb_base
from piece_problems import gores, trimmed, two_pieces, two_trimmed_pieces
from problems import CELL, fitted, regular

from miurafab.errors import PatternError
from miurafab.geometry.quads import QuadCharts
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.kinematics import rigid_motion, states_between
from miurafab.origami.formats.files import load
from miurafab.origami.formats.fold import fold_text, parse_fold, read_fold, write_fold
from miurafab.origami.miura import regular_miura
from miurafab.origami.unfold import unfold_charts
from miurafab.workflow.layers import layers
from miurafab.workflow.patterns import check


def document(pattern: CreasePattern | None = None) -> dict[str, Any]:
    loaded: dict[str, Any] = json.loads(fold_text(pattern or regular(4, 3)))
    return loaded


def same(one: CreasePattern, other: CreasePattern) -> bool:
    assert one.folded_coords is not None
    assert other.folded_coords is not None
    return (
        np.array_equal(one.vertices_coords, other.vertices_coords)
        and np.array_equal(one.folded_coords, other.folded_coords)
        and np.array_equal(one.edges_vertices, other.edges_vertices)
        and np.array_equal(one.edges_assignment, other.edges_assignment)
        and np.array_equal(one.faces_vertices, other.faces_vertices)
        and bool(np.abs(one.edges_fold_angle - other.edges_fold_angle).max() < 1e-14)
        and one.grid == other.grid
        and all(
            np.array_equal(getattr(one, name), getattr(other, name))
            for name in ("pieces", "seams", "cells")
        )
        and one.target == other.target
        and one.scale == other.scale
    )


def test_a_fitted_sheet_is_read_back_as_it_was(tmp_path: Path) -> None:
    pattern = fitted("hypar").pattern
    assert pattern is not None
    write_fold(pattern, tmp_path / "one.fold", "a hypar")
    again = read_fold(tmp_path / "one.fold")
    assert same(pattern, again)
    write_fold(again, tmp_path / "two.fold", "a hypar")
    first = json.loads((tmp_path / "one.fold").read_text())
    second = json.loads((tmp_path / "two.fold").read_text())
    assert {k: v for k, v in first.items() if k != "edges_foldAngle"} == {
        k: v for k, v in second.items() if k != "edges_foldAngle"
    }


@pytest.mark.parametrize("make", [two_pieces, gores, trimmed, two_trimmed_pieces])
def test_pieces_and_trimmed_facets_are_read_back_as_they_were(make: Any) -> None:
    pattern = make()
    written = json.loads(fold_text(pattern))
    assert same(parse_fold(written), pattern)
    assert "miurafab:grid" not in written
    assert len(written["miurafab:cells"]) == len(written["faces_vertices"])
    assert ("miurafab:pieces" in written) == (pattern.pieces_count > 1)


@settings(max_examples=30)
@given(
    kept=st.integers(0, 2**20 - 1).map(lambda bits: [bits >> n & 1 for n in range(20)]),
    after=st.integers(1, 4),
)
def test_any_cells_in_any_pieces_are_read_back(kept: list[int], after: int) -> None:
    cells = np.array(kept, dtype=bool).reshape(4, 5)
    cells[0, 0] = True
    charts = QuadCharts.of_cells(cells, (np.arange(5) >= after).astype(np.int64))
    used = np.unique(QuadCharts.of_cells(np.ones((4, 5), dtype=bool)).faces_vertices[cells.ravel()])
    pattern = unfold_charts(charts, regular_miura(CELL, 6, 5).vertices[used])
    assert same(parse_fold(json.loads(fold_text(pattern))), pattern)


def test_parts_that_do_not_touch_are_pieces_in_the_file_of_another_program() -> None:
    written = json.loads(fold_text(two_pieces()))
    del written["miurafab:pieces"], written["miurafab:seams"], written["miurafab:cells"]
    found = parse_fold(written)
    assert np.array_equal(found.pieces, two_pieces().pieces)
    assert found.seams is None


def test_the_frames_of_a_motion_follow_the_folded_form() -> None:
    pattern = regular(4, 3)
    motion = rigid_motion(pattern, states_between(pattern, 5))
    written = json.loads(fold_text(pattern, motion=motion))
    assert written["file_classes"] == ["singleModel", "animation"]
    frames = written["file_frames"]
    assert len(frames) == 7
    assert frames[0]["vertices_coords"] == pattern.folded_coords.tolist()
    for frame, points, angles in zip(frames[1:], motion.frames, motion.fold_angles, strict=True):
        assert frame["frame_parent"] == 0
        assert frame["frame_inherit"] is True
        assert frame["vertices_coords"] == points.tolist()
        assert frame["edges_foldAngle"] == np.degrees(angles).tolist()
    assert same(parse_fold(written), pattern)


@given(unit=st.sampled_from([("cm", 10.0), ("in", 25.4), ("m", 1000.0), ("unit", 1.0)]))
def test_units_are_turned_into_millimetres(unit: tuple[str, float]) -> None:
    given_ = document() | {"frame_unit": unit[0]}
    given_["file_frames"][0]["frame_unit"] = unit[0]
    found, expected = parse_fold(given_), regular(4, 3)
    assert found.vertices_coords == pytest.approx(expected.vertices_coords * unit[1])
    assert found.folded_coords == pytest.approx(expected.folded_coords * unit[1])


def test_clockwise_facets_are_turned_round() -> None:
    given_ = document()
    given_["faces_vertices"] = [face[::-1] for face in given_["faces_vertices"]]
    found = parse_fold(given_)
    assert {frozenset(face) for face in found.faces_vertices.tolist()} == {
        frozenset(face) for face in regular(4, 3).faces_vertices.tolist()
    }
    assert np.array_equal(
        np.sort(found.edges_faces, axis=1), np.sort(regular(4, 3).edges_faces, axis=1)
    )


def test_missing_facets_are_walked_from_the_edges() -> None:
    given_ = document()
    del given_["faces_vertices"]
    found = parse_fold(given_)
    assert {frozenset(face) for face in found.faces_vertices.tolist()} == {
        frozenset(face) for face in regular(4, 3).faces_vertices.tolist()
    }


def test_missing_angles_are_measured_in_the_folded_form() -> None:
    given_ = document()
    del given_["edges_foldAngle"]
    given_["edges_assignment"] = ["U"] * len(given_["edges_vertices"])
    found, expected = parse_fold(given_), regular(4, 3)
    assert np.abs(found.edges_fold_angle - expected.edges_fold_angle).max() < 1e-12
    assert np.array_equal(found.edges_assignment, expected.edges_assignment)


def test_a_form_that_is_folded_flat_leaves_the_letters_as_they_are() -> None:
    """Half a turn to either side is the same form; the letters of the file tell which."""
    sheet = regular(4, 3)
    given_ = document()
    del given_["edges_foldAngle"]
    flat = rigid_motion(sheet, [np.inf]).frames[0]
    given_["file_frames"] = [
        {**given_["file_frames"][0], "vertices_coords": flat.tolist()},
    ]
    found = parse_fold(given_)
    assert np.array_equal(found.edges_assignment, sheet.edges_assignment)
    assert {"M", "V"} <= set(found.edges_assignment.tolist())
    half = np.isin(sheet.edges_assignment, ("M", "V"))
    wanted = np.pi * np.sign(sheet.edges_fold_angle[half])
    assert found.edges_fold_angle[half] == pytest.approx(wanted, abs=1e-6)


def test_the_crease_pattern_may_stand_in_a_later_frame() -> None:
    given_ = document()
    flat = given_["vertices_coords"]
    folded = given_["file_frames"][0]["vertices_coords"]
    turned = {
        **given_,
        "frame_classes": ["foldedForm"],
        "vertices_coords": folded,
        "file_frames": [
            {
                "frame_classes": ["creasePattern"],
                "frame_inherit": True,
                "frame_parent": 0,
                "vertices_coords": flat,
            }
        ],
    }
    assert same(parse_fold(turned), regular(4, 3))


def test_mixed_polygons_are_padded() -> None:
    given_ = {
        "vertices_coords": [[0, 0], [2, 0], [2, 2], [0, 2], [3, 1]],
        "edges_vertices": [[0, 1], [1, 2], [2, 3], [3, 0], [1, 4], [4, 2]],
        "edges_assignment": ["B", "V", "B", "B", "B", "B"],
        "faces_vertices": [[0, 1, 2, 3], [2, 4, 1]],
    }
    found = parse_fold(given_)
    assert found.faces_vertices.tolist() == [[0, 1, 2, 3], [1, 4, 2, -1]]
    assert found.edges_fold_angle[1] == np.pi


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"edges_vertices": []}, "'edges_vertices' is missing"),
        ({"edges_assignment": ["B"]}, "one letter for each edge"),
        ({"edges_assignment": ["Q"] * 17}, "'Q'"),
        ({"edges_foldAngle": ["x"] * 17}, "not a number"),
        ({"vertices_coords": [[0, 0, 1], [1, 2, 3]]}, "does not exist"),
        ({"vertices_coords": [[0, 0], [1]]}, "equal dimension"),
        ({"faces_vertices": [[0, 1]]}, "fewer than three"),
        ({"faces_vertices": [[0, 1, 99]]}, "does not exist"),
        ({"faces_vertices": [[0, 1, 2.5]]}, "whole numbers"),
        ({"file_frames": [3]}, "not a list of objects"),
        ({"file_frames": [{"frame_inherit": True, "frame_parent": 7}]}, "inherits 7"),
        ({"miurafab:grid": [3, 3]}, "miurafab:grid"),
        ({"miurafab:scale": -1}, "miurafab:scale"),
        ({"miurafab:scale": 1e308}, "not a number from 1e-12"),
        ({"miurafab:pieces": [0]}, "one number for each facet"),
        ({"miurafab:pieces": 3}, "'miurafab:pieces' is not a list of whole numbers"),
        ({"miurafab:pieces": [0.5] * 6}, "'miurafab:pieces' is not a list of whole numbers"),
        ({"miurafab:pieces": [0, 0, 0, 0, 0, 1]}, "facets of two pieces"),
        ({"miurafab:seams": [[0, 1, 2]]}, "'miurafab:seams' is not a list of 2 whole numbers"),
        ({"miurafab:seams": [[0], [1, 2]]}, "'miurafab:seams' is not a list of 2 whole numbers"),
        ({"miurafab:seams": [[0, 17]]}, "edge that does not exist"),
        ({"miurafab:seams": [[0, 4]]}, "Edge 4 is in a seam and is no border"),
        ({"miurafab:cells": [[0, 0]]}, "one column and row for each facet"),
        ({"edges_vertices": [[0, -1]]}, "'edges_vertices' holds a negative vertex"),
        ({"faces_vertices": [[0, 1, 2], [0, 1, 2, "a"]]}, "that is not a vertex number"),
        ({"faces_vertices": [[0, 1, 2], [0, 1, 2, True]]}, "that is not a vertex number"),
        ({"miurafab:unfolded": True}, "'miurafab:unfolded' is not a number"),
        ({"miurafab:unfolded": 5}, "'miurafab:unfolded' is 5; it is from 0 to "),
        ({"miurafab:unfolded": -1e-9}, "'miurafab:unfolded' is -1e-09; it is from 0 to "),
        ({"miurafab:target": [1]}, "'miurafab:target' is not an object"),
        ({"miurafab:target": {"origin": [1, 2]}}, "'miurafab:target' is damaged: "),
        ({"miurafab:target": {"origin": [np.inf, 0, 0]}}, "origin is not three finite numbers"),
        ({"miurafab:target": {"a": [1.0, {"b": np.nan}]}}, "damaged: it holds nan"),
        ({"miurafab:target": {"a": ["\x1b[31m"]}}, "damaged: .* holds control characters"),
        ({"miurafab:target": {"\x07": 1}}, "damaged: .* holds control characters"),
        (
            {"file_frames": [{"frame_classes": ["foldedForm"], "vertices_coords": [[0, 0, 0]]}]},
            "The folded form has 1 vertices and the pattern 12",
        ),
    ],
)
def test_a_fault_is_named(change: dict[str, Any], words: str) -> None:
    with pytest.raises(PatternError, match=words):
        parse_fold(document() | change)


def test_a_file_that_is_no_fold_file_is_named(tmp_path: Path) -> None:
    for content, words in ((b"[1, 2]", "one JSON object"), (b"{", "line 1"), (b"\xff", "UTF-8")):
        path = tmp_path / "bad.fold"
        path.write_bytes(content)
        with pytest.raises(PatternError, match=words) as fault:
            read_fold(path)
        assert "bad.fold" in str(fault.value)
    with pytest.raises(PatternError, match="does not exist"):
        read_fold(tmp_path / "none.fold")


def test_the_same_pattern_gives_the_same_bytes() -> None:
    assert fold_text(regular(4, 3)) == fold_text(replace(regular(4, 3)))


def test_any_value_in_any_place_is_read_or_refused_in_a_sentence() -> None:
    values = [None, [], {}, "x", -1, 1e400, [1], [[1, 2]], 3.5, True, [None], [[None, None]], "M"]
    random = Random(1)
    text = fold_text(two_pieces(5, 3, 2))
    refused = []
    for _ in range(600):
        damaged = json.loads(text)
        key = random.choice(list(damaged))
        if random.random() < 0.5 or not isinstance(damaged[key], list):
            damaged[key] = random.choice(values)
        else:
            damaged[key][random.randrange(len(damaged[key]))] = random.choice(values)
        try:
            assert len(parse_fold(damaged).edges_faces)
        except PatternError as fault:
            refused.append(str(fault))
    assert all(sentence.endswith(".") for sentence in refused)


def test_an_angle_that_is_null_is_that_of_the_folded_form() -> None:
    """It was taken as half a turn, and a check said that the file gave it so."""
    square = [[0, 0], [1, 0], [1, 1], [0, 1]]
    document = {
        "file_spec": 1.2,
        "frame_classes": ["creasePattern"],
        "vertices_coords": square,
        "edges_vertices": [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2]],
        "edges_assignment": ["B", "B", "B", "B", "M"],
        "edges_foldAngle": [0, 0, 0, 0, None],
        "faces_vertices": [[0, 1, 2], [0, 2, 3]],
    }
    assert parse_fold(document).edges_fold_angle[4] == -np.pi
    corner = [0.5, 0.5, 0.5**0.5]  # turned up by a right angle about the diagonal
    form = {"frame_classes": ["foldedForm"], "vertices_coords": [[*p, 0] for p in square[:3]]}
    form["vertices_coords"].append(corner)
    found = parse_fold({**document, "file_frames": [{**document, **form}]})
    assert np.degrees(found.edges_fold_angle) == pytest.approx([0, 0, 0, 0, 90])
    assert found.edges_assignment.tolist() == [*"BBBB", "V"]
    given = {**document, "edges_foldAngle": [0, 0, 0, 0, 90]}
    kept = parse_fold({**given, "file_frames": [{**document, **form}]})
    assert kept.edges_assignment[4] == "M"  # as the file says, which a check finds


def test_folds_that_are_all_given_as_0_degrees_fold_by_their_letters(tmp_path: Path) -> None:
    """A check called every crease a valley, the layers were those of the unfolded sheet, and
    nothing folded.
    """
    known = json.loads(fold_text(waterbomb_base()))
    still = {**known, "edges_foldAngle": [0] * len(known["edges_vertices"])}
    del known["edges_foldAngle"]
    files = [tmp_path / "still.fold", tmp_path / "known.fold"]
    for file, content in zip(files, (still, known), strict=True):
        file.write_text(json.dumps(content))
    found, meant = map(load, files)
    assert np.array_equal(found.edges_fold_angle, meant.edges_fold_angle)
    assert found.angles_assumed
    said = [each.sentence for each in check(files[0]).findings]
    assert said[0] == (
        "The file gives no fold an angle but 0 degrees, so no size is known: mountains and valleys "
        "are taken to fold by 180."
    )
    assert not [sentence for sentence in said if "fold flat" in sentence]
    order, other = (layers(file).order for file in files)
    assert order is not None
    assert other is not None
    assert order.known
    assert np.array_equal(order.above, other.above)
    half = {**still, "edges_foldAngle": [0.0] * len(still["edges_vertices"])}
    half["edges_foldAngle"][half["edges_assignment"].index("M")] = -10.0
    assert np.degrees(parse_fold(half).edges_fold_angle) == pytest.approx(half["edges_foldAngle"])


@pytest.mark.parametrize(("given", "told"), [(0, True), (None, False)])
def test_what_a_file_gives_no_size_of_is_told_where_it_gives_0(
    given: int | None, told: bool
) -> None:
    """In lines that cross, of which facets are yet to be made, as where the file has them. An angle
    that is null is none, as where there are no angles.
    """
    file = {
        "vertices_coords": [[0, 0], [4, 0], [4, 4], [0, 4], [0, 2], [4, 2], [2, 0], [2, 4]],
        "edges_vertices": [[0, 6], [6, 1], [1, 5], [5, 2], [2, 7], [7, 3], [3, 4], [4, 0]],
        "edges_assignment": [*"BBBBBBBB", "V", "M"],
        "edges_foldAngle": [0] * 8 + [given] * 2,
    }
    file["edges_vertices"] += [[4, 5], [6, 7]]
    drawing = parse_fold(file)
    assert len(drawing.faces_vertices) == 4
    sheet = json.loads(fold_text(drawing))
    del sheet["miurafab:angles"]
    sheet["edges_foldAngle"] = [given] * len(sheet["edges_vertices"])
    for found in (drawing, parse_fold(sheet)):
        folds = np.isin(found.edges_assignment, ("M", "V"))
        assert np.abs(np.degrees(found.edges_fold_angle[folds])) == pytest.approx([180] * 4)
        assert [each.code for each in found.told] == ["not-proven"] * told
