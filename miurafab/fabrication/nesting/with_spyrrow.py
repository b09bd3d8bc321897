"""Strips cut into sheets, with spyrrow, the bindings of sparrow.

sparrow packs a strip of given width as short as it can. A sheet is such a strip that must not be
longer than the sheet: the largest outlines that are left, up to a share of its area, are packed,
and with less and less of them until the strip is short enough. So sheet by sheet until nothing is
left; then, while there is time, once more with other lots. Of a sheet with defects only the
largest rectangle without any is used.
"""

from __future__ import annotations

import itertools
import time

import numpy as np
import shapely
import spyrrow
from numpy.typing import NDArray

from miurafab.fabrication.nesting.problem import (
    Problem,
    Report,
    SheetKind,
    Slot,
    clear_rectangle,
    grown,
    renumbered,
)

_SHARES = (0.9, 0.86, 0.82, 0.78, 0.72, 0.64, 0.5, 0.3)
"""Shares of a sheet that are tried in turn; an outline alone is tried after them."""

_EASY = 3
"""With which of the shares the first layout begins, each further one a step higher, so that there
is a layout soon."""

_LEAST = 1
"""The shortest time in s that sparrow can be given; it counts in whole seconds."""

_Placed = dict[int, tuple[float, float, int]]


def spyrrow_engine(problem: Problem, report: Report) -> bool:
    """Layouts sheet by sheet, each with the next seed, until the time is over or none can take
    fewer sheets.
    """
    shapes = [grown(outline, problem.stock.gap) for outline in problem.outlines]
    areas = np.array([shapely.Polygon(shape).area for shape in shapes])
    end = time.monotonic() + problem.seconds
    best = len(shapes) + 1
    for number in itertools.count():
        shares = (*_SHARES[max(_EASY - number, 0) :], 0.0)
        slots = _layout(problem, shapes, areas, end, shares, problem.seed + number)
        if slots is None:
            break
        sheets = max(slot.sheet for slot in slots) + 1
        if sheets < best:
            best = sheets
            report(renumbered(slots))
        if best <= problem.bound:
            return True
    return False


def _layout(
    problem: Problem,
    shapes: list[NDArray[np.float64]],
    areas: NDArray[np.float64],
    end: float,
    shares: tuple[float, ...],
    seed: int,
) -> list[Slot] | None:
    """One layout; None if the time was over first, or the stock does not suffice."""
    left = np.argsort(-areas, kind="stable").tolist()
    slots: dict[int, Slot] = {}
    sheet = 0
    for k in problem.stock.in_turn:
        kind = problem.stock.kinds[k]
        count = 0
        while left and (kind.quantity is None or count < kind.quantity):
            placed = _sheet(shapes, areas, left, kind, problem.stock.gap, end, shares, seed)
            if not placed:
                break
            for number, (x, y, rotation) in placed.items():
                slots[number] = Slot(sheet, k, x, y, rotation)
            left = [number for number in left if number not in placed]
            sheet, count = sheet + 1, count + 1
    return None if left else [slots[number] for number in range(len(shapes))]


def _sheet(
    shapes: list[NDArray[np.float64]],
    areas: NDArray[np.float64],
    left: list[int],
    kind: SheetKind,
    gap: float,
    end: float,
    shares: tuple[float, ...],
    seed: int,
) -> _Placed:
    """Outlines of those ``left`` on one sheet: the most of it that a strip could hold."""
    low_x, low_y, high_x, high_y = clear_rectangle(kind)
    long, wide = high_x - low_x + gap, high_y - low_y + gap
    tried: list[int] = []
    for share in shares:
        chosen: list[int] = []
        room = share * long * wide
        for number in left:
            if areas[number] <= room:
                chosen.append(number)
                room -= areas[number]
        if not chosen and share == 0.0:
            chosen = left[:1]
        if not chosen or chosen == tried:
            continue
        if time.monotonic() + _LEAST > end:
            return {}
        tried = chosen
        solution = _strip(shapes, chosen, kind, wide, seed)
        if solution is not None and solution.width <= long:
            return {
                int(item.id): (
                    item.translation[0] + low_x - gap / 2,
                    item.translation[1] + low_y - gap / 2,
                    round(item.rotation) % 360,
                )
                for item in solution.placed_items
            }
    return {}


def _strip(
    shapes: list[NDArray[np.float64]], chosen: list[int], kind: SheetKind, wide: float, seed: int
) -> spyrrow.StripPackingSolution | None:
    """The chosen outlines in a strip, None where one is too wide for it."""
    items = []
    for number in chosen:
        corners = [(float(x), float(y)) for x, y in shapes[number].tolist()]
        turns = [float(rotation) for rotation in kind.rotations]
        items.append(spyrrow.Item(str(number), corners, 1, turns))
    config = spyrrow.StripPackingConfig(
        total_computation_time=_LEAST, early_termination=True, num_workers=1, seed=seed
    )
    try:
        return spyrrow.StripPackingInstance("sheet", wide, items).solve(config)
    except ValueError:
        return None
