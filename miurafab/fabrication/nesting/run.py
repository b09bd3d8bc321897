"""A problem given to an engine, and what comes back proven before anybody uses it.

An engine proposes one layout after the other; of those without a fault the one that takes the
least stock is the answer. A layout with a fault is told and forgotten. Where an engine of others
comes up with nothing, the raster engine's layout stands.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

from miurafab.errors import LayoutError
from miurafab.fabrication.nesting.outside import OUTSIDE, check_installed, installed, propose
from miurafab.fabrication.nesting.problem import (
    Problem,
    Slot,
    cost,
    layout_faults,
)
from miurafab.fabrication.nesting.raster import raster_engine
from miurafab.version import __version__

RASTER, AUTO = "raster", "auto"
ENGINES = (RASTER, AUTO, *OUTSIDE)
"""What may do the nesting; with ``auto`` the raster engine, and, where it takes more sheets than
the bound, whatever else is installed."""


@dataclass(frozen=True)
class Nesting:
    """A slot for each outline, and how they were found: the ``engine`` and its ``version``, the
    ``seed``, the ``seconds`` it took, None where the clock had no say in the result, the ``bound``
    below which no number of sheets can be, and ``remarks``, sentences on what went wrong.
    """

    slots: tuple[Slot, ...]
    engine: str
    version: str
    seed: int
    seconds: float | None
    bound: int
    remarks: tuple[str, ...] = ()

    @property
    def sheets(self) -> int:
        """How many sheets it takes."""
        return 1 + max(slot.sheet for slot in self.slots)


def check_engine(engine: str) -> None:
    """Raise :class:`~miurafab.errors.LayoutError` where ``engine`` cannot be asked here."""
    if engine in OUTSIDE:
        check_installed(engine)


def nest(problem: Problem, engine: str = RASTER) -> Nesting:
    """A slot for each outline.

    Raises :class:`~miurafab.errors.LayoutError` if an outline fits no sheet at any rotation, or
    the stock does not suffice, or the engine is not installed.
    """
    _check_sizes(problem)
    if engine in OUTSIDE:
        found = _outside(problem, engine)
        if found.slots:
            return found
        return _with_remarks(_raster(problem), found.remarks)
    found = _raster(problem)
    if engine == AUTO and found.sheets > found.bound:
        for other in OUTSIDE:
            if installed(other):
                tried = _outside(problem, other)
                best = found
                if tried.slots and cost(tried.slots, problem.stock) < cost(
                    found.slots, problem.stock
                ):
                    best = tried
                found = _with_remarks(best, tried.remarks)
    return found


def _check_sizes(problem: Problem) -> None:
    kinds = problem.stock.kinds
    for name, outline in zip(problem.names, problem.outlines, strict=True):
        if not any(kind.fits(outline, turn) for kind in kinds for turn in kind.rotations):
            wide, high = (outline.max(axis=0) - outline.min(axis=0)).tolist()
            largest = max(kinds, key=lambda kind: kind.width * kind.height)
            turns = ", ".join(str(turn) for turn in largest.rotations)
            raise LayoutError(
                f"Patch {name} measures {wide:.1f} mm x {high:.1f} mm and does not fit the usable "
                f"{largest.width:.1f} mm x {largest.height:.1f} mm of the largest sheet, turned by "
                f"{turns} degrees."
            )


def _raster(problem: Problem) -> Nesting:
    found: list[list[Slot]] = []
    started = time.monotonic()
    finished = raster_engine(problem, found.append)
    seconds = time.monotonic() - started
    faults = layout_faults(problem, found[-1])
    if faults:
        raise LayoutError(f"The nesting cannot be used: {faults[0]}.")
    remarks = []
    if not finished:
        remarks.append(
            f"The nesting was ended after {seconds:.0f} s; with more --nesting-time it may take "
            "fewer sheets."
        )
    return Nesting(
        tuple(found[-1]),
        RASTER,
        __version__,
        problem.seed,
        None if finished else seconds,
        problem.bound,
        tuple(remarks),
    )


def _outside(problem: Problem, engine: str) -> Nesting:
    """The best sound layout of an outside engine, without slots if there is none."""
    started = time.monotonic()
    proposals = propose(engine, problem)
    seconds = time.monotonic() - started
    sound, remarks = [], []
    for slots in proposals.layouts:
        faults = layout_faults(problem, slots)
        if faults:
            remarks.append(f"A layout of {engine} was refused: {faults[0]}.")
        else:
            sound.append(slots)
    if proposals.complaint:
        remarks.append(f"The nesting engine '{engine}': {proposals.complaint.rstrip('.')}.")
    best = min(sound, key=lambda slots: cost(slots, problem.stock), default=[])
    if not best:
        remarks.append(f"The nesting engine '{engine}' found no layout in {seconds:.0f} s.")
    version = proposals.version
    return Nesting(
        tuple(best), engine, version, problem.seed, seconds, problem.bound, tuple(remarks)
    )


def _with_remarks(nesting: Nesting, remarks: tuple[str, ...]) -> Nesting:
    return replace(nesting, remarks=nesting.remarks + remarks)
