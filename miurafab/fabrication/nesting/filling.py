"""Sheets that take parts one by one, each at the free position that a rule prefers.

Free positions are those of :mod:`~miurafab.fabrication.nesting.cells`. A sheet whose free area is
smaller than a part is not searched, and a corner rule puts the first part of an empty sheet in its
corner without a search.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from miurafab.fabrication.nesting.cells import Raster
from miurafab.fabrication.nesting.problem import Slot, Stock
from miurafab.geometry.arrays import Bools, Ints

_FIRST = 64
"""Positions that are tried at once, the best first."""

_LAST = 2
"""The number of sheets that are searched for a part once the work limit is reached."""

Rule = tuple[float, float] | None
"""A corner rule: the weights of x and y of the far corner of a part, whose sum is minimised. None
is the contact rule."""


class FilledSheet:
    """The parts on one sheet. Cells are marked only when the sheet is first searched; until then
    ``free``, an upper bound of the free area in mm², decides whether to search.
    """

    def __init__(self, kind: int, stock: Stock, raster: Raster) -> None:
        self.kind, self.raster = kind, raster
        self.allowed, gap = stock.kinds[kind], stock.gap
        whole = (self.allowed.width + gap) * (self.allowed.height + gap)
        self.free = whole - self.allowed.width * self.allowed.height + self.allowed.area
        self.placed: list[tuple[int, Slot]] = []
        self._refused: set[int] = set()
        self._waiting: list[tuple[int, int, int, int]] = []
        self._marked: Bools | None = None
        self._room: NDArray[np.int16]
        self._spectrum: NDArray[np.complex64] | None = None

    def take(self, number: int, part: int, rule: Rule) -> bool:
        """Place outline ``number``, of shape ``part``, at the free position that ``rule`` prefers;
        False if no position is free.
        """
        shape = self.raster.parts[part]
        if self.free < shape.area * (1 - 1e-6) or part in self._refused:
            return False
        rotations = [r for r in self.allowed.rotations if self.allowed.fits(shape.outline, r)]
        if rule is None or self.placed or self.allowed.defects:
            found = [self._best(part, rotation, rule) for rotation in rotations]
        else:
            found = [self._corner(part, rotation, rule) for rotation in rotations]
        open_places = [(*at, r) for at, r in zip(found, rotations, strict=True) if at is not None]
        if not open_places:
            self._refused.add(part)
            return False
        _, i, j, rotation = min(open_places, key=lambda place: place[0])
        self._waiting.append((part, rotation, i, j))
        self.free -= shape.area
        shift = np.array([i, j]) * self.raster.cell + shape.turned(rotation)[1]
        slot = Slot(0, self.kind, float(shift[0]), float(shift[1]), rotation)
        self.placed.append((number, slot))
        return True

    def _corner(
        self, part: int, rotation: int, weights: tuple[float, float]
    ) -> tuple[float, int, int] | None:
        return float(self.raster.reach(part, rotation) * self.raster.cell @ weights), 0, 0

    def _best(self, part: int, rotation: int, rule: Rule) -> tuple[float, int, int] | None:
        raster = self.raster
        raster.hold(part)
        mask, room = raster.mask(part, rotation), self._free()
        i, j = raster.open_positions(room, mask)
        if not len(i):
            return None
        if rule is None:
            touched = raster.correlated(self._transform(), raster.rim_of(part, rotation))
            # Rounding keeps the noise of the transforms out of the decision.
            order = -np.round(touched[i, j], 3)
        else:
            wide, high = mask.cells.shape
            across, along = raster.cell * rule
            order = (i + wide) * across + (j + high) * along
        for at in _best_first(order):
            clear = np.flatnonzero(raster.clear(room, mask, i[at], j[at]))
            if len(clear):
                best = at[clear[0]]
                return float(order[best]), int(i[best]), int(j[best])
        return None

    def _free(self) -> NDArray[np.int16]:
        """(columns, rows) the number of free cells from each cell upward."""
        if self._marked is None:
            self._marked = self.raster.blank(self.allowed)
            self._room = _room(self._marked)
        for part, rotation, i, j in self._waiting:
            cells = self.raster.mask(part, rotation).cells
            x, y = i + self.raster.rim, j + self.raster.rim
            new = slice(x, x + cells.shape[0])
            self._marked[new, y : y + cells.shape[1]] |= cells
            self._room[new] = _room(self._marked[new])
            self._spectrum = None
        self._waiting.clear()
        return self._room

    def _transform(self) -> NDArray[np.complex64]:
        """The transform of the marked cells."""
        if self._spectrum is None:
            assert self._marked is not None
            self._spectrum = self.raster.transformed(self._marked.astype(np.float32))
        return self._spectrum


def _best_first(order: NDArray[np.floating]) -> Iterator[Ints]:
    """The places of ``order`` from the least to the greatest, in parts; equals as they stand."""
    done = 0
    while done < len(order):
        last = min(2 * done + _FIRST, len(order)) - 1
        limit = np.partition(order, last)[last]
        near = np.flatnonzero(order <= limit)
        near = near[np.argsort(order[near], kind="stable")][done:]
        yield near
        done += len(near)


def _room(marked: Bools) -> NDArray[np.int16]:
    """The number of cells from each cell upward that are not ``marked``."""
    rows = marked.shape[1]
    row = np.arange(rows, dtype=np.int16)
    above = np.where(marked, row, np.int16(rows))[:, ::-1]
    return np.asarray(np.minimum.accumulate(above, axis=1)[:, ::-1] - row)


class Rack:
    """Sheets of some kinds: the sheets ``begun`` with their ``price``, the begun sheets that still
    have room, and one blank sheet of each kind while the stock lasts.
    """

    def __init__(self, stock: Stock, rasters: list[Raster], kinds: list[int]) -> None:
        self.stock, self.rasters, self.kinds = stock, rasters, kinds
        self.begun: list[FilledSheet] = []
        self.price = 0.0
        self._open: list[FilledSheet] = []
        self._blank: dict[int, FilledSheet] = {}
        for kind in kinds:
            self._supply(kind)

    def take(self, number: int, part: int, rule: Rule, rest: float, late: bool) -> bool:
        """Place outline ``number`` on the first sheet with room for it; False if there is none. No
        later outline is smaller than ``rest`` mm². If ``late``, only the last sheets are tried.
        """
        near = self._open[-_LAST:] if late else self._open
        blank = [self._blank[kind] for kind in self.kinds if kind in self._blank]
        for sheet in (*near, *blank):
            if sheet.take(number, part, rule):
                break
        else:
            return False
        if len(sheet.placed) == 1:
            self._begin(sheet)
        if sheet.free < rest * (1 - 1e-6):
            self._open.remove(sheet)
        return True

    def _begin(self, sheet: FilledSheet) -> None:
        self.begun.append(sheet)
        self.price += self.stock.prices[sheet.kind]
        self._open.append(sheet)
        del self._blank[sheet.kind]
        self._supply(sheet.kind)

    def _supply(self, kind: int) -> None:
        most = self.stock.kinds[kind].quantity
        if most is None or len(self.begun) < most:
            self._blank[kind] = FilledSheet(kind, self.stock, self.rasters[kind])
