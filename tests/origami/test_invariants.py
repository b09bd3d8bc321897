"""The residuals of a pattern, against closed forms on patterns small enough to compute by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from problems import regular
from test_crease_pattern import two_squares
from test_judge_pattern import strip

from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.invariants import (
    DEGENERATE,
    EXACT,
    angle_defect,
    corner_angles,
    corner_ring,
    crossed_facets,
    dented_facets,
    exactness,
    facet_planarity,
    interior_vertices,
    isometry,
    kawasaki_residual,
    residuals,
    seam_gaps,
)


def facet(flat: np.ndarray, folded: np.ndarray | None = None) -> CreasePattern:
    """One facet with these corners (k, 2), and (k, 3) in the folded form."""
    count = len(flat)
    ring = np.arange(count)
    return CreasePattern(
        np.asarray(flat, dtype=float),
        np.column_stack([ring, np.roll(ring, -1)]),
        np.full(count, "B"),
        np.zeros(count),
        ring[None],
        None if folded is None else np.asarray(folded, dtype=float),
    )


def wheel(letters: str, sectors: list[float], height: float = 0.0) -> CreasePattern:
    """Triangles around vertex 0 with these ``sectors`` (degrees); spokes of 10 mm, whose ends are
    lifted to ``height`` in the folded form.
    """
    turn = np.radians(np.cumsum([0, *sectors[:-1]]))
    count = len(letters)
    flat = 10 * np.vstack([[0, 0], np.stack([np.cos(turn), np.sin(turn)], axis=1)])
    rim = np.array([[n + 1, (n + 1) % count + 1] for n in range(count)])
    folded = np.pad(flat, ((0, 0), (0, 1)))
    folded[1:, 2] = height
    return CreasePattern(
        flat,
        np.concatenate([[[0, n + 1] for n in range(count)], rim]),
        np.array([*letters, *"B" * count]),
        np.zeros(2 * count),
        np.column_stack([np.zeros(count, dtype=np.int64), rim]),
        folded,
    )


@pytest.mark.parametrize(
    ("letters", "sectors", "residual"),
    [
        ("MVMV", [90.0, 90.0, 90.0, 90.0], 0.0),
        ("MVMV", [100.0, 80.0, 85.0, 95.0], 5.0),
        ("MVMV", [80.0, 100.0, 95.0, 85.0], 5.0),
        ("MVUV", [70.0, 80.0, 85.0, 125.0], 25.0),
        ("MFVMFV", [40.0, 50.0, 80.0, 60.0, 40.0, 90.0], 10.0),  # 90 80 100 90
        ("FMFVMJV", [20.0, 40.0, 50.0, 80.0, 60.0, 40.0, 70.0], 10.0),  # the first part of the last
        ("MVMVMV", [50.0, 60.0, 70.0, 60.0, 58.0, 62.0], 2.0),
        ("MVM", [120.0, 120.0, 120.0], 180.0),  # an odd number folds by no means
        ("MFFFF", [72.0] * 5, 180.0),
        ("FFFF", [90.0] * 4, 0.0),
    ],
)
def test_alternate_sectors_run_from_crease_to_crease(
    letters: str, sectors: list[float], residual: float
) -> None:
    pattern = wheel(letters, sectors)
    ring = corner_ring(pattern, pattern.folded_coords)
    found = kawasaki_residual(ring, np.array([0]), pattern.edges_creased)
    assert np.degrees(found) == pytest.approx([residual], abs=1e-9)


@pytest.mark.parametrize("sectors", [[60.0, 120.0, 60.0, 120.0], [120.0, 60.0, 120.0, 60.0]])
def test_where_sectors_add_up_to_no_whole_turn_the_worse_sum_counts(sectors: list[float]) -> None:
    """The cosine of a sector between spokes that rise by 45 degrees is (1 + cos d) / 2."""
    pattern = wheel("MVMV", sectors, height=10.0)
    small = 2 * math.acos((1 + math.cos(math.radians(60))) / 2)
    assert residuals(pattern).flat_foldability == pytest.approx([math.pi - small])


def test_several_vertices_are_walked_around_at_once() -> None:
    """Those with fewer corners wait for the others."""
    one, other = wheel("MVMV", [100.0, 80.0, 85.0, 95.0]), wheel("MFVMFV", [40, 50, 80, 60, 40, 90])
    count = len(one.vertices_coords)
    faces = np.concatenate([one.faces_vertices, other.faces_vertices + count])
    both = CreasePattern(
        np.concatenate([one.vertices_coords, other.vertices_coords + 50.0]),
        np.concatenate([one.edges_vertices, other.edges_vertices + count]),
        np.append(one.edges_assignment, other.edges_assignment),
        np.append(one.edges_fold_angle, other.edges_fold_angle),
        np.pad(faces, ((0, 0), (0, 1)), constant_values=-1),  # as beside a facet of four corners
        np.concatenate([one.folded_coords, other.folded_coords + 50.0]),
    )
    assert interior_vertices(both).tolist() == [0, count]
    found = residuals(both)
    assert np.degrees(found.flat_foldability) == pytest.approx([5.0, 10.0], abs=1e-9)
    assert found.developability == pytest.approx([0.0, 0.0], abs=1e-12)
    assert found.planarity.tolist() == [0.0] * 10  # triangles


def test_the_defect_of_a_pyramid_is_what_its_sectors_lack() -> None:
    """Spokes of length sqrt(200): the sector between two at right angles is 60 degrees."""
    pattern = wheel("MMMM", [90.0] * 4, height=10.0)
    ring = corner_ring(pattern, pattern.folded_coords)
    assert np.degrees(angle_defect(ring, np.array([0]))) == pytest.approx([120.0])
    found = residuals(pattern)
    assert np.degrees(found.developability) == pytest.approx([120.0])
    assert found.worst == pytest.approx(math.radians(120.0))
    saddle = wheel("MMMM", [90.0] * 4)
    saddle.folded_coords[[1, 3], 2], saddle.folded_coords[[2, 4], 2] = 10.0, -10.0
    # Each sector between (1, 0, 1) and (0, 1, -1) is 120 degrees.
    ring = corner_ring(saddle, saddle.folded_coords)
    assert np.degrees(angle_defect(ring, np.array([0]))) == pytest.approx([-120.0])
    assert np.degrees(residuals(saddle).developability) == pytest.approx([120.0])


def test_a_corner_of_more_than_half_a_turn_has_its_whole_angle() -> None:
    arrow = facet([[0, 0], [10, -10], [0, 20], [-10, -10]], np.zeros((4, 3)))
    folded = np.pad(arrow.vertices_coords, ((0, 0), (0, 1)))
    ring = corner_ring(arrow, folded)
    assert np.degrees(ring.angle).sum() == pytest.approx(360.0)
    assert np.degrees(ring.angle[0]) == pytest.approx(270.0)
    assert ring.vertex.tolist() == [0, 1, 2, 3]
    assert ring.following.tolist() == [-1] * 4  # borders all round
    assert ring.edge.tolist() == [3, 0, 1, 2]


def test_places_past_the_last_corner_have_no_vertex_no_edge_and_no_angle() -> None:
    """A square, and a triangle beside its second side."""
    flat = np.array([[0, 0], [10, 0], [10, 10], [0, 10], [20, 5]], dtype=float)
    pattern = CreasePattern(
        flat,
        np.array([[0, 1], [1, 2], [2, 3], [0, 3], [1, 4], [4, 2]]),
        np.array([*"BVBBBB"]),
        np.zeros(6),
        np.array([[0, 1, 2, 3], [1, 4, 2, -1]]),
    )
    ring = corner_ring(pattern, np.pad(flat, ((0, 0), (0, 1))))
    assert ring.vertex.tolist() == [0, 1, 2, 3, 1, 4, 2, -1]
    assert ring.edge.tolist() == [3, 0, 1, 2, 1, 4, 5, -1]
    assert ring.following.tolist() == [-1, -1, 6, -1, 1, -1, -1, -1]
    low = math.degrees(math.atan(2))
    right = [90.0] * 4 + [low, 180 - 2 * low, low, 0.0]
    assert np.degrees(ring.angle) == pytest.approx(right)
    angles = corner_angles(flat, pattern.faces_vertices)
    assert np.degrees(angles.ravel()) == pytest.approx(right)
    for other in (3 * flat, flat[:, ::-1] + 7.0):  # clockwise, too
        assert corner_angles(other, pattern.faces_vertices) == pytest.approx(angles)


def test_corners_follow_each_other_counter_clockwise() -> None:
    """Around the middle of a wheel, a corner is followed by that of the next triangle."""
    pattern = wheel("MVMV", [90.0] * 4)
    ring = corner_ring(pattern, pattern.folded_coords)
    middle = np.flatnonzero(ring.vertex == 0)
    assert ring.following[middle].tolist() == np.roll(middle, -1).tolist()
    assert pattern.edges_vertices[ring.edge[middle]].tolist() == [[0, 2], [0, 3], [0, 4], [0, 1]]


def test_planarity_is_a_volume_over_a_cube() -> None:
    square = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
    folded = np.pad(square, ((0, 0), (0, 1)))
    folded[3, 2] = 0.3  # over the plane of the other three
    pattern = facet(square, folded)
    mean = edge_lengths(folded, pattern.edges_vertices).mean()
    assert facet_planarity(pattern, folded) == pytest.approx([10 * 10 * 0.3 / mean**3])
    scaled = facet_planarity(facet(7 * square, 7 * folded), 7 * folded)
    assert scaled == pytest.approx([10 * 10 * 0.3 / mean**3])
    # Three corners in line say nothing of the plane; the others do.
    five = np.array([[0.0, 0.0], [5.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
    folded = np.pad(five, ((0, 0), (0, 1)))
    folded[2, 2] = folded[4, 2] = 0.2
    flat = facet(five, folded)
    mean = edge_lengths(folded, flat.edges_vertices).mean()
    # From p0, the farthest corner is p3, and p2 and p4 span the same area with it.
    volume = abs(np.linalg.det([folded[3], folded[2], folded[4]]))
    assert facet_planarity(flat, folded) == pytest.approx([volume / mean**3])
    assert volume == pytest.approx(40.0, rel=1e-3)


def test_a_triangle_is_flat_without_rounding() -> None:
    for corners in np.random.default_rng(3).normal(size=(20, 3, 3)):
        assert facet_planarity(facet(corners[:, :2], corners), corners).tolist() == [0.0]


def test_isometry_compares_sides_and_diagonals() -> None:
    square = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
    whole = np.pad(square, ((0, 0), (0, 1)))
    assert isometry(facet(square, whole)).tolist() == [0.0]
    longer = whole.copy()
    longer[2:, 1] = 10.1
    # Sides differ by 0.1 in 10.1, diagonals by less.
    assert isometry(facet(square, longer)) == pytest.approx([0.1 / 10.1])
    assert isometry(facet(longer[:, :2], whole)) == pytest.approx([0.1 / 10.1])
    rhombus = whole.copy()
    rhombus[2:, 0] += 6.0
    rhombus[2:, 1] = 8.0  # all sides keep their lengths, and the diagonals do not
    short = 10 * math.sqrt(2) - math.hypot(4, 8)
    assert isometry(facet(square, rhombus)) == pytest.approx([short / (10 * math.sqrt(2))])


def test_a_side_that_is_degenerate_in_both_forms_is_left_out() -> None:
    flat = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 1e-6], [0.0, 10.0]])
    folded = np.pad(flat, ((0, 0), (0, 1)))
    folded[2, 1] = 3e-6
    assert isometry(facet(flat, folded)).max() < 1e-6
    folded[2, 1] = 3e-5  # that is no longer degenerate
    assert isometry(facet(flat, folded)) == pytest.approx([29 / 30])


def test_a_side_is_degenerate_up_to_a_millionth_of_the_mean_edge_and_no_more() -> None:
    folded = np.array([[0, 0, 0], [1, 0, 0], [5, 12, 0], [0, 12, 0.0]])
    for _ in range(5):  # the mean has hardly any of the side
        pattern = facet(folded[:, :2], folded)
        short = DEGENERATE * edge_lengths(folded, pattern.edges_vertices).mean()
        folded[1, 0] = short
    flat = folded[:, :2].copy()
    flat[1, 0] = 0.5 * short
    sides = facet(flat, folded)
    assert edge_lengths(folded, sides.edges_vertices)[0] == short
    assert isometry(sides) == pytest.approx([0.0], abs=1e-6)
    folded[1, 0] = math.nextafter(short, 1.0)
    assert isometry(facet(flat, folded)) == pytest.approx([0.5])


def test_a_corner_is_dented_by_more_than_a_millionth_of_the_longest_side() -> None:
    """The longest side is 5, and the corner turns back by four times its height."""
    height = 1e-6 * 25.0 / 4
    for up, dented in ((height, []), (math.nextafter(height, 1.0), [0])):
        for ring in ([[0, 0], [2, up], [4, 0], [0, 3]], [[0, 3], [4, 0], [2, up], [0, 0]]):
            assert dented_facets(facet(np.array(ring))).tolist() == dented


def test_what_counts_as_exact_grows_with_the_distance_from_the_origin() -> None:
    pattern = regular()
    mean = edge_lengths(pattern.folded_coords, pattern.edges_vertices).mean()
    far = replace(pattern, folded_coords=pattern.folded_coords + np.array([3e7, 0.0, 0.0]))
    rounding = np.spacing(far.folded_coords.max())
    assert exactness(far) == pytest.approx(EXACT + 64 * rounding / mean)
    assert exactness(pattern) == pytest.approx(EXACT, rel=1e-2)
    assert exactness(replace(pattern, unfolded=1e-7)) == 2e-7
    assert exactness(replace(pattern, rounded=1e-7)) == 1e-7
    assert exactness(replace(pattern, unfolded=1e-7, rounded=3e-7)) == 3e-7
    assert exactness(replace(pattern, unfolded=1e-12)) == exactness(pattern)


def test_a_seam_gapes_by_length_or_by_place() -> None:
    pattern = two_squares()
    assert seam_gaps(pattern).tolist() == [0.0]
    apart = pattern.folded_coords.copy()
    apart[4, 2] = 0.25
    assert seam_gaps(replace(pattern, folded_coords=apart)) == pytest.approx([0.25])
    apart[4, 2], apart[7, 2] = 0.25, 0.5  # the farther end of edge 7, from 7 to 4
    assert seam_gaps(replace(pattern, folded_coords=apart)) == pytest.approx([0.5])
    longer = pattern.vertices_coords.copy()
    longer[7, 1] += 0.25
    long = replace(pattern, vertices_coords=longer, folded_coords=None)
    mean = edge_lengths(longer, pattern.edges_vertices).mean()
    assert seam_gaps(long) == pytest.approx([0.25 / mean])
    assert seam_gaps(replace(long, folded_coords=pattern.folded_coords)) == pytest.approx(
        [0.25 / mean]
    )
    assert seam_gaps(replace(pattern, seams=None)).shape == (0,)


def test_a_vertex_of_no_facet_is_not_within_the_sheet() -> None:
    pattern = regular(4, 4)
    lone = replace(
        pattern,
        vertices_coords=np.concatenate([pattern.vertices_coords, [[0.0, 0.0]]]),
        folded_coords=np.concatenate([pattern.folded_coords, [[0.0, 0.0, 0.0]]]),
        grid=None,
    )
    assert interior_vertices(lone).tolist() == [5, 6, 9, 10]
    alone = facet([[0, 0], [10, 0], [0, 10]], [[0, 0, 0], [10, 0, 0], [0, 10, 0]])
    assert residuals(alone).developability.shape == (0,)
    assert residuals(alone).flat_foldability.shape == (0,)
    assert residuals(alone).worst == 0.0


STAR = [[math.cos(0.8 * math.pi * n), math.sin(0.8 * math.pi * n)] for n in range(5)]
SHAPES = {
    "square": ([[0, 0], [1, 0], [1, 1], [0, 1]], False, False),
    "clockwise": ([[0, 0], [0, 1], [1, 1], [1, 0]], False, False),
    "bow-tie": ([[0, 0], [1, 0], [0, 1], [1, 1]], True, False),
    "other bow-tie": ([[0, 0], [1, 1], [1, 0], [0, 1]], True, False),
    "arrow": ([[0, 0], [2, -1], [0, 4], [-2, -1]], False, True),
    "arrow, clockwise": ([[0, 0], [-2, -1], [0, 4], [2, -1]], False, True),
    "next corner": ([[2, -1], [0, 4], [-2, -1], [0, 0]], False, True),
    "corner in line": ([[0, 0], [1, 0], [2, 0], [0, 1]], False, False),
    "dented by less than a rounding": ([[0, 0], [1, 1e-6], [2, 0], [0, 1]], False, False),
    "dented by more": ([[0, 0], [1, 1e-4], [2, 0], [0, 1]], False, True),
    "star": (STAR, True, False),
    "pentagon, dented": ([[0, 0], [2, 1], [4, 0], [4, 4], [0, 4]], False, False),
    "triangle": ([[0, 0], [1, 0], [0, 1]], False, False),
    "corner on a side": ([[0, 0], [4, 0], [4, 4], [2, 0], [0, 4]], False, False),
    "side at a corner": ([[4, 4], [2, 0], [0, 4], [0, 0], [4, 0]], False, False),
}


@pytest.mark.parametrize("name", SHAPES)
def test_shapes_are_told_by_their_corners(name: str) -> None:
    corners, crossed, dented = SHAPES[name]
    for size in (0.01, 1.0, 50.0):
        pattern = facet(size * np.array(corners, dtype=float))
        assert bool(len(crossed_facets(pattern))) is crossed
        assert bool(len(dented_facets(pattern))) is dented


def test_shapes_are_told_among_others() -> None:
    pattern = strip(np.zeros(5))
    flat = pattern.vertices_coords.copy()
    flat[[2, 7]] = flat[[7, 2]]
    crossed = replace(pattern, vertices_coords=flat)
    assert crossed_facets(crossed).tolist() == [1, 2]
    assert dented_facets(crossed).tolist() == []
    dented = pattern.vertices_coords.copy()
    dented[0] += [7.0, 7.0]
    assert dented_facets(replace(pattern, vertices_coords=dented)).tolist() == [0]
    padded = np.pad(pattern.faces_vertices, ((0, 0), (0, 1)), constant_values=-1)
    assert crossed_facets(replace(crossed, faces_vertices=padded)).tolist() == [1, 2]
    # Where a cut leaves facets of any shape, no dent is told.
    corner = replace(pattern, vertices_coords=dented, faces_vertices=pattern.faces_vertices.copy())
    corner.faces_vertices[3, 3] = -1
    assert dented_facets(corner).tolist() == []
    cut = replace(pattern, vertices_coords=dented, faces_vertices=padded)
    assert dented_facets(cut).tolist() == []
    assert dented_facets(cut).dtype == np.int64
