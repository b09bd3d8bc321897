"""First-fit on a raster: the engine that is always there, and gives the same layout every time.

A sheet grown by half the gap is divided into cells; an outline grown likewise marks every cell
that it may touch, so cells that are not shared mean outlines that keep their gap. The number of
cells that a part would share with what lies on a sheet, for all positions at once, is a
correlation of two masks and one product of Fourier transforms; positions where it is 0 are free.
Defects take their cells from the beginning.

Parts come by size, on the first sheet with a free position, at the one that a rule prefers.
Several orders and rules are tried, and the layout that takes the least stock wins; the first that
no layout could beat ends the search. A sheet without room for the area of a part is not searched,
and the first part on an empty sheet goes to its corner; so parts that fill a sheet each cost next
to nothing. Masks and transforms are made when they are asked for.

Nothing is random. The clock is read for the time limit alone: if that never strikes, the same
input gives the same layout. When it strikes in the first pass, what is left goes on the last
sheets or on new ones, without a look at the earlier ones.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
import scipy.fft
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from miurafab.errors import LayoutError
from miurafab.fabrication.nesting.problem import (
    Problem,
    Report,
    SheetKind,
    Slot,
    Stock,
    buffered,
    cost,
    turned,
)

_CELLS = 384
"""Cells along the longer side of a sheet, about; finer packs closer and takes longer."""

_LAST = 2
"""How many sheets are looked at for a part once the time is over."""

Clock = Callable[[], float]


@dataclass(frozen=True, eq=False)
class _Mask:
    """An outline at one rotation: its cells and their transform."""

    cells: NDArray[np.bool_]
    transform: NDArray[np.complex64]


@dataclass(frozen=True, eq=False)
class _Part:
    """An outline: its area grown by half the gap, and at each rotation its corners, moved so that
    their box begins at the origin, and by how much.
    """

    outline: NDArray[np.float64]
    area: float
    turns: dict[int, tuple[NDArray[np.float64], NDArray[np.float64]]] = field(default_factory=dict)

    def turned(self, rotation: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if rotation not in self.turns:
            points = turned(self.outline, rotation)
            low = points.min(axis=0)
            self.turns[rotation] = (points - low, -low)
        return self.turns[rotation]


class _Raster:
    """The cells of one size of sheet, grown by half the gap on all sides, and all masks on it."""

    def __init__(self, kind: SheetKind, gap: float, parts: Sequence[_Part]) -> None:
        self.gap, self.parts = gap, parts
        size = np.array([kind.width + gap, kind.height + gap])
        self.cells = [
            int(scipy.fft.next_fast_len(max(math.ceil(_CELLS * side / size.max()), 16), real=True))
            for side in size
        ]
        self.cell = size / self.cells
        self._masks: dict[tuple[int, int], _Mask] = {}

    def reach(self, number: int, rotation: int) -> NDArray[np.int64]:
        """(2,) how many cells the part takes along both axes."""
        high = self.parts[number].turned(rotation)[0].max(axis=0)
        count: NDArray[np.int64] = np.ceil((high + self.gap) / self.cell - 1e-7).astype(np.int64)
        return count.clip(1, np.array(self.cells))

    def mask(self, number: int, rotation: int) -> _Mask:
        """The cells that the part may touch."""
        if (number, rotation) not in self._masks:
            points, half = self.parts[number].turned(rotation)[0], self.gap / 2
            # A cell that the grown outline touches has its centre within half a diagonal of it.
            reach = half + np.hypot(*self.cell) / 2
            shape = buffered(shapely.Polygon(points), reach)
            cells = self._marked(shape, self.reach(number, rotation))
            transform = np.conj(scipy.fft.rfft2(cells.astype(np.float32), self.cells))
            self._masks[number, rotation] = _Mask(cells, transform)
        return self._masks[number, rotation]

    def flawed(self, kind: SheetKind) -> NDArray[np.bool_]:
        """The cells that touch a defect."""
        reach = np.hypot(*self.cell) / 2
        lost = buffered(kind.flaws, reach)
        return self._marked(lost, np.array(self.cells))

    def _marked(self, shape: BaseGeometry, count: NDArray[np.int64]) -> NDArray[np.bool_]:
        rings = shapely.get_rings(shapely.get_parts(shape))
        half = self.gap / 2
        return _scan([(shapely.get_coordinates(ring) + half) / self.cell for ring in rings], count)


def _scan(rings: list[NDArray[np.float64]], count: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which cells' centres lie inside ``rings`` given in units of cells, by even-odd crossings."""
    flips = np.zeros((count[0] + 1, count[1]), dtype=np.int64)
    for ring in rings:
        a, b = ring[:-1], ring[1:]
        low, high = np.minimum(a[:, 1], b[:, 1]), np.maximum(a[:, 1], b[:, 1])
        first = np.ceil(low - 0.5).clip(0, count[1]).astype(np.int64)
        last = np.ceil(high - 0.5).clip(0, count[1]).astype(np.int64)
        side = np.repeat(np.arange(len(a)), last - first)
        row = np.arange(len(side)) - np.repeat(np.cumsum(last - first) - last, last - first)
        part = (row + 0.5 - a[side, 1]) / (b[side, 1] - a[side, 1])
        x = a[side, 0] + part * (b[side, 0] - a[side, 0])
        np.add.at(flips, (np.ceil(x - 0.5).clip(0, count[0]).astype(np.int64), row), 1)
    inside: NDArray[np.bool_] = np.cumsum(flips, axis=0)[:-1] % 2 == 1
    return inside


