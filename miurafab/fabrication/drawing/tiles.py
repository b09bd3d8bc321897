"""Sheets tiled over the pages of an ordinary printer, true to scale, to be joined by hand.

The first page shows the sheet and its tiles. Then follows one page for each tile that is not blank,
named like a square of a chess board: A1 is at the lower left. The tiles start at the drawing, not
at the sheet, because each page costs an edge to glue. Neighbouring pages overlap by a strip with
numbered crosses; each cross is on both pages at the same place of the sheet, so pages match cross
on cross. The tiles of a sheet are of one size, so no page shows a mere sliver, and a page that
would show nothing but strips of its neighbours is left out. Mountains,
valleys and cuts have different colours.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray
from reportlab.lib.units import mm
from reportlab.pdfgen.canvas import Canvas

from miurafab.errors import InputError
from miurafab.fabrication.drawing.page import (
    INK,
    MOUNTAIN,
    PALE,
    QUIET,
    RULE,
    VALLEY,
    legend,
    paragraph,
    text,
)
from miurafab.fabrication.drawing.page_sizes import page_size
from miurafab.fabrication.drawing.pdf import draw_for_people, new_canvas
from miurafab.fabrication.toolpath import Toolpath
from miurafab.fabrication.wording import count
from miurafab.geometry.arrays import Floats, Ints

CHECK_MM = 50.0
"""The length of the bar for checking the scale of a print."""

_NARROW_MM = 190.0  # a narrower page has room for its field and the bar alone

EDGE_MM = 2.0
"""The distance between the drawing and the edge of the outermost pages."""

_HOW = (
    "Print at 100 %, without fitting to the page, and check the bar of 50 mm at the foot of each. "
    "Cut each page along its frame at the left and below, lay it over its neighbours so that "
    "crosses of the same number meet, and glue the strip."
)


@dataclass(frozen=True)
class Tiling:
    """The tiling of a sheet: a page size of :func:`page_size`, portrait or landscape, whichever
    needs fewer pages, the blank ``margin_mm`` of printers, and the ``overlap_mm`` of neighbouring
    pages.
    """

    page: str = "a4"
    margin_mm: float = 10.0
    overlap_mm: float = 10.0


def tiled_pdf(
    toolpaths: tuple[Toolpath, ...], letters: NDArray[np.str_], title: str, tiling: Tiling
) -> bytes:
    """All sheets, tile by tile. ``letters`` (E,) is the assignment of each pattern edge.

    Raises :class:`~miurafab.errors.InputError` for an unknown page or one without room.
    """
    size = page_size(tiling.page)
    if min(size) <= 2 * tiling.margin_mm + tiling.overlap_mm:
        raise InputError("The page has no room left within its margins and overlap.")
    stream = io.BytesIO()
    canvas = new_canvas(stream, title)
    for toolpath in toolpaths:
        both = [_Tiles(toolpath, letters, each, tiling) for each in (size, size[::-1])]
        tiles = min(both, key=lambda each: (len(each.printed), each.columns * each.rows))
        canvas.setPageSize((tiles.page[0] * mm, tiles.page[1] * mm))
        tiles.overview(canvas, title)
        for row, column in tiles.printed:
            tiles.draw(canvas, title, row, column)
    canvas.save()
    return stream.getvalue()


class _Tiles:
    """The tiles of one sheet on pages of one size."""

    def __init__(
        self,
        toolpath: Toolpath,
        letters: NDArray[np.str_],
        page: tuple[float, float],
        tiling: Tiling,
    ) -> None:
        self.toolpath, self.letters, self.page = toolpath, letters, page
        self.margin, self.overlap = tiling.margin_mm, tiling.overlap_mm
        self.origin = toolpath.points.min(axis=0) - EDGE_MM
        self.size = np.ptp(toolpath.points, axis=0) + 2 * EDGE_MM
        most = [side - 2 * self.margin for side in page]
        self.columns, self.rows = counts = [
            max(1, math.ceil((extent - self.overlap) / (side - self.overlap)))
            for extent, side in zip(self.size.tolist(), most, strict=True)
        ]
        self.step = tuple(
            (extent - self.overlap) / tiles
            for extent, tiles in zip(self.size.tolist(), counts, strict=True)
        )
        self.shown = tuple(step + self.overlap for step in self.step)

    @property
    def grid(self) -> str:
        """The number of columns and rows, in words."""
        columns = count(self.columns, "column", "columns")
        return f"{columns} by {count(self.rows, 'row', 'rows')}"

    def corner(self, row: int, column: int) -> tuple[float, float]:
        """The lower left corner of a tile on the sheet."""
        x, y = self.origin.tolist()
        return x + column * self.step[0], y + row * self.step[1]

    def strokes_in(self, row: int, column: int, inset: float = 0.0) -> Ints:
        """The strokes that touch a tile, without ``inset`` mm on its sides with neighbours."""
        x, y = self.corner(row, column)
        window = shapely.box(
            x + inset * (column > 0),
            y + inset * (row > 0),
            x + self.shown[0] - inset * (column < self.columns - 1),
            y + self.shown[1] - inset * (row < self.rows - 1),
        )
        return np.sort(self._tree.query(window, predicate="intersects"))

    @cached_property
    def _tree(self) -> shapely.STRtree:
        path = self.toolpath
        which = np.repeat(np.arange(len(path)), np.diff(path.offsets))
        return shapely.STRtree(np.asarray(shapely.linestrings(path.points, indices=which)))

    @cached_property
    def printed(self) -> list[tuple[int, int]]:
        """The tiles that show what no neighbour does, row by row: up to the middle of the strips
        the tiles share the sheet among themselves.
        """
        places = [(row, column) for row in range(self.rows) for column in range(self.columns)]
        half = self.overlap / 2
        return [place for place in places if len(self.strokes_in(*place, half))]

    def crosses(self) -> Iterator[tuple[int, float, float]]:
        """The number and place on the sheet of each cross: two on each side of a tile that has a
        neighbour there.
        """
        number = 0
        for axis, (tiles, others) in enumerate(
            ((self.columns, self.rows), (self.rows, self.columns))
        ):
            for boundary in range(1, tiles):
                at = self.origin[axis] + boundary * self.step[axis] + self.overlap / 2
                for other in range(others):
                    first = self.origin[1 - axis]
                    begin = first + other * self.step[1 - axis]
                    end = min(begin + self.shown[1 - axis], first + self.size[1 - axis])
                    for part in (0.3, 0.7):
                        along = begin + part * (end - begin)
                        number += 1
                        yield (number, at, along) if axis == 0 else (number, along, at)

    def overview(self, canvas: Canvas, title: str) -> None:
        """The sheet with its tiles, and instructions."""
        margin = self.margin + 6
        room = self.page[0] - 2 * margin
        top = self.page[1] - margin
        text(canvas, margin, top - 5, f"{title}: {self.toolpath.sheet}", 18, bold=True)
        printed = self.printed
        words = (
            f"{self.size[0]:.0f} x {self.size[1]:.0f} mm on "
            f"{count(len(printed), 'page', 'pages')}, {self.grid}"
        )
        text(canvas, margin, top - 11, words, 9.5, colour=QUIET)
        y = paragraph(canvas, margin, top - 20, _HOW, room, 9.5)
        whole = (
            (self.columns - 1) * self.step[0] + self.shown[0],
            (self.rows - 1) * self.step[1] + self.shown[1],
        )
        scale = min(room / whole[0], (y - margin - 16) / whole[1])
        low = y - 4 - whole[1] * scale
        canvas.saveState()
        place = np.array([margin, low]) - self.origin * scale
        canvas.translate(*(place * mm).tolist())
        canvas.scale(scale, scale)
        canvas.setFillColor(PALE)
        for row in range(self.rows):
            for column in range(self.columns):
                if (row, column) not in printed:
                    a, b = self.corner(row, column)
                    canvas.rect(a * mm, b * mm, self.step[0] * mm, self.step[1] * mm, 0, 1)
        draw_for_people(canvas, self.toolpath, self.letters, scale)
        canvas.setStrokeColor(RULE)
        canvas.setLineWidth(0.3 / scale * mm)
        for row, column in printed:
            a, b = self.corner(row, column)
            canvas.rect(a * mm, b * mm, self.shown[0] * mm, self.shown[1] * mm)
        canvas.restoreState()
        for row, column in printed:
            a, b = self.corner(row, column)
            at = place + np.array([a + self.shown[0] / 2, b + self.shown[1] / 2]) * scale
            canvas.setFillColor(INK, alpha=0.75)
            canvas.circle(at[0] * mm, at[1] * mm, 4.5 * mm, stroke=0, fill=1)
            canvas.setFillAlpha(1)
            name = _field(row, column)
            text(canvas, at[0], at[1] - 1.3, name, 10, bold=True, colour=PALE, align="middle")
        entries = [("mountain", MOUNTAIN, 0.3), ("valley", VALLEY, 0.3), ("cut", INK, 0.45)]
        legend(canvas, entries, margin + room, low - 7)
        canvas.showPage()

    def draw(self, canvas: Canvas, title: str, row: int, column: int) -> None:
        """One tile."""
        margin, shown = self.margin, self.shown
        x, y = self.corner(row, column)
        canvas.saveState()
        canvas.translate(margin * mm, margin * mm)
        window = canvas.beginPath()
        window.rect(0, 0, shown[0] * mm, shown[1] * mm)
        canvas.clipPath(window, stroke=0, fill=0)
        canvas.translate(-x * mm, -y * mm)
        draw_for_people(canvas, self.toolpath, self.letters, chosen=self.strokes_in(row, column))
        for number, a, b in self.crosses():
            if x <= a <= x + shown[0] and y <= b <= y + shown[1]:
                _cross(canvas, number, a, b)
        canvas.restoreState()
        canvas.setStrokeColor(RULE)
        canvas.setLineWidth(0.15 * mm)
        canvas.rect(margin * mm, margin * mm, shown[0] * mm, shown[1] * mm)
        foot = margin - 5.5
        text(canvas, margin, foot, _field(row, column), 11, bold=True)
        words = f"{title}, {self.toolpath.sheet}; {self.grid}"
        if self.page[0] >= _NARROW_MM:
            text(canvas, margin + 10, foot, words, 7.5, colour=QUIET)
        _check_bar(canvas, self.page[0] - margin, foot)
        canvas.showPage()


def _field(row: int, column: int) -> str:
    """``A1`` for the lower left tile, columns by letters."""
    name = ""
    column += 1
    while column:
        column, rest = divmod(column - 1, 26)
        name = chr(65 + rest) + name
    return f"{name}{row + 1}"


def _cross(canvas: Canvas, number: int, x: float, y: float) -> None:
    canvas.setStrokeColor(QUIET)
    canvas.setLineWidth(0.12 * mm)
    canvas.line((x - 4) * mm, y * mm, (x + 4) * mm, y * mm)
    canvas.line(x * mm, (y - 4) * mm, x * mm, (y + 4) * mm)
    canvas.circle(x * mm, y * mm, 2 * mm, stroke=1, fill=0)
    text(canvas, x + 1.2, y + 2.2, str(number), 6.5, colour=QUIET)


def _check_bar(canvas: Canvas, right: float, y: float) -> None:
    """The bar that ends at ``right``, with its length."""
    left = right - CHECK_MM
    ends: Floats = np.array([left, right])
    canvas.setStrokeColor(INK)
    canvas.setLineWidth(0.25 * mm)
    canvas.line(left * mm, (y + 1) * mm, right * mm, (y + 1) * mm)
    for x in ends.tolist():
        canvas.line(x * mm, y * mm, x * mm, (y + 2) * mm)
    text(canvas, left - 2, y, f"print at 100 %: this is {CHECK_MM:g} mm", 7.5, colour=QUIET,
         align="right")  # fmt: skip
