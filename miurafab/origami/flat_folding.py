"""What can be judged of the folds at a vertex without a folded form.

The sectors a_1 ... a_n around an interior vertex and the creases between them decide it. With the
fold angles rho_i the sheet closes around the vertex if the rotations

    R_z(a_1) R_x(rho_1) ... R_z(a_n) R_x(rho_n) = 1

(belcastro and Hull, Linear Algebra and its Applications 348, 2002). Folded flat, all rho = 180
degrees, that is Kawasaki's theorem: the sums of alternate sectors are equal. Two more conditions
are necessary for the mountains M and valleys V:

* Maekawa: M - V = +-2;
* big-little-big: of k equal sectors between two larger ones, the k + 1 creases have as many M as V
  if k is odd, and one more of either if k is even (Hull, Origametry, 2020, sec. 5.3; k = 1 is the
  lemma's first form).

Flat creases (F, J) join two sectors to one. A vertex with an unassigned crease (U) or a cut (C) is
not judged.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from miurafab.findings import Finding, counted
from miurafab.geometry.arrays import Bools, Floats
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.invariants import CornerRing, corner_ring, interior_vertices

CLOSED = 1e-5
"""Radians; a vertex that closes better than this is exact. Fitted sheets close to 1e-12, a file
with six decimals of millimetres and degrees to 1e-7, and coordinates of single precision beside
short edges to 6e-6."""

ROUGH = 0.01
"""Radians; what drawings with few digits leave open at a vertex that was meant to close."""

_SPREAD = 20.0
"""So many times the median residual are still the rounding of the same digits."""

_FINE = 1e-3
"""Radians; where some vertices of a drawing are exact, the others are off by less, in the median,
if that is the rounding of its digits."""

SAME = 1e-4
"""Radians; sectors that differ by less are equal."""


@dataclass(frozen=True, eq=False)
class VertexFolds:
    """The n folds around one interior vertex, counter-clockwise.

    Attributes
    ----------
    vertex : int
        The vertex.
    sectors : (n,) float64
        The angle between each crease and the next, radians.
    angles : (n,) float64
        The fold angle of each crease, radians.
    mountain : (n,) bool
        Whether each crease is a mountain by its letter: a fold angle of 0 does not tell.
    """

    vertex: int
    sectors: Floats
    angles: Floats
    mountain: Bools

    @property
    def gap(self) -> float:
        """The angle by which the sheet fails to close around the vertex, radians."""
        total = np.eye(3)
        for sector, fold in zip(self.sectors.tolist(), self.angles.tolist(), strict=True):
            c, s, d, t = math.cos(sector), math.sin(sector), math.cos(fold), math.sin(fold)
            total = total @ np.array([[c, -s * d, s * t], [s, c * d, -c * t], [0.0, t, d]])
        return 2 * math.asin(min(1.0, float(np.linalg.norm(total - np.eye(3))) / math.sqrt(8)))

    @property
    def kawasaki(self) -> float:
        """How much the sums of alternate sectors differ from 180 degrees; pi for an odd number."""
        if len(self.sectors) % 2:
            return math.pi
        return abs(float(self.sectors[::2].sum()) - math.pi)

    def why_not_flat(self, within: float) -> str:
        """Why the vertex does not fold flat; empty if no condition is broken."""
        count = len(self.angles)
        if count % 2:
            return f"{count} creases meet there, and a flat fold needs an even number"
        if self.kawasaki > within:
            one, other = (math.degrees(self.sectors[start::2].sum()) for start in (0, 1))
            digits = max(4, 4 - math.floor(math.log10(self.kawasaki)))
            return (
                f"the sums of alternate sectors are {one:.{digits}g} and {other:.{digits}g} "
                "degrees, and must be equal (Kawasaki)"
            )
        mountains = int(self.mountain.sum())
        if abs(2 * mountains - count) != 2:
            return (
                f"{mountains} mountains and {count - mountains} valleys meet there, and the "
                "numbers must differ by two (Maekawa)"
            )
        if self._breaks_big_little_big(within):
            return (
                "the creases beside its smallest sector fold the same way, so the sectors beside "
                "it pass through each other (big-little-big)"
            )
        return ""

    def _breaks_big_little_big(self, within: float) -> bool:
        count, same = len(self.sectors), max(SAME, within)
        rises = np.flatnonzero(np.roll(self.sectors, 1) - self.sectors > same)
        for first in rises.tolist():  # a sector smaller than the one before
            last = first
            while abs(self.sectors[(last + 1) % count] - self.sectors[first]) <= same:
                last += 1
            if self.sectors[(last + 1) % count] < self.sectors[first]:
                continue
            creases = self.mountain[np.arange(first - 1, last + 1) % count]
            if abs(2 * int(creases.sum()) - len(creases)) != len(creases) % 2:
                return True
        return False


def vertex_folds(pattern: CreasePattern) -> tuple[list[VertexFolds], int]:
    """The folds around each interior vertex of the flat pattern that can be judged, and the number
    of those that cannot.
    """
    vertices = interior_vertices(pattern)
    ring = corner_ring(pattern, np.pad(pattern.vertices_coords, ((0, 0), (0, 1))))
    letters, angles = pattern.edges_assignment, pattern.edges_fold_angle
    start = np.full(len(pattern.vertices_coords), -1)
    corners = np.flatnonzero(ring.vertex >= 0)
    start[ring.vertex[corners]] = corners
    judged, left_out = [], 0
    for vertex in vertices.tolist():
        around = list(_around(ring, int(start[vertex])))
        edge = ring.edge[around]
        if np.isin(letters[edge], ("U", "C", "B")).any():
            left_out += 1
            continue
        folding = np.flatnonzero(np.isin(letters[edge], ("M", "V")))
        if not len(folding):
            continue
        # A sector runs from one folding crease to the next.
        places = np.cumsum(ring.angle[around])
        sectors = np.diff(places[folding], append=places[-1] + places[folding[0]])
        creases = edge[folding]
        judged.append(
            VertexFolds(vertex, np.roll(sectors, 1), angles[creases], letters[creases] == "M")
        )
    return judged, left_out


def _around(ring: CornerRing, first: int) -> Iterator[int]:
    """The corners around the vertex of corner ``first``, counter-clockwise."""
    corner = first
    while True:
        yield corner
        corner = int(ring.following[corner])
        if corner == first or corner < 0:
            return


def judge_flat_folding(pattern: CreasePattern) -> Iterator[Finding]:
    """What the flat sectors of ``pattern``, its letters and its fold angles say of its folds."""
    folds, left_out = vertex_folds(pattern)
    if left_out:
        yield Finding(
            "not-proven",
            counted(left_out, "interior vertex is", "interior vertices are")
            + " not judged: a crease there is unassigned (U), or the sheet is cut there.",
        )
    if not folds:
        return
    sizes = np.concatenate([np.abs(each.angles) for each in folds])
    folded_flat = bool((np.abs(sizes - math.pi) <= CLOSED).all())
    if not folded_flat:
        yield from _loops(folds, _rounding(pattern, np.array([each.gap for each in folds])))
    off = np.array([each.kawasaki for each in folds])
    median = float(np.median(off))
    within = max(_SPREAD * median, _rounding(pattern, off)) if median <= CLOSED else ROUGH
    faults = {each.vertex: why for each in folds if (why := each.why_not_flat(within))}
    if not faults:
        return
    first = min(faults)
    many = (
        f"Vertex {first} does not fold flat"
        if len(faults) == 1
        else f"{len(faults)} of {len(folds)} interior vertices do not fold flat, the first is "
        f"vertex {first}"
    )
    if folded_flat and not pattern.angles_assumed:
        says = f"{many}: {faults[first]}. The file gives all folds as 180 degrees, or no angle."
        yield Finding("flat-folding", says, tuple(sorted(faults)))
    else:
        says = f"{many}: {faults[first]}. That matters only if the sheet is to be folded flat."
        yield Finding("not-flat-foldable", says, tuple(sorted(faults)))


def _rounding(pattern: CreasePattern, off: Floats) -> float:
    """Up to where residuals ``off`` (n,) of vertices may be the rounding of a file, radians.

    Our own sheets are exact. In drawings of others many vertices lie on the lines of a grid, which
    have few digits, and the others are rounded.
    """
    own = pattern.grid is not None or pattern.cells is not None or bool(pattern.target)
    loose = off[off > CLOSED]
    typical = 0.0 if own or not len(loose) else float(np.median(loose))
    return min(_SPREAD * typical, ROUGH) if CLOSED < typical <= _FINE else CLOSED


def _loops(folds: list[VertexFolds], within: float) -> Iterator[Finding]:
    """Vertices around which the sheet does not close ``within`` radians with the fold angles of the
    file.
    """
    gaps = np.array([each.gap for each in folds])
    vertices = np.array([each.vertex for each in folds])
    if not any((each.angles != 0).any() for each in folds):
        yield Finding("not-proven", "The file gives every fold as 0 degrees, so no size is known.")
        return
    wide = np.flatnonzero(gaps > within)
    if not len(wide):
        return
    where = tuple(vertices[wide].tolist())
    worst = int(wide[gaps[wide].argmax()])
    says = (
        f"With the fold angles of the file the sheet does not close around {len(wide)} of "
        f"{len(folds)} interior vertices, by up to {math.degrees(gaps[worst]):.3g} degrees around "
        f"vertex {vertices[worst]}"
    )
    if 2 * len(wide) <= len(folds):
        yield Finding("closure", f"{says}: fold angles or coordinates are wrong there.", where)
    else:
        yield Finding("not-proven", f"{says}; with a folded form it could be judged.", where)
