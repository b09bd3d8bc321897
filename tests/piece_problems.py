"""Exact patterns of several pieces and of trimmed facets, in closed form, for all tests.

``trimmed()`` is a Miura-ori with a round outline, ``two_pieces()`` a cylinder cut along a column,
``gores()`` a tube in four strips that close on each other, ``two_trimmed_pieces()`` both at once.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from problems import CELL

from miurafab.geometry.quads import QuadCharts
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.cylinder import cylinder_on, cylinder_over_polyline
from miurafab.origami.miura import regular_miura
from miurafab.origami.unfold import unfold, unfold_charts
from miurafab.surfaces.analytic import GeneralizedCylinder
from miurafab.surfaces.catalogue import make_surface


def cylinder_points(columns: int, rows: int, size: float = 200.0) -> np.ndarray:
    """(V, 3) the vertices of a cylinder's tessellation by direct construction, mm."""
    surface = make_surface("cylinder", {})[0]
    assert isinstance(surface, GeneralizedCylinder)
    points = cylinder_on(surface, columns, rows, 0.83, 1.4).vertices
    return points * size / np.ptp(points, axis=0).max()


@cache
def two_pieces(columns: int = 9, rows: int = 9, after: int = 4) -> CreasePattern:
    """A cylinder of ``columns`` x ``rows`` vertices, cut along the column of number ``after``."""
    piece = (np.arange(columns - 1) >= after).astype(np.int64)
    charts = QuadCharts.of_cells(np.ones((rows - 1, columns - 1), dtype=bool), piece)
    return unfold_charts(charts, cylinder_points(columns, rows))


def tube_points(sides: int = 12, along: int = 7, size: float = 30.0) -> np.ndarray:
    """(V, 3) a closed tube over a star of ``sides`` (even) corners; columns run round it."""
    turn = 2 * np.pi * np.arange(-1, sides + 2) / sides
    radius = size * np.where(np.arange(-1, sides + 2) % 2, 1.3, 1.0)
    profile = radius[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    points = cylinder_over_polyline(profile, 0.5 * size, 0.15 * size, along).points
    return points[:0:-1].transpose(1, 0, 2).reshape(-1, 3)


def ring_charts(
    sides: int = 12, along: int = 7, piece_of_column: np.ndarray | None = None
) -> QuadCharts:
    """The charts of :func:`tube_points`, closed all round."""
    whole = np.ones((along - 1, sides), dtype=bool)
    return QuadCharts.of_cells(whole, piece_of_column, closed=True)


@cache
def gores(pieces: int = 4, sides: int = 12, along: int = 7) -> CreasePattern:
    """A closed tube in ``pieces`` strips, the last joined to the first."""
    strip = np.arange(sides) * pieces // sides
    return unfold_charts(ring_charts(sides, along, strip), tube_points(sides, along))


@cache
def trimmed(columns: int = 11, rows: int = 11, radius: float = 0.47) -> CreasePattern:
    """A regular Miura-ori inside a circle of ``radius`` times its size, seen from above."""
    pattern = unfold(regular_miura(CELL, columns, rows))
    return inside_circle(pattern, radius)


@cache
def two_trimmed_pieces() -> CreasePattern:
    """:func:`two_pieces` inside a circle seen from above."""
    return inside_circle(two_pieces(), 0.45)


def inside_circle(pattern: CreasePattern, radius: float) -> CreasePattern:
    """``pattern`` cut to a circle of ``radius`` times its smaller side, seen from above."""
    assert pattern.folded_coords is not None
    seen = pattern.folded_coords[:, :2]
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
    reach = radius * float(np.ptp(seen, axis=0).min())
    return cut_to(pattern, reach - np.linalg.norm(seen - middle, axis=1))


def cut_to(pattern: CreasePattern, level: np.ndarray) -> CreasePattern:
    """The part of ``pattern`` where ``level`` (V,) is positive.

    Each edge whose ends differ in sign is cut where the level, linear along the edge, is zero. Both
    forms are cut at the same part of the edge, and each facet by one chord, so that the part is as
    exact as the whole.
    """
    assert pattern.folded_coords is not None
    forms = np.concatenate([pattern.vertices_coords, pattern.folded_coords], axis=1)
    points: list[np.ndarray] = []
    number: dict[tuple[int, int], int] = {}

    def vertex(a: int, b: int) -> int:
        """The vertex ``a``, or the cut of the edge from ``a`` to ``b``."""
        a, b = min(a, b), max(a, b)
        if (a, b) not in number:
            part = 0.0 if a == b else level[a] / (level[a] - level[b])
            number[a, b] = len(points)
            points.append(forms[a] + part * (forms[b] - forms[a]))
        return number[a, b]

    faces: list[list[int]] = []
    kept: list[int] = []
    for facet, corners in enumerate(pattern.faces_vertices.tolist()):
        polygon = []
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
            if level[a] > 0:
                polygon.append(vertex(a, a))
            if (level[a] > 0) != (level[b] > 0):
                polygon.append(vertex(a, b))
        if polygon:
            faces.append(polygon)
            kept.append(facet)

    edges: dict[tuple[int, int], list[int]] = {}
    for facet, polygon in enumerate(faces):
        for a, b in zip(polygon, polygon[1:] + polygon[:1], strict=True):
            edges.setdefault((min(a, b), max(a, b)), []).append(facet)
    source = {}
    for edge, (a, b) in enumerate(pattern.edges_vertices.tolist()):
        ends = [number.get(key) for key in ((a, a), (b, b), (min(a, b), max(a, b)))]
        ends = [end for end in ends if end is not None]
        if len(ends) == 2:
            source[min(ends), max(ends)] = edge
    names = list(edges)
    place = {source[name]: at for at, name in enumerate(names) if name in source}
    inner = [len(edges[name]) == 2 for name in names]
    old = [source.get(name, 0) for name in names]
    seams = [] if pattern.seams is None else pattern.seams.tolist()
    mates = [(place[a], place[b]) for a, b in seams if a in place and b in place]
    cells = pattern.cells
    if cells is None:
        assert pattern.grid is not None
        cells = np.stack(np.divmod(np.arange(len(pattern.faces_vertices)), pattern.grid[0] - 1), 1)
        cells = cells[:, ::-1]
    width = max(map(len, faces))
    places = np.array(points)
    return CreasePattern(
        vertices_coords=places[:, :2],
        edges_vertices=np.array(names),
        edges_assignment=np.where(inner, pattern.edges_assignment[old], "B"),
        edges_fold_angle=np.where(inner, pattern.edges_fold_angle[old], 0.0),
        faces_vertices=np.array([face + [-1] * (width - len(face)) for face in faces]),
        folded_coords=places[:, 2:],
        pieces=None if pattern.pieces is None else pattern.pieces[kept],
        seams=np.array(mates) if mates else None,
        cells=cells[kept],
        scale=pattern.scale,
        target=pattern.target,
    )
