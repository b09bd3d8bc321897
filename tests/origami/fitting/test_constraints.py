"""The constraints: zero on the closed forms, and their Jacobians those of finite differences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from problems import CELL

from miurafab.geometry.quads import QuadCharts
from miurafab.origami.fitting.constraints import OrigamiConstraints
from miurafab.origami.fitting.reduction import Unknowns
from miurafab.origami.miura import MiuraCell, regular_miura
from miurafab.origami.tessellation import Tessellation


def shaken(number: int, columns: int = 5, rows: int = 4) -> Tessellation:
    sheet = regular_miura(CELL, columns, rows)
    noise = np.random.default_rng(number).normal(scale=1.0, size=sheet.points.shape)
    return Tessellation(sheet.points + noise)


@pytest.mark.parametrize("flat_foldable", [False, True])
@settings(max_examples=8)
@given(number=st.integers(0, 10_000))
def test_the_jacobian_is_that_of_central_differences(flat_foldable: bool, number: int) -> None:
    sheet = shaken(number)
    constraints = OrigamiConstraints(sheet.grid, 10.0, flat_foldable)
    x = sheet.vertices.ravel()
    jacobian = constraints(x)[1].toarray()
    h = 1e-5
    columns = [
        (constraints(x + h * e)[0] - constraints(x - h * e)[0]) / (2 * h) for e in np.eye(len(x))
    ]
    assert np.abs(jacobian - np.stack(columns, axis=1)).max() < 1e-8


@pytest.mark.parametrize("flat_foldable", [False, True])
def test_the_values_alone_are_the_same_to_the_bit(flat_foldable: bool) -> None:
    sheet = Unknowns.all_of(QuadCharts.of_cells(np.ones((3, 4), dtype=bool)), 10.0)
    ring = Unknowns.ring(np.zeros(6, dtype=np.int64), 8, 10.0, turn=0.4)
    for unknowns, size in ((sheet, 3 * 20), (ring, 3 * 14)):
        x = np.random.default_rng(size).normal(scale=10.0, size=size)
        values = unknowns.constraints(flat_foldable)(x)[0]
        assert np.array_equal(unknowns.residuals(flat_foldable)(x), values)


@given(alpha=st.floats(0.3, 1.5), theta=st.floats(0.05, 1.5), across=st.floats(0.1, 50.0))
def test_a_regular_miura_meets_all_of_them(alpha: float, theta: float, across: float) -> None:
    sheet = regular_miura(MiuraCell(across, 10.0, alpha, theta), 6, 5)
    constraints = OrigamiConstraints(sheet.grid, float(sheet.edge_lengths.mean()), True)
    values, jacobian = constraints(sheet.vertices.ravel())
    assert len(values) == constraints.count == jacobian.shape[0]
    assert np.abs(values).max() < 1e-12


def test_moving_the_sheet_rigidly_changes_nothing() -> None:
    sheet = shaken(1)
    constraints = OrigamiConstraints(sheet.grid, 10.0, True)
    values, jacobian = constraints(sheet.vertices.ravel())
    for direction in np.eye(3):
        slide = np.tile(direction, len(sheet.vertices))
        turn = np.cross(direction, sheet.vertices).ravel()
        assert np.abs(jacobian @ slide).max() < 1e-12
        assert np.abs(jacobian @ turn).max() < 1e-11
    assert np.abs(values).max() > 1e-3


def test_a_strip_without_interior_vertices_is_only_planar() -> None:
    sheet = regular_miura(CELL, 5, 2)
    values, jacobian = OrigamiConstraints(sheet.grid, 10.0, True)(sheet.vertices.ravel())
    assert len(values) == 4
    assert jacobian.shape == (4, 30)
