"""Elimination of the conditions of a sheet: the factor of J J^T stays sparse."""

from __future__ import annotations

import numpy as np
import pytest

from miurafab.geometry.multifrontal import FrontalPlan
from miurafab.geometry.quads import QuadCharts
from miurafab.origami.fitting.constraints import OrigamiConstraints
from miurafab.origami.fitting.seed import Corrugation, seed
from miurafab.surfaces.catalogue import make_surface


@pytest.mark.parametrize("flat_foldable", [False, True])
def test_the_factor_grows_hardly_faster_than_the_sheet(flat_foldable: bool) -> None:
    fill = []
    for facets in (16, 64):
        charts = QuadCharts.of_cells(np.ones((facets, facets), dtype=bool))
        surface = make_surface("hypar", {})[0]
        start = seed(surface, charts, facets, facets, Corrugation(0.8, 1.3))
        constraints = OrigamiConstraints(charts, 1.0, flat_foldable)
        jacobian = constraints(start.vertices.ravel())[1]
        gram = (jacobian @ jacobian.T).tocsc()
        gram.sort_indices()
        fronts = FrontalPlan(gram).fronts
        numbers = [
            (front.end - front.start) * (front.end - front.start + 2 * len(front.border))
            for front in fronts
        ]
        fill.append(sum(numbers) / 2 / gram.shape[0])
    assert fill[1] < 3 * fill[0]  # a factor of 4 in each direction; a band would give 4
