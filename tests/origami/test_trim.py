"""A sheet cut along an outline: exact, on the outline, without parts that hang loose."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.outline import Outline
from miurafab.geometry.polygons import edge_lengths, facet_areas
from miurafab.origami import trim
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.fitting.fit import fit
from miurafab.origami.fitting.request import FitRequest
from miurafab.origami.folding.bending import bending_motion
from miurafab.origami.folding.contact import triangulate
from miurafab.origami.nearness import nearness
from miurafab.origami.trim import CREASE, SLIVER, inner_facets, trimmed
from miurafab.origami.trim_cuts import EdgeCuts, edge_cuts
from miurafab.origami.verify import audit
from miurafab.surfaces.mesh import MeshSurface, mesh_surface
from miurafab.surfaces.outline import WholeMesh, whole_mesh

COUNT = 14
TURN = np.linspace(0, 2 * np.pi, 160, endpoint=False)
CIRCLE = np.stack([np.cos(TURN), np.sin(TURN)], axis=1)
NOTCHED = np.array([[-60, -60], [70, -50], [65, 60], [5, 65], [0, -5], [-63, 0.0]])
SHAPES = {"circle": [72 * CIRCLE], "notched": [NOTCHED], "holed": [72 * CIRCLE, 25 * CIRCLE + 4]}


@pytest.fixture(scope="module")
def bowl() -> tuple[CreasePattern, WholeMesh]:
    """A sheet on a square part of a paraboloid, and the whole paraboloid."""
    line = np.linspace(-100, 100, 33)
    x, y = (part.ravel() for part in np.meshgrid(line, line))
    i = np.arange(33 * 33).reshape(33, 33)
    lower = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:]], axis=-1).reshape(-1, 3)
    upper = np.stack([i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 3)
    vertices = np.stack([x, y, 0.0015 * (x * x + y * y)], axis=1)
    surface = mesh_surface(vertices, np.concatenate([lower, upper]), "bowl")
    assert isinstance(surface, MeshSurface)
    request = FitRequest(facets=(COUNT, COUNT), surface=surface, edge="rectangle", polish="off")
    pattern = fit(request).pattern
    assert pattern is not None
    return pattern, whole_mesh(surface.layout).laid(surface.placement.angle)


def near(pattern: CreasePattern, target: WholeMesh) -> np.ndarray:
    assert pattern.folded_coords is not None
    return target.feet(pattern.folded_coords)


def cut(bowl: tuple[CreasePattern, WholeMesh], shape: str) -> tuple[CreasePattern, WholeMesh]:
    pattern, whole = bowl
    d = whole.domain
    centre = np.array([(d.u0 + d.u1) / 2, (d.v0 + d.v1) / 2])
    outline = Outline.of_loops([loop + centre for loop in SHAPES[shape]])
    target = replace(whole, outline=outline)
    return trimmed(pattern, target, near(pattern, target)), target


@pytest.mark.parametrize("shape", SHAPES)
def test_a_trimmed_sheet_is_exact(bowl: tuple[CreasePattern, WholeMesh], shape: str) -> None:
    pattern, _ = cut(bowl, shape)
    found = audit(pattern)
    assert found.valid, found.findings
    assert found.measurements.max_planarity is not None
    assert found.measurements.max_planarity < 1e-13
    assert found.measurements.max_isometry is not None
    assert found.measurements.max_isometry < 1e-12
    assert pattern.folded_coords is not None
    borders = 1 + (shape == "holed")
    euler = len(pattern.vertices_coords) - len(pattern.edges_vertices) + len(pattern.faces_vertices)
    assert euler == 2 - borders
    area = facet_areas(pattern.folded_coords, pattern.faces_vertices)
    assert area.min() >= SLIVER * np.median(area) * 0.9


@pytest.mark.parametrize("shape", SHAPES)
def test_it_covers_the_region_and_no_more(
    bowl: tuple[CreasePattern, WholeMesh], shape: str
) -> None:
    """Rays along the normals of the target, which the cut itself does not use for its edges."""
    pattern, target = cut(bowl, shape)
    uv = np.random.default_rng(4).uniform(-90, 90, (1500, 2)) + np.mean(
        [target.domain.lattice(2, 2)[0, 0], target.domain.lattice(2, 2)[1, 1]], axis=0
    )
    hit = paper_along_normals(pattern, target, uv)
    inside = target.outline.contains(uv)
    assert (hit & inside).sum() / inside.sum() > 0.97
    assert (hit & ~inside).sum() / inside.sum() < 0.012


def paper_along_normals(pattern: CreasePattern, target: WholeMesh, uv: Floats) -> Bools:
    """(n,) whether the line along the target's normal at ``uv`` meets the paper."""
    assert pattern.folded_coords is not None
    triangles = triangulate(pattern.faces_vertices, pattern.vertices_coords)[0]
    a, b, c = pattern.folded_coords[triangles].transpose(1, 0, 2)
    point, normal = target.point(uv)[:, None], target.normal(uv)[:, None]
    volumes = np.stack(
        [
            np.einsum("nfk,nfk->nf", np.cross(p - point, q - point), normal + 0 * p)
            for p, q in ((a, b), (b, c), (c, a))
        ]
    )
    same = (volumes >= 0).all(axis=0) | (volumes <= 0).all(axis=0)
    near = np.linalg.norm(a - point, axis=2) < 40
    return np.asarray((same & near).any(axis=1))


