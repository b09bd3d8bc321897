"""A program as flat arrays: the moves, the events and the lines sent.

:func:`~miurafab.gcode.interpreter.parse_program` makes it from G-code,
:func:`~miurafab.gcode.hpgl_reader.parse_hpgl` from HPGL.

Legend: n moves, e events, L lines sent; positions in mm in the frame of the first line (machine
position 0, no offsets), feeds in mm/min, power in S words, dwell in seconds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from miurafab.gcode.columns import Columns
from miurafab.geometry.arrays import Bools, Floats, Ints

RAPID, FEED = 0, 1
"""Values of :attr:`Program.motion`."""
BEAM_OFF, BEAM_M3, BEAM_M4 = 0, 3, 4
"""Values of :attr:`Program.spindle`."""
SYNC, DWELL, PAUSE, END = 0, 1, 2, 3
"""Values of :attr:`Program.event_kind`. The motion stops at each event; DWELL waits, PAUSE waits
for a person, END ends the program."""


@dataclass(frozen=True)
class Context:
    """The last comments ``(sheet NAME)``, ``(patch LABEL)`` and ``(operation NAME)`` before a move;
    empty where there was none.
    """

    sheet: str = ""
    patch: str = ""
    operation: str = ""


@dataclass(frozen=True, eq=False)
class Program:
    """The actions of a job.

    Per move, in order: ``start`` and ``end`` (n, 3) float64 mm; ``motion`` (n,) int8, RAPID or
    FEED; ``feed_mm_min`` (n,) float64, 0 for rapids; ``power`` (n,) float64, the S of the beam, 0
    with the spindle off and for rapids in laser mode; ``spindle`` (n,) int8, BEAM_OFF, BEAM_M3 or
    BEAM_M4; ``line`` (n,) int32, 1-based in the file; ``context`` (n,) int32 into ``contexts``.
    Arcs are chords. A move of length 0 is left out. Each move starts at the end of the move before,
    so ``start`` and ``end`` share one array.

    Per event: ``event_move`` (e,) int64, the number of moves before it; ``event_kind`` (e,) int8;
    ``event_seconds`` (e,) float64; ``event_power`` (e,) float64, the S of the standing beam after
    the event, NaN if unchanged; ``event_line`` (e,) int32.

    Per line sent: ``line_number``, ``line_bytes`` with the newline, ``line_words`` and
    ``line_points`` (decimal points), all (L,) int32. A move takes 50 bytes, a line 16.
    """

    name: str
    start: Floats
    end: Floats
    motion: NDArray[np.int8]
    feed_mm_min: Floats
    power: Floats
    spindle: NDArray[np.int8]
    line: NDArray[np.int32]
    context: NDArray[np.int32]
    contexts: tuple[Context, ...]
    event_move: Ints
    event_kind: NDArray[np.int8]
    event_seconds: Floats
    event_power: Floats
    event_line: NDArray[np.int32]
    line_number: NDArray[np.int32]
    line_bytes: NDArray[np.int32]
    line_words: NDArray[np.int32]
    line_points: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.motion)

    @property
    def beam_on(self) -> Bools:
        """(n,) whether a move burns."""
        return np.asarray(self.power > 0.0)

    @property
    def lengths(self) -> Floats:
        """(n,) lengths of the moves in mm."""
        return np.asarray(np.linalg.norm(self.end - self.start, axis=1), dtype=np.float64)


class ProgramBuilder:
    """The growing tables of a program; the columns are in the order of the ``add`` calls.

    ``moves``: x, y, z, motion, feed, power, spindle, line, context. ``events``: move, kind,
    seconds, power, line. ``sent``: number, bytes, words, points.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.moves = Columns("f8", "f8", "f8", "i1", "f8", "f8", "i1", "i4", "i4")
        self.events = Columns("i8", "i1", "f8", "f8", "i4")
        self.sent = Columns("i4", "i4", "i4", "i4")
        self._contexts: dict[Context, int] = {Context(): 0}

    def number_of(self, context: Context) -> int:
        """The number by which a move names ``context``."""
        return self._contexts.setdefault(context, len(self._contexts))

    def program(self) -> Program:
        """The finished program; call it once."""
        moves, events, sent = self.moves, self.events, self.sent
        places = np.zeros((len(moves) + 1, 3))
        for axis in range(3):
            places[1:, axis] = moves.take(axis)
        return Program(
            name=self.name,
            start=places[:-1],
            end=places[1:],
            motion=moves.take(3),
            feed_mm_min=moves.take(4),
            power=moves.take(5),
            spindle=moves.take(6),
            line=moves.take(7),
            context=moves.take(8),
            contexts=tuple(self._contexts),
            event_move=events.take(0),
            event_kind=events.take(1),
            event_seconds=events.take(2),
            event_power=events.take(3),
            event_line=events.take(4),
            line_number=sent.take(0),
            line_bytes=sent.take(1),
            line_words=sent.take(2),
            line_points=sent.take(3),
        )


@dataclass(frozen=True, eq=False)
class Strokes:
    """The burnt polylines: S strokes with N points in total.

    ``points`` (N, 3) float64 mm; ``offsets`` (S + 1,) int64: stroke s is
    ``points[offsets[s]:offsets[s + 1]]``; ``first_move`` and ``last_move`` (S,) int64, the first
    and last move of a stroke in the program; ``context`` (S,) int32 into ``contexts``.
    """

    points: Floats
    offsets: Ints
    first_move: Ints
    last_move: Ints
    context: NDArray[np.int32]
    contexts: tuple[Context, ...]

    def __len__(self) -> int:
        return len(self.context)

    def stroke(self, index: int) -> Floats:
        """(k, 3) the points of stroke ``index``."""
        return self.points[self.offsets[index] : self.offsets[index + 1]]


def strokes(program: Program) -> Strokes:
    """Join consecutive moves with the beam on while sheet, patch and operation stay the same."""
    burns = np.flatnonzero(program.beam_on)
    if not len(burns):
        nothing = np.zeros(0, dtype=np.int64)
        return Strokes(
            np.zeros((0, 3)), np.zeros(1, dtype=np.int64), nothing, nothing,
            program.context[:0], program.contexts,
        )  # fmt: skip
    joined = (np.diff(burns) == 1) & (np.diff(program.context[burns]) == 0)
    first = burns[np.concatenate([[True], ~joined])]
    last = burns[np.concatenate([~joined, [True]])]
    counts = last - first + 2
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    points = np.empty((int(offsets[-1]), 3))
    points[offsets[:-1]] = program.start[first]
    later = np.ones(len(points), dtype=bool)
    later[offsets[:-1]] = False
    points[later] = program.end[burns]
    return Strokes(points, offsets, first, last, program.context[first], program.contexts)
