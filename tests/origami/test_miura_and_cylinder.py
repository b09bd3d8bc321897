"""The two closed forms: the cell against its formulae, cylinders against the constraints."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from miurafab.origami.constraints import OrigamiConstraints
from miurafab.origami.cylinder import cylinder_on
from miurafab.origami.miura import MiuraCell, regular_miura
from miurafab.surfaces.analytic import GeneralizedCylinder
from miurafab.surfaces.catalogue import make_surface


@settings(max_examples=50)
@given(
    across=st.floats(0.5, 20), along=st.floats(0.5, 20), alpha=st.floats(0.3, 1.5),
    theta=st.floats(0.05, 1.5),
)  # fmt: skip
def test_the_cell_has_the_sides_and_angle_it_was_given(
    across: float, along: float, alpha: float, theta: float
) -> None:
    p = regular_miura(MiuraCell(across, along, alpha, theta), 3, 3).points
    assert np.allclose(np.linalg.norm(np.diff(p, axis=1), axis=2), along)
    assert np.allclose(np.linalg.norm(np.diff(p, axis=0), axis=2), across)
    cosine = (p[0, 1] - p[0, 0]) @ (p[1, 0] - p[0, 0]) / (along * across)
    angle = math.acos(cosine)
    assert math.isclose(min(angle, math.pi - angle), alpha, rel_tol=1e-9)


@pytest.mark.parametrize("name", ["cylinder", "log-spiral"])
@pytest.mark.parametrize("level", [0.0, -0.5])
def test_cylinders_are_exact_and_flat_foldable_without_a_solver(name: str, level: float) -> None:
    surface = make_surface(name, {})[0]
    assert isinstance(surface, GeneralizedCylinder)
    sheet = cylinder_on(surface, 41, 41, 0.83, 1.4, level)
    constraints = OrigamiConstraints(sheet.grid, float(sheet.edge_lengths.mean()), True)
    assert np.abs(constraints(sheet.vertices.ravel())[0]).max() < 2e-14


def test_the_top_of_a_cylinder_lies_on_it() -> None:
    surface = make_surface("cylinder", {})[0]
    assert isinstance(surface, GeneralizedCylinder)
    sheet = cylinder_on(surface, 21, 41, 0.83, 1.4, -0.5)
    upper = sheet.points[1::2].reshape(-1, 3)
    lower = sheet.points[0::2].reshape(-1, 3)
    gap = [np.linalg.norm(surface.closest_point(p) - p, axis=1).max() for p in (upper, lower)]
    assert gap[0] < 0.1 * gap[1]
