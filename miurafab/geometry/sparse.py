"""Factors of sparse symmetric matrices; no other module calls the library that makes them.

The matrices are positive definite or nearly so, and need no pivoting. A fill-reducing order can
therefore be chosen before the factorisation. The library is SuperLU (X. S. Li, ACM Trans. Math.
Softw. 31 (2005)).

An iteration factors matrices of one sparsity pattern in turn. A ``SymmetricSolver`` finds the order
of elimination once for them all.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from miurafab.geometry.arrays import Floats, Ints


class Factor(Protocol):
    """A factored matrix of n rows."""

    def solve(self, rhs: NDArray[Any], /) -> Floats:
        """The solution (n,) or (n, m) for the right-hand side ``rhs`` of the same shape."""
        ...


class SymmetricSolver:
    """Factors positive definite matrices of one sparsity pattern in turn.

    What depends on the pattern alone is kept from call to call: the fill-reducing order, and where
    each number of the matrix goes in that order. A matrix of another pattern begins anew. Entries
    that are sometimes zero should be stored as zeros, so that the pattern stays.
    """

    def __init__(self) -> None:
        self._indptr = self._indices = np.zeros(0, dtype=np.int32)
        self._order = self._source = np.zeros(0, dtype=np.int64)
        self._ordered = sparse.csc_array((0, 0))

    def factor(self, matrix: sparse.csc_array) -> Factor:
        """The factor of ``matrix``, whose indices are sorted within each column.

        Raises ``RuntimeError`` where the matrix is singular to the last digit.
        """
        known = np.array_equal(self._indptr, matrix.indptr)
        if not known or not np.array_equal(self._indices, matrix.indices):
            factor = _factor(matrix, reorder=True)
            self._keep(matrix, np.argsort(factor.perm_c).astype(np.int64))
            return factor
        self._ordered.data = matrix.data[self._source]
        return _OrderedFactor(self._order, _factor(self._ordered, reorder=False))

    def _keep(self, matrix: sparse.csc_array, order: Ints) -> None:
        self._indptr, self._indices = matrix.indptr.copy(), matrix.indices.copy()
        numbered = sparse.csc_array(
            (np.arange(matrix.nnz, dtype=np.int64), matrix.indices, matrix.indptr), matrix.shape
        )
        ordered = numbered[order][:, order].tocsc()
        ordered.sort_indices()
        self._order, self._source = order, ordered.data
        self._ordered = sparse.csc_array(
            (matrix.data[ordered.data], ordered.indices, ordered.indptr), matrix.shape
        )


class _OrderedFactor:
    """The ``factor`` of a matrix whose rows and columns stand in the ``order`` (n,)."""

    def __init__(self, order: Ints, factor: Factor) -> None:
        self._order, self._factor = order, factor

    def solve(self, rhs: NDArray[Any], /) -> Floats:
        solution = np.empty_like(rhs, dtype=np.float64)
        solution[self._order] = self._factor.solve(rhs[self._order])
        return solution


def factor_symmetric(matrix: sparse.csc_array, *, reorder: bool = True) -> Factor:
    """The factor of a symmetric ``matrix``.

    Rows are eliminated in the order of minimum degree, or without ``reorder`` in their own order.
    Raises ``RuntimeError`` where the matrix is singular to the last digit.
    """
    return _factor(matrix, reorder)


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
