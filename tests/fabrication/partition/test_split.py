"""The split into patches: a partition into disks that fit."""

from __future__ import annotations

import itertools
from dataclasses import replace

import flat_patterns
import numpy as np
import pytest
import shapely
from flat_patterns import card, facet_polygons, fits_turned, miura, triangles, without_grid, zigzag
from hypothesis import given, settings
from hypothesis import strategies as st

from miurafab.errors import LayoutError
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.boundary import boundaries
from miurafab.fabrication.partition.patch_outline import outline_patches
from miurafab.fabrication.partition.pieces import lattice_cells
from miurafab.fabrication.partition.region_growing import is_disk
from miurafab.fabrication.partition.split import check_facets, split
from miurafab.fabrication.tab_choice import choose_tabs
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.formats.crease_lines import CreaseLines
from miurafab.origami.formats.planar_graph import pattern_from_lines

CASES = {
    "miura": miura(24, 20),
    "zigzag": zigzag(18, 20),
    "fan": flat_patterns.fan(26, 22, radius=250.0),
    "one row": miura(80, 1),
    "one column": miura(1, 80),
    "fan without grid": without_grid(flat_patterns.fan(26, 22, radius=250.0)),
    "triangles": triangles(3, 15, 520.0),
    "ring": triangles(4, 15, 520.0, hole=True),
}


def test_a_lattice_is_read_from_a_grid_in_order_alone():
    """A facet too few, a facet that spans two cells, and a facet in another's place are none."""
    pattern = miura(4, 3)
    cells = lattice_cells(pattern)
    assert cells.tolist() == [[x, y] for y in range(3) for x in range(4)]
    order = np.random.default_rng(1).permutation(12)
    mixed = replace(pattern, faces_vertices=pattern.faces_vertices[order])
    assert np.array_equal(lattice_cells(mixed), cells[order])
    wide = pattern.faces_vertices.copy()
    wide[0, 2] += 1
    twice = pattern.faces_vertices[[0, *range(11)]]
    for faces in (pattern.faces_vertices[:-1], wide, twice):
        assert lattice_cells(replace(pattern, faces_vertices=faces)) is None
    assert lattice_cells(without_grid(pattern)) is None


def test_facets_that_are_none_are_refused():
    pattern = miura(2, 2)
    none = replace(pattern, faces_vertices=np.empty((0, 4), dtype=np.int64))
    with pytest.raises(LayoutError, match="has no facets; there is nothing to lay out"):
        check_facets(none)
    with pytest.raises(LayoutError, match=r"Edge \d+ of the pattern belongs to no facet"):
        check_facets(replace(pattern, faces_vertices=pattern.faces_vertices[:3]))
    clockwise = replace(pattern, faces_vertices=pattern.faces_vertices[:, ::-1])
    line = replace(
        pattern,
        vertices_coords=np.concatenate([pattern.vertices_coords, [[-5.0, -5.0]]]),
        edges_vertices=np.concatenate([pattern.edges_vertices, [[0, 9]]]),
        edges_assignment=np.append(pattern.edges_assignment, "B"),
        edges_fold_angle=np.append(pattern.edges_fold_angle, 0.0),
        faces_vertices=np.concatenate([pattern.faces_vertices, [[0, 9, -1, -1]]]),
        grid=None,
    )
    for number, wrong in ((0, clockwise), (4, line)):
        words = f"Facet {number} is not a simple counter-clockwise polygon"
        with pytest.raises(LayoutError, match=words):
            check_facets(wrong)


def assert_patches_are_sound(pattern, face_patch, width, height):
    assert face_patch.shape == (len(pattern.faces_vertices),)
    ids = np.unique(face_patch)
    np.testing.assert_array_equal(ids, np.arange(len(ids)))
    facets = facet_polygons(pattern)
    for patch, boundary in enumerate(boundaries(pattern, face_patch)):
        faces = np.flatnonzero(face_patch == patch)
        assert is_disk(pattern, faces)
        ring = pattern.vertices_coords[boundary.vertices]
        assert fits_turned(ring, width, height)
        outline = shapely.Polygon(ring)
        assert outline.is_valid
        assert outline.exterior.is_ccw
        assert outline.area == pytest.approx(shapely.area(facets[faces]).sum())


@pytest.mark.parametrize("name", CASES)
def test_every_facet_is_in_one_patch_and_every_patch_is_a_disk_that_fits(name):
    pattern = CASES[name]
    face_patch = split(pattern, 190.0, 140.0, card())
    assert face_patch.max() > 0
    assert_patches_are_sound(pattern, face_patch, 190.0, 140.0)


