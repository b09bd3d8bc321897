"""Whether the edges and facets of a pattern agree with each other and with its folded form.

What is creased is decided by the letters, what is told by the fold angles, and what is cut out by
the facets; so all three are recomputed. FOLD 1.2 says how letter, angle and facets go together: a
border (B) has one facet, a mountain (M) folds by a negative angle, a valley (V) by a positive one,
and no other edge folds. In the folded form the angle of each edge between two facets is measured.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from miurafab.findings import Finding
from miurafab.geometry.angles import fold_angles
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.polygons import (
    edge_lengths,
    facet_areas,
    facet_normals,
    filled,
    no_polygons,
    signed_areas,
)
from miurafab.geometry.quads import QuadGrid
from miurafab.origami.crease_pattern import UNCREASED, CreasePattern
from miurafab.origami.invariants import EXACT, Residuals, crossed_facets
from miurafab.origami.unfold import FLAT_ANGLE

_ROUNDINGS = 64
"""A fold angle may be off by as many residuals over the height of the lower facet beside it."""


@dataclass(frozen=True, eq=False)
class MeasuredFolds:
    """The fold angles of the folded form, of the E edges of a pattern.

    Attributes
    ----------
    angle : (E,) float64
        Radians, valley positive; NaN where there are not two facets, or one has no area.
    within : (E,) float64
        How exact ``angle`` is.
    """

    angle: Floats
    within: Floats

    @property
    def known(self) -> Bools:
        """(E,) where an angle was measured."""
        return np.isfinite(self.angle) & np.isfinite(self.within)

    @property
    def signed(self) -> Bools:
        """(E,) where the sign is known, too: a fold by 180 degrees is the same up and down."""
        return self.known & (np.abs(self.angle) < math.pi - self.within)


def measured_folds(pattern: CreasePattern, found: Residuals) -> MeasuredFolds:
    """The folds of the folded form, as exact as the facets beside them are by ``found``."""
    points = pattern.folded_coords
    assert points is not None
    beside = pattern.edges_faces
    inner = np.flatnonzero((beside >= 0).all(axis=1))
    angle, within = np.full((2, len(beside)), np.nan)
    normals = facet_normals(points, pattern.faces_vertices)
    left, right = (normals[beside[inner, side]] for side in (0, 1))
    lengths = edge_lengths(points, pattern.edges_vertices)
    areas = facet_areas(points, pattern.faces_vertices)[beside[inner]].min(axis=1)
    off = np.maximum(found.planarity, found.isometry)[beside[inner]].max(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        angle[inner] = fold_angles(points, pattern.edges_vertices[inner], left, right)
        low = areas / lengths[inner]
        within[inner] = FLAT_ANGLE + _ROUNDINGS * (EXACT + off) * lengths.mean() / low
    return MeasuredFolds(angle, within)


def unmeasured(folds: MeasuredFolds, pattern: CreasePattern) -> Iterator[Finding]:
    """What the folded form does not tell of the folds."""
    inner = (pattern.edges_faces >= 0).all(axis=1)
    lost = np.flatnonzero(inner & ~folds.known)
    if len(lost):
        which = "one edge" if len(lost) == 1 else f"{len(lost)} edges"
        says = f"Of {which} no fold angle is measured: a facet beside has no area."
        yield Finding("not-proven", says, tuple(lost.tolist()))
    closed = np.flatnonzero(folds.known & ~folds.signed)
    if len(closed):
        which = "One edge folds" if len(closed) == 1 else f"{len(closed)} edges fold"
        says = (
            f"{which} by 180 degrees, where the folded form does not tell mountains from valleys."
        )
        yield Finding("not-proven", says, tuple(closed.tolist()))


def judge_creases(pattern: CreasePattern, folds: MeasuredFolds | None) -> Iterator[Finding]:
    """What does not agree in ``pattern``: edges, letters, fold angles and facets."""
    yield from _edges(pattern)
    yield from _facets(pattern)
    faults = [*_letter_faults(pattern), *([] if folds is None else _fold_faults(pattern, folds))]
    for code in ("assignment", "fold-angle"):
        told: dict[int, str] = {}
        for fault in faults:
            if fault.code == code:
                told.setdefault(fault.edge, fault.sentence)
        if told:
            yield _finding(code, told, "edge")


class _Fault(NamedTuple):
    code: str
    edge: int
    sentence: str


def _finding(code: str, told: dict[int, str], noun: str) -> Finding:
    """One finding on all that ``told`` names; the first has its sentence."""
    first, *others = sorted(told)
    more = ""
    if others:
        shown = ", ".join(map(str, others[:4])) + (", ..." if len(others) > 4 else "")
        several = f"{noun}s" if len(others) > 1 else noun
        more = f" The same kind of fault is at {len(others)} more {several} ({shown})."
    return Finding(code, told[first] + more, (first, *others))


def _edges(pattern: CreasePattern) -> Iterator[Finding]:
    """Edges that are there twice, and edges of no facet."""
    ends = np.sort(pattern.edges_vertices, axis=1)
    _, first, which = np.unique(ends, axis=0, return_index=True, return_inverse=True)
    letters = pattern.edges_assignment
    twice = {
        int(edge): f"Edges {one} ({letters[one]}) and {edge} ({letters[edge]}) join the same two "
        "vertices; an edge is there once."
        for edge, one in enumerate(first[which.reshape(-1)].tolist())
        if one != edge
    }
    if twice:
        yield _finding("double-edge", twice, "edge")
    bare = np.flatnonzero((pattern.edges_faces < 0).all(axis=1) & ~np.isin(letters, UNCREASED))
    alone = {
        edge: f"Edge {edge} ({letters[edge]}) is a side of no facet: a facet is missing, or the "
        "edge is one too many."
        for edge in bare.tolist()
        if edge not in twice
    }
    if alone:
        yield _finding("facets", alone, "edge")


def _facets(pattern: CreasePattern) -> Iterator[Finding]:
    """Facets that are turned over or no polygons, or not those of the grid or of their cells."""
    faces = pattern.faces_vertices
    turned = np.flatnonzero(signed_areas(pattern.vertices_coords[filled(faces)]) < 0)
    if len(turned):
        over = {
            int(f): f"Facet {f} lies turned over in the flat pattern: its corners run clockwise "
            "while those of its neighbours do not."
            for f in turned
        }
        yield _finding("turned-over", over, "facet")
    left, right = pattern.edges_faces.T
    both = {
        int(edge): f"Facet {left[edge]} lies on both sides of edge {edge}, which ends inside it or "
        "leads to a window there: it is no polygon, and cannot be laid out on sheets. Join what "
        "is there to another side of the facet by a flat edge (F), or leave the edge out."
        for edge in np.flatnonzero((left == right) & (left >= 0))
    }
    if both:
        yield _finding("both-sides", both, "edge")
    bad = no_polygons(pattern.vertices_coords, faces)
    if len(bad):
        told = np.concatenate([turned, left[list(both)], crossed_facets(pattern)])
        bad = np.setdiff1d(bad, told)
    if len(bad):
        touching = {int(f): _touching(f, faces[f][faces[f] >= 0]) for f in bad}
        yield _finding("touches-itself", touching, "facet")
    if pattern.grid is not None:
        yield from _off_the_grid(faces, QuadGrid(*pattern.grid))
    elif pattern.cells is not None:
        yield from _off_their_cells(pattern, pattern.cells)


def _touching(facet: int, corners: Ints) -> str:
    """What is told of a ``facet`` that is no polygon, though none of its sides cross."""
    vertices, times = np.unique(corners, return_counts=True)
    where, way = "touches itself, or has no area", "Move its corners apart, or leave it out."
    if (times > 1).any():
        where = f"touches itself at vertex {vertices[times > 1][0]}"
        way = (
            "Join what hangs there to another side of the facet by a flat edge (F), or leave "
            "`faces_vertices` out of a file without a folded form."
        )
    return f"Facet {facet} {where}: it is no polygon, and cannot be laid out on sheets. {way}"


def _off_the_grid(faces: Ints, grid: QuadGrid) -> Iterator[Finding]:
    right = {
        tuple(sorted(cell)): number for number, cell in enumerate(grid.faces_vertices.tolist())
    }
    own = {tuple(sorted(v for v in face if v >= 0)): n for n, face in enumerate(faces.tolist())}
    foreign = {
        number: f"Facet {number} is no cell of the grid of {grid.columns} x {grid.rows} vertices."
        for corners, number in own.items()
        if corners not in right
    }
    if foreign:
        yield _finding("facets", foreign, "facet")
        return
    missing = {
        number: f"The grid of {grid.columns} x {grid.rows} vertices has a cell {number} for which "
        "there is no facet."
        for corners, number in right.items()
        if corners not in own
    }
    if missing:
        yield _finding("facets", missing, "cell")


def _off_their_cells(pattern: CreasePattern, cells: Ints) -> Iterator[Finding]:
    """Facets whose neighbours are not beside them in the lattice, unless their piece of it closes
    on itself.
    """
    inner = np.flatnonzero((pattern.edges_faces >= 0).all(axis=1))
    one, other = pattern.edges_faces[inner].T
    piece = np.zeros(len(cells), dtype=np.int64) if pattern.pieces is None else pattern.pieces
    low = np.full((pattern.pieces_count, 2), np.iinfo(np.int64).max)
    high = -low
    np.minimum.at(low, piece, cells)
    np.maximum.at(high, piece, cells)
    step = np.abs(cells[one] - cells[other])
    step = np.minimum(step, (high - low + 1)[piece[one]] - step)
    apart = inner[step.sum(axis=1) > 1]
    beside = pattern.edges_faces
    strange = {
        int(edge): f"Edge {edge} lies between facets {beside[edge, 0]} and {beside[edge, 1]}, "
        "whose cells are not beside each other in the lattice."
        for edge in apart
    }
    if strange:
        yield _finding("facets", strange, "edge")


def _letter_faults(pattern: CreasePattern) -> Iterator[_Fault]:
    """Edges whose letter contradicts their facets or their angle."""
    letters, angles = pattern.edges_assignment, pattern.edges_fold_angle
    sides = (pattern.edges_faces >= 0).sum(axis=1)
    told = (letters != "U").any()  # a file may tell no letter at all
    for edge in np.flatnonzero((sides == 1) & (letters != "B")).tolist() if told else ():
        yield _Fault(
            "assignment",
            edge,
            f"Edge {edge} is {letters[edge]} and a side of one facet alone: it is a border (B), or "
            "the facet beyond it is missing.",
        )
    for edge in np.flatnonzero((sides == 2) & (letters == "B")).tolist():
        one, other = pattern.edges_faces[edge].tolist()
        yield _Fault(
            "assignment",
            edge,
            f"Edge {edge} is a border (B) and lies between facets {one} and {other}; a cut within "
            "the sheet is C.",
        )
    sign = np.select([letters == "M", letters == "V"], [-1, 1])
    # A file of the flat state may give 0 for every fold.
    sizes_told = (np.abs(angles) > FLAT_ANGLE).any()
    wrong = np.where(np.abs(angles) > FLAT_ANGLE, np.sign(angles), 0) != sign
    wrong &= (angles != 0) | sizes_told
    wrong |= np.abs(angles) > math.pi + FLAT_ANGLE
    for edge in np.flatnonzero(wrong & (sides > 0)).tolist():
        yield _Fault(
            "assignment",
            edge,
            f"Edge {edge} is {letters[edge]} and its fold angle is {_degrees(angles[edge])}: a "
            "valley (V) folds by 0 to 180 degrees, a mountain (M) by 0 to -180, and no other edge "
            "folds.",
        )


def _fold_faults(pattern: CreasePattern, folds: MeasuredFolds) -> Iterator[_Fault]:
    """Edges whose letter or angle is not that of the folded form."""
    letters, angles = pattern.edges_assignment, pattern.edges_fold_angle
    with np.errstate(invalid="ignore"):
        off = np.abs((folds.angle - angles + math.pi) % (2 * math.pi) - math.pi)
        differs = folds.known & (off > folds.within)
        up = folds.signed & (folds.angle > folds.within)
        down = folds.signed & (folds.angle < -folds.within)
    for edge in np.flatnonzero(differs).tolist():
        yield _Fault(
            "fold-angle",
            edge,
            f"Edge {edge} folds by {_degrees(folds.angle[edge])} in the folded form, and its fold "
            f"angle is given as {_degrees(angles[edge])}.",
        )
    flat_folded = folds.known & ~folds.signed & ~np.isin(letters, ("M", "V"))
    wrong = (up & (letters != "V")) | (down & (letters != "M")) | flat_folded
    for edge in np.flatnonzero(wrong).tolist():
        right = "V" if up[edge] else "M" if down[edge] else "M or V"
        yield _Fault(
            "assignment",
            edge,
            f"Edge {edge} folds by {_degrees(folds.angle[edge])} in the folded form, and is "
            f"{letters[edge]}, not {right}.",
        )


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle) + 0.0:.6g} degrees"  # 0 and not -0
