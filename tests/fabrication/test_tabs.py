"""Tabs: each in its mate facet, off everything else."""

from __future__ import annotations

import dataclasses
import math

import flat_patterns
import needles
import numpy as np
import pytest
import shapely
from flat_patterns import card, facet_polygons, miura, triangles, zigzag
from hypothesis import given, settings
from hypothesis import strategies as st

from miurafab.fabrication.layout_findings import longest_run
from miurafab.fabrication.partition.patch_outline import outline_patches
from miurafab.fabrication.tab_choice import choose_tabs
from miurafab.fabrication.tabs import MIN_BASE_MM, MIN_SIDE_MM, inset_of
from miurafab.origami.crease_pattern import CreasePattern

CASES = {
    "mild": (miura(24, 20), card()),
    "acute": (zigzag(18, 20, sector=0.55), card()),
    "very acute": (zigzag(16, 14, a=25.0, sector=0.35), card()),
    "fan": (flat_patterns.fan(26, 22, radius=250.0), card(tab=12.0)),
    "triangles": (triangles(3, 15, 520.0), card()),
    "ring": (triangles(4, 15, 520.0, hole=True), card(tab=20.0)),
    "no inset": (miura(24, 20), card(inset=0.0)),
    "single facets": (miura(4, 4, a=60.0, b=60.0), card(tab=30.0)),
}


def with_angle(material, angle):
    return dataclasses.replace(material, tabs=dataclasses.replace(material.tabs, max_angle=angle))


def common_area(one, other) -> float:
    # Without a grid GEOS may give a whole polygon that only touches the other one.
    return shapely.area(shapely.intersection(one, other, grid_size=1e-9))


def assert_tabs_are_sound(pattern, outlined, material):
    tabs, facets = outlined.tabs, facet_polygons(pattern)
    patches = [shapely.union_all(facets[piece.faces]) for piece in outlined.patches]
    shapes = np.array([shapely.Polygon(tabs.polygon(i)) for i in range(len(tabs))])
    assert shapely.is_valid(shapes).all()
    owner = outlined.face_patch[tabs.own_face]
    for i, shape in enumerate(shapes):
        edge, own, mate = tabs.edge[i], tabs.own_face[i], tabs.mate_face[i]
        assert {own, mate} == set(pattern.edges_faces[edge])
        assert outlined.face_patch[own] != outlined.face_patch[mate]
        # In its mate facet, as far as its inset from every other side.
        seam = shapely.LineString(pattern.vertices_coords[pattern.edges_vertices[edge]])
        assert facets[mate].buffer(1e-9).contains(shape)
        rest = shapely.difference(facets[mate].exterior, seam.buffer(1e-7))
        assert shape.distance(rest) >= inset_of(material) - 1e-6
        # Along its seam edge, and no higher than asked.
        base = shapely.LineString(shapely.get_coordinates(shape)[:2])
        assert seam.buffer(1e-9).contains(base)
        assert base.length >= MIN_BASE_MM - 1e-9
        assert shape.area >= MIN_SIDE_MM * base.length - 1e-9
        line = shapely.get_coordinates(seam)
        way = (line[1] - line[0]) / np.linalg.norm(line[1] - line[0])
        off = (tabs.polygon(i) - line[0]) @ np.array([-way[1], way[0]])
        assert np.abs(off).max() <= material.tabs.height_mm + 1e-9
        # Off its own patch: it touches it in the base alone.
        assert common_area(shape, patches[owner[i]]) < 1e-6
        sides = shapely.difference(shape.exterior, base.buffer(1e-6))
        assert sides.distance(patches[owner[i]]) > 0
    # Off every other tab, and so far off that the cuts between them stay open.
    met = shapely.STRtree(shapes).query(shapes, predicate="intersects")
    assert (met[0] == met[1]).all()
    assert all(len(piece.cut_lines) == 1 for piece in outlined.patches)


