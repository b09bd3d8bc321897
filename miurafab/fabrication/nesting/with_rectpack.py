"""Boxes only, with rectpack: fast and coarse.

Kind by kind, in turn, the boxes of the grown outlines that are left are packed into as many sheets
as there are. Of a sheet with defects only the largest rectangle without any is used.
"""

from __future__ import annotations

import math

import numpy as np
import rectpack

from miurafab.fabrication.nesting.problem import (
    Problem,
    Report,
    SheetKind,
    Slot,
    clear_rectangle,
    grown,
    renumbered,
    turned,
)

_UNIT = 1e-3
"""Sizes are whole numbers of this many mm to the packer, which compares them exactly."""


def rectpack_engine(problem: Problem, report: Report) -> bool:
    """One layout of boxes; none where the stock does not suffice for them."""
    shapes = [grown(outline, problem.stock.gap) for outline in problem.outlines]
    left = list(range(len(shapes)))
    slots: dict[int, Slot] = {}
    sheets = 0
    for k in problem.stock.in_turn:
        placed = _packed(shapes, left, problem.stock.kinds[k], problem.stock.gap)
        for number, (sheet, x, y, rotation) in placed.items():
            slots[number] = Slot(sheets + sheet, k, x, y, rotation)
        sheets += 1 + max((sheet for sheet, *_ in placed.values()), default=-1)
        left = [number for number in left if number not in placed]
    if not left:
        report(renumbered([slots[number] for number in range(len(shapes))]))
    return True


def _packed(
    shapes: list[np.ndarray], left: list[int], kind: SheetKind, gap: float
) -> dict[int, tuple[int, float, float, int]]:
    """Sheet, place and rotation of each of the outlines ``left`` that finds room."""
    low_x, low_y, high_x, high_y = clear_rectangle(kind)
    wide, high = (math.floor(side / _UNIT) for side in (high_x - low_x + gap, high_y - low_y + gap))
    crosswise = all((rotation + 90) % 360 in kind.rotations for rotation in kind.rotations)
    packer = rectpack.newPacker(
        mode=rectpack.PackingMode.Offline,
        bin_algo=rectpack.PackingBin.BBF,
        pack_algo=rectpack.MaxRectsBssf,
        sort_algo=rectpack.SORT_AREA,
        rotation=crosswise,
    )
    boxes = {}
    for number in left:
        options = [(np.ptp(turned(shapes[number], r), axis=0), r) for r in kind.rotations]
        options = [
            (np.ceil(size / _UNIT), r)
            for size, r in options
            if (np.ceil(size / _UNIT) <= [wide, high]).all()
        ]
        if options:
            size, rotation = min(options, key=lambda option: float(option[0].prod()))
            boxes[number] = rotation
            packer.add_rect(int(size[0]), int(size[1]), number)
    packer.add_bin(wide, high, count=len(left) if kind.quantity is None else kind.quantity)
    packer.pack()
    found = {}
    for sheet, x, y, w, h, number in packer.rect_list():
        rotation = boxes[number]
        size = np.ceil(np.ptp(turned(shapes[number], rotation), axis=0) / _UNIT)
        if (w, h) != (int(size[0]), int(size[1])):
            rotation = (rotation + 90) % 360
        low = turned(shapes[number], rotation).min(axis=0)
        at = np.array([low_x, low_y]) + np.array([x, y]) * _UNIT - gap / 2 - low
        found[int(number)] = (int(sheet), float(at[0]), float(at[1]), rotation)
    return found
