"""Patches in frames of their own, one set for each copy of the model.

An outlined patch is turned to the smallest box that fits its sheet and moved until this box begins
at the origin. If it must lie along the fibres of a sheet, it keeps the directions of the pattern.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from miurafab.errors import LayoutError
from miurafab.fabrication.nesting import turned
from miurafab.fabrication.partition.fit_box import Space
from miurafab.fabrication.partition.patch_outline import (
    OutlinedPatch,
    OutlinedPatches,
)
from miurafab.fabrication.seam_names import tab_labels
from miurafab.fabrication.slots import TabSlot
from miurafab.fabrication.stock import LaidStock
from miurafab.fabrication.tabs import FOLDS, Tab
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern

DIGITS = 6
"""Decimals of mm in a layout, so that the written layout equals the computed layout."""


@dataclass(frozen=True, eq=False)
class Patch:
    """One patch in its own frame. ``faces`` (n,) int64 index the facets of the pattern.

    ``outline_mm`` (m, 2) is the cut line with tabs and kerf, counter-clockwise; ``waste_mm`` are
    further closed cut lines inside it, around enclosed waste (rare). A point p of the pattern is
    R(``rotation_deg``) (p - ``origin_mm``) in this frame. ``copy`` is the number of its model, from
    1. ``slots`` are those for the tabs of its neighbours.
    """

    id: int
    label: str
    faces: Ints
    outline_mm: Floats
    waste_mm: tuple[Floats, ...]
    origin_mm: tuple[float, float]
    rotation_deg: float
    tabs: tuple[Tab, ...]
    copy: int = 1
    slots: tuple[TabSlot, ...] = ()

    def from_pattern(self, points: Floats) -> Floats:
        """``points`` (n, 2) of the pattern, in the frame of the patch."""
        return turned(points - self.origin_mm, self.rotation_deg)


@dataclass(frozen=True, eq=False)
class FramedPatches:
    """The patches of one copy of the model: ``outlined`` in the pattern's plane, ``patches`` in
    their own frames, and the ``labels`` of the N tabs.
    """

    outlined: OutlinedPatches
    labels: tuple[str, ...]
    patches: tuple[Patch, ...]


def sheet_space(stock: LaidStock) -> Space:
    """The usable part of the main sheet of ``stock``."""
    kind = stock.kinds.kinds[stock.main]
    turns = tuple(sorted({turn // 90 % 2 for turn in kind.rotations})) if stock.upright else None
    return Space(kind.width, kind.height, turns)


def framed_patches(
    pattern: CreasePattern, outlined: OutlinedPatches, sheet: Space
) -> FramedPatches:
    """The patches in frames of their own, each no larger than ``sheet``."""
    labels = tab_labels(pattern, outlined.face_patch, outlined.tabs)
    numbers = _numbers(outlined)
    patches = (
        _patch(number, patch, outlined, numbers, labels, sheet)
        for number, patch in enumerate(outlined.patches)
    )
    return FramedPatches(outlined, labels, tuple(patches))


def copied(patches: tuple[Patch, ...], quantity: int) -> tuple[Patch, ...]:
    """The patches of ``quantity`` models, model by model, with ids and labels of their own."""
    if quantity == 1:
        return patches
    count = len(patches)
    return tuple(
        replace(
            patch,
            id=patch.id + count * copy,
            label=f"{patch.label}-{copy + 1}",
            tabs=tuple(
                tab
                if tab.mate_patch is None
                else replace(tab, mate_patch=tab.mate_patch + count * copy)
                for tab in patch.tabs
            ),
            copy=copy + 1,
            slots=tuple(
                replace(slot, mate_patch=slot.mate_patch + count * copy) for slot in patch.slots
            ),
        )
        for copy in range(quantity)
        for patch in patches
    )


def _numbers(outlined: OutlinedPatches) -> Ints:
    """The number of each tab, from 1, patch by patch along the outline."""
    numbers = np.empty(len(outlined.tabs), dtype=np.int64)
    order = np.concatenate([patch.tabs for patch in outlined.patches])
    numbers[order] = np.arange(1, len(order) + 1)
    return numbers


def _patch(
    number: int,
    patch: OutlinedPatch,
    outlined: OutlinedPatches,
    numbers: Ints,
    labels: tuple[str, ...],
    space: Space,
) -> Patch:
    line = patch.cut_lines[0]
    angle = space.turn(line)
    if angle is None:
        raise LayoutError(f"Patch {number} with its tabs does not fit the bed at any angle.")
    rotation = round(-math.degrees(angle), 9) if angle else 0.0
    low = turned(line, rotation).min(axis=0)
    origin = np.round(turned(low, -rotation), DIGITS)

    def framed(points: Floats) -> Floats:
        return np.round(turned(points - origin, rotation), DIGITS)

    tabs = outlined.tabs
    mates = np.where(tabs.mate_face < 0, -1, outlined.face_patch[tabs.mate_face])
    return Patch(
        id=number,
        label=f"P{number + 1}",
        faces=patch.faces,
        outline_mm=framed(line),
        waste_mm=tuple(framed(ring) for ring in patch.cut_lines[1:]),
        origin_mm=(float(origin[0]), float(origin[1])),
        rotation_deg=rotation,
        tabs=tuple(
            Tab(
                number=int(numbers[tab]),
                label=labels[tab],
                edge=int(tabs.edge[tab]),
                mate_edge=_mate(tabs.seams.edges[tab, 1]),
                mate_patch=_mate(mates[tab]),
                polygon_mm=framed(tabs.polygon(tab)),
                fold=FOLDS.get(str(tabs.seams.fold[tab]), "flat"),
                join=outlined.join if mates[tab] >= 0 else "glue",
            )
            for tab in patch.tabs.tolist()
        ),
        slots=tuple(
            TabSlot(
                tab=int(numbers[tab]),
                label=labels[tab],
                edge=int(tabs.seams.edges[tab, 1]),
                mate_patch=int(outlined.face_patch[tabs.own_face[tab]]),
                polygon_mm=framed(corners),
            )
            for tab, corners in _slots(outlined, mates == number)
        ),
    )


def _slots(outlined: OutlinedPatches, own: Bools) -> Iterator[tuple[int, Floats]]:
    """The number of the tab and the corners of each slot for one of the tabs ``own`` (N,)."""
    slots = outlined.slots
    for k in [] if slots is None else np.flatnonzero(own[slots.tab]).tolist():
        assert slots is not None
        yield int(slots.tab[k]), slots.corners[k]


def _mate(number: np.int64) -> int | None:
    """The number of a mate, None for -1."""
    return None if number < 0 else int(number)
