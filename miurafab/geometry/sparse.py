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

from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.multifrontal import FrontalPlan


class Factor(Protocol):
    """A factored matrix of n rows."""

    def solve(self, rhs: NDArray[Any], /) -> Floats:
        """The solution (n,) or (n, m) for the right-hand side ``rhs`` of the same shape."""
        ...


class SymmetricSolver:
    """Factors positive definite matrices of one sparsity pattern in turn.

    The order of elimination, and where each number of the matrix goes, are kept from call to call.
    A matrix of another pattern begins anew. Entries that are sometimes zero should be stored as
    zeros, so that the pattern stays.
    """

    def __init__(self) -> None:
        self._indptr = self._indices = np.zeros(0, dtype=np.int32)
        self._plan: FrontalPlan | None = None

    def factor(self, matrix: sparse.csc_array) -> Factor:
        """The factor of ``matrix``, which stores both triangles, with sorted indices.

        Raises ``RuntimeError`` where the matrix is not positive definite.
        """
        known = np.array_equal(self._indptr, matrix.indptr)
        if self._plan is None or not known or not np.array_equal(self._indices, matrix.indices):
            self._indptr, self._indices = matrix.indptr.copy(), matrix.indices.copy()
            self._plan = FrontalPlan(matrix)
        return self._plan.factor(matrix.data)


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
