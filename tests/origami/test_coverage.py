"""Coverage by closed forms: a Miura-ori on a rectangle, parts of it, and an L."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from problems import CELL, fitted

from miurafab.geometry.hausdorff import in_four
from miurafab.origami.coverage import Coverage, Shell, coverage
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.miura import regular_miura
from miurafab.origami.unfold import unfold
from miurafab.surfaces.catalogue import make_surface


def of(pattern: CreasePattern, name: str) -> Coverage:
    return coverage(pattern, make_surface(name, {})[0].tiles())


def part(pattern: CreasePattern, columns: slice, rows: slice = slice(None)) -> CreasePattern:
    """The pattern with the facets of these columns and rows alone."""
    wide, high = pattern.grid[0] - 1, pattern.grid[1] - 1
    kept = np.arange(wide * high).reshape(high, wide)[rows, columns].ravel()
    return replace(pattern, faces_vertices=pattern.faces_vertices[kept], grid=None)


@pytest.mark.parametrize("facets", [6, 12])
def test_a_miura_ori_covers_the_share_of_its_facets(facets):
    whole = fitted("plane", facets, facets).pattern
    found = of(whole, "plane")
    assert found.covered == pytest.approx(1.0, abs=1e-9)
    assert found.overhang == pytest.approx(0.0, abs=1e-9)
    half = facets // 2
    assert of(part(whole, slice(half)), "plane").covered == pytest.approx(0.5, abs=0.01)
    assert of(part(whole, slice(half), slice(half)), "plane").covered == pytest.approx(
        0.25, abs=0.01
    )


def test_the_sheet_that_is_moved_away_covers_what_is_left():
    pattern = fitted("plane", 12, 12).pattern
    surface = make_surface("plane", {})[0]
    side = surface.domain.width * pattern.scale
    moved = replace(pattern, folded_coords=pattern.folded_coords + np.array([0.3 * side, 0, 0]))
    found = of(moved, "plane")
    assert found.covered == pytest.approx(0.7, abs=0.01)
    assert found.overhang == pytest.approx(0.3, abs=0.01)
    lifted = replace(pattern, folded_coords=pattern.folded_coords + np.array([0, 0, 0.02 * side]))
    assert of(lifted, "plane").covered == of(pattern, "plane").covered


@pytest.mark.parametrize("name", ["hypar", "saddle", "vase"])
def test_half_a_sheet_and_the_other_half_cover_what_the_whole_covers(name):
    pattern = fitted(name, 12, 12).pattern
    whole = of(pattern, name)
    assert whole.covered > 0.97
    halves = (
        of(part(pattern, slice(6)), name).covered + of(part(pattern, slice(6, 12)), name).covered
    )
    assert halves == pytest.approx(whole.covered, abs=0.015)


def flat_l() -> np.ndarray:
    """An L of three squares of side 100, two of them below a rectangle 200 x 100."""
    unit = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], float)
    tiles = np.concatenate([unit + np.array([x, y, 0.0]) for x, y in ((0, 0), (1, 0), (0, 1))])
    for _ in range(3):
        tiles = in_four(tiles)
    return 100 * tiles


def test_the_rectangle_of_an_l_covers_two_thirds_of_it():
    tessellation = regular_miura(CELL, 17, 17)
    pattern, points = unfold(tessellation), tessellation.vertices
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    width, height = 16 * CELL.spacing_along, 16 * CELL.spacing_across
    laid = (points - middle) * [200 / width, 100 / height, 1.0] + [100.0, 50.0, 0.0]
    found = coverage(replace(pattern, folded_coords=laid), flat_l())
    assert found.covered == pytest.approx(2 / 3, abs=1e-3)
    assert found.overhang < 1e-3
    assert found.area == pytest.approx(200 * 100, rel=1e-3)


def test_a_second_turn_of_a_spiral_is_not_covered_by_the_first():
    surface, _ = make_surface("log-spiral", {})
    pattern = fitted("log-spiral", 12, 24).pattern
    inner = part(pattern, slice(None), slice(12))
    both = coverage(pattern, surface.tiles()).covered
    assert both > 0.95
    assert coverage(inner, surface.tiles()).covered < 0.6


@pytest.mark.parametrize("columns", [8, 5])
@pytest.mark.parametrize("name", ["plane", "vase", "log-spiral"])
def test_what_is_surely_covered_need_not_be_judged(name, columns, monkeypatch):
    """The shares are those of all parts, to the last bit, and some parts are left out."""
    pattern = part(fitted(name, 8, 8).pattern, slice(columns))
    known, asked = [], Shell.surely_covers
    monkeypatch.setattr(Shell, "surely_covers", lambda *of: known.append(asked(*of)) or known[-1])
    found = of(pattern, name)
    monkeypatch.setattr(
        Shell, "surely_covers", lambda shell, parts, reach: np.zeros(len(parts), bool)
    )
    assert found == of(pattern, name)
    assert found.overhang > 0 or name == "plane"
    assert np.concatenate(known).mean() > 0.1


@pytest.mark.parametrize("height", [0.0, 0.3])
def test_parts_that_are_surely_covered_lie_off_the_border(height):
    """Of a unit square, by closed form: points above it, and none beyond its sides."""
    square = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], float)
    shell = Shell.of_triangles(in_four(in_four(in_four(square))))
    random = np.random.default_rng(5)
    middles = random.uniform([-0.5, -0.5, height], [1.5, 1.5, height], (2000, 3))
    middles[:, 2] *= random.random(2000)
    parts = middles[:, None] + random.normal(scale=0.02, size=(2000, 3, 3))
    inside = (np.abs(parts[..., :2] - 0.5) < 0.5).all(axis=(1, 2))
    sure = shell.surely_covers(parts, 2.0)
    assert not (sure & ~inside).any()
    if height == 0:
        assert sure.sum() > 0.8 * inside.sum()
    assert not shell.surely_covers(parts + np.array([0, 0, 10]), 2.0).any()
