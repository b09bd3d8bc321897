"""The timing of the stepper interrupt and of the main program that it slows down.

Times are in processor cycles. Segments run one after another. While a segment runs, each of its
ticks takes about 340 cycles from the main program, so work of w cycles lasts
w / (1 - tick / period). When the queue is empty, the interrupt stops the motors and holds them for
the idle lock time before it returns: the main program waits for that time at each stop
(``st_go_idle`` in ``stepper.c``).
"""

from __future__ import annotations

import math
from collections.abc import Callable

from miurafab.motion.planner import Move
from miurafab.motion.segments import MICRO, QUEUE, Segment

_LEAST_SHARE = 0.05
"""The fraction of the processor left to the main program at any step rate."""


class Stepper:
    """The running segments.

    ``queue`` holds them, the running segment first; it began at the cycle ``began``. After the last
    segment the stepper is ``settling`` until that cycle, then ``stopped`` until a caller clears the
    flag. ``on_segment`` is called at the begin of each segment, ``on_end`` at the end of the last,
    ``on_settled`` at the end of settling; each with its cycle. ``change`` is the cycle at which the
    running segment, or the settling, ends.
    """

    def __init__(self) -> None:
        self.idle_lock = 0
        self.on_segment: Callable[[int, Segment], None] = lambda _now, _segment: None
        self.on_end: Callable[[int], None] = lambda _now: None
        self.on_settled: Callable[[int], None] = lambda _now: None
        self.halt()

    def halt(self) -> None:
        """Stop at once and drop all segments."""
        self.queue: list[Segment] = []
        self.running = False
        self.settling: int | None = None
        self.stopped = False
        self.began = 0
        self.share = 1.0
        self.change: int | None = None

    @property
    def room(self) -> bool:
        """Whether the queue has room."""
        return len(self.queue) < QUEUE

    def wake(self, now: int) -> None:
        """Start stepping at ``now`` unless it already runs."""
        if not self.running:
            self.running, self.settling = True, None
            self._begin(now)

    def run_to(self, now: int) -> None:
        """Run the segments and the settling that end by ``now``."""
        while self.running:
            change = self.change
            assert change is not None
            if change > now:
                return
            del self.queue[0]
            self._begin(change)
        if self.settling is not None and self.settling <= now:
            settled, self.settling = self.settling, None
            self.share, self.change = 1.0, None
            self.stopped = True
            self.on_settled(settled)

    def _begin(self, now: int) -> None:
        if self.queue:
            segment = self.queue[0]
            self.began, self.change = now, now + segment.cycles
            share = 1.0 - segment.tick / (segment.period or 1)
            self.share = share if share > _LEAST_SHARE else _LEAST_SHARE
            self.on_segment(now, segment)
        else:
            self.running = False
            self.settling = self.change = now + self.idle_lock
            self.share = 0.0
            self.on_end(now)

    def progress(self, now: int) -> tuple[Move, int] | None:
        """The move in execution at ``now`` and its progress in micro-steps; None at rest."""
        if not self.running:
            return None
        segment = self.queue[0]
        ticks = min((now - self.began) // max(segment.period, 1) + 1, segment.ticks)
        return segment.move, segment.done + ticks * segment.stride


class Processor:
    """The work of the main program beside a :class:`Stepper`."""

    def __init__(self, stepper: Stepper) -> None:
        self.stepper = stepper
        self._left = 0.0
        self._since = 0

    def start(self, now: int, cycles: float) -> None:
        """Start work of ``cycles`` at ``now``."""
        self._left, self._since = cycles, now

    def finish(self) -> int | None:
        """The cycle of completion if the stepper does not change before; None while it waits."""
        share = self.stepper.share
        if share == 1.0:
            return self._since + math.ceil(self._left)
        return self._since + math.ceil(self._left / share) if share else None

    def note(self, now: int) -> None:
        """Account for the work done by ``now``; call it just before the stepper changes."""
        self._left = max(self._left - (now - self._since) * self.stepper.share, 0.0)
        self._since = now

    def run(self, now: int, cycles: float) -> int:
        """Do work of ``cycles`` from ``now`` while the stepper runs; returns the end."""
        stepper = self.stepper
        share = stepper.share
        if share:  # usually the stepper does not change meanwhile
            done_at = now + math.ceil(cycles / share)
            change = stepper.change
            if change is None or done_at < change:
                return done_at
        self.start(now, cycles)
        while True:
            done, change = self.finish(), stepper.change
            if change is None or (done is not None and done < change):
                assert done is not None  # only an interrupt takes all of the time
                return done
            self.note(change)
            stepper.run_to(change)


def steps_taken(move: Move, micro: int) -> tuple[int, ...]:
    """The motor position on ``move`` after ``micro`` micro-steps: Bresenham's line in closed form.

    Each axis adds its steps to a counter that starts at events/2, and makes a step when the counter
    passes events. So after m micro-steps it made ceil((events/2 + m steps / 8) / events) - 1 steps.
    """
    half = MICRO * move.events
    whole = 2 * half
    position = []
    for start, n in zip(move.origin, move.steps, strict=True):
        if n >= 0:
            position.append(start - (-(half + 2 * micro * n) // whole) - 1)
        else:
            position.append(start + (-(half - 2 * micro * n) // whole) + 1)
    return tuple(position)
