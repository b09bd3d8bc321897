"""The regions of tabs, each worked out anew by half planes, and the sides that bear them."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace

import flat_patterns
import numpy as np
import pytest
import shapely
from flat_patterns import bed, card, miura
from hypothesis import example, given, settings
from hypothesis import strategies as st

from miurafab.fabrication.double_tabs import double_tabs, in_pairs
from miurafab.fabrication.kerf import SHORTEST_MM
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.seams import all_seams, border_seams
from miurafab.fabrication.sheets import lay_out
from miurafab.fabrication.slots import slotted_tabs
from miurafab.fabrication.tab_choice import border_tabs, choose_tabs
from miurafab.fabrication.tabs import TabRegions, inset_of, tab_regions
from miurafab.origami.crease_pattern import CreasePattern

FAR = 1e4


def half_plane(point, normal, least):
    """The x with (x - point) . normal >= least, as far as ``FAR``; normal need not be a unit."""
    size = np.hypot(*normal)
    unit = normal / size
    along = FAR * np.array([-unit[1], unit[0]])
    at = point + unit * least / size
    return shapely.Polygon(
        [at - along, at + along, at + along + FAR * unit, at - along + FAR * unit]
    )


def sides_of(pattern, face):
    """[(edge, from, to, inward normal), ...] of one facet, counter-clockwise."""
    corners = pattern.vertices_coords[[v for v in pattern.faces_vertices[face] if v >= 0]]
    found = []
    for k, (a, b) in enumerate(zip(corners, np.roll(corners, -1, axis=0), strict=True)):
        along = (b - a) / np.hypot(*(b - a))
        edge = int(pattern.faces_edges[face, k])
        found.append((edge, a, b, np.array([-along[1], along[0]])))
    return found


def region(pattern, edge, face, material, shared=(), full=False, raised=False):
    """The tab on ``edge`` in ``face`` by the words of the module: (polygon, base) or None."""
    sides = sides_of(pattern, face)
    (own,) = [side for side in sides if side[0] == edge]
    _, start, end, up = own
    along, inset = np.array([up[1], -up[0]]), inset_of(material)
    height = material.tabs.height_mm * (2 if raised else 1)
    found = half_plane(start, up, 0.0)
    if not full:
        found &= half_plane(start, -up, -height)
    for other, a, _, normal in sides:
        if other == edge:
            continue
        found &= half_plane(a, normal, inset)
        if other in shared:
            gap = normal - up
            least = inset * np.hypot(*gap) + a @ normal - start @ up
            found &= half_plane(np.zeros(2), gap, least)

    def base_of(shape):
        if shape.is_empty or shape.geom_type != "Polygon":
            return None
        ring = shapely.get_coordinates(shape)
        low = ring[np.abs((ring - start) @ up) < 1e-9] - start
        places = low @ along
        return (places.min(), places.max()) if len(low) else None

    for beyond, clip in (
        (lambda base: base[0] < 0, half_plane(start, along, 0.0)),
        (lambda base: base[1] > np.hypot(*(end - start)), half_plane(end, -along, 0.0)),
    ):
        base = base_of(found)
        if base is not None and beyond(base):
            found &= clip
    base = base_of(found)
    if base is None or base[1] - base[0] < 1e-6:
        return None
    if not full:
        angle = math.pi / 2 if raised else material.tabs.max_angle
        for place, way in ((base[0], 1.0), (base[1], -1.0)):
            lean = way * math.sin(angle) * along - math.cos(angle) * up
            found &= half_plane(start + place * along, lean, 0.0)
        found &= half_plane(start, -up, -2 * (base[1] - base[0]))
    return found, np.array([start + place * along for place in base])


def moved(pattern, tabs, index):
    """A tab as glued, moved so that its mate's edge lies on its own, which runs the other way."""
    (own,) = [s for s in sides_of(pattern, tabs.own_face[index]) if s[0] == tabs.edge[index]]
    mate_edge = tabs.seams.edges[index, 1]
    (mate,) = [s for s in sides_of(pattern, tabs.mate_face[index]) if s[0] == mate_edge]
    turned = [complex(*(s[2] - s[1])) / np.hypot(*(s[2] - s[1])) for s in (own, mate)]
    points = tabs.glued[index, : tabs.count[index]] - mate[1]
    there = complex(*own[2]) - turned[0] / turned[1] * (points[:, 0] + 1j * points[:, 1])
    return np.column_stack([there.real, there.imag])