@pytest.mark.parametrize("name", CASES)
def test_each_tab_is_in_its_mate_and_off_its_own_patch_and_every_other_tab(name):
    pattern, material = CASES[name]
    outlined = outline_patches(pattern, 190.0, 140.0, material)
    assert len(outlined.tabs)
    assert_tabs_are_sound(pattern, outlined, material)


@pytest.mark.parametrize("name", CASES)
def test_each_seam_edge_has_one_tab_or_is_told(name):
    pattern, material = CASES[name]
    outlined = outline_patches(pattern, 190.0, 140.0, material)
    sides = pattern.edges_faces
    seam = (sides >= 0).all(axis=1)
    seam &= outlined.face_patch[sides[:, 0]] != outlined.face_patch[sides[:, 1]]
    told = np.concatenate([outlined.tabs.edge, outlined.untabbed])
    np.testing.assert_array_equal(np.sort(told), np.flatnonzero(seam))


@pytest.mark.parametrize("name", CASES)
def test_a_piece_is_its_patch_and_its_tabs(name):
    pattern, material = CASES[name]
    outlined = outline_patches(pattern, 190.0, 140.0, material)
    facets = facet_polygons(pattern)
    seen = []
    for number, piece in enumerate(outlined.patches):
        outline = shapely.Polygon(piece.rings[0], piece.rings[1:])
        assert outline.is_valid
        assert outline.exterior.is_ccw
        area = shapely.area(facets[piece.faces]).sum() + outlined.tabs.areas[piece.tabs].sum()
        assert outline.area == pytest.approx(area)
        assert (outlined.face_patch[outlined.tabs.own_face[piece.tabs]] == number).all()
        seen += piece.tabs.tolist()
    assert sorted(seen) == list(range(len(outlined.tabs)))


def test_the_tab_of_a_rectangle_is_the_strip_less_its_insets():
    pattern = miura(2, 1, a=30.0, b=20.0, sector=np.pi / 2)
    upright = with_angle(card(tab=7.0, inset=0.3), math.pi)
    tabs, unusual, untabbed = choose_tabs(pattern, np.array([0, 1]), upright)
    assert not unusual.any()
    assert not len(untabbed)
    expected = shapely.box(30.0, 0.3, 37.0, 19.7)
    assert shapely.Polygon(tabs.polygon(0)).normalize().equals_exact(expected.normalize(), 1e-9)
    assert tabs.areas[0] == pytest.approx(7.0 * 19.4)


@pytest.mark.parametrize("degrees", [45.0, 75.0])
def test_no_inner_angle_at_a_base_is_larger_than_asked(degrees):
    """Half the pieces of the mild pattern lean outwards by themselves."""
    pattern, material = CASES["mild"]
    assert material.tabs.max_angle == pytest.approx(math.radians(75.0)), "the usual"
    outlined = outline_patches(pattern, 190.0, 140.0, with_angle(material, math.radians(degrees)))
    tabs = outlined.tabs
    largest = 0.0
    for k in range(len(tabs)):
        ring = tabs.polygon(k)
        for corner, (one, other) in ((0, (1, -1)), (1, (2, 0))):
            a, b = ring[one] - ring[corner], ring[other] - ring[corner]
            angle = math.degrees(math.atan2(abs(a[0] * b[1] - a[1] * b[0]), a @ b))
            largest = max(largest, angle)
    assert largest == pytest.approx(degrees, abs=1e-5)


def test_a_facet_with_two_seam_edges_is_split_on_its_bisector():
    pattern = miura(2, 2, a=30.0, b=30.0, sector=np.pi / 2)
    # The last facet is glued to by the one left of it and by the one below it.
    tabs, _, _ = choose_tabs(pattern, np.array([3, 0, 1, 2]), card(tab=25.0, inset=1.0))
    both = np.flatnonzero(tabs.mate_face == 3)
    assert len(both) == 2
    one, other = (shapely.Polygon(tabs.polygon(i)) for i in both)
    # Mirror images about the bisector of the square, which runs from (30, 30) to (60, 60).
    mirrored = shapely.transform(other, lambda p: p[:, ::-1])
    assert one.symmetric_difference(mirrored).area < 1e-9
    assert one.distance(other) == pytest.approx(2.0)


