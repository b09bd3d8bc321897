"""From lines to a crease pattern: lines are joined where they meet and split where they cross.

Drawings (SVG, CP, OPX, DXF) hold only lines. Two lines meet where their ends are within a tolerance
of each other. Facets come from the plane graph: at the end of a side, the next side clockwise
follows, so that the walk around each facet is counter-clockwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from miurafab.errors import PatternError
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.boxes import meeting_pairs
from miurafab.geometry.polygons import (
    connected_parts,
    filled,
    next_corners,
    reversed_faces,
    signed_areas,
)
from miurafab.origami.crease_pattern import CreasePattern

TOLERANCE = 1e-4
"""The distance within which ends meet, as a part of the median line."""

_FAR = 1e9
_SAMPLE, _MEETINGS, _FEW_MEETINGS = 200, 100, 1_000_000
# Of two lines on each other, the line of the higher rank is kept.
_RANK = {"B": 6, "C": 5, "M": 4, "V": 4, "J": 2, "F": 1, "U": 0}


@dataclass(frozen=True, eq=False)
class CreaseLines:
    """n straight lines of a drawing, y upwards.

    ``ends`` (n, 2, 2) float64, mm; ``assignment`` (n,) letters of FOLD; ``fold_angle`` (n,)
    float64, radians, NaN if unknown.
    """

    ends: Floats
    assignment: NDArray[np.str_]
    fold_angle: Floats


def lines_of(pattern: CreasePattern) -> CreaseLines:
    """The edges of the flat ``pattern`` as lines."""
    return CreaseLines(
        pattern.vertices_coords[pattern.edges_vertices],
        pattern.edges_assignment,
        pattern.edges_fold_angle,
    )


def pattern_from_lines(lines: CreaseLines, tolerance: float | None = None) -> CreasePattern:
    """The pattern that ``lines`` draw.

    Ends within ``tolerance`` (mm; default :data:`TOLERANCE` of the median line) of each other are
    one vertex, an end within ``tolerance`` of a line lies on the line, and crossing lines get a
    vertex. A mountain or valley of unknown angle is folded flat. Lines that bound no facet are left
    out. The parts of a drawing that lie apart are the pieces of the pattern.

    Raises :class:`~miurafab.errors.PatternError` if the lines enclose no facet, or if a part of
    the drawing lies loose inside a facet of another.
    """
    if not len(lines.ends):
        raise PatternError("The drawing holds no straight line.")
    if not (np.abs(lines.ends) < _FAR).all():
        raise PatternError("The drawing holds a coordinate that is not a number or is beyond 1e9.")
    lengths = np.linalg.norm(lines.ends[:, 1] - lines.ends[:, 0], axis=1)
    near = TOLERANCE * float(np.median(lengths)) if tolerance is None else tolerance
    points, sides, source = _split(lines.ends, near)
    sides, source = _without_doubles(sides, source, lines.assignment)
    points, sides, source = _without_loose_ends(points, sides, source)
    if not len(sides):
        raise PatternError("The lines of the drawing enclose no facet; is the border there?")
    faces = faces_of_plane_graph(points, sides)
    letter = lines.assignment[source]
    pieces, piece = connected_parts(faces)
    whole = without_holes(faces, piece, sides, letter, len(points))
    faces, piece = faces[whole], piece[whole]
    if pieces > 1:
        _refuse_loose(points, faces, piece)
    count = _sides_of_faces(faces, sides, len(points))
    keep = count > 0
    sides, source, letter, count = sides[keep], source[keep], letter[keep], count[keep]
    used = np.unique(sides)
    renumber = np.full(len(points) + 1, -1, dtype=np.int64)  # the last entry maps -1 to -1
    renumber[used] = np.arange(len(used))
    letter = np.where(count == 1, "B", np.where(letter == "B", "C", letter))
    flat_folded = np.select([letter == "M", letter == "V"], [-np.pi, np.pi], 0.0)
    angle = lines.fold_angle[source]
    angle = np.where(np.isnan(angle) | (count == 1), flat_folded, angle)
    return CreasePattern(
        vertices_coords=points[used] - points[used].min(axis=0),
        edges_vertices=renumber[sides],
        edges_assignment=letter,
        edges_fold_angle=angle,
        faces_vertices=renumber[faces],
        pieces=piece if pieces > 1 else None,
        angles_assumed=bool(
            (np.isnan(lines.fold_angle[source]) & np.isin(letter, ("M", "V"))).any()
        ),
    )


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
    loops = coo_array((np.ones(count), (np.arange(count), following)), shape=(count, count))
    number, loop = connected_components(loops, directed=False)
    cross = points[tail, 0] * points[head, 1] - points[tail, 1] * points[head, 0]
    area = np.bincount(loop, cross, minlength=number) / 2
    inside = np.flatnonzero(area > 0)
    start = np.full(number, count, dtype=np.int64)
    np.minimum.at(start, loop, np.arange(count))
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
    return np.stack(corners, axis=1)


def enclosed_facets(flat: Floats, edges: Ints, assignment: NDArray[np.str_]) -> Ints:
    """The facets that ``edges`` enclose, for a file without facets; what only borders enclose in a
    creased sheet is a hole.
    """
    if edges.max() >= len(flat):
        raise PatternError("'edges_vertices' refers to a vertex that does not exist.")
    faces = faces_of_plane_graph(flat, edges)
    if not len(faces):
        raise PatternError("'faces_vertices' is missing and 'edges_vertices' encloses no facet.")
    return faces[without_holes(faces, connected_parts(faces)[1], edges, assignment, len(flat))]


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


def _split(ends: Floats, near: float) -> tuple[Floats, Ints, Ints]:
    """Vertices (V, 2), sides (m, 2) between them, and the line (m,) that each side is part of."""
    low, high = ends.min(axis=1) - near, ends.max(axis=1)
    _refuse_tangle(low, high)
    first, second = meeting_pairs(*(np.pad(corner, ((0, 0), (0, 1))) for corner in (low, high)))
    a, b = ends[first], ends[second]
    along, across = a[:, 1] - a[:, 0], b[:, 1] - b[:, 0]
    offset = b[:, 0] - a[:, 0]
    turn = _cross(along, across)
    with np.errstate(invalid="ignore", divide="ignore"):
        t, u = _cross(offset, across) / turn, _cross(offset, along) / turn
    sharp = np.abs(turn) > 1e-9 * np.linalg.norm(along, axis=1) * np.linalg.norm(across, axis=1)
    crossing = sharp & (t > 0) & (t < 1) & (u > 0) & (u < 1)
    meet = a[crossing, 0] + t[crossing, None] * along[crossing]

    count = len(ends)
    loose = np.concatenate([ends.reshape(-1, 2), meet])
    vertex, points = _merged(loose, near)
    end = vertex[: 2 * count].reshape(count, 2)
    cut = vertex[2 * count :]
    # every line is cut at its ends, at its crossings, and at other lines' ends that lie on it
    line = [np.arange(count), np.arange(count), first[crossing], second[crossing]]
    at = [end[:, 0], end[:, 1], cut, cut]
    for one, other in ((first, second), (second, first)):
        for which in (0, 1):
            on = _lies_on(points[end[other, which]], ends[one], near)
            line.append(one[on])
            at.append(end[other[on], which])
    lines, cuts = np.concatenate(line), np.concatenate(at)
    start = ends[lines, 0]
    place = np.einsum("nk,nk->n", points[cuts] - start, ends[lines, 1] - start)
    order = np.lexsort((place, lines))
    lines, cuts = lines[order], cuts[order]
    joined = (lines[1:] == lines[:-1]) & (cuts[1:] != cuts[:-1])
    return points, np.stack([cuts[:-1], cuts[1:]], axis=1)[joined], lines[1:][joined]


def _refuse_tangle(low: Floats, high: Floats) -> None:
    """Refuse lines of which so many cross that they are no crease pattern: in one, few lines meet
    each line. The boxes ``low`` to ``high`` (n, 2) of some lines tell for all.
    """
    count = len(low)
    some = np.arange(0, count, max(count // _SAMPLE, 1))
    meet = sum(int(((low[i] <= high) & (low <= high[i])).all(axis=1).sum()) for i in some)
    if meet / len(some) * count / 2 > max(_FEW_MEETINGS, _MEETINGS * count):
        raise PatternError("Too many lines of the drawing cross each other for a crease pattern.")


def _merged(loose: Floats, near: float) -> tuple[Ints, Floats]:
    """The vertex of each loose point, and the vertices: the first point of each that met."""
    pairs = cKDTree(loose).query_pairs(near, output_type="ndarray")
    _, label = connected_components(_graph(pairs, len(loose)), directed=False)
    _, first, vertex = np.unique(label, return_index=True, return_inverse=True)
    return np.asarray(vertex, dtype=np.int64), loose[first]


def _lies_on(points: Floats, ends: Floats, near: float) -> Bools:
    """Whether each point lies within ``near`` of its line, between the line's ends."""
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1)
    offset = points - ends[:, 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        place = np.einsum("nk,nk->n", offset, along) / length
        away = np.abs(_cross(along, offset)) / length
    return np.asarray((away <= near) & (place > near) & (place < length - near))


def _without_doubles(sides: Ints, source: Ints, assignment: NDArray[np.str_]) -> tuple[Ints, Ints]:
    """One side between two vertices, the side of the highest rank."""
    rank = np.array([_RANK[letter] for letter in assignment.tolist()])
    key = np.sort(sides, axis=1)
    order = np.lexsort((source, -rank[source], key[:, 1], key[:, 0]))
    different = np.ones(len(order), dtype=bool)
    different[1:] = (np.diff(key[order], axis=0) != 0).any(axis=1)
    kept = np.sort(order[different])
    return sides[kept], source[kept]


def _without_loose_ends(points: Floats, sides: Ints, source: Ints) -> tuple[Floats, Ints, Ints]:
    """Without the sides that end at a vertex of no other side, and without unused points."""
    while True:
        degree = np.bincount(sides.ravel(), minlength=len(points))
        firm = (degree[sides] > 1).all(axis=1)
        if firm.all():
            break
        sides, source = sides[firm], source[firm]
    used = np.unique(sides)
    renumber = np.zeros(len(points), dtype=np.int64)
    renumber[used] = np.arange(len(used))
    return points[used], renumber[sides], source


def without_holes(
    faces: Ints, piece: Ints, sides: Ints, letter: NDArray[np.str_], vertices: int
) -> Bools:
    """(F,) all but the facets that only border lines enclose; in a piece of only such, all."""
    face, side = _face_sides(faces, sides, vertices)
    cut = np.isin(letter[side], ("B", "C"))
    creased = np.bincount(face, ~cut, minlength=len(faces)) > 0
    bare = np.bincount(piece, creased) == 0
    return np.asarray(creased | bare[piece])


def _refuse_loose(points: Floats, faces: Ints, piece: Ints) -> None:
    """Refuse a piece that lies inside a facet of another: its first corner shows it."""
    start, end = points[filled(faces)], np.roll(points[filled(faces)], -1, axis=1)
    for number in range(int(piece.max()) + 1):
        x, y = points[faces[np.argmax(piece == number), 0]]
        over = (start[..., 1] > y) != (end[..., 1] > y)
        with np.errstate(invalid="ignore", divide="ignore"):
            part = (y - start[..., 1]) / (end[..., 1] - start[..., 1])
            right = over & (start[..., 0] + part * (end[..., 0] - start[..., 0]) > x)
        inside = (right.sum(axis=1) % 2 == 1) & (piece != number)
        if inside.any():
            raise PatternError(
                f"A part of the drawing, at ({x:.6g}, {y:.6g}), lies loose inside a facet of "
                "another; join them by a crease, or give a larger `tolerance`."
            )


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


def _graph(pairs: Ints, nodes: int) -> coo_array:
    return coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(nodes, nodes))


def _cross(a: Floats, b: Floats) -> Floats:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