def shaken(seed, joined=True):
    """4 x 4 shaken cells, one in four cut into triangles and some dented, joined left to right."""
    rng = np.random.default_rng(seed)
    i, j = np.indices((5, 5))
    points = np.stack([j, i], axis=-1) + rng.uniform(-0.32, 0.32, (5, 5, 2))
    pattern = flat_patterns.grid(points * rng.uniform(1, 6) ** 2)
    cut = rng.random(16) < 0.25
    quads = pattern.faces_vertices
    padded = np.column_stack([quads[cut][:, [0, 1, 2]], np.full(cut.sum(), -1)])
    others = np.column_stack([quads[cut][:, [0, 2, 3]], np.full(cut.sum(), -1)])
    faces = np.concatenate([quads[~cut], padded, others])
    faces = np.pad(faces, ((0, 0), (0, 1)), constant_values=-1)  # as if there were a pentagon
    edges = np.concatenate([pattern.edges_vertices, quads[cut][:, [0, 2]]])
    letters = np.concatenate([pattern.edges_assignment, np.full(cut.sum(), "V")])
    ends = pattern.edges_vertices % 5
    left, right = (np.flatnonzero((ends == column).all(axis=1)) for column in (0, 4))
    return CreasePattern(
        vertices_coords=pattern.vertices_coords,
        edges_vertices=edges,
        edges_assignment=letters,
        edges_fold_angle=np.select([letters == "M", letters == "V"], [-1.0, 1.0], 0.0),
        faces_vertices=faces,
        seams=np.column_stack([left, right]) if joined else None,
    )


def dented(seed):
    """2 x 2 cells about a vertex that lies so far in one of them that it is not convex there."""
    rng = np.random.default_rng(seed)
    points = np.stack(np.meshgrid([0.0, 1, 2], [0.0, 1, 2]), axis=-1)
    points[1, 1] += 0.55 + rng.uniform(0.0, 0.4, 2)
    turn = rng.uniform(0, 2 * math.pi)
    c, s = math.cos(turn), math.sin(turn)
    return flat_patterns.grid(rng.uniform(5, 40) * points @ np.array([[c, s], [-s, c]]))


def assert_is_region(tabs, index, expected):
    """The tab is the polygon and has the base that are expected."""
    found = tabs.glued[index, : tabs.count[index]]
    if expected is None:
        assert len(found) < 3 or shapely.Polygon(found).area < 1e-4
        return
    made = shapely.Polygon(found)
    assert made.exterior.is_ccw
    assert shapely.symmetric_difference(made, expected[0]).area < 1e-5
    np.testing.assert_allclose(found[:2], expected[1], atol=1e-6)


@settings(derandomize=True, max_examples=80, deadline=None)
@given(
    st.sampled_from([shaken, dented]),
    st.integers(0, 10_000),
    st.floats(1.0, 30.0),
    st.floats(0.0, 2.0),
    st.floats(0.0, 0.5),
    st.floats(0.5, math.pi),
    st.booleans(),
    st.booleans(),
    st.booleans(),
)
def test_each_region_is_the_one_of_its_half_planes(
    make, seed, height, inset, kerf, angle, full, some_raised, some_shared
):
    rng = np.random.default_rng(seed)
    pattern, material = make(seed), card(tab=height, inset=inset, kerf=kerf)
    material = replace(material, tabs=replace(material.tabs, max_angle=angle))
    seams = all_seams(pattern, rng.permutation(len(pattern.faces_vertices)))
    seams = seams.swapped(rng.random(len(seams)) < 0.5)
    shared = rng.random(pattern.faces_edges.shape) < 0.5 if some_shared else None
    raised = rng.random(len(seams)) < 0.5 if some_raised else None
    tabs = tab_regions(pattern, seams, material, shared, full_facet=full, raised=raised)
    assert len(tabs) == len(seams)
    for k in range(len(seams)):
        edge, face = seams.edges[k, 1], tabs.mate_face[k]
        bears = () if shared is None else pattern.faces_edges[face][shared[face]]
        high = raised is not None and bool(raised[k])
        assert_is_region(tabs, k, region(pattern, edge, face, material, bears, full, high))
        np.testing.assert_allclose(tabs.polygon(k), moved(pattern, tabs, k), atol=1e-7)


