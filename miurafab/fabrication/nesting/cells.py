"""Masks of outlines and sheets in cells: the cells that a part may touch, and the marked cells.

A sheet grown by half the gap is divided into cells. An outline grown by half the gap marks every
cell that it may touch, so outlines without a common cell keep their gap. The rim of a part is a
band of cells around it; a band of the same width around the sheet counts as marked.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy.fft
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from miurafab.fabrication.nesting.problem import SheetKind, buffered, turned
from miurafab.geometry.arrays import Bools, Floats, Ints, places_in_runs


@dataclass(frozen=True, eq=False)
class Mask:
    """The cells of an outline at one rotation, their transform, and the transform of its rim."""

    cells: Bools
    transform: NDArray[np.complex64]
    rim: NDArray[np.complex64] | None
    """Scaled so that a wholly marked rim counts 1."""


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
        self.whole = [int(scipy.fft.next_fast_len(n + 2 * rim, real=True)) for n in least]
        self.cells = [n - 2 * rim for n in self.whole]
        self.cell = size / self.cells
        self._held = -1
        self._cells: dict[int, Bools] = {}
        self._masks: dict[int, Mask] = {}

    def reach(self, number: int, rotation: int) -> Ints:
        """(2,) the number of cells of the part along both axes."""
        high = self.parts[number].turned(rotation)[0].max(axis=0)
        count: Ints = np.ceil((high + self.gap) / self.cell - 1e-7).astype(np.int64)
        return count.clip(1, np.array(self.cells))

    def marked(self, number: int, rotation: int) -> Bools:
        """The cells that the part may touch."""
        if number != self._held:
            return self._grown(number, rotation, 0)
        if rotation not in self._cells:
            self._cells[rotation] = self._grown(number, rotation, 0)
        return self._cells[rotation]

    def mask(self, number: int, rotation: int) -> Mask:
        """The cells with their transforms. From now on the masks of this part are kept."""
        if number != self._held:
            self._held, self._cells, self._masks = number, {}, {}
        if rotation not in self._masks:
            cells, rim = self.marked(number, rotation), None
            if self.rim:
                around = self._grown(number, rotation, self.rim).astype(np.float32)
                around[self.rim : -self.rim, self.rim : -self.rim][cells] = 0.0
                rim = self._transform(around / around.sum())
            transform = self._transform(cells.astype(np.float32))
            self._masks[rotation] = Mask(cells, transform, rim)
        return self._masks[rotation]

    def _transform(self, cells: NDArray[np.float32]) -> NDArray[np.complex64]:
        return np.conj(scipy.fft.rfft2(cells, self.whole))

    def _grown(self, number: int, rotation: int, more: int) -> Bools:
        """The cells that the part grown by ``more`` cells may touch."""
        points, half = self.parts[number].turned(rotation)[0], self.gap / 2
        # A cell that the grown outline touches has its centre within half a diagonal of it.
        reach = half + np.hypot(*self.cell) / 2 + more * self.cell.min()
        shape = buffered(shapely.Polygon(points), reach)
        return self._inside(shape, self.reach(number, rotation) + 2 * more, more)

    def blank(self, kind: SheetKind) -> NDArray[np.float32]:
        """The marked cells of an empty sheet: the band around it, and cells that touch a defect."""
        taken = np.ones(self.whole, dtype=np.float32)
        inside = taken[self.rim : self.whole[0] - self.rim, self.rim : self.whole[1] - self.rim]
        inside[:] = 0.0
        if kind.defects:
            lost = buffered(kind.flaws, np.hypot(*self.cell) / 2)
            inside += self._inside(lost, np.array(self.cells), 0)
        return taken

    def _inside(self, shape: BaseGeometry, count: Ints, beyond: int) -> Bools:
        rings = shapely.get_rings(shapely.get_parts(shape))
        half = self.gap / 2
        return _scan(
            [(shapely.get_coordinates(ring) + half) / self.cell + beyond for ring in rings], count
        )


def _scan(rings: list[Floats], count: Ints) -> Bools:
    """The cells whose centres lie inside ``rings`` (in units of cells), by the even-odd rule."""
    flips = np.zeros((count[0] + 1, count[1]), dtype=np.int64)
    for ring in rings:
        a, b = ring[:-1], ring[1:]
        low, high = np.minimum(a[:, 1], b[:, 1]), np.maximum(a[:, 1], b[:, 1])
        first = np.ceil(low - 0.5).clip(0, count[1]).astype(np.int64)
        last = np.ceil(high - 0.5).clip(0, count[1]).astype(np.int64)
        side = np.repeat(np.arange(len(a)), last - first)
        row = first[side] + places_in_runs(last - first)
        part = (row + 0.5 - a[side, 1]) / (b[side, 1] - a[side, 1])
        x = a[side, 0] + part * (b[side, 0] - a[side, 0])
        np.add.at(flips, (np.ceil(x - 0.5).clip(0, count[0]).astype(np.int64), row), 1)
    return np.asarray(np.cumsum(flips, axis=0)[:-1] % 2 == 1)
