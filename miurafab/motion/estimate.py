"""The time estimate of a program: the firmware's main loop, run without the bytes.

The planner, segment generator and stepper of the simulator are driven line by line. A line arrives
when the wire and the receive buffer allow it and is parsed; its moves are planned when there is
room; segments are prepared when the main program gets to them; a synchronisation waits for all
motion to end. So the estimate includes what makes short dashes slow: the processor, the wire and
each stop.
"""

from __future__ import annotations

import math
from array import array
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from miurafab.gcode.program import DWELL, RAPID, Program
from miurafab.geometry.arrays import Floats
from miurafab.motion import cpu
from miurafab.motion.parameters import Link, MotionParameters
from miurafab.motion.planner import Planner
from miurafab.motion.segments import QUEUE, Segment, SegmentGenerator
from miurafab.motion.stepper import Processor, Stepper

_OK_BYTES = 4
_FOREVER = 1 << 62
_LEAST_FEED = 1.0  # mm/min (``MINIMUM_FEED_RATE`` of ``config.h``)
TOLD = 1000
"""The moves (0.04 s of processor time) after which the share that is done is told."""
_LONGEST_MOVE = 72_000.0
"""Seconds. In a longer move the way of one segment is below the last digit of the length left, a
32-bit float (2^23 segments of 10 ms are 84,000 s): the firmware would never arrive. It is timed by
length over feed, as is a job of days, which is a slip of the decimal point."""
_LONGEST_JOB = 1e6
_BLOCK = 4096  # lines held as Python objects at a time


@dataclass(frozen=True, eq=False)
class Estimate:
    """``seconds`` from the first step (or dwell) to the end of the last move or dwell;
    ``beam_on_seconds`` of them with the beam on, moving or standing; ``start`` and ``end`` (n,)
    float64, the times of each move in s since the first step.
    """

    seconds: float
    beam_on_seconds: float
    start: Floats
    end: Floats


def estimate(
    program: Program,
    parameters: MotionParameters,
    link: Link | None = None,
    on_share: Callable[[float], None] | None = None,
) -> Estimate:
    """Estimate the time of ``program`` on a machine with ``parameters`` behind ``link``.

    ``link`` None is the usual link of GRBL: 115200 baud, 1 ms, 128 bytes. ``on_share`` gets the
    share that is done, every :data:`TOLD` moves.
    """
    plain = _plain_seconds(program, parameters)
    if plain.max(initial=0.0) > _LONGEST_MOVE or plain.sum() > _LONGEST_JOB:
        return _plain(program, plain)
    run = _Run(program, parameters, link or Link())
    run.lines(on_share)
    return run.result()


def _plain_seconds(program: Program, parameters: MotionParameters) -> Floats:
    """(n,) the length of each move over its feed, without acceleration."""
    fastest = min(parameters.max_rate_mm_min[:2])
    feed = np.where(program.motion == RAPID, fastest, program.feed_mm_min)
    seconds: Floats = 60.0 * program.lengths / np.clip(feed, _LEAST_FEED, max(fastest, _LEAST_FEED))
    return seconds


def _plain(program: Program, seconds: Floats) -> Estimate:
    end = np.cumsum(seconds)
    burning = float(seconds[program.beam_on].sum())
    return Estimate(float(end[-1]), burning, end - seconds, end)


class _Wire:
    """The arrival times of the lines under character counting; without a buffer, one by one."""

    def __init__(self, link: Link) -> None:
        self.byte = 10.0 * cpu.CLOCK / link.baud
        self.latency = link.latency * cpu.CLOCK
        self.room = link.rx_bytes
        self.overhead = link.line_overhead
        self.unanswered: deque[tuple[int, float]] = deque()
        self.free = 0.0
        self.out_free = 0.0

    def arrival(self, size: int) -> int:
        """The cycle at which the last byte of the next line, of ``size`` bytes, arrives."""
        start = self.free
        while self.room < size and self.unanswered:
            freed, seen = self.unanswered.popleft()
            self.room += freed
            start = max(start, seen)
        self.room -= size
        self.free = start + (size + self.overhead) * self.byte
        return math.ceil(self.free)

    def answer(self, now: int, size: int) -> None:
        """The controller answers a line of ``size`` bytes at ``now``."""
        self.out_free = max(self.out_free, now) + _OK_BYTES * self.byte
        self.unanswered.append((size, self.out_free + self.latency))


