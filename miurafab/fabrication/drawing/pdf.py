"""Sheets as PDF, true to scale: whole for large printers and cutters, tiled for desktop printers.

Tiles overlap by a strip and carry crosses at the corners of what each of them shows, with the
number of the row and column, so that printed pages can be laid edge to edge and glued. This module
and the assembly guide are the only homes of reportlab.
"""

from __future__ import annotations

import io
import math
from dataclasses import dataclass

from reportlab.lib.colors import HexColor
from reportlab.lib.units import mm
from reportlab.pdfgen.canvas import Canvas

from miurafab.errors import InputError
from miurafab.fabrication.drawing.svg import COLOURS
from miurafab.fabrication.toolpath import Toolpath
from miurafab.profiles import OPERATIONS

LINE_MM = 0.1
PAGES_MM = {"a4": (210.0, 297.0), "a3": (297.0, 420.0), "letter": (215.9, 279.4)}
"""Page sizes by name: width and height in mm (ISO 216; ANSI/ASME Y14.1)."""


@dataclass(frozen=True)
class Tiling:
    """How a sheet is cut into pages: a size of :data:`PAGES_MM`, the ``margin_mm`` that printers
    leave blank, and the ``overlap_mm`` that neighbouring pages share.
    """

    page: str = "a4"
    margin_mm: float = 8.0
    overlap_mm: float = 10.0


def sheets_pdf(toolpaths: tuple[Toolpath, ...], title: str) -> bytes:
    """All sheets, one page each, the page being the sheet. The same input gives the same bytes."""
    stream = io.BytesIO()
    canvas = _canvas(stream, title)
    for toolpath in toolpaths:
        canvas.setPageSize((toolpath.width_mm * mm, toolpath.height_mm * mm))
        draw_strokes(canvas, toolpath)
        canvas.showPage()
    canvas.save()
    return stream.getvalue()


def tiled_pdf(toolpaths: tuple[Toolpath, ...], title: str, tiling: Tiling) -> bytes:
    """All sheets over pages of an ordinary printer, true to scale, with marks to join them.

    Raises :class:`~miurafab.errors.InputError` for an unknown page or one without room.
    """
    size = PAGES_MM.get(tiling.page.lower())
    if size is None:
        raise InputError(f"The page '{tiling.page}' is not one of {', '.join(PAGES_MM)}.")
    shown = tuple(side - 2 * tiling.margin_mm for side in size)
    step = tuple(side - tiling.overlap_mm for side in shown)
    if min(step) <= 0:
        raise InputError("The page has no room left within its margins and overlap.")
    stream = io.BytesIO()
    canvas = _canvas(stream, title)
    canvas.setPageSize((size[0] * mm, size[1] * mm))
    for toolpath in toolpaths:
        columns, rows = (
            max(1, math.ceil((length - tiling.overlap_mm) / advance))
            for length, advance in zip((toolpath.width_mm, toolpath.height_mm), step, strict=True)
        )
        for row in range(rows):
            for column in range(columns):
                corner = (column * step[0], row * step[1])
                _tile(canvas, toolpath, corner, (shown[0], shown[1]), tiling.margin_mm)
                label = f"{title}   {toolpath.sheet}   row {row + 1}/{rows}, column {column + 1}"
                canvas.setFont("Helvetica", 7)
                canvas.drawString(
                    tiling.margin_mm * mm, 3 * mm, f"{label}/{columns}   print at 100 %"
                )
                canvas.showPage()
    canvas.save()
    return stream.getvalue()


def _tile(
    canvas: Canvas,
    toolpath: Toolpath,
    corner: tuple[float, float],
    shown: tuple[float, float],
    margin: float,
) -> None:
    canvas.saveState()
    canvas.translate(margin * mm, margin * mm)
    window = canvas.beginPath()
    window.rect(0, 0, shown[0] * mm, shown[1] * mm)
    canvas.clipPath(window, stroke=0, fill=0)
    canvas.translate(-corner[0] * mm, -corner[1] * mm)
    draw_strokes(canvas, toolpath)
    canvas.restoreState()
    canvas.saveState()
    canvas.translate(margin * mm, margin * mm)
    canvas.setLineWidth(0.15 * mm)
    for x in (0.0, shown[0]):
        for y in (0.0, shown[1]):
            canvas.line((x - 3) * mm, y * mm, (x + 3) * mm, y * mm)
            canvas.line(x * mm, (y - 3) * mm, x * mm, (y + 3) * mm)
    canvas.restoreState()


def _canvas(stream: io.BytesIO, title: str) -> Canvas:
    canvas = Canvas(stream, invariant=1, pageCompression=1)
    canvas.setTitle(title)
    canvas.setCreator("miurafab")
    return canvas


def draw_strokes(canvas: Canvas, toolpath: Toolpath, line_mm: float = LINE_MM) -> None:
    """Draw the strokes at the canvas's origin, in mm, a colour an operation."""
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
