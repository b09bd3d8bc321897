"""The bounds: their gradients those of finite differences, their kinds counted right."""

from __future__ import annotations

import math

import numpy as np
import pytest
from problems import CELL

from miurafab.geometry.quads import QuadCharts
from miurafab.origami.fitting.inequalities import Bounds, limits
from miurafab.origami.fitting.reduction import Unknowns
from miurafab.origami.fitting.request import FitOptions
from miurafab.origami.invariants import EXACT
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
    p = SHEET.vertices[SHEET.grid.faces_vertices]
    ahead, behind = np.roll(p, -1, axis=1) - p, np.roll(p, 1, axis=1) - p
    cosine = (ahead * behind).sum(axis=2)
    cosine /= np.linalg.norm(ahead, axis=2) * np.linalg.norm(behind, axis=2)
    corners = np.arccos(cosine).ravel()
    assert np.allclose(angles, np.concatenate([corners - low, high - corners]))
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


@pytest.mark.parametrize("left_out", [*EVERY, None])
def test_a_kind_that_is_left_out_is_not_counted(left_out: str | None) -> None:
    kinds = {kind: bound for kind, bound in EVERY.items() if kind != left_out}
    names = dict(zip(EVERY, ("edge", "angle", "aspect", "kawasaki"), strict=True))
    sizes = {"edge": 24, "angle": 72, "aspect": 108, "kawasaki": 8}
    held = {names[kind]: place + 1 for place, kind in enumerate(kinds)}
    marks = [np.arange(sizes[name]) < number for name, number in held.items()]
    assert Bounds(CHARTS, 10.0, **kinds).count(np.concatenate(marks)) == held
    if left_out is not None:
        assert Bounds(CHARTS, 10.0, **{left_out: EVERY[left_out]}).any


UNKNOWNS = Unknowns.all_of(CHARTS, 12.5)
ASKED = {
    "min_edge_mm": 5.0,
    "min_angle": 0.5,
    "max_angle": 2.4,
    "max_aspect": 3.0,
    "flat_foldable": 0.1,
}


def values(bounds: Bounds) -> tuple[object, ...]:
    return bounds.min_edge, bounds.angles, bounds.aspect, bounds.kawasaki


def test_a_margin_makes_each_limit_tighter_by_its_part() -> None:
    """In a unit of 4 mm; an angle at most 2.4 is one at least pi - 2.4 beside it."""
    as_asked = limits(FitOptions(**ASKED), UNKNOWNS, 4.0)
    assert (as_asked.charts, as_asked.length) == (CHARTS, 12.5)
    assert values(as_asked) == (1.25, (0.5, 2.4), 3.0, 0.1)
    edge, angles, aspect, kawasaki = values(limits(FitOptions(**ASKED), UNKNOWNS, 4.0, 0.1))
    assert angles == pytest.approx((0.55, math.pi - 1.1 * (math.pi - 2.4)))
    assert (edge, aspect, kawasaki) == pytest.approx((1.375, 2.7, 0.09))


@pytest.mark.parametrize(
    ("option", "expected"),
    [
        ("min_edge_mm", (5.0, None, None, None)),
        ("min_angle", (None, (0.5, math.pi), None, None)),
        ("max_angle", (None, (0.0, 2.4), None, None)),
        ("max_aspect", (None, None, 3.0, None)),
        ("flat_foldable", (None, None, None, 0.1)),
    ],
)
def test_each_option_is_one_limit(option: str, expected: tuple[object, ...]) -> None:
    assert values(limits(FitOptions(**{option: ASKED[option]}), UNKNOWNS, 1.0)) == expected


def test_what_is_not_asked_for_or_is_a_constraint_is_no_limit() -> None:
    assert not limits(FitOptions(), UNKNOWNS, 1.0).any
    assert not limits(FitOptions(flat_foldable=EXACT), UNKNOWNS, 1.0).any
