"""What a wide tolerance may not join: parts of a drawing that are whole as they are drawn.

Lines that do not quite meet end loose, or leave tiny edges where they cross. A part of a drawing
without either, such as a circle in the middle of a facet, is settled: its vertices stay apart, from
each other and from other settled parts, and no line shrinks to a point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.connected import components
from miurafab.geometry.polygons import edge_lengths


@dataclass(frozen=True, eq=False)
class DrawnSides:
    """The ``sides`` (m, 2) between the vertices ``points`` (V, 2) that n lines were cut into, the
    ``line`` (m,) of each, and the vertices at the ``ends`` (n, 2) of the lines.
    """

    points: Floats
    sides: Ints
    line: Ints
    ends: Ints


@dataclass(frozen=True, eq=False)
class SettledParts:
    """The parts of a drawing, whose lines within the usual tolerance are ``drawn``: ``part`` (V,)
    of each vertex, and whether a vertex is of a ``settled`` (V,) part. Vertices of one part that
    lie within ``short`` of each other are rounded, those of two parts within ``rounding``.
    """

    drawn: DrawnSides
    part: Ints
    settled: Bools
    short: float
    rounding: float

    @classmethod
    def of(cls, drawn: DrawnSides, short: float, rounding: float) -> SettledParts:
        """Of the lines ``drawn``; edges below ``short`` may be left where lines were to meet."""
        count = len(drawn.points)
        pairs = np.unique(np.sort(drawn.sides, axis=1), axis=0)
        part = components(count, *pairs.T)
        loose = np.bincount(pairs.ravel(), minlength=count) == 1
        pieces = np.bincount(drawn.line, minlength=len(drawn.ends))[drawn.line]
        tiny = (edge_lengths(drawn.points, drawn.sides) < short) & (pieces > 1)
        loose[drawn.sides[tiny]] = True
        return cls(drawn, part, np.bincount(part, loose)[part] == 0, short, rounding)

    def are_merged(self, wider: DrawnSides) -> bool:
        """Whether the same lines, drawn with a ``wider`` tolerance, lose one of their own, or a
        vertex of a settled part meets another vertex of one, or a line that it did not meet before.
        """
        first, now = self.drawn.ends, wider.ends
        if ((first[:, 0] != first[:, 1]) & (now[:, 0] == now[:, 1])).any():
            return True
        met = np.unique(np.stack([now.ravel(), first.ravel()], axis=1), axis=0)
        met = met[self.settled[met[:, 1]]]
        same = met[:-1, 0] == met[1:, 0]
        one, other = met[:-1, 1][same], met[1:, 1][same]
        if self._far(one, other, self.drawn.points[one] - self.drawn.points[other]):
            return True
        owner = first[wider.line, 0]
        side, line = wider.sides[self.settled[owner]].ravel(), wider.line[self.settled[owner]]
        line = np.repeat(line, 2)
        place = np.searchsorted(met[:, 0], side)  # the vertex of a settled part that came there
        found = place < len(met)
        found[found] = met[place[found], 0] == side[found]
        line, other = line[found], met[place[found], 1]
        # an end on a curve lies off the straight lines that stand for it, as it is drawn
        new = ~np.isin(self._meetings(line, other), self._meetings(*self._drawn))
        line, other = line[new], other[new]
        start, end = (self.drawn.points[first[line, at]] for at in (0, 1))
        along = (end - start) / np.linalg.norm(end - start, axis=1)[:, None]
        offset = self.drawn.points[other] - start
        off = offset - np.einsum("nk,nk->n", offset, along)[:, None] * along
        return self._far(first[line, 0], other, off)

    @property
    def _drawn(self) -> tuple[Ints, Ints]:
        """Each line as it is drawn, with a vertex at which it is cut."""
        return np.repeat(self.drawn.line, 2), self.drawn.sides.ravel()

    def _meetings(self, line: Ints, vertex: Ints) -> Ints:
        """(n,) a number for each pair of a ``line`` and a ``vertex`` on it."""
        return line * len(self.drawn.points) + vertex

    def _far(self, one: Ints, other: Ints, between: Floats) -> bool:
        """Whether one of the vectors ``between`` (n, 2) two vertices is longer than rounding."""
        limit = np.where(self.part[one] == self.part[other], self.short, self.rounding)
        return bool((np.linalg.norm(between, axis=1) > limit).any())