@pytest.mark.parametrize("reflex", [False, True])
def test_a_corner_of_the_outline_inside_a_facet_stays(
    bowl: tuple[CreasePattern, WholeMesh], reflex: bool
) -> None:
    whole, target = bowl
    assert whole.folded_coords is not None
    facet = 5 * COUNT + 6
    corners = whole.folded_coords[whole.faces_vertices[facet]]
    corner = target.feet(corners.mean(axis=0, keepdims=True))[0]
    loop = corner + np.array([[0, 0], [70, -30], [60, 60], [0, 70], [-5, 60.0]])
    if reflex:
        far = corner + np.array([[0, -65], [70, -65], [70, 60], [-60, 60], [-60, 5.0]])
        loop = np.concatenate([[corner], far])
    cornered = replace(target, outline=Outline.of_loops([loop]))
    pattern = trimmed(whole, cornered, near(whole, target))
    assert pattern.folded_coords is not None
    feet = target.feet(pattern.folded_coords)
    nearest = int(np.linalg.norm(feet - corner, axis=1).argmin())
    assert np.abs(feet[nearest] - corner).max() < 1e-6
    assert (pattern.faces_vertices == nearest).sum() == 1
    assert audit(pattern).valid


def test_all_parts_hang_on_creases(bowl: tuple[CreasePattern, WholeMesh]) -> None:
    whole, _ = bowl
    mean = float(edge_lengths(whole.vertices_coords, whole.edges_vertices).mean())
    pattern, _ = cut(bowl, "circle")
    faces = pattern.edges_faces
    long = edge_lengths(pattern.vertices_coords, pattern.edges_vertices) >= CREASE * mean
    reached = {0}
    for _ in faces:
        for one, other in faces[long & (faces >= 0).all(axis=1)].tolist():
            if one in reached or other in reached:
                reached |= {one, other}
        if len(reached) == len(pattern.faces_vertices):
            break
    assert len(reached) == len(pattern.faces_vertices)


def test_whole_facets_are_those_with_their_means_inside(
    bowl: tuple[CreasePattern, WholeMesh],
) -> None:
    whole, target = bowl
    d = target.domain
    outline = Outline.of_loops([72 * CIRCLE + np.array([(d.u0 + d.u1) / 2, (d.v0 + d.v1) / 2])])
    target = replace(target, outline=outline)
    pattern = inner_facets(whole, target, near(whole, target))
    assert whole.folded_coords is not None
    assert pattern.folded_coords is not None
    assert pattern.faces_vertices.shape[1] == 4
    assert audit(pattern).valid
    means = whole.folded_coords[whole.faces_vertices].mean(axis=1)
    inside = outline.contains(target.feet(means))
    kept = pattern.folded_coords[pattern.faces_vertices].mean(axis=1)
    assert np.abs(np.sort(kept, axis=0) - np.sort(means[inside], axis=0)).max() < 1e-12


def test_cut_facets_do_not_count_as_the_middle_of_a_sheet(
    bowl: tuple[CreasePattern, WholeMesh],
) -> None:
    pattern, target = cut(bowl, "circle")
    as_cut = replace(pattern, target=pattern.target | {"edge": "trim"})
    all_means, uncut = (nearness(each, target, target.tiles()) for each in (pattern, as_cut))
    before = nearness(bowl[0], target, target.tiles())
    assert uncut.means_to_target <= before.means_to_target
    assert all_means.means_to_target > 2 * before.means_to_target
    assert uncut.sheet_to_target == all_means.sheet_to_target


def test_a_sheet_of_two_pieces_is_cut_as_one(bowl: tuple[CreasePattern, WholeMesh]) -> None:
    whole, _ = bowl
    parted = in_two(whole)
    one, _ = cut(bowl, "notched")
    two, _ = cut((parted, bowl[1]), "notched")
    assert two.pieces_count == 2
    assert two.seams is not None
    assert len(two.faces_vertices) == len(one.faces_vertices)
    assert one.folded_coords is not None
    assert two.folded_coords is not None
    assert np.sort(facet_areas(one.folded_coords, one.faces_vertices)) == pytest.approx(
        np.sort(facet_areas(two.folded_coords, two.faces_vertices))
    )
    pairs = two.seam_vertices
    ends = two.folded_coords[pairs]
    assert np.abs(ends[:, :, 0] - ends[:, :, 1]).max() < 1e-12
    lengths = edge_lengths(two.vertices_coords, two.edges_vertices)[two.seams]
    assert lengths[:, 0] == pytest.approx(lengths[:, 1], rel=1e-12)
    assert two.cells is not None
    # the seam is cut at both ends of the outline, and facets stay on both sides of most of it
    inner = (one.edges_assignment != "B").sum() - (two.edges_assignment != "B").sum()
    assert inner == len(two.seams)
    assert audit(two).valid


