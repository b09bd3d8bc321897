"""What a machine in memory burnt or drew: every stretch of time and way with the beam on.

Each virtual machine keeps such a log, so that a test can ask what was made and no sender has to be
believed. A pen or blade that is down counts as a beam.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

Point = tuple[float, float]


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


class BeamLog:
    """Closes one segment and opens the next at each change; ``pwm`` is 0..255."""

    def __init__(self) -> None:
        self.segments: list[BeamSegment] = []
        self.pwm = 0
        self._t0 = 0.0
        self._at: Point = (0.0, 0.0)

    def mark(self, time: float, at: Point, pwm: int) -> None:
        """From ``time`` (s) and ``at`` (mm) on the beam has ``pwm``, and may move otherwise."""
        if self.pwm and time > self._t0:
            self._close(time, at)
        self.pwm, self._t0, self._at = pwm, time, at

    def _close(self, time: float, at: Point) -> None:
        power, log = self.pwm / 255.0, self.segments
        here = BeamSegment(self._t0, time, *self._at, *at, power)
        if log and here.standing and _continues(log[-1], here):
            here = BeamSegment(log.pop().t0, time, *at, *at, power)
        log.append(here)


def _continues(before: BeamSegment, after: BeamSegment) -> bool:
    """Whether ``after`` is the same standing beam, cut in two by somebody's look at the log."""
    same_place = before.standing and (before.x1, before.y1) == (after.x0, after.y0)
    return same_place and before.t1 == after.t0 and before.power == after.power
