"""A sparse Cholesky factor A = L L^T by dense blocks: the multifrontal method.

Each separator of a nested dissection is eliminated in a dense matrix of its own, its front:

    [ F  G^T ]   F (k, k): the separator's unknowns
    [ G  H   ]   H (b, b): the later unknowns that it meets, its border

F = L L^T, then G becomes G L^-T, and -G G^T is added to H, which is passed on to the front of the
parent. So nearly all arithmetic is that of dense matrices, by LAPACK and BLAS (I. S. Duff and
J. K. Reid, ACM Trans. Math. Softw. 9 (1983); J. W. H. Liu, SIAM Review 34 (1992)).

Only the lower triangles count. The arrays here are the transposes, row by row in memory.

A ``FrontalPlan`` depends on the pattern alone and serves all matrices of that pattern.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg.blas import dsyrk, dtrsm, dtrsv
from scipy.linalg.lapack import dpotrf

from miurafab.geometry.arrays import Floats, Ints, places_in_runs
from miurafab.geometry.dissection import dissect

_Block = tuple[slice, slice, slice, slice]
"""Rows and columns in the parent's array, then in the child's."""


@dataclass(frozen=True, eq=False)
class _Handover:
    """Where the H of the front ``child`` goes in its parent's F, G and H, block by block."""

    child: int
    to_f: list[_Block]
    to_g: list[_Block]
    to_h: list[_Block]


@dataclass(frozen=True, eq=False)
class _Front:
    """The unknowns ``start`` to ``end`` of the order of elimination, and their ``border`` (b,).

    ``f_at`` and ``g_at`` are the places in F and G, row by row, of the numbers ``f_from`` and
    ``g_from`` of the matrix.
    """

    start: int
    end: int
    border: Ints
    f_at: Ints
    f_from: Ints
    g_at: Ints
    g_from: Ints
    handovers: list[_Handover]


class FrontalPlan:
    """The order of elimination of a symmetric ``pattern``, and where each number goes.

    The order is that of the nested dissection, or that of ``parts``, the unknowns that are
    eliminated together.
    """

    def __init__(self, pattern: sparse.csc_array, parts: list[Ints] | None = None) -> None:
        self.parts = [s.columns for s in dissect(pattern)] if parts is None else parts
        count = pattern.shape[0]
        self.order: Ints = np.concatenate([np.zeros(0, dtype=np.int64), *self.parts])
        place = np.empty(count, dtype=np.int64)
        place[self.order] = np.arange(count)
        self.fronts: list[_Front] = []
        self.work = 0.0
        indptr = pattern.indptr.astype(np.int64)
        ends = np.cumsum([len(columns) for columns in self.parts])
        below: list[list[int]] = [[] for _ in self.parts]
        start = 0
        for index, columns in enumerate(self.parts):
            size = len(columns)
            end = start + size
            children = below[index]
            counts = indptr[columns + 1] - indptr[columns]
            source = np.repeat(indptr[columns], counts) + places_in_runs(counts)
            row = place[pattern.indices[source]]
            column = np.repeat(np.arange(size), counts)
            lower = row >= start + column
            source, row, column = source[lower], row[lower], column[lower]
            later = [self.fronts[child].border for child in children]
            border = np.unique(np.concatenate([row, *later]))
            border = border[np.searchsorted(border, end) :]
            own = row < end
            self.fronts.append(
                _Front(
                    start,
                    end,
                    border,
                    column[own] * size + row[own] - start,
                    source[own],
                    column[~own] * len(border) + np.searchsorted(border, row[~own]),
                    source[~own],
                    [
                        _handover(child, self.fronts[child].border, start, end, border)
                        for child in children
                    ],
                )
            )
            if len(border):  # it is passed on to where the first of its unknowns is eliminated
                below[int(np.searchsorted(ends, border[0], side="right"))].append(index)
            self.work += float(size) * (size + len(border)) ** 2
            start = end

    def factor(self, numbers: Floats) -> FrontalFactor:
        """The factor of the matrix with the stored ``numbers`` (nnz,).

        Raises ``RuntimeError`` where the matrix is not positive definite.
        """
        pivots: list[Floats] = []
        panels: list[Floats] = []
        passed: dict[int, Floats] = {}
        for index, front in enumerate(self.fronts):
            size, border = front.end - front.start, len(front.border)
            f, g = np.zeros((size, size)), np.zeros((size, border))
            f.reshape(-1)[front.f_at] = numbers[front.f_from]
            g.reshape(-1)[front.g_at] = numbers[front.g_from]
            for handover in front.handovers:
                h = passed[handover.child]
                _add(f, handover.to_f, h)
                _add(g, handover.to_g, h)
            lower, failed = dpotrf(f.T, lower=1, clean=0, overwrite_a=1)
            if failed:
                raise RuntimeError("the matrix is not positive definite")
            pivots.append(lower)
            if not border:
                panels.append(g.T)
                continue
            panel = dtrsm(1.0, lower, g.T, side=1, lower=1, trans_a=1, overwrite_b=1)
            panels.append(panel)
            rest = dsyrk(-1.0, panel, lower=1).T
            for handover in front.handovers:
                _add(rest, handover.to_h, passed.pop(handover.child))
            passed[index] = rest
        return FrontalFactor(self, pivots, panels)


