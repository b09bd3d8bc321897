"""First-fit on a raster: the engine that is always there, and gives the same layout every time.

A sheet grown by half the gap is divided into cells; an outline grown likewise marks every cell
that it may touch, so cells that are not shared mean outlines that keep their gap. The number of
cells that a part would share with what lies on a sheet, for all positions at once, is a
correlation of two masks and one product of Fourier transforms; positions where it is 0 are free.
Defects take their cells from the beginning.

Parts come by size, on the first sheet with a free position, at the one that a rule prefers: the
one nearest to a side or a corner, or the one with most company, that is, with the largest share of
the rim around the part taken already or off the sheet. That share is another correlation; it packs
closer, the more so on finer cells, and takes longer. Several orders and rules are tried, and the
layout that takes the least stock wins; the first that no layout could beat ends the search. A sheet
without room for the area of a part is not searched, and by the first rules the first part on an
empty sheet goes to its corner; so parts that fill a sheet each cost next to nothing. Masks and
transforms are made when they are asked for, and kept for one part at a time.

Nothing is random. The clock is read for the time limit alone: if that never strikes, the same
input gives the same layout. When it strikes in the first pass, what is left goes on the last
sheets or on new ones, without a look at the earlier ones.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from miurafab.errors import LayoutError
from miurafab.fabrication.nesting.cells import Part, Raster
from miurafab.fabrication.nesting.problem import (
    Problem,
    Report,
    Slot,
    Stock,
    cost,
)

_CELLS = 384
"""Cells along the longer side of a sheet, about; finer packs closer and takes longer."""

_FINE = 600
"""The same for the rule of most company."""

_RIM = 12
"""How many cells wide the rim around a part is (tried: 1 to 16)."""

_LAST = 2
"""How many sheets are looked at for a part once the time is over."""

Clock = Callable[[], float]
Rule = tuple[float, float] | None
"""The weights of x and y by which the far corner of a part is least; None for most company."""


class _Sheet:
    """What lies on one sheet. Its cells are marked when a part is first looked for among others;
    until then ``free``, an area that no less is free, tells whether that is worth while.
    """

    def __init__(self, kind: int, stock: Stock, raster: Raster) -> None:
        self.kind, self.raster = kind, raster
        self.allowed, gap = stock.kinds[kind], stock.gap
        whole = (self.allowed.width + gap) * (self.allowed.height + gap)
        self.free = whole - self.allowed.width * self.allowed.height + self.allowed.area
        self.placed: list[tuple[int, Slot]] = []
        self._refused: set[int] = set()
        self._waiting: list[tuple[int, int, int, int]] = []
        self._taken: NDArray[np.float32] | None = None
        self._transform: NDArray[np.complex64] | None = None

    def take(self, number: int, part: int, rule: Rule) -> bool:
        """Lay outline ``number``, which is as ``part``, at the free position that ``rule`` prefers,
        if there is a position.
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
        mask = raster.mask(part, rotation)
        marked = self._marked()
        wide, high = mask.cells.shape
        columns, rows = raster.cells[0] - wide + 1, raster.cells[1] - high + 1
        near = raster.rim
        shared = scipy.fft.irfft2(marked * mask.transform, raster.whole)
        free = np.flatnonzero(shared[near : near + columns, near : near + rows] < 0.5)
        if not len(free):
            return None
        i, j = np.divmod(free, rows)
        if rule is None:
            assert mask.rim is not None
            around = scipy.fft.irfft2(marked * mask.rim, raster.whole)[:columns, :rows]
            # Rounded, so that the noise of the transforms decides nothing.
            order = -np.round(around.ravel()[free], 3)
        else:
            far = (i + wide) * raster.cell[0], (j + high) * raster.cell[1]
            order = far[0] * rule[0] + far[1] * rule[1]
        at = int(np.argmin(order))
        return float(order[at]), int(i[at]), int(j[at])

    def _marked(self) -> NDArray[np.complex64]:
        """The transform of the cells that are taken."""
        if self._taken is None:
            self._taken = self.raster.blank(self.allowed)
        if self._transform is None or self._waiting:
            for part, rotation, i, j in self._waiting:
                cells = self.raster.marked(part, rotation)
                x, y = i + self.raster.rim, j + self.raster.rim
                self._taken[x : x + cells.shape[0], y : y + cells.shape[1]] += cells
            self._waiting.clear()
            self._transform = scipy.fft.rfft2(self._taken)
        return self._transform


