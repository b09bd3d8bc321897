"""Nested dissection: a permutation whose separators separate, and a factor that stays sparse."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse
from scipy.sparse.linalg import splu

from miurafab.geometry.quads import QuadCharts
from miurafab.origami.fitting.constraints import OrigamiConstraints
from miurafab.origami.fitting.nested_dissection import boxes_of_rows, nested_dissection
from miurafab.origami.fitting.seed import Corrugation, seed
from miurafab.origami.fitting.solver import elimination_order
from miurafab.surfaces.catalogue import make_surface


@settings(max_examples=30)
@given(st.integers(1, 200), st.integers(0, 2**31))
def test_every_row_comes_once(count: int, number: int) -> None:
    random = np.random.default_rng(number)
    low = random.integers(0, 30, size=(count, 2))
    order = nested_dissection(low, low + random.integers(0, 4, size=(count, 2)))
    assert np.array_equal(np.sort(order), np.arange(count))


def test_boxes_are_the_extremes_of_the_places_that_a_row_touches() -> None:
    matrix = sparse.csr_array(np.array([[1.0, 0, 0, 1], [0, 1, 0, 0]]))
    places = np.array([[3, 0], [1, 1], [7, 7], [2, 5]])
    low, high = boxes_of_rows(matrix, places)
    assert low.tolist() == [[2, 0], [1, 1]]
    assert high.tolist() == [[3, 5], [1, 1]]


@pytest.mark.parametrize("flat_foldable", [False, True])
def test_the_factor_grows_hardly_faster_than_the_sheet(flat_foldable: bool) -> None:
    fill = []
    for facets in (16, 64):
        charts = QuadCharts.of_cells(np.ones((facets, facets), dtype=bool))
        surface = make_surface("hypar", {})[0]
        start = seed(surface, charts, facets, facets, Corrugation(0.8, 1.3))
        constraints = OrigamiConstraints(charts, 1.0, flat_foldable)
        jacobian = constraints(start.vertices.ravel())[1]
        ordered = jacobian[elimination_order(jacobian, charts.lattice.repeat(3, axis=0))]
        gram = (ordered @ ordered.T).tocsc() + 1e-9 * sparse.eye_array(
            ordered.shape[0], format="csc"
        )
        factor = splu(
            gram, permc_spec="NATURAL", diag_pivot_thresh=0, options={"SymmetricMode": True}
        )
        fill.append(factor.L.nnz / ordered.shape[0])
    assert fill[1] < 3 * fill[0]  # a factor of 4 in each direction; a band would give 4