class FrontalFactor:
    """The Cholesky factor: of each front L (k, k) in ``pivots`` and G L^-T (b, k) in ``panels``."""

    def __init__(self, plan: FrontalPlan, pivots: list[Floats], panels: list[Floats]) -> None:
        self._plan, self._pivots, self._panels = plan, pivots, panels

    def solve(self, rhs: NDArray[Any], /) -> Floats:
        """The solution (n,) or (n, m) for the right-hand side ``rhs`` of the same shape."""
        order, fronts = self._plan.order, self._plan.fronts
        x = np.asarray(rhs, dtype=np.float64)[order]
        # for one column dtrsv costs two thirds of dtrsm
        forth, back = (_FORTH, _BACK) if x.ndim == 1 else (_FORTH_ALL, _BACK_ALL)
        for front, lower, panel in zip(fronts, self._pivots, self._panels, strict=True):
            own = x[front.start : front.end] = forth(lower, x[front.start : front.end])
            x[front.border] -= panel @ own
        for index in range(len(fronts) - 1, -1, -1):
            front = fronts[index]
            own = x[front.start : front.end] - self._panels[index].T @ x[front.border]
            x[front.start : front.end] = back(self._pivots[index], own)
        solution = np.empty_like(x)
        solution[order] = x
        return solution


_FORTH, _BACK = partial(dtrsv, lower=1), partial(dtrsv, lower=1, trans=1)
"""L^-1 and L^-T times one column."""
_FORTH_ALL, _BACK_ALL = partial(dtrsm, 1.0, lower=1), partial(dtrsm, 1.0, lower=1, trans_a=1)


def _add(target: Floats, blocks: list[_Block], source: Floats) -> None:
    for rows, columns, of_rows, of_columns in blocks:
        target[rows, columns] += source[of_rows, of_columns]


def _handover(child: int, passed: Ints, start: int, end: int, border: Ints) -> _Handover:
    """How a child with the border ``passed`` meets the front of ``start`` to ``end``.

    The border falls into runs that are whole in the front too, so that blocks can be added.
    """
    size = end - start
    own = int(np.searchsorted(passed, end))
    at = np.concatenate([passed[:own] - start, size + np.searchsorted(border, passed[own:])])
    breaks = np.flatnonzero(np.diff(at) != 1) + 1
    edges = np.unique(np.concatenate([[0, own, len(at)], breaks])).tolist()
    runs = [(slice(a, b), int(at[a])) for a, b in pairwise(edges)]
    result = _Handover(child, [], [], [])
    for k, (rows, row) in enumerate(runs):
        for columns, column in runs[k:]:
            blocks, up, left = result.to_h, size, size
            if row < size:
                blocks, up, left = (result.to_f, 0, 0) if column < size else (result.to_g, 0, size)
            high, wide = rows.stop - rows.start, columns.stop - columns.start
            blocks.append(
                (
                    slice(row - up, row - up + high),
                    slice(column - left, column - left + wide),
                    rows,
                    columns,
                )
            )
    return result
