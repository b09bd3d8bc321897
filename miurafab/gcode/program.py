"""A G-code program as data: flat arrays of what the machine would do, line by line.

:func:`~miurafab.gcode.interpreter.parse_program` makes it.

Legend: n moves, e events, L lines sent; positions in mm in the frame of the first line (machine
position 0, no offsets), feeds in mm/min, power in S words, dwell in seconds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

RAPID, FEED = 0, 1
"""Values of :attr:`Program.motion`."""
BEAM_OFF, BEAM_M3, BEAM_M4 = 0, 3, 4
"""Values of :attr:`Program.spindle`."""
SYNC, DWELL, PAUSE, END = 0, 1, 2, 3
"""Values of :attr:`Program.event_kind`: the motion stops and (DWELL) waits, (PAUSE) waits for
somebody, (END) the program ends."""


@dataclass(frozen=True)
class Context:
    """What the comments before a move said: ``(sheet NAME)``, ``(patch LABEL)``,
    ``(operation NAME)``; each empty if never said.
    """

    sheet: str = ""
    patch: str = ""
    operation: str = ""


@dataclass(frozen=True, eq=False)
class Program:
    """What a job does.

    Per move, in order: ``start`` and ``end`` (n, 3) float64 mm; ``motion`` (n,) int8, RAPID or
    FEED; ``feed_mm_min`` (n,) float64, 0 for rapids; ``power`` (n,) float64, the S that the beam
    gets, 0 with the spindle off and for rapids in laser mode; ``spindle`` (n,) int8, BEAM_OFF,
    BEAM_M3 or BEAM_M4; ``line`` (n,) int32, 1-based in the file; ``context`` (n,) int32 into
    ``contexts``. Arcs are chords; a move that goes nowhere is left out, and each move starts where
    the one before it ends, so that both share one array.

    Per event: ``event_move`` (e,) int64, the number of moves made before it; ``event_kind`` (e,)
    int8; ``event_seconds`` (e,) float64; ``event_power`` (e,) float64, the S that burns from it
    on while nothing moves, NaN for as before; ``event_line`` (e,) int32.

    Per line sent: ``line_number``, ``line_bytes`` with the newline, ``line_words`` and
    ``line_points`` (decimal points), all (L,) int32. In all 50 bytes a move and 16 a line.
    """

    name: str
    start: NDArray[np.float64]
    end: NDArray[np.float64]
    motion: NDArray[np.int8]
    feed_mm_min: NDArray[np.float64]
    power: NDArray[np.float64]
    spindle: NDArray[np.int8]
    line: NDArray[np.int32]
    context: NDArray[np.int32]
    contexts: tuple[Context, ...]
    event_move: NDArray[np.int64]
    event_kind: NDArray[np.int8]
    event_seconds: NDArray[np.float64]
    event_power: NDArray[np.float64]
    event_line: NDArray[np.int32]
    line_number: NDArray[np.int32]
    line_bytes: NDArray[np.int32]
    line_words: NDArray[np.int32]
    line_points: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.motion)

    @property
    def beam_on(self) -> NDArray[np.bool_]:
        """(n,) whether a move burns."""
        return np.asarray(self.power > 0.0)

    @property
    def lengths(self) -> NDArray[np.float64]:
        """(n,) lengths of the moves in mm."""
        return np.asarray(np.linalg.norm(self.end - self.start, axis=1), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Strokes:
    """S polylines burnt, N points in all.

    ``points`` (N, 3) float64 mm; ``offsets`` (S + 1,) int64, stroke s being
    ``points[offsets[s]:offsets[s + 1]]``; ``first_move`` and ``last_move`` (S,) int64, its moves
    in the program, both included; ``context`` (S,) int32 into ``contexts``.
    """

    points: NDArray[np.float64]
    offsets: NDArray[np.int64]
    first_move: NDArray[np.int64]
    last_move: NDArray[np.int64]
    context: NDArray[np.int32]
    contexts: tuple[Context, ...]

    def __len__(self) -> int:
        return len(self.context)

    def stroke(self, index: int) -> NDArray[np.float64]:
        """(k, 3) points of one stroke."""
        return self.points[self.offsets[index] : self.offsets[index + 1]]


def strokes(program: Program) -> Strokes:
    """Consecutive moves with the beam on, joined while sheet, patch and operation stay.

    Moves that follow one another always meet, because a program leaves no gap between moves.
    """
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
    others = np.ones(len(points), dtype=bool)
    others[offsets[:-1]] = False
    points[others] = program.end[burns]
    return Strokes(points, offsets, first, last, program.context[first], program.contexts)
