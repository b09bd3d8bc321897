"""The question that nesting answers, what an answer is, and what is wrong with a given one.

Outlines go on sheets of some kinds, at rotations that each kind allows, a gap apart. An answer is
one :class:`Slot` for each outline. Nobody is believed: :func:`layout_faults` proves every answer
with exact geometry, whoever proposed it.

Two outlines keep the gap g when each, grown by g/2, shares no area with the other; an outline
grown by g/2 lies on a bed grown by g/2 on all sides when the outline itself lies on the bed. So
engines are given grown outlines (:func:`grown`), grown beds and no gap; they keep half a gap from
defects that way, which is more than they must: touching a defect is no fault.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from miurafab.geometry.shapes import common_area

TOLERANCE = 1e-6
"""How far, in mm, a placement may be off by rounding."""

Ring = tuple[tuple[float, float], ...]
"""The corners of a closed curve in mm, the first not repeated."""


@dataclass(frozen=True)
class SheetKind:
    """Sheets alike: the usable size in mm, the ``rotations`` in whole degrees from 0 that outlines
    may have on them, the ``defects``, in the frame of the usable part, which nothing may lie on,
    and how many there are, None for as many as it takes.
    """

    width: float
    height: float
    rotations: tuple[int, ...]
    quantity: int | None = None
    defects: tuple[Ring, ...] = ()

    def fits(self, outline: NDArray[np.float64], rotation: int) -> bool:
        """Whether the box of ``outline`` (n, 2) at ``rotation`` is no larger than the sheet."""
        wide, high = np.ptp(turned(outline, rotation), axis=0)
        return bool(wide <= self.width + TOLERANCE and high <= self.height + TOLERANCE)

    @cached_property
    def flaws(self) -> BaseGeometry:
        """The defects in one shape."""
        shapes = [shapely.Polygon(ring) for ring in self.defects]
        # Snapping to a grid keeps GEOS 3.14 from returning shapes that only touch.
        return shapely.union_all(shapes, grid_size=1e-9)

    @property
    def area(self) -> float:
        """What can be used, in mm²."""
        bed = shapely.box(0.0, 0.0, self.width, self.height)
        lost = shapely.intersection(bed, self.flaws, grid_size=1e-9).area
        return float(self.width * self.height - lost)


@dataclass(frozen=True)
class Stock:
    """What the outlines go on, in the order in which it is to be used up, and the ``gap`` in mm
    kept between outlines. Kinds of which there are as many as it takes are begun last.
    """

    kinds: tuple[SheetKind, ...]
    gap: float

    @property
    def in_turn(self) -> list[int]:
        """The numbers of the kinds, those in a given quantity first."""
        return sorted(range(len(self.kinds)), key=lambda k: self.kinds[k].quantity is None)


@dataclass(frozen=True, eq=False)
class Problem:
    """``outlines`` to nest, closed curves (n, 2) in mm, called ``names``, on ``stock`` within
    ``seconds`` of time. Engines that draw lots draw them from ``seed``.
    """

    outlines: tuple[NDArray[np.float64], ...]
    names: tuple[str, ...]
    stock: Stock
    seconds: float
    seed: int = 0

    @cached_property
    def areas(self) -> NDArray[np.float64]:
        """(N,) the areas of the outlines grown by half the gap, in mm², or a little less."""
        shapes = [shapely.Polygon(outline) for outline in self.outlines]
        found: NDArray[np.float64] = shapely.area(shapely.buffer(shapes, self.stock.gap / 2))
        return found

    @cached_property
    def bound(self) -> int:
        """A number of sheets below which no layout can go.

        The sheets have at least the area of the outlines, both grown by half the gap, when the
        largest are used first; and no two outlines share a sheet that each of them fills by more
        than half.
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


@dataclass(frozen=True)
class Slot:
    """Where an outline goes: turned counter-clockwise by ``rotation_deg`` about its origin, then
    moved by (``x_mm``, ``y_mm``) on the usable part of ``sheet``, from 0, which is of ``kind``.
    """

    sheet: int
    kind: int
    x_mm: float
    y_mm: float
    rotation_deg: int


Report = Callable[[list[Slot]], None]
"""Takes a layout that is better than those before it."""


