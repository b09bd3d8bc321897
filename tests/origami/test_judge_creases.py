"""Each way in which a pattern contradicts itself is found, and named by its edge or facet."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from piece_problems import gores, trimmed, two_trimmed_pieces
from problems import fitted, regular, saddle_mesh

import miurafab as mf
from miurafab.errors import PatternError
from miurafab.findings import refusals
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.flat_folding import judge_flat_folding, vertex_folds
from miurafab.origami.formats.fold import fold_text, parse_fold
from miurafab.origami.formats.lines import parse_cp
from miurafab.origami.formats.planar_graph import pattern_from_lines
from miurafab.origami.verify import audit

WHOLE = {"grid": regular(), "trimmed": trimmed(), "gores": gores(), "both": two_trimmed_pieces()}


def found(pattern: CreasePattern) -> dict[str, tuple]:
    return {each.code: each.where for each in refusals(audit(pattern).findings)}


def document(pattern: CreasePattern) -> dict:
    return json.loads(fold_text(pattern))


def creases(pattern: CreasePattern) -> np.ndarray:
    return np.flatnonzero((pattern.edges_faces >= 0).all(axis=1))


def with_letter(pattern: CreasePattern, edge: int, letter: str) -> CreasePattern:
    letters = pattern.edges_assignment.copy()
    letters[edge] = letter
    return replace(pattern, edges_assignment=letters)


@pytest.mark.parametrize("name", WHOLE)
def test_each_other_letter_of_a_crease_is_a_fault_of_that_edge(name):
    pattern = WHOLE[name]
    assert found(pattern) == {}
    for edge in creases(pattern)[::7].tolist():
        for letter in set("BMVFUCJ") - {pattern.edges_assignment[edge]}:
            assert found(with_letter(pattern, edge, letter)) == {"assignment": (edge,)}
    border = int(np.flatnonzero(pattern.edges_assignment == "B")[3])
    if pattern.seams is None or border not in pattern.seams:
        for letter in "MVFUCJ":
            assert found(with_letter(pattern, border, letter)) == {"assignment": (border,)}


@pytest.mark.parametrize("change", [1e-6, -1e-6, 0.1])
def test_a_fold_angle_that_is_not_that_of_the_folded_form_is_named(change):
    pattern = regular()
    edge = int(creases(pattern)[20])
    angles = pattern.edges_fold_angle.copy()
    angles[edge] += change
    assert found(replace(pattern, edges_fold_angle=angles)) == {"fold-angle": (edge,)}
    flat = replace(pattern, edges_fold_angle=0 * angles)
    assert set(found(flat)["fold-angle"]) == set(creases(pattern).tolist())


def test_a_crease_of_both_the_wrong_letter_and_angle_is_told_from_the_folded_form():
    pattern = regular()
    edge = int(creases(pattern)[20])
    letters, angles = pattern.edges_assignment.copy(), pattern.edges_fold_angle.copy()
    letters[edge] = "V" if letters[edge] == "M" else "M"
    angles[edge] *= -1
    wrong = replace(pattern, edges_assignment=letters, edges_fold_angle=angles)
    assert found(wrong) == {"assignment": (edge,), "fold-angle": (edge,)}


def test_letters_and_angles_that_contradict_each_other_need_no_folded_form():
    pattern = replace(regular(), folded_coords=None)
    edge = int(creases(pattern)[20])
    angles = pattern.edges_fold_angle.copy()
    angles[edge] *= -1
    assert found(replace(pattern, edges_fold_angle=angles))["assignment"] == (edge,)
    # What closes at no vertex around it is said even where letter and angle agree.
    angles[edge] = pattern.edges_fold_angle[edge] + math.copysign(0.01, -angles[edge])
    assert "closure" in found(replace(pattern, edges_fold_angle=angles))


@pytest.mark.parametrize("name", WHOLE)
def test_a_facet_that_is_missing_is_found(name):
    pattern = WHOLE[name]
    for lost in (0, 13):
        file = document(pattern)
        del file["faces_vertices"][lost]
        for key in ("miurafab:cells", "miurafab:pieces"):
            if key in file:
                del file[key][lost]
        file.pop("miurafab:seams", None)
        assert {"facets", "assignment"} & set(found(parse_fold(file)))


def test_a_facet_that_is_there_twice_or_has_a_wrong_corner_is_named():
    file = document(regular())
    twice = file | {"faces_vertices": [*file["faces_vertices"], file["faces_vertices"][5]]}
    with pytest.raises(PatternError, match=r"Facets 5 and 48 lie on the same side of edge \d+"):
        parse_fold(twice)
    faces = [list(face) for face in file["faces_vertices"]]
    faces[5][0] = 40
    with pytest.raises(PatternError, match="side of facet 5 is not among edges_vertices"):
        parse_fold(file | {"faces_vertices": faces})


def test_an_edge_that_is_there_twice_is_named_with_its_letters():
    file = document(regular())
    edge = 30
    file["edges_vertices"].append(file["edges_vertices"][edge][::-1])
    file["edges_assignment"].append("V" if file["edges_assignment"][edge] == "M" else "M")
    file["edges_foldAngle"].append(-file["edges_foldAngle"][edge])
    pattern = parse_fold(file)
    last = len(pattern.edges_vertices) - 1
    assert found(pattern)["double-edge"] in {(edge,), (last,)}


def test_a_grid_that_is_not_that_of_the_facets_is_found():
    file = document(regular())
    assert file["miurafab:grid"] == [9, 7]
    assert "facets" in found(parse_fold(file | {"miurafab:grid": [7, 9]}))
    with pytest.raises(PatternError, match="grid"):
        parse_fold(file | {"miurafab:grid": [9, 8]})
    file = document(trimmed())
    file["miurafab:cells"][20][0] += 2
    assert "facets" in found(parse_fold(file))


def test_a_facet_turned_over_is_read_and_found():
    """A file that a fit could write: neighbours agree, and one facet lies on its face."""
    flat = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.4, 0.1], [0.4, 0.9]], dtype=float)
    pattern = {
        "vertices_coords": (10 * flat).tolist(),
        "edges_vertices": [[0, 1], [1, 2], [2, 3], [3, 0], [1, 4], [4, 5], [5, 2]],
        "edges_assignment": ["B", "V", "B", "B", "B", "B", "B"],
        "faces_vertices": [[0, 1, 2, 3], [1, 4, 5, 2]],
    }
    assert found(parse_fold(pattern))["turned-over"] == (1,)


def test_a_hole_of_border_edges_is_no_facet():
    outer, inner = [[0, 0], [3, 0], [3, 3], [0, 3]], [[1, 1], [2, 1], [2, 2], [1, 2]]
    ring = [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4]]
    pattern = parse_fold(
        {
            "vertices_coords": outer + inner,
            "edges_vertices": [*ring, [0, 4], [1, 5], [2, 6], [3, 7]],
            "edges_assignment": ["B"] * 8 + ["M", "V", "M", "V"],
        }
    )
    assert len(pattern.faces_vertices) == 4
    assert found(pattern) == {}


def star(letters: str, sectors: list[float], angle: float | None = None) -> CreasePattern:
    """One vertex amid creases of these letters, with the sectors (degrees) after each."""
    turn = np.radians(np.cumsum([0, *sectors[:-1]]))
    count = len(letters)
    points = 10 * np.vstack([[0, 0], np.stack([np.cos(turn), np.sin(turn)], axis=1)])
    rim = [[n + 1, (n + 1) % count + 1] for n in range(count)]
    file = {
        "vertices_coords": points.tolist(),
        "edges_vertices": [*([0, n + 1] for n in range(count)), *rim],
        "edges_assignment": [*letters, *"B" * count],
        "faces_vertices": [[0, *side] for side in rim],
    }
    if angle is not None:
        sign = {"M": -angle, "V": angle}
        file["edges_foldAngle"] = [sign.get(each, 0) for each in file["edges_assignment"]]
    return parse_fold(file)


SIX = [45, 45, 90, 45, 45, 90]


@pytest.mark.parametrize(
    ("letters", "sectors", "why"),
    [
        ("VMVVMV", SIX, None),  # the waterbomb base
        ("MMMV", [111.8, 56.9, 112.6, 78.7], "Kawasaki"),
        ("MMMVV", [72] * 5, "even number"),
        ("MVMV", [90] * 4, "Maekawa"),
        ("MMMV", [90] * 4, None),
        ("MMMV", [100, 60, 80, 120], "big-little-big"),  # the 60 degrees lie between M and M
        ("MVMM", [100, 60, 80, 120], None),
        ("MMVVVV", SIX, "big-little-big"),  # V V V beside the equal pair
        ("VMFVV", [100, 30, 30, 80, 120], None),  # a flat crease parts no sector
    ],
)
def test_a_vertex_that_cannot_fold_flat_says_which_condition_it_breaks(letters, sectors, why):
    told = {each.code: str(each) for each in judge_flat_folding(star(letters, sectors))}
    assert told.keys() == ({"flat-folding"} if why else set())
    assert why is None or why in told["flat-folding"]


def test_flat_folding_is_a_note_where_folds_are_not_stated_as_180_degrees():
    codes = {each.code for each in judge_flat_folding(star("MVMV", [90] * 4, 120.0))}
    assert codes == {"not-flat-foldable", "not-proven"}
    assumed = replace(star("MVMV", [90] * 4), angles_assumed=True)
    assert {each.code for each in judge_flat_folding(assumed)} == {"not-flat-foldable"}
    (said,) = judge_flat_folding(star("MUMV", [90] * 4))
    assert said.code == "not-proven"
    assert said.sentence.startswith("1 interior vertex is not judged: a crease there is unassigned")


def test_the_rotations_around_each_vertex_of_a_folded_sheet_close():
    folds, left_out = vertex_folds(fitted("hypar").pattern)
    assert left_out == 0
    assert max(each.gap for each in folds) < 1e-9
    assert max(each.kawasaki for each in folds) > 1e-3
    # Folded flat, the gap is twice the residual of Kawasaki's theorem.
    flat = vertex_folds(star("MMMV", [100, 60, 75, 125]))[0][0]
    assert flat.gap == pytest.approx(2 * flat.kawasaki)


@pytest.mark.parametrize(
    ("change", "codes"),
    [
        (lambda file: None, set()),
        (lambda file: file["miurafab:target"].update(mesh="elsewhere.stl"), set()),
        (lambda file: file.pop("miurafab:target_sha256"), {"not-proven"}),
        (
            lambda file: file.update({"miurafab:scale": 1.000001 * file["miurafab:scale"]}),
            {"scale"},
        ),
        (lambda file: file["miurafab:target"]["parameters"].update(height=0.6), {"scale"}),
    ],
)
def test_a_target_that_is_not_the_one_of_the_fit_is_found(tmp_path, change, codes):
    path = tmp_path / "a.fold"
    fitted("hypar", 6, 6).pattern.save(path)
    file = json.loads(path.read_text())
    change(file)
    path.write_text(json.dumps(file))
    findings = audit(parse_fold(json.loads(path.read_text()))).findings
    assert {each.code for each in findings} & {"scale", "not-proven"} == codes


def test_nothing_is_made_of_a_pattern_that_contradicts_itself(tmp_path):
    pattern = fitted("hypar").pattern
    flat = np.where(pattern.edges_assignment == "B", "B", "F")
    replace(pattern, edges_assignment=flat).save(tmp_path / "bad.fold")
    for make in (mf.sheets, mf.fold, mf.energy, lambda file: mf.convert(file, tmp_path / "a.svg")):
        with pytest.raises(PatternError, match=r"bad\.fold does not hold.*Edge \d+ is F"):
            make(tmp_path / "bad.fold")


def test_an_outline_that_runs_along_a_crease_and_back_leaves_it_a_crease(tmp_path):
    """On this mesh the parts of a crease were borders, between two facets that fold."""
    saddle_mesh().export(tmp_path / "saddle.stl")
    assert found(mf.fit(tmp_path / "saddle.stl", facets="8x8").pattern) == {}


def test_a_drawing_without_angles_says_so_when_it_is_read_again(tmp_path):
    regular().save(tmp_path / "a.dxf")
    mf.convert(tmp_path / "a.dxf", tmp_path / "b.fold")
    assert mf.load(tmp_path / "b.fold").angles_assumed
    assert mf.load(tmp_path / "a.dxf").scaled(2).angles_assumed is not False


def test_a_sector_of_more_than_half_a_turn_is_told_as_such() -> None:
    """Two folds that bend at a vertex: the facet on one side has a corner of 270 degrees there."""
    border = ["0", "0", "8", "0", "8", "4", "8", "8", "4", "8", "0", "8", "0", "0"]
    rim = [" ".join(border[at : at + 4]) for at in range(0, len(border) - 2, 2)]
    text = "\n".join([*(f"1 {line}" for line in rim), "2 4 4 8 4", "3 4 4 4 8"])
    pattern = pattern_from_lines(parse_cp(text))
    (found,), _ = vertex_folds(pattern)
    assert sorted(np.degrees(found.sectors)) == pytest.approx([90, 270])
    assert "90 and 270" in found.why_not_flat(1e-6) or "270 and 90" in found.why_not_flat(1e-6)


def test_coordinates_of_single_precision_beside_short_edges_fold_flat_all_the_same() -> None:
    """A grid of a size of 1 and edges of 0.02 in seven digits, its places of no short numbers."""
    from named_patterns import flat_only, miura

    pattern = flat_only(miura(6))
    turned = pattern.vertices_coords @ np.array([[0.8, 0.6], [-0.6, 0.8]]) / 600 + 0.7
    rounded = turned.astype(np.float32).astype(np.float64)
    single = replace(pattern, vertices_coords=rounded)
    assert max(each.kawasaki for each in vertex_folds(single)[0]) > 1e-6
    assert [f.code for f in judge_flat_folding(single)] == []
    off = rounded.copy()
    off[24] += 1e-4
    found = [f.code for f in judge_flat_folding(replace(pattern, vertices_coords=off))]
    assert found == ["not-flat-foldable"]


def test_a_drawing_of_few_digits_is_as_right_as_its_digits() -> None:
    """Most vertices are exact, and some off by a hundredth of a degree; one that is off by degrees
    is told."""
    from named_patterns import flat_only, miura

    pattern = replace(flat_only(miura(6)), angles_assumed=False)

    def codes(by: float) -> list[str]:
        points = pattern.vertices_coords.copy()
        points[24] += by
        return [f.code for f in judge_flat_folding(replace(pattern, vertices_coords=points))]

    assert codes(0.0) == codes(1e-3) == []
    assert codes(0.5) == ["flat-folding"]


def test_a_drawing_of_opaque_folds_does_not_say_that_it_folds_flat(tmp_path) -> None:
    """Nothing but opacity tells an angle in the format of Origami Simulator."""
    rim = '<rect width="8" height="8" fill="none" stroke="#000"/>'
    fold = '<path d="M4 0 L4 4 L8 6" stroke="red" fill="none" {}/>'
    for name, look, valid in (("a.svg", "", True), ("b.svg", 'data-foldAngle="-180"', False)):
        (tmp_path / name).write_text(f"<svg>{rim}{fold.format(look)}</svg>")
        checked = mf.check(tmp_path / name)
        assert checked.valid == valid
        told = [finding.sentence for finding in checked.findings]
        assert any("must be equal" in sentence for sentence in told)


def test_folds_that_are_all_given_as_0_degrees_prove_nothing() -> None:
    pattern = replace(regular(5, 5), folded_coords=None, grid=None)
    still = replace(pattern, edges_fold_angle=np.zeros(len(pattern.edges_vertices)))
    said = [each.sentence for each in audit(still).findings if each.code == "not-proven"]
    assert "The file gives every fold as 0 degrees, so no size is known." in said
    told = [each.sentence for each in audit(still).findings if each.code == "not-flat-foldable"]
    assert told == []  # by its letters every vertex has three of one kind and one of the other


def test_beside_a_facet_without_area_no_fold_is_measured() -> None:
    """The first facet is a point in the folded form: its two inner edges have no angle there."""
    pattern = regular(4, 4)
    folded = pattern.folded_coords.copy()
    folded[pattern.faces_vertices[0]] = folded[0]
    told = [each for each in audit(replace(pattern, folded_coords=folded)).findings
            if "no fold angle is measured" in each.sentence]  # fmt: skip
    assert len(told) == 1
    inner = (pattern.edges_faces >= 0).all(axis=1) & (pattern.edges_faces == 0).any(axis=1)
    assert told[0].where == tuple(np.flatnonzero(inner).tolist())
    assert told[0].sentence == ("Of 2 edges no fold angle is measured: a facet beside has no area.")
