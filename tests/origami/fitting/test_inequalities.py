"""The bounds: their gradients those of finite differences, their kinds counted right."""

from __future__ import annotations

import math

import numpy as np
import pytest
from problems import CELL

from miurafab.geometry.quads import QuadCharts
from miurafab.origami.fitting.inequalities import Bounds
from miurafab.origami.miura import regular_miura

SHEET = regular_miura(CELL, 4, 4)
CHARTS = QuadCharts.of_cells(np.ones((3, 3), dtype=bool))
EVERY = {"min_edge": 2.0, "angles": (0.5, 2.5), "aspect": 2.0, "kawasaki": 0.1}


@pytest.mark.parametrize("only", [*EVERY, None])
def test_the_gradient_is_that_of_central_differences(only: str | None) -> None:
    limits = EVERY if only is None else {only: EVERY[only]}
    bounds = Bounds(CHARTS, 10.0, **limits)
    x = SHEET.vertices.ravel() + np.random.default_rng(1).normal(scale=0.5, size=48)
    h = 1e-5
    columns = [(bounds(x + h * e)[0] - bounds(x - h * e)[0]) / (2 * h) for e in np.eye(len(x))]
    assert np.abs(bounds(x)[1].toarray() - np.stack(columns, axis=1)).max() < 1e-8


def test_slack_is_the_distance_to_the_limit() -> None:
    x = SHEET.vertices.ravel()
    edges = Bounds(CHARTS, 1.0, min_edge=4.0)(x)[0]
    assert np.allclose(edges, SHEET.edge_lengths - 4.0)
    low, high = math.radians(60), math.radians(118)
    angles = Bounds(CHARTS, 1.0, angles=(low, high))(x)[0]
    assert np.isclose(angles.min(), min(CELL.alpha - low, high - (math.pi - CELL.alpha)))
    aspect = Bounds(CHARTS, 1.0, aspect=1.5)(x)[0]
    assert np.isclose(aspect.min(), 1.5 * 10.0 - 12.0)
    kawasaki = Bounds(CHARTS, 1.0, kawasaki=0.1)(x)[0]
    assert np.allclose(kawasaki, 0.1)


def test_each_kind_is_counted_by_itself() -> None:
    bounds = Bounds(CHARTS, 10.0, **EVERY)
    g, _ = bounds(SHEET.vertices.ravel())
    counts = bounds.count(np.ones(len(g), dtype=bool))
    assert counts == {"edge": 24, "angle": 72, "aspect": 108, "kawasaki": 8}
    assert Bounds(CHARTS, 10.0, aspect=2.0).count(np.zeros(108, dtype=bool)) == {"aspect": 0}
    assert not Bounds(CHARTS, 10.0).any