class Engine(Protocol):
    """What proposes layouts: one after the other, each better, and says whether it ended by itself
    and not because the time of the problem was over.
    """

    def __call__(self, problem: Problem, report: Report) -> bool: ...


def place(points: NDArray[np.float64], slot: Slot) -> NDArray[np.float64]:
    """``points`` (n, 2) of an outline, on the usable part of its sheet."""
    shift = np.array([slot.x_mm, slot.y_mm])
    moved: NDArray[np.float64] = turned(points, slot.rotation_deg) + shift
    return moved


def turned(points: NDArray[np.float64], rotation_deg: float) -> NDArray[np.float64]:
    """``points`` (n, 2) turned counter-clockwise about the origin; exact for right angles."""
    quarter, rest = divmod(rotation_deg, 90.0)
    if rest == 0.0:
        c, s = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarter) % 4]
    else:
        c, s = math.cos(math.radians(rotation_deg)), math.sin(math.radians(rotation_deg))
    x, y = points[..., 0], points[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def buffered(shape: BaseGeometry, distance: float) -> BaseGeometry:
    """A shape that holds ``shape`` grown by ``distance`` mm, in spite of the chords that its arcs
    are drawn with and of the hundredth of the distance that GEOS allows itself.
    """
    return shapely.buffer(shape, distance * 1.015, quad_segs=16)


def grown(outline: NDArray[np.float64], gap: float) -> NDArray[np.float64]:
    """The corners (m, 2) of a shape that holds ``outline`` grown by half of ``gap``, in few
    corners more than the outline has; counter-clockwise.
    """
    slack = 0.02
    shape = buffered(shapely.Polygon(outline), gap / 2 + slack)
    ring = shapely.get_exterior_ring(shapely.simplify(shape, slack))
    corners = shapely.get_coordinates(ring)[:-1]
    return corners if shapely.is_ccw(ring) else corners[::-1]


def clear_rectangle(kind: SheetKind) -> tuple[float, float, float, float]:
    """The largest rectangle (low x, low y, high x, high y) of a sheet that no box around a defect
    reaches into, in mm.
    """
    boxes = [shapely.Polygon(ring).bounds for ring in kind.defects]
    best = (0.0, 0.0, 0.0, 0.0)
    for low in [0.0, *(box[3] for box in boxes)]:
        for high in [kind.height, *(box[1] for box in boxes)]:
            between = sorted(box for box in boxes if box[1] < high and box[3] > low)
            left = 0.0
            for right, beyond in [*((b[0], b[2]) for b in between), (kind.width, 0.0)]:
                found = (left, max(low, 0.0), min(right, kind.width), min(high, kind.height))
                if min(found[2] - left, found[3] - found[1]) > 0 and _size(found) > _size(best):
                    best = found
                left = max(left, beyond)
    return best


def _size(box: tuple[float, float, float, float]) -> float:
    return (box[2] - box[0]) * (box[3] - box[1])


def renumbered(slots: Sequence[Slot]) -> list[Slot]:
    """The same layout with its sheets numbered from 0 without gaps, in their order."""
    used = {sheet: number for number, sheet in enumerate(sorted({slot.sheet for slot in slots}))}
    return [
        Slot(used[slot.sheet], slot.kind, slot.x_mm, slot.y_mm, slot.rotation_deg) for slot in slots
    ]


def cost(slots: Sequence[Slot], stock: Stock) -> tuple[float, float]:
    """What a layout takes, to be compared: the area of the sheets of which there are as many as it
    takes, then that of all sheets, in mm².
    """
    kinds = [stock.kinds[kind] for _, kind in sorted({(slot.sheet, slot.kind) for slot in slots})]
    sizes = [(kind.width * kind.height, kind.quantity is None) for kind in kinds]
    return sum(size for size, endless in sizes if endless), sum(size for size, _ in sizes)


def layout_faults(problem: Problem, slots: Sequence[Slot]) -> list[str]:
    """What is wrong with a layout, each as half a sentence; empty if all is well."""
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
    # Sheets are laid side by side, so that only what lies on the same one is near.
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
    """What is wrong with the sheets that are used."""
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
