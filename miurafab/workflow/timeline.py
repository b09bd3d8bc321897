"""The progress of a running job in strokes and time left, from its dry run.

An acknowledged move is planned, not made: the machine is behind by up to the moves of its planner.
The reported position tells which of these moves it makes, and how much of it is done. The time left
is the rest of the dry run, at the overridden feed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from miurafab.gcode.program import strokes
from miurafab.geometry.arrays import Floats
from miurafab.machine.progress import Progress
from miurafab.workflow.dry_run import SheetPreview


@dataclass(frozen=True, slots=True)
class SheetProgress:
    """Where sheet ``number`` (from 1) is: strokes done of all, the ``share`` of its time that is
    over, and the seconds left.
    """

    number: int
    stroke: int
    strokes: int
    share: float
    seconds_left: float
    stream: Progress


class Timeline:
    """The dry run of one sheet over time; the controller plans ``blocks`` moves ahead."""

    def __init__(self, sheet: SheetPreview, blocks: int) -> None:
        burnt = strokes(sheet.program)
        self._strokes = len(burnt)
        self._stroke_ends = burnt.last_move
        self._program = sheet.program
        self._ends = np.concatenate([[0.0], sheet.end_seconds])
        self._blocks = blocks
        self._move = 0  # the move being made; never decreases

    def place(self, number: int, now: Progress) -> SheetProgress:
        """Where the sheet is, which is sheet ``number``."""
        planned = int(np.searchsorted(self._program.line, now.line, side="right"))
        first, share = max(self._move, planned - self._blocks - 2), 0.0
        if now.state == "Idle" and now.lines_acknowledged == now.lines_total:
            first = len(self._program)
        elif first < planned and now.position is not None:
            moves = slice(first, planned)
            gap, along = _nearest(
                np.array(now.position[:2]),
                self._program.start[moves, :2],
                self._program.end[moves, :2],
            )
            nearest = int(np.argmin(gap))
            first, share = first + nearest, float(along[nearest])
        self._move = first
        done = int(np.searchsorted(self._stroke_ends, first))
        begun = self._ends[first]
        ended = self._ends[min(first + 1, len(self._ends) - 1)]
        over = float(begun + share * (ended - begun))
        total = float(self._ends[-1])
        left = max(0.0, total - over) * 100.0 / max(now.overrides.feed, 1)
        of_time = min(over / total, 1.0) if total else 1.0
        return SheetProgress(number, done, self._strokes, of_time, left, now)


def placed(
    on_progress: Callable[[SheetProgress], None] | None,
    number: int,
    sheet: SheetPreview,
    blocks: int,
) -> Callable[[Progress], None] | None:
    """The callback of a sender that tells ``on_progress`` where sheet ``number`` is."""
    if on_progress is None:
        return None
    timeline = Timeline(sheet, blocks)

    return lambda now: on_progress(timeline.place(number, now))


def _nearest(at: Floats, start: Floats, end: Floats) -> tuple[Floats, Floats]:
    """(n,) the distance of ``at`` from each of n moves, and (n,) the done share of each."""
    way = end - start
    square = np.maximum((way**2).sum(axis=1), 1e-12)
    along = np.clip(((at - start) * way).sum(axis=1) / square, 0.0, 1.0)
    return np.linalg.norm(at - start - along[:, None] * way, axis=1), along
