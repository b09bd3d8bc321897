"""The strokes of the tool on one sheet: an ordered batch of polylines.

A :class:`Toolpath` is the output of the origami tower and the input of the post processor. Strokes
are flat arrays with offsets, so that a hundred thousand dashes are a few arrays and not a hundred
thousand objects.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from miurafab.geometry.arrays import Floats, Ints
from miurafab.profiles import OPERATIONS


@dataclass(frozen=True, eq=False)
class Toolpath:
    """S strokes in order, with N points in total.

    ``points`` (N, 2) float64 in mm on the sheet, the origin at its lower left corner;
    ``offsets`` (S + 1,) int64: stroke s is ``points[offsets[s]:offsets[s + 1]]``;
    ``operation`` (S,) int64, indices into :data:`~miurafab.profiles.OPERATIONS`;
    ``patch`` (S,) int64, the patch id, -1 for none; ``edge`` (S,) int64, the pattern edge that a
    crease stroke lies on, -1 for outlines and text.
    """

    sheet: str
    width_mm: float
    height_mm: float
    points: Floats
    offsets: Ints
    operation: Ints
    patch: Ints
    edge: Ints

    def __len__(self) -> int:
        return len(self.operation)

    def stroke(self, index: int) -> Floats:
        """(n, 2) points of one stroke."""
        return self.points[self.offsets[index] : self.offsets[index + 1]]

    @property
    def starts(self) -> Floats:
        """(S, 2) first points."""
        return self.points[self.offsets[:-1]]

    @property
    def ends(self) -> Floats:
        """(S, 2) last points."""
        return self.points[self.offsets[1:] - 1]

    @property
    def lengths(self) -> Floats:
        """(S,) lengths of the strokes in mm."""
        steps = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        along = np.concatenate([[0.0], np.cumsum(steps)])
        return np.asarray(along[self.offsets[1:] - 1] - along[self.offsets[:-1]])

    def length_of(self, operation: str) -> float:
        """The length in mm of all strokes of one operation."""
        return float(self.lengths[self.operation == OPERATIONS.index(operation)].sum())

    @property
    def travel_mm(self) -> float:
        """The length in mm travelled with the beam off, from the origin and back to it."""
        if not len(self):
            return 0.0
        legs = np.linalg.norm(self.starts[1:] - self.ends[:-1], axis=1).sum()
        return float(legs + np.linalg.norm(self.starts[0]) + np.linalg.norm(self.ends[-1]))
