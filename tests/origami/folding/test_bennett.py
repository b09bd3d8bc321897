"""Plates on shifted hinges: loops close through the whole motion, and no solids collide."""

from __future__ import annotations

import io
import itertools
import json
import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import ezdxf
import numpy as np
import pytest
import trimesh
from flat_folds import strip
from problems import fitted, regular
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from miurafab.errors import InputError, PatternError
from miurafab.geometry.polygons import signed_areas
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding import plates as plates_module
from miurafab.origami.folding.bennett import (
    bennett_heights,
    nearest_heights,
    thick_loop_gap,
    thick_placement,
)
from miurafab.origami.folding.kinematics import fold_angles_at, place, states_between
from miurafab.origami.folding.plates import ThickPlates, thick_plates
from miurafab.origami.folding.slits import blocks_of, facet_cells, opened_by, slit_sheets
from miurafab.origami.folding.thick_panels import LEAST_USEFUL, thick_panels
from miurafab.origami.invariants import interior_vertices
from miurafab.origami.piece import piece_of

STATES = np.geomspace(0.1, 10.0, 10)


@cache
def exact(name: str, cells: int = 6) -> CreasePattern:
    found = fitted(name, cells, cells, 0.0).pattern
    assert found is not None
    return found


@cache
def plywood() -> ThickPlates:
    """Four by four facets of a hypar, 200 mm long, in plywood of 4 mm."""
    return thick_plates(exact("hypar", 4), 4.0)


@pytest.mark.parametrize("name", ["plane", "hypar", "paraboloid", "cylinder"])
def test_any_heights_that_close_at_one_state_close_at_all(name: str) -> None:
    pattern = exact(name)
    assert bennett_heights(pattern).free == 2 * (6 - 1)
    wished = np.random.default_rng(3).uniform(-1, 1, len(pattern.edges_vertices))
    heights = nearest_heights(pattern, wished)
    assert np.abs(heights).max() > 0.1
    assert thick_loop_gap(pattern, heights, STATES).max() <= 1e-11
    # without the shares of the sectors they do not
    assert thick_loop_gap(pattern, wished, STATES).min() > 1e-3
    # and what is nearest to them is they
    assert np.abs(nearest_heights(pattern, heights) - heights).max() < 1e-9


def test_a_regular_miura_climbs_by_one_thickness_a_row() -> None:
    for cells in (4, 6):
        heights = bennett_heights(exact("plane", cells))
        assert heights.thickness / 2 == pytest.approx(1 / (2 * (cells - 1)), rel=1e-6)
        assert np.abs(heights.axis).max() <= 1 + 1e-9


def test_axes_and_plates_keep_their_sides() -> None:
    for name in ("hypar", "cylinder"):
        heights = bennett_heights(exact(name, 6))
        pattern = heights.pattern
        assert heights.thickness > 0
        inner = np.flatnonzero((pattern.edges_faces >= 0).all(axis=1))
        for edge in inner.tolist():
            plates = heights.bottom[pattern.edges_faces[edge]]
            if pattern.edges_assignment[edge] == "V":
                assert heights.axis[edge] >= (plates + heights.thickness).max() - 1e-7
            else:
                assert heights.axis[edge] <= plates.min() + 1e-7


def test_one_patch_in_plywood_moves_without_collision_from_flat_to_flat() -> None:
    (patch,) = plywood().patches
    assert (patch.clear_deg, patch.collision) == (180.0, None)
    assert plywood().folds
    assert patch.range_mm < 16 * 4
    # the plates move with the angles of the thin sheet, about axes that stay in both plates
    assert thick_loop_gap(patch.pattern, patch.axis_mm, STATES).max() <= 1e-11
    solids = patch.solids()
    thin = place(patch.pattern, fold_angles_at(patch.pattern, np.array([1.0]))).turn[0]
    placed = patch.placed(solids, np.array([1.0]))[0]
    first = solids.facet == 5
    corners = solids.corners[first]
    moved = placed[first] - placed[first][0]
    assert np.abs(moved - (corners - corners[0]) @ thin[5].T).max() < 1e-10