def regions(polygons):
    """Tabs of the given corners; where they stand means nothing."""
    most = max(map(len, polygons))
    points = np.array([[*p, *([[7.0, -3.0]] * (most - len(p)))] for p in polygons])
    pattern = miura(len(polygons) + 1, 1)
    seams = all_seams(pattern, np.arange(len(polygons) + 1))
    return TabRegions(seams, points, points + 1, np.array([len(p) for p in polygons]))


def test_areas_are_those_of_the_real_corners_and_few_are_usable():
    box = [[0.0, 0], [5, 0], [5, 2], [0, 2]]
    tabs = regions(
        [
            box,
            [[0.0, 0], [2.5, 0], [2.5, 1], [0, 1]],  # all at the least: 2.5 mm, 1 mm mean height
            [[0.0, 0], [2.499, 0], [2.499, 2], [0, 2]],  # the base
            [[0.0, 0], [5, 0], [2, 1.9]],  # 4.75 mm2 over 5 mm
            [[0.0, 0], [4, 0], [4, 1]],  # 2 mm2, but only half a mm high
            [[0.0, 0], [5, 0]],
        ]
    )
    shapes = [shapely.Polygon(tabs.polygon(k)).area for k in range(5)]
    np.testing.assert_allclose(tabs.areas, [*shapes, 0.0], atol=1e-12)
    assert tabs.usable.tolist() == [True, True, False, False, False, False]
    np.testing.assert_allclose(tabs.glue, [10.0, 2.5, 0, 0, 0, 0])
    assert tabs.present.sum(axis=1).tolist() == tabs.count.tolist() == [4, 4, 4, 3, 3, 2]


def test_tabs_are_taken_and_joined_with_their_corners():
    triangle = [[0.0, 0], [5, 0], [2, 3]]
    one = regions([triangle, triangle])
    other = regions([[[0.0, 0], [5, 0], [5, 2], [2, 4], [0, 2]]])
    both = one.joined(other)
    assert both.count.tolist() == [3, 3, 5]
    for whole, parts in ((both, (one, other)), (other.joined(one), (other, one))):
        at = 0
        for part in parts:
            for k in range(len(part)):
                np.testing.assert_array_equal(whole.polygon(at), part.polygon(k))
                corners = whole.glued[at, : whole.count[at]]
                np.testing.assert_array_equal(corners, part.polygon(k) + 1)
                assert whole.edge[at] == part.edge[k]
                at += 1
    last = both.take(np.array([2]))
    np.testing.assert_array_equal(last.polygon(0), other.polygon(0))
    assert (len(last), last.edge[0]) == (1, other.edge[0])


def test_the_inset_keeps_two_cuts_apart():
    assert inset_of(card(inset=0.3, kerf=0.1)) == 0.3
    assert inset_of(card(inset=0.3, kerf=0.4)) == pytest.approx(0.45)


SIDES = ("lower", "upper", "alternate")


@pytest.mark.parametrize("join", ["glue", "slots"])
@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("patches", [np.repeat([2, 0, 3, 1], 3), np.zeros(12, dtype=np.int64)])
def test_the_side_that_is_asked_for_bears_the_tab(side, join, patches):
    """Cells of 40 mm, where each tab is large enough; the two outer borders are joined."""
    lines = np.arange(4) * 40.0, np.arange(5) * 40.0
    pattern = flat_patterns.grid(np.stack(np.meshgrid(*lines), axis=-1))
    ends = pattern.edges_vertices // 4
    low, high = (np.flatnonzero((ends == row).all(axis=1)) for row in (0, 4))
    pattern = replace(pattern, seams=np.column_stack([high, low]))
    tabs, unusual, untabbed = choose_tabs(
        pattern, patches, card(), LayoutOptions(tab_side=side, join=join)
    )
    assert len(untabbed) == 0
    assert unusual.dtype == bool
    assert unusual.tolist() == [join == "slots"] * len(tabs)
    seams = all_seams(pattern, patches)
    assert len(tabs) == len(seams) == len(np.unique(patches)) * 3
    turn: dict[tuple[int, int], int] = {}
    for k, ((one, other), faces) in enumerate(zip(seams.edges, seams.faces, strict=True)):
        pair = tuple(sorted(patches[faces].tolist()))
        turn[pair] = turn.get(pair, -1) + 1
        to_lower = {"lower": True, "upper": False, "alternate": turn[pair] % 2 == 0}[side]
        if pair[0] != pair[1]:
            own = min(pair) if to_lower else max(pair)
            assert patches[tabs.own_face[k]] == own
        else:
            own = min(one, other) if to_lower else max(one, other)
            assert tabs.edge[k] == own
        assert set(tabs.seams.edges[k]) == {one, other}


