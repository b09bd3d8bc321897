"""The log of the virtual controller's beam, as its power changes."""

from __future__ import annotations

from miurafab.motion.beam import BeamSegment

Point = tuple[float, float]


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