@pytest.mark.parametrize("name", CASES)
def test_pieces_fit_with_tabs_and_kerf(name):
    for piece in outline_patches(CASES[name], 190.0, 140.0, card(kerf=0.4)).patches:
        assert fits_turned(piece.cut_lines[0], 190.0, 140.0)


@pytest.mark.parametrize("turns", [(0,), (1,), (0, 1)])
@pytest.mark.parametrize("name", CASES)
def test_pieces_that_keep_the_directions_of_the_pattern_fit_as_they_are(name, turns):
    outlined = outline_patches(CASES[name], 190.0, 140.0, card(kerf=0.4), turns=turns)
    assert_patches_are_sound(CASES[name], outlined.face_patch, 340.0, 340.0)
    sizes = np.array([(190.0, 140.0), (140.0, 190.0)])[list(turns)] + 1e-6
    for piece in outlined.patches:
        assert (np.ptp(piece.cut_lines[0], axis=0) <= sizes).all(axis=1).any()


def test_a_sheet_of_very_many_facets_is_split_by_every_second_direction(monkeypatch):
    monkeypatch.setattr("miurafab.fabrication.partition.split._MANY", 100)
    pattern = miura(24, 20)
    face_patch = split(pattern, 190.0, 140.0, card())
    assert face_patch.max() > 0
    assert_patches_are_sound(pattern, face_patch, 190.0, 140.0)


def test_a_facet_larger_than_a_patch_may_be_is_named():
    options = LayoutOptions(max_patch_mm=(12.0, 8.0))
    with pytest.raises(LayoutError, match=r"Facet 0 .* fit a patch of 12 mm x 8 mm; .* larger"):
        outline_patches(miura(8, 10), 190.0, 140.0, card(), options)


def test_squares_that_keep_their_directions_are_split_into_as_few_patches_as_possible():
    i, j = np.indices((25, 41))
    squares = flat_patterns.grid(np.stack([j * 10.0, i * 10.0], axis=-1))
    # Of 40 x 24 squares a bed takes 9 x 5 with tabs of 7 mm on two sides, and one more at the end.
    assert split(squares, 101.0, 61.0, card(), turns=(0,)).max() + 1 == 5 * 5
    assert split(squares, 101.0, 61.0, card(), turns=(1,)).max() + 1 == 8 * 3
    assert split(squares, 61.0, 101.0, card(), turns=(0,)).max() + 1 == 8 * 3
    assert split(squares, 61.0, 101.0, card(), turns=(1,)).max() + 1 == 5 * 5


def test_a_facet_too_large_in_the_directions_of_the_pattern_is_named():
    turn = np.array([[1.0, 1.0], [-1.0, 1.0]]) / np.sqrt(2.0)
    i, j = np.indices((5, 5))
    tilted = flat_patterns.grid(np.stack([j * 50.0, i * 50.0], axis=-1) @ turn)
    assert split(tilted, 62.0, 62.0, card()).max() + 1 == 16
    message = (
        r"Facet 0 measures 70\.7 mm x 70\.7 mm along the pattern's axes and does not fit the "
        r"usable bed of 62\.0 mm x 62\.0 mm; .*, write grain = 'none', or take"
    )
    with pytest.raises(LayoutError, match=message):
        split(tilted, 62.0, 62.0, card(), turns=(0,))


def test_a_pattern_that_fits_is_one_patch_whatever_its_angle():
    turn = np.array([[np.cos(1.1), np.sin(1.1)], [-np.sin(1.1), np.cos(1.1)]])
    pattern = miura(8, 10)
    turned = flat_patterns.grid((pattern.vertices_coords @ turn).reshape(11, 9, 2))
    wide, high = np.ptp(pattern.vertices_coords, axis=0)
    assert split(turned, wide + 1e-6, high + 1e-6, card()).max() == 0
    assert split(turned, high + 1e-6, wide + 1e-6, card()).max() == 0
    assert split(turned, wide - 1.0, high, card()).max() > 0


def test_a_ring_that_fits_stays_whole_and_its_hole_is_cut_out():
    pattern = triangles(4, 12, 100.0, hole=True)
    (patch,) = outline_patches(pattern, 500.0, 500.0, card(kerf=0.4)).patches
    outer, hole = (shapely.Polygon(line) for line in patch.cut_lines)
    # A valid shape that surrounds exactly the facets, less half a kerf all round.
    rest = outer.difference(hole).buffer(-0.2, join_style="mitre")
    facets = shapely.union_all(facet_polygons(pattern))
    assert len(facets.interiors) == 1
    assert outer.contains(hole)
    assert shapely.hausdorff_distance(rest, facets) < 0.01


