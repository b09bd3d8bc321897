"""Factors of sparse symmetric matrices, and the order in which unknowns are eliminated."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from miurafab.geometry import multifrontal
from miurafab.geometry.dissection import dissect
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


def test_a_solver_fills_up_patterns_with_fewer_entries_and_learns_new_entries():
    solver, whole = SymmetricSolver(), positive_definite(12, 1)
    right = np.ones(144)
    for reach in (1, 12, 0, 144, 13):
        band = sparse.diags_array(
            np.ones(2 * reach + 1), offsets=range(-reach, reach + 1), shape=whole.shape
        )
        matrix = (whole * band + 40 * sparse.eye_array(144)).tocsc()
        assert matrix @ solver.factor(matrix).solve(right) == pytest.approx(right)


def test_earlier_factors_of_a_solver_stay_good():
    solver = SymmetricSolver()
    matrices = [positive_definite(12, seed) for seed in range(3)]
    factors = [solver.factor(matrix) for matrix in matrices]
    right = np.random.default_rng(0).normal(size=(144, 2))
    for matrix, factor in zip(matrices, factors, strict=True):
        assert matrix @ factor.solve(right) == pytest.approx(right)


def test_a_solver_goes_on_after_a_matrix_that_is_not_positive_definite():
    solver, matrix = SymmetricSolver(), positive_definite(12, 1)
    solver.factor(matrix)
    shifted = (matrix - 5 * sparse.eye_array(144)).tocsc()
    for other in (matrix * 0.0, shifted):
        with pytest.raises(RuntimeError):
            solver.factor(other)
    assert matrix @ solver.factor(matrix).solve(np.ones(144)) == pytest.approx(np.ones(144))


def scattered(side, seed):
    """Two grids without a join and five lone unknowns, in a random order."""
    grids = [positive_definite(side, seed), positive_definite(side // 2, seed + 1)]
    matrix = sparse.block_diag([*grids, sparse.eye_array(5)], format="csr")
    mixed = np.random.default_rng(seed).permutation(matrix.shape[0])
    result = matrix[mixed][:, mixed].tocsc()
    result.sort_indices()
    return result


@pytest.mark.parametrize("side", [2, 9, 30])
def test_a_solver_factors_matrices_that_fall_apart(side):
    matrix = scattered(side, 3)
    right = np.random.default_rng(1).normal(size=(matrix.shape[0], 2))
    assert matrix @ SymmetricSolver().factor(matrix).solve(right) == pytest.approx(right)


def test_a_solver_that_expects_no_entries_learns_them():
    solver = SymmetricSolver()
    solver.expect(sparse.csc_array((3, 3)))
    matrix = sparse.diags_array([1.0, 2.0, 4.0]).tocsc()
    assert solver.factor(matrix).solve(np.ones(3)) == pytest.approx([1.0, 0.5, 0.25])


def test_a_solver_factors_a_matrix_without_joins():
    numbers = np.arange(1.0, 501.0)
    solution = SymmetricSolver().factor(sparse.diags_array(numbers).tocsc()).solve(np.ones(500))
    assert solution == pytest.approx(1 / numbers)


def test_a_pattern_that_grows_keeps_its_order_while_that_is_good_for_it(monkeypatch):
    """Couplings of neighbours' neighbours, one by one, and then of many unknowns far apart."""
    made = []

    def counted(pattern):
        made.append(pattern.nnz)
        return dissect(pattern)

    monkeypatch.setattr(multifrontal, "dissect", counted)
    side, solver = 24, SymmetricSolver()
    matrix = positive_definite(side, 3)
    random = np.random.default_rng(8)
    right = random.normal(size=(side**2, 2))

    def coupled(one, other):
        both = np.concatenate([one, other]), np.concatenate([other, one])
        more = sparse.coo_array((np.full(2 * len(one), 1e-3), both), shape=matrix.shape)
        return (matrix + more.tocsc()).tocsc()

    for place in [None, 50, 201, 333, 402, 505]:
        if place is not None:
            matrix = coupled(np.array([place]), np.array([place + 3]))
        assert matrix @ solver.factor(matrix).solve(right) == pytest.approx(right)
    assert len(made) == 2  # of no matrix, and of the first
    matrix = coupled(*random.permutation(side**2)[:400].reshape(2, -1))
    assert matrix @ solver.factor(matrix).solve(right) == pytest.approx(right)
    assert len(made) == 3


def test_an_empty_matrix_has_an_empty_solution():
    assert SymmetricSolver().factor(sparse.csc_array((0, 0))).solve(np.zeros(0)).shape == (0,)


@pytest.mark.parametrize("matrix", [positive_definite(40, 2), scattered(30, 5)])
def test_a_separator_parts_what_is_eliminated_before_it(matrix):
    separators = dissect(matrix)
    every = np.concatenate([separator.columns for separator in separators])
    assert sorted(every.tolist()) == list(range(matrix.shape[0]))
    assert len(separators) > 5
    beneath = []
    for separator in separators:
        parts = [beneath[child] for child in separator.children]
        for k, part in enumerate(parts):
            for other in parts[k + 1 :]:
                assert matrix[part][:, other].nnz == 0
        beneath.append(np.concatenate([separator.columns, *parts]))
    tops = set(range(len(separators))) - {c for s in separators for c in s.children}
    assert sum(len(beneath[top]) for top in tops) == matrix.shape[0]


def test_the_last_separator_of_a_grid_is_thin_and_lies_in_the_middle():
    """Unknowns are coupled two lines apart, so no separator of the grid has under two lines."""
    separators = dissect(positive_definite(60, 7))
    middle = len(separators[-1].columns)
    assert 2 * 60 <= middle <= 1.2 * 2 * 60
    below = [0] * len(separators)
    for k, separator in enumerate(separators):
        below[k] = len(separator.columns) + sum(below[child] for child in separator.children)
    sides = [below[child] for child in separators[-1].children]
    assert min(sides) >= 0.3 * 60**2
    assert sum(sides) == 60**2 - middle