def test_a_cut_in_the_pattern_gets_no_tab():
    pattern = miura(3, 1, a=30.0, b=20.0)
    inner = np.flatnonzero((pattern.edges_faces >= 0).all(axis=1))
    letters = pattern.edges_assignment.copy()
    letters[inner[0]] = "C"
    tabs, _, untabbed = choose_tabs(
        replace(pattern, edges_assignment=letters), np.arange(3), card()
    )
    assert tabs.edge.tolist() == [inner[1]]
    assert len(untabbed) == 0


def test_a_tab_folds_as_the_crease_along_its_seam():
    pattern = miura(5, 1, a=30.0, b=20.0)
    inner = np.flatnonzero((pattern.edges_faces >= 0).all(axis=1))
    letters, angles = pattern.edges_assignment.copy(), pattern.edges_fold_angle.copy()
    letters[inner], angles[inner] = list("MVUF"), [-1.0, 1.0, 0.0, 0.0]
    pattern = replace(pattern, edges_assignment=letters, edges_fold_angle=angles)
    layout = lay_out(
        pattern, bed(300.0, 300.0), card(), options=LayoutOptions(max_patch_mm=(50.0, 50.0))
    )
    assert len(layout.patches) == 5
    folds = {tab.edge: tab.fold for patch in layout.patches for tab in patch.tabs}
    said = ["mountain", "valley", "unassigned", "flat"]
    assert folds == dict(zip(inner.tolist(), said, strict=True))


def test_a_tight_patch_keeps_its_standard_tabs():
    """Of four patches with weak tabs, those that are tight get none that is raised."""
    pattern = miura(4, 4, 10.0, 10.0, sector=np.pi / 2)
    patches, material = np.repeat([0, 1, 2, 3], 4), card(tab=0.8)
    material = replace(material, tabs=replace(material.tabs, max_angle=math.pi / 2))
    for tight in ([True] * 4, [False, True, False, False], [False] * 4):
        tabs, unusual, _ = choose_tabs(pattern, patches, material, tight=np.array(tight))
        own = patches[tabs.own_face]
        heights = tabs.areas / np.linalg.norm(tabs.points[:, 1] - tabs.points[:, 0], axis=1)
        loose = ~np.array(tight)[own]
        # 9.4 x 0.8 mm is too little glue, and 9.4 x 1.6 mm enough.
        assert unusual.tolist() == loose.tolist()
        np.testing.assert_allclose(heights, np.where(loose, 1.6, 0.8), atol=1e-6)


def test_a_tab_does_not_go_over_to_a_patch_that_is_tight():
    points = np.stack(np.meshgrid([0.0, 20, 21.2, 60], [0.0, 20]), axis=-1)
    pattern = flat_patterns.grid(points)
    material = card(inset=0.1, kerf=0.0)
    material = replace(material, tabs=replace(material.tabs, min_area_mm2=30.0))
    for tight, mates in (([False] * 3, [0, 2]), ([False, True, False], [1, 2])):
        tabs, unusual, untabbed = choose_tabs(
            pattern, np.arange(3), material, tight=np.array(tight)
        )
        # The middle facet is 1.2 mm wide, so that the tab in it is weak, but holds.
        assert tabs.mate_face.tolist() == mates
        assert unusual.tolist() == [True, False]
        assert len(untabbed) == 0


def test_a_tab_of_just_the_least_glue_is_not_weak():
    pattern = miura(2, 1, a=30.0, b=20.0, sector=np.pi / 2)
    points = np.stack(np.meshgrid([0.0, 20, 21.2, 60], [0.0, 20]), axis=-1)
    beside = flat_patterns.grid(points)
    for sheet, expected in ((pattern, [False]), (beside, [True, False])):
        patches = np.arange(len(sheet.faces_vertices))
        material = card(inset=0.1, kerf=0.0)
        area = choose_tabs(sheet, patches, material)[0].areas[-1]
        for least, weak in ((area, False), (np.nextafter(area, np.inf), True)):
            asked = replace(material, tabs=replace(material.tabs, min_area_mm2=float(least)))
            unusual = choose_tabs(sheet, patches, asked)[1]
            assert unusual.tolist() == [*expected[:-1], weak]


