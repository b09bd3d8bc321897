"""Where the lines of a drawing meet: ends that nearly coincide, ends on lines, and crossings."""

from __future__ import annotations

import numpy as np

from miurafab.errors import PatternError
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.boxes import meeting_pairs
from miurafab.geometry.connected import components
from miurafab.geometry.nearest import tree_of
from miurafab.origami.formats.crease_lines import CreaseLines
from miurafab.origami.formats.settled_parts import DrawnSides

_SAMPLE, _MEETINGS, _FEW_MEETINGS = 200, 20, 1_000_000


def split_lines(lines: CreaseLines, near: float) -> DrawnSides:
    """``lines`` cut where they meet; ends and crossings within ``near`` of each other are one."""
    ends = lines.ends
    width = np.full(len(ends), near)
    if lines.curve is not None:
        width[lines.curve >= 0] += lines.curve_tolerance
    low, high = ends.min(axis=1) - width[:, None], ends.max(axis=1)
    high = high + (width - near)[:, None]
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
    # a line that ends on a curve ends there, and not where it crosses a line in place of the curve
    for one, other in ((first, second), (second, first)):
        for which in (0, 1):
            crossing &= ~((width[one] > near) & _lies_on(ends[other, which], ends[one], width[one]))
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
            on = _lies_on(points[end[other, which]], ends[one], width[one])
            line.append(one[on])
            at.append(end[other[on], which])
    owners, cuts = np.concatenate(line), np.concatenate(at)
    start = ends[owners, 0]
    place = np.einsum("nk,nk->n", points[cuts] - start, ends[owners, 1] - start)
    order = np.lexsort((place, owners))
    owners, cuts = owners[order], cuts[order]
    joined = (owners[1:] == owners[:-1]) & (cuts[1:] != cuts[:-1])
    sides = np.stack([cuts[:-1], cuts[1:]], axis=1)[joined]
    return DrawnSides(points, sides, owners[1:][joined], end)


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
    pairs = tree_of(loose).query_pairs(near, output_type="ndarray")
    label = components(len(loose), *pairs.T)
    _, first, vertex = np.unique(label, return_index=True, return_inverse=True)
    return np.asarray(vertex, dtype=np.int64), loose[first]


def _lies_on(points: Floats, ends: Floats, near: Floats) -> Bools:
    """Whether each point lies within ``near`` (n,) of its line, between the line's ends."""
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1)
    offset = points - ends[:, 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        place = np.einsum("nk,nk->n", offset, along) / length
        away = np.abs(_cross(along, offset)) / length
    return np.asarray((away <= near) & (place > near) & (place < length - near))


def _cross(a: Floats, b: Floats) -> Floats:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def lines_cross(points: Floats, edges: Ints) -> bool:
    """Whether two of ``edges`` (E, 2) at ``points`` (V, 2) cross each other between their ends, or
    one ends on the other.
    """
    if edges.max() >= len(points) or not np.isfinite(points).all():
        return False  # what reads them next says so
    ends = points[edges]
    low, high = ends.min(axis=1), ends.max(axis=1)
    first, second = meeting_pairs(*(np.pad(corner, ((0, 0), (0, 1))) for corner in (low, high)))
    apart = (edges[first][:, :, None] != edges[second][:, None, :]).all(axis=(1, 2))
    a, b = ends[first[apart]], ends[second[apart]]
    along, across = a[:, 1] - a[:, 0], b[:, 1] - b[:, 0]
    scale = 1e-9 * np.linalg.norm(along, axis=1) * np.linalg.norm(across, axis=1)
    one = _cross(along, b[:, 0] - a[:, 0]), _cross(along, b[:, 1] - a[:, 0])
    other = _cross(across, a[:, 0] - b[:, 0]), _cross(across, a[:, 1] - b[:, 0])
    parts = [(np.minimum(*pair) <= scale) & (np.maximum(*pair) >= -scale) for pair in (one, other)]
    level = np.abs(_cross(along, across)) <= scale
    return bool((parts[0] & parts[1] & ~level).any())
