"""The nesting problem, its solution, and the proof of a solution.

Outlines go on sheets of given kinds, at the rotations that the kind allows, a gap apart. A solution
is one :class:`Slot` per outline. :func:`layout_faults` checks a solution with exact geometry,
whatever the search did.

Two outlines keep the gap g if the outlines grown by g/2 share no area. An outline lies on the bed
if the outline grown by g/2 lies on the bed grown by g/2. So the search works with grown outlines,
grown beds and no gap. It keeps g/2 from defects, which is more than required: an outline may touch
a defect.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from miurafab.geometry.arrays import Floats
from miurafab.geometry.shapes import common_area

TOLERANCE = 1e-6
"""Rounding error of a placement that is accepted, in mm."""

Ring = tuple[tuple[float, float], ...]
"""The corners of a closed curve in mm; the first corner is not repeated."""


@dataclass(frozen=True)
class SheetKind:
    """A kind of sheet: its usable ``width`` and ``height`` in mm, the ``rotations`` in whole
    degrees that outlines may have on it, its ``quantity`` (None: unlimited), and its ``defects``,
    on which nothing may lie, with coordinates from the corner of the usable part.
    """

    width: float
    height: float
    rotations: tuple[int, ...]
    quantity: int | None = None
    defects: tuple[Ring, ...] = ()

    def fits(self, outline: Floats, rotation: int) -> bool:
        """Whether the bounding box of ``outline`` (n, 2) at ``rotation`` fits the sheet."""
        wide, high = np.ptp(turned(outline, rotation), axis=0)
        return bool(wide <= self.width + TOLERANCE and high <= self.height + TOLERANCE)

    @cached_property
    def flaws(self) -> BaseGeometry:
        """The union of the defects."""
        shapes = [shapely.Polygon(ring) for ring in self.defects]
        # Snapping to a grid keeps GEOS 3.14 from returning shapes that only touch.
        return shapely.union_all(shapes, grid_size=1e-9)

    @property
    def area(self) -> float:
        """The area without the defects, in mm²."""
        bed = shapely.box(0.0, 0.0, self.width, self.height)
        lost = shapely.intersection(bed, self.flaws, grid_size=1e-9).area
        return float(self.width * self.height - lost)


@dataclass(frozen=True)
class Stock:
    """The kinds of sheet, in the order in which to use them, and the ``gap`` in mm between
    outlines. Kinds with unlimited quantity are used last.
    """

    kinds: tuple[SheetKind, ...]
    gap: float

    @cached_property
    def prices(self) -> tuple[float, ...]:
        """What a sheet of each kind costs, in sheets of the largest kind: its share of that area.
        Kinds of limited quantity are free where there are others, since they are to be used up.
        """
        endless = any(kind.quantity is None for kind in self.kinds)
        largest = max(kind.area for kind in self.kinds)
        return tuple(
            0.0 if endless and kind.quantity is not None else kind.area / largest
            for kind in self.kinds
        )

    def least_price(self, area: float) -> float:
        """A lower bound of the price of sheets for outlines of ``area`` mm², grown by half the
        gap.
        """
        room = [(kind.width + self.gap) * (kind.height + self.gap) for kind in self.kinds]
        if len(room) == 1:
            return float(math.ceil(area * (1 - 1e-9) / room[0]))
        dear = [k for k, price in enumerate(self.prices) if price > 0]
        free = sum(
            room[k] * (kind.quantity or 0) for k, kind in enumerate(self.kinds) if k not in dear
        )
        return max(area - free, 0.0) * min(self.prices[k] / room[k] for k in dear)

    @property
    def in_turn(self) -> list[int]:
        """The indices of the kinds, kinds of limited quantity first."""
        return sorted(range(len(self.kinds)), key=lambda k: self.kinds[k].quantity is None)


@dataclass(frozen=True, eq=False)
class Problem:
    """The ``outlines`` to nest, closed curves (n, 2) in mm, their ``names``, and the ``stock``."""

    outlines: tuple[Floats, ...]
    names: tuple[str, ...]
    stock: Stock

    @cached_property
    def areas(self) -> Floats:
        """(N,) the areas of the outlines grown by half the gap, in mm², at most a little less."""
        shapes = [shapely.Polygon(outline) for outline in self.outlines]
        return shapely.area(shapely.buffer(shapes, self.stock.gap / 2))

    @cached_property
    def bound(self) -> int:
        """A lower bound of the number of sheets.

        The grown sheets, the largest used first, have at least the area of the grown outlines. And
        two outlines that each fill more than half of the largest sheet cannot share a sheet.
        """
        kinds, gap = self.stock.kinds, self.stock.gap
        room = [(kind.width + gap) * (kind.height + gap) for kind in kinds]
        left, sheets = float(self.areas.sum()) * (1 - 1e-9), 0
        for k in sorted(range(len(room)), key=lambda k: -room[k]):
            most = kinds[k].quantity
            need = math.ceil(left / room[k])
            sheets += need if most is None else min(need, most)
            left -= room[k] * (need if most is None else most)
            if left <= 0:
                break
        return max(sheets, int((self.areas > max(room) / 2 * (1 + 1e-9)).sum()), 1)

    @property
    def least_price(self) -> float:
        """A lower bound of the :func:`price` of a layout."""
        least = self.stock.least_price(float(self.areas.sum()))
        return max(least, float(self.bound)) if len(self.stock.kinds) == 1 else least


@dataclass(frozen=True)
class Slot:
    """The place of an outline: turned counter-clockwise by ``rotation_deg`` about its origin, then
    moved by (``x_mm``, ``y_mm``) from the corner of the usable part of ``sheet`` (numbered from 0),
    a sheet of ``kind``.
    """

    sheet: int
    kind: int
    x_mm: float
    y_mm: float
    rotation_deg: int


def place(points: Floats, slot: Slot) -> Floats:
    """``points`` (n, 2) of an outline, moved to the usable part of its sheet."""
    shift = np.array([slot.x_mm, slot.y_mm])
    return np.asarray(turned(points, slot.rotation_deg) + shift)


def turned(points: Floats, rotation_deg: float) -> Floats:
    """``points`` (n, 2) turned counter-clockwise about the origin; exact for right angles."""
    quarter, rest = divmod(rotation_deg, 90.0)
    if rest == 0.0:
        c, s = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarter) % 4]
    else:
        c, s = math.cos(math.radians(rotation_deg)), math.sin(math.radians(rotation_deg))
    x, y = points[..., 0], points[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def buffered(shape: BaseGeometry, distance: float) -> BaseGeometry:
    """``shape`` grown by at least ``distance`` mm. The factor 1.015 makes up for the chords of the
    arcs and for the tolerance of GEOS, a hundredth of the distance.
    """
    return shapely.buffer(shape, distance * 1.015, quad_segs=16)


def price(slots: Sequence[Slot], stock: Stock) -> float:
    """The sum of the :attr:`Stock.prices` of the sheets of a layout."""
    return sum(stock.prices[kind] for _, kind in {(slot.sheet, slot.kind) for slot in slots})


def cost(slots: Sequence[Slot], stock: Stock) -> tuple[float, float]:
    """The cost of a layout, compared in order: the area of the sheets of unlimited kinds, then the
    area of all sheets, in mm².
    """
    kinds = [stock.kinds[kind] for _, kind in sorted({(slot.sheet, slot.kind) for slot in slots})]
    sizes = [(kind.width * kind.height, kind.quantity is None) for kind in kinds]
    return sum(size for size, endless in sizes if endless), sum(size for size, _ in sizes)


def layout_faults(problem: Problem, slots: Sequence[Slot]) -> list[str]:
    """The faults of a layout, each as half a sentence; empty if the layout is valid."""
    outlines, names, stock = problem.outlines, problem.names, problem.stock
    if len(slots) != len(outlines):
        return [f"it has {len(slots)} places for {len(outlines)} patches"]
    if any(not 0 <= slot.kind < len(stock.kinds) for slot in slots):
        return ["it uses a sheet that the stock does not hold"]
    for name, slot in zip(names, slots, strict=True):
        if not (math.isfinite(slot.x_mm) and math.isfinite(slot.y_mm)):
            return [f"patch {name} is nowhere"]
    faults = []
    shapes = [
        shapely.Polygon(place(outline, slot)) for outline, slot in zip(outlines, slots, strict=True)
    ]
    for name, shape, slot in zip(names, shapes, slots, strict=True):
        kind = stock.kinds[slot.kind]
        low_x, low_y, high_x, high_y = shape.bounds
        if slot.rotation_deg not in kind.rotations:
            faults.append(f"patch {name} is turned by {slot.rotation_deg} degrees")
        low, wide, high = -TOLERANCE, kind.width + TOLERANCE, kind.height + TOLERANCE
        if low_x < low or low_y < low or high_x > wide or high_y > high:
            faults.append(f"patch {name} lies outside the usable bed")
        if kind.defects and common_area(shape, kind.flaws) > TOLERANCE * shape.length:
            faults.append(f"patch {name} lies on a defect")
    faults += _stock_faults(slots, stock)
    # The sheets are laid side by side, so that only outlines on the same sheet are near.
    step = max(kind.width for kind in stock.kinds) + stock.gap + 1.0
    beside = [
        shapely.Polygon(place(outline, slot) + np.array([slot.sheet * step, 0.0]))
        for outline, slot in zip(outlines, slots, strict=True)
    ]
    tree = shapely.STRtree(beside)
    near = tree.query(beside, predicate="dwithin", distance=max(stock.gap - TOLERANCE, 0.0))
    for one, other in near.T.tolist():
        if one >= other or slots[one].sheet != slots[other].sheet:
            continue
        if stock.gap > TOLERANCE:
            gap = f"{stock.gap:g} mm"
            faults.append(f"patches {names[one]} and {names[other]} are nearer than {gap}")
        elif common_area(shapes[one], shapes[other]) > TOLERANCE * shapes[one].length:
            faults.append(f"patches {names[one]} and {names[other]} overlap")
    return faults


def _stock_faults(slots: Sequence[Slot], stock: Stock) -> list[str]:
    """The faults in the numbers and kinds of the sheets."""
    pairs = {(slot.sheet, slot.kind) for slot in slots}
    sheets = {sheet for sheet, _ in pairs}
    if len(sheets) < len(pairs):
        return ["a sheet is of two kinds"]
    if sheets != set(range(len(sheets))):
        return ["its sheets are not numbered from 0 on"]
    taken = np.bincount([kind for _, kind in pairs], minlength=len(stock.kinds)).tolist()
    return [
        f"it takes {count} sheets of a kind of which there are {kind.quantity}"
        for count, kind in zip(taken, stock.kinds, strict=True)
        if kind.quantity is not None and count > kind.quantity
    ]
