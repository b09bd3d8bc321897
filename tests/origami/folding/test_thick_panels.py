"""Thick panels: trimmed as computed they clear each other, untrimmed they do not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from problems import CELL, fitted, regular

from miurafab.errors import InputError
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding import thick_panels as thickness
from miurafab.origami.folding.thick_panels import facet_limits, thick_panels


def one_crease(angle: float) -> CreasePattern:
    """Two squares of 10 mm side by side, folded by ``angle`` about the crease between them."""
    return CreasePattern(
        vertices_coords=np.array([[0, 0], [10, 0], [20, 0], [0, 10], [10, 10], [20, 10]], float),
        edges_vertices=np.array([[1, 4], [0, 1], [1, 2], [3, 4], [4, 5], [0, 3], [2, 5]]),
        edges_assignment=np.array(["V" if angle > 0 else "M"] + ["B"] * 6),
        edges_fold_angle=np.array([angle] + [0.0] * 6),
        faces_vertices=np.array([[0, 1, 4, 3], [1, 2, 5, 4]]),
    )


@pytest.mark.parametrize("angle", [-2.0, -0.3, 0.4, math.pi / 2, 3.0])
def test_one_crease_is_cut_back_by_the_bisecting_plane(angle: float) -> None:
    panels = thick_panels(one_crease(angle), 2.0)
    assert panels.closing_side[0] == ("top" if angle > 0 else "bottom")
    assert panels.offset_mm[0] == pytest.approx(math.tan(abs(angle) / 2))
    assert (panels.closing_side[1:] == "").all()
    assert (panels.offset_mm[1:] == 0).all()
    # a square loses its two long sides where the cut has crossed it
    assert panels.limit_mm == pytest.approx(20 / math.tan(abs(angle) / 2))


def test_a_regular_miura_has_the_limit_of_its_parallelograms() -> None:
    # each facet closes on the top, and on the bottom, along one zig-zag and one straight crease
    pattern = regular()
    inner = (pattern.edges_faces >= 0).all(axis=1)
    half = np.abs(np.tan(pattern.edges_fold_angle[inner] / 2))
    ends = pattern.vertices_coords[pattern.edges_vertices[inner]]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    zigzag = np.isclose(length, CELL.along)
    sine = math.sin(CELL.alpha)
    expected = min(
        2 * CELL.along * sine / half[~zigzag].max(), 2 * CELL.across * sine / half[zigzag].max()
    )
    assert facet_limits(pattern, pattern.edges_fold_angle).min() == pytest.approx(expected)


@pytest.mark.parametrize("part", [0.05, 0.5, 0.98])
def test_trimmed_panels_clear_each_other_all_the_way(part: float) -> None:
    limit = facet_limits(regular(), regular().edges_fold_angle).min()
    panels = thick_panels(regular(), part * limit)
    assert panels.folds
    assert panels.collisions == ()
    assert panels.least_scale == pytest.approx(part)


def test_trimmed_panels_of_a_curved_sheet_clear_each_other() -> None:
    pattern = fitted("sphere", 10, 10, 0.0).pattern
    assert pattern is not None
    limit = facet_limits(pattern, pattern.edges_fold_angle).min()
    assert thick_panels(pattern, 0.9 * limit).folds
    too_thick = thick_panels(pattern, 1.1 * limit)
    assert not too_thick.folds
    assert len(too_thick.too_small) > 0
    assert too_thick.least_scale == pytest.approx(1.1)


def test_untrimmed_panels_run_into_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    closing = thickness._closing
    monkeypatch.setattr(thickness, "_closing", lambda pattern, angle: 0.9 * closing(pattern, angle))
    panels = thick_panels(regular(5, 4), 1.0)
    assert panels.collisions
    assert not panels.folds


def test_what_is_folded_flat_has_no_thickness() -> None:
    panels = thick_panels(replace(one_crease(math.pi - 1e-9)), 0.1)
    assert panels.offset_mm[0] == math.inf
    assert panels.too_small.tolist() == [0, 1]
    assert panels.least_scale == math.inf
    assert panels.useful.tolist() == [0.0, 0.0]


def test_what_cannot_be_made_of_panels_is_refused() -> None:
    with pytest.raises(InputError, match="greater than zero"):
        thick_panels(regular(), 0.0)
    pattern = fitted("hypar").pattern
    assert pattern is not None
    with pytest.raises(InputError, match="does not fold rigidly"):
        thick_panels(pattern, 1.0)
