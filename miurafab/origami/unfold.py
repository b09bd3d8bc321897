"""Unfolding: a developable tessellation laid flat without stretching, with its fold angles.

Each piece is developed by itself (:mod:`miurafab.origami.development`), turned with its rows along
x, and laid beside the others. The flat pattern is isometric as far as the sheet is developable and
planar; verification measures that independently.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from miurafab.geometry.angles import fold_angles
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.polygons import edge_lengths, facet_normals
from miurafab.geometry.quads import QuadCharts
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.development import Development, develop
from miurafab.origami.meeting_borders import meeting_borders
from miurafab.origami.piece import shelved
from miurafab.origami.tessellation import Tessellation

FLAT_ANGLE = 1e-9
"""Radians; an edge with a smaller fold angle is flat and not folded."""
HALF_TURN = 1e-6
"""Radians; closer to half a turn than this, rounding decides on the sign of a fold angle."""


def unfold(
    tessellation: Tessellation, *, scale: float = 1.0, target: dict[str, Any] | None = None
) -> CreasePattern:
    """The crease pattern of ``tessellation``, with rows along x, in the first quadrant."""
    grid = tessellation.grid
    whole = np.ones((grid.rows - 1, grid.columns - 1), dtype=bool)
    charts = QuadCharts.of_cells(whole)
    return unfold_charts(charts, tessellation.vertices, scale=scale, target=target)


def unfold_charts(
    charts: QuadCharts,
    points: Floats,
    *,
    scale: float = 1.0,
    target: dict[str, Any] | None = None,
) -> CreasePattern:
    """The crease pattern of ``charts`` at ``points`` (V, 3), one piece for each chart.

    A chart that does not hang together by creases gives several pieces. A chart that closes on
    itself is opened along a seam. The pattern has ``pieces`` if there are several, ``grid`` if it
    is one full grid and else ``cells``. Facets keep their order; vertices are ordered by piece, row
    and column.
    """
    flat = develop(charts, points)
    f = flat.faces_vertices
    along = np.unique(np.concatenate([f[:, [0, 1]], f[:, [3, 2]]]), axis=0)
    across = np.unique(np.concatenate([f[:, [0, 3]], f[:, [1, 2]]]), axis=0)
    edges = np.concatenate([along, across])
    pieces = int(flat.pieces.max()) + 1
    seams = _seams(flat.vertices[edges])
    grid = _full_grid(charts.cells, len(flat.vertices)) if pieces == 1 else None
    pattern = CreasePattern(
        vertices_coords=_laid_apart(flat, along, edges),
        edges_vertices=edges,
        edges_assignment=np.full(len(edges), "U"),
        edges_fold_angle=np.zeros(len(edges)),
        faces_vertices=f,
        folded_coords=points[flat.vertices],
        grid=grid,
        pieces=flat.pieces if pieces > 1 else None,
        cells=charts.cells if grid is None else None,
        scale=scale,
        target=target or {},
    )
    pattern = with_angles_of_the_folded_form(pattern)
    if not len(seams):
        return pattern
    # the two ends of a band that goes all round have vertices of their own
    ends_met = meeting_borders(pattern)
    ends_met = ends_met[~np.isin(ends_met, seams).any(axis=1)]
    return replace(pattern, seams=np.concatenate([seams, ends_met]))


def _seams(ends: Ints) -> Ints:
    """(S, 2) the pairs of edges whose ``ends`` (E, 2) are the same two vertices of the charts."""
    ends = np.sort(ends, axis=1)
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    twice = np.flatnonzero((ends[order[1:]] == ends[order[:-1]]).all(axis=1))
    pairs = np.stack([order[twice], order[twice + 1]], axis=1)
    return pairs[np.argsort(pairs[:, 0])]


def _full_grid(cells: Ints, vertices: int) -> tuple[int, int] | None:
    """Columns and rows of vertices, if ``cells`` (F, 2) fill a grid row by row; else None."""
    columns, rows = (np.ptp(cells, axis=0) + 1).tolist()
    column, row = (cells - cells.min(axis=0)).T
    in_order = np.array_equal(row * columns + column, np.arange(columns * rows))
    whole = in_order and vertices == (columns + 1) * (rows + 1)
    return (columns + 1, rows + 1) if whole else None


def _laid_apart(flat: Development, along: Ints, edges: Ints) -> Floats:
    """(V, 2) the vertices with each piece upright, the pieces apart in the first quadrant.

    They stand in rows, with the mean edge for a gap.
    """
    places = flat.places.copy()
    piece = np.empty(len(places), dtype=np.int64)
    piece[flat.faces_vertices] = flat.pieces[:, None]
    starts = np.flatnonzero(np.diff(piece, prepend=-1))
    ends = np.append(starts[1:], len(places))
    for start, end in zip(starts, ends, strict=True):
        own = along[(along[:, 0] >= start) & (along[:, 0] < end)]
        places[start:end] = turned_upright(places[start:end], own - start)
    if len(starts) == 1:
        return places
    gap = float(edge_lengths(places, edges).mean())
    sizes = np.array([places[a:b].max(axis=0) for a, b in zip(starts, ends, strict=True)])
    for start, end, move in zip(starts, ends, shelved(sizes, gap), strict=True):
        places[start:end] += move
    return places


def turned_upright(flat: Floats, along: Ints) -> Floats:
    """``flat`` (V, 2) turned until its edges ``along`` (n, 2) point on average along x, with its
    bounding box in the first quadrant.
    """
    c, s = (flat[along[:, 1]] - flat[along[:, 0]]).sum(axis=0)
    length = math.hypot(c, s)
    turned = flat @ (np.array([[c, -s], [s, c]]) / length) if length > 0 else flat
    return np.asarray(turned - turned.min(axis=0))


def with_angles_of_the_folded_form(
    pattern: CreasePattern, own: Bools | None = None
) -> CreasePattern:
    """``pattern`` with its fold angles measured in its folded form, for facets of any shape, but
    for the edges whose ``own`` (E,) letter and angle are known.

    The sign makes a mountain or valley; borders, cuts and joins stay. Half a turn to either side is
    the same form, so there a mountain stays one. The fold angle at a crease or facet without extent
    is 0.
    """
    assert pattern.folded_coords is not None
    normals = facet_normals(pattern.folded_coords, pattern.faces_vertices)
    inner = (pattern.edges_faces >= 0).all(axis=1)
    left, right = (normals[pattern.edges_faces[inner, side]] for side in (0, 1))
    angle = np.zeros(len(pattern.edges_vertices))
    with np.errstate(invalid="ignore", divide="ignore"):
        turned = fold_angles(pattern.folded_coords, pattern.edges_vertices[inner], left, right)
    angle[inner] = np.nan_to_num(turned)
    half = np.abs(angle) > np.pi - HALF_TURN
    told = half & np.isin(pattern.edges_assignment, ("M", "V"))
    angle[told] = np.where(pattern.edges_assignment[told] == "M", -1, 1) * np.abs(angle[told])
    letter = np.where(angle > FLAT_ANGLE, "V", np.where(angle < -FLAT_ANGLE, "M", "F"))
    folds = inner & ~np.isin(pattern.edges_assignment, ("B", "C", "J"))
    kept = np.where(~inner & (pattern.edges_assignment != "C"), "B", pattern.edges_assignment)
    letters, angles = np.where(folds, letter, kept), np.where(folds, angle, 0.0)
    if own is not None:
        letters = np.where(own, pattern.edges_assignment, letters)
        angles = np.where(own, pattern.edges_fold_angle, angles)
    return replace(pattern, edges_assignment=letters, edges_fold_angle=angles)