@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
def test_a_weak_tab_stays_where_the_other_side_has_no_more_room(order):
    pattern = miura(2, 1, a=32.0, b=16.0, sector=np.pi / 2)
    material = card()
    material = replace(material, tabs=replace(material.tabs, min_area_mm2=1e6))
    tabs, unusual, _ = choose_tabs(pattern, np.array(order), material)
    assert order[tabs.own_face[0]] == 0
    assert unusual.tolist() == [True]


def test_a_weak_tab_goes_where_there_is_somewhat_more_room():
    pattern = flat_patterns.grid(np.stack(np.meshgrid([0.0, 1.9, 3.1], [0.0, 20]), axis=-1))
    material = card(inset=0.1, kerf=0.0)
    material = replace(material, tabs=replace(material.tabs, min_area_mm2=1e6))
    for order in ([0, 1], [1, 0]):
        tabs, _, _ = choose_tabs(pattern, np.array(order), material)
        assert tabs.mate_face.tolist() == [0]


def test_a_full_facet_tab_has_no_limit_but_the_facet():
    pattern = shaken(8)
    patches = np.arange(len(pattern.faces_vertices))
    tabs, _, _ = choose_tabs(pattern, patches, card(), LayoutOptions(full_facet=True))
    shared = {}
    for edge, face in zip(tabs.seams.edges[:, 1], tabs.mate_face, strict=True):
        shared.setdefault(int(face), []).append(int(edge))
    lone = [k for k in range(len(tabs)) if len(shared[int(tabs.mate_face[k])]) == 1]
    assert len(lone) > 2
    for k in lone:
        edge, face = tabs.seams.edges[k, 1], tabs.mate_face[k]
        assert_is_region(tabs, k, region(pattern, edge, face, card(), full=True))


@pytest.mark.parametrize("widths", [(30.0, 30.0), (30.0, 4.0), (4.0, 30.0), (4.0, 4.0)])
@pytest.mark.parametrize("tight", [(False, False), (False, True), (True, False), (True, True)])
@pytest.mark.parametrize("side", ["lower", "upper"])
@pytest.mark.parametrize("ticks", [None, 2.0])
def test_a_tab_for_a_slot_goes_where_there_is_room(widths, tight, side, ticks):
    """To the other patch only if there is none here, there is some there, and it is not tight."""
    lines = np.cumsum([0.0, *widths])
    pattern = flat_patterns.grid(np.stack(np.meshgrid(lines, [0.0, 40.0]), axis=-1))
    options = LayoutOptions(join="slots", tab_side=side, ticks_mm=ticks)
    tabs, unusual, untabbed = choose_tabs(
        pattern, np.arange(2), card(), options, tight=np.array(tight)
    )
    seams = all_seams(pattern, np.arange(2))
    alone = {}
    for own in (0, 1):
        turned = seams.swapped(seams.faces[:, 0] != own)
        bearing = pattern.faces_edges == turned.edges[0, 1]
        bearing[own] = False
        alone[own] = slotted_tabs(
            pattern, turned, card(), bearing, np.array([tight[own]]), ticks or 0.0
        )
    first = 0 if side == "lower" else 1
    here, there = (bool(alone[own].usable[0]) for own in (first, 1 - first))
    if here:
        own = first
    elif there and not tight[1 - first]:
        own = 1 - first
    else:
        assert len(tabs) == 0
        assert untabbed.tolist() == seams.edges[:, 0].tolist()
        return
    assert tabs.own_face.tolist() == [own]
    assert unusual.tolist() == [not tight[own]]
    np.testing.assert_array_equal(tabs.polygon(0), alone[own].polygon(0))


def test_all_tabs_of_a_border_stand_on_either_side():
    pattern = shaken(5)
    seams = border_seams(pattern)
    tabs = border_tabs(pattern, card(), LayoutOptions())
    want = np.concatenate([seams.edges, seams.edges[:, ::-1]])
    np.testing.assert_array_equal(tabs.seams.edges, want)
    for full in (False, True):
        tabs = border_tabs(pattern, card(), LayoutOptions(full_facet=full))
        for k in range(len(tabs)):
            edge, face = tabs.seams.edges[k, 1], tabs.mate_face[k]
            assert_is_region(tabs, k, region(pattern, edge, face, card(), full=full))
    free = len(border_tabs(pattern, card(), LayoutOptions(border_tabs="all")))
    assert free > len(tabs)


