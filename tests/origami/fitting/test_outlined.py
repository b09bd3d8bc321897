"""Sheets on all of a disk mesh: the lattice over its outline, and fits that end where it ends.

How much is covered is recomputed by rays along the mesh's own normals, from its own triangles.
"""

from __future__ import annotations

import numpy as np
import pytest
from mesh_shapes import mesh

from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.fitting.fit import fit
from miurafab.origami.fitting.outlined import OutlinedLattice, _in_one_piece, angles_of
from miurafab.origami.fitting.request import FitRequest
from miurafab.origami.fitting.result import FitResult
from miurafab.origami.fitting.starts import starts_elsewhere, starts_for
from miurafab.origami.folding.contact import triangulate
from miurafab.surfaces.mesh import MeshSurface, mesh_surface


@pytest.fixture(scope="module")
def petal() -> MeshSurface:
    """A saddle of 207 x 121 mm with a border like a peanut."""
    return mesh_surface(*mesh("petal"), "petal")


@pytest.fixture(scope="module")
def trimmed_petal(petal: MeshSurface) -> FitResult:
    return fit(FitRequest(facets=(12, 12), surface=petal))


def paper_along_normals(pattern: CreasePattern, points: Floats, normals: Floats) -> Bools:
    """(n,) whether the line along ``normals`` at ``points`` (n, 3) meets the paper near by."""
    assert pattern.folded_coords is not None
    triangles = triangulate(pattern.faces_vertices, pattern.vertices_coords)[0]
    a, b, c = pattern.folded_coords[triangles].transpose(1, 0, 2)
    p, n = points[:, None], normals[:, None]
    volumes = np.stack(
        [
            np.einsum("nfk,nfk->nf", np.cross(q - p, r - p), n + 0 * q)
            for q, r in ((a, b), (b, c), (c, a))
        ]
    )
    same = (volumes >= 0).all(axis=0) | (volumes <= 0).all(axis=0)
    near = np.linalg.norm(a - p, axis=2) < 0.3 * np.linalg.norm(np.ptp(points, axis=0))
    return np.asarray((same & near).any(axis=1))


