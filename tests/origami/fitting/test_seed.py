"""The seed: the regular Miura-ori on a plane, and a short way from an exact sheet elsewhere."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from miurafab.geometry.polygons import edge_lengths
from miurafab.geometry.quads import QuadCharts
from miurafab.origami.fitting.constraints import OrigamiConstraints
from miurafab.origami.fitting.reduction import Unknowns
from miurafab.origami.fitting.seed import Corrugation, seed
from miurafab.origami.fitting.solver import project
from miurafab.surfaces.catalogue import make_surface
from miurafab.surfaces.surface import Swapped, tangents, unit


def seeded(surface, columns, rows, corrugation, **options):
    """The seed on a whole lattice, and its charts."""
    charts = QuadCharts.of_cells(np.ones((rows, columns), dtype=bool))
    return seed(surface, charts, columns, rows, corrugation, **options), charts


def mean_edge(made, charts) -> float:
    return float(edge_lengths(made.vertices, charts.edges_vertices).mean())


@settings(max_examples=30)
@given(amplitude=st.floats(0.1, 3.0), zigzag=st.floats(0.1, 3.0))
def test_on_a_plane_it_is_exact(amplitude: float, zigzag: float) -> None:
    made, charts = seeded(make_surface("plane", {})[0], 6, 5, Corrugation(amplitude, zigzag))
    constraints = OrigamiConstraints(charts, mean_edge(made, charts), True)
    assert np.abs(constraints(made.vertices.ravel())[0]).max() < 1e-10
    assert made.steepest < 1e-9


@given(along=st.floats(1.05, 3.0), across=st.floats(1.05, 3.0))
def test_stretches_and_corrugation_say_the_same(along: float, across: float) -> None:
    corrugation = Corrugation.from_stretches(along, across)
    assert math.isclose(corrugation.stretch_along, along)
    assert math.isclose(corrugation.stretch_across, across)


def test_its_middle_lies_on_the_target_and_a_level_lifts_it() -> None:
    surface = make_surface("plane", {})[0]
    corrugation = Corrugation(0.8, 1.0)
    middle, charts = seeded(surface, 6, 5, corrugation)
    top = seeded(surface, 6, 5, corrugation, level=-0.5)[0].vertices.reshape(6, 7, 3)
    assert np.abs(middle.vertices[charts.faces_vertices].mean(axis=1)[:, 2]).max() < 1e-12
    assert np.abs(top[1::2, :, 2]).max() < 1e-12
    assert (top[0::2, :, 2] < -0.1).all()


@pytest.mark.parametrize("name", ["hypar", "saddle", "paraboloid", "bump", "catenoid"])
def test_projection_from_it_takes_few_steps(name: str) -> None:
    made, charts = seeded(make_surface(name, {})[0], 16, 16, Corrugation.from_stretches(1.3, 1.3))
    unknowns = Unknowns.all_of(charts, mean_edge(made, charts))
    constraints, cap = unknowns.constraints(False), 0.25 * unknowns.length
    found = project(constraints, made.vertices.ravel(), cap=cap)
    assert found.converged
    assert found.iterations <= 9


def test_where_the_spacing_grows_to_one_side_the_paper_becomes_a_fan() -> None:
    surface = make_surface("helicoid", {"inner": 0.3, "pitch": 1.0, "turns": 0.6})[0]
    made, _ = seeded(surface, 16, 16, Corrugation.from_stretches(1.3, 1.3))
    points = made.vertices.reshape(17, 17, 3)
    across = np.linalg.norm(np.diff(points, axis=0), axis=-1).mean(axis=0)
    assert across[-1] > 1.5 * across[0]  # not the constant length of a rectangle of paper


def test_the_upper_layer_slides_by_at_most_60_degrees() -> None:
    """On a cylinder bent along the rows, neighbouring rows differ by H (N + t tan psi)."""
    surface = Swapped(make_surface("cylinder", {"angle": "300deg"})[0])
    made, _ = seeded(surface, 20, 5, Corrugation.from_stretches(1.3, 1.3))
    uv = surface.domain.lattice(21, 5)
    step = np.diff(made.vertices.reshape(6, 21, 3), axis=0)
    tangent = unit(tangents(surface, uv)[0])
    slide = np.einsum("jik,jik->ji", step, tangent)
    height = np.einsum("jik,jik->ji", step, surface.normal(uv))
    assert math.tan(made.steepest) > 3
    assert np.abs(slide / height).max() == pytest.approx(math.tan(math.radians(60)))


def test_each_piece_has_a_ramp_of_its_own_and_they_share_a_seam() -> None:
    surface = Swapped(make_surface("cylinder", {"angle": "160deg"})[0])
    whole = np.ones((6, 24), dtype=bool)
    corrugation = Corrugation.from_stretches(1.3, 1.3)
    slides = []
    for pieces in (1, 2, 4):
        charts = QuadCharts.of_cells(whole, np.arange(24) * pieces // 24)
        made = seed(surface, charts, 24, 6, corrugation)
        assert len(made.vertices) == 25 * 7
        slides.append(math.tan(made.steepest))
    # the slide grows with the turn of one piece: half the width, half the tangent
    assert slides[1] == pytest.approx(slides[0] / 2, rel=0.05)
    assert slides[2] == pytest.approx(slides[0] / 4, rel=0.05)
