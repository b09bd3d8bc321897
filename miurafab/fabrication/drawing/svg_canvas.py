"""A canvas that writes SVG, so that one drawing serves the printed guide and the page for a tablet.

It has the part of reportlab's canvas that the views of the guide use, with the same units: points,
from the lower left corner, y upwards. In SVG y points down; so each y changes its sign when it is
written, and the view box begins at minus the height.
"""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from reportlab.lib.colors import Color
from reportlab.lib.units import mm
from reportlab.pdfbase.pdfmetrics import stringWidth
from reportlab.pdfgen.canvas import Canvas
from reportlab.pdfgen.pathobject import PDFPathObject

from miurafab.fabrication.drawing.colours import hex_of

_FINE = 1
"""Decimals of a coordinate in points: a tenth is 0.035 mm."""
_CAPS, _JOINS = ("butt", "round", "square"), ("miter", "round", "bevel")


def _n(value: float) -> str:
    text = f"{value:.{_FINE}f}".removesuffix(".0")
    return "0" if text == "-0" else text


class SvgPath:
    """The data of a path that grows."""

    def __init__(self) -> None:
        self.data: list[str] = []

    def moveTo(self, x: float, y: float) -> None:
        self.data.append(f"M{_n(x)} {_n(-y)}")

    def lineTo(self, x: float, y: float) -> None:
        self.data.append(f"L{_n(x)} {_n(-y)}")

    def close(self) -> None:
        self.data.append("Z")


@dataclass(slots=True)
class _Brush:
    """The state of a canvas that is kept and restored; it changes as the canvas draws."""

    fill: str = "#000000"
    line: str = "#000000"
    width: float = 1.0
    cap: int = 0
    join: int = 0
    dash: str = ""
    font: str = "Helvetica"
    size: float = 10.0


