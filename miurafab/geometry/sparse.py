"""Factors of sparse symmetric matrices; no other module calls the library that makes them.

The matrices are positive definite or nearly so, and need no pivoting. A fill-reducing order can
therefore be chosen before the factorisation. The library is SuperLU (X. S. Li, ACM Trans. Math.
Softw. 31 (2005)).
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
