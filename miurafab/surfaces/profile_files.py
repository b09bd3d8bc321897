"""Drawn profiles: the curve of a surface of revolution or of a cylinder, from a file.

A ``.csv`` or ``.txt`` file has one point a line, two numbers: r and z of a revolution, y and z of a
cylinder. A ``.dxf`` drawing has the profile as its longest curve in the plane: a polyline, a spline
or an arc, flattened to a thousandth of its size. So does an ``.svg`` drawing, in its user units
and with its axis at x = 0; fontTools reads the data of its paths. The file of a pattern holds the
points.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np

from miurafab.errors import TargetError
from miurafab.files import Reading, read_bytes, read_text
from miurafab.geometry.arrays import Floats

if TYPE_CHECKING:
    from ezdxf import path as curves

LARGEST = 1e9
"""No coordinate of a profile is larger, in its own unit."""
MOST_POINTS = 100_000
"""A profile has no more points: a curve flattened to a thousandth has some hundred."""
PROFILE_SUFFIXES = (".csv", ".txt", ".dxf", ".svg")

_DRAWN = "LWPOLYLINE POLYLINE SPLINE ARC ELLIPSE LINE"
_CURVES = ("path", "polyline", "polygon", "line")
_HIDDEN = ("defs", "clipPath", "mask", "marker", "symbol", "pattern")
_FLAT = 1e-3
_SEPARATORS = re.compile(r"[,;\s]+")


def read_profile(path: Path) -> list[list[float]]:
    """The points of the profile in the file ``path``, in its own unit.

    Raises :class:`~miurafab.errors.TargetError` for a file that is missing, of another kind, or
    holds no profile.
    """
    with Reading(path, "a profile that can be read", TargetError):
        return _profile(path)


def _profile(path: Path) -> list[list[float]]:
    suffix = path.suffix.lower()
    if suffix not in PROFILE_SUFFIXES:
        known = ", ".join(PROFILE_SUFFIXES)
        raise TargetError(f"The profile {path} is not a file of points; known are {known}.")
    if suffix in _DRAWINGS:
        return _longest(path, _DRAWINGS[suffix](path))
    points: list[list[float]] = []
    text = read_text(path, TargetError, "a list of points")
    for number, line in enumerate(text.splitlines(), 1):
        words = _SEPARATORS.split(line.partition("#")[0].strip())
        if words == [""]:
            continue
        try:
            x, y = (float(word) for word in words)
        except ValueError:
            if not points and not any(map(_is_number, words)):
                continue  # the names of the columns
            raise TargetError(
                f"{path}, line {number} is '{line.strip()}'; a profile has two numbers a line."
            ) from None
        points.append([x, y])
    return points


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _of_dxf(path: Path) -> Iterator[curves.Path]:
    from ezdxf import path as curves
    from ezdxf.filemanagement import read
    from ezdxf.lldxf.const import DXFError

    content = read_bytes(path, TargetError)
    try:
        drawing = read(io.StringIO(content.decode("utf-8", "replace").replace("\r\n", "\n")))
    except (DXFError, OSError, ValueError) as fault:
        reason = " ".join(str(fault).split()).rstrip(".")
        raise TargetError(f"{path} cannot be read as a DXF drawing: {reason}.") from None
    for entity in drawing.modelspace().query(_DRAWN):
        yield curves.make_path(entity)


def _of_svg(path: Path) -> Iterator[curves.Path]:
    """The parts of all paths, polylines, polygons and lines, with the second axis upwards."""
    from fontTools.pens.recordingPen import RecordingPen
    from fontTools.svgLib.path import parse_path

    text = read_text(path, TargetError, "an SVG drawing")
    if "<!ENTITY" in text:
        raise TargetError(f"{path} cannot be read as an SVG drawing: it declares XML entities.")
    try:
        root = ElementTree.fromstring(text)
        for element in _untransformed(root, path):
            pen = RecordingPen()
            parse_path(_path_data(element), pen)
            yield from _drawn(pen.value)
    except (ElementTree.ParseError, ValueError, IndexError, KeyError) as fault:
        reason = " ".join(str(fault).split()).rstrip(".")
        raise TargetError(f"{path} cannot be read as an SVG drawing: {reason}.") from None


def _untransformed(element: ElementTree.Element, path: Path) -> Iterator[ElementTree.Element]:
    """The elements in ``element`` that draw curves. Raises for one that is moved by an attribute:
    how far it lies from the axis would be lost."""
    tag = element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""
    if tag in _HIDDEN:
        return
    inside = [found for child in element for found in _untransformed(child, path)]
    if tag in _CURVES:
        inside.append(element)
    if inside and element.get("transform"):
        raise TargetError(
            f"{path}: '{element.get('id', tag)}' is moved by a transform; apply it to the points "
            "in your drawing program, or ungroup it."
        )
    yield from inside


def _path_data(element: ElementTree.Element) -> str:
    """What the element draws, as the data of a path."""
    tag = element.tag.rpartition("}")[2]
    if tag == "path":
        return element.get("d", "")
    if tag == "line":
        x1, y1, x2, y2 = (element.get(name, "0") for name in ("x1", "y1", "x2", "y2"))
        return f"M {x1} {y1} L {x2} {y2}"
    points = element.get("points", "")
    return f"M {points}{' Z' if tag == 'polygon' else ''}" if points.strip() else ""


def _drawn(strokes: Iterable[tuple[str, tuple[tuple[float, float], ...]]]) -> Iterator[curves.Path]:
    """The curves of a pen's ``strokes``."""
    from ezdxf import path as curves

    curve = curves.Path()
    for stroke, places in strokes:
        points = [(x, -y) for x, y in places]
        if stroke == "moveTo":
            curve = curves.Path(points[0])
        elif stroke == "lineTo":
            curve.line_to(points[0])
        elif stroke == "curveTo":
            curve.curve4_to(points[2], points[0], points[1])
        elif stroke == "qCurveTo":
            curve.curve3_to(points[1], points[0])
        else:
            if stroke == "closePath":
                curve.close()
            yield curve
            curve = curves.Path(curve.start)  # where a stroke after a closed one begins


def _longest(path: Path, found: Iterable[curves.Path]) -> list[list[float]]:
    """The points of the longest of the curves, flattened."""
    flattened: list[Floats] = []
    for curve in found:
        ends = np.array([[p.x, p.y] for p in curve.control_vertices()])
        if len(ends) < 2:
            continue
        if not (np.abs(ends) < LARGEST).all():
            raise TargetError(f"{path} holds a coordinate that is no number below 1e9.")
        flat = _FLAT * max(float(np.ptp(ends, axis=0).max()), 1e-12)
        points = np.array([[p.x, p.y] for p in islice(curve.flattening(flat), MOST_POINTS)])
        if len(points) == MOST_POINTS:
            raise TargetError(f"{path} holds a curve of more than {MOST_POINTS:,} points.")
        apart = np.linalg.norm(np.diff(points, axis=0), axis=1) > 0
        flattened.append(points[np.concatenate([[True], apart])])
    if not flattened:
        raise TargetError(f"{path} holds no polyline, spline or arc to be a profile.")
    longest = max(flattened, key=lambda p: float(np.linalg.norm(np.diff(p, axis=0), axis=1).sum()))
    points_list: list[list[float]] = longest.tolist()
    return points_list


_DRAWINGS: dict[str, Callable[[Path], Iterator[curves.Path]]] = {".dxf": _of_dxf, ".svg": _of_svg}