@pytest.mark.parametrize(
    "windows",
    [
        [(50, 0, 70, 50, 30, 50)],
        [(50, 100, 70, 130, 30, 130), (50, 100, 70, 60, 30, 60)],
        [(0, 0, 30, 10, 10, 30), (30, 10, 50, 40, 60, 10), (60, 10, 80, 30, 90, 10)],
    ],
)
def test_windows_that_touch_the_border_or_each_other_in_a_vertex_leave_one_patch(windows):
    """It had a seam and a tab. No loop has a vertex twice: a window at the border is no notch."""
    outer = (0, 0, 200, 0, 200, 200, 0, 200)
    loops = [np.array(loop, dtype=np.float64).reshape(-1, 2) for loop in (outer, *windows)]
    ends = [np.stack([loop, np.roll(loop, -1, axis=0)], axis=1) for loop in loops]
    lines = np.concatenate([*ends, [[[100.0, 0.0], [100.0, 200.0]]]])
    letters = np.array(["B"] * (len(lines) - 1) + ["V"])
    pattern = pattern_from_lines(CreaseLines(lines, letters, np.full(len(lines), np.nan)))
    outlined = outline_patches(pattern, 300.0, 300.0, card(kerf=0.4))
    (patch,) = outlined.patches
    assert len(outlined.tabs) == 0
    outline = shapely.Polygon(patch.rings[0], patch.rings[1:])
    assert outline.is_valid
    assert outline.equals(
        shapely.Polygon(loops[0]) - shapely.union_all(shapely.polygons(loops[1:]))
    )
    assert len(patch.cut_lines) == len(loops)


def test_two_separate_pieces_of_paper_are_two_patches():
    one = miura(4, 4)
    count = len(one.vertices_coords)
    both = CreasePattern(
        vertices_coords=np.concatenate(
            [one.vertices_coords, one.vertices_coords + np.array([100.0, 0.0])]
        ),
        edges_vertices=np.concatenate([one.edges_vertices, one.edges_vertices + count]),
        edges_assignment=np.concatenate([one.edges_assignment] * 2),
        edges_fold_angle=np.concatenate([one.edges_fold_angle] * 2),
        faces_vertices=np.concatenate([one.faces_vertices, one.faces_vertices + count]),
    )
    face_patch = split(both, 400.0, 400.0, card())
    np.testing.assert_array_equal(face_patch, np.repeat([0, 1], 16))


def test_a_pattern_that_overlaps_itself_is_split_into_patches_that_do_not():
    # A fan of 1.3 full turns: as one piece of paper it would lie on top of itself.
    pattern = flat_patterns.fan(60, 3, cell=10.0, radius=60.0)
    for flat in (pattern, without_grid(pattern)):
        face_patch = split(flat, 1000.0, 1000.0, card())
        assert face_patch.max() > 0
        assert_patches_are_sound(flat, face_patch, 1000.0, 1000.0)


def test_a_facet_larger_than_the_bed_is_named_with_its_size():
    points = miura(6, 5).vertices_coords.reshape(6, 7, 2).copy()
    points[:, 4:, 0] += 240.0
    with pytest.raises(LayoutError, match=r"^Facet 3 measures 25\d\.\d mm x .* 190\.0 mm x 140"):
        split(flat_patterns.grid(points), 190.0, 140.0, card())


def test_a_facet_that_fits_only_without_its_tabs_is_named_so():
    pattern = miura(3, 3, a=100.0, b=100.0, sector=np.pi / 2)
    with pytest.raises(LayoutError, match="with its tabs and does not fit"):
        split(pattern, 102.0, 102.0, card())


@pytest.mark.parametrize("flaw", ["clockwise", "crossed", "flat"])
def test_a_facet_that_is_no_polygon_is_named(flaw):
    pattern = miura(4, 4)
    points = pattern.vertices_coords.copy()
    faces = pattern.faces_vertices.copy()
    if flaw == "clockwise":
        points[:, 0] *= -1
    elif flaw == "crossed":
        points[[0, 1]] = points[[1, 0]]
    else:
        points[[0, 5]] = points[[1, 6]]
    bad = CreasePattern(
        points, pattern.edges_vertices, pattern.edges_assignment, pattern.edges_fold_angle, faces
    )
    with pytest.raises(LayoutError, match=r"^Facet 0 is not a simple counter-clockwise polygon"):
        split(bad, 190.0, 140.0, card())


