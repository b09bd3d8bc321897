"""Two views of a sheet for its folder: flat with the rows numbered on the rim, and on its way."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from reportlab.lib.colors import Color
from reportlab.lib.units import mm

from miurafab.fabrication.drawing.page import CREASE_COLOURS, INK, Box, fitted, fold_lines, polygon
from miurafab.fabrication.drawing.svg_canvas import Pen
from miurafab.fabrication.drawing.views import OUTLINED, Views, named
from miurafab.fabrication.kit.rim import RimEnd
from miurafab.geometry.arrays import Bools, Floats
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.picture import azimuth_of, fills, project

_LETTER = np.array([1.5, 2.5])
"""The room of a letter in mm on paper. Numbers that would overlap are thinned out."""
_OFF = 3.2
"""The middle of a number is so far from the end of its row, in mm on paper."""
_WIDE = 3.0
"""Creases whose median length on paper is less, in mm, are drawn thin."""


def rim_view(
    canvas: Pen, box: Box, views: Views, ends: Sequence[RimEnd], inside: Bools | None = None
) -> None:
    """The flat sheet, or the part of it ``inside`` (F,), with its creases, mountains solid
    and valleys dashed, and the numbers of its rows at their ``ends``.
    """
    pattern = views.pattern
    faces = pattern.edges_faces
    kept = np.ones(len(pattern.faces_vertices), bool) if inside is None else inside
    by_side = np.where(faces >= 0, kept[faces], False)
    corners = pattern.faces_vertices[kept]
    used = np.unique(corners[corners >= 0])
    x, y, width, height = box
    points = np.zeros_like(views.flat)
    room = 2 * _OFF
    inner = (x + room, y + room, width - 2 * room, height - 2 * room)
    points[used], scale = fitted(views.flat[used], inner)
    low = views.flat[used].min(axis=0)
    shift = points[used].min(axis=0) - scale * low
    for patch in views.patches:
        if kept[patch.faces].all():
            views.fill(canvas, points, patch.id, 0.35)
    lines = points[pattern.edges_vertices]
    both = by_side.all(axis=1)
    lengths = np.linalg.norm(lines[both, 1] - lines[both, 0], axis=1)
    wide = len(lengths) > 0 and float(np.median(lengths)) >= _WIDE
    canvas.setLineCap(0)
    for letter, colour in CREASE_COLOURS.items():
        canvas.setStrokeColor(colour)
        canvas.setLineWidth((0.28 if wide else 0.12) * mm)
        folds = fold_lines(lines[both & (pattern.edges_assignment == letter)], letter)
        canvas.lines((folds * mm).reshape(-1, 4).tolist())
    canvas.setStrokeColor(INK)
    canvas.setLineWidth(0.35 * mm)
    canvas.setLineCap(1)
    cut = (by_side.any(axis=1) & ~both) | (both & np.isin(pattern.edges_assignment, ("B", "C")))
    canvas.lines((lines[cut] * mm).reshape(-1, 4).tolist())
    _numbers(canvas, views, ends, scale, shift)


def _numbers(
    canvas: Pen, views: Views, ends: Sequence[RimEnd], scale: float, shift: Floats
) -> None:
    """The numbers of rows at their ends; where they would touch, some are left out."""
    if not ends:
        return
    at = views.upright(np.stack([end.at for end in ends])) * scale + shift
    out = views.upright(np.stack([end.out for end in ends]))
    place = at + _OFF * out
    half = np.stack([_LETTER * [len(end.name), 1.0] for end in ends]) / 2
    sides: dict[tuple[str, int], list[int]] = {}
    for k, end in enumerate(ends):
        sides.setdefault((end.name[0], k % 2), []).append(k)
    taken: list[int] = []

    def meets(one: int, other: int) -> bool:
        return bool((np.abs(place[one] - place[other]) < half[one] + half[other]).all())

    for own in sides.values():
        steps = (1, 2, 5, 10, 20, 50, 100, 200, 500)
        wanted = next(
            (step for step in steps if not any(map(meets, own[::step], own[step::step]))), steps[-1]
        )
        for k in dict.fromkeys([own[0], own[-1], *own[::wanted]]):
            if any(meets(k, other) for other in taken):
                continue
            taken.append(k)
            (x0, y0), (x1, y1) = (at[k] + 0.4 * out[k]).tolist(), (at[k] + 1.4 * out[k]).tolist()
            canvas.setStrokeColor(INK)
            canvas.setLineWidth(0.15 * mm)
            canvas.line(x0 * mm, y0 * mm, x1 * mm, y1 * mm)
            x, y = place[k].tolist()
            named(canvas, ends[k].name, x, y, 6.5)


def camera(pattern: CreasePattern, shape: Floats) -> float:
    """The azimuth from which all states of a sheet are seen that ends in ``shape`` (V, 3)."""
    return azimuth_of(shape, pattern.faces_vertices)


def shape_view(
    canvas: Pen, box: Box, pattern: CreasePattern, shape: Floats, azimuth: float, inside: Bools
) -> None:
    """The facets ``inside`` (F,) of a sheet in one state, the two sides of the paper in two
    colours.
    """
    faces = pattern.faces_vertices
    view = project(shape, faces, azimuth)
    corners = faces[inside]
    used = np.unique(corners[corners >= 0])
    seen = np.zeros_like(view.places)
    seen[used], _ = fitted(view.places[used], box)
    colours = fills(view) / 255
    outlined = len(faces) <= OUTLINED
    canvas.setLineWidth(0.08 * mm)
    canvas.setLineJoin(1)
    for face in view.order[inside[view.order]].tolist():
        red, green, blue = colours[face].tolist()
        canvas.setFillColor(Color(red, green, blue))
        canvas.setStrokeColor(Color(0.72 * red, 0.72 * green, 0.72 * blue))
        polygon(canvas, seen[faces[face][faces[face] >= 0]], stroke=outlined)
