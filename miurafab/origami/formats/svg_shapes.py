"""What an SVG element draws: lines and curves in its own units (SVG 1.1, chapters 8 and 9)."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from xml.etree.ElementTree import Element

import numpy as np

from miurafab.errors import PatternError
from miurafab.geometry.arrays import Floats
from miurafab.origami.formats.curves import Arc, Bezier, PlainCurve, Polyline, svg_arc
from miurafab.origami.formats.lines import finite_number
from miurafab.units import DECIMAL

NUMBER = re.compile(rf"[-+]?{DECIMAL}(?:[eE][-+]?\d+)?")
_PATH = re.compile(r"([MmLlHhVvZzCcSsQqTtAa])|(" + NUMBER.pattern + r")|([^\s,])")
_FLAG = re.compile(r"[\s,]*([01])")
_AXES = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])


def tag_of(element: Element) -> str:
    """The tag without its namespace; empty for a comment."""
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""


def shapes(element: Element) -> Iterator[PlainCurve]:
    """The lines that ``element`` draws; none for an element that draws none.

    Raises :class:`~miurafab.errors.PatternError` for what is no number or no path.
    """
    tag = tag_of(element)

    def number(name: str) -> float:
        return value_of(element.get(name) or "0", name)

    if tag == "line":
        yield Polyline(np.array([[number("x1"), number("y1")], [number("x2"), number("y2")]]))
    elif tag in ("polyline", "polygon"):
        numbers = [float(text) for text in NUMBER.findall(element.get("points") or "")]
        points = np.array(numbers[: len(numbers) // 2 * 2]).reshape(-1, 2)
        if len(points) > 1:
            yield Polyline(np.concatenate([points, points[:1]]) if tag == "polygon" else points)
    elif tag == "rect":
        yield from _rectangle(element)
    elif tag in ("circle", "ellipse"):
        names = ("r", "r") if tag == "circle" else ("rx", "ry")
        radii = np.array([number(name) for name in names])
        if (radii > 0).all():
            centre = np.array([number("cx"), number("cy")])
            yield Arc(centre, np.diag(radii), 0.0, 2 * math.pi)
    elif tag == "path":
        yield from _PathReader(element.get("d") or "").drawn()


def value_of(text: str, name: str) -> float:
    """The number in ``text``. Raises ``PatternError`` naming the attribute ``name``."""
    number = text.strip().removesuffix("px").rstrip()
    if NUMBER.fullmatch(number) is None:
        raise PatternError(f"{name} is '{text[:40]}', not a number.")
    return finite_number(number, name)


def _rectangle(element: Element) -> Iterator[PlainCurve]:
    x, y, width, height = (
        value_of(element.get(name) or "0", name) for name in ("x", "y", "width", "height")
    )
    given = [element.get(name) for name in ("rx", "ry")]
    radii = [None if text is None else value_of(text, "rx") for text in given]
    rx, ry = (next((r for r in pair if r is not None), 0.0) for pair in (radii, radii[::-1]))
    rx, ry = min(max(rx, 0.0), width / 2), min(max(ry, 0.0), height / 2)
    if rx == 0 or ry == 0:
        corners = [[x, y], [x + width, y], [x + width, y + height], [x, y + height], [x, y]]
        yield Polyline(np.array(corners))
        return
    (left, top), (right, bottom) = (x + rx, y + ry), (x + width - rx, y + height - ry)
    centres = np.array([[right, bottom], [left, bottom], [left, top], [right, top]])
    radii_of = np.array([rx, ry])
    for quarter, centre in enumerate(centres):
        yield Arc(centre, np.diag(radii_of), quarter * math.pi / 2, math.pi / 2)
        side = radii_of * _AXES[(quarter + 1) % 4]
        ends = np.stack([centre + side, centres[(quarter + 1) % 4] + side])
        if (ends[0] != ends[1]).any():
            yield Polyline(ends)


class _PathReader:
    """The commands of a path, read one after the other; it moves on as it reads."""

    def __init__(self, text: str) -> None:
        self.text, self.place = text, 0
        self.at, self.start = np.zeros(2), np.zeros(2)
        self.handle: Floats | None = None
        """The last control point of a curve before, of which S and T take the mirror image."""
        self.cubic = False

    def drawn(self) -> Iterator[PlainCurve]:
        """The lines and curves; straight ones in one piece as far as they hang together."""
        corners: list[Floats] = []
        command = ""
        while (token := self._peek()) is not None:
            if token[1]:
                command = token[1]
                self.place = token.end()
            elif token[3]:
                raise PatternError(
                    f"the path '{self.text[:40]}' holds '{token[3]}', which is no command of a "
                    "path."
                )
            elif not command:
                raise PatternError(f"the path '{self.text[:40]}' begins with a number.")
            kind, relative = command.upper(), command.islower()
            if kind != "M" and not corners:
                raise PatternError(f"the path '{self.text[:40]}' does not begin with an M.")
            if kind in "CSQTA":
                if len(corners) > 1:
                    yield Polyline(np.array(corners))
                yield self._curve(kind, relative)
                corners = [self.at]
                continue
            self.handle = None
            if kind == "Z":
                corners.append(self.start)
                self.at, command = self.start, ""
                continue
            to = self._straight(kind, relative)
            if kind == "M":
                if len(corners) > 1:
                    yield Polyline(np.array(corners))
                corners, self.start = [to], to
                command = "l" if relative else "L"
            else:
                corners.append(to)
            self.at = to
        if len(corners) > 1:
            yield Polyline(np.array(corners))

    def _straight(self, kind: str, relative: bool) -> Floats:
        base = self.at if relative else np.zeros(2)
        if kind == "H":
            return np.array([self._number() + base[0], self.at[1]])
        if kind == "V":
            return np.array([self.at[0], self._number() + base[1]])
        return self._point(base)

    def _curve(self, kind: str, relative: bool) -> PlainCurve:
        """The next curve; its end is where the path is then."""
        start, base = self.at, self.at if relative else np.zeros(2)
        if kind == "A":
            radii, turn = self._point(np.zeros(2)), math.radians(self._number())
            large, sweep = self._flag(), self._flag()
            self.at, self.handle = self._point(base), None
            return svg_arc(start, self.at, radii, turn, large, sweep)
        cubic = kind in "CS"
        if kind in "CQ":
            first = self._point(base)
        else:  # mirrored in the point where the curve of the same kind before ended
            before = self.handle if self.cubic == cubic else None
            first = start if before is None else 2 * start - before
        control = [start, first, *([self._point(base)] if cubic else []), self._point(base)]
        self.at, self.handle, self.cubic = control[-1], control[-2], cubic
        return Bezier(np.array(control))

    def _peek(self) -> re.Match[str] | None:
        return _PATH.search(self.text, self.place)

    def _number(self) -> float:
        token = self._peek()
        if token is None or not token[2]:
            raise PatternError(f"the path '{self.text[:40]}' lacks a number.")
        self.place = token.end()
        return finite_number(token[2], "a number of a path")

    def _point(self, base: Floats) -> Floats:
        return np.array([self._number(), self._number()]) + base

    def _flag(self) -> bool:
        """A flag of an arc, which needs no space behind it."""
        match = _FLAG.match(self.text, self.place)
        if match is None:
            raise PatternError(f"the path '{self.text[:40]}' has an arc whose flag is not 0 or 1.")
        self.place = match.end()
        return match[1] == "1"
