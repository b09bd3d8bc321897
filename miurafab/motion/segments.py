"""The segment generator: planned moves are divided into segments of constant speed, 10 ms each.

The controller follows the speed profile of a move in segments of 10 ms, each a whole number of
motor steps at one rate (``stepper.c``). A segment ends early at the end of its move, and lasts
longer if 10 ms would hold no step. Distances are not whole steps, so the time of a step begun is
carried into the next segment, and the sum is exact to one step. A short dash has one or two
segments, which determine its time.

Within a move the speed rises from ``speed`` to ``top`` until ``rise_end``, holds until
``fall_start``, and falls to ``exit`` at ``goal``. Distances are in mm, measured backwards from the
end of the move.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable

from miurafab.motion import cpu
from miurafab.motion.planner import Move, Planner, single

SEGMENT_TIME = single(1.0 / 6000.0)
"""Minutes."""
QUEUE = 5
"""The longest segment queue, including the running segment: 6 slots, one of them free."""
_MINUTE = 60 * cpu.CLOCK
_LEAST_STEPS = 1.25
_SLOWEST_PERIOD = 0xFFFF
_SMOOTHING = (2000, 4000, 8000)
"""From these cycles per step on, the stepper divides each step into 2, 4, 8 ticks (AMASS)."""
MICRO = 8
"""Micro-steps per step; progress within a move is counted in micro-steps."""

_LONG_HOLD, _HOLD_REST = 100 * SEGMENT_TIME, 20 * SEGMENT_TIME

RISE, HOLD, FALL, FALL_TO_TOP = range(4)


class Segment:
    """``ticks`` interrupts, ``period`` cycles apart, of ``stride`` micro-steps of ``move`` each;
    ``cycles`` in total.

    ``done`` is the progress before the segment in micro-steps; ``power`` its PWM value;
    ``follows`` whether the power follows the speed; ``tick`` the cycles of each interrupt.
    """

    __slots__ = (
        "cycles", "done", "follows", "move", "period", "power", "stride", "tick", "ticks",
    )  # fmt: skip

    def __init__(self, move: Move, done: int, power: int, follows: bool) -> None:
        self.move = move
        self.tick = cpu.STEP_TICK + cpu.STEP_AXIS * move.axes
        self.done = done
        self.power = power
        self.follows = follows
        self.ticks = self.period = self.cycles = 0
        self.stride = MICRO


class SegmentGenerator:
    """Divides the first planned move into segments, one per call of :meth:`next`.

    ``to_pwm`` converts an S value, or None for a spindle that is off, to the PWM value 0..255.
    ``cycles`` accumulates the processor's work. With ``whole_holds`` a long stretch at constant
    speed is one segment instead of many, so that a move of days costs no more to time than another.
    """

    def __init__(
        self,
        planner: Planner,
        to_pwm: Callable[[float | None], int],
        *,
        whole_holds: bool = False,
    ) -> None:
        self.planner = planner
        self.to_pwm = to_pwm
        self.whole_holds = whole_holds
        self.cycles = 0
        planner.on_replan = self.replan
        self.reset()

    def reset(self) -> None:
        """Drop the current move and clear all flags."""
        self.move: Move | None = None
        self.system_move: Move | None = None
        self.holding = False
        self.finished = False
        self.refresh_power = False
        self.speed = 0.0
        self._recalculate = False
        self._entry_forced = False
        self._ramp = RISE
        self._power = 0
        self._follows = False
        self._steps_left = 0
        self._done = 0
        self._late = 0.0
        self._steps_per_mm = 1.0
        self.exit = self.top = self.rise_end = self.fall_start = self.goal = 0.0

    def resume(self) -> None:
        """End a hold or a system motion; continue with the planner's moves."""
        self.holding = self.finished = False
        self.system_move = None

    def replan(self) -> None:
        """The current move has a new plan: compute its profile again from the present speed."""
        if self.move is not None:
            self._recalculate = True
            self.move.entry_sqr = self.speed * self.speed
            self.move = None

    def hold(self) -> None:
        """Brake to a stop from now on, regardless of the plan."""
        self.replan()
        self.holding = True
        self.refresh_power = False

    def next(self) -> Segment | None:
        """The next segment; None if no motion is left to prepare."""
        if self.finished:
            return None
        move = self.move or self._take_up()
        if move is None:
            return None
        segment = Segment(move, self._done, 0, self._follows)
        long = self._hold(move) if self.whole_holds and self._ramp == HOLD else None
        length, duration, rounds = long or self._travel(move)
        if self._follows or self.refresh_power:
            self._set_power(move)
        segment.power = self._power
        self.cycles += cpu.SEGMENT + rounds * cpu.ROUND
        if not self._cut(segment, length, duration):
            self.finished = True
            return None
        move.length = length
        if length == self.goal:
            if length > 0.0:
                self.finished = True
            else:
                self._end_move()
        return segment

    def _end_move(self) -> None:
        if self.system_move is not None:
            self.finished = True
            return
        self.move = None
        self.planner.discard()

    def _take_up(self) -> Move | None:
        planner = self.planner
        if self.system_move is not None:
            move: Move | None = self.system_move
        else:
            move = planner.moves[0] if planner.moves else None
        if move is None:
            return None
        self.move = move
        if self._recalculate:
            self._recalculate = self._entry_forced = False
        else:
            self._load(move)
        self._lay_profile(move)
        self.refresh_power = True
        return move

    def _load(self, move: Move) -> None:
        self.cycles += cpu.LOAD_BLOCK
        self._steps_left = move.events
        self._done = 0
        self._late = 0.0
        self._steps_per_mm = move.events / single(move.length)
        if self.holding or self._entry_forced:
            self.speed = self.exit
            move.entry_sqr = self.exit * self.exit
            self._entry_forced = False
        else:
            self.speed = single(math.sqrt(move.entry_sqr))
        self._follows = self.planner.parameters.laser and move.spindle == 4
        if self._follows:
            self.cycles += cpu.LOAD_RATE

    def _lay_profile(self, move: Move) -> None:
        """Choose one of the seven combinations of rise, hold and fall for the rest of the move."""
        self.cycles += cpu.PROFILE
        length, entry_sqr, twice = move.length, move.entry_sqr, 2.0 * move.acceleration
        per_speed_sqr = 0.5 / move.acceleration
        self.goal = 0.0
        if self.holding:
            self._ramp = FALL
            stop = length - per_speed_sqr * entry_sqr
            if stop < 0.0:
                self.exit = single(math.sqrt(max(entry_sqr - twice * length, 0.0)))
            else:
                self.goal, self.exit = stop, 0.0
            return
        exit_sqr = 0.0 if self.system_move is not None else self.planner.exit_sqr()
        nominal = self.planner.nominal_speed(move)
        nominal_sqr = nominal * nominal
        self.exit = single(math.sqrt(exit_sqr))
        self._ramp = RISE
        self.rise_end = length
        meeting = 0.5 * (length + per_speed_sqr * (entry_sqr - exit_sqr))
        if entry_sqr > nominal_sqr:
            self.rise_end = length - per_speed_sqr * (entry_sqr - nominal_sqr)
            if self.rise_end <= 0.0:
                self._ramp = FALL
                self.exit = single(math.sqrt(max(entry_sqr - twice * length, 0.0)))
                self._entry_forced = True
            else:
                self._ramp = FALL_TO_TOP
                self.fall_start = per_speed_sqr * (nominal_sqr - exit_sqr)
                self.top = nominal
        elif meeting <= 0.0:
            self.rise_end = 0.0
            self.fall_start = 0.0
            self.top = self.exit
        elif meeting >= length:
            self._ramp = FALL
        else:
            self.fall_start = per_speed_sqr * (nominal_sqr - exit_sqr)
            if self.fall_start >= meeting:
                self.rise_end = self.fall_start = meeting
                self.top = single(math.sqrt(twice * meeting + exit_sqr))
            else:
                self.top = nominal
                if entry_sqr == nominal_sqr:
                    self._ramp = HOLD
                else:
                    self.rise_end -= per_speed_sqr * (nominal_sqr - entry_sqr)

    def _hold(self, move: Move) -> tuple[float, float, int] | None:
        """Most of a long stretch at constant speed, as :meth:`_travel` gives a segment; else None.

        Its end is left to segments of the usual length: a line that comes may change its plan.
        """
        span = (move.length - self.fall_start) / self.top - _HOLD_REST
        if span < _LONG_HOLD:
            return None
        return move.length - self.top * span, span, 1

    def _travel(self, move: Move) -> tuple[float, float, int]:
        """Follow the profile for one segment: the length left, the time, the loop rounds."""
        length = move.length
        acceleration = move.acceleration
        enough = max(length - _LEAST_STEPS / self._steps_per_mm, 0.0)
        limit = span = SEGMENT_TIME
        duration = 0.0
        rounds = 0
        while True:
            rounds += 1
            change = acceleration * span
            if self._ramp == RISE:
                after = length - span * (self.speed + 0.5 * change)
                if after < self.rise_end:
                    after = self.rise_end
                    span = 2.0 * (move.length - after) / (self.speed + self.top)
                    self._ramp = FALL if after == self.fall_start else HOLD
                    self.speed = self.top
                    self.cycles += cpu.RAMP_END
                else:
                    self.speed += change
            elif self._ramp == HOLD:
                after = length - self.top * span
                if after < self.fall_start:
                    after = self.fall_start
                    span = (length - after) / self.top
                    self._ramp = FALL
                    self.cycles += cpu.RAMP_END
            elif self._ramp == FALL_TO_TOP:
                if self.speed - self.top <= change:
                    after = self.rise_end
                    span = 2.0 * (move.length - after) / (self.speed + self.top)
                    self._ramp = HOLD
                    self.speed = self.top
                    self.cycles += cpu.RAMP_END
                else:
                    after = length - span * (self.speed - 0.5 * change)
                    self.speed -= change
            else:
                after = length - span * (self.speed - 0.5 * change)
                if self.speed > change and after > self.goal:
                    self.speed -= change
                else:
                    after = self.goal
                    total = self.speed + self.exit
                    span = 2.0 * (length - after) / total if total else 0.0
                    self.speed = self.exit
                    self.cycles += cpu.RAMP_END
            length = after
            duration += span
            if duration < limit:
                span = limit - duration
            elif length > enough:
                limit += SEGMENT_TIME
                span = limit - duration
            else:
                break
            if length <= self.goal:
                break
        return length, duration, rounds

    def _set_power(self, move: Move) -> None:
        self.refresh_power = False
        if not move.spindle:
            self._power = self.to_pwm(None)
            return
        word = move.speed_word
        if self._follows:
            self.cycles += cpu.POWER
            word *= self.speed * (1.0 / move.rate) if move.rate else 0.0
        self._power = self.to_pwm(word)

    def _cut(self, segment: Segment, length: float, duration: float) -> bool:
        """Give ``segment`` its whole steps and their rate; False if a hold leaves no step."""
        left = self._steps_per_mm * length
        whole = math.ceil(left)
        steps = self._steps_left - whole
        if steps == 0 and self.holding:
            return False
        duration += self._late
        per_step = duration / ((self._steps_left - left) or 1.0)
        cycles = math.ceil(_MINUTE * per_step)
        level = bisect_right(_SMOOTHING, cycles)
        segment.ticks = steps << level
        segment.period = min(cycles >> level, _SLOWEST_PERIOD)
        segment.stride = MICRO >> level
        segment.cycles = segment.ticks * segment.period
        self._late = (whole - left) * per_step
        self._steps_left = whole
        self._done += steps * MICRO
        return True
