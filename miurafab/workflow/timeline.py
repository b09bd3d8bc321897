"""Where a running job is, in strokes and in time left, by the figures of its dry run.

What is acknowledged is planned, not made: the machine is behind by the moves of its planner. So
the place is that of the last acknowledged line, less those moves; the time left is the dry run's
from there on, at the feed that the override leaves.
"""

from __future__ import annotations

import numpy as np

from miurafab.gcode.program import strokes
from miurafab.machine.sender import Progress
from miurafab.workflow.dry_run import SheetPreview


class Timeline:
    """The way of one sheet; ``blocks`` is how many moves the controller plans ahead."""

    def __init__(self, sheet: SheetPreview, blocks: int) -> None:
        burnt = strokes(sheet.program)
        self.strokes = len(burnt)
        self._stroke_ends = burnt.last_move
        self._lines = sheet.program.line
        self._ends = sheet.end_seconds
        self._seconds = sheet.seconds
        self._blocks = blocks

    def place(self, now: Progress) -> tuple[int, float]:
        """The strokes done, and the seconds left."""
        move = int(np.searchsorted(self._lines, now.line, side="right"))
        if now.state != "Idle":
            move = max(0, move - self._blocks)
        done = int(np.searchsorted(self._stroke_ends, move))
        made = float(self._ends[move - 1]) if move else 0.0
        return done, (self._seconds - made) * 100.0 / max(now.feed_override, 1)
