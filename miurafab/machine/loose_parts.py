"""Pieces that are cut loose while the job goes on, and outlines that do not close.

After an outline has been cut all round, its piece may have tipped, fallen or blown away. A later
stroke there misses its place; and on a tipped piece the beam is out of focus and close to the
material below, which is how sheets catch fire. So nothing may be burnt inside an outline after its
last pass. An outline that almost closes was meant to close: it holds its piece by a thread that
nobody sees until the sheet is lifted.

Only the job can say which strokes cut *through*: those after ``(operation cut)``. In a job that
names no operations every closed stroke may be an outline, and may be an engraving; that is a
warning and no refusal.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from miurafab.gcode.program import Program, Strokes, strokes
from miurafab.geometry.arrays import Bools, Floats, Ints

CUT = "cut"
_CLOSED = 0.02  # mm; ends nearer than this meet: G-code has three decimals, kerf is ten times more
_OPEN_SHARE = 0.25  # an outline's gap is at most this share of its length; a zigzag's ends are far
_LEAST_MOVES = 3
_POINTS_AT_ONCE = 4096


@dataclass(frozen=True, slots=True)
class LooseStroke:
    """A stroke at fault: its ``line``, and ``outline_line``, where the outline begins.

    ``gap_mm`` is for an outline that does not close.
    """

    line: int
    outline_line: int
    gap_mm: float = 0.0


@dataclass(frozen=True)
class _Path:
    """Strokes joined end to end: their points (n, 2), and their first and last move."""

    points: Floats
    first_move: int
    last_move: int

    @property
    def gap(self) -> float:
        return float(np.linalg.norm(self.points[-1] - self.points[0]))


def says_operations(program: Program) -> bool:
    """Whether the job names the operations of its strokes."""
    return any(context.operation for context in program.contexts)


def burnt_on_loose_pieces(program: Program) -> Iterator[LooseStroke]:
    """For each outline, the first later stroke inside it.

    In a job that names no operations, each closed stroke counts as an outline.
    """
    table = strokes(program)
    chosen = _without_lone_dashes(table, _through(table, program))
    outlines = [path for path in _paths(table, chosen) if path.gap <= _CLOSED]
    if not outlines:
        return
    burns = np.flatnonzero(program.beam_on)
    middle = 0.5 * (program.start[burns, :2] + program.end[burns, :2])
    order = np.argsort(middle[:, 0], kind="stable")
    sorted_x = middle[order, 0]
    for outline in _last_passes(outlines):
        low, high = outline.points.min(axis=0), outline.points.max(axis=0)
        begin, stop = np.searchsorted(sorted_x, (low[0], high[0]))
        near = order[begin:stop]
        y = middle[near, 1]
        near = near[(burns[near] > outline.last_move) & (y > low[1]) & (y < high[1])]
        for chunk in np.split(np.sort(near), range(_POINTS_AT_ONCE, len(near), _POINTS_AT_ONCE)):
            inside = _inside(middle[chunk], outline.points)
            if inside.any():
                move = burns[chunk[np.argmax(inside)]]
                yield LooseStroke(int(program.line[move]), int(program.line[outline.first_move]))
                break


def open_outlines(program: Program) -> Iterator[LooseStroke]:
    """Outlines of operation ``cut`` whose end misses their beginning.

    A stroke whose ends are near other cut strokes is not such an outline: it is a part of an
    outline held by bridges.
    """
    table = strokes(program)
    paths = _paths(table, _through(table, program)) if says_operations(program) else []
    ends = np.array([(path.points[0], path.points[-1]) for path in paths]).reshape(-1, 2, 2)
    for index, path in enumerate(paths):
        length = float(np.linalg.norm(np.diff(path.points, axis=0), axis=1).sum())
        if len(path.points) <= _LEAST_MOVES or not _CLOSED < path.gap <= _OPEN_SHARE * length:
            continue
        others = np.delete(ends, index, axis=0).reshape(-1, 2)
        reach = np.linalg.norm(others[:, None] - ends[index], axis=2)
        if not (reach <= path.gap + _CLOSED).any():
            line = int(program.line[path.last_move])
            yield LooseStroke(line, int(program.line[path.first_move]), path.gap)


def _through(table: Strokes, program: Program) -> Ints:
    """The indices of the strokes of operation ``cut``; of all strokes if none is named."""
    cut = np.array([c.operation == CUT for c in table.contexts], dtype=bool)
    return np.flatnonzero(cut[table.context] | (not says_operations(program)))


def _without_lone_dashes(table: Strokes, chosen: Ints) -> Ints:
    """``chosen`` without short strokes that do not join their neighbours: most, and no outline."""
    begin, end = table.offsets[:-1][chosen], table.offsets[1:][chosen]
    first, last = table.points[begin, :2], table.points[end - 1, :2]
    meets = np.zeros(len(chosen) + 1, dtype=bool)  # the one before it
    meets[1:-1] = np.linalg.norm(first[1:] - last[:-1], axis=1) <= _CLOSED
    return chosen[(end - begin > _LEAST_MOVES) | meets[:-1] | meets[1:]]


def _paths(table: Strokes, chosen: Ints) -> list[_Path]:
    """The ``chosen`` strokes, joined where one begins at the end of the stroke before it."""
    paths: list[_Path] = []
    for index in chosen.tolist():
        for path in _rounds(table.stroke(index)[:, :2], int(table.first_move[index])):
            before = paths[-1] if paths else None
            if (
                before is not None
                and before.gap > _CLOSED
                and np.linalg.norm(before.points[-1] - path.points[0]) <= _CLOSED
            ):
                joined = np.concatenate([before.points, path.points[1:]])
                paths[-1] = _Path(joined, before.first_move, path.last_move)
            else:
                paths.append(path)
    return paths


def _rounds(points: Floats, first_move: int) -> Iterator[_Path]:
    """A stroke split where it returns to its beginning: several passes without a travel."""
    back = np.flatnonzero(np.linalg.norm(points - points[0], axis=1) <= _CLOSED)
    back = back[(back >= _LEAST_MOVES) & (back < len(points) - 1)]
    bounds = [0, *back[np.diff(back, prepend=0) >= _LEAST_MOVES].tolist(), len(points) - 1]
    for begin, end in pairwise(bounds):
        yield _Path(points[begin : end + 1], first_move + begin, first_move + end - 1)


def _last_passes(outlines: list[_Path]) -> list[_Path]:
    """The last pass of each outline: only after that pass is the piece loose."""
    last: dict[tuple[int, ...], _Path] = {}
    for outline in outlines:
        low, high = outline.points.min(axis=0), outline.points.max(axis=0)
        around = np.linalg.norm(np.diff(outline.points, axis=0), axis=1).sum()
        last[tuple(np.round(np.array([*low, *high, around]) / _CLOSED).astype(int))] = outline
    return [outline for outline in last.values() if len(outline.points) > _LEAST_MOVES]


def _inside(points: Floats, polygon: Floats) -> Bools:
    """(k,) whether ``points`` (k, 2) lie inside ``polygon`` (n, 2), farther than the tolerance from
    its edges: an even-odd count of the edges that a ray along X crosses.
    """
    inside = np.zeros(len(points), dtype=bool)
    nearest = np.full(len(points), np.inf)
    x, y = points.T
    for (ax, ay), (bx, by) in pairwise([*polygon.tolist(), polygon[0].tolist()]):
        crosses = (ay > y) != (by > y)
        if crosses.any():
            at = ax + (y - ay) * (bx - ax) / ((by - ay) or 1.0)
            inside ^= crosses & (x < at)
        square = (bx - ax) ** 2 + (by - ay) ** 2
        along = ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / (square or 1.0)
        along = np.clip(along, 0.0, 1.0)
        nearest = np.minimum(
            nearest, np.hypot(ax + along * (bx - ax) - x, ay + along * (by - ay) - y)
        )
    return np.asarray(inside & (nearest > _CLOSED))