class _Sheet:
    """What lies on one sheet. Its cells are marked when a part is first looked for among others;
    until then ``free``, an area that no less is free, tells whether that is worth while.
    """

    def __init__(self, kind: int, stock: Stock, raster: _Raster) -> None:
        self.kind, self.raster = kind, raster
        self.allowed, gap = stock.kinds[kind], stock.gap
        whole = (self.allowed.width + gap) * (self.allowed.height + gap)
        self.free = whole - self.allowed.width * self.allowed.height + self.allowed.area
        self.placed: list[tuple[int, Slot]] = []
        self._refused: set[int] = set()
        self._waiting: list[tuple[int, int, int, int]] = []
        self._taken: NDArray[np.float32] | None = None
        self._transform: NDArray[np.complex64] | None = None

    def take(self, number: int, part: int, weights: tuple[float, float]) -> bool:
        """Lay outline ``number``, which is as ``part``, at the free position whose far corner is
        least by ``weights``, if there is a position.
        """
        shape = self.raster.parts[part]
        if self.free < shape.area * (1 - 1e-6) or part in self._refused:
            return False
        rotations = [r for r in self.allowed.rotations if self.allowed.fits(shape.outline, r)]
        empty = not self.placed and not self.allowed.defects
        found = [
            (self._corner if empty else self._best)(part, rotation, weights)
            for rotation in rotations
        ]
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
    ) -> tuple[float, int, int]:
        return float(self.raster.reach(part, rotation) * self.raster.cell @ weights), 0, 0

    def _best(
        self, part: int, rotation: int, weights: tuple[float, float]
    ) -> tuple[float, int, int] | None:
        cell, cells = self.raster.cell, self.raster.cells
        mask = self.raster.mask(part, rotation)
        shared = scipy.fft.irfft2(self._marked() * mask.transform, cells)
        wide, high = mask.cells.shape
        columns, rows = cells[0] - wide + 1, cells[1] - high + 1
        free = np.flatnonzero(shared[:columns, :rows] < 0.5)
        if not len(free):
            return None
        i, j = np.divmod(free, rows)
        far = (i + wide) * (weights[0] * cell[0]) + (j + high) * (weights[1] * cell[1])
        at = int(np.argmin(far))
        return float(far[at]), int(i[at]), int(j[at])

    def _marked(self) -> NDArray[np.complex64]:
        """The transform of the cells that are taken."""
        if self._taken is None:
            self._taken = np.zeros(self.raster.cells, dtype=np.float32)
            if self.allowed.defects:
                self._taken += self.raster.flawed(self.allowed)
        if self._transform is None or self._waiting:
            for part, rotation, i, j in self._waiting:
                cells = self.raster.mask(part, rotation).cells
                self._taken[i : i + cells.shape[0], j : j + cells.shape[1]] += cells
            self._waiting.clear()
            self._transform = scipy.fft.rfft2(self._taken)
        return self._transform


class _Rack:
    """Sheets of some kinds: those ``begun``, of them those that are still looked at, and of each
    kind one that is blank, as long as there are any.
    """

    def __init__(self, stock: Stock, rasters: list[_Raster], kinds: list[int]) -> None:
        self.stock, self.rasters, self.kinds = stock, rasters, kinds
        self.begun: list[_Sheet] = []
        self._open: list[_Sheet] = []
        self._blank: dict[int, _Sheet] = {}
        for kind in kinds:
            self._supply(kind)

    def take(
        self, number: int, part: int, weights: tuple[float, float], rest: float, late: bool
    ) -> bool:
        """Lay outline ``number`` on the first sheet with room for it, if there is one. No outline
        after it is smaller than ``rest`` mm²; if it is ``late`` only the last sheets are tried.
        """
        near = self._open[-_LAST:] if late else self._open
        blank = [self._blank[kind] for kind in self.kinds if kind in self._blank]
        for sheet in (*near, *blank):
            if sheet.take(number, part, weights):
                break
        else:
            return False
        if len(sheet.placed) == 1:
            self._begin(sheet)
        if sheet.free < rest * (1 - 1e-6):
            self._open.remove(sheet)
        return True

    def _begin(self, sheet: _Sheet) -> None:
        self.begun.append(sheet)
        self._open.append(sheet)
        del self._blank[sheet.kind]
        self._supply(sheet.kind)

    def _supply(self, kind: int) -> None:
        most = self.stock.kinds[kind].quantity
        if most is None or len(self.begun) < most:
            self._blank[kind] = _Sheet(kind, self.stock, self.rasters[kind])


