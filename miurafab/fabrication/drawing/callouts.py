"""Labels that are not on a sheet, in its drawing: in their places, or beside them with a line.

A label with room on the sheet that is not engraved (``marks``) is written where it would be, if it
can be read there. Any other stands beside its place, on a leader line: at the nearest place that is
clear of what is written already, and of the patches if there is such a place nearby.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely
from reportlab.lib.colors import white
from reportlab.lib.units import mm
from reportlab.pdfbase.pdfmetrics import stringWidth

from miurafab.fabrication.drawing.page import INK, text
from miurafab.fabrication.drawing.svg_canvas import Pen
from miurafab.fabrication.lettering import text_strokes
from miurafab.geometry.arrays import Bools, Floats

_SIZE = 5.0
"""The type size of labels on leader lines, in points."""
_LEAST_MM = 0.9
"""Lower capitals cannot be read on paper (judged)."""
_CAPITALS = 0.718
"""The height of capitals over the type size (Helvetica's font metrics)."""
_POINT_MM = 25.4 / 72
_WAYS = np.radians(np.arange(0.0, 360.0, 15.0))
_AWAY_MM = (3.0, 4.5, 6.0, 8.0, 10.0, 13.0, 16.0, 20.0, 25.0)
"""The lengths of leader lines that are tried, shortest first."""
_OVER_MM = 8.0
"""A place over a patch is taken rather than one that is farther away by more than this."""


@dataclass(frozen=True, eq=False)
class Taken:
    """The boxes (x0, y0, x1, y1) on a page that bear words, in mm."""

    boxes: list[tuple[float, float, float, float]] = field(default_factory=list)

    def clear(self, places: Floats, wide: float, tall: float) -> Bools:
        """(n,) whether a box around each of ``places`` (n, 2) meets none."""
        if not self.boxes:
            return np.ones(len(places), dtype=bool)
        taken, half = np.array(self.boxes), np.array([wide, tall]) / 2
        low, high = (places - half)[:, None], (places + half)[:, None]
        apart = np.any((high < taken[:, :2]) | (low > taken[:, 2:]), axis=2)
        return np.asarray(np.all(apart, axis=1), dtype=bool)

    def take(self, x: float, y: float, wide: float, tall: float) -> None:
        """Note a box around (``x``, ``y``)."""
        self.boxes.append((x - wide / 2, y - tall / 2, x + wide / 2, y + tall / 2))


@dataclass(frozen=True)
class Callout:
    """A label at (``x``, ``y``) on the page, in mm. It would run along ``angle`` in radians with
    capitals ``height`` mm high; without room the height is 0.
    """

    words: str
    x: float
    y: float
    angle: float
    height: float


def draw_callouts(
    canvas: Pen, labels: Sequence[Callout], patches: Sequence[Floats], written: Taken
) -> None:
    """The ``labels`` on a drawing of ``patches`` (n, 2), clear of what is ``written``."""
    for label in labels:
        if label.height >= _LEAST_MM:
            _in_place(canvas, label)
    shapes = shapely.union_all([shapely.Polygon(patch).buffer(0) for patch in patches])
    shapely.prepare(shapes)
    for label in labels:
        if label.height < _LEAST_MM:
            _beside(canvas, label, shapes, written)


def _in_place(canvas: Pen, label: Callout) -> None:
    c, s = label.height * math.cos(label.angle), label.height * math.sin(label.angle)
    canvas.setStrokeColor(INK)
    canvas.setLineWidth(0.15 * mm)
    canvas.setLineCap(1)
    path = canvas.beginPath()
    for stroke in text_strokes(label.words):
        points = stroke @ np.array([[c, s], [-s, c]]) + [label.x, label.y]
        for k, (x, y) in enumerate((points * mm).tolist()):
            (path.lineTo if k else path.moveTo)(x, y)
    canvas.drawPath(path, stroke=1, fill=0)


def _beside(canvas: Pen, label: Callout, shapes: shapely.Geometry, written: Taken) -> None:
    wide = stringWidth(label.words, "Helvetica-Bold", _SIZE) * _POINT_MM + 0.8
    tall = _SIZE * _CAPITALS * _POINT_MM + 0.8
    at = np.array([label.x, label.y])
    ways = np.stack([np.cos(_WAYS), np.sin(_WAYS)], axis=1)
    away = np.repeat(_AWAY_MM, len(ways))
    places = at + away[:, None] * np.tile(ways, (len(_AWAY_MM), 1))
    half = np.array([wide, tall]) / 2
    boxes = shapely.box(*(places - half).T, *(places + half).T)
    cost = away + _OVER_MM * shapely.intersects(shapes, boxes)
    cost[~written.clear(places, wide, tall)] += 1e3
    x, y = places[int(np.argmin(cost))].tolist()
    written.take(x, y, wide, tall)
    canvas.setLineCap(1)
    for weight, colour in ((0.35, white), (0.12, INK)):
        canvas.setStrokeColor(colour)
        canvas.setLineWidth(weight * mm)
        canvas.line(label.x * mm, label.y * mm, x * mm, y * mm)
    canvas.setFillColor(INK)
    canvas.circle(label.x * mm, label.y * mm, 0.25 * mm, stroke=0, fill=1)
    canvas.setFillColor(white)
    canvas.rect((x - wide / 2) * mm, (y - tall / 2) * mm, wide * mm, tall * mm, stroke=0, fill=1)
    text(canvas, x, y - tall / 2 + 0.4, label.words, _SIZE, bold=True, align="middle")
