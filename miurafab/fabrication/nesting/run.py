"""A problem given to an engine, and what comes back proven before anybody uses it.

An engine proposes one layout after the other; the one that takes the least stock of those without
a fault is the answer. What a layout with a fault had wrong is told, and the layout forgotten.
"""

from __future__ import annotations

from dataclasses import dataclass

from miurafab.errors import LayoutError
from miurafab.fabrication.nesting.problem import Problem, Slot, layout_faults, sheet_bound
from miurafab.fabrication.nesting.raster import raster_engine
from miurafab.version import __version__


@dataclass(frozen=True)
class Nesting:
    """A slot for each outline, and how they were found: the ``engine`` and its ``version``, the
    ``seed``, whether it ended by itself, the ``bound`` below which no number of sheets can be, and
    ``remarks``, sentences on what went wrong on the way.
    """

    slots: tuple[Slot, ...]
    engine: str
    version: str
    seed: int
    finished: bool
    bound: int
    remarks: tuple[str, ...] = ()


def nest(problem: Problem, engine: str = "raster") -> Nesting:
    """A slot for each outline.

    Raises :class:`~miurafab.errors.LayoutError` if an outline fits no sheet at any rotation, or
    the stock does not suffice, or the engine's layout is wrong.
    """
    for name, outline in zip(problem.names, problem.outlines, strict=True):
        if not any(
            kind.fits(outline, rotation)
            for kind in problem.stock.kinds
            for rotation in kind.rotations
        ):
            low, high = outline.min(axis=0), outline.max(axis=0)
            wide, tall = high - low
            largest = max(problem.stock.kinds, key=lambda kind: kind.width * kind.height)
            raise LayoutError(
                f"Patch {name} measures {wide:.1f} mm x {tall:.1f} mm and does not fit the "
                f"usable bed of {largest.width:.1f} mm x {largest.height:.1f} mm."
            )
    found: list[list[Slot]] = []
    finished = raster_engine(problem, found.append)
    faults = layout_faults(problem, found[-1])
    if faults:
        raise LayoutError(f"The nesting cannot be used: {faults[0]}.")
    bound = sheet_bound(problem.outlines, problem.stock)
    return Nesting(tuple(found[-1]), "raster", __version__, problem.seed, finished, bound)
