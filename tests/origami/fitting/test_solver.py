"""The projection: the nearest point of a manifold, held inequalities, and failure as a result."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from miurafab.geometry.arrays import Floats
from miurafab.origami.fitting.solver import GramFactor, project


def circles(x: Floats) -> tuple[Floats, sparse.csr_array]:
    """Each pair of coordinates on the unit circle."""
    p = x.reshape(-1, 2)
    rows = np.arange(len(p)).repeat(2)
    matrix = sparse.coo_array((2 * x, (rows, np.arange(len(x)))), shape=(len(p), len(x)))
    return (p**2).sum(axis=1) - 1, matrix.tocsr()


@settings(max_examples=25)
@given(st.lists(st.floats(0.2, 5.0), min_size=2, max_size=20))
def test_it_finds_the_nearest_points_of_circles(radii: list[float]) -> None:
    angle = np.arange(len(radii)) * 0.7
    on_circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    found = project(circles, (on_circle * np.array(radii)[:, None]).ravel())
    assert found.converged
    assert found.reason == "converged"
    assert np.abs(found.x.reshape(-1, 2) - on_circle).max() < 1e-12


def test_a_linear_problem_takes_one_step_of_least_norm() -> None:
    random = np.random.default_rng(0)
    matrix = random.normal(size=(3, 7))
    right = random.normal(size=3)

    def plane(x: Floats) -> tuple[Floats, sparse.csr_array]:
        return matrix @ x - right, sparse.csr_array(matrix)

    found = project(plane, np.zeros(7), tolerance=1e-12)
    assert found.iterations <= 2
    assert np.abs(found.x - np.linalg.pinv(matrix) @ right).max() < 1e-9


def test_redundant_constraints_do_no_harm() -> None:
    def twice(x: Floats) -> tuple[Floats, sparse.csr_array]:
        values, jacobian = circles(x)
        return np.concatenate([values, values]), sparse.vstack([jacobian, jacobian], format="csr")

    found = project(twice, np.array([3.0, 4.0]), tolerance=1e-10)
    assert found.converged
    assert np.abs(found.x - [0.6, 0.8]).max() < 1e-9


def test_an_empty_set_is_a_result_and_not_an_exception() -> None:
    def impossible(x: Floats) -> tuple[Floats, sparse.csr_array]:
        return x**2 + 1, sparse.csr_array(np.diag(2 * x))

    found = project(impossible, np.array([1.0, 2.0]), cap=0.5, max_iterations=50)
    assert not found.converged
    assert found.residual >= 1
    assert found.reason in {"the residual stalled", "the iterations ran out"}


def test_what_goes_wrong_on_the_way_is_a_reason() -> None:
    def nowhere(x: Floats) -> tuple[Floats, sparse.csr_array]:
        """The slope of a length that is 0."""
        return np.ones(1), sparse.csr_array([[np.nan]])

    def root(x: Floats) -> tuple[Floats, sparse.csr_array]:
        """log(x), of which a step from 4 leads below 0."""
        with np.errstate(invalid="ignore"):
            return np.log(x), sparse.diags_array(1 / x).tocsr()

    def square(x: Floats) -> tuple[Floats, sparse.csr_array]:
        return x**2, sparse.diags_array(2 * x).tocsr()

    for rows, start, most, reason in (
        (nowhere, 1.0, 60, "the linear system became singular"),
        (root, 4.0, 60, "a facet or edge degenerated"),
        (square, 1.0, 5, "the iterations ran out"),
    ):
        found = project(rows, np.array([start]), max_iterations=most)
        assert (found.converged, found.reason) == (False, reason)
    assert found.iterations == 5
    assert found.x == pytest.approx(2.0**-5)


def test_a_step_is_never_longer_than_the_cap() -> None:
    seen: list[Floats] = []

    def watched(x: Floats) -> tuple[Floats, sparse.csr_array]:
        seen.append(x)
        return circles(x)

    project(watched, np.array([9.0, 0.0]), cap=0.3)
    assert max(np.abs(b - a).max() for a, b in itertools.pairwise(seen)) <= 0.3 + 1e-15


class TestInequalities:
    """On the unit circle, kept above a line."""

    @staticmethod
    def above(height: float):
        def rows(x: Floats) -> tuple[Floats, sparse.csr_array]:
            return x[1::2] - height, sparse.csr_array(np.array([[0.0, 1.0]]))

        return rows

    def test_a_bound_that_is_met_changes_nothing(self) -> None:
        found = project(circles, np.array([1.0, 1.0]), inequalities=self.above(0.1))
        assert found.converged
        assert not found.active.any()
        assert np.abs(found.x - np.sqrt(0.5)).max() < 1e-12

    def test_a_bound_in_the_way_is_held_exactly_and_reported(self) -> None:
        found = project(circles, np.array([1.5, 0.1]), inequalities=self.above(0.6))
        assert found.converged
        assert found.active.tolist() == [True]
        assert np.abs(found.x - [0.8, 0.6]).max() < 1e-12

    def test_bounds_that_contradict_the_constraints_are_a_result(self) -> None:
        found = project(circles, np.array([0.5, 0.5]), inequalities=self.above(1.5), cap=0.2)
        assert not found.converged
        assert found.residual > 0.1


@pytest.mark.parametrize("change", [0.0, 1e-4])
def test_refining_an_old_factor_solves_the_new_system(change: float) -> None:
    random = np.random.default_rng(3)
    old = sparse.csr_array(random.normal(size=(20, 60)))
    new = sparse.csr_array(old.toarray() + change * random.normal(size=(20, 60)))
    factor = GramFactor()
    assert factor.renew(old)
    right = random.normal(size=20)
    solution = factor.refine(new, right)
    assert solution is not None
    assert np.abs(new @ (new.T @ solution) - right).max() < 1e-5