class SvgCanvas:
    """A drawing that grows; it mutates as reportlab's canvas does."""

    def __init__(self) -> None:
        self._parts: list[str] = []
        self._open: list[int] = []
        self._look = _Brush()
        self._kept: list[_Brush] = []

    def text(self, x: float, y: float, width: float, height: float, title: str) -> str:
        """The SVG of what lies in a box of the page, in mm; ``title`` says what it shows."""
        box = f"{_n(x * mm)} {_n(-(y + height) * mm)} {_n(width * mm)} {_n(height * mm)}"
        says = html.escape(title, quote=True)
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{box}" role="img" '
            f'aria-label="{says}" font-family="Helvetica, Arial, sans-serif">'
            f"{''.join(self._parts)}{'</g>' * len(self._open)}</svg>"
        )

    def setFillColor(self, colour: Color) -> None:
        self._look.fill = _hex(colour)

    def setStrokeColor(self, colour: Color) -> None:
        self._look.line = _hex(colour)

    def setLineWidth(self, width: float) -> None:
        self._look.width = width

    def setLineCap(self, mode: int) -> None:
        self._look.cap = mode

    def setLineJoin(self, mode: int) -> None:
        self._look.join = mode

    def setDash(self, array: Sequence[float] = (), phase: float = 0) -> None:
        parts = " ".join(map(_n, array))
        dash = f' stroke-dasharray="{parts}" stroke-dashoffset="{_n(phase)}"' if parts else ""
        self._look.dash = dash

    def setFont(self, name: str, size: float) -> None:
        self._look.font, self._look.size = name, size

    def saveState(self) -> None:
        self._open.append(0)
        self._kept.append(replace(self._look))

    def restoreState(self) -> None:
        self._parts.append("</g>" * self._open.pop())
        self._look = self._kept.pop()

    def translate(self, x: float, y: float) -> None:
        self._group(f"translate({_n(x)} {_n(-y)})")

    def scale(self, x: float, y: float) -> None:
        self._group(f"scale({x:.6g} {y:.6g})")

    def _group(self, transform: str) -> None:
        self._open[-1] += 1
        self._parts.append(f'<g transform="{transform}">')

    def beginPath(self) -> SvgPath:
        return SvgPath()

    def drawPath(
        self,
        path: SvgPath | PDFPathObject,
        stroke: int = 1,
        fill: int = 0,
        fillMode: int | None = None,
    ) -> None:
        assert isinstance(path, SvgPath)
        if path.data:
            rule = ' fill-rule="evenodd"' if fillMode == 0 else ""
            self._drawn("".join(path.data), stroke, fill, rule)

    def line(self, x0: float, y0: float, x1: float, y1: float) -> None:
        self.lines([(x0, y0, x1, y1)])

    def lines(self, ends: Iterable[Sequence[float]]) -> None:
        data = "".join(f"M{_n(a)} {_n(-b)}L{_n(c)} {_n(-d)}" for a, b, c, d in ends)
        if data:
            self._drawn(data, 1, 0)

    def rect(
        self, x: float, y: float, width: float, height: float, stroke: int = 1, fill: int = 0
    ) -> None:
        self._drawn(f"M{_n(x)} {_n(-y)}h{_n(width)}v{_n(-height)}h{_n(-width)}Z", stroke, fill)

    def roundRect(
        self,
        x: float,
        y: float,
        width: float,
        height: float,
        radius: float,
        stroke: int = 1,
        fill: int = 0,
    ) -> None:
        r, across, up = _n(radius), _n(width - 2 * radius), height - 2 * radius
        corner = f"a{r} {r} 0 0 0 "
        self._drawn(
            f"M{_n(x + radius)} {_n(-y)}h{across}{corner}{r} -{r}v{_n(-up)}{corner}-{r} -{r}"
            f"h-{across}{corner}-{r} {r}v{_n(up)}{corner}{r} {r}Z",
            stroke,
            fill,
        )

    def circle(self, x: float, y: float, radius: float, stroke: int = 1, fill: int = 0) -> None:
        r, d = _n(radius), _n(2 * radius)
        self._drawn(
            f"M{_n(x - radius)} {_n(-y)}a{r} {r} 0 1 0 {d} 0a{r} {r} 0 1 0 -{d} 0Z", stroke, fill
        )

    def _drawn(self, data: str, stroke: int, fill: int, rule: str = "") -> None:
        inside = f' fill="{self._look.fill}"{rule}' if fill else ' fill="none"'
        around = ""
        if stroke:
            look = self._look
            cap = f' stroke-linecap="{_CAPS[look.cap]}"' if look.cap else ""
            join = f' stroke-linejoin="{_JOINS[look.join]}"' if look.join else ""
            width = f' stroke-width="{look.width:.3g}"'
            around = f' stroke="{look.line}"{width}{cap}{join}{look.dash}'
        self._parts.append(f'<path d="{data}"{inside}{around}/>')

    def stringWidth(self, words: str, font: str, size: float) -> float:
        return float(stringWidth(words, font, size))

    def drawString(self, x: float, y: float, words: str, mode: int | None = None) -> None:
        self._words(x, y, words, "start", mode)

    def drawRightString(self, x: float, y: float, words: str) -> None:
        self._words(x, y, words, "end", None)

    def drawCentredString(self, x: float, y: float, words: str) -> None:
        self._words(x, y, words, "middle", None)

    def _words(self, x: float, y: float, words: str, anchor: str, mode: int | None) -> None:
        own = self._look
        bold = ' font-weight="bold"' if own.font.endswith("Bold") else ""
        where = "" if anchor == "start" else f' text-anchor="{anchor}"'
        colour = f'fill="{own.fill}"'
        if mode == 1:  # the outline alone
            colour = f'fill="none" stroke="{own.line}" stroke-width="{own.width:.3g}"'
            colour += ' stroke-linejoin="round" aria-hidden="true"'
        self._parts.append(
            f'<text x="{_n(x)}" y="{_n(-y)}" font-size="{own.size:.3g}"{bold}{where} {colour}>'
            f"{html.escape(words, quote=False)}</text>"
        )


def _hex(colour: Color) -> str:
    return hex_of((colour.red, colour.green, colour.blue))


Pen = Canvas | SvgCanvas
"""What a view of the guide draws on."""
