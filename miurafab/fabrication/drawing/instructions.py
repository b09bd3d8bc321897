"""How to fold and glue, in words and two small drawings that explain the lines and the tabs."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from reportlab.lib.colors import Color
from reportlab.lib.units import mm

from miurafab.fabrication.drawing.page import (
    INK,
    MARGIN,
    MOUNTAIN,
    QUIET,
    ROOM,
    VALLEY,
    paragraph,
    polygon,
    text,
    tint,
    wrapped,
)
from miurafab.fabrication.drawing.svg_canvas import Pen
from miurafab.geometry.arrays import Floats

_FOLDING = (
    "Crease every line both ways, one row after another.",
    "Fold all rows together, a little at a time: the sheet moves as one. Lines that are red in the "
    "pictures of the sheets are mountains and fold away from you, blue ones are valleys and fold "
    "towards you, seen from the front, the show side.",
)
_GLUEING = (
    "On each tab stands its label, the letter of its seam and a number, and the way its own fold "
    "goes: M for mountain, V for valley.",
    "It goes under the facet that bears the same label, edge to edge with the line.",
    "Patches are glued best half way unfolded, while the seam is nearly flat. Press until it "
    "holds, then take the next tab.",
)
_GLUEING_PIECES = (
    *_GLUEING[:2],
    "Pieces meet as they are folded: give each its shape first, then glue the seam from one end to "
    "the other. The last seams are closed from outside, as on a paper globe.",
)


_COLUMN = (ROOM - 10) / 2
_STEP = 8.5 * 0.47
"""The line spacing of a paragraph."""


def glueing(tabs: int, pieces: int) -> Sequence[str]:
    """How to glue ``pieces`` with so many ``tabs``; nothing without tabs."""
    if not tabs:
        return ()
    return _GLUEING_PIECES if pieces > 1 else _GLUEING


def height_of_instructions(notes: Sequence[str], glue: Sequence[str]) -> float:
    """The height of :func:`draw_instructions` in mm."""
    columns = (
        sum(len(wrapped(line, _COLUMN - 5, 8.5)) * _STEP + 1.4 for line in lines)
        for lines in (_FOLDING, glue)
    )
    below = sum(len(wrapped(note, ROOM, 8.5)) for note in notes) * _STEP
    return 48.0 + max(columns) + below + 6.0


def draw_instructions(canvas: Pen, top: float, notes: Sequence[str], glue: Sequence[str]) -> None:
    """How to fold, how to ``glue`` (:func:`glueing`), and ``notes``, from ``top`` down."""
    columns: list[tuple[float, str, Sequence[str]]] = [(MARGIN, "Fold", _FOLDING)]
    _draw_folds(canvas, MARGIN, top - 34)
    if glue:
        columns.append((MARGIN + _COLUMN + 10, "Glue", glue))
        _draw_tab(canvas, MARGIN + _COLUMN + 10, top - 34)
    lowest = top
    for x, title, lines in columns:
        text(canvas, x, top - 43, title, 11, bold=True)
        y = top - 49.0
        for number, line in enumerate(lines, start=1):
            text(canvas, x, y, f"{number}", 8.5, bold=True, colour=QUIET)
            y = paragraph(canvas, x + 5, y, line, _COLUMN - 5, 8.5) - 1.4
        lowest = min(lowest, y)
    y = lowest
    for note in notes:
        y = paragraph(canvas, MARGIN, y, note, ROOM, 8.5, bold=True)


def _solid(x: float, y: float, size: float, points: Sequence[tuple[float, float, float]]) -> Floats:
    """Corners in space, seen from the front and above, on the page at (x, y)."""
    space = np.array(points)
    a, b = math.radians(24), math.radians(30)
    across = space[:, 0] * math.cos(a) - space[:, 1] * math.sin(a)
    away = space[:, 0] * math.sin(a) + space[:, 1] * math.cos(a)
    seen = np.column_stack([across, away * math.sin(b) + space[:, 2] * math.cos(b)])
    return np.asarray(seen * size + np.array([x, y]))


def _draw_folds(canvas: Pen, x: float, y: float) -> None:
    """A mountain and a valley: two facets that meet in a coloured line."""
    size = 15.0
    for place, (name, colour, lift) in enumerate(
        (("mountain", MOUNTAIN, 0.5), ("valley", VALLEY, -0.5))
    ):
        left = x + 10 + place * _COLUMN / 2
        base = y + (12 if lift < 0 else 5)
        ridge = [(0.8, 0.0, lift), (0.8, 1.2, lift)]
        near = [(0.0, 0.0, 0.0), *ridge, (0.0, 1.2, 0.0)]
        far = [ridge[0], (1.6, 0.0, 0.0), (1.6, 1.2, 0.0), ridge[1]]
        canvas.setStrokeColor(INK)
        canvas.setLineWidth(0.25 * mm)
        canvas.setLineJoin(1)
        leaves = [(0.4, near), (0.85, far)]
        # The facet farther from the viewer is drawn first.
        for strength, corners in leaves if lift < 0 else leaves[::-1]:
            canvas.setFillColor(tint(0, strength))
            polygon(canvas, _solid(left, base, size, corners), stroke=True)
        _line(canvas, _solid(left, base, size, ridge), colour)
        text(canvas, left + 8, y - 1.5, name, 8.5, colour=colour, bold=True, align="middle")


def _draw_tab(canvas: Pen, x: float, y: float) -> None:
    """A tab with its number and letter, and the facet under which it goes."""
    left = np.array([[0, 0], [30, 0], [26, 24], [-4, 24]]) + np.array([x + 6, y + 4])
    tab = np.array([[29.6, 2.5], [38.5, 5], [35.2, 20], [26.6, 21.5]]) + np.array([x + 6, y + 4])
    right = np.array([[0, 0], [27, 0], [23, 24], [-4, 24]]) + np.array([x + 49, y + 4])
    canvas.setStrokeColor(INK)
    canvas.setLineWidth(0.25 * mm)
    canvas.setLineJoin(1)
    for fill, corners in ((tint(1, 0.6), left), (tint(1, 0.3), tab), (tint(2, 0.6), right)):
        canvas.setFillColor(fill)
        polygon(canvas, corners, stroke=True)
    _line(canvas, left[1:3], VALLEY)
    text(canvas, x + 38.6, y + 14.8, "a7V", 9, bold=True, align="middle")
    text(canvas, x + 55, y + 14.8, "a7", 9, bold=True, align="middle")
    text(canvas, x + 17, y + 14.8, "P1", 9, colour=QUIET, align="middle")
    text(canvas, x + 66, y + 14.8, "P2", 9, colour=QUIET, align="middle")
    words = "tab a7 folds as a valley and goes under the facet marked a7"
    text(canvas, x + _COLUMN / 2, y - 1.5, words, 8.5, colour=QUIET, align="middle")


def _line(canvas: Pen, ends: Floats, colour: Color) -> None:
    """A crease, drawn heavier than outlines."""
    canvas.setStrokeColor(colour)
    canvas.setLineWidth(0.7 * mm)
    (x0, y0), (x1, y1) = (ends * mm).tolist()
    canvas.line(x0, y0, x1, y1)
