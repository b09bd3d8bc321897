"""From lines to a crease pattern: lines are joined where they meet and split where they cross.

Drawings (SVG, CP, OPX, DXF) hold only lines. Two lines meet where their ends are within a tolerance
of each other. A line that ends on a curve misses the straight lines that stand for the curve by a
little; they are led through its end. Facets come from the plane graph: at the end of a side, the
next side clockwise follows, so that the walk around each facet is counter-clockwise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from miurafab.errors import PatternError
from miurafab.findings import Finding
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.connected import components
from miurafab.geometry.polygons import (
    connected_parts,
    edge_lengths,
    filled,
    next_corners,
    reversed_faces,
    signed_areas,
)
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.formats.crease_lines import (
    FARTHEST,
    CreaseLines,
    corners_at_ends,
    too_far,
    with_flat_lines,
)
from miurafab.origami.formats.line_crossings import lines_cross, split_lines
from miurafab.origami.formats.loose_parts import InnerParts, facets_around, inner_parts
from miurafab.origami.formats.rulings import rulings
from miurafab.origami.formats.settled_parts import DrawnSides, SettledParts
from miurafab.origami.formats.told import (
    lost_lines,
    told_of_inner_parts,
    told_of_joining,
    told_of_lines,
    told_of_rulings,
    torn_lines,
)

TOLERANCES = (1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1)
"""The distances within which ends meet, as parts of the median line. The first is the usual one;
of a drawing of few digits, whose lines would not quite meet, that which leaves the fewest lines out
and the fewest edges short."""
ROUNDED = 1e-2
"""Parts of a drawing that are whole are joined within this part of the median line, no farther."""
SHORT = 1e-3
"""Shorter edges, as parts of the median line, may be left where lines were to meet."""
SHORT_CURVED = 0.25
"""The same as a part of the tolerance of curves."""

CUTS = ("B", "C")
"""The letters of lines along which paper is cut, also where they end in the middle of a facet."""

_ROUNDS = 30
"""So often flat lines are drawn in facets that are no polygons; where parts hang on each other they
are joined one after another."""
_MOST_CORNERS = 20_000_000
"""Of all facets, were each as large as the largest: 160 MB."""
# Of two lines on each other, the line of the higher rank is kept.
_RANK = {"B": 6, "C": 5, "M": 4, "V": 4, "J": 2, "F": 1, "U": 0}


def pattern_from_lines(lines: CreaseLines, tolerance: float | None = None) -> CreasePattern:
    """The pattern that ``lines`` draw.

    Ends within ``tolerance`` (mm) of each other are one vertex, an end within ``tolerance`` of a
    line lies on the line, and crossing lines get a vertex. The default is the first of
    :data:`TOLERANCES` with which the fewest lines are left out. A mountain or valley of unknown
    angle is folded flat. Lines that bound no facet are left out, which
    :attr:`CreasePattern.told` tells. The parts of a drawing that lie apart are the pieces of the
    pattern; what lies loose inside a facet or ends there as a cut (B, C) is joined to the lines
    around by flat lines (:mod:`miurafab.origami.formats.loose_parts`).

    Raises :class:`~miurafab.errors.PatternError` if the lines enclose no facet.
    """
    if not len(lines.ends):
        raise PatternError("The drawing holds no line.")
    if not (np.abs(lines.ends) < FARTHEST).all():
        raise too_far()
    lines = corners_at_ends(lines)
    near, told = (tolerance, ()) if tolerance is not None else _nearness(lines)
    drawn = _joined(lines, split_lines(lines, near))
    found: list[InnerParts] = []
    while len(drawn.inner.bridges):
        if len(found) == _ROUNDS:
            raise drawn.inner.refusal()
        found.append(drawn.inner)
        lines = with_flat_lines(lines, drawn.inner.bridges)
        drawn = _joined(lines, split_lines(lines, near))
    told += told_of_inner_parts(found)
    if lines.curve is None:
        return replace(drawn.pattern, told=drawn.pattern.told + told)
    bent = rulings(drawn.pattern, lines.curve[drawn.source] >= 0)
    if len(bent):
        with_rulings = with_flat_lines(lines, bent + drawn.origin)
        ruled = _joined(with_rulings, split_lines(with_rulings, near)).pattern
        told += (told_of_rulings(len(bent)),)
        drawn = replace(drawn, pattern=ruled)
    return replace(drawn.pattern, told=drawn.pattern.told + told)


def _nearness(lines: CreaseLines) -> tuple[float, tuple[Finding, ...]]:
    """The distance within which ends meet, mm, and what is told of it."""
    median = float(np.median(_lengths(lines)))
    short = max(SHORT * median, SHORT_CURVED * lines.curve_tolerance)
    first = split_lines(lines, TOLERANCES[0] * median)
    parts = SettledParts.of(first, short, ROUNDED * median)
    chosen, least, refused = None, (0, 0.0), None
    for share in TOLERANCES:
        near = share * median
        sides = first if share == TOLERANCES[0] else split_lines(lines, near)
        if parts.are_merged(sides):
            break
        try:
            drawn = _joined(lines, sides)
        except PatternError as fault:
            refused = refused or fault
            continue
        found = drawn.pattern
        if share > TOLERANCES[0] and lines_cross(found.vertices_coords, found.edges_vertices):
            continue  # ends were moved over other lines
        lost = drawn.lost + int((drawn.lengths < short).sum())
        wrong = lost, drawn.inner.slits if share <= ROUNDED else math.inf
        if chosen is None or wrong < least:
            chosen, least = share, wrong
        if not any(least) or (share >= ROUNDED and not least[0]):
            break
    if chosen is None:
        assert refused is not None
        raise refused
    near = chosen * median
    return near, (() if chosen == TOLERANCES[0] else (told_of_joining(near),))


@dataclass(frozen=True, eq=False)
class _Joined:
    """A ``pattern`` that lines draw, of whose edges ``source`` (E,) are the lines; ``origin`` (2,)
    is where its corner lies in the drawing, ``lost`` the number of lines that are left out, and
    ``inner`` what lies within facets.
    """

    pattern: CreasePattern
    source: Ints
    origin: Floats
    lost: int
    inner: InnerParts

    @property
    def lengths(self) -> Floats:
        """(E,) the lengths of the edges."""
        return edge_lengths(self.pattern.vertices_coords, self.pattern.edges_vertices)


def _joined(lines: CreaseLines, drawn: DrawnSides) -> _Joined:
    """The pattern of the sides that ``lines`` were cut into."""
    every, line = drawn.sides, drawn.line
    stands_for = _without_doubles(every, line, lines.assignment)
    cut = np.isin(lines.assignment[line], CUTS)
    points, sides, rows = _without_loose_ends(drawn.points, every, np.unique(stands_for), cut)
    if not len(sides):
        raise PatternError("The lines of the drawing enclose no facet; is the border there?")
    faces = faces_of_plane_graph(points, sides)
    if not len(faces):
        raise PatternError("The lines of the drawing enclose no facet; is the border there?")
    letter = lines.assignment[line[rows]]
    pieces, piece = connected_parts(faces)
    whole = without_holes(faces, piece, sides, letter, len(points))
    areas = np.abs(signed_areas(points[filled(faces)]))
    holes = areas[~whole] / areas.sum()
    faces, piece = faces[whole], piece[whole]
    inner = inner_parts(points, sides, faces)
    count = _sides_of_faces(faces, sides, len(points))
    keep, there = count > 0, rows[(count > 0) | inner.waits]
    sides, rows, letter, count = sides[keep], rows[keep], letter[keep], count[keep]
    source = line[rows]
    used = np.unique(sides)
    origin = points[used].min(axis=0)
    renumber = np.full(len(points) + 1, -1, dtype=np.int64)  # the last entry maps -1 to -1
    renumber[used] = np.arange(len(used))
    letter = np.where(count == 1, "B", np.where(letter == "B", "C", letter))
    flat_folded = np.select([letter == "M", letter == "V"], [-np.pi, np.pi], 0.0)
    angle = lines.fold_angle[source]
    angle = np.where(np.isnan(angle) | (count == 1), flat_folded, angle)
    stands_for = np.where(np.isin(stands_for, there), stands_for, -1)
    lengths = edge_lengths(drawn.points, every)
    gone = np.flatnonzero(stands_for < 0)
    middles = drawn.points[every[gone]].mean(axis=1)
    beyond = facets_around(points, faces, np.full(len(faces), -1), middles) == 0
    lengths[gone[beyond]] = 0.0  # where no paper is, nothing is lost
    pattern = CreasePattern(
        vertices_coords=points[used] - origin,
        edges_vertices=renumber[sides],
        edges_assignment=letter,
        edges_fold_angle=angle,
        faces_vertices=renumber[faces],
        pieces=piece if pieces > 1 else None,
        angles_assumed=bool(
            (np.isnan(lines.fold_angle[source]) & np.isin(letter, ("M", "V"))).any()
        ),
        told=told_of_lines(lines, line, stands_for, lengths, holes),
    )
    lost = int(lost_lines(lines, line, stands_for).sum())
    lost += int(torn_lines(lines, line, stands_for, lengths).sum())
    return _Joined(pattern, source, origin, lost, inner)


def faces_of_plane_graph(points: Floats, sides: Ints) -> Ints:
    """(F, k) the facets between ``sides`` (E, 2) without crossings at ``points`` (V, 2).

    Counter-clockwise, filled with -1, without the outside.
    """
    tail = np.concatenate([sides[:, 0], sides[:, 1]])
    head = np.concatenate([sides[:, 1], sides[:, 0]])
    count = len(tail)
    twin = (np.arange(count) + len(sides)) % count
    direction = points[head] - points[tail]
    angle = np.arctan2(direction[:, 1], direction[:, 0])
    order = np.lexsort((angle, tail))
    rank = np.empty(count, dtype=np.int64)
    rank[order] = np.arange(count)
    first = np.searchsorted(tail[order], np.arange(len(points)))
    degree = np.bincount(tail, minlength=len(points))
    before = np.where(rank > first[tail], rank - 1, first[tail] + degree[tail] - 1)
    following = order[before][twin]
    loop = components(count, np.arange(count), following)
    near = points - points[0]  # far from the origin products of coordinates have no digits left
    cross = near[tail, 0] * near[head, 1] - near[tail, 1] * near[head, 0]
    alone = loop != loop[twin]  # a walk along which each side is gone both ways encloses nothing
    inside = np.flatnonzero((np.bincount(loop, cross) > 0) & (np.bincount(loop, alone) > 0))
    start = np.unique(loop, return_index=True)[1]
    at = start[inside]
    if not len(at):
        return np.empty((0, 3), dtype=np.int64)
    corners = [tail[at]]
    open_ = np.ones(len(at), dtype=bool)
    while True:
        at = following[at]
        open_ &= at != start[inside]
        if not open_.any():
            break
        corners.append(np.where(open_, tail[at], -1))
        if len(corners) * len(at) > _MOST_CORNERS:
            raise PatternError(
                f"A facet has more than {len(corners)} corners, too many beside {len(at)} others; "
                "draw its border by longer lines."
            )
    return np.stack(corners, axis=1)


def enclosed_facets(flat: Floats, edges: Ints, assignment: NDArray[np.str_]) -> Ints:
    """The facets that ``edges`` enclose, for a file without facets; what only borders enclose in a
    creased sheet is a hole.

    Raises :class:`~miurafab.errors.PatternError`, also where a part lies loose inside a facet.
    """
    faces, inner = _enclosed(flat, edges, assignment)
    if inner.waits.any():
        raise inner.refusal()
    return faces


def are_lines(flat: Floats, edges: Ints, assignment: NDArray[np.str_]) -> bool:
    """Whether the ``edges`` of a file without facets are lines of a drawing, of which facets are
    yet to be made: they cross, one has no length, or a part lies in the middle of a facet.

    Raises :class:`~miurafab.errors.PatternError` as :func:`enclosed_facets`.
    """
    if (edges[:, 0] == edges[:, 1]).any() or lines_cross(flat, edges):
        return True
    return len(_enclosed(flat, edges, assignment)[1].bridges) > 0


def _enclosed(flat: Floats, edges: Ints, assignment: NDArray[np.str_]) -> tuple[Ints, InnerParts]:
    if edges.max() >= len(flat):
        raise PatternError("'edges_vertices' refers to a vertex that does not exist.")
    long = edges[:, 0] != edges[:, 1]
    edges, assignment = edges[long], assignment[long]
    faces = faces_of_plane_graph(flat, edges)
    if not len(faces):
        raise PatternError("'faces_vertices' is missing and 'edges_vertices' encloses no facet.")
    piece = connected_parts(faces)[1]
    faces = faces[without_holes(faces, piece, edges, assignment, len(flat))]
    return faces, inner_parts(flat, edges, faces)


def oriented(flat: Floats, faces: Ints) -> Ints:
    """``faces`` counter-clockwise.

    The order of the corners says which side of the paper a facet shows. So where neighbours agree,
    a part of the sheet is reversed as a whole, if most of it runs clockwise: a facet that lies
    turned over in the flat pattern stays so, and verification finds it. A file whose neighbours do
    not agree says nothing of sides, and each facet is made to run counter-clockwise.
    """
    areas = signed_areas(flat[filled(faces)])
    tails = faces[faces >= 0]
    heads = np.take_along_axis(faces, next_corners(faces), axis=1)[faces >= 0]
    agree = len(np.unique(tails * len(flat) + heads)) == len(tails)
    if agree:
        part = connected_parts(faces)[1]
        areas = np.bincount(part, areas).astype(np.float64)[part]
    return np.where((areas < 0)[:, None], reversed_faces(faces), faces)


def _lengths(lines: CreaseLines) -> Floats:
    """The lengths of the lines of the drawing, a curve being one."""
    lengths = np.linalg.norm(lines.ends[:, 1] - lines.ends[:, 0], axis=1)
    if lines.curve is None:
        return np.asarray(lengths)
    straight = lines.curve < 0
    whole = np.bincount(lines.curve[~straight], lengths[~straight])
    return np.concatenate([lengths[straight], whole])


def _without_doubles(sides: Ints, source: Ints, assignment: NDArray[np.str_]) -> Ints:
    """(m,) of each side the side that stands for it: that of the highest rank between its ends."""
    rank = np.array([_RANK[letter] for letter in assignment.tolist()])
    key = np.sort(sides, axis=1)
    order = np.lexsort((source, -rank[source], key[:, 1], key[:, 0]))
    different = np.ones(len(order), dtype=bool)
    different[1:] = (np.diff(key[order], axis=0) != 0).any(axis=1)
    found = np.empty(len(order), dtype=np.int64)
    found[order] = order[different][np.cumsum(different) - 1]
    return found


def _without_loose_ends(
    points: Floats, every: Ints, rows: Ints, cut: Bools
) -> tuple[Floats, Ints, Ints]:
    """Vertices, sides and their ``rows`` in ``every`` side, without the sides that end at a vertex
    of no other side and are no ``cut``, and without unused points.
    """
    while True:
        sides = every[rows]
        degree = np.bincount(sides.ravel(), minlength=len(points))
        firm = (degree[sides] > 1).all(axis=1) | cut[rows]
        if firm.all():
            break
        rows = rows[firm]
    used = np.unique(sides)
    renumber = np.zeros(len(points), dtype=np.int64)
    renumber[used] = np.arange(len(used))
    return points[used], renumber[sides], rows


def without_holes(
    faces: Ints, piece: Ints, sides: Ints, letter: NDArray[np.str_], vertices: int
) -> Bools:
    """(F,) all but the facets that only border lines enclose; in a piece of only such, all."""
    face, side = _face_sides(faces, sides, vertices)
    cut = np.isin(letter[side], CUTS)
    creased = np.bincount(face, ~cut, minlength=len(faces)) > 0
    bare = np.bincount(piece, creased) == 0
    return np.asarray(creased | bare[piece])


def _sides_of_faces(faces: Ints, sides: Ints, vertices: int) -> Ints:
    """(E,) the number of facets at each side, 0 to 2."""
    _, side = _face_sides(faces, sides, vertices)
    return np.bincount(side, minlength=len(sides))


def _face_sides(faces: Ints, sides: Ints, vertices: int) -> tuple[Ints, Ints]:
    """The facet and the side of every pair of a facet and one of its sides."""
    size = (faces >= 0).sum(axis=1)
    face, corner = np.nonzero(faces >= 0)
    tail = faces[face, corner]
    head = faces[face, (corner + 1) % size[face]]
    key = np.minimum(tail, head) * vertices + np.maximum(tail, head)
    keys = sides.min(axis=1) * vertices + sides.max(axis=1)
    order = np.argsort(keys)
    return face, order[np.searchsorted(keys, key, sorter=order)]