def samples(vertices: Floats, faces: Ints, count: int) -> tuple[Floats, Floats]:
    """Points spread evenly over a mesh, and its normals there."""
    random = np.random.default_rng(5)
    corners = vertices[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(across, axis=1)
    chosen = random.choice(len(faces), count, p=area / area.sum())
    weights = random.dirichlet([1, 1, 1], count)
    points = np.einsum("nc,nck->nk", weights, corners[chosen])
    return points, across[chosen] / area[chosen][:, None]


def test_the_lattice_holds_the_cells_at_the_outline(petal: MeshSurface) -> None:
    assert petal.whole is not None
    pieces = np.repeat([0, 1], 6)
    lattice = OutlinedLattice.of(petal.whole, 0.0, (12, 10), 1.2, pieces)
    charts, target = lattice.charts, lattice.target
    assert 60 < len(charts.cells) < 120
    assert np.array_equal(charts.pieces, pieces[charts.cells[:, 0]])
    low, high = target.outline.box
    d = target.domain
    column = d.width / 12
    assert low[0] - d.u0 == pytest.approx(column / 2)
    assert d.v1 - high[1] >= 1.2 * column / 2 - 1e-9
    inside = np.setdiff1d(np.arange(len(charts.cells)), lattice.rim.facets)
    step = np.array([d.width / 12, d.height / 10])
    centres = np.array([d.u0, d.v0]) + (charts.cells[inside] + 0.5) * step
    assert (target.outline.signed_distance(centres) > 0.3 * step.min()).all()


def test_a_given_rotation_leaves_two_directions_of_the_rows(petal: MeshSurface) -> None:
    assert angles_of(0.2) == pytest.approx((0.2, 0.2 + np.pi / 2))
    request = FitRequest(facets=(8, 8), surface=petal, rotate=0.2, amplitude=0.8, zigzag=1.2)
    starts = starts_for(request, 1)
    assert {start.way for start in starts} == {"outline"}
    assert len(starts) == 2


def test_a_sheet_covers_all_of_the_mesh_and_little_more(
    petal: MeshSurface, trimmed_petal: FitResult
) -> None:
    assert trimmed_petal.status == "converged"
    pattern = trimmed_petal.pattern
    assert pattern is not None
    assert pattern.grid is None
    assert pattern.target == {"edge": "trim"}
    points, normals = samples(petal.layout.vertices, petal.layout.faces, 1500)
    covered = paper_along_normals(pattern, points, normals).mean()
    assert covered > 0.97  # of 100 facets half are cut; 0.985 to 0.994 at 20 x 20
    whole = petal.whole
    assert whole is not None
    feet = whole.feet(pattern.folded_coords)
    beyond = -whole.outline.signed_distance(feet)
    edge = float(np.sqrt(whole.outline.area / len(pattern.faces_vertices)))
    assert beyond.max() < 0.3 * edge  # a cut under 0.15 of an edge moves to the vertex
    assert trimmed_petal.deviation_mm is not None
    assert trimmed_petal.deviation_mm < 0.005 * np.linalg.norm(np.ptp(petal.layout.vertices, 0))
    assert trimmed_petal.measurements is not None
    assert trimmed_petal.measurements.max_planarity is not None
    assert trimmed_petal.measurements.max_planarity < 1e-12


def test_a_trimmed_sheet_has_the_size_that_was_asked_for(petal: MeshSurface) -> None:
    request = FitRequest(facets=(8, 8), surface=petal, size_mm=120.0, polish="off")
    pattern = fit(request).pattern
    assert pattern is not None
    assert np.ptp(pattern.folded_coords, axis=0).max() == pytest.approx(120.0, rel=1e-12)
    assert pattern.scale == pytest.approx(120 / 207, rel=0.05)


def test_whole_facets_serve_where_a_cut_would_leave_short_edges(petal: MeshSurface) -> None:
    common = {"facets": (8, 8), "surface": petal, "polish": "off"}
    cut = fit(FitRequest(**common)).pattern
    whole = fit(FitRequest(**common, edge="whole")).pattern
    found = fit(FitRequest(**common, min_edge_mm=9.0))
    asked = found.pattern
    (said,) = [finding for finding in found.findings if finding.code == "whole-facets"]
    assert "`min_edge` of 9 mm" in said.sentence
    assert cut is not None
    assert whole is not None
    assert asked is not None
    assert cut.faces_vertices.shape[1] > 4
    assert whole.faces_vertices.shape[1] == asked.faces_vertices.shape[1] == 4
    assert whole.target["edge"] == asked.target["edge"] == "whole"


def test_a_rectangle_is_fitted_where_it_is_asked_for(petal: MeshSurface) -> None:
    request = FitRequest(facets=(8, 8), surface=petal, edge="rectangle", polish="off")
    assert {start.way for start in starts_for(request, 1)} == {"sheet"}
    pattern = fit(request).pattern
    assert pattern is not None
    assert pattern.grid == (9, 9)
    last_resorts = starts_elsewhere(FitRequest(facets=(8, 8), surface=petal), 1)
    assert last_resorts[0].way == "sheet"
    assert all(start.place for start in last_resorts)


def test_a_rectangle_that_was_asked_for_is_no_last_resort(petal: MeshSurface) -> None:
    asked = FitRequest(facets=(4, 4), surface=petal, edge="rectangle", amplitude=0.6, zigzag=0.6)
    places = {start.place for start in starts_elsewhere(asked, 1)}
    assert places
    assert "a rectangle of the mesh" not in places


def test_of_cells_that_hang_together_in_two_parts_the_larger_is_kept() -> None:
    cells = np.array([[1, 0, 1, 1], [0, 1, 0, 1], [1, 0, 0, 1]], dtype=bool)
    assert _in_one_piece(cells).tolist() == [[0, 0, 1, 1], [0, 0, 0, 1], [0, 0, 0, 1]]
    assert _in_one_piece(cells[:, 2:]).tolist() == cells[:, 2:].tolist()
