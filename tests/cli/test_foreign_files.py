"""Files of other programs: each kind that was refused wrongly or told untruly, once."""

from __future__ import annotations

import json
import re

import pytest

import miurafab as mf
from miurafab.origami.cut_open import cut_open
from miurafab.origami.formats.fold import parse_fold

SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]
BORDER = [[0, 1], [1, 2], [2, 3], [3, 0]]


def written(folder, **document):
    path = folder / "foreign.fold"
    path.write_text(json.dumps({"file_spec": 1.1, **document}))
    return path


def codes(answer) -> list[str]:
    return [finding["code"] for finding in answer["findings"]]


@pytest.mark.parametrize("degrees", [90, 180])
def test_a_sheet_that_does_not_fold_flat_is_answered_with_no(run, tmp_path, degrees) -> None:
    """Four valleys across a square meet in its middle."""
    path = written(
        tmp_path,
        vertices_coords=[*SQUARE, [1.5, 2]],
        edges_vertices=[*BORDER, [0, 4], [1, 4], [2, 4], [3, 4]],
        edges_assignment=list("BBBBVVVV"),
        edges_foldAngle=[0, 0, 0, 0, *[degrees] * 4],
    )
    done = run("layers", path, "--json")
    assert done.returncode == 1
    answer = json.loads(done.stdout)
    assert not answer["exists"]
    assert codes(answer) == ["cannot-fold-flat"]
    assert "does not fold flat" in answer["findings"][0]["sentence"]


def two_squares(**keys):
    """Two creased squares that touch at one corner."""
    far = [[x + 4, y + 4] for x, y in SQUARE[1:]]
    return {
        "vertices_coords": [*SQUARE, *far],
        "edges_vertices": [*BORDER, [0, 2], [2, 4], [4, 5], [5, 6], [6, 2], [4, 6]],
        "edges_assignment": list("BBBBVBBBBM"),
        "faces_vertices": [[0, 1, 2], [0, 2, 3], [2, 4, 6], [4, 5, 6]],
        **keys,
    }


def test_parts_that_touch_at_a_corner_fold_by_themselves(run, tmp_path) -> None:
    path = written(tmp_path, **two_squares())
    for command in ("fold", "layers"):
        done = run(command, path, "--json")
        assert done.returncode == 0, done.stderr
    answer = json.loads(run("fold", path, "--json").stdout)
    assert answer["pieces"] == 2
    opened = cut_open(mf.load(path))
    assert opened.pieces_count == 2
    assert len(opened.vertices_coords) == 8
    assert cut_open(opened) is opened


def test_cuts_within_a_sheet_are_told(run, tmp_path) -> None:
    """A square folded along its middle, with a slit beside the crease."""
    path = written(
        tmp_path,
        vertices_coords=[[0, 0], [2, 0], [4, 0], [4, 4], [2, 4], [0, 4], [2, 2]],
        edges_vertices=[[0, 1], [1, 2], [2, 3], [3, 4], [4, 5], [5, 0], [1, 6], [6, 4]],
        edges_assignment=list("BBBBBBVC"),
    )
    for command in ("check", "fold", "layers"):
        done = run(command, path, "--json")
        assert done.returncode == 0, done.stderr
        answer = json.loads(done.stdout)
        told = [each for each in answer["findings"] if each["code"] == "opened"]
        assert len(told) == 1
        assert told[0]["where"] == [7]
        assert "An edge within the sheet is a cut (C)" in told[0]["sentence"]


def test_lines_that_cross_are_split_where_a_file_names_no_facets(run, tmp_path) -> None:
    path = written(
        tmp_path,
        vertices_coords=SQUARE,
        edges_vertices=[*BORDER, [0, 2], [1, 3]],
        edges_assignment=list("BBBBVM"),
    )
    pattern = mf.load(path)
    assert len(pattern.faces_vertices) == 4
    assert len(pattern.vertices_coords) == 5
    assert run("check", path).returncode == 0


def test_edges_are_found_where_a_file_names_facets_alone() -> None:
    read = parse_fold({"vertices_coords": SQUARE, "faces_vertices": [[0, 1, 2], [0, 2, 3]]})
    assert sorted(map(tuple, read.edges_vertices.tolist())) == [
        (0, 1), (0, 2), (0, 3), (1, 2), (2, 3),
    ]  # fmt: skip


def drawing(shift: float) -> dict:
    """A square with a vertex where Kawasaki holds but for ``shift``, and creases to its corners."""
    return {
        "vertices_coords": [*SQUARE, [2, 2], [2 + shift, 0], [2, 4], [0, 2 + shift / 3], [4, 2]],
        "edges_vertices": [[0, 5], [5, 1], [1, 8], [8, 2], [2, 6], [6, 3], [3, 7], [7, 0],
                           [4, 5], [4, 6], [4, 7], [4, 8]],
        "edges_assignment": list("BBBBBBBBMVVV"),
        "edges_foldAngle": [0] * 8 + [-180, 180, 180, 180],
    }  # fmt: skip