def test_tabs_on_open_borders_come_after_those_of_the_seams():
    pattern = miura(2, 1, a=30.0, b=20.0, sector=np.pi / 2)
    tabs, unusual, _ = choose_tabs(
        pattern, np.array([0, 1]), card(), LayoutOptions(border_tabs="all")
    )
    assert (tabs.mate_face < 0).tolist() == [False] + [True] * 6
    assert unusual.tolist() == [False] * 7


@settings(derandomize=True, max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.floats(2.0, 20.0), st.floats(0.0, 1.0))
@example(3, 20.0, 0.0)
def test_a_double_tab_is_what_two_tabs_have_in_common(seed, height, inset):
    pattern, material = shaken(seed, joined=False), card(tab=height, inset=inset)
    seams = all_seams(pattern, np.arange(len(pattern.faces_vertices)))
    none = np.zeros(pattern.faces_edges.shape, dtype=bool)
    tabs, count = double_tabs(pattern, seams, material, none), len(seams)
    assert len(tabs) == 2 * count
    assert set(tabs.seams.fold) == {"M"}
    np.testing.assert_array_equal(tabs.edge, np.tile(seams.edges[:, 0], 2))
    np.testing.assert_array_equal(
        tabs.own_face, np.concatenate([seams.faces[:, 0], seams.faces[:, 1]])
    )
    for k in range(count):
        edge = seams.edges[k, 0]
        one, other = (region(pattern, edge, face, material) for face in seams.faces[k, ::-1])
        a, b = pattern.vertices_coords[pattern.edges_vertices[edge]]
        along = (b - a) / np.hypot(*(b - a))

        def mirrored(points, a=a, along=along):
            off = points - a
            return a + 2 * np.outer(off @ along, along) - off

        found = [tabs.polygon(k + half * count) for half in (0, 1)]
        common = None
        if one is not None and other is not None:
            # Without a grid GEOS may find nothing where the two share a side but for rounding.
            image = shapely.transform(other[0], mirrored)
            common = shapely.intersection(one[0], image, grid_size=1e-8)
        if common is None or common.area < 1e-3:
            assert all(len(p) < 3 or shapely.Polygon(p).area < 2e-3 for p in found)
            continue
        if len(found[0]) < 3:
            assert common.area < 0.05 + SHORTEST_MM * common.length, "no base in common, or specks"
            continue
        made = shapely.Polygon(found[0])
        # A side shorter than programs draw may be missing.
        assert shapely.symmetric_difference(made, common).area < 1e-5 + SHORTEST_MM * made.length
        assert made.exterior.is_ccw
        sides = np.linalg.norm(np.roll(found[0], -1, axis=0) - found[0], axis=1)
        assert sides[1:].min() >= SHORTEST_MM
        image = mirrored(found[1])
        np.testing.assert_allclose(np.roll(image[::-1], 2, axis=0), found[0], atol=1e-9)


def test_double_tabs_of_triangles_are_triangles():
    """Of two equilateral facets of 12 mm, less the inset on two sides."""
    high = 6 * math.sqrt(3)
    pattern = CreasePattern(
        vertices_coords=np.array([[0.0, 0], [12, 0], [6, high], [6, -high]]),
        edges_vertices=np.array([[0, 1], [1, 2], [2, 0], [0, 3], [3, 1]]),
        edges_assignment=np.array(["V", "B", "B", "B", "B"]),
        edges_fold_angle=np.array([1.0, 0, 0, 0, 0]),
        faces_vertices=np.array([[0, 1, 2], [1, 0, 3]]),
    )
    material = card(tab=30.0, inset=0.5)
    tabs, _, _ = choose_tabs(pattern, np.arange(2), material, LayoutOptions(join="double"))
    assert tabs.count.tolist() == [3, 3]
    base = 12 - 2 * 0.5 / math.sin(math.pi / 3)
    np.testing.assert_allclose(tabs.areas, math.sqrt(3) / 4 * base**2, rtol=1e-8)


