"""Opening a ring elsewhere: its flat strip is cut along another line and joined at its old ends.

The pattern of a ring that closes along its rows is a strip of n rows of facets. In the folded form
its last line of vertices P_n lies on its first line P_0. Opened after row k, it is the strip of the
same facets that starts with row k + 1:

    g P_k, ..., g P_(n-1), P_0, ..., P_k,    g the motion of the plane with g P_n = P_0

Such a motion exists if the two ends are congruent. They are if the closed sheet is developable at
its seam: the flat angles of both sides at each seam vertex sum to 2 pi. The vertices of the old
seam become inner vertices, and its crease folds as in the folded form; the line after row k becomes
border. Along columns, rows and columns are exchanged. A pattern opened after row k and then after
row n - k is the original pattern.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from miurafab.errors import LayoutError
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.seams import border_seams
from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.quads import QuadGrid
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.meeting_borders import COINCIDENT
from miurafab.origami.unfold import turned_upright, with_angles_of_the_folded_form

_T = TypeVar("_T", np.float64, np.int64)

_AXES = ("row", "column")


def opened(pattern: CreasePattern, options: LayoutOptions) -> CreasePattern:
    """``pattern`` opened where ``options`` say, unchanged if they say nothing.

    Raises :class:`~miurafab.errors.LayoutError` as :func:`open_ring` does.
    """
    for axis, line in enumerate((options.open_row, options.open_column)):
        if line is not None:
            pattern = open_ring(pattern, axis, line)
    return pattern


def open_ring(pattern: CreasePattern, axis: int, line: int) -> CreasePattern:
    """A ring along its rows (``axis`` 0) or columns (1), opened after the ``line``-th, from 1.

    Its arrays are in the order of the grid, its rows along x, its box in the first quadrant. Raises
    :class:`~miurafab.errors.LayoutError` where the facets form no grid, the folded form does not
    close along that axis, there is no such line, or the two ends are not congruent.
    """
    name = _AXES[axis]
    refused = f"The ring cannot be opened after {name} {line}: "
    parts = _parts(pattern)
    if parts is None:
        raise LayoutError(f"{refused}the facets of this pattern do not form a grid.")
    if pattern.folded_coords is None:
        raise LayoutError(f"{refused}where it closes is seen in the folded form, which is missing.")
    if not _closes(pattern, parts, axis):
        other = 1 - axis
        hint = f"; it closes along its {_AXES[other]}s" if _closes(pattern, parts, other) else ""
        raise LayoutError(
            f"{refused}its first and last {name} do not come together in the folded form{hint}."
        )
    count = parts.facets.shape[axis]
    if not 1 <= line < count:
        raise LayoutError(f"{refused}with {count} {name}s it may be 1 to {count - 1}.")
    grid = parts.grid
    flat = pattern.vertices_coords.reshape(grid.rows, grid.columns, 2)
    folded = pattern.folded_coords.reshape(grid.rows, grid.columns, 3)
    moved, miss = _laid(flat, axis)
    if miss > COINCIDENT * float(np.linalg.norm(np.ptp(pattern.folded_coords, axis=0))):
        raise LayoutError(
            f"{refused}laid on each other in the flat pattern, its two ends differ by up to "
            f"{miss:.3g} mm."
        )
    edges, joint, ends = _edges(parts, axis, line)
    letters, angles = pattern.edges_assignment[edges], pattern.edges_fold_angle[edges]
    letters[ends], letters[joint], angles[ends] = "B", "U", 0.0
    made = replace(
        pattern,
        vertices_coords=turned_upright(
            _spliced(moved, flat, axis, line).reshape(-1, 2),
            grid.edges_vertices[: parts.along.size],
        ),
        edges_vertices=grid.edges_vertices,
        edges_assignment=letters,
        edges_fold_angle=angles,
        faces_vertices=_faces(pattern, parts, axis, line),
        folded_coords=_spliced(folded, folded, axis, line).reshape(-1, 3),
        seams=None,
    )
    if pattern.seams is not None:
        made = replace(made, seams=border_seams(made).edges)
    measured = with_angles_of_the_folded_form(made)
    letters[joint] = measured.edges_assignment[joint]
    angles[joint] = measured.edges_fold_angle[joint]
    return replace(made, edges_assignment=letters, edges_fold_angle=angles)


@dataclass(frozen=True, eq=False)
class _Parts:
    """The parts of a ``grid`` of R x C vertices by their numbers in the pattern: the edges
    ``along`` its rows (R, C - 1), the edges ``across`` (R - 1, C), its ``facets`` (R - 1, C - 1).
    """

    grid: QuadGrid
    along: Ints
    across: Ints
    facets: Ints

    def on_lines(self, axis: int) -> Ints:
        """The edges that lie on each row (``axis`` 0) or column (1) of vertices."""
        return self.along if axis == 0 else self.across.T


def _parts(pattern: CreasePattern) -> _Parts | None:
    """The parts of the grid of ``pattern``; None if its edges and facets form no grid."""
    if pattern.grid is None:
        return None
    grid = QuadGrid(*pattern.grid)
    edges = _places(pattern.edges_vertices, grid.edges_vertices)
    facets = _places(pattern.faces_vertices, grid.faces_vertices)
    return None if edges is None or facets is None else _placed(grid, edges, facets)


def _placed(grid: QuadGrid, edges: Ints, facets: Ints) -> _Parts:
    """``edges`` (E,) and ``facets`` (F,) of the order of the grid as its parts."""
    rows, columns = grid.rows, grid.columns
    along, across = np.split(edges, [rows * (columns - 1)])
    return _Parts(
        grid,
        along.reshape(rows, columns - 1),
        across.reshape(rows - 1, columns),
        facets.reshape(rows - 1, columns - 1),
    )


def _places(found: Ints, wanted: Ints) -> Ints | None:
    """(n,) the row of ``found`` (n, k) with the vertices of each row of ``wanted`` (n, k), or None
    if the sets of vertices differ.
    """
    if found.shape != wanted.shape:
        return None
    here, there = np.sort(found, axis=1), np.sort(wanted, axis=1)
    order, to = np.lexsort(here.T), np.lexsort(there.T)
    if not np.array_equal(here[order], there[to]):
        return None
    places = np.empty(len(order), dtype=np.int64)
    places[to] = order
    return places


def _closes(pattern: CreasePattern, parts: _Parts, axis: int) -> bool:
    """Whether each edge of the first line is glued to its edge of the last line."""
    lines = parts.on_lines(axis)
    wanted = np.sort(lines[[0, -1]].T, axis=1)
    glued = np.sort(border_seams(pattern).edges, axis=1)
    return set(map(tuple, wanted.tolist())) <= set(map(tuple, glued.tolist()))


def _spliced(beyond: NDArray[_T], before: NDArray[_T], axis: int, line: int) -> NDArray[_T]:
    """The lines of ``beyond`` from ``line`` to the last but one, then ``before`` up to ``line``."""
    last = beyond.shape[axis] - 1
    parts = beyond.take(range(line, last), axis), before.take(range(line + 1), axis)
    return np.concatenate(parts, axis)


def _laid(flat: Floats, axis: int) -> tuple[Floats, float]:
    """``flat`` (R, C, 2) moved in the plane so that its last line lies on its first line, and the
    largest distance of two corresponding vertices.
    """
    points = flat @ np.array([1.0, 1.0j])
    first, last = points.take(0, axis), points.take(-1, axis)
    turn = np.vdot(last - last.mean(), first - first.mean())
    moved = (points - last.mean()) * (turn / abs(turn)) + first.mean()
    miss = float(np.abs(moved.take(-1, axis) - first).max())
    return np.stack([moved.real, moved.imag], axis=-1), miss


def _edges(parts: _Parts, axis: int, line: int) -> tuple[Ints, Ints, Ints]:
    """(E,) the edges in the order of the opened grid, and the places in it of the crease on the old
    seam (m,) and of the two borders along the line (2, m).
    """
    grid, along, across = parts.grid, parts.along, parts.across
    if axis == 0:
        along, across = _spliced(along, along, axis, line), np.roll(across, -line, axis)
    else:
        along, across = np.roll(along, -line, axis), _spliced(across, across, axis, line)
    edges = np.concatenate([along.ravel(), across.ravel()])
    lines = _placed(grid, np.arange(len(edges)), parts.facets).on_lines(axis)
    return edges, lines[-1 - line], lines[[0, -1]]


def _faces(pattern: CreasePattern, parts: _Parts, axis: int, line: int) -> Ints:
    """(F, 4) the facets in the order of the opened grid, each with its corners in their order."""
    grid = parts.grid
    facets = np.roll(parts.facets, -line, axis).ravel()
    row, column = np.divmod(pattern.faces_vertices[facets], grid.columns)
    row -= row.min(axis=1, keepdims=True)
    column -= column.min(axis=1, keepdims=True)
    return np.asarray(grid.faces_vertices[:, :1] + row * grid.columns + column)
