"""Masks of outlines and sheets in cells: the cells that a part may touch, and the marked cells.

A sheet grown by half the gap is divided into cells. An outline grown by half the gap marks every
cell that it may touch, so outlines without a common cell keep their gap. The rim of a part is a
band of cells around it; a band of the same width around the sheet counts as marked.

The cells of a part in one column are one run or several. With d[i, j] the number of cells from cell
(i, j) upward that are free, a run of n cells that begins at (c, a) is free for the part at position
(i, j) if

    d[i + c, j + a] >= n,

and the position is free if all runs are. One comparison decides a run for all positions. A few
runs, far apart, rule out every position of most sheets that have no room. Where many positions are
left, the other runs are compared at the best positions only.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from miurafab.fabrication.nesting.problem import SheetKind, buffered, turned
from miurafab.geometry.arrays import Bools, Floats, Ints, places_in_runs

_TRIED = 16
"""The number of runs that are compared at all positions (tried: 8 to 32)."""

_FEW = 32
"""If fewer than one position in so many is left, the other runs are compared at each position left
(tried: 16 to 64)."""

_BLOCK = 8192
"""Positions times runs that are compared in one step."""

_COMPARED = 100
"""Cells that are compared in the time in which one cell is transformed (measured)."""


@dataclass(frozen=True, eq=False)
class Mask:
    """The cells of an outline at one rotation."""

    cells: Bools

    @cached_property
    def runs(self) -> Ints:
        """(n, 3) column, first row and length of each run; neighbours are far apart in the list."""
        padded = np.pad(self.cells, ((0, 0), (1, 1)))
        column, row = np.nonzero(padded[:, 1:] != padded[:, :-1])
        start, length = row[::2], row[1::2] - row[::2]
        # Steps of the golden ratio reach every part of the outline early.
        spread = np.argsort(np.arange(len(start)) * 0.6180339887498949 % 1.0)
        return np.column_stack([column[::2], start, length])[spread]


@dataclass(frozen=True, eq=False)
class Part:
    """An outline, its area grown by half the gap, and for each rotation its corners, moved so that
    their bounding box begins at the origin, with the shift.
    """

    outline: Floats
    area: float
    turns: dict[int, tuple[Floats, Floats]] = field(default_factory=dict)

    def turned(self, rotation: int) -> tuple[Floats, Floats]:
        if rotation not in self.turns:
            points = turned(self.outline, rotation)
            low = points.min(axis=0)
            self.turns[rotation] = (points - low, -low)
        return self.turns[rotation]


class Raster:
    """The cells of sheets of one size, grown by half the gap on all sides and by ``rim`` cells, and
    the masks of one part at a time. ``work`` counts the cells transformed.
    """

    def __init__(
        self, kind: SheetKind, gap: float, parts: Sequence[Part], along: int, rim: int
    ) -> None:
        self.gap, self.parts, self.rim, self.work = gap, parts, rim, 0
        size = np.array([kind.width + gap, kind.height + gap])
        least = [max(math.ceil(along * side / size.max()), 16) for side in size]
        import scipy.fft

        self.whole = [int(scipy.fft.next_fast_len(n + 2 * rim, real=True)) for n in least]
        self.cells = [n - 2 * rim for n in self.whole]
        self.cell = size / self.cells
        self._held = -1
        self._masks: dict[int, Mask] = {}
        self._rims: dict[int, NDArray[np.complex64]] = {}

    def reach(self, number: int, rotation: int) -> Ints:
        """(2,) the number of cells of the part along both axes."""
        high = self.parts[number].turned(rotation)[0].max(axis=0)
        count: Ints = np.ceil((high + self.gap) / self.cell - 1e-7).astype(np.int64)
        return count.clip(1, np.array(self.cells))

    def mask(self, number: int, rotation: int) -> Mask:
        """The cells that the part may touch."""
        if number != self._held:
            return Mask(self._grown(number, rotation, 0))
        if rotation not in self._masks:
            self._masks[rotation] = Mask(self._grown(number, rotation, 0))
        return self._masks[rotation]

    def hold(self, number: int) -> None:
        """Keep the masks of this part from now on, and of no other."""
        if number != self._held:
            self._held, self._masks, self._rims = number, {}, {}

    def rim_of(self, number: int, rotation: int) -> NDArray[np.complex64]:
        """The transform of the rim of the part that is held, scaled so that a wholly marked rim
        counts 1.
        """
        if rotation not in self._rims:
            around = self._grown(number, rotation, self.rim).astype(np.float32)
            inside = slice(self.rim, -self.rim)
            around[inside, inside][self.mask(number, rotation).cells] = 0.0
            self._rims[rotation] = np.conj(self.transformed(around / around.sum()))
        return self._rims[rotation]

    def transformed(self, cells: NDArray[np.float32]) -> NDArray[np.complex64]:
        """The Fourier transform of cells of a sheet."""
        self.work += math.prod(self.whole)
        import scipy.fft

        return np.asarray(scipy.fft.rfft2(cells, self.whole))

    def correlated(
        self, one: NDArray[np.complex64], other: NDArray[np.complex64]
    ) -> NDArray[np.float32]:
        """The correlation of two masks from their transforms, the second conjugate."""
        self.work += math.prod(self.whole)
        import scipy.fft

        return np.asarray(scipy.fft.irfft2(one * other, self.whole))

    def _grown(self, number: int, rotation: int, more: int) -> Bools:
        """The cells that the part grown by ``more`` cells may touch."""
        points, half = self.parts[number].turned(rotation)[0], self.gap / 2
        # A cell that the grown outline touches has its centre within half a diagonal of it.
        reach = half + np.hypot(*self.cell) / 2 + more * self.cell.min()
        shape = buffered(shapely.Polygon(points), reach)
        return self._inside(shape, self.reach(number, rotation) + 2 * more, more)

    def blank(self, kind: SheetKind) -> Bools:
        """The marked cells of an empty sheet: the band around it, and cells that touch a defect."""
        taken = np.ones(self.whole, dtype=np.bool_)
        inside = taken[self.rim : self.whole[0] - self.rim, self.rim : self.whole[1] - self.rim]
        inside[:] = False
        if kind.defects:
            lost = buffered(kind.flaws, np.hypot(*self.cell) / 2)
            inside |= self._inside(lost, np.array(self.cells), 0)
        return taken

    def open_positions(self, room: NDArray[np.int16], mask: Mask) -> tuple[Ints, Ints]:
        """The positions i, j that a few runs of ``mask`` do not rule out on a sheet with ``room``
        d, row by row; where few are left, the free positions.
        """
        columns, rows = self.cells - np.array(mask.cells.shape) + 1
        free = np.ones((columns, rows), dtype=np.bool_)
        enough = np.empty_like(free)
        done, left = 0, free.size
        for done, (column, row, length) in enumerate(mask.runs[:_TRIED].tolist(), 1):
            x, y = column + self.rim, row + self.rim
            np.greater_equal(room[x : x + columns, y : y + rows], length, out=enough)
            np.logical_and(free, enough, out=free)
            if done % 4 == 0:
                left = int(np.count_nonzero(free))
            if left * _FEW < free.size:
                break
        self.work += done * free.size // _COMPARED
        i, j = np.divmod(np.flatnonzero(free), rows)
        if left * _FEW < free.size:
            clear = self.clear(room, mask, i, j)
            return i[clear], j[clear]
        return i, j

    def clear(self, room: NDArray[np.int16], mask: Mask, i: Ints, j: Ints) -> Bools:
        """Whether the positions i, j are free for ``mask`` on a sheet with ``room`` d."""
        flat, wide = room.ravel(), room.shape[1]
        found = np.ones(len(i), dtype=np.bool_)
        at = (i + self.rim) * wide + j + self.rim
        done, left = 0, np.arange(len(i))
        while len(left) and done < len(mask.runs):
            column, row, length = mask.runs[done : done + max(_BLOCK // len(left), 1)].T
            clear = (flat[at[left, None] + (column * wide + row)] >= length).all(axis=1)
            self.work += len(left) * len(length) // _COMPARED
            found[left[~clear]] = False
            left, done = left[clear], done + len(length)
        return found

    def _inside(self, shape: BaseGeometry, count: Ints, beyond: int) -> Bools:
        rings = shapely.get_rings(shapely.get_parts(shape))
        half = self.gap / 2
        return _scan(
            [(shapely.get_coordinates(ring) + half) / self.cell + beyond for ring in rings], count
        )


def _scan(rings: list[Floats], count: Ints) -> Bools:
    """The cells whose centres lie inside ``rings`` (in units of cells), by the even-odd rule."""
    flips = np.zeros((int(count[0]) + 1) * int(count[1]), dtype=np.uint8)
    for ring in rings:
        a, b = ring[:-1], ring[1:]
        low, high = np.minimum(a[:, 1], b[:, 1]), np.maximum(a[:, 1], b[:, 1])
        first = np.ceil(low - 0.5).clip(0, count[1]).astype(np.int64)
        last = np.ceil(high - 0.5).clip(0, count[1]).astype(np.int64)
        side = np.repeat(np.arange(len(a)), last - first)
        row = first[side] + places_in_runs(last - first)
        part = (row + 0.5 - a[side, 1]) / (b[side, 1] - a[side, 1])
        x = a[side, 0] + part * (b[side, 0] - a[side, 0])
        at = np.ceil(x - 0.5).clip(0, count[0]).astype(np.int64) * count[1] + row
        np.add.at(flips, at, np.uint8(1))
    # eight cells in a byte: a quarter of the time
    odd = np.packbits((flips & 1).reshape(-1, count[1]), axis=1)
    inside = np.bitwise_xor.accumulate(odd, axis=0)[:-1]
    return np.unpackbits(inside, axis=1, count=int(count[1])).view(np.bool_)
