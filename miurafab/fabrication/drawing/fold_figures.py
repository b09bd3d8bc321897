"""Small drawings that explain a fold: a mountain, a valley, a crossing, tabs, a wedge."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from reportlab.lib.colors import Color
from reportlab.lib.units import mm

from miurafab.fabrication.drawing.page import (
    CREASE_COLOURS,
    INK,
    MOUNTAIN,
    QUIET,
    VALLEY,
    Box,
    fitted,
    fold_lines,
    polygon,
    text,
    tint,
)
from miurafab.fabrication.drawing.svg_canvas import Pen
from miurafab.geometry.arrays import Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.picture import fills, project

_CROSSING_VIEW = math.radians(-65), math.radians(55)
"""The azimuth and elevation from which a crossing is seen, its middle normal upright."""


def mountain(canvas: Pen, box: Box) -> None:
    """Two facets that meet in a ridge."""
    _fold(canvas, box, 0.5, MOUNTAIN, "M")


def valley(canvas: Pen, box: Box) -> None:
    """Two facets that meet in a trough."""
    _fold(canvas, box, -0.5, VALLEY, "V")


def _fold(canvas: Pen, box: Box, lift: float, colour: Color, letter: str) -> None:
    crease = [(0.8, 0.0, lift), (0.8, 1.2, lift)]
    near = [(0.0, 0.0, 0.0), *crease, (0.0, 1.2, 0.0)]
    far = [crease[0], (1.6, 0.0, 0.0), (1.6, 1.2, 0.0), crease[1]]
    seen, _ = fitted(np.concatenate([_solid(near), _solid(far)]), box)
    leaves = [(0.4, seen[:4]), (0.85, seen[4:])]
    canvas.setStrokeColor(INK)
    canvas.setLineWidth(0.25 * mm)
    canvas.setLineJoin(1)
    # The facet farther from the viewer is drawn first.
    for strength, corners in leaves if lift < 0 else leaves[::-1]:
        canvas.setFillColor(tint(0, strength))
        polygon(canvas, corners, stroke=True)
    _crease(canvas, seen[1:3], colour, letter)


def _solid(points: Sequence[tuple[float, float, float]]) -> Floats:
    """Corners in space, seen from the front and above."""
    space = np.array(points)
    a, b = math.radians(24), math.radians(30)
    across = space[:, 0] * math.cos(a) - space[:, 1] * math.sin(a)
    away = space[:, 0] * math.sin(a) + space[:, 1] * math.cos(a)
    return np.column_stack([across, away * math.sin(b) + space[:, 2] * math.cos(b)])


def _crease(canvas: Pen, ends: Floats, colour: Color, letter: str) -> None:
    """A crease, drawn heavier than outlines; a valley is dashed."""
    canvas.setStrokeColor(colour)
    canvas.setLineWidth(0.8 * mm)
    canvas.setLineCap(0)
    canvas.lines((fold_lines(ends[None], letter) * mm).reshape(-1, 4).tolist())


def crossing_of(pattern: CreasePattern) -> int | None:
    """The vertex nearest to the middle where four creases meet, three of them of one kind."""
    folded = np.isin(pattern.edges_assignment, ("M", "V"))
    ends = pattern.edges_vertices[folded]
    count = len(pattern.vertices_coords)
    ways = np.bincount(ends.ravel(), minlength=count)
    up = np.bincount(pattern.edges_vertices[pattern.edges_assignment == "M"].ravel(), None, count)
    fit = np.flatnonzero((ways == 4) & np.isin(up, (1, 3)))
    if not len(fit):
        return None
    off = pattern.vertices_coords[fit] - pattern.vertices_coords.mean(axis=0)
    return int(fit[np.argmin(np.round(np.linalg.norm(off, axis=1), 6))])


def crossing(canvas: Pen, box: Box, pattern: CreasePattern, points: Floats, vertex: int) -> None:
    """The four facets round ``vertex``, folded as at ``points`` (V, 3), with their creases."""
    at = np.flatnonzero((pattern.edges_vertices == vertex).any(axis=1))
    own: Ints = np.unique(pattern.edges_faces[at])
    faces = pattern.faces_vertices[own[own >= 0]]
    corners = points[np.where(faces >= 0, faces, faces[:, :1])]
    spokes = corners - corners[:, :1]
    normal = np.cross(spokes, np.roll(spokes, -1, axis=1)).sum(axis=(0, 1))
    normal /= np.linalg.norm(normal)
    across = np.cross([0.0, 1.0, 0.0] if abs(normal[1]) < 0.9 else [1.0, 0.0, 0.0], normal)
    across /= np.linalg.norm(across)
    upright = points @ np.stack([across, np.cross(normal, across), normal], axis=1)
    view = project(upright, faces, *_CROSSING_VIEW)
    used = np.unique(faces[faces >= 0])
    place = np.zeros_like(view.places)
    place[used], _ = fitted(view.places[used], box)
    colours = fills(view) / 255
    canvas.setLineJoin(1)
    for face in view.order.tolist():
        canvas.setFillColor(Color(*colours[face].tolist()))
        canvas.setStrokeColor(INK)
        canvas.setLineWidth(0.15 * mm)
        polygon(canvas, place[faces[face][faces[face] >= 0]], stroke=True)
        for edge in at[np.isin(pattern.edges_vertices[at], faces[face]).all(axis=1)].tolist():
            letter = str(pattern.edges_assignment[edge])
            _crease(canvas, place[pattern.edges_vertices[edge]], CREASE_COLOURS[letter], letter)


_LEFT = np.array([[6, 4], [36, 4], [32, 28], [2, 28]])
_RIGHT = np.array([[49, 4], [76, 4], [72, 28], [45, 28]])
_TAB = np.array([[35.6, 6.5], [44.5, 9.0], [41.2, 24.0], [32.6, 25.5]])
_HEADED = np.array([[35, 10], [39.4, 7.4], [46, 11.5], [44, 22.5], [36.5, 26], [33, 22]])
_SLOT = np.array([[51.2, 8.5], [52.4, 8.5], [49.8, 23.5], [48.6, 23.5]])
"""Two facets, a tab between them, a tab with a head, and its slot; all with y from 4 to 28."""


def tab(canvas: Pen, box: Box) -> None:
    """A tab with its label and letter, and the facet under which it goes."""
    names = (("a7V", 38.6), ("a7", 55.0), ("P1", 17.0), ("P2", 66.0))
    _joint(canvas, box, (_LEFT, _TAB, _RIGHT), ((_LEFT[1:3], "V"),), names)


def slotted_tab(canvas: Pen, box: Box) -> None:
    """A tab with a head, and the facet with its slot."""
    names = (("a7V", 40.4), ("a7", 58.0), ("P1", 17.0), ("P2", 68.0))
    fold = _HEADED[[0, 5]], "V"
    _joint(canvas, box, (_LEFT, _HEADED, _RIGHT, _SLOT), (fold,), names)


def double_tab(canvas: Pen, box: Box) -> None:
    """A tab, and the tab of the other patch to which it is glued."""
    right = _RIGHT + np.array([13.0, 0.0])
    # Turned by half a turn about the middle between the two facets, a trapezoid is its own mirror.
    image = np.array([94.0, 32.0]) - _TAB
    names = (("a7M", 38.6), ("a7M", 55.4), ("P1", 17.0), ("P2", 80.0))
    folds = ((_LEFT[1:3], "M"), (right[[0, 3]], "M"))
    _joint(canvas, box, (_LEFT, _TAB, right, image), folds, names)


def _joint(
    canvas: Pen,
    box: Box,
    shapes: Sequence[Floats],
    folds: Sequence[tuple[Floats, str]],
    names: Sequence[tuple[str, float]],
) -> None:
    """A facet, its tab, its mate, and what the mate has; with ``folds`` and their letters, and
    ``names`` with their places from left to right.
    """
    every = np.concatenate(shapes)
    seen, scale = fitted(every, box)
    low = seen[0] - scale * every[0]
    canvas.setStrokeColor(INK)
    canvas.setLineWidth(0.25 * mm)
    canvas.setLineJoin(1)
    fills = (tint(1, 0.6), tint(1, 0.3), tint(2, 0.6), tint(2, 0.3))
    for fill, corners in zip(fills, shapes, strict=False):
        canvas.setFillColor(fill)
        polygon(canvas, low + scale * corners, stroke=True)
    for ends, letter in folds:
        _crease(canvas, low + scale * ends, CREASE_COLOURS[letter], letter)
    for words, at in names:
        x, y = (low + scale * np.array([at, 14.8])).tolist()
        look = QUIET if words.startswith("P") else INK
        text(canvas, x, y, words, 9, bold=look == INK, colour=look, align="middle")


def wedge_aspect(opening: float) -> float:
    """The height over the width of a wedge with this ``opening`` in radians at its tip."""
    low, high = _sector(opening).min(axis=0), _sector(opening).max(axis=0)
    wide, tall = (high - low).tolist()
    return float(tall / wide)


def _sector(opening: float) -> Floats:
    """The outline of a wedge of radius 1, its tip in the origin."""
    turns = np.linspace(0.0, opening, max(int(math.degrees(opening) / 3), 2) + 1)
    return np.concatenate([[[0.0, 0.0]], np.column_stack([np.cos(turns), np.sin(turns)])])


def wedge(canvas: Pen, box: Box, opening: float, name: str) -> None:
    """A wedge to cut out, with its ``name`` and the angle ``opening`` in radians at its tip."""
    seen, scale = fitted(_sector(opening), box)
    canvas.setFillColor(tint(5, 0.25))
    canvas.setStrokeColor(INK)
    canvas.setLineWidth(0.3 * mm)
    canvas.setLineJoin(1)
    polygon(canvas, seen, stroke=True)
    x, y = (
        seen[0] + 0.7 * scale * np.array([math.cos(opening / 2), math.sin(opening / 2)])
    ).tolist()
    text(canvas, x, y, name, 12, bold=True, align="middle")
    text(canvas, x, y - 4, f"{math.degrees(opening):.0f}\N{DEGREE SIGN}", 8, align="middle")


def protractor(canvas: Pen, box: Box) -> None:
    """A half disk with lines at each 5 degrees, numbered by the fold angle."""
    seen, scale = fitted(_sector(math.pi), box)
    canvas.setFillColor(tint(5, 0.15))
    canvas.setStrokeColor(INK)
    canvas.setLineWidth(0.3 * mm)
    polygon(canvas, seen, stroke=True)
    for degrees in range(5, 180, 5):
        way = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees))])
        inner = 0.12 if degrees % 15 == 0 else 0.9
        (x0, y0), (x1, y1) = ((seen[0] + scale * r * way) for r in (inner, 1.0))
        canvas.setLineWidth(0.12 * mm)
        canvas.line(x0 * mm, y0 * mm, x1 * mm, y1 * mm)
        if degrees % 15 == 0:
            x, y = (seen[0] + scale * 0.8 * way).tolist()
            canvas.setFillColor(tint(5, 0.15))
            canvas.circle(x * mm, y * mm, 2.6 * mm, stroke=0, fill=1)
            text(canvas, x, y - 1, str(180 - degrees), 7, align="middle")
