"""The motion and the beam of the Marlin in memory: planned moves, one after another, in time.

A move takes the time of its trapezoid between the speeds at its ends, as they are planned when it
begins. The first of several waits a moment for others to be planned behind it
(``BLOCK_DELAY_FOR_1ST_MOVE`` in MarlinFirmware/Marlin, ``planner.h``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from miurafab.motion.parameters import MotionParameters
from miurafab.motion.planner import Move, Planner
from miurafab.simulate.beam import BeamSegment

_FIRST_MOVE_S = 0.1


class Carriage:
    """What moves and burns; each method is given the time ``now`` in s, which never goes back.

    ``due`` is when the move in hand ends, or the first begins; infinite at rest. What was burnt is
    appended to ``log``.
    """

    def __init__(self, parameters: MotionParameters, log: list[BeamSegment]) -> None:
        self.planner = Planner(parameters)
        self.due = math.inf
        self._parameters = parameters
        self._log = log
        self._running: tuple[Move, float] | None = None  # and its begin
        self._standing: tuple[float, float] | None = None  # since when, power

    @property
    def burning(self) -> bool:
        """Whether the beam burns now."""
        moving = self._running is not None and self._running[0].speed_word > 0
        return moving or self._standing is not None

    def plan(self, now: float, target: Sequence[float], feed: float, power: float) -> None:
        """A line to ``target`` at ``feed`` mm/min with ``power`` (S). There must be room for it."""
        spindle = 3 if power > 0 else 0
        move = self.planner.append(target, feed, spindle=spindle, speed_word=power)
        if move is not None and self._running is None and math.isinf(self.due):
            self.due = now + _FIRST_MOVE_S

    def hurry(self, now: float) -> None:
        """Somebody waits for the end of all motion: begin at once."""
        if self._running is None and not math.isinf(self.due):
            self.due = min(self.due, now)

    def go_on(self, now: float) -> None:
        """At ``due``: the move in hand is done; the next begins."""
        if self._running is not None:
            self._note(now)
            self.planner.discard()
        self._running, self.due = None, math.inf
        if self.planner.moves:
            move = self.planner.moves[0]
            ends = math.sqrt(move.entry_sqr), math.sqrt(self.planner.exit_sqr())
            self.due = now + 60.0 * float(_minutes(move, *ends, self.planner.nominal_speed(move)))
            self._running = move, now

    def halt(self, now: float) -> list[float]:
        """Stop dead and forget what is planned; where it stands, in mm."""
        if self._running is not None:
            self._note(now)
        place = self.place(now)
        self.put(place)
        return place

    def put(self, place: Sequence[float]) -> None:
        """It stands at ``place`` (mm), whatever it did."""
        steps = self._parameters.steps_per_mm
        self.planner.reset([round(x * k) for x, k in zip(place, steps, strict=True)])
        self._running, self.due = None, math.inf

    def place(self, now: float) -> list[float]:
        """Where it is, in mm."""
        steps = self._parameters.steps_per_mm
        if self._running is None:
            return [n / k for n, k in zip(self.planner.position, steps, strict=True)]
        move, begin = self._running
        part = min(1.0, (now - begin) / (self.due - begin)) if self.due > begin else 1.0
        return [
            (start + part * way) / k
            for start, way, k in zip(move.origin, move.steps, steps, strict=True)
        ]

    def _note(self, now: float) -> None:
        """Log what the move in hand has burnt until now."""
        assert self._running is not None
        move, begin = self._running
        if move.speed_word > 0 and now > begin:
            (x0, y0, _), (x1, y1, _) = self.place(begin), self.place(now)
            power = move.speed_word / self._parameters.s_max
            self._log.append(BeamSegment(begin, now, x0, y0, x1, y1, power))

    def stand(self, now: float, power: float) -> None:
        """The beam is at ``power``, a fraction, from now on, whatever moves."""
        if self._standing is not None:
            x, y, _ = self.place(now)
            since, before = self._standing
            self._log.append(BeamSegment(since, now, x, y, x, y, before))
        self._standing = (now, power) if power > 0 else None


def _minutes(move: Move, entry: float, leave: float, nominal: float) -> float:
    """The time of a trapezoid: up from ``entry``, on at ``nominal``, down to ``leave`` (mm/min)."""
    acceleration, length = move.acceleration, move.length
    top = min(nominal, math.sqrt(acceleration * length + 0.5 * (entry**2 + leave**2)))
    top = max(top, entry, leave)
    ramps = (2 * top**2 - entry**2 - leave**2) / (2 * acceleration)
    return (2 * top - entry - leave) / acceleration + max(0.0, length - ramps) / top
