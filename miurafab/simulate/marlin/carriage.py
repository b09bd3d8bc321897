"""The motion and the beam of the simulated Marlin controller.

A move takes the time of its speed trapezoid, with the end speeds that are planned when it begins.
The first move waits a moment so that others can be planned behind it
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
    """The moving beam. Each method takes the time ``now`` in s, which never goes back.

    ``due`` is the end of the current move, or the begin of the first; infinite at rest. Burnt
    segments are appended to ``log``.
    """

    def __init__(self, parameters: MotionParameters, log: list[BeamSegment]) -> None:
        self.planner = Planner(parameters)
        self.due = math.inf
        self._parameters = parameters
        self._log = log
        self._running: tuple[Move, float] | None = None  # the move and its begin
        self._standing: tuple[float, float] | None = None  # the begin and the power

    @property
    def burning(self) -> bool:
        """Whether the beam is on."""
        moving = self._running is not None and self._running[0].speed_word > 0
        return moving or self._standing is not None

    def plan(self, now: float, target: Sequence[float], feed: float, power: float) -> None:
        """Plan a move to ``target`` at ``feed`` mm/min with ``power`` (S). It needs room."""
        spindle = 3 if power > 0 else 0
        move = self.planner.append(target, feed, spindle=spindle, speed_word=power)
        if move is not None and self._running is None and math.isinf(self.due):
            self.due = now + _FIRST_MOVE_S

    def hurry(self, now: float) -> None:
        """Begin at once, because a command waits for the end of all motion."""
        if self._running is None and not math.isinf(self.due):
            self.due = min(self.due, now)

    def go_on(self, now: float) -> None:
        """At ``due``: end the current move and begin the next."""
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
        """Stop at once and drop all planned moves; returns the position in mm."""
        if self._running is not None:
            self._note(now)
        place = self.place(now)
        self.put(place)
        return place

    def put(self, place: Sequence[float]) -> None:
        """Set the position to ``place`` (mm), at rest."""
        steps = self._parameters.steps_per_mm
        self.planner.reset([round(x * k) for x, k in zip(place, steps, strict=True)])
        self._running, self.due = None, math.inf

    def place(self, now: float) -> list[float]:
        """The position in mm."""
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
        """Log the part of the current move burnt up to ``now``."""
        assert self._running is not None
        move, begin = self._running
        if move.speed_word > 0 and now > begin:
            (x0, y0, _), (x1, y1, _) = self.place(begin), self.place(now)
            power = move.speed_word / self._parameters.s_max
            self._log.append(BeamSegment(begin, now, x0, y0, x1, y1, power))

    def stand(self, now: float, power: float) -> None:
        """Set the beam to ``power``, a fraction, from ``now`` on, independent of moves."""
        if self._standing is not None:
            x, y, _ = self.place(now)
            since, before = self._standing
            self._log.append(BeamSegment(since, now, x, y, x, y, before))
        self._standing = (now, power) if power > 0 else None


def _minutes(move: Move, entry: float, leave: float, nominal: float) -> float:
    """The minutes of a trapezoid from ``entry`` over ``nominal`` to ``leave`` (mm/min)."""
    acceleration, length = move.acceleration, move.length
    top = min(nominal, math.sqrt(acceleration * length + 0.5 * (entry**2 + leave**2)))
    top = max(top, entry, leave)
    ramps = (2 * top**2 - entry**2 - leave**2) / (2 * acceleration)
    return (2 * top - entry - leave) / acceleration + max(0.0, length - ramps) / top
