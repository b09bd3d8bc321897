"""An audit of a pattern broken by hand finds that fault, where it is, and no other."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from piece_problems import two_pieces
from problems import CELL, fitted, regular
from test_contact import fan, rolled

from miurafab.errors import PatternError
from miurafab.origami import verify
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.invariants import residuals
from miurafab.origami.miura import regular_miura
from miurafab.origami.nearness import Nearness
from miurafab.origami.tessellation import Tessellation
from miurafab.origami.unfold import unfold, with_angles_of_the_folded_form
from miurafab.origami.verify import audit, measure, with_distances, with_nearness
from miurafab.surfaces.catalogue import make_surface

PROMISED = {
    "status", "advice", "facets", "vertices", "max_planarity", "max_developability",
    "max_flat_foldability", "min_edge_mm", "max_isometry", "hausdorff_mm", "hausdorff_relative",
    "hausdorff_midsurface_mm", "self_intersections", "overlaps", "area_ratio", "iterations",
    "seconds", "sheet_to_target_mm", "target_to_sheet_mm", "coverage", "overhang", "pieces",
    "seam_mm", "quality", "findings",
}  # fmt: skip


def codes(pattern: CreasePattern) -> dict[str, tuple[int, ...]]:
    found = audit(pattern).findings
    return {finding.code: finding.where for finding in found if finding.code != "not-proven"}


def moved(points: np.ndarray, vertex: int, *by: float) -> np.ndarray:
    points = points.copy()
    points[vertex] += by
    return points


def facets_at(pattern: CreasePattern, vertex: int) -> tuple[int, ...]:
    return tuple(np.flatnonzero((pattern.faces_vertices == vertex).any(axis=1)).tolist())


def test_what_is_whole_has_no_findings():
    assert codes(regular()) == {}
    assert codes(fitted("hypar").pattern) == {}


def test_a_fitted_sheet_measures_as_the_fit_reports():
    result = fitted("saddle")
    assert audit(result.pattern).measurements.max_planarity == result.measurements.max_planarity


def test_a_vertex_of_the_flat_pattern_moved_a_little_is_a_fault_of_isometry_alone():
    pattern = regular()
    vertex = 3 * 9 + 4
    broken = replace(pattern, vertices_coords=moved(pattern.vertices_coords, vertex, 1e-6, 0.0))
    assert codes(broken) == {"isometry": facets_at(pattern, vertex)}


def test_a_vertex_of_the_folded_form_lifted_is_a_fault_of_all_that_hang_on_it():
    pattern = regular()
    vertex = 3 * 9 + 4
    broken = replace(pattern, folded_coords=moved(pattern.folded_coords, vertex, 0.0, 0.0, 1e-5))
    found = codes(broken)
    assert set(found) == {"planarity", "developability", "isometry"}
    assert found["planarity"] == facets_at(pattern, vertex)
    assert vertex in found["developability"]
    assert set(found["developability"]) <= {vertex, vertex - 1, vertex + 1, vertex - 9, vertex + 9}


def with_diagonals(pattern: CreasePattern, letter: str) -> CreasePattern:
    """``pattern`` with each quad cut by a diagonal of this ``letter``."""
    a, b, c, d = pattern.faces_vertices.T
    return replace(
        pattern,
        edges_vertices=np.concatenate([pattern.edges_vertices, np.stack([a, c], axis=1)]),
        edges_assignment=np.append(pattern.edges_assignment, np.full(len(a), letter)),
        edges_fold_angle=np.append(pattern.edges_fold_angle, np.zeros(len(a))),
        faces_vertices=np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]),
        grid=None,
    )


@pytest.mark.parametrize("letter", ["F", "J"])
def test_edges_that_do_not_fold_are_no_creases_of_a_vertex(letter: str) -> None:
    """Sectors run from crease to crease, and the angles of a sheet are those of its creases."""
    whole = audit(regular()).measurements
    cut = audit(with_diagonals(regular(), letter)).measurements
    assert cut.max_flat_foldability < 1e-12
    for name, measured in vars(whole.quality).items():
        assert getattr(cut.quality, name) == pytest.approx(measured), name


@pytest.mark.parametrize("letter", ["F", "J"])
def test_a_line_that_nobody_folds_leaves_a_facet_its_sides(letter: str) -> None:
    """It ends in the middle of a crease and of a border: no corner of 180 degrees is there."""
    folded = np.array([[0, 0, 0], [9, 0, 0], [9, 4, 0], [0, 4, 0], [0, 4, 4], [9, 4, 4.0]])
    flat = np.array([[0, 0], [9, 0], [9, 4], [0, 4], [0, 8], [9, 8.0]])
    edges = [(0, 1), (1, 2), (2, 3), (3, 0), (2, 5), (5, 4), (4, 3)]
    whole = CreasePattern(
        vertices_coords=flat,
        edges_vertices=np.array(edges),
        edges_assignment=np.array(list("BBVBBBB")),
        edges_fold_angle=np.where(np.arange(7) == 2, np.pi / 2, 0.0),
        faces_vertices=np.array([[0, 1, 2, 3], [3, 2, 5, 4]]),
        folded_coords=folded,
    )
    split = [(0, 6), (6, 1), (1, 2), (2, 7), (7, 3), (3, 0), (2, 5), (5, 4), (4, 3), (6, 7)]
    cut = replace(
        whole,
        vertices_coords=np.append(flat, [[1, 0], [1, 4.0]], axis=0),
        folded_coords=np.append(folded, [[1, 0, 0], [1, 4, 0.0]], axis=0),
        edges_vertices=np.array(split),
        edges_assignment=np.array([*"BBBVVBBBB", letter]),
        edges_fold_angle=np.where(np.isin(np.arange(10), (3, 4)), np.pi / 2, 0.0),
        faces_vertices=np.array([[0, 6, 7, 3, -1], [6, 1, 2, 7, -1], [3, 7, 2, 5, 4]]),
    )
    shape = audit(cut).measurements.quality
    assert shape == audit(whole).measurements.quality
    assert (shape.edge_mm, shape.facet_aspect) == ((4.0, 4.0), 2.25)
    assert np.degrees(shape.sector_angles) == pytest.approx([90, 90])


def test_an_unassigned_edge_may_fold_and_counts_as_a_crease() -> None:
    cut = with_diagonals(fitted("hypar").pattern, "U")
    assert audit(cut).measurements.max_flat_foldability > 0.5


def test_a_seam_that_gapes_is_a_fault_of_that_seam_alone():
    pattern = two_pieces()
    second = pattern.faces_vertices[pattern.pieces == 1]
    shift = np.zeros((len(pattern.vertices_coords), 3))
    shift[np.unique(second)] = [0.0, 0.0, 1e-6]
    broken = replace(pattern, folded_coords=pattern.folded_coords + shift)
    assert codes(broken) == {"seam": tuple(range(len(pattern.seams)))}


def test_a_seam_whose_edges_differ_in_length_is_found_without_a_folded_form():
    pattern = two_pieces()
    edge = pattern.edges_vertices[pattern.seams[0, 1]]
    flat = moved(pattern.vertices_coords, edge[0], 0.0, -1e-6)
    broken = replace(pattern, vertices_coords=flat, folded_coords=None)
    assert codes(broken) == {"seam": (0,)}


def test_pieces_that_lie_on_each_other_when_flat_are_told_from_facets_that_do():
    pattern = two_pieces()
    second = np.unique(pattern.faces_vertices[pattern.pieces == 1])
    flat = pattern.vertices_coords.copy()
    flat[second, 0] -= flat[second, 0].min()
    finding = audit(replace(pattern, vertices_coords=flat)).findings
    assert [f.code for f in finding] == ["overlap"]
    assert "Pieces lie on each other" in finding[0].sentence


def test_a_corner_vertex_lifted_off_its_facet_spoils_no_developability():
    pattern = regular()
    broken = replace(pattern, folded_coords=moved(pattern.folded_coords, 0, 0.0, 0.0, 1e-5))
    found = codes(broken)
    assert found["planarity"] == (0,)
    assert set(found) <= {"planarity", "isometry", "developability"}


def test_a_folded_form_scaled_is_a_fault_of_isometry_alone():
    pattern = regular()
    broken = replace(pattern, folded_coords=pattern.folded_coords * 1.001)
    assert codes(broken) == {"isometry": tuple(range(len(pattern.faces_vertices)))}


def test_planar_facets_that_do_not_close_are_a_fault_of_developability_alone():
    """A pyramid of four planar quads, its flat form squeezed so that the sides keep: not possible,
    so the flat form is left and isometry complains as well; the facets are planar throughout."""
    pattern = unfold(Tessellation(regular_miura(CELL, 3, 3).points))
    folded = pattern.folded_coords.copy()
    right, up = np.array([10.0, 0, 3.0]), np.array([0, 10.0, 3.0])
    left, down = right * [-1, 1, 1], up * [1, -1, 1]
    folded[4] = 0
    folded[5], folded[7], folded[3], folded[1] = right, up, left, down
    folded[8], folded[6], folded[0], folded[2] = right + up, up + left, left + down, down + right
    found = codes(replace(pattern, folded_coords=folded))
    assert found["developability"] == (4,)
    assert "planarity" not in found


def test_a_fan_that_overlaps_is_a_fault_of_overlap_alone():
    """14 trapezoids of a twelfth of a turn each; folded once across they are free."""
    flat = fan(math.tau * 14 / 12, 14)
    bent = _folded_fan(flat, math.radians(70))
    assert codes(bent) == {"overlap": (0, 1, 12, 13)}


def _folded_fan(flat: CreasePattern, angle: float) -> CreasePattern:
    """The fan folded by ``angle`` at its middle crease."""
    count = len(flat.faces_vertices)
    points = np.zeros((2 * count + 2, 3))
    turn, shift = np.eye(3), np.zeros(3)
    for n, (inner, outer, next_outer, next_inner) in enumerate(flat.faces_vertices.tolist()):
        place = np.append(flat.vertices_coords, np.zeros((2 * count + 2, 1)), axis=1)
        for vertex in (inner, outer, next_outer, next_inner):
            points[vertex] = turn @ place[vertex] + shift
        axis = points[next_outer] - points[next_inner]
        axis /= np.linalg.norm(axis)
        rho = angle if n == 6 else 0.0
        k = np.cross(np.eye(3), axis)
        rotate = np.eye(3) - math.sin(rho) * k + (1 - math.cos(rho)) * (k @ k)
        shift = rotate @ (shift - points[next_inner]) + points[next_inner]
        turn = rotate @ turn
    return with_angles_of_the_folded_form(replace(flat, folded_coords=points))


def test_a_roll_is_a_fault_of_self_intersection_alone():
    assert codes(rolled(math.radians(58), 8)) == {"self-intersection": (0, 1, 6, 7)}
    # at 60 degrees the ends of the roll lie on each other, whose order is not judged
    assert codes(rolled(math.radians(60), 8)) == {}
    assert "not-proven" in [each.code for each in audit(rolled(math.radians(60), 8)).findings]


def test_a_degenerate_edge_is_named():
    pattern = regular()
    folded, flat = pattern.folded_coords.copy(), pattern.vertices_coords.copy()
    folded[1], flat[1] = folded[0] + 1e-12, flat[0] + 1e-12
    broken = replace(pattern, folded_coords=folded, vertices_coords=flat)
    found = codes(broken)
    edge = int(np.flatnonzero((pattern.edges_vertices == [0, 1]).all(axis=1))[0])
    assert found["degenerate-edge"] == (edge,)
    message = next(f.sentence for f in audit(broken).findings if f.code == "degenerate-edge")
    assert f"Edge {edge} is" in message


def test_a_flat_pattern_alone_is_measured_flat_alone():
    pattern = replace(regular(), folded_coords=None)
    result = audit(pattern)
    assert result.valid
    assert result.measurements.max_planarity is None
    assert result.measurements.self_intersections is None


@pytest.mark.parametrize("key", ["vertices_coords", "folded_coords"])
def test_a_coordinate_that_is_no_number_never_gets_as_far(key):
    points = getattr(regular(), key).copy()
    points[3, 0] = math.nan
    with pytest.raises(PatternError, match="not"):
        replace(regular(), **{key: points})


def test_bow_ties_pass_every_residual_and_are_found():
    """A strip of three squares of which the middle one is crossed: flat and folded are one."""
    flat = np.array([[0, 0], [1, 0], [2, 0], [3, 0], [0, 1], [1, 1], [2, 1], [3, 1]], dtype=float)
    faces = np.array([[0, 1, 5, 4], [1, 2, 5, 6], [2, 3, 7, 6]])
    sides = {
        tuple(sorted(pair)) for f in faces.tolist() for pair in zip(f, f[1:] + f[:1], strict=True)
    }
    edges = np.array(sorted(sides))
    uses = [sum(set(e) <= set(f) for f in faces.tolist()) for e in edges.tolist()]
    pattern = CreasePattern(
        vertices_coords=10 * flat,
        edges_vertices=edges,
        edges_assignment=np.where(np.array(uses) == 2, "F", "B"),
        edges_fold_angle=np.zeros(len(edges)),
        faces_vertices=faces,
        folded_coords=np.pad(10 * flat, ((0, 0), (0, 1))),
    )
    found = codes(pattern)
    assert found["bow-tie"] == (1,)
    assert not {"isometry", "planarity", "developability"} & set(found)
    assert not audit(pattern).valid


def test_a_quad_that_is_not_convex_is_told():
    pattern = regular()
    flat, folded = pattern.vertices_coords.copy(), pattern.folded_coords.copy()
    for points in (flat, folded):  # the corner goes over the diagonal of its facet
        points[0] = points[0] + 0.7 * (points[10] - points[0])
    found = codes(replace(pattern, vertices_coords=flat, folded_coords=folded))
    assert found == {"dented": (0,)}


def test_a_sheet_far_from_the_origin_is_as_exact_as_its_digits():
    pattern = regular()
    far = replace(pattern, folded_coords=pattern.folded_coords + np.array([3e7, -2e7, 1e7]))
    assert codes(far) == {}
    bent = moved(pattern.folded_coords, 3 * 9 + 4, 0.0, 0.0, 1e-3)
    far = replace(pattern, folded_coords=bent + np.array([3e7, -2e7, 1e7]))
    assert {"planarity", "isometry"} <= set(codes(far))


def test_the_quality_is_that_of_the_regular_miura_ori():
    """Sector angles of 65 and 115 degrees, sides of 12 and 10 mm, fold angles of two values."""
    pattern = regular()
    shape = audit(pattern).measurements.quality
    assert np.degrees(shape.sector_angles) == pytest.approx([65, 115])
    assert shape.edge_mm[0] == pytest.approx(10.0)
    assert shape.facet_aspect == pytest.approx(1.2)
    stated = np.abs(pattern.edges_fold_angle[pattern.edges_assignment != "B"])
    assert shape.fold_angles == pytest.approx(np.quantile(stated, (0.5, 0.95, 1.0)))


def test_the_report_names_what_the_fit_report_names():
    names = set(fitted("hypar").report()) & PROMISED
    assert names == PROMISED
    assert names <= set(audit(regular()).report())


PLANE = make_surface("plane", {})[0]
SIZE = 100.0 / PLANE.domain.width
"""With it as scale, the plane is a square of 100 mm."""
LOWEST = np.array([PLANE.domain.u0, PLANE.domain.v0]) * SIZE


def over_the_plane(*, aside: float = 0.0, height: float = 1.0) -> CreasePattern:
    """Four squares of 50 mm that lie ``height`` over the plane and ``aside`` from it."""
    grid = np.stack(np.meshgrid([0.0, 50.0, 100.0], [0.0, 50.0, 100.0]), axis=-1)
    flat = grid + LOWEST + np.array([aside, 0.0])
    points = np.concatenate([flat, np.full((3, 3, 1), height)], axis=2)
    return replace(unfold(Tessellation(points)), scale=SIZE)


def test_a_flat_sheet_over_a_plane_is_measured_by_hand():
    found = audit(over_the_plane(), PLANE).measurements
    assert found.sheet_to_target_mm == pytest.approx(1.0)
    assert found.target_to_sheet_mm == pytest.approx(1.0)
    assert found.hausdorff_midsurface_mm == pytest.approx(1.0)
    assert found.hausdorff_relative == pytest.approx(1 / math.hypot(100, 100))
    assert found.area_ratio == pytest.approx(1.0)
    assert (found.coverage, found.overhang) == pytest.approx((1.0, 0.0))
    assert (found.facets, found.vertices, found.pieces, found.seam_mm) == (4, 9, 1, 0.0)
    assert found.min_edge_mm == pytest.approx(50.0)


def test_each_distance_has_its_name(monkeypatch):
    asked = []

    def measured_so(*given):
        asked.append(given)
        return Nearness(
            sheet_to_target=3.0, target_to_sheet=5.0, means_to_target=2.0, diagonal=20.0
        )

    monkeypatch.setattr(verify, "nearness", measured_so)
    pattern, tiles = regular(3, 3), PLANE.tiles()
    for given in ((), (tiles[:1],)):
        found = with_nearness(measure(pattern), pattern, PLANE, *given)
        assert (found.sheet_to_target_mm, found.target_to_sheet_mm) == (3.0, 5.0)
        assert (found.hausdorff_mm, found.hausdorff_relative) == (5.0, 0.25)
        assert (found.hausdorff_midsurface_mm, found.facets) == (2.0, 4)
    assert [each[:2] for each in asked] == [(pattern, PLANE)] * 2
    assert [len(each[2]) for each in asked] == [len(tiles), 1]
    made = []
    surface = SimpleNamespace(tiles=lambda: made.append(tiles) or tiles)
    assert with_distances(measure(pattern), pattern, surface).hausdorff_mm == 5.0
    assert len(made) == 1  # for the distances and the coverage
    assert asked[-1][2] is tiles


def test_distances_that_are_known_are_not_measured_again():
    known = replace(measure(over_the_plane()), hausdorff_mm=7.0)
    found = with_distances(known, over_the_plane(aside=25.0), PLANE)
    assert (found.hausdorff_mm, found.sheet_to_target_mm) == (7.0, None)
    assert (found.coverage, found.overhang) == pytest.approx((0.75, 0.25), abs=0.01)
    ridge = np.zeros((9, 3))
    ridge[1::3, 2] = 37.5  # sides of 62.5 mm over 50
    flat = over_the_plane()
    roof = with_distances(known, replace(flat, folded_coords=flat.folded_coords + ridge), PLANE)
    assert roof.area_ratio == pytest.approx(1.25)


def test_the_paper_of_a_dented_facet_counts_once():
    """A facet of the shape of an L, whose first corner does not see the others."""
    ring = np.array([[100, 60], [60, 60], [60, 100], [0, 100], [0, 0], [100, 0]]) + LOWEST
    corner = np.arange(6)
    pattern = CreasePattern(
        vertices_coords=ring,
        edges_vertices=np.stack([corner, np.roll(corner, -1)], axis=1),
        edges_assignment=np.full(6, "B"),
        edges_fold_angle=np.zeros(6),
        faces_vertices=corner[None],
        folded_coords=np.pad(ring, ((0, 0), (0, 1))),
        scale=SIZE,
    )
    known = replace(measure(pattern), hausdorff_mm=0.0)
    found = with_distances(known, pattern, PLANE)
    assert found.coverage == pytest.approx(0.84, abs=0.01)
    assert found.area_ratio == pytest.approx(1.0)


def test_what_is_measured_is_the_worst_of_each_kind():
    pattern = regular()
    rough = replace(pattern, folded_coords=moved(pattern.folded_coords, 31, 0.0, 0.0, 1e-3))
    measured, found = measure(rough), residuals(rough)
    assert measured.max_planarity == found.planarity.max() > 0
    assert measured.max_developability == found.developability.max() > 0
    assert measured.max_flat_foldability == found.flat_foldability.max() > 0
    assert measured.max_isometry == found.isometry.max() > 0
    exact = measure(regular(4, 2))  # no vertex is within the sheet
    assert (exact.max_developability, exact.max_flat_foldability) == (0.0, 0.0)
    assert (exact.seam_mm, measure(replace(regular(), folded_coords=None)).max_planarity) == (
        0,
        None,
    )
    assert measure(rolled(math.radians(58), 8)).self_intersections == 3
    assert measure(fan(math.tau * 14 / 12, 14)).overlaps == 2


def test_an_audit_is_shown_with_what_is_wrong():
    pattern = regular(5, 5)
    assert repr(audit(pattern)) == "<Audit valid: 16 facets>"
    scaled = replace(pattern, folded_coords=1.1 * pattern.folded_coords)
    assert repr(audit(scaled)) == "<Audit invalid: isometry>"
