"""The parts of a printed A4 page that all guides share: margins, inks, type sizes, small drawings.

Lengths are mm on the page; the origin is at the lower left.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from reportlab import rl_config
from reportlab.lib.colors import Color, HexColor, white
from reportlab.lib.units import mm
from reportlab.pdfbase.pdfmetrics import stringWidth
from reportlab.pdfgen.canvas import Canvas

from miurafab.fabrication.drawing.colours import patch_colour
from miurafab.fabrication.drawing.svg_canvas import Pen
from miurafab.fabrication.wording import runs
from miurafab.geometry.arrays import Floats, places_in_runs
from miurafab.origami import picture

rl_config.useA85 = 0  # pages as bytes take four fifths of the room that they take as text

Page = Callable[[Canvas], None]
"""A function that draws one page."""
Box = tuple[float, float, float, float]
"""A rectangle on the page: x, y of its lower left corner, width, height."""

WIDTH, HEIGHT, MARGIN = 210.0, 297.0, 18.0
ROOM = WIDTH - 2 * MARGIN
"""The width between the margins."""
BOTTOM = 17.0
"""The lower end of the content, above the foot."""

LEADING = 0.47
"""From one baseline to the next, in mm for each point of the size of the type: 1.33 sizes."""

INK, QUIET, RULE = HexColor(picture.INK), HexColor("#5c6670"), HexColor("#c3cad2")
PALE = HexColor("#eef1f4")
MOUNTAIN, VALLEY = HexColor(picture.CREASES["M"]), HexColor(picture.CREASES["V"])
OTHER = HexColor("#8a6d3b")
CREASE_COLOURS = {"M": MOUNTAIN, "V": VALLEY, "U": OTHER}
DASHES_MM = {"V": (2.4, 0.62), "U": (1.2, 0.3)}
"""The period in mm and the drawn part of it of folds that are dashed for people; mountains are
solid (as in the crease patterns of R. Lang). So a grey print tells them apart, too.
"""


def tint(number: int, strength: float = 1.0) -> Color:
    """The colour of patch ``number``; a ``strength`` below 1 is nearer to white."""
    return Color(*patch_colour(number, strength))


def text(
    canvas: Pen,
    x: float,
    y: float,
    words: str,
    size: float = 9.0,
    *,
    bold: bool = False,
    colour: Color = INK,
    align: str = "left",
) -> None:
    """One line of text with its baseline at ``y``; it starts, ends or is centred at ``x``."""
    canvas.setFillColor(colour)
    canvas.setFont(_font(bold), size)
    draw = {
        "left": canvas.drawString,
        "right": canvas.drawRightString,
        "middle": canvas.drawCentredString,
    }[align]
    draw(x * mm, y * mm, words)


def _font(bold: bool) -> str:
    return "Helvetica-Bold" if bold else "Helvetica"


def wrapped(words: str, width: float, size: float, *, bold: bool = False) -> list[str]:
    """``words`` in lines of at most ``width`` mm; a longer word gets a line of its own."""
    lines = [""]
    for word in words.split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and stringWidth(longer, _font(bold), size) > width * mm:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


def paragraph(
    canvas: Pen,
    x: float,
    y: float,
    words: str,
    width: float,
    size: float = 9.0,
    *,
    bold: bool = False,
    colour: Color = INK,
) -> float:
    """``words`` in lines from the baseline ``y`` down; returns the next baseline."""
    for line in wrapped(words, width, size, bold=bold):
        text(canvas, x, y, line, size, bold=bold, colour=colour)
        y -= size * LEADING
    return y


def paragraph_height(words: str, width: float, size: float = 9.0) -> float:
    """The height of a :func:`paragraph`, mm."""
    return len(wrapped(words, width, size)) * size * LEADING


def heading(canvas: Pen, title: str, subtitle: str) -> float:
    """The head of a page; returns the top of the content."""
    top = HEIGHT - MARGIN
    text(canvas, MARGIN, top - 5, title, 18, bold=True)
    text(canvas, MARGIN, top - 11, subtitle, 9.5, colour=QUIET)
    canvas.setStrokeColor(RULE)
    canvas.setLineWidth(0.2 * mm)
    canvas.line(MARGIN * mm, (top - 14) * mm, (WIDTH - MARGIN) * mm, (top - 14) * mm)
    return top - 19


def foot(canvas: Pen, title: str, page: int, pages: int) -> None:
    """The foot of a page."""
    text(canvas, MARGIN, 10, f"{title}, made with miurafab", 7.5, colour=QUIET)
    numbers = f"{page} of {pages}"
    text(canvas, WIDTH - MARGIN, 10, numbers, 7.5, colour=QUIET, align="right")


def caption(canvas: Pen, words: str, x: float, y: float) -> None:
    """The name of a drawing, its top at ``y``."""
    text(canvas, x, y - 3.2, words, 10, bold=True)


def scale_bar(canvas: Pen, scale: float, x: float, y: float) -> None:
    """A bar of a round length at ``scale`` (page mm per pattern mm)."""
    length = next(
        size for size in (500, 200, 100, 50, 20, 10, 5, 2, 1, 0.5) if size * scale <= 45 or size < 1
    )
    canvas.setStrokeColor(INK)
    canvas.setLineWidth(0.3 * mm)
    canvas.line(x * mm, y * mm, (x + length * scale) * mm, y * mm)
    for end in (x, x + length * scale):
        canvas.line(end * mm, (y - 1) * mm, end * mm, (y + 1) * mm)
    text(canvas, x + length * scale + 2, y - 1, f"{length:g} mm", 8, colour=QUIET)


def fold_lines(ends: Floats, letter: str, scale: float = 1.0) -> Floats:
    """(M, 2, 2) the pieces of N folds ``ends`` (N, 2, 2), with the dashes of their ``letter`` on a
    canvas that is scaled by ``scale``. A fold begins and ends with a dash and has two at least.
    """
    if letter not in DASHES_MM or not len(ends):
        return ends
    period, part = DASHES_MM[letter]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) * scale
    count = np.maximum(np.rint(length / period + 1 - part), 2).astype(np.int64)
    fold, place = np.repeat(np.arange(len(ends)), count), places_in_runs(count)
    step = 1 / (count[fold] - 1 + part)
    share = np.stack([place * step, (place + part) * step], axis=1)
    along = ends[fold, 1] - ends[fold, 0]
    return np.asarray(ends[fold, :1] + share[:, :, None] * along[:, None])


def legend(canvas: Pen, entries: Sequence[tuple[str, Color, float]], x: float, y: float) -> None:
    """Names, each behind a stroke of its colour and weight (mm), right-aligned at ``x``. Those of
    folds are dashed as in the drawing.
    """
    letters = {"mountain": "M", "valley": "V"}
    for name, colour, weight in reversed(entries):
        text(canvas, x, y - 1, name, 8, colour=QUIET, align="right")
        x -= stringWidth(name, "Helvetica", 8) / mm + 1.5
        canvas.setStrokeColor(colour)
        canvas.setLineWidth(weight * mm)
        line = np.array([[[x - 7, y], [x, y]]])
        canvas.lines((fold_lines(line, letters.get(name, "")) * mm).reshape(-1, 4).tolist())
        x -= 12


def chip(canvas: Pen, words: str, x: float, y: float, fill: Color, size: float = 7.0) -> None:
    """A short word on a rounded rectangle, centred at (``x``, ``y``)."""
    wide = stringWidth(words, "Helvetica-Bold", size) / mm + 0.32 * size
    tall = 0.52 * size
    canvas.setFillColor(fill)
    canvas.setStrokeColor(white)
    canvas.setLineWidth(0.25 * mm)
    canvas.roundRect(
        (x - wide / 2) * mm, (y - tall / 2) * mm, wide * mm, tall * mm, tall / 2 * mm, fill=1
    )
    text(canvas, x, y - 0.125 * size, words, size, bold=True, align="middle")


def disk(canvas: Pen, words: str, x: float, y: float, fill: Color) -> None:
    """One or two letters in a disk around (``x``, ``y``)."""
    canvas.setFillColor(fill)
    canvas.setStrokeColor(white)
    canvas.setLineWidth(0.2 * mm)
    canvas.circle(x * mm, y * mm, 1.6 * mm, stroke=1, fill=1)
    text(canvas, x, y - 0.85, words, 6.5, bold=True, colour=white, align="middle")


def polygon(canvas: Pen, points: Floats, *, stroke: bool = False) -> None:
    """A filled closed polygon (n, 2) in the current colours."""
    path = canvas.beginPath()
    path.moveTo(points[0, 0] * mm, points[0, 1] * mm)
    for x, y in points[1:].tolist():
        path.lineTo(x * mm, y * mm)
    path.close()
    canvas.drawPath(path, stroke=int(stroke), fill=1)


def fitted(points: Floats, box: Box) -> tuple[Floats, float]:
    """``points`` (n, 2) scaled and centred into ``box``, and the scale."""
    low, span = points.min(axis=0), np.ptp(points, axis=0)
    x, y, width, height = box
    scale = float(min(width / max(span[0], 1e-9), height / max(span[1], 1e-9)))
    shift = np.array([x + (width - scale * span[0]) / 2, y + (height - scale * span[1]) / 2])
    return (points - low) * scale + shift, scale


def line_above(canvas: Pen, x: float, y: float, width: float) -> None:
    """A rule between two parts of a page."""
    canvas.setStrokeColor(RULE)
    canvas.setLineWidth(0.2 * mm)
    canvas.line(x * mm, y * mm, (x + width) * mm, y * mm)


def tabs_called(labels: Sequence[str]) -> str:
    """``tabs a1-a4, b7``."""
    return f"{'tab' if len(labels) == 1 else 'tabs'} {runs(labels)}"
