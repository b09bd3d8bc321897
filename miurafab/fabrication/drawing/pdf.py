"""Sheets as PDF, true to scale: on the layers of drawings for machines, by their folds for people.

Only the modules of this room that write PDF import reportlab.
"""

from __future__ import annotations

import io
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from reportlab.lib.colors import Color, HexColor
from reportlab.lib.units import mm
from reportlab.pdfgen.canvas import Canvas

from miurafab.fabrication.drawing.layers import LAYERS, NO_LETTERS, Letters, layers_of
from miurafab.fabrication.drawing.page import CREASE_COLOURS, INK, fold_lines
from miurafab.fabrication.drawing.svg_canvas import Pen
from miurafab.fabrication.toolpath import Toolpath
from miurafab.geometry.arrays import Floats, Ints
from miurafab.profiles import OPERATIONS


def sheets_pdf(toolpaths: tuple[Toolpath, ...], title: str, letters: Letters = NO_LETTERS) -> bytes:
    """All sheets, one page each, of the sheet's size. The same input gives the same bytes.
    ``letters`` (E,) is the assignment of each pattern edge.
    """
    stream = io.BytesIO()
    canvas = new_canvas(stream, title)
    for toolpath in toolpaths:
        canvas.setPageSize((toolpath.width_mm * mm, toolpath.height_mm * mm))
        draw_strokes(canvas, toolpath, letters)
        canvas.showPage()
    canvas.save()
    return stream.getvalue()


def new_canvas(stream: io.BytesIO, title: str) -> Canvas:
    """A canvas that writes the same bytes each time."""
    canvas = Canvas(stream, invariant=1, pageCompression=1)
    canvas.setTitle(title)
    canvas.setCreator("miurafab")
    return canvas


def draw_strokes(
    canvas: Canvas, toolpath: Toolpath, letters: Letters = NO_LETTERS, scale: float = 1.0
) -> None:
    """Draw the strokes from the origin of the canvas, in mm, layer by layer, on a canvas that is
    scaled by ``scale``.
    """
    canvas.setLineCap(0)
    points = (toolpath.points * mm).tolist()
    offsets = toolpath.offsets.tolist()
    layer_of = layers_of(toolpath, letters)
    for number in np.unique(layer_of).tolist():
        path = canvas.beginPath()
        for index in np.flatnonzero(layer_of == number).tolist():
            first, last = points[offsets[index]], points[offsets[index + 1] - 1]
            path.moveTo(*first)
            closed = first == last and offsets[index + 1] - offsets[index] > 3
            stop = offsets[index + 1] - 1 if closed else offsets[index + 1]
            for point in points[offsets[index] + 1 : stop]:
                path.lineTo(*point)
            if closed:
                path.close()
        canvas.setLineWidth(LAYERS[number].line_mm / scale * mm)
        canvas.setStrokeColor(HexColor(LAYERS[number].colour))
        canvas.drawPath(path, stroke=1, fill=0)


def draw_for_people(
    canvas: Pen,
    toolpath: Toolpath,
    letters: NDArray[np.str_],
    scale: float = 1.0,
    chosen: Ints | None = None,
) -> None:
    """The strokes, or those ``chosen``, for people: mountains solid, valleys dashed, each in its
    colour, whatever the tool makes of them; cuts and lettering.

    ``letters`` (E,) is the assignment of each pattern edge; the canvas is scaled by ``scale``.
    """
    strokes = np.arange(len(toolpath)) if chosen is None else chosen
    letter = np.where(toolpath.edge >= 0, letters[toolpath.edge], "")
    engraved = toolpath.operation == OPERATIONS.index("engrave")
    cut = toolpath.operation == OPERATIONS.index("cut")
    canvas.setLineJoin(1)
    canvas.setLineCap(0)

    def drawn(lines: Iterable[Floats], colour: Color, weight: float) -> None:
        path = canvas.beginPath()
        for line in lines:
            for k, (x, y) in enumerate((line * mm).tolist()):
                (path.lineTo if k else path.moveTo)(x, y)
        canvas.setStrokeColor(colour)
        canvas.setLineWidth(weight / scale * mm)
        canvas.drawPath(path, stroke=1, fill=0)

    drawn((toolpath.stroke(k) for k in strokes[engraved[strokes]].tolist()), INK, 0.12)
    # The dashes of a fold follow each other; it is drawn whole where one of them is chosen.
    folded = ~cut & ~engraved & (letter != "")
    change = np.ones(len(toolpath), dtype=bool)
    change[1:] = (np.diff(toolpath.edge) != 0) | (np.diff(toolpath.patch) != 0)
    change[1:] |= np.diff(folded) != 0
    fold = np.cumsum(change) - 1
    first = np.flatnonzero(change)
    last = np.append(first[1:], len(toolpath)) - 1
    ends = np.stack([toolpath.starts[first], toolpath.ends[last]], axis=1)
    wanted = np.zeros(len(first), dtype=bool)
    wanted[fold[strokes]] = True
    wanted &= folded[first]
    for name, colour in CREASE_COLOURS.items():
        chosen_folds = wanted & (letter[first] == name)
        drawn(fold_lines(ends[chosen_folds], name, scale), colour, 0.17)
    drawn((toolpath.stroke(k) for k in strokes[cut[strokes]].tolist()), INK, 0.28)
