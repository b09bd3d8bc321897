"""What a pattern needs of the bed, in words: how many sheets, and up to which size one will do.

At once, while a hand drags a slider, by the closed form of the largest scale
(:mod:`~miurafab.fabrication.plan_size`); with more time, by a whole plan, which also tells the
sheets and the glue of a shell that is larger than one sheet.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.patch_frame import sheet_space
from miurafab.fabrication.plan import LARGE, plan_patches
from miurafab.fabrication.plan_size import Sizing
from miurafab.fabrication.seams import border_seams
from miurafab.fabrication.wording import count
from miurafab.geometry.polygons import filled, signed_areas
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import MachineProfile, Material
from miurafab.workflow.dry_run import length_text
from miurafab.workflow.scaling import size_of

ONE = "One sheet, no glue"
_SLACK = 1e-3
"""A box may be so many mm larger than its sheet by rounding."""


def at_once(
    pattern: CreasePattern, machine: MachineProfile, material: Material, options: LayoutOptions
) -> dict[str, Any]:
    """The words that the closed form allows: ``title``, ``remark``, ``mark``, ``largest_mm``.

    One piece without tabs on its border lies on a sheet whole up to that scale exactly. For other
    patterns it is a bound, and so the words say "at most".

    Raises :class:`~miurafab.errors.LayoutError` where the material leaves no room on the bed.
    """
    sizing = Sizing(pattern, machine, material, options)
    scale = sizing.bound()
    largest = _floor(scale * size_of(pattern))
    exact = _is_exact(sizing)
    on = _on_bed(sizing, scale)
    if scale >= 1:
        if exact:
            words = _words(ONE, f"it may be as large as {largest:g} mm", largest, good=True)
        else:
            words = _words("Perhaps one sheet", f"at most {largest:g} mm fit", largest, good=None)
        return words | on
    remark = f"at {largest:g} mm: one sheet, no glue" if exact else f"at most {largest:g} mm fit"
    least = _least_sheets(sizing)
    title = f"At least {least} sheets" if least > 1 else "Larger than a sheet in one piece"
    return _words(title, remark, largest, good=False) | on


def planned(
    pattern: CreasePattern, machine: MachineProfile, material: Material, options: LayoutOptions
) -> dict[str, Any]:
    """The words of a whole plan; those of :func:`at_once` for a pattern that is too large for it.

    Raises :class:`~miurafab.errors.LayoutError` where a facet is larger than the bed.
    """
    quick = at_once(pattern, machine, material, options)
    if len(pattern.faces_vertices) > LARGE:
        return quick
    sizing = Sizing(pattern, machine, material, options)
    plan = plan_patches(sizing.pattern, sizing.stock, sizing.material, options)
    (row,) = (each for each in plan.alternatives if each.chosen)
    whole = row.seam_mm == 0
    sheets = "One sheet" if row.sheets == 1 else count(row.sheets, "sheet", "sheets")
    glue = "no glue" if whole else f"{length_text(row.seam_mm)} of glue"
    largest = quick["largest_mm"]
    one = whole and row.sheets == 1
    if one:
        remark = quick["remark"] if quick["mark"] == "good" else ""
    else:
        remark = f"{count(row.patches, 'patch', 'patches')}; {quick['remark']}"
    return quick | _words(f"{sheets}, {glue}", remark, largest, good=one)


def _words(title: str, remark: str, largest: float, *, good: bool | None) -> dict[str, Any]:
    mark = "" if good is None else "good" if good else "more"
    return {"title": title, "remark": remark, "mark": mark, "largest_mm": largest}


def _on_bed(sizing: Sizing, scale: float) -> dict[str, Any]:
    """The flat pattern over one sheet, both in mm about their middles: the ``sheet`` [width,
    height] that can be used, and the ``border`` [x, y, x, y] of each edge, turned as it lies on the
    sheet at the largest ``scale``. ``sheet`` is None for several pieces: a plan says where they
    lie.
    """
    if len(sizing.pieces) > 1:
        return {"sheet": None, "border": []}
    room, flat = sizing.room, sizing.pattern.vertices_coords
    fitting = scale * flat
    turn = room.turn(fitting) or 0.0
    cos, sin = math.cos(turn), math.sin(turn)
    points = flat @ np.array([[cos, -sin], [sin, cos]])
    wide, high = scale * np.ptp(points, axis=0)
    if wide > room.width + _SLACK or high > room.height + _SLACK:
        points = points @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    points -= (points.min(axis=0) + points.max(axis=0)) / 2
    border = sizing.pattern.edges_vertices[sizing.pattern.edges_assignment == "B"]
    return {
        "sheet": [round(room.width, 1), round(room.height, 1)],
        "border": points[border].reshape(-1, 4).round(1).tolist(),
    }


def _is_exact(sizing: Sizing) -> bool:
    """Whether the bound is the largest scale: one piece, once, with no seam of its border."""
    alone = len(sizing.pieces) == 1 and sizing.options.nesting.quantity == 1
    return alone and not len(border_seams(sizing.pattern).edges)


def _least_sheets(sizing: Sizing) -> int:
    """The sheets that the area of the pattern needs in any case."""
    corners = sizing.pattern.vertices_coords[filled(sizing.pattern.faces_vertices)]
    area = float(np.abs(signed_areas(corners)).sum()) * sizing.options.nesting.quantity
    sheet = sheet_space(sizing.stock)
    return max(1, math.ceil(area / (sheet.width * sheet.height) - 1e-9))


def _floor(size_mm: float) -> float:
    """Rounded down: a size that is told must fit. 273.5 mm are 273."""
    return math.floor(size_mm) if size_mm >= 10 else math.floor(100 * size_mm) / 100
