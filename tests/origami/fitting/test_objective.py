"""The fair objective: each term has the gradient of central differences."""

from __future__ import annotations

import numpy as np
import pytest

from miurafab.geometry.quads import QuadCharts
from miurafab.origami.fitting.blocks import folds, stacked
from miurafab.origami.fitting.nominal import Nominal, Rim, chains_of
from miurafab.origami.fitting.objective import FairObjective, Weights
from miurafab.origami.fitting.score import bow_ties
from miurafab.origami.fitting.seed import Corrugation, seed
from miurafab.surfaces.catalogue import make_surface

CELLS = (7, 6)
SURFACE = make_surface("hypar", {})[0]
CHARTS = QuadCharts.of_cells(np.ones(CELLS[::-1], dtype=bool), np.array([0, 0, 0, 1, 1, 1, 1]))
START = seed(SURFACE, CHARTS, *CELLS, Corrugation.from_stretches(1.6, 1.3)).vertices
SHAKEN = START + np.random.default_rng(3).normal(scale=0.03, size=START.shape)
OBJECTIVE = FairObjective.of(SURFACE, CHARTS, CELLS, START, aspect=1.2, kawasaki=0.01)


@pytest.mark.parametrize("term", ["_hinges", "_fair"])
def test_gradients_are_those_of_central_differences(term: str) -> None:
    move = np.random.default_rng(4).normal(size=SHAKEN.shape)
    step = 1e-6
    active = 0
    for number, block in enumerate(getattr(OBJECTIVE, term)(SHAKEN)):
        values, jacobian = stacked([block], SHAKEN.size)
        after, before = (
            list(getattr(OBJECTIVE, term)(SHAKEN + sign * step * move))[number][0]
            for sign in (1, -1)
        )
        slope = (after - before) / (2 * step)
        allowed = 1e-6 * max(1, np.abs(slope).max(initial=0))
        assert np.abs(jacobian @ move.ravel() - slope).max(initial=0) < allowed
        active += int((values != 0).any())
    assert active >= 2


@pytest.mark.parametrize("kept", [(1, 2), (2, 1)])
@pytest.mark.parametrize("turned", [20.0, 100.0, 179.0, 181.0, 200.0])
def test_a_fold_past_180_degrees_reads_as_more(kept: tuple[int, int], turned: float) -> None:
    """Two squares and the line between them, about which the second is turned."""
    charts = QuadCharts.of_cells(np.ones(kept, dtype=bool))
    flat = np.pad(charts.lattice.astype(float), ((0, 0), (0, 1)))
    # seen along the crease, with the first square to its left, the second turns up
    across, along = (flat[:, :1], 1) if kept == (1, 2) else (flat[:, 1:2], 0)
    away = np.maximum(across - 1, 0)
    out, up = np.eye(3)[1 - along], np.array([0.0, 0.0, -1.0])

    def at(angle: float) -> np.ndarray:
        return flat - away * out + away * (np.cos(angle) * out + np.sin(angle) * up)

    angle, step = np.radians(turned), 1e-6
    rho, vertices, rows = folds(at(angle), charts)
    assert np.cos(rho - angle) == pytest.approx(1) or np.cos(rho + angle) == pytest.approx(1)
    _, jacobian = stacked([(rho, vertices, rows)], flat.size)
    speed = (at(angle + step) - at(angle - step)).ravel() / (2 * step)
    assert abs(jacobian @ speed) == pytest.approx(1.0, abs=1e-6)
    objective = FairObjective.of(SURFACE, charts, kept[::-1], at(1.0))
    w = Weights()
    values = [float(np.abs(value).sum()) for value, _, _ in objective._folds(at(angle))]
    assert values == pytest.approx(
        [
            w.folds * max(0.0, w.least_fold - angle, angle - w.greatest_fold),
            w.closed * max(0.0, angle - w.closed_fold),
        ],
        abs=1e-9,
    )


def test_a_fold_depends_on_six_vertices_that_differ() -> None:
    _, vertices, _ = folds(SHAKEN, CHARTS)
    assert vertices.shape == (len(CHARTS.neighbouring_facets), 6)
    assert (np.diff(np.sort(vertices, axis=1), axis=1) > 0).all()


