"""Split of a grid of facets into few blocks that each fit the bed, by dynamic programming.

A *band* is a range of facet rows. It is cut into runs of columns, each as long as fits with its
tabs; no other cut of the band has fewer runs. With runs(r, h, c) the number of runs of the h rows
from row r over the first c columns, the least number of patches of a prefix is

    best(0, c) = 0,    best(r, c) = min over h of best(r - h, c) + runs(r - h, h, c).

The same is done with rows and columns exchanged. Prefixes allow more than a plain split: for each
c, the columns before c are cut into bands of rows and the columns from c on into bands of columns
(their least number is a suffix sum of the same kind). The best c is found by adding two arrays. So
the short runs at the ends of all bands are joined and cut lengthwise. Among equal numbers of
patches, the shortest seams win.

The tab of an edge between two facets is assumed to stand on the facet with the lower row or column,
as the tabs are assigned later. Tabs that share a facet only become smaller.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from miurafab.fabrication.partition.fit_box import Space
from miurafab.geometry.arrays import Floats, Ints

Block = tuple[int, int, int, int]
"""First row, end row, first column, end column of a block of facets; the ends are excluded."""

_PATCH = 1e9
"""The cost of a patch in mm of seam: one patch less always wins."""


@dataclass(frozen=True, eq=False)
class GridShape:
    """A grid of R x C facets for the split: support values in D directions, and side lengths.

    ``body`` (C, R, D): support values of the facets; ``right`` and ``top`` (C, R, D): support
    values of the tabs on their right and top sides; ``right_mm`` and ``top_mm`` (C, R): lengths of
    these sides, 0 at the border.
    """

    body: NDArray[np.float32]
    right: NDArray[np.float32]
    top: NDArray[np.float32]
    right_mm: Floats
    top_mm: Floats

    def rows_from(self, row: int) -> GridShape:
        """The grid without its first ``row`` rows."""
        return GridShape(
            self.body[:, row:],
            self.right[:, row:],
            self.top[:, row:],
            self.right_mm[:, row:],
            self.top_mm[:, row:],
        )

    def part(self, r0: int, r1: int, c0: int, c1: int) -> GridShape:
        """The rows from ``r0`` to ``r1`` and columns from ``c0`` to ``c1``, the ends excluded."""
        here = (slice(c0, c1), slice(r0, r1))
        return GridShape(
            self.body[here],
            self.right[here],
            self.top[here],
            self.right_mm[here],
            self.top_mm[here],
        )

    def with_every(self, n: int) -> GridShape:
        """The same grid with every ``n``-th direction only."""
        here = (slice(None), slice(None), slice(None, None, n))
        return replace(self, body=self.body[here], right=self.right[here], top=self.top[here])

    def exchanged(self) -> GridShape:
        """The same grid with rows and columns exchanged."""

        def swap(values: NDArray[Any]) -> NDArray[Any]:
            return np.ascontiguousarray(values.swapaxes(0, 1))

        return GridShape(
            swap(self.body),
            swap(self.top),
            swap(self.right),
            swap(self.top_mm),
            swap(self.right_mm),
        )


def split_grid(shape: GridShape, space: Space) -> list[Block]:
    """Blocks that cover the grid and each fit ``space`` with their tabs.

    Of two neighbouring blocks the lower or left block comes first. Every facet with its tabs must
    fit alone.
    """
    rows, columns = _Bands(shape, space), _Bands(shape.exchanged(), space)
    by_row = rows.prefixes + columns.suffix_total()
    by_column = columns.prefixes + rows.suffix_total()
    at_row, at_column = int(np.argmin(by_row)), int(np.argmin(by_column))
    if by_row[at_row] <= by_column[at_column]:
        return _both(rows, columns, at_row)
    return [(b0, b1, a0, a1) for a0, a1, b0, b1 in _both(columns, rows, at_column)]


def _both(first: _Bands, second: _Bands, at: int) -> list[Block]:
    """Blocks of ``first`` over its columns before ``at``, then of ``second`` over the rest."""
    found = first.blocks(at)
    found += [(b0, b1, a0, a1) for a0, a1, b0, b1 in second.blocks_from(at)]
    return found


class _Bands:
    """The cost of every band over every prefix of columns, and the best cuts between bands.

    ``cost[h - 1][c, r]`` (C + 1, R - h + 1) is the cost of the band of h rows from row r over its
    first c columns; infinite if a column of the band does not fit.
    """

    def __init__(self, shape: GridShape, space: Space) -> None:
        self.shape, self.space = shape, space
        self.columns, self.rows = shape.right_mm.shape
        self.cost: list[Floats] = []
        body, right, cut_mm = shape.body.copy(), shape.right.copy(), shape.right_mm
        for h in range(1, self.rows + 1):
            top = shape.rows_from(h - 1)
            if h > 1:
                body, right = body[:, :-1], right[:, :-1]
                np.maximum(body, top.body, out=body)
                np.maximum(right, top.right, out=right)
                cut_mm = cut_mm[:, :-1] + top.right_mm
            cost = self._runs(body, top.top, right, cut_mm, h)
            if np.isinf(cost[1]).all():
                break
            seam = np.concatenate([np.zeros((1, cost.shape[1])), np.cumsum(top.top_mm, axis=0)])
            self.cost.append(cost + seam)
        self.best, self.choice = self._cuts()
        self.prefixes = self.best[self.rows] + np.append(0.0, shape.right_mm.sum(axis=1))
        self.prefixes[0] = 0.0

    def _runs(
        self,
        body: NDArray[np.float32],
        top: NDArray[np.float32],
        right: NDArray[np.float32],
        cut_mm: Floats,
        h: int,
    ) -> Floats:
        """(C + 1, B) cost in mm of the greedy runs of B bands over their first c columns."""
        bands = body.shape[1]
        cost = np.zeros((self.columns + 1, bands))
        run = np.full(body.shape[1:], -np.inf, dtype=np.float32)
        for c in range(self.columns):
            column = np.maximum(body[c], top[c])
            grown = np.maximum(run, column)
            longer = self.space.holds(np.maximum(grown, right[c]))
            if c == 0:
                longer[:] = False
            step = np.where(longer, 0.0, _PATCH + (cut_mm[c - 1] if c else 0.0))
            opened = np.flatnonzero(~longer)
            if len(opened):
                grown[opened] = column[opened]
                if h > 1:
                    fit = self.space.holds(np.maximum(column[opened], right[c, opened]))
                    step[opened[~fit]] = np.inf
            run = grown
            cost[c + 1] = cost[c] + step
        return cost

    def _cuts(self) -> tuple[Floats, Ints]:
        """(R + 1, C + 1) the least cost of the first r rows and c columns, and the height of the
        last band.
        """
        best = np.full((self.rows + 1, self.columns + 1), np.inf)
        choice = np.zeros((self.rows + 1, self.columns + 1), dtype=np.int64)
        best[0] = 0.0
        for r in range(1, self.rows + 1):
            for h in range(min(r, len(self.cost)), 0, -1):
                total = best[r - h] + self.cost[h - 1][:, r - h]
                better = total < best[r]
                best[r, better] = total[better]
                choice[r, better] = h
        return best, choice

    def suffix_total(self) -> Floats:
        """(R + 1,) the least cost of the rows from r on, over all columns."""
        return self._suffix()[0]

    def _suffix(self) -> tuple[Floats, Ints]:
        total = np.full(self.rows + 1, np.inf)
        choice = np.zeros(self.rows + 1, dtype=np.int64)
        total[self.rows] = 0.0
        for r in range(self.rows - 1, -1, -1):
            for h in range(min(self.rows - r, len(self.cost)), 0, -1):
                value = total[r + h] + self.cost[h - 1][self.columns, r]
                if value < total[r]:
                    total[r], choice[r] = value, h
        return total, choice

    def blocks(self, columns: int) -> list[Block]:
        """The best split of the first ``columns`` columns."""
        bands: list[tuple[int, int]] = []
        r = self.rows if columns else 0
        while r > 0:
            h = int(self.choice[r, columns])
            bands.append((r - h, r))
            r -= h
        return [part for r0, r1 in reversed(bands) for part in self._cut(r0, r1, columns)]

    def blocks_from(self, row: int) -> list[Block]:
        """The best split of the rows from ``row`` on."""
        _, choice = self._suffix()
        found: list[Block] = []
        while row < self.rows:
            h = int(choice[row])
            found += self._cut(row, row + h, self.columns)
            row += h
        return found

    def _cut(self, r0: int, r1: int, columns: int) -> list[Block]:
        """The greedy runs of one band: a run starts where the cost rises."""
        cost = self.cost[r1 - r0 - 1][: columns + 1, r0]
        starts = np.flatnonzero(np.diff(cost) >= _PATCH / 2)
        ends = np.append(starts[1:], columns)
        return [(r0, r1, int(c0), int(c1)) for c0, c1 in zip(starts, ends, strict=True)]
