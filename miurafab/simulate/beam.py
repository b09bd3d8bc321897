"""The beam log of a simulator: what it burnt or drew, as segments in time and space.

Tests compare a job with this log instead of trusting the sender. A lowered pen or blade counts as a
beam.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class BeamSegment:
    """The beam was on from ``t0`` to ``t1`` (s of virtual time) at ``power``, a fraction of full,
    and moved uniformly from (``x0``, ``y0``) to (``x1``, ``y1``) in machine mm.
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
        """Whether the beam did not move."""
        return self.x0 == self.x1 and self.y0 == self.y1


def standing_seconds(log: Iterable[BeamSegment]) -> float:
    """The total time in which the beam was on and did not move."""
    return sum(segment.t1 - segment.t0 for segment in log if segment.standing)


class BeamLog:
    """Ends a segment and starts the next at each change; ``pwm`` is 0..255."""

    def __init__(self) -> None:
        self.segments: list[BeamSegment] = []
        self.pwm = 0
        self._t0 = 0.0
        self._at: Point = (0.0, 0.0)

    def mark(self, time: float, at: Point, pwm: int) -> None:
        """From ``time`` (s) and ``at`` (mm) on the beam has ``pwm``; its speed may change too."""
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
    """Whether ``after`` continues the standing beam ``before``, split by a read of the log."""
    same_place = before.standing and (before.x1, before.y1) == (after.x0, after.y0)
    return same_place and before.t1 == after.t0 and before.power == after.power
