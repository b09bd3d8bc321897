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

from miurafab.errors import LayoutError
from miurafab.fabrication.nesting.cells import Part, Raster
from miurafab.fabrication.nesting.filling import FilledSheet, Rack, Rule
from miurafab.fabrication.nesting.problem import Problem, Slot, cost, layout_faults, price
from miurafab.fabrication.wording import count

WORK = 4_000_000_000
"""The limit of the search in cells transformed: about 40 s on one core of 2020 (measured:
100 million cells a second)."""

_CELLS = 384
"""Cells along the longer side of a sheet, about, for the corner rules; finer cells pack closer and
take longer."""

_FINE = 600
"""The same for the contact rule."""

_RIM = 12
"""The width of the rim around a part in cells (tried: 1 to 16)."""


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


def nest(problem: Problem, work: int = WORK, *, known: Nesting | None = None) -> Nesting:
    """A slot for each outline, proven by :func:`~miurafab.fabrication.nesting.layout_faults`; no
    worse than the ``known`` nesting of :func:`first_nesting`.

    Raises :class:`~miurafab.errors.LayoutError` naming the outline if an outline fits no sheet at
    any rotation, or if the stock does not suffice.
    """
    _check_sizes(problem)
    slots, finished = _Search(problem, work).run(() if known is None else known.slots)
    return _proven(problem, slots, finished)


def nest_within(problem: Problem, most: float, work: int = WORK) -> Nesting | None:
    """What :func:`nest` finds if its price is at most ``most``, else None. An order is given up
    at the first sheet too many.
    """
    _check_sizes(problem)
    if problem.least_price > most:
        return None
    slots, finished = _Search(problem, work).run(most=most)
    return _proven(problem, slots, finished) if slots else None


def first_nesting(problem: Problem, most: float = math.inf) -> Nesting | None:
    """The nesting of the first pass alone, not proven yet; None if its price is over ``most``.

    Raises :class:`~miurafab.errors.LayoutError` as :func:`nest`.
    """
    _check_sizes(problem)
    if problem.least_price > most:
        return None
    slots = _Search(problem, WORK).first_pass(most)
    return None if slots is None else Nesting(tuple(slots), problem.bound, True)


def _proven(problem: Problem, slots: Sequence[Slot], finished: bool) -> Nesting:
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

    def run(
        self, known: Sequence[Slot] = (), most: float = math.inf
    ) -> tuple[Sequence[Slot], bool]:
        """The best layout whose price is at most ``most``, empty if none is found, and whether the
        search ended within its work limit. ``known`` is the layout of the first pass.
        """
        best = known
        least = self.taken(known) if known else (math.inf, math.inf, math.inf)
        for number, (rule, order, endless) in enumerate(self.passes()):
            if number or not known:
                must = not best and math.isinf(most)
                slots = self.first_fit(order, rule, endless, must, most)
                if slots is None:
                    if self.late:
                        return best, False
                    continue
                if self.taken(slots) < least:
                    best, least = slots, self.taken(slots)
            if self.unbeatable(best):
                break
            if self.late:
                return best, False
            most = min(most, price(best, self.stock))
        return best, True

    def first_pass(self, most: float) -> list[Slot] | None:
        """The layout of the first pass; None if its price is over ``most``."""
        rule, order, endless = next(self.passes())
        return self.first_fit(order, rule, endless, True, most)

    def taken(self, slots: Sequence[Slot]) -> tuple[float, float, float]:
        """What a layout takes, compared in order: its cost, then the area on its last sheet."""
        last = max(slot.sheet for slot in slots)
        share = sum(
            area for area, slot in zip(self.areas, slots, strict=True) if slot.sheet == last
        )
        return (*cost(slots, self.stock), float(share))

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
        self,
        order: list[int],
        rule: Rule,
        endless: list[int],
        first: bool,
        most: float = math.inf,
    ) -> list[Slot] | None:
        """The slots of one pass; None at the work limit, unless this is the ``first`` pass, and
        None as soon as the price is over ``most``.
        """
        given = [k for k in self.stock.in_turn if self.stock.kinds[k].quantity is not None]
        racks = [
            Rack(self.stock, self.rasters(rule is None), kinds)
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
            if sum(rack.price for rack in racks) > most * (1 + 1e-9):
                return None
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
            FilledSheet(k, self.stock, raster).take(number, self.alike[number], (1.0, 1.0))
            for k, raster in enumerate(self.rasters(False))
        ):
            there = count(sum(kind.quantity or 0 for kind in kinds), "sheet", "sheets")
            return (
                f"The stock of {there} is used up and patch {name} has no room; add a "
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