class _Rack:
    """Sheets of some kinds: those ``begun``, of them those that are still looked at, and of each
    kind one that is blank, as long as there are any.
    """

    def __init__(self, stock: Stock, rasters: list[Raster], kinds: list[int]) -> None:
        self.stock, self.rasters, self.kinds = stock, rasters, kinds
        self.begun: list[_Sheet] = []
        self._open: list[_Sheet] = []
        self._blank: dict[int, _Sheet] = {}
        for kind in kinds:
            self._supply(kind)

    def take(self, number: int, part: int, rule: Rule, rest: float, late: bool) -> bool:
        """Lay outline ``number`` on the first sheet with room for it, if there is one. No outline
        after it is smaller than ``rest`` mm²; if it is ``late`` only the last sheets are tried.
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
            part: Part(outline, float(area))
            for part, outline, area in zip(self.alike, problem.outlines, self.areas, strict=True)
        }
        self.parts = list(parts.values())
        self._rasters: dict[bool, list[Raster]] = {}

    def rasters(self, fine: bool) -> list[Raster]:
        """The raster of each kind of sheet, kinds of one size having the same."""
        if fine not in self._rasters:
            kinds = self.stock.kinds
            by_size: dict[tuple[float, float], Raster] = {}
            for kind in kinds:
                size = (kind.width, kind.height)
                if size not in by_size:
                    how = (_FINE, _RIM) if fine else (_CELLS, 0)
                    by_size[size] = Raster(kind, self.stock.gap, self.parts, *how)
            self._rasters[fine] = [by_size[kind.width, kind.height] for kind in kinds]
        return self._rasters[fine]

    def orders(self) -> list[list[int]]:
        """The outlines by area, by their longer side, and by both, the largest first."""
        sides = np.array([np.ptp(outline, axis=0).max() for outline in self.problem.outlines])
        keys = (self.areas, sides, self.areas * sides)
        return [np.argsort(-key, kind="stable").tolist() for key in keys]

    def endless(self) -> list[list[int]]:
        """Orders in which to begin sheets of which there are as many as it takes."""
        kinds = self.stock.kinds
        given = [k for k, kind in enumerate(kinds) if kind.quantity is None]
        small_first = sorted(given, key=lambda k: kinds[k].width * kinds[k].height)
        return [given] if small_first == given else [given, small_first]

    def first_fit(
        self, order: list[int], rule: Rule, endless: list[int], first: bool
    ) -> list[Slot] | None:
        """The slots of one pass; None if the time was over, unless this is the ``first``."""
        given = [k for k in self.stock.in_turn if self.stock.kinds[k].quantity is not None]
        racks = [
            _Rack(self.stock, self.rasters(rule is None), kinds)
            for kinds in (*([k] for k in given), endless)
        ]
        least = np.append(np.minimum.accumulate(self.areas[order][::-1])[::-1], np.inf)
        for position, number in enumerate(order):
            late = self.clock() >= self.end
            if late and not first:
                return None
            part, rest = self.alike[number], float(least[position + 1])
            if not any(rack.take(number, part, rule, rest, late) for rack in racks):
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
            for k, raster in enumerate(self.rasters(False))
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

    def passes(self) -> Iterator[tuple[Rule, list[int], list[int]]]:
        """Rule, order and endless sheets of each pass: the quickest, the closest, the others."""
        *usual, both = self.orders()
        quick = list(product([(0.01, 1.0), (1.0, 0.01), (1.0, 1.0)], usual, self.endless()))
        yield quick[0]
        for order, endless in product((*usual, both), self.endless()):
            yield None, order, endless
        yield from quick[1:]

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
    for number, (rule, order, endless) in enumerate(search.passes()):
        slots = search.first_fit(order, rule, endless, number == 0)
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
