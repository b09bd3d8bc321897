"""Nested dissection: an elimination order that keeps the factor of a planar problem sparse.

Each row of a sparse matrix touches unknowns that have places in the plane; the row covers the box
around them. A straight cut parts the rows into two sides and the few rows that straddle the cut.
The straddling rows are numbered last, so the two sides are independent. Each side is cut again
across its longer extent. The factor of the Gram matrix of n rows then has O(n log n) entries and
takes O(n^1.5) operations (A. George, SIAM J. Numer. Anal. 10 (1973)).
This module knows nothing of origami.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from miurafab.geometry.arrays import Ints

LEAF = 24
"""Sets of up to this many rows are not cut further."""


def boxes_of_rows(matrix: sparse.csr_array, places: Ints) -> tuple[Ints, Ints]:
    """The lower and upper corner, each (m, 2), of the places that each row of ``matrix`` touches.

    ``places`` (n, 2) are whole-number places of the matrix's columns; no row may be empty.
    """
    touched = places[matrix.indices]
    starts = matrix.indptr[:-1]
    return np.minimum.reduceat(touched, starts), np.maximum.reduceat(touched, starts)


def nested_dissection(low: Ints, high: Ints) -> Ints:
    """(m,) the order in which to eliminate rows that cover the boxes ``low`` to ``high`` (m, 2)."""
    ordered: list[Ints] = []
    # depth first; a separator is pushed before its two sides, so that it is popped after them
    waiting: list[tuple[Ints, bool]] = [(np.arange(len(low), dtype=np.int64), False)]
    while waiting:
        rows, separator = waiting.pop()
        sides = None if separator or len(rows) <= LEAF else _cut(rows, low[rows], high[rows])
        if sides is None:
            ordered.append(rows)
        else:
            before, after, straddling = sides
            waiting += [(straddling, True), (after, False), (before, False)]
    return np.concatenate(ordered)


def _cut(rows: Ints, low: Ints, high: Ints) -> tuple[Ints, Ints, Ints] | None:
    """The rows before, after and across the cut through the middle; None if a side is empty."""
    start, end = low.min(axis=0), high.max(axis=0)
    axis = int(np.argmax(end - start))
    middle = (start[axis] + end[axis] + 1) // 2
    before, after = high[:, axis] < middle, low[:, axis] >= middle
    if not before.any() or not after.any():
        return None
    return rows[before], rows[after], rows[~(before | after)]
