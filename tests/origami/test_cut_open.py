"""Cuts are opened: the facets on both sides part, and everything else stays."""

from __future__ import annotations

from dataclasses import replace

import named_patterns
import numpy as np
import pytest

from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.cut_open import cut_open
from miurafab.origami.energy.bar_hinge import sheet_model
from miurafab.origami.folding.motion import find_motion


def slit():
    """Three by two squares: a slit along the middle of the lower row's top, and two flaps."""
    lines = named_patterns.border((0.0, 0.0), (3.0, 0.0), (3.0, 2.0), (0.0, 2.0))
    lines += [((1.0, 1.0), (2.0, 1.0), "C", 0.0), ((0.0, 1.0), (1.0, 1.0), "V", 60.0)]
    lines += [((2.0, 1.0), (3.0, 1.0), "V", 60.0)]
    lines += [((x, 0.0), (x, 2.0), "F", 0.0) for x in (1.0, 2.0)]
    return named_patterns.drawn(lines)


def test_the_two_sides_of_a_cut_part() -> None:
    pattern = slit()
    opened = cut_open(pattern)
    edges = len(pattern.edges_vertices)
    assert len(opened.faces_vertices) == len(pattern.faces_vertices) == 6
    # both ends of the slit lie inside the sheet, so facets around them still join them
    assert len(opened.vertices_coords) == len(pattern.vertices_coords)
    # and its two sides are one edge, which was there twice, once as a side of no facet
    assert len(opened.edges_vertices) == edges
    assert (opened.edges_assignment == pattern.edges_assignment).all()
    assert cut_open(opened).told == opened.told
    form = np.pad(opened.vertices_coords, ((0, 0), (0, 1)))
    model = sheet_model(replace(opened, folded_coords=form))
    assert set(opened.edges_assignment[model.creases_edges]) == {"V"}
    through = named_patterns.drawn(
        [
            *named_patterns.border((0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0)),
            ((1.0, 0.0), (1.0, 1.0), "C", 0.0),
        ]
    )
    parted = cut_open(through)
    assert parted.pieces_count == 2
    assert len(parted.vertices_coords) == len(through.vertices_coords) + 2
    assert (parted.edges_faces >= 0).sum() == 8
    lengths = edge_lengths(parted.vertices_coords, parted.edges_vertices)
    assert lengths[: len(through.edges_vertices)] == pytest.approx(
        edge_lengths(through.vertices_coords, through.edges_vertices)
    )
    assert cut_open(named_patterns.waterbomb_base()).edges_vertices.shape == (12, 2)


def test_a_flap_folds_along_its_cut() -> None:
    """A flap in a square, cut on three sides, turns by itself and leaves the square flat."""
    lines = named_patterns.border((0.0, 0.0), (3.0, 0.0), (3.0, 3.0), (0.0, 3.0))
    lines += [((1.0, 1.0), (2.0, 1.0), "V", 90.0), ((2.0, 1.0), (2.0, 2.0), "C", 0.0)]
    lines += [((2.0, 2.0), (1.0, 2.0), "C", 0.0), ((1.0, 2.0), (1.0, 1.0), "C", 0.0)]
    lines += [((0.0, 1.0), (1.0, 1.0), "F", 0.0), ((2.0, 1.0), (3.0, 1.0), "F", 0.0)]
    motion = find_motion(named_patterns.drawn(lines), 4).motion
    assert motion.is_rigid
    valley = motion.pattern.edges_assignment == "V"
    last = np.degrees(motion.fold_angles[-1])
    assert last[~valley] == pytest.approx(0.0, abs=1e-9)
    assert len(motion.pattern.vertices_coords) == 10 + 2  # the far corners of the flap are two
