"""Factors of sparse symmetric matrices; no other module calls a library that makes them.

Two kinds of matrices, and so two factors:

- positive definite: ``SymmetricSolver``, a multifrontal Cholesky factor. What depends on the
  sparsity pattern alone is kept between the matrices of an iteration.
- symmetric, perhaps with negative eigenvalues: ``factor_symmetric``, SuperLU without pivoting
  (X. S. Li, ACM Trans. Math. Softw. 31 (2005)).
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from miurafab.geometry.arrays import Floats, Ints, places_among
from miurafab.geometry.multifrontal import FrontalPlan

MORE_WORK = 1.5
"""A pattern that has grown gets an order of its own if in the old order its factor takes so many
times the work that the factor took as the order was made."""


class Factor(Protocol):
    """A factored matrix of n rows."""

    def solve(self, rhs: NDArray[Any], /) -> Floats:
        """The solution (n,) or (n, m) for the right-hand side ``rhs`` of the same shape."""
        ...


class SymmetricSolver:
    """Factors positive definite matrices of about one sparsity pattern in turn.

    The order of elimination, and where each number of a matrix goes, are kept from call to call.
    SciPy's products leave out entries that happen to be zero, so patterns of the same problem
    differ a little: a matrix with fewer entries is filled up with zeros, and new entries join the
    pattern for all calls that follow, in the same order of elimination as long as that is good for
    them (``MORE_WORK``). A matrix of another size begins anew.
    """

    def __init__(self) -> None:
        self.expect(sparse.csc_array((0, 0)))

    @property
    def size(self) -> int:
        """The rows of the matrices that are expected."""
        return int(self._pattern.shape[0])

    def expect(self, pattern: sparse.csc_array) -> None:
        """Plan for matrices whose entries are among those of ``pattern``."""
        self._pattern = _ones(pattern)
        self._plan = FrontalPlan(self._pattern)
        self._work = self._plan.work

    def factor(self, matrix: sparse.csc_array) -> Factor:
        """The factor of ``matrix``, which stores both triangles, with sorted indices.

        Raises ``RuntimeError`` where the matrix is not positive definite.
        """
        if matrix.shape != self._pattern.shape:
            self.expect(matrix)
        numbers = self._filled_up(matrix)
        if numbers is None:
            self._grow(_ones(matrix))
            numbers = self._filled_up(matrix)
            assert numbers is not None
        return self._plan.factor(numbers)

    def _grow(self, more: sparse.csc_array) -> None:
        """Plan for the entries of ``more`` as well."""
        pattern = _ones(self._pattern + more)
        plan = FrontalPlan(pattern, self._plan.parts)
        if plan.work > MORE_WORK * self._work:
            self.expect(pattern)
        else:
            self._pattern, self._plan = pattern, plan

    def _filled_up(self, matrix: sparse.csc_array) -> Floats | None:
        """The numbers of ``matrix`` at the entries of the pattern; None if it lacks entries."""
        mine = self._pattern
        if np.array_equal(mine.indptr, matrix.indptr) and np.array_equal(
            mine.indices, matrix.indices
        ):
            return matrix.data
        known, wanted = _keys(mine), _keys(matrix)
        at = places_among(known, wanted)
        if (at < 0).any():
            return None
        numbers = np.zeros(len(known))
        numbers[at] = matrix.data
        return numbers


def _ones(matrix: sparse.csc_array) -> sparse.csc_array:
    """The pattern of ``matrix`` with a one at each entry, its indices sorted."""
    ones = np.ones(matrix.nnz)
    pattern = sparse.csc_array((ones, matrix.indices, matrix.indptr), matrix.shape, copy=True)
    pattern.sort_indices()
    return pattern


def _keys(matrix: sparse.csc_array) -> Ints:
    """(nnz,) a number for each entry; ascending if the indices are sorted."""
    columns = np.repeat(np.arange(matrix.shape[1], dtype=np.int64), np.diff(matrix.indptr))
    return columns * matrix.shape[0] + matrix.indices


def factor_symmetric(matrix: sparse.csc_array, *, reorder: bool = True) -> Factor:
    """The factor of a symmetric ``matrix``.

    Rows are eliminated in the order of minimum degree, or without ``reorder`` in their own order.
    Raises ``RuntimeError`` where the matrix is singular to the last digit.
    """
    return _factor(matrix, reorder)


def negative_pivots(factor: Factor) -> int:
    """The number of negative eigenvalues of a matrix factored by a function of this module.

    By J. J. Sylvester's law of inertia it is that of the pivots, since rows are not exchanged. A
    Cholesky factor has none.
    """
    return int((factor.U.diagonal() < 0).sum()) if isinstance(factor, SuperLU) else 0


def minimum_degree(matrix: sparse.csc_array) -> Ints:
    """(n,) the rows of a symmetric ``matrix`` in the fill-reducing order of minimum degree."""
    return np.argsort(_factor(matrix, reorder=True).perm_c).astype(np.int64)


def _factor(matrix: sparse.csc_array, reorder: bool) -> SuperLU:
    return splu(
        matrix,
        permc_spec="MMD_AT_PLUS_A" if reorder else "NATURAL",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
