"""Factors of sparse symmetric matrices, and what is kept between those of one pattern."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from miurafab.geometry.sparse import SymmetricSolver, factor_symmetric, minimum_degree


def positive_definite(side, seed):
    """A matrix over the vertices of a square grid, each coupled to its neighbours."""
    random = np.random.default_rng(seed)
    path = sparse.diags_array([1.0, 1.0, 1.0], offsets=[-1, 0, 1], shape=(side, side))
    pattern = sparse.kron(path, path, format="csr")
    rows = pattern.copy()
    rows.data = random.normal(size=rows.nnz)
    return (rows.T @ rows + sparse.eye_array(side**2)).tocsc()


@pytest.mark.parametrize("reorder", [True, False])
def test_a_factor_solves_and_a_singular_matrix_is_refused(reorder):
    random = np.random.default_rng(4)
    matrix = positive_definite(6, 4)
    right = random.normal(size=(36, 2))
    assert matrix @ factor_symmetric(matrix, reorder=reorder).solve(right) == pytest.approx(right)
    assert sorted(minimum_degree(matrix).tolist()) == list(range(36))
    with pytest.raises(RuntimeError):
        factor_symmetric(sparse.csc_array((3, 3)), reorder=reorder)


def test_a_solver_factors_matrices_of_one_pattern_and_of_another():
    solver = SymmetricSolver()
    for side, seed in [(12, 1), (12, 2), (12, 3), (9, 4), (12, 5)]:
        matrix = positive_definite(side, seed)
        for right in np.random.default_rng(seed).normal(size=(3, side**2)):
            assert matrix @ solver.factor(matrix).solve(right) == pytest.approx(right)


def test_earlier_factors_of_a_solver_stay_good():
    solver = SymmetricSolver()
    matrices = [positive_definite(12, seed) for seed in range(3)]
    factors = [solver.factor(matrix) for matrix in matrices]
    right = np.random.default_rng(0).normal(size=(144, 2))
    for matrix, factor in zip(matrices, factors, strict=True):
        assert matrix @ factor.solve(right) == pytest.approx(right)


def test_a_solver_goes_on_after_a_singular_matrix():
    solver, matrix = SymmetricSolver(), positive_definite(12, 1)
    solver.factor(matrix)
    singular = matrix * 0.0
    with pytest.raises(RuntimeError):
        solver.factor(singular)
    assert matrix @ solver.factor(matrix).solve(np.ones(144)) == pytest.approx(np.ones(144))