def deepest(one: np.ndarray, other: np.ndarray) -> float:
    """The radius of the largest ball in both of two convex solids (n, 3), by linear programming;
    negative where they are apart.
    """
    hulls = [ConvexHull(points).equations for points in (one, other)]
    planes = np.concatenate(hulls)
    ball = np.column_stack([planes[:, :3], np.ones(len(planes))])
    found = linprog([0, 0, 0, -1], ball, -planes[:, 3], bounds=[(None, None)] * 4)
    return float(found.x[3])


@pytest.mark.large
@pytest.mark.parametrize("cells", [4, 6])
def test_convex_solids_have_no_ball_in_common_at_finer_states(cells: int) -> None:
    """Of a sheet that is whole, and of one with a slit."""
    (patch,) = thick_plates(exact("hypar", cells), 4.0).patches
    solids = patch.solids()
    graph = trimesh.Trimesh(solids.corners, solids.triangles, process=False)
    parts = trimesh.graph.connected_components(graph.edges, nodes=np.arange(len(graph.vertices)))
    owner = [int(solids.facet[part[0]]) for part in parts]
    checked = 0
    for placed in patch.placed(solids, states_between(patch.pattern, 60)):
        boxes = [(placed[part].min(axis=0), placed[part].max(axis=0)) for part in parts]
        for a, b in itertools.combinations(range(len(parts)), 2):
            apart = (boxes[a][0] > boxes[b][1]) | (boxes[b][0] > boxes[a][1])
            if owner[a] == owner[b] or apart.any():
                continue
            checked += 1
            assert deepest(placed[parts[a]], placed[parts[b]]) < 0.01
    assert checked > 1000


@pytest.mark.parametrize("fault", ["higher plates", "axes in the middle", "thicker plates"])
def test_collisions_are_found_where_heights_are_wrong(fault: str) -> None:
    (patch,) = plywood().patches
    wrong = {
        "higher plates": replace(patch, bottom_mm=patch.bottom_mm + np.arange(16) % 2 * 3.0),
        "axes in the middle": replace(
            patch, axis_mm=0 * patch.axis_mm, bottom_mm=0 * patch.bottom_mm - 2.0
        ),
        "thicker plates": replace(patch, thickness_mm=6.0),
    }[fault]
    found = wrong.cleared()
    assert found.clear_deg < 180
    assert found.collision is not None


def test_sheets_without_plates_are_slit_and_stay_one_mechanism() -> None:
    pattern = exact("hypar", 6)
    assert not bennett_heights(pattern).exists
    made = thick_plates(pattern, 2.0)
    (patch,), (seam,) = made.patches, made.seams
    assert made.folds
    assert patch.range_mm <= 16 * 2.0
    # the two creases at one vertex of the seam keep their hinges, so that this vertex ties both
    ends = pattern.edges_vertices[list(seam.hinges)]
    (tied,) = set(ends[0]) & set(ends[1])
    assert tied in interior_vertices(pattern)
    block = blocks_of(facet_cells(pattern), 2, 1)
    apart = block[pattern.edges_faces]
    inner = (pattern.edges_faces >= 0).all(axis=1)
    across = np.flatnonzero(inner & (apart[:, 0] != apart[:, 1]))
    assert sorted((*seam.hinges, *seam.slits)) == across.tolist()
    assert set(patch.edges[patch.edges_inner]) == set(np.flatnonzero(inner)) - set(seam.slits)
    assert thick_loop_gap(patch.pattern, patch.axis_mm, STATES).max() <= 1e-11


def test_slits_open_as_far_as_the_solids_beside_them() -> None:
    pattern = exact("hypar", 6)
    made = thick_plates(pattern, 2.0)
    (patch,), (seam,) = made.patches, made.seams
    solids = patch.solids()
    widest = 0.0
    for placed in patch.placed(solids, states_between(patch.pattern, 12)):
        for edge in seam.slits:
            for vertex in pattern.edges_vertices[edge]:
                corner = []
                for facet in pattern.edges_faces[edge]:
                    # a plate has two corners at the vertex, on its bottom and on its top
                    away = np.linalg.norm(
                        solids.corners[:, :2] - pattern.vertices_coords[vertex], axis=1
                    )
                    away[solids.facet != facet] = np.inf
                    corner.append(placed[np.argsort(away)[:2]].mean(axis=0))
                widest = max(widest, float(np.linalg.norm(corner[0] - corner[1])))
    assert seam.opens_mm == pytest.approx(widest, abs=1.0)  # plates keep 0.1 mm from vertices
    assert widest > 5.0


