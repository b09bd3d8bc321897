"""First-fit nesting on a raster.

A sheet grown by half the gap is divided into cells. An outline, also grown by half the gap, marks
every cell that it may touch; outlines without a common cell keep their gap. A position is free if
no cell of the part is marked there (:mod:`~miurafab.fabrication.nesting.cells`). Defects mark their
cells before any part.

Parts are placed by size, each on the first sheet with a free position, at the free position that a
rule prefers. A corner rule prefers the position nearest to a side or a corner. The contact rule
prefers the position where the largest share of the rim around the part is marked already or off the
sheet: for all positions at once this share is a correlation of two masks, computed by Fourier
transforms. It packs closer, the more so on finer cells, and takes longer.
Several orders and rules are tried. The layout that takes the least stock wins, and a layout that
meets the lower bound ends the search. A sheet whose free area is smaller than a part is not
searched, and a corner rule puts the first part of an empty sheet in its corner without a search; so
parts that fill a sheet each cost almost nothing. Masks and transforms are computed when they are
needed and kept for one part at a time.

Nothing is random and nothing reads a clock, so the same input gives the same layout. The work is
counted in cells transformed and is limited by :data:`WORK`. If the limit is reached in the first
pass, the remaining parts go on the last sheets or on new sheets.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from miurafab.errors import LayoutError
from miurafab.fabrication.nesting.cells import Part, Raster
from miurafab.fabrication.nesting.problem import Problem, Slot, Stock, cost, layout_faults
from miurafab.geometry.arrays import Bools, Ints

WORK = 4_000_000_000
"""The limit of the search in cells transformed: about 40 s on one core of 2020 (measured:
100 million cells a second)."""

_CELLS = 384
"""Cells along the longer side of a sheet, about, for the corner rules; finer cells pack closer and
take longer."""

_FINE = 600
"""The same for the contact rule."""

_FIRST = 64
"""Positions that are tried at once, the best first."""

_RIM = 12
"""The width of the rim around a part in cells (tried: 1 to 16)."""

_LAST = 2
"""The number of sheets that are searched for a part once the work limit is reached."""

Rule = tuple[float, float] | None
"""A corner rule: the weights of x and y of the far corner of a part, whose sum is minimised. None
is the contact rule."""


@dataclass(frozen=True)
class Nesting:
    """A slot for each outline, the lower ``bound`` of the number of sheets, and whether the search
    was ``finished`` within its work limit.
    """

    slots: tuple[Slot, ...]
    bound: int
    finished: bool

    @property
    def sheets(self) -> int:
        """The number of sheets used."""
        return 1 + max(slot.sheet for slot in self.slots)


def nest(problem: Problem, work: int = WORK) -> Nesting:
    """A slot for each outline, proven by :func:`~miurafab.fabrication.nesting.layout_faults`.

    Raises :class:`~miurafab.errors.LayoutError` naming the outline if an outline fits no sheet at
    any rotation, or if the stock does not suffice.
    """
    _check_sizes(problem)
    slots, finished = _Search(problem, work).run()
    faults = layout_faults(problem, slots)
    if faults:
        raise LayoutError(f"The nesting cannot be used: {faults[0]}.")
    return Nesting(tuple(slots), problem.bound, finished)


def _check_sizes(problem: Problem) -> None:
    kinds = problem.stock.kinds
    for name, outline in zip(problem.names, problem.outlines, strict=True):
        if not any(kind.fits(outline, turn) for kind in kinds for turn in kind.rotations):
            wide, high = (outline.max(axis=0) - outline.min(axis=0)).tolist()
            largest = max(kinds, key=lambda kind: kind.width * kind.height)
            turns = ", ".join(str(turn) for turn in largest.rotations)
            raise LayoutError(
                f"Patch {name} measures {wide:.1f} mm x {high:.1f} mm and does not fit the usable "
                f"{largest.width:.1f} mm x {largest.height:.1f} mm of the largest sheet, turned by "
                f"{turns} degrees."
            )


class _Sheet:
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


class _Rack:
    """Sheets of some kinds: the sheets ``begun``, the begun sheets that still have room, and one
    blank sheet of each kind while the stock lasts.
    """

    def __init__(self, stock: Stock, rasters: list[Raster], kinds: list[int]) -> None:
        self.stock, self.rasters, self.kinds = stock, rasters, kinds
        self.begun: list[_Sheet] = []
        self._open: list[_Sheet] = []
        self._blank: dict[int, _Sheet] = {}
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
    """The search for one problem, with the rasters that all passes share."""

    def __init__(self, problem: Problem, work: int) -> None:
        self.problem, self.limit = problem, work
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

    def run(self) -> tuple[list[Slot], bool]:
        """The best layout found, and whether the search ended within its work limit."""
        best: list[Slot] = []
        least = (math.inf, math.inf, math.inf)
        for rule, order, endless in self.passes():
            slots = self.first_fit(order, rule, endless, not best)
            if slots is None:
                return best, False
            last = max(slot.sheet for slot in slots)
            share = sum(
                area for area, slot in zip(self.areas, slots, strict=True) if slot.sheet == last
            )
            taken = (*cost(slots, self.stock), float(share))
            if taken < least:
                best, least = slots, taken
            if self.unbeatable(slots):
                break
            if self.late:
                return best, False
        return best, True

    @property
    def late(self) -> bool:
        """Whether the work limit is reached."""
        rasters = {id(raster): raster for rasters in self._rasters.values() for raster in rasters}
        return sum(raster.work for raster in rasters.values()) >= self.limit

    def rasters(self, fine: bool) -> list[Raster]:
        """The raster of each kind of sheet; kinds of the same size share a raster."""
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
        """The outlines by area, by longer side, and by their product, the largest first."""
        sides = np.array([np.ptp(outline, axis=0).max() for outline in self.problem.outlines])
        keys = (self.areas, sides, self.areas * sides)
        return [np.argsort(-key, kind="stable").tolist() for key in keys]

    def endless(self) -> list[list[int]]:
        """Orders in which to begin sheets of the unlimited kinds."""
        kinds = self.stock.kinds
        given = [k for k, kind in enumerate(kinds) if kind.quantity is None]
        small_first = sorted(given, key=lambda k: kinds[k].width * kinds[k].height)
        return [given] if small_first == given else [given, small_first]

    def first_fit(
        self, order: list[int], rule: Rule, endless: list[int], first: bool
    ) -> list[Slot] | None:
        """The slots of one pass; None at the work limit, unless this is the ``first`` pass."""
        given = [k for k in self.stock.in_turn if self.stock.kinds[k].quantity is not None]
        racks = [
            _Rack(self.stock, self.rasters(rule is None), kinds)
            for kinds in (*([k] for k in given), endless)
        ]
        least = np.append(np.minimum.accumulate(self.areas[order][::-1])[::-1], np.inf)
        for position, number in enumerate(order):
            late = self.late
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
        """The message for an outline without a place."""
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
            "patches smaller with `max_patch`."
        )

    def passes(self) -> Iterator[tuple[Rule, list[int], list[int]]]:
        """Rule, order and unlimited kinds of each pass: the quickest, the closest, the others."""
        *usual, both = self.orders()
        quick = list(product([(0.01, 1.0), (1.0, 0.01), (1.0, 1.0)], usual, self.endless()))
        yield quick[0]
        for order, endless in product((*usual, both), self.endless()):
            yield None, order, endless
        yield from quick[1:]

    def unbeatable(self, slots: Sequence[Slot]) -> bool:
        """Whether no layout can take less stock; False, too, if several kinds are unlimited."""
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
