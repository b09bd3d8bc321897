"""Other programs read our files: the npm packages `fold` and `rabbit-ear` under Node.

They are independent oracles: they take the flat pattern and its ``edges_foldAngle`` and fold it.
A wrong sign would give the mirror image, which no proper motion lays on the folded form.
"""

from __future__ import annotations

import json
import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from problems import fitted, regular

from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.kinematics import rigid_motion
from miurafab.origami.folding.layers import layer_order
from miurafab.origami.folding.laying import laid_on
from miurafab.origami.formats.crease_lines import lines_of
from miurafab.origami.formats.fold import read_fold, write_fold
from miurafab.origami.formats.lines import opx_text
from miurafab.origami.unfold import with_angles_of_the_folded_form

HERE = Path(__file__).parent
NODE = shutil.which("node")
pytestmark = pytest.mark.skipif(
    NODE is None or not (HERE / "node_modules").is_dir(),
    reason="needs Node and `npm ci` in tests/interop",
)

SHEETS = ("regular", "hypar", "hypar exact", "sphere exact", "saddle", "log-spiral")


@cache
def sheet(name: str) -> CreasePattern:
    if name == "regular":
        return regular()
    surface, _, exact = name.partition(" ")
    found = fitted(surface, flat_foldable=0.0 if exact else None).pattern
    assert found is not None
    return found


def others(path: Path, *what: str) -> dict[str, Any]:
    assert NODE is not None
    script = HERE / "read_with_others.cjs"
    done = subprocess.run([NODE, script, path, *what], capture_output=True, text=True, check=True)
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def apart(points: Any, known: np.ndarray) -> float:
    """How far ``points``, moved rigidly, stay from ``known``, in parts of its size."""
    found = np.pad(np.array(points), ((0, 0), (0, 3 - len(points[0]))))
    size = np.linalg.norm(np.ptp(known, axis=0))
    return float(np.linalg.norm(laid_on(found, known) - known, axis=1).max() / size)


@pytest.mark.parametrize("name", SHEETS)
def test_they_validate_a_sheet_and_fold_it_to_our_folded_form(name: str, tmp_path: Path) -> None:
    pattern = sheet(name)
    write_fold(pattern, tmp_path / "sheet.fold")
    answer = others(tmp_path / "sheet.fold")
    assert answer["rabbit_ear"]["validation"]["summary"] == "valid"
    assert answer["rabbit_ear"]["validation"]["vertices"]["duplicate"] == []
    assert pattern.folded_coords is not None
    assert apart(answer["rabbit_ear"]["folded"], pattern.folded_coords) < 1e-9

    counted = answer["fold"]
    assert counted["vertices"] == len(pattern.vertices_coords)
    assert counted["edges"] == len(pattern.edges_vertices)
    assert counted["faces"] == len(pattern.faces_vertices)
    for letter, key in (("M", "mountains"), ("V", "valleys"), ("B", "border")):
        assert counted[key] == int((pattern.edges_assignment == letter).sum())
    assert counted["edges_without_faces"] == 0


def test_they_tell_the_mirror_image_from_the_folded_form(tmp_path: Path) -> None:
    pattern = sheet("sphere exact")
    write_fold(pattern, tmp_path / "sheet.fold")
    text = json.loads((tmp_path / "sheet.fold").read_text())
    text["edges_foldAngle"] = [-angle for angle in text["edges_foldAngle"]]
    (tmp_path / "mirror.fold").write_text(json.dumps(text))
    assert pattern.folded_coords is not None
    assert (
        apart(others(tmp_path / "mirror.fold")["rabbit_ear"]["folded"], pattern.folded_coords)
        > 1e-3
    )


@pytest.mark.parametrize("name", ["regular", "hypar exact", "sphere exact"])
def test_they_fold_an_exact_sheet_flat_as_we_do(name: str, tmp_path: Path) -> None:
    pattern = sheet(name)
    write_fold(pattern, tmp_path / "sheet.fold")
    counted = others(tmp_path / "sheet.fold")["fold"]
    ours = rigid_motion(pattern, [np.inf]).frames[0]
    size = float(np.linalg.norm(np.ptp(pattern.vertices_coords, axis=0)))
    assert counted["flat_folded_closure"] < 1e-9 * size
    # in the plane the two may lie back to front, which a turn in space allows
    assert apart(counted["flat_folded"], ours) < 1e-9


@pytest.mark.parametrize(("name", "cells"), [("plane", 4), ("hypar", 8), ("cylinder", 6)])
def test_they_find_our_order_of_the_layers_and_no_other(
    name: str, cells: int, tmp_path: Path
) -> None:
    found = fitted(name, cells, cells, 0.0).pattern
    assert found is not None
    write_fold(found, tmp_path / "sheet.fold")
    theirs = others(tmp_path / "sheet.fold", "layers")
    assert theirs["branches"] == []  # each pair is decided, so the order is the only one
    order = layer_order(found)
    pairs = order.folded.shared.pairs.tolist()
    assert sorted(theirs["root"]) == sorted(f"{one} {other}" for one, other in pairs)
    signs = [theirs["root"][f"{one} {other}"] for one, other in pairs]
    side = signs[0] * order.above[0]  # they may look at the sheet from its back
    assert signs == (side * order.above).tolist()


def test_they_find_a_developable_sheet_not_to_fold_flat(tmp_path: Path) -> None:
    pattern = sheet("hypar")
    write_fold(pattern, tmp_path / "sheet.fold")
    assert others(tmp_path / "sheet.fold")["fold"]["flat_folded_closure"] > 1.0


def test_they_walk_the_same_facets_from_the_edges_alone(tmp_path: Path) -> None:
    pattern = sheet("hypar")
    write_fold(pattern, tmp_path / "sheet.fold")
    walked = others(tmp_path / "sheet.fold")["fold"]["walked_faces"]
    ours = {frozenset(face) for face in pattern.faces_vertices.tolist()}
    theirs = {frozenset(face) for face in walked}
    assert ours <= theirs
    assert len(theirs) <= len(ours) + 1  # it may list the outside, too


def test_they_read_our_opx_files(tmp_path: Path) -> None:
    pattern = sheet("hypar")
    (tmp_path / "sheet.opx").write_text(opx_text(lines_of(pattern), "hypar"), encoding="utf-8")
    read = others(tmp_path / "sheet.opx")
    assert len(read["vertices_coords"]) == len(pattern.vertices_coords)
    assert len(read["edges_vertices"]) == len(pattern.edges_vertices)
    for letter in "BMV":
        expected = int((pattern.edges_assignment == letter).sum())
        assert read["edges_assignment"].count(letter) == expected


@pytest.mark.large
def test_they_fold_a_sheet_of_thirty_by_thirty_cells(tmp_path: Path) -> None:
    found = fitted("hypar", 60, 60, 0.0).pattern
    assert found is not None
    write_fold(found, tmp_path / "sheet.fold")
    again = with_angles_of_the_folded_form(read_fold(tmp_path / "sheet.fold"))
    assert np.abs(again.edges_fold_angle - found.edges_fold_angle).max() < 1e-9
    answer = others(tmp_path / "sheet.fold")["rabbit_ear"]
    assert answer["validation"]["summary"] == "valid"
    assert found.folded_coords is not None
    assert apart(answer["folded"], found.folded_coords) < 1e-9
