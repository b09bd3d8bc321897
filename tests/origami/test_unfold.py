"""Unfolding in pieces: exact lengths, seams that meet, pieces apart, rings and holes opened."""

from __future__ import annotations

import numpy as np
import pytest
from piece_problems import (
    cylinder_points,
    gores,
    ring_charts,
    trimmed,
    tube_points,
    two_pieces,
    two_trimmed_pieces,
)
from problems import CELL, assert_mountains_and_valleys

from miurafab.geometry.quads import QuadCharts
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.invariants import isometry
from miurafab.origami.miura import regular_miura
from miurafab.origami.tessellation import Tessellation
from miurafab.origami.unfold import unfold, unfold_charts
from miurafab.origami.verify import audit


def whole(columns: int, rows: int) -> np.ndarray:
    return np.ones((rows, columns), dtype=bool)


def assert_seams_meet(pattern: CreasePattern) -> None:
    """Both edges of each seam have the same ends in the folded form and the same length flat."""
    pairs = pattern.seam_vertices
    folded = pattern.folded_coords[pairs]
    assert np.array_equal(folded[:, :, 0], folded[:, :, 1])
    flat = pattern.vertices_coords[pairs]
    lengths = np.linalg.norm(flat[:, 0] - flat[:, 1], axis=2)
    assert np.allclose(lengths[:, 0], lengths[:, 1], rtol=1e-12, atol=0)


def boxes(pattern: CreasePattern) -> np.ndarray:
    """(P, 2, 2) the lowest and highest corner of each piece when flat."""
    corners = [
        pattern.vertices_coords[pattern.faces_vertices[pattern.pieces == piece]].reshape(-1, 2)
        for piece in range(pattern.pieces_count)
    ]
    return np.array([[c.min(axis=0), c.max(axis=0)] for c in corners])


@pytest.mark.parametrize("make", [two_pieces, gores, trimmed, two_trimmed_pieces])
def test_exact_charts_give_valid_patterns(make) -> None:
    pattern = make()
    assert audit(pattern).findings == ()
    assert_mountains_and_valleys(pattern)
    assert_seams_meet(pattern)


def test_a_cylinder_cut_along_a_column_is_two_pieces_with_a_seam() -> None:
    pattern = two_pieces(columns=9, rows=7, after=3)
    assert pattern.pieces_count == 2
    assert pattern.grid is None
    assert len(pattern.seams) == 6
    assert len(pattern.vertices_coords) == 9 * 7 + 7
    uncut = unfold_charts(QuadCharts.of_cells(whole(8, 6)), cylinder_points(9, 7))
    assert (pattern.pieces == (pattern.cells[:, 0] >= 3)).all()
    # the creases that are left fold as before, those of the cut are borders
    inner = [(p.edges_assignment != "B").sum() for p in (uncut, pattern)]
    assert inner[0] - inner[1] == 6
    shape = uncut.folded_coords[uncut.faces_vertices]
    assert np.array_equal(pattern.folded_coords[pattern.faces_vertices], shape)


def test_the_pieces_stand_apart_and_upright() -> None:
    pattern = gores()
    box = boxes(pattern)
    for one in range(4):
        for other in range(one):
            apart = (box[one, 0] > box[other, 1]) | (box[other, 0] > box[one, 1])
            assert apart.any()
    assert pattern.vertices_coords.min(axis=0) == pytest.approx([0, 0])
    for piece in range(4):
        corners = pattern.vertices_coords[pattern.faces_vertices[pattern.pieces == piece]]
        along = (corners[:, 1] - corners[:, 0] + corners[:, 2] - corners[:, 3]).sum(axis=0)
        assert abs(along[1]) < 1e-9 * along[0]


def test_many_pieces_go_on_above() -> None:
    charts = ring_charts(24, 3, np.arange(24))
    pattern = unfold_charts(charts, tube_points(24, 3))
    width, height = np.ptp(pattern.vertices_coords, axis=0)
    assert pattern.pieces_count == 24
    assert width < 6 * height


def test_gores_close_on_each_other_all_round() -> None:
    pattern = gores(pieces=4, sides=12, along=7)
    assert len(pattern.seams) == 4 * 6
    piece = pattern.pieces[pattern.edges_faces[pattern.seams].max(axis=2)]
    assert {tuple(sorted(pair)) for pair in piece.tolist()} == {(0, 1), (1, 2), (2, 3), (0, 3)}


def test_a_ring_in_one_piece_opens_where_the_lattice_closes() -> None:
    pattern = unfold_charts(ring_charts(12, 7), tube_points(12, 7))
    assert pattern.grid == (13, 7)
    assert pattern.pieces is None
    assert audit(pattern).findings == ()
    assert_seams_meet(pattern)
    first_and_last = np.arange(7)[:, None] * 13 + [0, 12]
    assert {tuple(sorted(pair)) for pair in pattern.seam_vertices.reshape(-1, 2).tolist()} == {
        tuple(pair) for pair in first_and_last.tolist()
    }


def test_a_piece_may_straddle_the_line_where_the_lattice_closes() -> None:
    straddling = unfold_charts(
        ring_charts(12, 7, np.array([1, 1, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1])), tube_points(12, 7)
    )
    assert straddling.pieces_count == 2
    assert len(straddling.seams) == 2 * 6
    assert len(straddling.vertices_coords) == 7 * (8 + 6)
    assert audit(straddling).findings == ()


