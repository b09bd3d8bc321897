"""Carrying a sheet: coordinates come back, and a finer grid starts near its solution."""

import numpy as np
import pytest

from miurafab.origami.fitting.constraints import OrigamiConstraints
from miurafab.origami.fitting.continuation import COARSEST
from miurafab.origami.fitting.fit import FitRequest
from miurafab.origami.fitting.prolongation import from_local, refined, to_local
from miurafab.origami.fitting.seed import Corrugation, seed
from miurafab.origami.fitting.strategies import Strategy
from miurafab.origami.tessellation import Tessellation
from miurafab.surfaces.catalogue import make_surface
from miurafab.surfaces.surface import Bent, Swapped

CORRUGATION = Corrugation.from_stretches(1.6, 1.3)


def test_coordinates_come_back():
    surface = make_surface("sphere", {})[0]
    uv = surface.domain.lattice(7, 5)
    points = surface.point(uv) + np.random.default_rng(1).normal(scale=0.05, size=(5, 7, 3))
    again = from_local(surface, uv, to_local(surface, uv, points))
    assert np.abs(again - points).max() < 1e-14


def test_a_flat_sheet_refined_is_the_sheet_of_the_finer_grid():
    """On a plane the coordinates of one parity are constant, so refining is exact."""
    surface = make_surface("plane", {})[0]
    coarse, _ = seed(surface, 9, 7, CORRUGATION)
    fine, _ = seed(surface, 17, 13, CORRUGATION)
    assert np.abs(refined(surface, coarse, 17, 13).points - fine.points).max() < 1e-13


@pytest.mark.parametrize("name", ["hypar", "sphere"])
def test_the_way_from_coarse_to_fine_ends_in_an_exact_sheet(name):
    surface = Swapped(make_surface(name, {})[0])
    plan = Strategy("refined", surface, "v", CORRUGATION)
    side = 4 * COARSEST
    found = plan.run(FitRequest(surface=surface, facets=(side, side), size_mm=200.0))
    measured = found.measurements
    assert found.attempt.way == "refined"
    assert max(measured.max_planarity, measured.max_developability) <= 1e-12
    assert measured.hausdorff_relative < 0.03


def test_a_refined_start_is_nearer_the_solution_than_the_seed():
    """Fewer steps are left to do on the finest grid than from its own seed."""
    surface = Bent(make_surface("sphere", {})[0], 1.0)
    coarse = Strategy("seed", surface, "u", CORRUGATION).run(
        FitRequest(surface=surface, facets=(16, 16))
    )
    assert coarse.measurements is not None
    sheet = coarse.pattern.folded_coords.reshape(17, 17, 3)
    start = refined(surface, Tessellation(sheet), 33, 33)
    own, _ = seed(surface, 33, 33, CORRUGATION)
    residual = {}
    for label, each in (("refined", start), ("own", own)):
        constraints = OrigamiConstraints(each.grid, float(each.edge_lengths.mean()))
        residual[label] = np.sqrt(np.mean(constraints(each.vertices.ravel())[0] ** 2))
    assert residual["refined"] < residual["own"]
