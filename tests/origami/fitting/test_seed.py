"""The seed: the regular Miura-ori on a plane, and a short way from an exact sheet elsewhere."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from miurafab.origami.fitting.constraints import OrigamiConstraints
from miurafab.origami.fitting.seed import Corrugation, seed
from miurafab.origami.fitting.solver import project
from miurafab.surfaces.catalogue import make_surface
from miurafab.surfaces.surface import Swapped, tangents, unit


@settings(max_examples=30)
@given(amplitude=st.floats(0.1, 3.0), zigzag=st.floats(0.1, 3.0))
def test_on_a_plane_it_is_exact(amplitude: float, zigzag: float) -> None:
    sheet, steepest = seed(make_surface("plane", {})[0], 7, 6, Corrugation(amplitude, zigzag))
    constraints = OrigamiConstraints(sheet.grid, float(sheet.edge_lengths.mean()), True)
    assert np.abs(constraints(sheet.vertices.ravel())[0]).max() < 1e-10
    assert steepest < 1e-9


@given(along=st.floats(1.05, 3.0), across=st.floats(1.05, 3.0))
def test_stretches_and_corrugation_say_the_same(along: float, across: float) -> None:
    corrugation = Corrugation.from_stretches(along, across)
    assert math.isclose(corrugation.stretch_along, along)
    assert math.isclose(corrugation.stretch_across, across)


def test_its_middle_lies_on_the_target_and_a_level_lifts_it() -> None:
    surface = make_surface("plane", {})[0]
    corrugation = Corrugation(0.8, 1.0)
    middle, _ = seed(surface, 7, 6, corrugation)
    top, _ = seed(surface, 7, 6, corrugation, level=-0.5)
    assert np.abs(middle.vertices[middle.grid.faces_vertices].mean(axis=1)[:, 2]).max() < 1e-12
    assert np.abs(top.points[1::2, :, 2]).max() < 1e-12
    assert (top.points[0::2, :, 2] < -0.1).all()


@pytest.mark.parametrize("name", ["hypar", "saddle", "paraboloid", "bump", "catenoid"])
def test_projection_from_it_takes_few_steps(name: str) -> None:
    sheet, _ = seed(make_surface(name, {})[0], 17, 17, Corrugation.from_stretches(1.3, 1.3))
    length = float(sheet.edge_lengths.mean())
    constraints = OrigamiConstraints(sheet.grid, length)
    found = project(constraints, sheet.vertices.ravel(), constraints.places, cap=0.25 * length)
    assert found.converged
    assert found.iterations <= 9


def test_where_the_spacing_grows_to_one_side_the_paper_becomes_a_fan() -> None:
    surface = make_surface("helicoid", {"inner": 0.3, "pitch": 1.0, "turns": 0.6})[0]
    sheet, _ = seed(surface, 17, 17, Corrugation.from_stretches(1.3, 1.3))
    across = np.linalg.norm(np.diff(sheet.points, axis=0), axis=-1).mean(axis=0)
    assert across[-1] > 1.5 * across[0]  # not the constant length of a rectangle of paper


def test_the_upper_layer_slides_by_at_most_60_degrees() -> None:
    """On a cylinder bent along the rows, neighbouring rows differ by H (N + t tan psi)."""
    surface = Swapped(make_surface("cylinder", {"angle": "300deg"})[0])
    sheet, steepest = seed(surface, 21, 6, Corrugation.from_stretches(1.3, 1.3))
    uv = surface.domain.lattice(21, 5)
    step = np.diff(sheet.points, axis=0)
    tangent = unit(tangents(surface, uv)[0])
    slide = np.einsum("jik,jik->ji", step, tangent)
    height = np.einsum("jik,jik->ji", step, surface.normal(uv))
    assert steepest > 3
    assert np.abs(slide / height).max() == pytest.approx(math.tan(math.radians(60)))
