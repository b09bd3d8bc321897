"""What a machine in memory burnt or drew: every stretch of time and way with the beam on.

Each virtual machine keeps such a log, so that a test can ask what was made and no sender has to be
believed. A pen or blade that is down counts as a beam.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class BeamSegment:
    """The beam on from ``t0`` to ``t1`` (s of virtual time), moving evenly from (``x0``, ``y0``)
    to (``x1``, ``y1``) in machine mm (equal: standing still), at ``power``, a fraction of full.
    """

    t0: float
    t1: float
    x0: float
    y0: float
    x1: float
    y1: float
    power: float

    @property
    def standing(self) -> bool:
        """Whether the beam burnt in place."""
        return self.x0 == self.x1 and self.y0 == self.y1


def standing_seconds(log: Iterable[BeamSegment]) -> float:
    """How long the beam stood still while on, all in all."""
    return sum(segment.t1 - segment.t0 for segment in log if segment.standing)
