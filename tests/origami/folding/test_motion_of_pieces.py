"""Pieces and trimmed sheets in motion: each folds as the whole sheet, or as it does alone."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from piece_problems import cut_to, gores, inside_circle, trimmed, two_pieces, two_trimmed_pieces
from problems import CELL, fitted, regular
from scipy.spatial.distance import pdist

from miurafab.errors import InputError, PatternError
from miurafab.geometry.polygons import edge_lengths
from miurafab.geometry.quads import QuadCharts
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.bar_hinge import sheet_model
from miurafab.origami.energy.curve import energy_curve
from miurafab.origami.energy.hinges import hinge_angles
from miurafab.origami.energy.path import folding_path
from miurafab.origami.energy.pieces import energies_of_pieces
from miurafab.origami.folding.angles_csv import contacts
from miurafab.origami.folding.bending import bending_motion
from miurafab.origami.folding.kinematics import FoldingMotion, rigid_motion, states_between
from miurafab.origami.folding.thick_panels import thick_panels
from miurafab.origami.formats.fold import fold_text, parse_fold
from miurafab.origami.miura import regular_miura
from miurafab.origami.piece import pieces_of
from miurafab.origami.unfold import unfold, unfold_charts
from miurafab.origami.verify import audit
from miurafab.workflow.fold import fold


@cache
def bent_pieces() -> CreasePattern:
    """A fitted hypar, which does not fold rigidly, in two pieces."""
    pattern = fitted("hypar", 6, 6).pattern
    charts = QuadCharts.of_cells(np.ones((6, 6), dtype=bool), np.arange(6) // 3)
    return unfold_charts(charts, pattern.folded_coords)


def assert_apart(motion: FoldingMotion) -> None:
    """The boxes of the pieces, seen from above over all frames, have gaps between them."""
    pieces = pieces_of(motion.pattern)
    seen = [motion.frames[:, piece.vertices, :2].reshape(-1, 2) for piece in pieces]
    for n, one in enumerate(seen):
        for other in seen[:n]:
            low, high = (np.array([p.min(axis=0), p.max(axis=0)]) for p in (one, other))
            assert ((low[1] < high[0]) | (high[1] < low[0])).any()


def assert_congruent(one: np.ndarray, other: np.ndarray, tolerance: float) -> None:
    assert np.abs(pdist(one) - pdist(other)).max() < tolerance


def test_a_trimmed_sheet_moves_as_its_part_of_the_whole_sheet() -> None:
    whole, part = unfold(regular_miura(CELL, 11, 11)), trimmed(11, 11)
    states = states_between(whole, 10)
    motions = [rigid_motion(pattern, states) for pattern in (whole, part)]
    gap = np.linalg.norm(part.folded_coords[:, None] - whole.folded_coords[None], axis=2)
    mine, theirs = np.nonzero(gap == 0.0)
    assert len(mine) > 40
    for one, other in zip(*(motion.frames for motion in motions), strict=True):
        assert_congruent(other[mine], one[theirs], 1e-9)
    assert motions[1].mismatch.max() < 1e-11
    last = np.abs(motions[1].fold_angles[-1])[part.edges_assignment != "B"]
    assert last == pytest.approx(np.pi)


@settings(max_examples=25)
@given(
    seed=st.integers(0, 2**32 - 1),
    corners=st.integers(3, 7),
)
def test_any_part_of_a_sheet_is_valid_and_folds_rigidly(seed: int, corners: int) -> None:
    """The part inside a star-shaped outline, in a file and back."""
    whole = regular(9, 9)
    random = np.random.default_rng(seed)
    seen = whole.folded_coords[:, :2] - whole.folded_coords[:, :2].mean(axis=0)
    size = np.ptp(seen, axis=0).max()
    wave = 0.12 * np.cos(corners * np.arctan2(seen[:, 1], seen[:, 0]) + random.uniform(0, 6))
    level = random.uniform(0.3, 0.45) + wave - np.linalg.norm(seen, axis=1) / size
    part = cut_to(whole, level)
    assert audit(part).findings == ()
    again = parse_fold(json.loads(fold_text(part)))
    assert np.array_equal(again.faces_vertices, part.faces_vertices)
    motion = rigid_motion(again, states_between(again, 4))
    assert motion.mismatch.max() < 1e-10
    assert contacts(motion) == ()


@pytest.mark.parametrize("make", [gores, two_pieces, two_trimmed_pieces])
def test_each_piece_folds_as_it_does_alone(make) -> None:
    pattern = make()
    states = states_between(pattern, 6)
    motion = rigid_motion(pattern, states)
    assert motion.is_rigid
    assert_apart(motion)
    for piece in pieces_of(pattern):
        alone = rigid_motion(piece.pattern, states).frames
        for one, other in zip(alone, motion.frames[:, piece.vertices], strict=True):
            assert_congruent(one, other, 1e-9)


def test_the_folded_frame_of_each_piece_is_its_part_of_the_folded_form() -> None:
    pattern = gores()
    folded = rigid_motion(pattern, [0.5, 1.0]).frames[1]
    for piece in pieces_of(pattern):
        assert_congruent(folded[piece.vertices], pattern.folded_coords[piece.vertices], 1e-9)


def test_pieces_that_bend_go_through_the_same_states() -> None:
    pattern = bent_pieces()
    motion = fold(pattern, 6).motion
    assert motion.mismatch is None
    assert len(motion.frames) == 7
    assert_apart(motion)
    assert motion.states[-1] == 1.0
    sides = pattern.edges_vertices
    flat = edge_lengths(pattern.vertices_coords, sides)
    for points in motion.frames:
        assert edge_lengths(points, sides) == pytest.approx(flat, rel=1e-9)
    for piece in pieces_of(pattern):
        end = motion.frames[-1][piece.vertices]
        assert_congruent(end, pattern.folded_coords[piece.vertices], 1e-7)
        # tan(rho / 2) of the crease that is driven is the state times its last value
        half = np.tan(motion.fold_angles[:, piece.edges] / 2)
        moving = np.abs(half[-1]) > 0.1
        ratio = half[:, moving] / half[-1, moving]
        assert np.abs(ratio - motion.states[:, None]).max(axis=0).min() < 1e-9


def test_a_trimmed_sheet_that_does_not_fold_rigidly_bends() -> None:
    pattern = inside_circle(fitted("hypar", 8, 8).pattern, 0.45)
    assert (pattern.faces_vertices >= 0).sum(axis=1).max() > 4
    motion = bending_motion(pattern, 6)
    assert len(motion.frames) == 7
    flat = edge_lengths(pattern.vertices_coords, pattern.edges_vertices)
    for points in motion.frames:
        assert edge_lengths(points, pattern.edges_vertices) == pytest.approx(flat, rel=1e-9)
    assert motion.frames[-1] == pytest.approx(pattern.folded_coords, abs=1e-6)


def with_flaps() -> CreasePattern:
    """A fitted hypar with three facets that hang on one crease each."""
    kept = np.ones((6, 6), dtype=bool)
    kept[0, :] = kept[:, 0] = False
    kept[0, 3] = kept[2, 0] = True
    kept[1:3, 4:] = kept[3, 4] = False
    charts = QuadCharts.of_cells(np.ones((6, 6), dtype=bool))
    shown = QuadCharts.of_cells(kept)
    used = np.unique(charts.faces_vertices[kept.ravel()])
    return unfold_charts(shown, fitted("hypar", 6, 6).pattern.folded_coords[used])


def test_parts_that_hang_on_one_crease_go_with_the_sheet() -> None:
    """Nothing but the driven crease tells them where to be: their creases keep its ratio."""
    pattern = with_flaps()
    model = sheet_model(pattern)
    counts = np.bincount(model.mechanisms)
    assert sorted(counts.tolist()) == [1, 1, 1, 28]
    curve = energy_curve(pattern, 8)
    assert curve.converged
    path = curve.path
    hanging = np.flatnonzero(counts[model.mechanisms] == 1)
    angles = np.array(
        [hinge_angles(points / model.unit_mm, model.creases) for points in path.coords]
    )
    half = np.tan(angles[:, hanging] / 2)
    driven = np.tan(path.drives / 2)
    assert half / half[0] == pytest.approx((driven / driven[0])[:, None].repeat(3, 1), rel=1e-6)


def test_two_parts_that_share_one_facet_fold_together() -> None:
    kept = np.zeros((7, 7), dtype=bool)
    kept[:4, :4] = kept[3:, 3:] = True
    whole = QuadCharts.of_cells(np.ones((7, 7), dtype=bool))
    used = np.unique(whole.faces_vertices[kept.ravel()])
    points = fitted("hypar", 7, 7).pattern.folded_coords[used]
    pattern = unfold_charts(QuadCharts.of_cells(kept), points)
    model = sheet_model(pattern)
    assert np.bincount(model.mechanisms).tolist() == [24, 24]
    path = folding_path(pattern, 40)
    assert path.converged
    slope = np.gradient(path.energies, path.drives)[3:-3]
    assert path.loads[3:-3] == pytest.approx(slope, abs=0.03 * np.abs(slope).max())
    angles = np.abs(hinge_angles(path.coords[-1] / model.unit_mm, model.creases))
    assert angles.max() < 0.2


def test_the_load_is_the_slope_of_the_energy_where_guides_hold_parts() -> None:
    path = folding_path(inside_circle(fitted("hypar", 8, 8).pattern, 0.45), 60)
    slope = np.gradient(path.energies, path.drives)
    middle = slice(5, -5)
    assert path.loads[middle] == pytest.approx(slope[middle], abs=0.02 * np.abs(slope).max())


def test_a_trimmed_miura_stores_no_energy() -> None:
    curve = energy_curve(trimmed(7, 7), 6)
    assert curve.converged
    assert curve.rigid


def test_the_energy_of_each_piece_is_that_of_the_piece_alone() -> None:
    pattern = bent_pieces()
    found = energies_of_pieces(pattern, 6)
    assert found.facets == (18, 18)
    assert found.converged
    for piece, curve in zip(pieces_of(pattern), found.curves, strict=True):
        alone = energy_curve(piece.pattern, 6)
        longer = curve.path.model.unit_mm / alone.path.model.unit_mm
        # the stiffness k_f l is in mean edges of the whole pattern here
        assert curve.path.energies * longer == pytest.approx(alone.path.energies, rel=1e-6)
        assert curve.crease == piece.edges[alone.crease]
    report = found.report()
    assert [piece["facets"] for piece in report["pieces"]] == [18, 18]
    assert report["rigid"] is False


def test_a_named_crease_is_driven_in_its_own_piece() -> None:
    pattern = two_pieces(7, 5, 3)
    second = pieces_of(pattern)[1]
    crease = int(second.edges[second.pattern.edges_assignment != "B"][0])
    driven = [curve.crease for curve in energies_of_pieces(pattern, 2, crease=crease).curves]
    assert driven[1] == crease
    assert driven[0] != crease
    with pytest.raises(InputError, match=f"Edge {pattern.seams[0, 0]} is not a crease"):
        energies_of_pieces(pattern, 2, crease=int(pattern.seams[0, 0]))


def with_a_cap() -> CreasePattern:
    """Two pieces, the second of one facet."""
    kept = np.ones((2, 3), dtype=bool)
    kept[1, 2] = False
    charts = QuadCharts.of_cells(kept, np.array([0, 0, 1]))
    points = regular_miura(CELL, 4, 3).vertices
    used = np.unique(QuadCharts.of_cells(np.ones((2, 3), dtype=bool)).faces_vertices[kept.ravel()])
    return unfold_charts(charts, points[used])


def test_a_piece_of_one_facet_stays_as_it_is() -> None:
    pattern = with_a_cap()
    assert np.bincount(pattern.pieces).tolist() == [4, 1]
    found = energies_of_pieces(pattern, 3)
    assert found.curves[1] is None
    assert found.report()["pieces"][1] == {"piece": 1, "facets": 1, "creases": 0}
    for motion in (rigid_motion(pattern, [0.0, 0.5, 1.0]), bending_motion(pattern, 3)):
        cap = pieces_of(pattern)[1].vertices
        for points in motion.frames:
            assert_congruent(points[cap], pattern.folded_coords[cap], 1e-9)


def test_what_no_piece_can_is_refused() -> None:
    pattern = two_pieces(5, 5, 2)
    with pytest.raises(PatternError, match="no folded form"):
        energies_of_pieces(replace(pattern, folded_coords=None))
    stiff = np.where(pattern.edges_assignment == "B", "B", "F")
    with pytest.raises(PatternError, match="no crease between two facets"):
        energies_of_pieces(replace(pattern, edges_assignment=stiff))
    with pytest.raises(PatternError, match="has 2 pieces"):
        sheet_model(pattern)


def test_panels_of_different_pieces_do_not_collide() -> None:
    panels = thick_panels(gores(), 0.5)
    assert panels.folds
    alone = thick_panels(pieces_of(gores())[0].pattern, 0.5)
    assert panels.limit_mm.min() == pytest.approx(alone.limit_mm.min())


@pytest.mark.parametrize("ending", [".fold", ".gif", ".glb", ".html"])
def test_a_motion_of_pieces_is_written_in_every_format(ending: str, tmp_path) -> None:
    folding = fold(two_trimmed_pieces(), 3)
    assert folding.contacts == ()
    assert folding.report()["pieces"] == 2
    path = tmp_path / f"motion{ending}"
    folding.save(path)
    assert path.stat().st_size > 1000


def test_the_energies_of_pieces_are_drawn_and_written(tmp_path) -> None:
    found = energies_of_pieces(two_pieces(5, 5, 2), 2)
    assert found.verdict() == "All pieces fold rigidly: no energy is stored on the way to flat."
    axes = found.plot()
    assert [line.get_label() for line in axes.lines] == ["piece 0", "piece 1"]
    assert "all pieces fold rigidly" in axes.get_title()
    found.save(tmp_path / "energy.svg")
    found.save(tmp_path / "energy.csv")
    rows = (tmp_path / "energy.csv").read_text().splitlines()
    assert rows[0].startswith("piece,step,angle_deg,energy_k_f_L")
    assert [row.split(",")[0] for row in rows[1:]] == ["0"] * 3 + ["1"] * 3