@pytest.mark.parametrize(("shift", "status"), [(3e-6, 0), (0.1, 1)])
def test_the_digits_of_a_drawing_break_no_theorem(run, tmp_path, shift, status) -> None:
    path = written(tmp_path, **drawing(shift))
    done = run("check", path, "--json")
    assert done.returncode == status
    # a pattern that does not fold flat is converted all the same
    assert run("convert", path, tmp_path / "a.cp").returncode == 0
    if status:
        told = next(each for each in json.loads(done.stdout)["findings"] if "Kawasaki" in
                    each["sentence"])  # fmt: skip
        numbers = re.findall(r"sectors are ([\d.]+) and ([\d.]+) degrees", told["sentence"])[0]
        assert numbers[0] != numbers[1]


def test_a_frame_of_another_sheet_is_passed_over(run, tmp_path) -> None:
    other = {"frame_classes": ["foldedForm"], "vertices_coords": [[0, 0, 0], [1, 0, 0], [0, 1, 1]]}
    folded = {
        "frame_classes": ["foldedForm"],
        "frame_parent": 0,
        "frame_inherit": True,
        "vertices_coords": [[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]],
    }
    path = written(
        tmp_path,
        frame_classes=["creasePattern"],
        vertices_coords=SQUARE,
        edges_vertices=[*BORDER, [0, 2]],
        edges_assignment=list("BBBBF"),
        faces_vertices=[[0, 1, 2], [0, 2, 3]],
        file_frames=[folded, other],
    )
    assert run("check", path).returncode == 0


def test_colours_by_hue_and_by_name_are_read(tmp_path) -> None:
    (tmp_path / "a.svg").write_text(
        '<svg><rect width="9" height="9" stroke="hsl(0, 0%, 5%)"/>'
        '<line x2="9" y2="9" stroke="hsl(240, 100%, 50%)"/></svg>'
    )
    assert sorted(mf.load(tmp_path / "a.svg").edges_assignment.tolist()) == list("BBBBV")


def test_frames_are_named_by_the_angle_of_a_crease(run, tmp_path) -> None:
    path = written(tmp_path, **two_squares())
    out = tmp_path / "motion.fold"
    assert run("fold", path, "-o", out, "--steps", "4").returncode == 0
    document = json.loads(out.read_text())
    titles = [frame["frame_title"] for frame in document["file_frames"] if "frame_title" in frame]
    assert titles[0] == "flat"
    assert titles[-1] == "folded flat"
    for frame in document["file_frames"]:
        words = frame.get("frame_title", "flat").split()
        if words[0] == "edge":
            assert abs(frame["edges_foldAngle"][int(words[1])]) == pytest.approx(
                float(words[4]), rel=1e-3
            )
    assert any(title.startswith("edge ") for title in titles)


def test_energy_takes_the_shape_to_which_a_pattern_folds_from_flat(run, tmp_path) -> None:
    path = written(tmp_path, **drawing(0.0))
    answer = json.loads(run("energy", path, "--steps", "4", "--json").stdout)
    assert answer["rigid"]
    assert answer["converged"]
    # not one of the two that make half a turn, whose sign rounding decides
    assert 90 < abs(answer["folded_angle_deg"]) < 179
    assert answer["barrier"] == 0


def test_a_vertex_of_no_facet_is_left_out_and_told(run, tmp_path) -> None:
    path = written(
        tmp_path,
        vertices_coords=[[9, 9], *SQUARE, [6, 6]],
        edges_vertices=[[1, 2], [2, 3], [3, 4], [4, 1], [1, 3], [0, 5]],
        edges_assignment=list("BBBBVM"),
        faces_vertices=[[1, 2, 3], [1, 3, 4]],
    )
    done = run("convert", path, tmp_path / "a.fold", "--json")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert (answer["vertices"], answer["edges"]) == (4, {"B": 4, "V": 1})
    assert codes(answer) == ["lost-lines"]
    assert "2 vertices of no facet, with 1 edge" in answer["findings"][0]["sentence"]


def test_each_command_names_the_file_that_does_not_hold(run, tmp_path) -> None:
    """`fold` and `layers` said "The pattern"."""
    path = written(
        tmp_path,
        vertices_coords=SQUARE,
        edges_vertices=[*BORDER, [0, 2]],
        edges_assignment=list("BBBFV"),
        faces_vertices=[[0, 1, 2], [0, 2, 3]],
    )
    for words in (("layers",), ("fold",), ("energy",), ("convert", tmp_path / "a.svg")):
        done = run(words[0], path, *words[1:])
        assert done.returncode == 2
        assert f"{path} does not hold, and nothing is made of it: Edge 3 is F" in done.stderr