def test_the_split_of_a_grid_is_the_best_of_all_bands():
    """Against every way of cutting rows and, in each band, columns."""
    pattern = zigzag(6, 6, a=20.0, sector=1.0)
    material = card(tab=3.0)
    cells = np.arange(36).reshape(6, 6)

    def fewest(cells: np.ndarray) -> int:
        best = 99
        for cuts in itertools.product([0, 1], repeat=5):
            rows = [0, *(k + 1 for k in range(5) if cuts[k]), 6]
            total = 0
            for r0, r1 in itertools.pairwise(rows):
                total += runs(cells[r0:r1])
            best = min(best, total)
        return best

    def runs(band: np.ndarray) -> float:
        total, c0 = 0, 0
        while c0 < 6:
            c1 = c0
            while c1 < 6 and room(band[:, c0 : c1 + 1]):
                c1 += 1
            if c1 == c0:
                return np.inf
            total, c0 = total + 1, c1
        return total

    known: dict[bytes, bool] = {}

    def room(block: np.ndarray) -> bool:
        key = np.sort(block, axis=None).tobytes()
        if key not in known:
            known[key] = measured(block)
        return known[key]

    def measured(block: np.ndarray) -> bool:
        face_patch = np.where(np.isin(np.arange(36), block), 0, np.arange(1, 37))
        before = np.arange(36) < block.min()
        # Facets before the block bear the tabs towards it.
        face_patch = np.unique(np.where(before, face_patch - 100, face_patch), return_inverse=True)
        patch = face_patch[1][block[0, 0]]
        return _fits_with_tabs(pattern, face_patch[1], patch, material)

    found = split(pattern, 75.0, 62.0, material).max() + 1
    assert found <= fewest(cells)
    assert found <= fewest(cells.T)


def _fits_with_tabs(pattern, face_patch, patch, material) -> bool:
    tabs, _, _ = choose_tabs(pattern, face_patch, material)
    faces = pattern.faces_vertices[face_patch == patch]
    own = np.flatnonzero(face_patch[tabs.own_face] == patch)
    parts = [pattern.vertices_coords[faces].reshape(-1, 2), *(tabs.polygon(i) for i in own)]
    return fits_turned(np.concatenate(parts), 75.0, 62.0)


@st.composite
def jobs(draw):
    """A pattern, a bed that takes a part of it, and on which side of a seam the tabs stand."""
    kind = draw(st.sampled_from(["miura", "zigzag", "fan", "triangles", "ring"]))
    columns, rows = draw(st.integers(4, 22)), draw(st.integers(4, 18))
    if kind in ("triangles", "ring"):
        seed, count = draw(st.integers(0, 999)), draw(st.integers(6, 13))
        pattern = triangles(seed, count, 26.0 * count, hole=kind == "ring")
    elif kind == "fan":
        radius = draw(st.floats(120.0, 900.0))
        pattern = flat_patterns.fan(columns, rows, radius=radius)
    elif kind == "miura":
        pattern = miura(columns, rows, sector=draw(st.floats(0.7, 1.5)))
    else:
        pattern = zigzag(columns, rows, sector=draw(st.floats(0.6, 1.2)))
    if draw(st.booleans()):
        pattern = without_grid(pattern)
    bed = (draw(st.floats(90.0, 220.0)), draw(st.floats(90.0, 220.0)))
    return pattern, bed, draw(st.sampled_from(["lower", "upper", "alternate"]))


@settings(derandomize=True, max_examples=10, deadline=None)
@given(jobs())
def test_any_split_is_of_disks_that_fit_with_their_tabs(job):
    pattern, bed, tab_side = job
    options = LayoutOptions(tab_side=tab_side)
    outlined = outline_patches(pattern, *bed, card(), options)
    assert_patches_are_sound(pattern, outlined.face_patch, *bed)
    for piece in outlined.patches:
        assert fits_turned(piece.cut_lines[0], *bed)
    split_again = outline_patches(pattern, *bed, card(), options).face_patch
    np.testing.assert_array_equal(outlined.face_patch, split_again)


@pytest.mark.parametrize("tab_side", ["lower", "upper", "alternate"])
def test_asked_for_seams_stay_when_a_split_is_made_better(tab_side):
    pattern = miura(40, 24)
    options = LayoutOptions(seam_rows=(7,), seam_columns=(9, 25), tab_side=tab_side)
    patch = split(pattern, 150.0, 110.0, card(), options).reshape(24, 40)
    for r0, r1 in ((0, 7), (7, 24)):
        for c0, c1 in ((0, 9), (9, 25), (25, 40)):
            inside = np.unique(patch[r0:r1, c0:c1])
            outside = patch.copy()
            outside[r0:r1, c0:c1] = -1
            assert not np.isin(inside, outside).any()


@pytest.mark.parametrize(
    ("pattern", "most"),
    [
        pytest.param(miura(60, 60), 1.25, id="miura"),
        pytest.param(flat_patterns.fan(80, 80, radius=1000.0), 1.3, id="fan"),
    ],
)
def test_the_number_of_patches_is_near_the_area_bound(pattern, most):
    area = shapely.area(facet_polygons(pattern)).sum()
    patches = split(pattern, 290.0, 190.0, card()).max() + 1
    assert patches <= most * np.ceil(area / (290.0 * 190.0))