@cache
def loose() -> ThickPlates:
    """Eight by eight facets, which take four loose patches."""
    return thick_plates(exact("hypar", 8), 2.0)


def test_loose_patches_are_made_where_slits_do_not_help() -> None:
    made = loose()
    assert len(made.patches) == 4
    facets = np.concatenate([patch.facets for patch in made.patches])
    assert sorted(facets.tolist()) == list(range(64))
    assert made.folds
    assert [(seam.patch, seam.blocks, seam.hinges) for seam in made.seams] == [
        (None, (0, 1), ()),
        (None, (0, 2), ()),
        (None, (1, 3), ()),
        (None, (2, 3), ()),
    ]
    assert all(len(seam.slits) == 4 for seam in made.seams)


def test_loose_patches_are_joined_in_the_folded_form() -> None:
    """How far their edges are apart there, with each patch laid onto the folded form by itself."""
    pattern, made = exact("hypar", 8), loose()
    assert pattern.folded_coords is not None
    where: dict[tuple[int, int], np.ndarray] = {}
    for patch in made.patches:
        plates = thick_placement(patch.pattern, patch.axis_mm, np.ones(1))
        faces = pattern.faces_vertices[patch.facets]
        middle = patch.bottom_mm + 1.0
        flat = pattern.vertices_coords[faces]
        level = np.concatenate(
            [flat, np.broadcast_to(middle[:, None, None], (*flat.shape[:2], 1))], axis=2
        )
        placed = np.einsum("fij,fcj->fci", plates.turn[0], level) + plates.shift[0, :, None]
        # the normals of both, side by side, give the turn
        thin = pattern.folded_coords[faces]
        normals = [np.cross(x[:, 1] - x[:, 0], x[:, 3] - x[:, 0]) for x in (placed, thin)]
        u, _, vt = np.linalg.svd(normals[0].T @ normals[1])
        placed = placed @ (u @ vt)
        placed += (thin - placed).mean(axis=(0, 1))
        assert np.abs(placed - thin).max() < 16 * 2.0
        for facet, face, points in zip(patch.facets, faces, placed, strict=True):
            where |= {(int(facet), int(v)): point for v, point in zip(face, points, strict=True)}
    for seam in made.seams:
        gaps = [
            np.linalg.norm(where[int(one), int(v)] - where[int(other), int(v)])
            for edge in seam.slits
            for one, other in [pattern.edges_faces[edge]]
            for v in pattern.edges_vertices[edge]
        ]
        assert seam.opens_mm == pytest.approx(max(gaps), rel=1e-6)
        assert seam.opens_mm > 0.1