class _Run:
    def __init__(self, program: Program, parameters: MotionParameters, link: Link) -> None:
        self.program = program
        self.laser = parameters.laser
        self.slow = parameters.slow_processor
        self.planner = Planner(parameters)
        self.planner.position = tuple(
            round(x * k)
            for x, k in zip(
                program.start[0] if len(program) else (0.0, 0.0, 0.0),
                parameters.steps_per_mm,
                strict=True,
            )
        )
        self.generator = SegmentGenerator(self.planner, _burns, whole_holds=True)
        self.stepper = Stepper()
        self.stepper.idle_lock = round((parameters.idle_lock or 0.0) * cpu.CLOCK)
        self.stepper.on_segment = self._segment
        self.stepper.on_settled = self._settled
        self.processor = Processor(self.stepper)
        self.wire = _Wire(link)
        self.now = 0
        self.cycling = False
        self.began = array("q", [-1]) * len(program)
        self.ended = array("q", [-1]) * len(program)
        self.moving = -1
        self.follows = False
        self.burning = False
        self.burning_since = 0
        self.burnt = 0
        self.first: int | None = None
        self.last_end = 0

    def lines(self, on_share: Callable[[float], None] | None) -> None:
        done, told = 0, 0
        for line in _lines(self.program):
            done += len(line.actions)
            if on_share is not None and done >= told:
                on_share(min(1.0, done / len(self.program)))
                told = done + TOLD
            self._receive(line.size)
            reading = cpu.words_cost(line.words, line.size - 1, line.points)
            self._work(cpu.LINE_FIXED + reading)
            chord = cpu.ARC_CHORD if len(line.actions) > 1 else 0
            self._work(cpu.ARC_SETUP if chord else 0)
            for action in line.actions:
                if len(action) == 3:
                    self._event(*action)
                else:
                    self._work(chord)
                    self._line(*action)
            self._work(_OK_BYTES * cpu.ANSWER_BYTE)
            self.wire.answer(self.now, line.size)
        self._synchronize()

    def _receive(self, size: int) -> None:
        arrival = self.wire.arrival(size)
        # The last byte may arrive while the bytes before it are read.
        if arrival <= self.now + (size - 1) * cpu.CHARACTER:
            self._work(size * cpu.CHARACTER)
            return
        while True:
            self._start()
            self._realtime()
            if arrival <= self.now:
                break
            self._wait(arrival)
        self._work(cpu.CHARACTER)

    def _line(
        self, end: list[float], feed: float, rapid: bool, spindle: int, power: float, tag: int
    ) -> None:
        while True:
            self._realtime()
            if not self.planner.full:
                break
            self._start()
            self._realtime()
            if self.planner.full:
                self._wait(_FOREVER)
        move = self.planner.append(
            end, feed, rapid=rapid, spindle=spindle, speed_word=power, tag=tag
        )
        self._work(0)
        if move is None and self.laser and spindle == 3:
            self._synchronize()
            self._beam(self.now, power > 0.0)

    def _event(self, kind: int, seconds: float, power: float) -> None:
        self._synchronize()
        if kind == DWELL:
            if self.first is None:
                self.first = self.now
            self.now = self.processor.run(self.now, cpu.dwell_steps(seconds) * cpu.DWELL_STEP)
            self.last_end = self.now
        if power == power:
            self._beam(self.now, power > 0.0)

    def _synchronize(self) -> None:
        self._start()
        while True:
            self._realtime()
            if not self.planner.moves and not self.cycling:
                return
            self._start()
            self._wait(_FOREVER)

    def _start(self) -> None:
        if not self.cycling and self.planner.moves:
            self.cycling = True
            self._prepare()
            self.stepper.wake(self.now)

    def _realtime(self) -> None:
        if self.stepper.stopped:
            self.stepper.stopped = False
            self.cycling = False
        elif self.cycling and len(self.stepper.queue) < QUEUE:
            self._prepare()

    def _prepare(self) -> None:
        queue, generator = self.stepper.queue, self.generator
        while len(queue) < QUEUE:
            segment = generator.next()
            if segment is None:
                return
            self._work(0)
            queue.append(segment)

    def _wait(self, until: int) -> None:
        change = self.stepper.change
        if change is not None and change <= until:
            if change > self.now:
                self.now = change
            self.stepper.run_to(self.now)
        elif self.now < until < _FOREVER:
            self.now = until

    def _work(self, cycles: int) -> None:
        """Do ``cycles`` of work, and the pending work of planner and generator."""
        planner, generator = self.planner, self.generator
        cycles += planner.cycles + generator.cycles
        planner.cycles = generator.cycles = 0
        if cycles and self.slow:
            self.now = self.processor.run(self.now, cycles)

    def _segment(self, now: int, segment: Segment) -> None:
        if self.first is None:
            self.first = now
        tag = segment.move.tag
        if tag != self.moving:
            self.moving = tag
            self.began[tag] = now
        self.ended[tag] = self.last_end = now + segment.cycles
        self.follows = segment.follows
        burning = segment.power > 0
        if burning != self.burning:
            self._beam(now, burning)

    def _settled(self, now: int) -> None:
        """At rest the beam of M4 goes off; the constant power of M3 stays on."""
        if self.follows:
            self._beam(now, False)

    def _beam(self, now: int, burning: bool) -> None:
        if burning and not self.burning:
            self.burning_since = now
        elif self.burning and not burning:
            self.burnt += now - self.burning_since
        self.burning = burning

    def result(self) -> Estimate:
        self._beam(self.now, False)
        start = np.array(self.began, dtype=np.float64)
        end = np.array(self.ended, dtype=np.float64)
        made = start >= 0.0
        first = float(self.first or 0)
        # A move shorter than a motor step takes no time and happens at the end of the move before.
        before = np.maximum.accumulate(np.where(made, end, first))
        start = np.where(made, start, before)
        end = np.where(made, end, before)
        return Estimate(
            seconds=(self.last_end - first) / cpu.CLOCK,
            beam_on_seconds=self.burnt / cpu.CLOCK,
            start=(start - first) / cpu.CLOCK,
            end=(end - first) / cpu.CLOCK,
        )