def test_what_rests_within_its_limits_has_no_row() -> None:
    """But the product of the Jacobian keeps an entry for every two vertices of neighbouring facets:
    the order of elimination is found once.
    """
    values = [value for value, _, _ in OBJECTIVE._hinges(SHAKEN)]
    assert len(values.pop(1)) == len(CHARTS.neighbouring_facets)
    assert (np.concatenate(values) != 0).all()
    _, jacobian = stacked(list(OBJECTIVE._hinges(SHAKEN)), SHAKEN.size)
    product = (abs(jacobian).T @ abs(jacobian)).toarray().reshape(len(SHAKEN), 3, -1, 3)
    six = folds(SHAKEN, CHARTS)[1]
    assert (product[six[:, :, None], :, six[:, None, :]] > 0).all()


def test_folds_have_the_sense_of_a_miura_tessellation() -> None:
    assert (np.sign(folds(START, CHARTS)[0]) == OBJECTIVE.sense).all()
    # a few folds that the start presses past 180 degrees do not change the sense of any
    pressed = START.copy()
    pressed[CHARTS.faces_vertices[20, 2]] -= [0.0, 0.0, 1.0]
    other = FairObjective.of(SURFACE, CHARTS, CELLS, pressed)
    assert not (np.sign(folds(pressed, CHARTS)[0]) == OBJECTIVE.sense).all()
    assert (other.sense == OBJECTIVE.sense).all()


def test_the_distance_is_to_the_tangent_plane() -> None:
    values, jacobian, feet = OBJECTIVE(SHAKEN, OBJECTIVE.feet)
    move = np.random.default_rng(5).normal(size=SHAKEN.shape)
    step, facets = 1e-6, len(CHARTS.faces_vertices)
    after, before = (OBJECTIVE(SHAKEN + sign * step * move, feet)[0][:facets] for sign in (1, -1))
    slope = (after - before) / (2 * step)
    # the foot moves within the plane, to first order
    assert np.abs((jacobian @ move.ravel())[:facets] - slope).max() < 0.05 * np.abs(slope).max()
    assert np.abs(values[:facets]).max() > 0.01


def test_second_differences_are_taken_inside_a_chart_against_the_target() -> None:
    corners = Nominal.of(SURFACE, CHARTS, *CELLS).corners
    chains, bend = chains_of(CHARTS, corners)
    place = CHARTS.lattice[chains]
    steps = np.diff(place, axis=1)
    assert ((steps == [2, 0]).all(axis=(1, 2)) | (steps == [0, 2]).all(axis=(1, 2))).all()
    along = chains[(steps == [2, 0]).all(axis=(1, 2))]
    # only the second piece is four columns wide
    assert set(CHARTS.lattice[along[:, 0], 0].tolist()) == {3}
    assert len(along) == 7
    assert len(chains) - len(along) == 3 * (4 + 5)  # the shared column belongs to both pieces
    nominal = np.zeros((CHARTS.vertices_count, 3))
    nominal[CHARTS.faces_vertices] = corners
    second = nominal[chains[:, 0]] - 2 * nominal[chains[:, 1]] + nominal[chains[:, 2]]
    assert np.allclose(second, bend)


def test_the_rim_is_at_the_border_and_points_outwards() -> None:
    rim = OBJECTIVE.rim
    assert len(rim.facets) == 2 * sum(CELLS)
    middle = SURFACE.point(np.zeros((1, 2)))
    assert (np.einsum("nk,nk->n", rim.outward, rim.places - middle) > 0).all()
    whole = Rim(rim.facets, rim.places, rim.outward)
    assert whole.overhang == 1.0


def test_a_bow_tie_is_told_from_a_convex_quad() -> None:
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    dart = np.array([[0.0, 0, 0], [1, 0, 0], [0.2, 0.2, 0], [0, 1, 0]])
    bow = square[[0, 1, 3, 2]]
    assert bow_ties(np.stack([square, dart, bow, square[::-1]])).tolist() == [0, 1, 1, 0]
