"""From format to format: what is kept, what is said to be lost, and what is refused."""

from __future__ import annotations

from pathlib import Path

import named_patterns
import numpy as np
import pytest
import trimesh
from piece_problems import gores, trimmed, two_pieces, two_trimmed_pieces
from problems import fitted, regular, saddle_mesh

from miurafab.errors import InputError, PatternError
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.fitting.fit import fit
from miurafab.origami.folding.kinematics import rigid_motion, states_between
from miurafab.origami.formats.files import WRITTEN, load
from miurafab.origami.formats.fold import read_fold
from miurafab.origami.verify import audit
from miurafab.surfaces.description import described_surface
from miurafab.workflow.convert import convert
from miurafab.workflow.design import design


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    regular(6, 5).save(tmp_path / "sheet.fold")
    return tmp_path / "sheet.fold"


@pytest.mark.parametrize("ending", WRITTEN)
def test_every_format_is_written_the_same_every_time(saved: Path, ending: str) -> None:
    one, two = (saved.with_name(f"{name}{ending}") for name in ("a", "a2"))
    done = convert(saved, one)
    convert(saved, two)
    same_but_for_the_name = one.read_bytes().replace(b"# a,", b"# a2,")
    assert same_but_for_the_name == two.read_bytes()
    assert done.report()["facets"] == 20
    counted = sum(done.report()["edges"].values())
    assert counted == len(regular(6, 5).edges_vertices)


@pytest.mark.parametrize("ending", [".fold", ".svg", ".cp", ".opx", ".dxf"])
def test_there_and_back_is_the_same_pattern(saved: Path, ending: str) -> None:
    middle, back = saved.with_name(f"middle{ending}"), saved.with_name("back.fold")
    convert(saved, middle)
    lost = convert(middle, back).findings
    first, last = read_fold(saved), read_fold(back)
    assert len(last.vertices_coords) == len(first.vertices_coords)
    assert len(last.faces_vertices) == len(first.faces_vertices)
    for letter in "BMV":
        same = (last.edges_assignment == letter).sum() == (first.edges_assignment == letter).sum()
        assert same
    if ending in (".fold", ".svg"):
        assert np.sort(last.edges_fold_angle) == pytest.approx(np.sort(first.edges_fold_angle))
        assert lost == ()
    else:
        assert "no fold angles" in lost[0].sentence
        assert rigid_motion(last, states_between(last, 5)).is_rigid


@pytest.mark.parametrize("make", [two_pieces, gores, trimmed, two_trimmed_pieces])
@pytest.mark.parametrize("ending", [".fold", ".svg", ".cp", ".opx", ".dxf"])
def test_pieces_and_trimmed_facets_go_there_and_back(make, ending: str, tmp_path: Path) -> None:
    pattern, first, middle = make(), tmp_path / "first.fold", tmp_path / f"middle{ending}"
    pattern.save(first)
    lost = {finding.code for finding in convert(first, middle).findings}
    assert ("no-seams" in lost) == (pattern.seams is not None and ending != ".fold")
    last = load(middle)
    assert last.pieces_count == pattern.pieces_count
    sizes = [np.sort((p.faces_vertices >= 0).sum(axis=1)) for p in (last, pattern)]
    assert np.array_equal(*sizes)
    for letter in "BMV":
        same = (last.edges_assignment == letter).sum() == (pattern.edges_assignment == letter).sum()
        assert same
    of_pieces = [np.sort(np.bincount(p.pieces)) for p in (last, pattern) if p.pieces is not None]
    assert len(of_pieces) == 0 or np.array_equal(*of_pieces)


@pytest.mark.parametrize("make", [two_pieces, two_trimmed_pieces])
def test_solids_hold_every_piece(make, tmp_path: Path) -> None:
    pattern = make()
    flat, folded = tmp_path / "flat.obj", tmp_path / "folded.obj"
    pattern.save(flat, form="flat")
    pattern.save(folded, form="folded")
    read = load(flat, folded=folded)
    assert read.pieces_count == 2
    assert np.array_equal(read.faces_vertices, pattern.faces_vertices)
    assert np.array_equal(read.folded_coords, pattern.folded_coords)
    assert audit(read).valid
    triangles = int(((pattern.faces_vertices >= 0).sum(axis=1) - 2).sum())
    pattern.save(tmp_path / "sheet.stl")
    assert (tmp_path / "sheet.stl").stat().st_size == 84 + 50 * triangles
    pattern.save(tmp_path / "sheet.glb")
    scene = trimesh.load(tmp_path / "sheet.glb")
    front_and_back = [len(part.faces) for part in scene.geometry.values()]
    assert front_and_back == [triangles, triangles]