def _burns(word: float | None) -> int:
    return 1 if word else 0


_Move = tuple[list[float], float, bool, int, float, int]
_Event = tuple[int, float, float]


class _Sent(NamedTuple):
    """A line sent: its bytes, words and decimal points, and its actions in order."""

    size: int
    words: int
    points: int
    actions: Sequence[_Move | _Event]


def _lines(program: Program) -> Iterator[_Sent]:
    """Yield the lines of ``program``, read from its arrays in blocks."""
    for first in range(0, len(program.line_number), _BLOCK):
        block = slice(first, first + _BLOCK)
        numbers = program.line_number[block]
        span = numbers[0], numbers[-1] + 1
        begin, stop = np.searchsorted(program.line, span).tolist()
        here = slice(begin, stop)
        moves: list[_Move] = _rows(
            program.end[here],
            program.feed_mm_min[here],
            program.motion[here] == RAPID,
            program.spindle[here],
            program.power[here],
            np.arange(begin, stop),
        )
        move_bounds = [*np.searchsorted(program.line[here], numbers).tolist(), len(moves)]
        at = slice(*np.searchsorted(program.event_line, span).tolist())
        events: list[_Event] = _rows(
            program.event_kind[at], program.event_seconds[at], program.event_power[at]
        )
        event_bounds = [*np.searchsorted(program.event_line[at], numbers).tolist(), len(events)]
        places = (program.event_move[at] - begin).tolist()
        sizes = _rows(
            program.line_bytes[block], program.line_words[block], program.line_points[block]
        )
        for index, (size, words, points) in enumerate(sizes):
            first_move, end = move_bounds[index], move_bounds[index + 1]
            actions: list[_Move | _Event] = []
            for event in range(event_bounds[index], event_bounds[index + 1]):
                actions += moves[first_move : places[event]]
                actions.append(events[event])
                first_move = max(first_move, places[event])
            yield _Sent(size, words, points, [*actions, *moves[first_move:end]])


def _rows(*columns: NDArray[Any]) -> list[Any]:
    """The rows of a table of ``columns``, as tuples of Python numbers."""
    return list(zip(*(column.tolist() for column in columns), strict=True))
