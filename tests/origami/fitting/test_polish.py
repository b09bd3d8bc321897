"""Polishing: closer to the target in the null space of exact constraints, never farther."""

from __future__ import annotations

import numpy as np
import pytest

from miurafab.geometry.quads import QuadGrid
from miurafab.origami.fitting.constraints import OrigamiConstraints
from miurafab.origami.fitting.inequalities import Bounds
from miurafab.origami.fitting.polish import followers, polish
from miurafab.origami.fitting.reduction import Unknowns, about_z
from miurafab.origami.fitting.seed import Corrugation, seed
from miurafab.origami.fitting.solver import project
from miurafab.surfaces.analytic import revolution
from miurafab.surfaces.catalogue import make_surface


def test_followers_are_facet_means_or_every_other_row() -> None:
    grid = QuadGrid(4, 5)
    points = np.random.default_rng(0).normal(size=(20, 3))
    middle = followers(grid, "middle") @ points
    assert np.allclose(middle, points[grid.faces_vertices].mean(axis=1))
    rows = points.reshape(5, 4, 3)
    assert np.array_equal(followers(grid, "top") @ points, rows[1::2].reshape(-1, 3))
    assert np.array_equal(followers(grid, "bottom") @ points, rows[0::2].reshape(-1, 3))
    assert np.array_equal(followers(grid, "top", -1) @ points, rows[0::2].reshape(-1, 3))


@pytest.mark.parametrize("flat_foldable", [False, True])
def test_the_sheet_comes_closer_and_stays_exact(flat_foldable: bool) -> None:
    surface = make_surface("saddle", {})[0]
    start, _ = seed(surface, 15, 15, Corrugation.from_stretches(1.3, 1.3))
    unknowns = Unknowns(15, 15, float(start.edge_lengths.mean()))
    constraints = unknowns.constraints(False)
    cap = 0.25 * unknowns.length
    found = project(constraints, start.vertices.ravel(), unknowns.places, cap=cap)
    constraints = unknowns.constraints(flat_foldable)
    found = project(constraints, found.x, unknowns.places, cap=cap)
    assert found.converged
    better = polish(found, surface, unknowns, constraints)
    assert better.after < better.before / 10
    assert np.abs(constraints(better.projection.x)[0]).max() < 1e-12


def test_bounds_hold_while_it_comes_closer() -> None:
    surface = make_surface("hypar", {})[0]
    start, _ = seed(surface, 13, 13, Corrugation.from_stretches(1.3, 1.3))
    unknowns = Unknowns(13, 13, float(start.edge_lengths.mean()))
    constraints = unknowns.constraints(False)
    bounds = Bounds(unknowns.grid, unknowns.length, min_edge=0.9 * unknowns.length)
    cap = 0.25 * unknowns.length
    x, places = start.vertices.ravel(), unknowns.places
    found = project(constraints, x, places, inequalities=bounds, cap=cap)
    assert found.converged
    better = polish(found, surface, unknowns, constraints, bounds=bounds)
    assert better.after <= better.before
    assert bounds(better.projection.x)[0].min() >= -1e-12


def test_one_period_has_the_conditions_of_the_whole_ring() -> None:
    surface = make_surface("pill", {"angle": "360deg"})[0]
    beta = surface.domain.height / 20
    profile = surface.profile
    first, _ = seed(revolution(profile, beta), 9, 2, Corrugation(0.8, 1.2))
    unknowns = Unknowns(9, 21, float(first.edge_lengths.mean()), 2 * beta)
    x = first.vertices.ravel()
    values, jacobian = unknowns.constraints(True)(x)
    sheet = unknowns.sheet(x)
    assert np.allclose(sheet.points[2], sheet.points[0] @ about_z(2 * beta).T)
    whole = OrigamiConstraints(sheet.grid, unknowns.length, True)(sheet.vertices.ravel())[0]
    assert np.allclose(np.unique(values.round(9)), np.unique(whole.round(9)))
    h = 1e-6
    columns = [
        (unknowns.constraints(True)(x + h * e)[0] - unknowns.constraints(True)(x - h * e)[0])
        / (2 * h)
        for e in np.eye(len(x))
    ]
    assert np.abs(jacobian.toarray() - np.stack(columns, axis=1)).max() < 1e-6
