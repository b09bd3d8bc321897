"""What happens between two runs of strokes, with the beam off: the height of the head, the air.

A material gives each operation the height of its first pass and a step down for each further pass.
Heights count from where the head was focused, which is Z0; it is there before a job and after it.
A line is written only where something changes, so a job without heights has none.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from miurafab.errors import ProfileError
from miurafab.posting.dialects import Words
from miurafab.posting.strokes import Runs
from miurafab.posting.text import trimmed
from miurafab.profiles import OPERATIONS, MachineProfile, Material
from miurafab.profiles.beam import Operation


def heights_of(runs: Runs, machine: MachineProfile, material: Material) -> list[float]:
    """Z in each of the ``runs``.

    Raises :class:`~miurafab.errors.ProfileError` for heights that ``machine`` does not have.
    """
    operations = material.on(machine).operations
    heights = [
        operations[OPERATIONS[code]].heights_mm[number - 1]
        for code, number in zip(runs.operation.tolist(), runs.number.tolist(), strict=True)
    ]
    travel = float(np.ptp([0.0, *heights]))
    if travel and machine.z is None:
        raise ProfileError(
            f"{material.name} gives operations a z_step or a focus, and {machine.name} has no Z "
            "axis; leave them out, or write a table [z] in the machine's file if it has one."
        )
    if machine.z is not None and travel > machine.z.travel_mm:
        raise ProfileError(
            f"{material.name} moves the head over {travel:g} mm in Z, and {machine.name} has "
            f"{machine.z.travel_mm:g} mm; take fewer passes or a smaller z_step."
        )
    return heights


class Between:
    """The lines between the ``runs`` of a sheet, which are made at ``heights``."""

    def __init__(
        self,
        runs: Runs,
        heights: Sequence[float],
        operations: Mapping[str, Operation],
        words: Words,
    ) -> None:
        self._heights = heights
        self._air = [operations[OPERATIONS[code]].air for code in runs.operation.tolist()]
        self._words = words

    @property
    def back(self) -> tuple[str, ...]:
        """What brings the head back to where it was focused."""
        return (self._to(0.0),) if self._heights and self._heights[-1] else ()

    def lines(self, mode: str) -> list[str]:
        """What stands before each run; ``mode`` makes a move absolute where it might not be."""
        return list(self._lines(mode))

    def _lines(self, mode: str) -> Iterator[str]:
        height, blowing = 0.0, False
        for z, air in zip(self._heights, self._air, strict=True):
            text = ""
            if self._words.air and air != blowing:
                text += self._words.air[0 if air else 1] + "\n"
            if z != height:
                text += f"{mode}{self._to(z)}\n"
            height, blowing = z, air
            yield text

    def _to(self, z: float) -> str:
        return f"G0 Z{trimmed(z)}{self._words.travel}"