@pytest.mark.parametrize("parted", [False, True])
@pytest.mark.parametrize("first", [False, True])
def test_an_edge_that_dips_outside_stays_an_edge(
    bowl: tuple[CreasePattern, WholeMesh],
    monkeypatch: pytest.MonkeyPatch,
    parted: bool,
    first: bool,
) -> None:
    """The facets on both sides keep the part outside, so it is a crease or a seam, no border."""
    pattern, target = in_two(bowl[0]) if parted else bowl[0], bowl[1]
    middle = 7 * (COUNT + 1) + COUNT // 2
    ends = pattern.edges_vertices == [middle, middle + COUNT + 1]
    edge = int(np.flatnonzero(ends.all(axis=1))[0])
    whole = trimmed(pattern, target, near(pattern, target))

    def dipping(*given: Any) -> EdgeCuts:
        cuts = edge_cuts(*given)
        line = int(cuts.line[edge])
        breaks, inside = list(cuts.breaks), cuts.starts_inside.copy()
        assert not breaks[line]
        assert inside[line]
        breaks[line], inside[line] = (0.6,), first
        return replace(cuts, breaks=tuple(breaks), starts_inside=inside)

    monkeypatch.setattr(trim, "edge_cuts", dipping)
    found = trimmed(pattern, target, near(pattern, target))
    assert audit(found).valid
    for letter in "BMVU":
        more = np.sum(found.edges_assignment == letter) - np.sum(whole.edges_assignment == letter)
        dips = letter == pattern.edges_assignment[edge]
        assert more == (1 + parted if dips else 0), letter
    assert len(seams(found)) == len(seams(whole)) + parted


def seams(pattern: CreasePattern) -> Ints:
    return np.empty((0, 2), dtype=np.int64) if pattern.seams is None else pattern.seams


def in_two(pattern: CreasePattern) -> CreasePattern:
    """``pattern``, a grid, with the facets right of its middle column as a piece of their own."""
    assert pattern.grid is not None
    assert pattern.folded_coords is not None
    columns, rows = pattern.grid
    middle = columns // 2
    column = np.arange(len(pattern.faces_vertices)) % (columns - 1)
    right = column >= middle
    first = len(pattern.vertices_coords)
    twin = np.arange(first)
    seam = np.arange(rows) * columns + middle
    twin[seam] = first + np.arange(rows)
    moved = np.concatenate([pattern.vertices_coords, pattern.vertices_coords[seam]])
    of_right = np.concatenate([np.arange(first) % columns > middle, np.ones(rows, dtype=bool)])
    moved[of_right, 0] += 50.0
    faces = np.where(right[:, None], twin[pattern.faces_vertices], pattern.faces_vertices)
    edges = pattern.edges_vertices
    to_right = (edges % columns > middle).any(axis=1)
    on_seam = (edges % columns == middle).all(axis=1)
    edges = np.where(to_right[:, None], twin[edges], edges)
    mates = twin[edges[on_seam]]
    seams = np.stack([np.flatnonzero(on_seam), len(edges) + np.arange(on_seam.sum())], axis=1)
    return replace(
        pattern,
        vertices_coords=moved,
        folded_coords=np.concatenate([pattern.folded_coords, pattern.folded_coords[seam]]),
        faces_vertices=faces,
        edges_vertices=np.concatenate([edges, mates]),
        edges_assignment=np.append(
            np.where(on_seam, "B", pattern.edges_assignment), ["B"] * len(mates)
        ),
        edges_fold_angle=np.append(
            np.where(on_seam, 0.0, pattern.edges_fold_angle), np.zeros(len(mates))
        ),
        grid=None,
        pieces=right.astype(np.int64),
        seams=seams,
        cells=np.stack([column, np.arange(len(faces)) // (columns - 1)], axis=1),
    )


@pytest.mark.parametrize("shape", SHAPES)
def test_a_trimmed_sheet_moves_from_nearly_flat_to_its_folded_form(
    bowl: tuple[CreasePattern, WholeMesh], shape: str
) -> None:
    pattern, _ = cut(bowl, shape)
    motion = bending_motion(pattern, 6)
    assert len(motion.frames) == 7
    flat = edge_lengths(pattern.vertices_coords, pattern.edges_vertices)
    for points in motion.frames:
        assert edge_lengths(points, pattern.edges_vertices) == pytest.approx(flat, rel=1e-8)
    assert motion.frames[-1] == pytest.approx(pattern.folded_coords, abs=1e-6)
    assert np.abs(motion.fold_angles[0]).max() < 0.2