def test_two_obj_files_make_the_pattern_again(saved: Path) -> None:
    flat, folded = saved.with_name("flat.obj"), saved.with_name("folded.obj")
    convert(saved, flat, form="flat")
    convert(saved, folded)
    convert(flat, saved.with_name("again.fold"), folded=folded)
    again = read_fold(saved.with_name("again.fold"))
    assert audit(again).valid
    first = read_fold(saved)
    assert np.array_equal(again.folded_coords, first.folded_coords)
    assert np.sort(again.edges_fold_angle) == pytest.approx(np.sort(first.edges_fold_angle))


def test_a_mesh_target_is_still_found_from_another_folder(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    saddle_mesh(11).export(tmp_path / "saddle.stl")
    wanted = design(str(tmp_path / "saddle.stl"), facets="4x4", edge="rectangle", polish="off")
    found = fit(wanted.request).pattern
    assert found is not None
    found.save(tmp_path / "a.fold")
    convert(tmp_path / "a.fold", tmp_path / "there" / "b.fold")
    surface, findings = described_surface(load(tmp_path / "there" / "b.fold").target)
    assert findings == ()
    assert surface is not None


@pytest.mark.parametrize(
    ("source", "target", "options", "words"),
    [
        ("sheet.fold", "a.pdf", {}, "does not end in one of"),
        ("sheet.fold", "a.obj", {"form": "round"}, "one of flat, folded"),
        ("sheet.fold", "a.cp", {"folded": "b.obj"}, "'folded' goes with"),
        ("sheet.txt", "a.cp", {}, "does not end in one of"),
        ("sheet.stl", "a.fold", {}, "no crease pattern"),
        ("sheet.obj", "a.fold", {}, "as 'folded'"),
        ("none.svg", "a.fold", {}, "does not exist"),
    ],
)
def test_what_does_not_go_is_refused(
    saved: Path, source: str, target: str, options: dict[str, str], words: str
) -> None:
    folder = saved.parent
    with pytest.raises((InputError, PatternError), match=words):
        convert(folder / source, folder / target, **options)
    assert not (folder / target).exists()


def test_a_fault_in_a_drawing_names_the_file(tmp_path: Path) -> None:
    (tmp_path / "bad.cp").write_text("1 2 3\n")
    with pytest.raises(PatternError, match=r"bad\.cp: line 1"):
        load(tmp_path / "bad.cp")


def test_a_flat_pattern_has_no_folded_form_to_write(tmp_path: Path) -> None:
    regular(5, 4).save(tmp_path / "a.fold")
    convert(tmp_path / "a.fold", tmp_path / "a.cp")
    with pytest.raises(InputError, match="no folded form"):
        convert(tmp_path / "a.cp", tmp_path / "a.stl", form="folded")


def test_a_curved_sheet_of_another_program_folds_like_ours(tmp_path: Path) -> None:
    pattern = fitted("sphere", 10, 10, 0.0).pattern
    assert pattern is not None
    pattern.save(tmp_path / "a.fold")
    convert(tmp_path / "a.fold", tmp_path / "a.dxf")
    read = load(tmp_path / "a.dxf")
    motion = rigid_motion(read, states_between(read, 6))
    assert motion.is_rigid


def test_free_creases_that_a_format_cannot_hold_are_told(tmp_path: Path) -> None:
    pattern = named_patterns.pleated_hypar(3)
    free = int((pattern.edges_assignment == "U").sum())
    done = convert(_saved(pattern, tmp_path / "a.fold"), tmp_path / "a.cp")
    told = {finding.code: finding.sentence for finding in done.findings}
    assert f"{free} become F" in told["free-creases"]
    assert (done.pattern.edges_assignment == "U").sum() == free
    kept = convert(tmp_path / "a.fold", tmp_path / "b.svg").findings
    assert "free-creases" not in {finding.code for finding in kept}


def _saved(pattern: CreasePattern, path: Path) -> Path:
    pattern.save(path)
    return path
