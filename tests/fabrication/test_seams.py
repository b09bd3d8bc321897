"""Borders that the folded form brings together: found, glued, numbered, and closed last."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import shapely
from flat_patterns import bed, card, facet_polygons, miura, without_grid
from rings import revolved, tube

from miurafab.fabrication.assembly import assembly_order
from miurafab.fabrication.labels import Sides, place_texts
from miurafab.fabrication.layout import write_layout
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.patch_outline import outline_patches
from miurafab.fabrication.seam_names import tab_labels
from miurafab.fabrication.seams import border_seams
from miurafab.fabrication.sheets import lay_out
from miurafab.fabrication.tabs import inset_of

CASES = {"ring": lambda: revolved("6x16", "220mm"), "tube": tube}
BEDS = {"one patch": (1200.0, 900.0), "several": (220.0, 160.0)}


@pytest.fixture(scope="module", params=CASES)
def closed(request):
    return CASES[request.param]()


def row_edges(pattern, row):
    """The edges along one row of vertices of a grid, in order."""
    columns = pattern.grid[0]
    low, high = np.sort(pattern.edges_vertices, axis=1).T
    return np.flatnonzero((high - low == 1) & (low // columns == row) & (high // columns == row))


def test_the_first_and_last_row_of_a_ring_are_a_seam(closed):
    seams = border_seams(closed)
    _, rows = closed.grid
    first, last = row_edges(closed, 0), row_edges(closed, rows - 1)
    np.testing.assert_array_equal(seams.edges, np.column_stack([first, last]))
    np.testing.assert_array_equal(seams.faces, closed.edges_faces[seams.edges].max(axis=2))


def test_the_seam_of_a_ring_folds_as_the_row_a_period_farther(closed):
    seams = border_seams(closed)
    np.testing.assert_array_equal(seams.fold, closed.edges_assignment[row_edges(closed, 2)])


def flat_folded(pattern):
    """All layers of a sheet on each other: nothing of this is glued."""
    points = np.pad(pattern.vertices_coords, ((0, 0), (0, 1)))
    columns = pattern.grid[0]
    return replace(pattern, folded_coords=points[np.arange(len(points)) % columns])


def book():
    """Two pages closed upon each other: their three free edges coincide in pairs."""
    pattern = miura(2, 1, 20.0, 30.0, sector=np.pi / 2)
    points = np.pad(pattern.vertices_coords, ((0, 0), (0, 1)))
    points[[2, 5], 0] = points[[0, 3], 0]
    return replace(pattern, folded_coords=points)


@pytest.mark.parametrize(
    "make",
    [
        pytest.param(lambda: miura(6, 5), id="flat pattern alone"),
        pytest.param(lambda: revolved("6x16", "220mm", close="open"), id="open ring"),
        pytest.param(lambda: flat_folded(miura(6, 6)), id="folded together"),
        pytest.param(book, id="closed book"),
    ],
)
def test_what_is_not_glued_is_no_seam(make):
    assert len(border_seams(make())) == 0


def carried(points, start, end, to_start, to_end):
    """``points`` moved as the segment ``start`` - ``end`` onto ``to_start`` - ``to_end``."""
    along, to = complex(*(end - start)), complex(*(to_end - to_start))
    moved = (points - start) @ [1, 1j] * (to / along) + complex(*to_start)
    return np.column_stack([moved.real, moved.imag])


def ends_of(pattern, edge, face):
    """The ends of an edge with its facet on the left."""
    corners = pattern.faces_vertices[face].tolist()
    at = pattern.faces_edges[face].tolist().index(edge)
    return pattern.vertices_coords[[corners[at], corners[(at + 1) % len(corners)]]]


@pytest.mark.parametrize("size", BEDS)
@pytest.mark.parametrize("side", ["lower", "upper", "alternate"])
@pytest.mark.parametrize("gridded", [True, False])
def test_each_ring_tab_is_in_its_mate_and_off_everything_else(closed, size, side, gridded):
    pattern = closed if gridded else without_grid_of(closed)
    material = card()
    options = LayoutOptions(tab_side=side)
    outlined = outline_patches(pattern, *BEDS[size], material, options)
    tabs, facets = outlined.tabs, facet_polygons(pattern)
    across = tabs.seams.edges[:, 0] != tabs.seams.edges[:, 1]
    assert across.sum() == len(border_seams(pattern))
    assert not len(outlined.untabbed)
    shapes = np.array([shapely.Polygon(tabs.polygon(k)) for k in range(len(tabs))])
    owner = outlined.face_patch[tabs.own_face]
    for k in np.flatnonzero(across).tolist():
        (own, mate), (edge, far) = tabs.seams.faces[k], tabs.seams.edges[k]
        a, b = ends_of(pattern, edge, own)
        c, d = ends_of(pattern, far, mate)
        glued = shapely.Polygon(carried(tabs.polygon(k), a, b, d, c))
        assert glued.equals_exact(shapely.Polygon(tabs.glued[k, : tabs.count[k]]), 1e-6)
        assert facets[mate].buffer(1e-6).contains(glued)
        rest = shapely.difference(facets[mate].exterior, shapely.LineString([c, d]).buffer(1e-5))
        assert glued.distance(rest) >= inset_of(material) - 1e-5
        # What is glued into one facet does not overlap.
        for other in np.flatnonzero(tabs.mate_face == mate).tolist():
            if other != k:
                ring = tabs.glued[other, : tabs.count[other]]
                assert glued.distance(shapely.Polygon(ring)) >= inset_of(material) - 1e-5
        # In the flat pattern it touches its patch in its base alone, and no tab of that patch.
        patch = shapely.union_all(facets[outlined.patches[owner[k]].faces], grid_size=1e-9)
        base = shapely.LineString(tabs.polygon(k)[:2])
        free = shapely.difference(shapes[k], base.buffer(1e-5))
        assert free.distance(patch) > 0
        same = np.setdiff1d(np.flatnonzero(owner == owner[k]), [k])
        assert (shapely.distance(shapes[k], shapes[same]) > 0).all()
    for number, piece in enumerate(outlined.patches):
        outline = shapely.Polygon(piece.rings[0], piece.rings[1:])
        assert outline.is_valid
        assert outline.area == pytest.approx(
            shapely.area(facets[piece.faces]).sum() + tabs.areas[owner == number].sum()
        )


def without_grid_of(pattern):
    return replace(without_grid(pattern), folded_coords=pattern.folded_coords)


@pytest.mark.parametrize("size", BEDS)
def test_the_layout_of_a_ring_tells_its_seam(closed, size):
    layout = lay_out(closed, bed(*BEDS[size]), card())
    document = json.loads(write_layout(layout, "p", "s"))
    seams = border_seams(closed)
    home = {face: patch["id"] for patch in document["patches"] for face in patch["faces"]}
    told = {
        (tab["edge"], tab["mate_edge"]): (patch["id"], tab["mate_patch"], tab["fold"])
        for patch in document["patches"]
        for tab in patch["tabs"]
        if tab["edge"] != tab["mate_edge"]
    }
    names = {"M": "mountain", "V": "valley"}
    assert told == {
        (int(one), int(other)): (home[int(f)], home[int(g)], names[str(fold)])
        for (one, other), (f, g), fold in zip(seams.edges, seams.faces, seams.fold, strict=True)
    }
    length = np.linalg.norm(
        np.diff(closed.vertices_coords[closed.edges_vertices[seams.edges[:, 0]]], axis=1), axis=2
    ).sum()
    if size == "one patch":
        assert layout.totals.seam_mm == pytest.approx(length)
    # Each fold is made on the side that bears the tab, and on no other.
    made = {edge for path in layout.toolpaths for edge in path.edge.tolist()}
    assert set(seams.edges[:, 0].tolist()) <= made
    assert not set(seams.edges[:, 1].tolist()) & made


FRONT = Sides("front", "front", "front")


def test_both_edges_of_a_ring_seam_are_labelled(closed):
    outlined = outline_patches(closed, *BEDS["one patch"], card())
    tabs, facets = outlined.tabs, facet_polygons(closed)
    labels = tab_labels(closed, outlined.face_patch, tabs)
    lettering = place_texts(closed, outlined.face_patch, ["P1"], tabs, labels, np.zeros(1), FRONT)
    assert lettering.left_out == lettering.unmarked == 0
    where = {
        text.text: shapely.MultiLineString([stroke.tolist() for stroke in text.strokes])
        for text in lettering.texts
    }
    for k, label in enumerate(labels):
        marked = where[f"{label}{tabs.seams.fold[k]}"]
        assert shapely.Polygon(tabs.polygon(k)).contains(marked)
        assert facets[tabs.mate_face[k]].contains(where[label])
        assert shapely.Polygon(tabs.glued[k, : tabs.count[k]]).contains(where[label])


@pytest.mark.parametrize("size", BEDS)
def test_a_ring_is_closed_when_all_else_is_glued(closed, size):
    layout = lay_out(closed, bed(*BEDS[size]), card())
    steps = assembly_order(layout, closed)
    closing = [step.closes for step in steps]
    assert closing == sorted(closing), "what closes comes last"
    assert any(closing)
    ring = {
        tab.number for patch in layout.patches for tab in patch.tabs if tab.edge != tab.mate_edge
    }
    assert {n for step in steps if step.closes for n in step.tabs} == ring
    assert sorted(n for step in steps for n in step.tabs) == list(range(1, layout.totals.tabs + 1))
    assert sorted(step.patch for step in steps if not step.closes) == [
        patch.id for patch in layout.patches
    ]