@settings(derandomize=True, max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_double_tabs_of_one_patch_share_the_facet_that_they_are_drawn_on(seed):
    """Where one is drawn alone, it is as large as if it were the only one."""
    pattern, material = shaken(seed, joined=False), card(tab=12.0, inset=0.4)
    patches = np.random.default_rng(seed).integers(0, 4, len(pattern.faces_vertices))
    seams = all_seams(pattern, patches)
    none = np.zeros(pattern.faces_edges.shape, dtype=bool)
    alone = double_tabs(pattern, seams, material, none)
    names = zip(alone.edge.tolist(), alone.own_face.tolist(), strict=True)
    free = {name: alone.polygon(k) for k, name in enumerate(names)}
    tabs, unusual, _ = choose_tabs(pattern, patches, material, LayoutOptions(join="double"))
    assert unusual.tolist() == [False] * len(tabs)
    pairs = np.unique(np.sort(tabs.seams.edges), axis=0, return_counts=True)[1]
    assert (pairs == 2).all()
    sides = np.concatenate([seams.faces, seams.faces[:, ::-1]])
    drawn = Counter((int(patches[own]), int(mate)) for own, mate in sides)
    shared = {mate for (_, mate), times in drawn.items() if times > 1}
    shapes = {}
    for k in range(len(tabs)):
        own, mate = tabs.own_face[k], tabs.mate_face[k]
        here, there = (int(patches[own]), int(mate)), (int(patches[mate]), int(own))
        shapes.setdefault(here, []).append(shapely.Polygon(tabs.glued[k, : tabs.count[k]]))
        if not {here[1], there[1]} & shared:
            whole = free[int(tabs.edge[k]), int(own)]
            np.testing.assert_allclose(tabs.polygon(k), whole, atol=1e-4)
    for several in shapes.values():
        for i, one in enumerate(several):
            for other in several[:i]:
                assert one.distance(other) > 2 * inset_of(material) - 1e-5


def test_a_double_tab_without_its_other_half_is_not_kept():
    pattern = miura(4, 1, a=30.0, b=20.0, sector=np.pi / 2)
    tabs, _, _ = choose_tabs(
        pattern, np.arange(4), card(), LayoutOptions(join="double", border_tabs="all")
    )
    assert (tabs.mate_face >= 0).sum() == 6
    pairs = tabs.take(np.array([0, 1, 2, 3, 4, 5, 6, 7]))
    kept = np.array([True, True, False, True, False, False, True, False])
    assert pairs.edge[:3].tolist() == pairs.edge[3:6].tolist()
    assert in_pairs(pairs, kept).tolist() == [True, False, False, True, False, False, True, False]


def test_slots_keep_clear_of_the_ticks_that_are_asked_for():
    pattern, patches, material = miura(3, 1, a=30.0, b=20.0), np.arange(3), card()
    bases = []
    for ticks in (None, 3.0):
        options = LayoutOptions(join="slots", ticks_mm=ticks)
        tabs, _, _ = choose_tabs(pattern, patches, material, options)
        alone = slotted_tabs(
            pattern, tabs.seams, material, None, np.full(len(tabs), False), ticks or 0.0
        )
        np.testing.assert_allclose(tabs.points, alone.points, atol=1e-9)
        bases.append(np.linalg.norm(tabs.points[:, 1] - tabs.points[:, 0], axis=1))
    assert not np.isclose(*bases).any()


def test_tabs_of_joined_borders_alone_stand_at_their_own_sides():
    """No seam of one patch is an edge that two facets share."""
    pattern = shaken(3)
    seams = all_seams(pattern, np.zeros(len(pattern.faces_vertices), dtype=np.int64))
    assert (seams.edges[:, 0] != seams.edges[:, 1]).all()
    tabs = tab_regions(pattern, seams, card())
    assert tabs.usable.any()
    for k in range(len(seams)):
        np.testing.assert_allclose(tabs.polygon(k), moved(pattern, tabs, k), atol=1e-7)


def test_a_tab_with_just_enough_glue_stays_as_it_is():
    pattern, patches, material = miura(3, 1, a=30.0, b=20.0), np.arange(3), card()
    usual, _, _ = choose_tabs(pattern, patches, material)
    least = float(usual.glue.min())
    for area, unusual in ((least, False), (np.nextafter(least, np.inf), True)):
        rule = replace(material.tabs, min_area_mm2=area)
        found = choose_tabs(pattern, patches, replace(material, tabs=rule))[1]
        assert found.any() == unusual
