"""The look-ahead planner: the entry speed of each queued move (fifteen moves on GRBL).

At the corner of two moves with unit directions u and v the speed w is bounded by a circle that
misses the corner by the junction deviation d. With t the angle between -u and v,
w^2 = a d sin(t/2) / (1 - sin(t/2)) (``planner.c``; S. K. Jeon's cornering note of 2011). Below this
bound the entry speeds e_i obey, with a_i and l_i the accelerations and lengths of the moves,

    backward   e_i^2 <= e_{i+1}^2 + 2 a_i l_i      (each move can brake, the last one to a stop)
    forward    e_{i+1}^2 <= e_i^2 + 2 a_i l_i      (no move accelerates beyond its length)

Speeds before :attr:`Planner.planned` are final; a new move changes only the later ones.

All values have single precision, with the firmware's units and order of operations: the last bit
decides whether a hold that ends on a whole motor step takes one step more.

Legend: speeds in mm/min, ``_sqr`` their squares, accelerations in mm/min², lengths in mm, counts in
motor steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import cast

import numpy as np

from miurafab.motion import cpu
from miurafab.motion.parameters import MotionParameters

single = cast("Callable[[float], float]", np.float32)
"""Round to single precision; arithmetic with the result keeps it."""

_STRAIGHT = 0.999999
_PERCENT = single(0.01)
_UNLIMITED = 1e38
_MOST_STEPS = 2.0**31 - 1.0
_FARTHEST = 1e30
"""mm; farther targets do not fit into single precision."""
_SLOWEST = 1.0
"""mm/min; the lowest planned speed (``config.h``)."""
_LEAST_ACCELERATION = 3.6e-3
"""mm/min²; the firmware divides by a $120 of zero, this bound keeps the arithmetic finite."""


class Move:
    """One planned straight move.

    ``origin`` and signed ``steps`` per axis in motor steps, ``events`` the largest step count,
    ``axes`` how many axes move; ``length`` is the part not prepared yet; ``rate`` the programmed
    speed and ``rapid_rate`` the fastest in its direction; ``speed_word`` is its S and ``spindle``
    0, 3 or 4; ``steady`` moves ignore the feed override; ``tag`` belongs to the caller.
    """

    __slots__ = (
        "acceleration", "axes", "entry_sqr", "events", "junction_sqr", "length", "limit_sqr",
        "origin", "rapid", "rapid_rate", "rate", "speed_word", "spindle", "steady", "steps", "tag",
    )  # fmt: skip

    def __init__(self) -> None:
        self.origin: tuple[int, ...] = (0, 0, 0)
        self.steps: tuple[int, ...] = (0, 0, 0)
        self.events = self.axes = self.spindle = self.tag = 0
        self.length = self.acceleration = self.rate = self.rapid_rate = self.speed_word = 0.0
        self.entry_sqr = self.limit_sqr = self.junction_sqr = 0.0
        self.rapid = self.steady = False


class Planner:
    """The queue of planned moves and the speeds at their junctions.

    ``position`` is the end of the last move, in motor steps. ``on_replan`` is called when the move
    in execution gets a new exit speed. ``cycles`` accumulates the processor's work.
    """

    def __init__(self, parameters: MotionParameters) -> None:
        self.configure(parameters)
        self.on_replan: Callable[[], None] = lambda: None
        self.feed_override = 100
        self.rapid_override = 100
        self.cycles = 0
        self.reset((0, 0, 0))

    def configure(self, parameters: MotionParameters) -> None:
        """Apply other settings to later moves."""
        self.parameters = parameters
        self._steps_per_mm = tuple(map(single, parameters.steps_per_mm))
        self._max_rate = tuple(map(single, parameters.max_rate_mm_min))
        self._acceleration = tuple(single(a) * 60 * 60 for a in parameters.acceleration)
        self._deviation = single(parameters.junction_deviation)

    def reset(self, position: Sequence[int]) -> None:
        """Drop all moves and set ``position`` (motor steps)."""
        self.moves: list[Move] = []
        self.planned = 0
        self.position: tuple[int, ...] = tuple(position)
        self._direction = (0.0, 0.0, 0.0)
        self._last_nominal = 0.0

    @property
    def full(self) -> bool:
        """Whether the queue has no room."""
        return len(self.moves) >= self.parameters.planner_blocks

    def nominal_speed(self, move: Move) -> float:
        """The programmed speed of ``move`` under the overrides."""
        speed = move.rate
        if move.rapid:
            speed *= _PERCENT * self.rapid_override
        else:
            if not move.steady:
                speed *= _PERCENT * self.feed_override
            speed = min(speed, move.rapid_rate)
        return max(speed, _SLOWEST)

    def make(
        self,
        target: Sequence[float],
        feed: float,
        *,
        rapid: bool = False,
        inverse_time: bool = False,
        steady: bool = False,
        origin: Sequence[int] | None = None,
    ) -> tuple[Move, tuple[float, float, float], tuple[int, ...]] | None:
        """A move to ``target`` (mm) at ``feed`` (mm/min, or 1/min), its direction and its end.

        None if it is shorter than half a motor step. System motion gives an ``origin`` other than
        :attr:`position`.
        """
        start = self.position if origin is None else tuple(origin)
        kx, ky, kz = self._steps_per_mm
        x0, y0, z0 = start
        x1 = to_steps(target[0], kx) if kx else x0
        y1 = to_steps(target[1], ky) if ky else y0
        z1 = to_steps(target[2], kz) if kz else z0
        end = (x1, y1, z1)
        steps = (x1 - x0, y1 - y0, z1 - z0)
        axes = 3 - steps.count(0)
        self.cycles += cpu.PLAN_LINE + cpu.PLAN_AXIS * axes
        events = max(map(abs, steps))
        if events == 0:
            return None
        x = steps[0] / kx if kx else 0.0
        y = steps[1] / ky if ky else 0.0
        z = steps[2] / kz if kz else 0.0
        length = single(math.sqrt(x * x + y * y + z * z))
        inverse = 1.0 / length
        direction = (x * inverse, y * inverse, z * inverse)
        move = Move()
        move.origin, move.steps, move.events, move.axes = start, steps, events, axes
        move.length = length
        move.acceleration = max(along(self._acceleration, direction), _LEAST_ACCELERATION)
        move.rapid_rate = along(self._max_rate, direction)
        move.rapid, move.steady = rapid, steady
        feed = single(feed)
        move.rate = move.rapid_rate if rapid else feed * length if inverse_time else feed
        return move, direction, end

    def append(
        self,
        target: Sequence[float],
        feed: float,
        *,
        rapid: bool = False,
        inverse_time: bool = False,
        steady: bool = False,
        spindle: int = 0,
        speed_word: float = 0.0,
        tag: int = 0,
    ) -> Move | None:
        """Plan a line to ``target`` (mm) at ``feed`` (mm/min, or 1/min with ``inverse_time``).

        Returns None if it is shorter than half a motor step. The queue must have room.
        """
        planned = self.make(target, feed, rapid=rapid, inverse_time=inverse_time, steady=steady)
        if planned is None:
            return None
        move, direction, end = planned
        move.spindle, move.speed_word, move.tag = spindle, speed_word, tag
        if self.moves:
            move.junction_sqr = self._junction_sqr(direction)
        nominal = self.nominal_speed(move)
        self._limit(move, nominal, self._last_nominal)
        self._last_nominal = nominal
        self._direction = direction
        self.position = end
        self.moves.append(move)
        self._plan()
        return move

    def discard(self) -> None:
        """Remove the first move, which is fully prepared, from the queue."""
        del self.moves[0]
        if self.planned:
            self.planned -= 1

    def restart(self) -> None:
        """Replan all moves from the present speed of the first (after a stop or an override)."""
        self.on_replan()
        self.planned = 0
        self._plan()

    def override(self, feed: int, rapid: int) -> None:
        """Apply new overrides in percent to all moves, and replan."""
        self.feed_override, self.rapid_override = feed, rapid
        last = _UNLIMITED
        for move in self.moves:
            nominal = self.nominal_speed(move)
            self._limit(move, nominal, last)
            last = nominal
        self._last_nominal = last
        self.restart()

    def exit_sqr(self) -> float:
        """The squared speed at the end of the first move."""
        return self.moves[1].entry_sqr if len(self.moves) > 1 else 0.0

    @staticmethod
    def _limit(move: Move, nominal: float, before: float) -> None:
        slower = min(nominal, before)
        move.limit_sqr = min(slower * slower, move.junction_sqr)

    def _junction_sqr(self, direction: tuple[float, float, float]) -> float:
        ux, uy, uz = self._direction
        vx, vy, vz = direction
        cosine = -(ux * vx + uy * vy + uz * vz)
        if cosine > _STRAIGHT:
            return 0.0
        if cosine < -_STRAIGHT:
            return _UNLIMITED
        x, y, z = vx - ux, vy - uy, vz - uz
        self.cycles += cpu.PLAN_CORNER + cpu.PLAN_CORNER_AXIS * ((x != 0) + (y != 0) + (z != 0))
        inverse = 1.0 / single(math.sqrt(x * x + y * y + z * z))
        acceleration = along(self._acceleration, (x * inverse, y * inverse, z * inverse))
        half_sine = single(math.sqrt(0.5 * (1.0 - cosine)))
        return max(0.0, acceleration * self._deviation * half_sine / (1.0 - half_sine))

    def _plan(self) -> None:
        moves, planned = self.moves, self.planned
        last = len(moves) - 1
        if last <= planned:
            return
        move = moves[last]
        move.entry_sqr = exit_sqr = min(move.limit_sqr, 2.0 * move.acceleration * move.length)
        if planned == 0:
            self.on_replan()
        for index in range(last - 1, planned, -1):
            move = moves[index]
            if move.entry_sqr != move.limit_sqr:
                reach = exit_sqr + 2.0 * move.acceleration * move.length
                move.entry_sqr = min(reach, move.limit_sqr)
            exit_sqr = move.entry_sqr
        rising = 0
        move = moves[planned]
        for index in range(planned + 1, last + 1):
            after = moves[index]
            if move.entry_sqr < after.entry_sqr:
                rising += 1
                reach = move.entry_sqr + 2.0 * move.acceleration * move.length
                if reach < after.entry_sqr:
                    after.entry_sqr = reach
                    self.planned = index
            if after.entry_sqr == after.limit_sqr:
                self.planned = index
            move = after
        self.cycles += (
            cpu.PLAN_NEWEST + (last - planned - 1) * cpu.PLAN_BLOCK + rising * cpu.PLAN_RISING
        )


def to_steps(value: float, steps_per_mm: float) -> int:
    """``value`` mm in motor steps, rounded half away from zero, clipped to 32 bits; NaN gives 0."""
    steps = float(single(min(max(value, -_FARTHEST), _FARTHEST)) * steps_per_mm)
    if not -_MOST_STEPS <= steps <= _MOST_STEPS:
        return 0 if steps != steps else int(math.copysign(_MOST_STEPS, steps))
    return int(steps + 0.5) if steps >= 0.0 else -int(0.5 - steps)


def along(limits: Sequence[float], direction: Sequence[float]) -> float:
    """The largest value along ``direction`` that keeps each axis within its limit."""
    most = math.inf
    for limit, part in zip(limits, direction, strict=True):
        if part and (own := limit / abs(part)) < most:
            most = own
    return most
