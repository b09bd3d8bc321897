"""The room that a job needs: whether all of its moves fit the bed and the travel of a machine."""

from __future__ import annotations

import numpy as np

from miurafab.gcode.program import Program
from miurafab.geometry.arrays import Floats
from miurafab.profiles import MachineProfile

TOLERANCE_MM = 5e-4
"""How far a move may pass a limit: half a micron. G-code has three decimals, so a move that
exceeds a limit by more than this is written as a different number."""


def fits_bed(program: Program | None, machine: MachineProfile) -> bool:
    """Whether some origin puts all moves of ``program`` on the bed."""
    if program is None or not len(program):
        return False
    extent = np.ptp(program.end[:, :2], axis=0)
    size = np.array([machine.bed.width_mm, machine.bed.height_mm])
    deep = machine.z is not None and z_extent(program) > machine.z.travel_mm + TOLERANCE_MM
    return bool((extent <= size + TOLERANCE_MM).all()) and not deep


def z_extent(program: Program) -> float:
    """Over how many mm of Z the program moves, from where it begins."""
    return float(np.ptp(np.append(program.end[:, 2], program.start[:1, 2])))


def first_outside(ends: Floats, low: Floats, high: Floats) -> tuple[int, int] | None:
    """The index of the first of ``ends`` (n, 2) outside the box and the number of all, or None."""
    outside = ((ends < low - TOLERANCE_MM) | (ends > high + TOLERANCE_MM)).any(axis=1)
    return (int(np.argmax(outside)), int(outside.sum())) if outside.any() else None