def test_glue_area_of_a_mild_pattern_is_at_least_5_mm2_a_mm_of_seam():
    for pattern in (miura(30, 26), flat_patterns.fan(26, 22, radius=250.0)):
        outlined = outline_patches(pattern, 190.0, 140.0, card())
        ends = pattern.vertices_coords[pattern.edges_vertices[outlined.tabs.edge]]
        seam = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()
        assert outlined.tabs.areas.sum() / seam >= 5.0


def test_a_tab_too_small_on_one_side_goes_to_the_other():
    points = np.array(
        [[[0.0, 0], [20, 0], [20.4, 0], [60, 0]], [[0.0, 20], [20, 20], [20.4, 20], [60, 20]]]
    )
    pattern = flat_patterns.grid(points)
    # The middle facet is 0.4 mm wide: no tab can be glued into it.
    tabs, swapped, untabbed = choose_tabs(pattern, np.array([0, 1, 2]), card())
    assert swapped.tolist() == [True, False]
    np.testing.assert_array_equal(tabs.mate_face, [0, 2])
    narrow = dataclasses.replace(pattern, vertices_coords=pattern.vertices_coords * [0.02, 1.0])
    tabs, _, untabbed = choose_tabs(narrow, np.array([0, 1, 2]), card())
    assert len(tabs) + len(untabbed) == 2
    assert len(untabbed) == 2


def test_a_tab_with_too_little_glue_is_made_higher():
    pattern = miura(4, 3, 10.0, 10.0, sector=np.pi / 2)
    face_patch = np.repeat([0, 1, 2], 4)
    for height in (0.8, 1.0, 1.2, 7.0):
        tabs, unusual, _ = choose_tabs(pattern, face_patch, card(tab=height))
        ends = pattern.vertices_coords[pattern.edges_vertices[tabs.edge], 1]
        reach = np.abs(tabs.points[..., 1] - ends[:, :1]).max(axis=1, where=tabs.present, initial=0)
        weak = height < 1.1
        assert unusual.all() == unusual.any() == weak
        np.testing.assert_allclose(reach, 2 * height if weak else height)
        assert (tabs.areas >= 10.0).all()


def test_a_facet_that_is_not_convex_gets_a_tab_inside_it_or_none():
    points = np.array([[0.0, 0], [40, 0], [40, 40], [0, 40], [20, 12], [0, -30], [40, -30]])
    pattern = CreasePattern(
        vertices_coords=points,
        edges_vertices=np.array([[0, 1], [1, 2], [2, 4], [4, 0], [0, 5], [5, 6], [6, 1]]),
        edges_assignment=np.array(["M", "B", "B", "B", "B", "B", "B"]),
        edges_fold_angle=np.array([-1.0, 0, 0, 0, 0, 0, 0]),
        faces_vertices=np.array([[0, 1, 2, 4], [0, 5, 6, 1]]),
    )
    facets = facet_polygons(pattern)
    for order in ([0, 1], [1, 0]):
        tabs, _, untabbed = choose_tabs(pattern, np.array(order), card())
        assert len(tabs) == 1
        assert not len(untabbed)
        shape = shapely.Polygon(tabs.polygon(0))
        assert facets[tabs.mate_face[0]].buffer(1e-9).contains(shape)
        assert common_area(shape, facets[tabs.own_face[0]]) < 1e-9


def test_a_pattern_that_overlaps_itself_has_tabs_that_do_not():
    pattern = flat_patterns.fan(60, 3, cell=10.0, radius=60.0)
    outlined = outline_patches(pattern, 1000.0, 1000.0, card())
    for piece in outlined.patches:
        assert shapely.Polygon(piece.rings[0], piece.rings[1:]).is_valid
    assert len(outlined.tabs) + len(outlined.untabbed) > 0