def test_a_ring_of_three_facets_is_opened_on_one_side_only() -> None:
    turn = 2 * np.pi * np.arange(3) / 3
    ring = np.stack([np.cos(turn), np.sin(turn), np.zeros(3)], axis=1)
    charts = QuadCharts.of_cells(whole(3, 1), closed=True)
    pattern = unfold_charts(charts, np.concatenate([ring, ring + np.array([0.0, 0.0, 5.0])]))
    assert pattern.grid == (4, 2)
    assert len(pattern.seams) == 1
    assert np.ptp(pattern.vertices_coords, axis=0) == pytest.approx([3 * np.sqrt(3), 5.0])


def masked(kept: np.ndarray) -> CreasePattern:
    """The Miura-ori of the cells ``kept`` (rows, columns)."""
    rows, columns = kept.shape
    grid = QuadCharts.of_cells(whole(columns, rows))
    used = np.unique(grid.faces_vertices[kept.ravel()])
    points = regular_miura(CELL, columns + 1, rows + 1).vertices[used]
    return unfold_charts(QuadCharts.of_cells(kept), points)


def test_a_chart_that_does_not_hang_together_is_several_pieces() -> None:
    kept = whole(5, 4)
    kept[:, 2] = False
    pattern = masked(kept)
    assert pattern.pieces_count == 2
    assert pattern.seams is None
    assert audit(pattern).findings == ()


def test_missing_cells_are_missing_from_the_whole_sheet_and_change_nothing_else() -> None:
    random = np.random.default_rng(5)
    kept = random.random((9, 10)) > 0.12
    kept[:, 0] = kept[0] = True
    pattern = masked(kept)
    flat = unfold(regular_miura(CELL, 11, 10))
    assert pattern.pieces_count == 1
    assert pattern.seams is None
    ours = pattern.vertices_coords[pattern.faces_vertices]
    theirs = flat.vertices_coords[flat.faces_vertices[kept.ravel()]]
    angle = np.arctan2(*(ours[-1, 2] - ours[0, 0])[::-1]) - np.arctan2(
        *(theirs[-1, 2] - theirs[0, 0])[::-1]
    )
    c, s = np.cos(angle), np.sin(angle)
    gap = ours - theirs @ np.array([[c, s], [-s, c]])
    assert np.abs(gap - gap[0, 0]).max() < 1e-11
    assert audit(pattern).findings == ()


def test_facets_that_touch_at_a_corner_only_have_vertices_of_their_own() -> None:
    kept = whole(4, 4)
    kept[0, 1] = kept[1, 2] = False
    touching = masked(kept)
    assert touching.pieces_count == 1
    table = len(np.unique(touching.folded_coords, axis=0))
    assert len(touching.vertices_coords) == table + 1


def frustum_ring() -> tuple[QuadCharts, np.ndarray]:
    """Eight facets around a square hole, too sharp at its corners to close when flat."""
    kept = whole(3, 3)
    kept[1, 1] = False
    x, y = np.meshgrid(np.arange(4) - 1.5, np.arange(4) - 1.5)
    outside = np.maximum(np.abs(x), np.abs(y)) > 1
    both = np.minimum(np.abs(x), np.abs(y)) > 1
    z = np.where(both, -1.0, np.where(outside, 0.0, 1.0))
    return QuadCharts.of_cells(kept), np.stack([x, y, z], axis=-1).reshape(-1, 3)


def test_a_piece_around_a_hole_that_does_not_close_when_flat_is_opened() -> None:
    charts, points = frustum_ring()
    pattern = unfold_charts(charts, points)
    assert pattern.pieces is None
    assert len(pattern.seams) == 1
    assert audit(pattern).measurements.max_isometry < 1e-14
    assert_seams_meet(pattern)


@pytest.mark.parametrize("pieces", [1, 3])
def test_ten_thousand_facets_unfold_to_rounding(pieces: int) -> None:
    piece = np.arange(100) * pieces // 100
    charts = QuadCharts.of_cells(whole(100, 100), piece)
    pattern = unfold_charts(charts, cylinder_points(101, 101))
    assert pattern.pieces_count == pieces
    assert isometry(pattern).max() < 1e-12


def test_rounding_is_spread_and_faults_stay_where_they_are() -> None:
    points = cylinder_points(31, 31)
    noise = np.random.default_rng(4).normal(size=points.shape)
    charts = QuadCharts.of_cells(whole(30, 30))
    rough = unfold_charts(charts, points + 1e-10 * noise)
    # every vertex is off by 1e-10 in 6 mm; added up over 15 facets of turns it would be 1e-9
    assert isometry(rough).max() < 2e-10
    lifted = points.copy()
    lifted[15 * 31 + 15] += [0.0, 0.0, 1e-3]
    broken = isometry(unfold_charts(charts, lifted)).reshape(30, 30)
    assert broken.max() > 1e-4
    assert broken[:5, :5].max() < 1e-12


@pytest.mark.parametrize(
    ("faces", "says"),
    [([[0, 1, 2, 3], [0, 1, 4, 5]], "same side"), ([[0, 1, 2, 3], [2, 1, 0, 4]], "two sides")],
)
def test_facets_that_form_no_sheet_are_a_mistake_of_the_program(faces, says) -> None:
    charts = QuadCharts(np.array(faces), np.array([[0, 0], [0, 1]]), np.zeros(2, np.int64), 6)
    with pytest.raises(ValueError, match=says):
        unfold_charts(charts, np.random.default_rng(0).random((6, 3)))


def test_a_grid_with_a_facet_that_is_not_convex_lies_flat_as_it_is() -> None:
    points = regular_miura(CELL, 4, 4).points.copy()
    points[0, 0] += 0.7 * (points[1, 1] - points[0, 0])  # over the diagonal of its facet
    pattern = unfold(Tessellation(points))
    assert {finding.code for finding in audit(pattern).findings} == {"dented"}
    assert isometry(pattern).max() < 1e-13
