"""The back of a sheet: the sheet turned over about its vertical axis, located by three holes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from miurafab.errors import LayoutError
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.relief import circles
from miurafab.fabrication.route.order import HOLE, StrokeSet
from miurafab.geometry.arrays import Floats
from miurafab.profiles import OPERATIONS, Material

if TYPE_CHECKING:
    from miurafab.fabrication.strokes import Blank

PIN_MM = 2.0
"""The diameter of a registration hole; it lies in the middle of the margin."""


def check_two_sided(material: Material, sheets: Sequence[Blank], options: LayoutOptions) -> None:
    if options.two_sided and material.creases["valley"].mode != "score":
        raise LayoutError(
            "Two-sided working scores the valleys from the back, but the material "
            f"'{material.name}' does not score them; write mode = 'score' under [creases.valley]."
        )
    if any(blank.margin < PIN_MM + 1.0 for blank in sheets):
        raise LayoutError(
            f"Two-sided working needs a margin of {PIN_MM + 1.0:g} mm for its registration holes, "
            f"and the machine's is {sheets[0].margin:g} mm; make it wider in the machine's file."
        )


def turned_over(strokes: StrokeSet) -> StrokeSet:
    """The strokes seen from the back of the sheet, turned over about its vertical axis."""
    front = strokes.toolpath
    points = front.points * np.array([-1.0, 1.0]) + np.array([front.width_mm, 0.0])
    return replace(strokes, toolpath=replace(front, points=points))


def pin_centres(width: float, height: float, margin: float) -> Floats:
    """(3, 2) the centres of the registration holes on the front of a sheet, in mm. Their distances
    from the corners differ, so a sheet that is turned the wrong way does not match.
    """
    near = margin / 2
    return np.array([[near, near], [width - near, near], [near, height * 0.7]])


def with_pins(back: StrokeSet, blank: Blank, material: Material) -> StrokeSet:
    """The strokes of a back, with its registration holes."""
    centres = pin_centres(blank.width, blank.height, blank.margin) * [-1.0, 1.0]
    moved = centres + np.array([blank.width, 0.0])
    points, count = circles(moved, PIN_MM - material.kerf_mm)
    path, pins = back.toolpath, len(centres)
    return StrokeSet(
        replace(
            path,
            points=np.concatenate([path.points, points]),
            offsets=np.concatenate(
                [path.offsets, path.offsets[-1] + count * np.arange(1, 1 + pins)]
            ),
            operation=np.append(path.operation, np.full(pins, OPERATIONS.index("cut"))),
            patch=np.append(path.patch, np.full(pins, -1)),
            edge=np.append(path.edge, np.full(pins, -1)),
        ),
        np.append(back.group, back.group.max(initial=-1) + 1 + np.arange(pins)),
        np.append(back.rank, np.full(pins, HOLE)),
    )
