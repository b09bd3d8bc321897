"""Blocks on a sheet, in rows and columns: the first way to lay them that has room."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TypeAlias

import numpy as np

from miurafab.errors import LayoutError
from miurafab.geometry.arrays import Floats
from miurafab.profiles import MachineProfile

Points = Floats

_SPACE = 8.0
"""Between two blocks, in mm."""

Tree: TypeAlias = "int | tuple[str, tuple[Tree, ...]]"
"""A block by its number, or parts in a ``row`` or a ``column``."""


def arranged(
    blocks: Sequence[tuple[float, float]], ways: Sequence[Tree], machine: MachineProfile
) -> tuple[list[Points], tuple[float, float]]:
    """The lower left corners of the ``blocks``, and their total size, as the first of the ``ways``
    that has room on the bed of ``machine``.

    Raises :class:`~miurafab.errors.LayoutError` where none has.
    """
    bed = machine.bed
    room = (bed.width_mm - 2 * bed.margin_mm, bed.height_mm - 2 * bed.margin_mm)
    sizes = [_extent(way, blocks) for way in ways]
    for way, (wide, high) in zip(ways, sizes, strict=True):
        if wide <= room[0] and high <= room[1]:
            places = dict(_places(way, blocks, 0.0, high))
            return [np.array(places[number]) for number in range(len(blocks))], (wide, high)
    needed = " or ".join(f"{wide:.0f} mm x {high:.0f} mm" for wide, high in sizes)
    raise LayoutError(
        f"The calibration sheet needs {needed}, and the usable bed of {machine.name} is "
        f"{room[0]:g} mm x {room[1]:g} mm; choose another machine, or a smaller margin in its "
        "profile."
    )


def _extent(tree: Tree, blocks: Sequence[tuple[float, float]]) -> tuple[float, float]:
    if isinstance(tree, int):
        return blocks[tree]
    kind, parts = tree
    wide, high = zip(*(_extent(part, blocks) for part in parts), strict=True)
    between = _SPACE * (len(parts) - 1)
    return (sum(wide) + between, max(high)) if kind == "row" else (max(wide), sum(high) + between)


def _places(
    tree: Tree, blocks: Sequence[tuple[float, float]], left: float, top: float
) -> Iterator[tuple[int, tuple[float, float]]]:
    """The lower left corner of each block of ``tree``, whose upper left corner is given."""
    if isinstance(tree, int):
        yield tree, (left, top - blocks[tree][1])
        return
    kind, parts = tree
    for part in parts:
        wide, high = _extent(part, blocks)
        yield from _places(part, blocks, left, top)
        left, top = (left + wide + _SPACE, top) if kind == "row" else (left, top - high - _SPACE)
