"""Sheets as PDF, true to scale: in the colours of operations for machines, of folds for people.

Only the modules of this room that write PDF import reportlab.
"""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray
from reportlab.lib.colors import Color, HexColor
from reportlab.lib.units import mm
from reportlab.pdfgen.canvas import Canvas

from miurafab.fabrication.drawing.page import CREASE_COLOURS, INK
from miurafab.fabrication.drawing.svg import COLOURS
from miurafab.fabrication.drawing.svg_canvas import Pen
from miurafab.fabrication.toolpath import Toolpath
from miurafab.geometry.arrays import Bools, Ints
from miurafab.profiles import OPERATIONS

LINE_MM = 0.1


def sheets_pdf(toolpaths: tuple[Toolpath, ...], title: str) -> bytes:
    """All sheets, one page each, of the sheet's size. The same input gives the same bytes."""
    stream = io.BytesIO()
    canvas = new_canvas(stream, title)
    for toolpath in toolpaths:
        canvas.setPageSize((toolpath.width_mm * mm, toolpath.height_mm * mm))
        draw_strokes(canvas, toolpath)
        canvas.showPage()
    canvas.save()
    return stream.getvalue()


def new_canvas(stream: io.BytesIO, title: str) -> Canvas:
    """A canvas that writes the same bytes each time."""
    canvas = Canvas(stream, invariant=1, pageCompression=1)
    canvas.setTitle(title)
    canvas.setCreator("miurafab")
    return canvas


def draw_strokes(canvas: Canvas, toolpath: Toolpath, line_mm: float = LINE_MM) -> None:
    """Draw the strokes from the origin of the canvas, in mm, one colour per operation."""
    canvas.setLineWidth(line_mm * mm)
    canvas.setLineCap(0)
    points = (toolpath.points * mm).tolist()
    offsets = toolpath.offsets.tolist()
    operations = toolpath.operation.tolist()
    for number, name in enumerate(OPERATIONS):
        path = canvas.beginPath()
        for index, operation in enumerate(operations):
            if operation != number:
                continue
            first, last = points[offsets[index]], points[offsets[index + 1] - 1]
            path.moveTo(*first)
            closed = first == last and offsets[index + 1] - offsets[index] > 3
            stop = offsets[index + 1] - 1 if closed else offsets[index + 1]
            for point in points[offsets[index] + 1 : stop]:
                path.lineTo(*point)
            if closed:
                path.close()
        canvas.setStrokeColor(HexColor(COLOURS[name]))
        canvas.drawPath(path, stroke=1, fill=0)


def draw_for_people(
    canvas: Pen,
    toolpath: Toolpath,
    letters: NDArray[np.str_],
    scale: float = 1.0,
    chosen: Ints | None = None,
) -> None:
    """The strokes, or those ``chosen``, in colours for people: mountains, valleys, cuts, lettering.

    ``letters`` (E,) is the assignment of each pattern edge; the canvas is scaled by ``scale``.
    """
    strokes = np.arange(len(toolpath)) if chosen is None else chosen
    edge, operation = toolpath.edge[strokes], toolpath.operation[strokes]
    letter = np.where(edge >= 0, letters[edge], "")
    engraved = operation == OPERATIONS.index("engrave")
    cut = operation == OPERATIONS.index("cut")
    kinds: list[tuple[Color, float, Bools]] = [
        (INK, 0.12, engraved),
        *((colour, 0.17, ~cut & (letter == name)) for name, colour in CREASE_COLOURS.items()),
        (INK, 0.28, cut),
    ]
    canvas.setLineJoin(1)
    canvas.setLineCap(0)
    for colour, weight, kind in kinds:
        path = canvas.beginPath()
        for index in strokes[kind].tolist():
            for k, (x, y) in enumerate((toolpath.stroke(index) * mm).tolist()):
                (path.lineTo if k else path.moveTo)(x, y)
        canvas.setStrokeColor(colour)
        canvas.setLineWidth(weight / scale * mm)
        canvas.drawPath(path, stroke=1, fill=0)
