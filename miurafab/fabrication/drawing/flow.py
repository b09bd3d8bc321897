"""Sections on pages of paper, one after the other: a block that has no room goes to the next page.

A section begins on the page on which the one before it ends, if its head and its first two parts
have room there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from reportlab.lib.colors import Color
from reportlab.lib.units import mm
from reportlab.pdfbase.pdfmetrics import stringWidth

from miurafab.fabrication.drawing.page import (
    BOTTOM,
    HEIGHT,
    INK,
    LEADING,
    MARGIN,
    QUIET,
    ROOM,
    Page,
    heading,
    line_above,
    paragraph,
    text,
    wrapped,
)
from miurafab.fabrication.drawing.sections import (
    Block,
    Figure,
    Figures,
    Numbered,
    Section,
    ShortRows,
)
from miurafab.fabrication.drawing.svg_canvas import Pen

_TOP = HEIGHT - MARGIN - 19
"""The top of the content under the head of a page."""
_SIZE, _LINE = 9.0, 9.0 * LEADING
_GAP = 6.0
"""Between figures side by side."""
_HEAD = 13.0
"""The height of the head of a section within a page."""
_ROW = 4.1
"""The height of a row of columns."""
_DEEP = 16
"""So many rows stand below each other in a part."""
_SMALL = 8.0


@dataclass(frozen=True)
class _Stretch:
    """Something of a known ``height`` that is not broken; ``draw`` draws it from a height down."""

    height: float
    draw: Callable[[Pen, float], object]


def flow(sections: Sequence[Section], title: str) -> list[Page]:
    """Functions that draw one page each of the guide with this ``title``."""
    pages: list[list[tuple[float, _Stretch]]] = []
    y = BOTTOM
    for section in sections:
        parts = [part for block in section.blocks for part in _parts(block)]
        begins = sum(part.height for part in parts[:2]) + _HEAD + 4.0
        if pages and y - begins >= BOTTOM:
            pages[-1].append((y - 4.0, _head_within(section)))
            y -= _HEAD + 4.0
        else:
            pages.append([(_TOP, _head(title, section.title, section.subtitle))])
            y = _TOP
        for part in parts:
            if y - part.height < BOTTOM:
                pages.append([(_TOP, _head(title, section.title, "Continued"))])
                y = _TOP
            pages[-1].append((y, part))
            y -= part.height

    def page(parts: list[tuple[float, _Stretch]]) -> Page:
        def draw(canvas: Pen) -> None:
            for top, part in parts:
                part.draw(canvas, top)

        return draw

    return [page(parts) for parts in pages]


def _head(title: str, name: str, subtitle: str) -> _Stretch:
    return _Stretch(0.0, lambda canvas, _: heading(canvas, f"{title}: {name}", subtitle))


def _head_within(section: Section) -> _Stretch:
    def draw(canvas: Pen, y: float) -> None:
        line_above(canvas, MARGIN, y, ROOM)
        text(canvas, MARGIN, y - 6, section.title[:1].upper() + section.title[1:], 13, bold=True)
        text(canvas, MARGIN, y - 10.2, section.subtitle, _SIZE, colour=QUIET)

    return _Stretch(_HEAD, draw)


def _parts(block: Block) -> Iterator[_Stretch]:
    if isinstance(block, Numbered):
        for number, line in enumerate(block.lines, start=1):
            yield _step(number, line)
    elif isinstance(block, Figures):
        yield from _rows(block)
    elif isinstance(block, ShortRows):
        yield from _chunks(block)
    else:
        yield _said(block.words, bold=block.bold)


def _said(words: str, *, bold: bool) -> _Stretch:
    height = len(wrapped(words, ROOM, _SIZE, bold=bold)) * _LINE + 2.0
    return _Stretch(
        height,
        lambda canvas, y: paragraph(canvas, MARGIN, y - 3.2, words, ROOM, _SIZE, bold=bold),
    )


def _step(number: int, words: str) -> _Stretch:
    def draw(canvas: Pen, y: float) -> None:
        text(canvas, MARGIN, y - 3.2, f"{number}", _SIZE, bold=True, colour=QUIET)
        paragraph(canvas, MARGIN + 6, y - 3.2, words, ROOM - 6, _SIZE)

    return _Stretch(len(wrapped(words, ROOM - 6, _SIZE)) * _LINE + 1.6, draw)


def _rows(block: Figures) -> Iterator[_Stretch]:
    """The rows of figures, each as high as its highest figure."""
    columns = block.columns
    width = (ROOM - _GAP * (columns - 1)) / columns
    for first in range(0, len(block.figures), columns):
        yield _row(block.figures[first : first + columns], width, block.tallest)


def _row(figures: Sequence[Figure], width: float, tallest: float) -> _Stretch:
    said = [
        [part for line in each.lines for part in wrapped(line, width, _SMALL)] for each in figures
    ]
    titles = [wrapped(each.title, width - 8.5 * (each.number is not None), 9.5, bold=True)
              for each in figures]  # fmt: skip
    above = 4.6 * max(map(len, titles)) + 3.7 * max(map(len, said)) + 4.0
    tall = min(max(each.aspect * width for each in figures), tallest)

    def draw(canvas: Pen, y: float) -> None:
        for place, (each, title, lines) in enumerate(zip(figures, titles, said, strict=True)):
            x = MARGIN + place * (width + _GAP)
            left = x
            if each.number is not None:
                canvas.setFillColor(INK)
                canvas.circle((x + 3.2) * mm, (y - 4.0) * mm, 3.2 * mm, stroke=0, fill=1)
                text(
                    canvas, x + 3.2, y - 5.1, str(each.number), 8.5, bold=True,
                    colour=Color(1, 1, 1), align="middle",
                )  # fmt: skip
                left += 8.5
            at = y - 5.2
            for line in title:
                text(canvas, left, at, line, 9.5, bold=True)
                at -= 4.6
            for line in lines:
                text(canvas, left, at, line, _SMALL)
                at -= 3.7
            each.draw(canvas, (x, y - above - 1.0 - tall, width, tall))

    return _Stretch(above + tall + 4.0, draw)


def _chunks(block: ShortRows) -> Iterator[_Stretch]:
    """The rows in columns, in parts of which two or three have room on a page."""
    a_part = _DEEP * block.columns
    width = (ROOM - _GAP * (block.columns - 1)) / block.columns
    for first in range(0, len(block.rows), a_part):
        rows = block.rows[first : first + a_part]
        deep = math.ceil(len(rows) / block.columns)
        yield _chunk(block.head, rows, deep, width)


def _chunk(
    head: tuple[str, ...], rows: Sequence[tuple[str, ...]], deep: int, width: float
) -> _Stretch:
    taken = [
        max(stringWidth(row[k], "Helvetica-Bold", _SMALL) for row in (head, *rows)) / mm
        for k in range(len(head))
    ]
    apart = max(min((width - sum(taken)) / max(len(head) - 1, 1), 5.0), 1.0)
    left = [sum(taken[:k]) + apart * k for k in range(len(head))]

    def draw(canvas: Pen, y: float) -> None:
        for column in range(math.ceil(len(rows) / deep)):
            x = MARGIN + column * (width + _GAP)
            for word, shift in zip(head, left, strict=True):
                text(canvas, x + shift, y - 3.4, word, 7.5, colour=QUIET)
            line_above(canvas, x, y - 4.6, width)
            for place, row in enumerate(rows[column * deep : (column + 1) * deep]):
                for number, (word, shift) in enumerate(zip(row, left, strict=True)):
                    at = y - 4.6 - _ROW * (place + 0.8)
                    text(canvas, x + shift, at, word, _SMALL, bold=number == 0)

    return _Stretch(_ROW * deep + 8.0, draw)
