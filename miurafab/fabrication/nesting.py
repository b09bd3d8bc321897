"""Nesting: the patches placed on as few sheets as possible, turned but never overlapping.

An *engine* is any function that proposes a :class:`Slot` for each outline; :func:`nest` checks
every proposal with exact geometry before anybody sees it.

The engine here is first-fit on a raster. The gap is dealt with by growing every outline, and the
bed, by half of it. The bed is divided into cells; an outline marks every cell that it may touch,
so cells that are not shared mean outlines that do not touch. The number of cells that a part would
share with what lies on a sheet, for all positions at once, is a correlation of two masks and one
product of Fourier transforms; positions where it is 0 are free. Parts come by size, on the first
sheet with a free position, at the one that a rule prefers. Several orders and rules are tried, and
the fewest sheets win. Nothing is random and no clock is read: the same input gives the same layout.

Off-cuts are used before whole sheets. One is any part of the bed, with holes where it has defects;
the cells that it lacks are taken from the beginning, so that half a gap is kept from them too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import scipy.fft
import shapely
from numpy.typing import NDArray

from miurafab.errors import LayoutError

_CELLS = 384
"""Cells along the longer side of the bed, about; finer packs closer and takes longer."""

_TOLERANCE = 1e-6
"""How far, in mm, a placement may be off by rounding."""


@dataclass(frozen=True)
class Slot:
    """Where an outline goes: turned counter-clockwise by ``rotation_deg`` about its origin, then
    moved by (``x_mm``, ``y_mm``) on the usable bed of ``sheet``, from 0. ``offcut`` is the number
    of the off-cut that this sheet is, -1 for a whole one.
    """

    sheet: int
    x_mm: float
    y_mm: float
    rotation_deg: int
    offcut: int = -1


@dataclass(frozen=True)
class Stock:
    """What the outlines go on: the usable size in mm, the gap kept between outlines, and the
    rotations in degrees, multiples of 90, that the material allows. There are as many whole sheets
    as it takes, and one of each of the ``offcuts``: what can be used of it, placed on the bed.
    """

    width: float
    height: float
    gap: float
    rotations: tuple[int, ...]
    offcuts: tuple[shapely.Polygon, ...] = ()


Engine = Callable[[Sequence[NDArray[np.float64]], Stock], list[Slot]]


def nest(
    outlines: Sequence[NDArray[np.float64]], stock: Stock, engine: Engine | None = None
) -> list[Slot]:
    """A slot for each outline (n, 2), a closed curve in mm without its repeated first point.

    Each outline must fit a whole sheet at one of its rotations. Raises
    :class:`~miurafab.errors.LayoutError` if one does not, or if the engine's layout is wrong.
    """
    for number, outline in enumerate(outlines):
        if not any(_fits(outline, stock, rotation) for rotation in stock.rotations):
            wide, high = np.ptp(outline, axis=0)
            raise LayoutError(
                f"Patch {number} measures {wide:.1f} mm x {high:.1f} mm and does not fit the "
                f"usable bed of {stock.width:.1f} mm x {stock.height:.1f} mm."
            )
    slots = (engine or raster_engine)(outlines, stock)
    faults = layout_faults(outlines, slots, stock)
    if faults:
        raise LayoutError(f"The nesting cannot be used: {faults[0]}.")
    return slots


def place(points: NDArray[np.float64], slot: Slot) -> NDArray[np.float64]:
    """``points`` (n, 2) of an outline, on the usable bed."""
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


def layout_faults(
    outlines: Sequence[NDArray[np.float64]], slots: Sequence[Slot], stock: Stock
) -> list[str]:
    """What is wrong with a layout, each as half a sentence; empty if all is well."""
    if len(slots) != len(outlines):
        return [f"it has {len(slots)} places for {len(outlines)} patches"]
    faults = []
    shapes = [
        shapely.Polygon(place(outline, slot)) for outline, slot in zip(outlines, slots, strict=True)
    ]
    bed = (-_TOLERANCE, -_TOLERANCE, stock.width + _TOLERANCE, stock.height + _TOLERANCE)
    for number, (shape, slot) in enumerate(zip(shapes, slots, strict=True)):
        low_x, low_y, high_x, high_y = shape.bounds
        if slot.rotation_deg not in stock.rotations:
            faults.append(f"patch {number} is turned by {slot.rotation_deg} degrees")
        if low_x < bed[0] or low_y < bed[1] or high_x > bed[2] or high_y > bed[3]:
            faults.append(f"patch {number} lies outside the usable bed")
        if slot.offcut >= 0 and not stock.offcuts[slot.offcut].buffer(_TOLERANCE).covers(shape):
            faults.append(f"patch {number} lies outside off-cut {slot.offcut + 1}")
    pairs = {(slot.sheet, slot.offcut) for slot in slots}
    sheets, offcuts = zip(*pairs, strict=True) if pairs else ((), ())
    taken = [offcut for offcut in offcuts if offcut >= 0]
    if len(set(sheets)) < len(pairs) or len(set(taken)) < len(taken):
        faults.append("an off-cut is used for two sheets, or a sheet is two off-cuts")
    tree = shapely.STRtree(shapes)
    near = tree.query(shapes, predicate="dwithin", distance=stock.gap - _TOLERANCE)
    for one, other in near.T.tolist():
        if one < other and slots[one].sheet == slots[other].sheet:
            faults.append(f"patches {one} and {other} are nearer than {stock.gap:g} mm")
    return faults


def _fits(outline: NDArray[np.float64], stock: Stock, rotation: int) -> bool:
    wide, high = np.ptp(turned(outline, rotation), axis=0)
    return bool(wide <= stock.width + _TOLERANCE and high <= stock.height + _TOLERANCE)


@dataclass(frozen=True, eq=False)
class _Mask:
    """An outline at one rotation: its cells, their transform, and where its origin lies from the
    lower left corner of its box.
    """

    rotation: int
    cells: NDArray[np.bool_]
    transform: NDArray[np.complex64]
    shift: tuple[float, float]


class _Raster:
    """The cells of a bed grown by half a gap on all sides."""

    def __init__(self, stock: Stock) -> None:
        self.stock = stock
        size = np.array([stock.width + stock.gap, stock.height + stock.gap])
        self.cells = [
            int(scipy.fft.next_fast_len(max(math.ceil(_CELLS * side / size.max()), 16), real=True))
            for side in size
        ]
        self.cell = size / self.cells

    def mask(self, outline: NDArray[np.float64], rotation: int) -> _Mask:
        points = turned(outline, rotation)
        low, high = points.min(axis=0), points.max(axis=0)
        gap = self.stock.gap
        count = np.ceil((high - low + gap) / self.cell - 1e-7).astype(np.int64).clip(1, self.cells)
        # A cell that the grown outline touches has its centre within half a diagonal of it.
        reach = gap / 2 + np.hypot(*self.cell) / 2
        grown = shapely.buffer(shapely.Polygon(points - low), reach * 1.003, quad_segs=16)
        rings = [shapely.get_coordinates(ring) for ring in shapely.get_rings(grown)]
        cells = _scan([(ring + gap / 2) / self.cell for ring in rings], count)
        transform = np.conj(scipy.fft.rfft2(cells.astype(np.float32), self.cells))
        return _Mask(rotation, cells, transform, (-float(low[0]), -float(low[1])))

    def lacking(self, offcut: shapely.Polygon) -> NDArray[np.bool_]:
        """The cells that touch what ``offcut`` lacks of the usable bed."""
        bed = shapely.box(0.0, 0.0, self.stock.width, self.stock.height)
        reach = np.hypot(*self.cell) / 2
        lost = shapely.buffer(bed.difference(offcut), reach * 1.003, quad_segs=16)
        rings = [
            shapely.get_coordinates(ring) for ring in shapely.get_rings(shapely.get_parts(lost))
        ]
        half = self.stock.gap / 2
        return _scan([(ring + half) / self.cell for ring in rings], np.array(self.cells))


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
    """The cells taken on one sheet, and how many are free."""

    def __init__(self, raster: _Raster, lacking: NDArray[np.bool_] | None = None) -> None:
        self.raster = raster
        self.taken = np.zeros(raster.cells, dtype=np.float32)
        if lacking is not None:
            self.taken += lacking
        self.transform = scipy.fft.rfft2(self.taken)
        self.free = int(self.taken.size - np.count_nonzero(self.taken))

    def best(self, mask: _Mask, weights: tuple[float, float]) -> tuple[float, int, int] | None:
        """The free position of ``mask`` whose far corner is least by ``weights``, if any."""
        shared = scipy.fft.irfft2(self.transform * mask.transform, self.raster.cells)
        wide, high = mask.cells.shape
        columns, rows = self.raster.cells[0] - wide + 1, self.raster.cells[1] - high + 1
        free = np.flatnonzero(shared[:columns, :rows] < 0.5)
        if not len(free):
            return None
        i, j = np.divmod(free, rows)
        cost = (i + wide) * (weights[0] * self.raster.cell[0])
        cost += (j + high) * (weights[1] * self.raster.cell[1])
        at = int(np.argmin(cost))
        return float(cost[at]), int(i[at]), int(j[at])

    def put(self, mask: _Mask, i: int, j: int) -> None:
        wide, high = mask.cells.shape
        self.taken[i : i + wide, j : j + high] += mask.cells
        self.transform = scipy.fft.rfft2(self.taken)
        self.free -= int(mask.cells.sum())


def raster_engine(outlines: Sequence[NDArray[np.float64]], stock: Stock) -> list[Slot]:
    """First-fit by size on a raster; see the module."""
    raster = _Raster(stock)
    masks = [
        [raster.mask(outline, r) for r in stock.rotations if _fits(outline, stock, r)]
        for outline in outlines
    ]
    areas = np.array([shapely.Polygon(outline).area for outline in outlines])
    sides = np.array([np.ptp(outline, axis=0) for outline in outlines])
    lacking = [raster.lacking(offcut) for offcut in stock.offcuts]
    rest = areas.sum() - sum(offcut.area for offcut in stock.offcuts)
    bound = math.ceil(rest / (stock.width * stock.height) - 1e-9)
    orders = [np.argsort(-key, kind="stable") for key in (areas, sides.max(axis=1))]
    best: list[Slot] = []
    fewest = math.inf
    for weights, order in product([(0.01, 1.0), (1.0, 0.01), (1.0, 1.0)], orders):
        slots, used = _first_fit(raster, masks, order.tolist(), weights, lacking)
        if used < fewest:
            best, fewest = slots, used
        if math.ceil(fewest) <= bound:
            break
    return best


def _first_fit(
    raster: _Raster,
    masks: list[list[_Mask]],
    order: list[int],
    weights: tuple[float, float],
    lacking: list[NDArray[np.bool_]],
) -> tuple[list[Slot], float]:
    """The slots of one pass, and the whole sheets used: all but the last, and its share in use."""
    sheets = [_Sheet(raster, cells) for cells in lacking]
    slots: dict[int, Slot] = {}
    for number in order:
        smallest = min(int(mask.cells.sum()) for mask in masks[number])
        for index in range(len(sheets) + 1):
            if index == len(sheets):
                sheets.append(_Sheet(raster))
            sheet = sheets[index]
            if sheet.free < smallest:
                continue
            found = [(sheet.best(mask, weights), mask) for mask in masks[number]]
            open_places = [(place, mask) for place, mask in found if place is not None]
            if open_places:
                (_, i, j), mask = min(open_places, key=lambda entry: entry[0][0])
                sheet.put(mask, i, j)
                x, y = np.array([i, j]) * raster.cell + mask.shift
                offcut = index if index < len(lacking) else -1
                slots[number] = Slot(index, float(x), float(y), mask.rotation, offcut)
                break
    whole = sheets[len(lacking) :]
    share = 1 - whole[-1].free / whole[-1].taken.size if whole else 0.0
    used = sorted({slot.sheet for slot in slots.values()})
    placed = [replace(slots[n], sheet=used.index(slots[n].sheet)) for n in sorted(slots)]
    return placed, len(whole) - 1 + share