def test_a_loose_patch_may_be_slit(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sheet that is too large to be tried whole is one loose patch here, with its slit."""
    whole = thick_plates(exact("hypar", 6), 2.0)
    monkeypatch.setattr(plates_module, "WHOLE", 35)
    made = thick_plates(exact("hypar", 6), 2.0)
    (patch,) = made.patches
    assert np.array_equal(patch.axis_mm, whole.patches[0].axis_mm)
    assert np.array_equal(patch.edges, whole.patches[0].edges)
    assert made.seams == whole.seams
    assert [seam.patch for seam in whole.seams] == [0]


def test_the_pieces_of_a_pattern_are_made_one_by_one() -> None:
    pattern = exact("bump", 6)
    assert pattern.pieces is not None
    made = thick_plates(pattern, 2.0)
    assert len(made.patches) == pattern.pieces_count == 2
    for number, patch in enumerate(made.patches):
        assert set(pattern.pieces[patch.facets]) == {number}
        assert np.array_equal(
            pattern.vertices_coords[pattern.edges_vertices[patch.edges]],
            patch.pattern.vertices_coords[patch.pattern.edges_vertices],
        )


def test_a_sheet_without_a_grid_has_plates_as_a_whole_or_is_refused() -> None:
    whole = replace(exact("plane", 6), grid=None)
    assert len(thick_plates(whole, 2.0).patches) == 1
    with pytest.raises(PatternError, match="has no grid of facets by which it could be slit"):
        thick_plates(replace(exact("hypar", 6), grid=None), 2.0)


@pytest.mark.parametrize("name", ["plane", "hypar"])
def test_the_guide_tells_what_is_made(name: str) -> None:
    heights = bennett_heights(exact(name))
    guide = (Path(__file__).parents[3] / "docs" / "folding.md").read_text()
    row = next(line for line in guide.splitlines() if line.startswith(f"| {name} | 10 |"))
    assert f"| {heights.thickness / 2:.4f} |" in row
    made = thick_plates(exact(name), 2.0)
    slits = sum(len(seam.slits) for seam in made.seams)
    patches = "one" if len(made.patches) == 1 else f"{len(made.patches)} patches"
    most = max(patch.range_mm for patch in made.patches) / 2.0
    assert row.endswith(f"| {patches} | {slits} | {most:.1f} t | 180° |")
    assert all(patch.clear_deg == 180.0 for patch in made.patches)


def test_one_crease_folds_about_the_face_of_its_plates() -> None:
    made = thick_plates(strip("V"), 4.0)
    (patch,) = made.patches
    assert made.folds
    assert patch.clear_deg == pytest.approx(180.0)
    assert patch.brackets == ()
    crease = patch.edges_inner
    assert patch.bottom_mm + 4.0 == pytest.approx(patch.axis_mm[crease].repeat(2))


def test_plates_that_their_clearance_eats_up_are_refused(tmp_path: Path) -> None:
    """A unit square loses both sides at a clearance of 1/2, which is a thickness of 10."""
    thin = thick_plates(strip("V"), 9.9)
    assert np.concatenate([patch.limit_mm for patch in thin.patches]) == pytest.approx(10.0)
    assert thin.folds
    thin.save(tmp_path / "thin.svg")
    thick = thick_plates(strip("V"), 10.1)
    assert thick.too_small.tolist() == [0, 1]
    assert not thick.folds
    with pytest.raises(InputError, match=r"too small for panels of 10\.1 mm"):
        thick.save(tmp_path / "thick.svg")
    assert not (tmp_path / "thick.svg").exists()


def test_what_has_no_shifted_hinges_is_refused() -> None:
    developable = fitted("hypar", 4, 4).pattern
    assert developable is not None
    with pytest.raises(PatternError, match="closed form of folding does not hold"):
        thick_plates(developable, 4.0)
    with pytest.raises(InputError, match="greater than zero"):
        thick_plates(regular(), 0.0)
    with pytest.raises(PatternError, match="its layers have no order in which it closes"):
        bennett_heights(strip("VVV", angle=math.radians(120)))


def test_a_small_sheet_is_slit_in_the_ways_that_leave_blocks_of_two() -> None:
    """4 x 2 facets: no more than two blocks along, and one across."""
    cells = facet_cells(exact("plane", 4))[:8]
    pattern = piece_of(exact("plane", 4), np.arange(8)).pattern
    found = list(slit_sheets(pattern, cells))
    assert found
    for slit, edges, seams in found:
        assert slit.pieces_count == 1
        assert len(seams) == 1
        cut = len(slit.edges_vertices) - len(pattern.edges_vertices)
        assert cut == len(seams[0].slits)
        assert len(edges) == len(slit.edges_vertices)
        assert len(seams[0].hinges) + cut == 2
    whole = replace(seams[0], slits=())
    nothing = np.zeros(len(slit.edges_vertices)), np.zeros(8)
    assert opened_by(pattern, slit, *nothing, whole) == 0.0


def test_patches_are_made_smaller_until_each_has_plates(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where none of any size has, that is told."""
    tried: list[int] = []

    def few(pattern: CreasePattern, thickness: float) -> tuple | None:
        tried.append(len(pattern.faces_vertices))
        return made(pattern, thickness) if tried[-1] <= most else None

    made, pattern = plates_module._mechanism, exact("plane", 6)
    monkeypatch.setattr(plates_module, "_mechanism", few)
    most = 9
    found = thick_plates(pattern, 4.0)
    assert [len(patch.facets) for patch in found.patches] == [9] * 4
    assert tried == sorted(tried, reverse=True)
    assert tried[0] == 36
    most = 0
    with pytest.raises(PatternError, match="neither for the whole sheet, slit or"):
        thick_plates(pattern, 4.0)


def test_plates_are_written_as_solids_that_move(tmp_path: Path) -> None:
    (patch,) = plywood().patches
    parts = 16 + len(patch.brackets)
    plywood().save(tmp_path / "plates.stl")
    mesh = trimesh.load(tmp_path / "plates.stl")
    assert mesh.is_watertight
    bracket_mm3 = sum(
        float(signed_areas(b.foot[None])[0]) * (b.high - b.low) for b in patch.brackets
    )
    expected = 4.0 * signed_areas(patch.outlines).sum() + bracket_mm3
    assert mesh.volume == pytest.approx(expected, rel=1e-4)
    assert len(mesh.split()) == parts
    plywood().save(tmp_path / "plates.glb")
    content = (tmp_path / "plates.glb").read_bytes()
    document = json.loads(content[20 : 20 + int.from_bytes(content[12:16], "little")])
    assert len(document["meshes"][0]["primitives"][0]["targets"]) == 24
    trimesh.load(io.BytesIO(content), file_type="glb")


def test_tapered_panels_are_written_as_plies_with_the_hinge_between(tmp_path: Path) -> None:
    panels = thick_panels(regular(), 2.0)
    panels.save(tmp_path / "panels.dxf")
    space = ezdxf.readfile(tmp_path / "panels.dxf").modelspace()
    found: dict[str, list[np.ndarray]] = {}
    for line in space.query("POLYLINE"):
        points = np.array([tuple(vertex.dxf.location)[:2] for vertex in line.vertices])
        found.setdefault(line.dxf.layer, []).append(points)
    facets, creases = len(regular().faces_vertices), int((panels.closing_side != "").sum())
    assert {name: len(lines) for name, lines in found.items()} == {
        "TopPly": facets,
        "Hinge": 2 * creases,
        "BottomPly": facets,
    }
    # of a crease that closes on the top, the top plies keep d away, and the bottom plies reach it
    edge = int(np.flatnonzero(panels.closing_side == "top")[0])
    start, end = regular().vertices_coords[regular().edges_vertices[edge]]
    normal = np.array([start[1] - end[1], end[0] - start[0]]) / np.linalg.norm(end - start)
    facet = int(regular().edges_faces[edge, 0])
    top, bottom = found["TopPly"][facet], panels.plies[1, facet]
    assert np.abs((top - start) @ normal).min() == pytest.approx(panels.offset_mm[edge], rel=1e-5)
    assert np.abs((bottom - start) @ normal).min() < 1e-9
    panels.save(tmp_path / "panels.stl")
    points, triangles, _ = panels.solids()  # panels touch along hinges, so each is taken alone
    assert trimesh.Trimesh(points, triangles, process=False).is_watertight
    mesh = trimesh.load(tmp_path / "panels.stl")
    # corners move in proportion to the height, so Simpson's rule is exact on either side
    middle = regular().vertices_coords[regular().faces_vertices]
    volume = sum(
        (signed_areas(middle) + 4 * signed_areas((middle + ply) / 2) + signed_areas(ply)).sum() / 6
        for ply in panels.plies
    )
    assert mesh.volume == pytest.approx(volume, rel=1e-5)
    for ending in (".svg", ".glb"):
        panels.save(tmp_path / f"panels{ending}")
        assert (tmp_path / f"panels{ending}").stat().st_size > 1000


def test_panels_of_which_little_is_left_are_of_no_use() -> None:
    thin, thick = thick_panels(regular(), 1.0), thick_panels(regular(), 20.0)
    assert thin.usable
    assert thin.useful.min() > 0.7
    limit = float(thick.limit_mm.min())
    nearly = thick_panels(regular(), 0.98 * limit)
    assert nearly.folds
    assert not nearly.usable
    assert nearly.useful.min() < LEAST_USEFUL
    assert thick_panels(regular(), 1.1 * limit).useful.min() == 0.0