class _Search:
    """One problem, with what all passes share."""

    def __init__(self, problem: Problem, clock: Clock) -> None:
        self.problem, self.clock = problem, clock
        self.end = clock() + problem.seconds
        self.stock = problem.stock
        self.areas = problem.areas
        first: dict[bytes, int] = {}
        self.alike = [first.setdefault(o.tobytes(), len(first)) for o in problem.outlines]
        parts = {
            part: _Part(outline, float(area))
            for part, outline, area in zip(self.alike, problem.outlines, self.areas, strict=True)
        }
        kinds, gap = self.stock.kinds, self.stock.gap
        by_size = {
            size: _Raster(kind, gap, list(parts.values()))
            for size, kind in (((kind.width, kind.height), kind) for kind in kinds)
        }
        self.rasters = [by_size[kind.width, kind.height] for kind in kinds]

    def orders(self) -> list[list[int]]:
        """The outlines by area, and by their longer side, the largest first."""
        sides = np.array([np.ptp(outline, axis=0).max() for outline in self.problem.outlines])
        return [np.argsort(-key, kind="stable").tolist() for key in (self.areas, sides)]

    def endless(self) -> list[list[int]]:
        """Orders in which to begin sheets of which there are as many as it takes."""
        kinds = self.stock.kinds
        given = [k for k, kind in enumerate(kinds) if kind.quantity is None]
        small_first = sorted(given, key=lambda k: kinds[k].width * kinds[k].height)
        return [given] if small_first == given else [given, small_first]

    def first_fit(
        self, order: list[int], weights: tuple[float, float], endless: list[int], first: bool
    ) -> list[Slot] | None:
        """The slots of one pass; None if the time was over, unless this is the ``first``."""
        given = [k for k in self.stock.in_turn if self.stock.kinds[k].quantity is not None]
        racks = [
            _Rack(self.stock, self.rasters, kinds) for kinds in (*([k] for k in given), endless)
        ]
        least = np.append(np.minimum.accumulate(self.areas[order][::-1])[::-1], np.inf)
        for position, number in enumerate(order):
            late = self.clock() >= self.end
            if late and not first:
                return None
            part, rest = self.alike[number], float(least[position + 1])
            if not any(rack.take(number, part, weights, rest, late) for rack in racks):
                raise LayoutError(self._no_room(number))
        found = [Slot(0, 0, 0.0, 0.0, 0)] * len(order)
        for index, sheet in enumerate(sheet for rack in racks for sheet in rack.begun):
            for number, slot in sheet.placed:
                found[number] = replace(slot, sheet=index)
        return found

    def _no_room(self, number: int) -> str:
        """Why the outline has no place."""
        name = self.problem.names[number]
        kinds = self.stock.kinds
        if any(
            _Sheet(k, self.stock, raster).take(number, self.alike[number], (1.0, 1.0))
            for k, raster in enumerate(self.rasters)
        ):
            count = sum(kind.quantity or 0 for kind in kinds)
            return (
                f"The stock of {count} sheets is used up and patch {name} has no room; add a "
                "sheet, or give one of them no quantity, for as many as it takes."
            )
        return (
            f"Patch {name} fits no sheet of the stock beside the defects; add a sheet, or make the "
            "patches smaller with --max-patch."
        )

    def unbeatable(self, slots: Sequence[Slot]) -> bool:
        """Whether no layout could take less stock. If sheets of several kinds come in any number,
        that is not told.
        """
        used = {(slot.sheet, slot.kind) for slot in slots}
        kinds, gap = self.stock.kinds, self.stock.gap
        if len(kinds) == 1:
            return len(used) <= self.problem.bound
        endless = [k for k, kind in enumerate(kinds) if kind.quantity is None]
        if len(endless) != 1:
            return False
        room = [(kind.width + gap) * (kind.height + gap) for kind in kinds]
        given = sum(r * (kind.quantity or 0) for r, kind in zip(room, kinds, strict=True))
        need = math.ceil((self.areas.sum() - given) / room[endless[0]] - 1e-9)
        return bool(0 < sum(kind == endless[0] for _, kind in used) <= need)


def raster_engine(problem: Problem, report: Report, clock: Clock = time.monotonic) -> bool:
    """First-fit by size on a raster; see the module.

    Raises :class:`~miurafab.errors.LayoutError` naming the outline if the stock has no room for
    one.
    """
    search = _Search(problem, clock)
    best = (math.inf, math.inf, math.inf)
    passes = product([(0.01, 1.0), (1.0, 0.01), (1.0, 1.0)], search.orders(), search.endless())
    for number, (weights, order, endless) in enumerate(passes):
        slots = search.first_fit(order, weights, endless, number == 0)
        if slots is None:
            return False
        last = max(slot.sheet for slot in slots)
        share = sum(
            area for area, slot in zip(search.areas, slots, strict=True) if slot.sheet == last
        )
        taken = (*cost(slots, problem.stock), float(share))
        if taken < best:
            best = taken
            report(slots)
        if search.unbeatable(slots):
            return True
        if clock() >= search.end:
            return False
    return True