@settings(derandomize=True, max_examples=40, deadline=None)
@given(
    st.integers(0, 10_000),
    st.floats(1.0, 30.0),
    st.floats(0.0, 3.0),
    st.floats(0.0, 0.5),
    st.integers(1, 12),
)
def test_any_split_of_any_shaken_grid_has_sound_tabs(seed, height, inset, kerf, parts):
    rng = np.random.default_rng(seed)
    i, j = np.indices((7, 7))
    square = np.stack([j, i], axis=-1) + rng.uniform(-0.3, 0.3, (7, 7, 2))
    pattern = flat_patterns.grid(square * rng.uniform(8, 40))
    material = card(tab=height, inset=inset, kerf=kerf)
    face_patch = rng.integers(0, parts, 36)
    tabs, _, untabbed = choose_tabs(pattern, face_patch, material)
    facets = facet_polygons(pattern)
    shapes = np.array([shapely.Polygon(tabs.polygon(i)) for i in range(len(tabs))], dtype=object)
    for i, shape in enumerate(shapes):
        assert facets[tabs.mate_face[i]].buffer(1e-9).contains(shape)
    sides = pattern.edges_faces
    seam = (sides >= 0).all(axis=1) & (face_patch[sides[:, 0]] != face_patch[sides[:, 1]])
    assert len(tabs) + len(untabbed) == seam.sum()
    if len(shapes):
        near = shapely.STRtree(shapes).query(shapes, predicate="intersects")
        assert (near[0] == near[1]).all()


@settings(derandomize=True, max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.floats(1.5, 6.0), st.floats(8.0, 30.0), st.floats(0.0, 0.3))
def test_no_tab_is_a_needle(seed, short, long, shake):
    """Small facets with short seam edges, whose tabs are raised."""
    rng = np.random.default_rng(seed)
    points = np.stack(np.meshgrid(long * np.arange(5), short * np.arange(7)), axis=-1)
    points = points + rng.uniform(-shake, shake, points.shape) * short
    pattern = flat_patterns.grid(points)
    patch = np.arange(len(pattern.faces_vertices)) % 4
    tabs, unusual, untabbed = choose_tabs(pattern, patch, card(tab=7.0, inset=0.3))
    assert len(tabs) + len(untabbed) == 18
    for k in range(len(tabs)):
        ring = tabs.polygon(k)
        base = np.linalg.norm(ring[1] - ring[0])
        along = (ring[1] - ring[0]) / base
        x, y = (ring - ring[0]) @ along, (ring - ring[0]) @ [-along[1], along[0]]
        assert base >= MIN_BASE_MM
        assert y.max() <= 2 * base + 1e-9
        if unusual[k]:
            assert x.min() >= -1e-6
            assert x.max() <= base + 1e-6


def test_random_designs_have_no_needles_and_keep_their_glue():
    """A sample of ``benchmarks/needles.py``; the second has facets so small that needles were."""
    for each in needles.sample(20, 1):
        assert each.needles == 0
        assert each.kept >= needles.LEAST_KEPT
    small = needles.sample(20, 1, (4.0, 16.0))
    assert sum(each.needles for each in small) == 0 < sum(each.needles_before for each in small)
    assert all(each.enough for each in small)
    worst = needles.measured(106, (4.0, 16.0))
    assert 0.97 * worst.allowed < worst.kept < worst.allowed < 0.5


def test_the_longest_bare_run_is_told():
    points = np.stack(np.meshgrid([0.0, 30.0, 60.0], [0.0, 1.0, 2.0, 20.0, 38.0, 39.0]), axis=-1)
    pattern = flat_patterns.grid(points)
    _, _, untabbed = choose_tabs(pattern, np.arange(10) % 2, card())
    assert len(untabbed) == 3
    assert longest_run(pattern, untabbed)[0] == pytest.approx(2.0)
    assert longest_run(pattern, untabbed)[1] == untabbed.min()
