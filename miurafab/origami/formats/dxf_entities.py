"""The lines and curves of a DXF file: its LINE, ARC, CIRCLE, ELLIPSE, SPLINE and polylines.

Group codes are those of the AutoCAD DXF reference, section ENTITIES. Arcs, circles and polylines
lie in a system of their own, which is mirrored where the extrusion direction points down (groups
210 to 230).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np

from miurafab.errors import PatternError
from miurafab.geometry.arrays import Floats
from miurafab.origami.formats.crease_lines import CreaseLines, DrawnLine, straightened
from miurafab.origami.formats.curves import Arc, Curve, Polyline, Spline, bulged
from miurafab.origami.formats.lines import finite_number

Tags = list[tuple[int, str]]

_CLOSED, _FRAME = 1, 16
_HIGHEST_DEGREE = 25
"""Of a spline; programs draw up to 11, and each point takes the square of it in time."""
_MIRRORED = np.array([[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
_UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
_WITHOUT_LINES = frozenset(
    {"ENDSEC", "TEXT", "MTEXT", "POINT", "DIMENSION", "VIEWPORT", "ATTRIB", "SEQEND"}
)


@np.errstate(over="ignore", invalid="ignore")
def parse_dxf(text: str, curve_tolerance: float | None = None) -> CreaseLines:
    """The lines of a DXF file, lettered by layer, else by colour.

    Curves become straight lines within ``curve_tolerance``, mm
    (:func:`~miurafab.origami.formats.crease_lines.straightened`). Raises ``PatternError`` naming
    the line at fault.
    """
    drawn: list[DrawnLine] = []
    left_out: dict[str, int] = {}
    for kind, tags in _entities(text):
        if kind not in _COURSES:
            if kind not in _WITHOUT_LINES:
                left_out[kind] = left_out.get(kind, 0) + 1
            continue
        letter = _dxf_letter(tags)
        drawn += [DrawnLine(course, letter, math.nan) for course in _COURSES[kind](tags)]
    return straightened(drawn, curve_tolerance, left_out)


def _line(tags: Tags) -> Iterator[Curve]:
    x0, y0, x1, y1 = (_first(tags, code) for code in (10, 20, 11, 21))
    yield Polyline(np.array([[x0, y0], [x1, y1]]))


def _circle(tags: Tags) -> Iterator[Curve]:
    yield from _round(tags, 0.0, 2 * math.pi)


def _arc(tags: Tags) -> Iterator[Curve]:
    start, end = (math.radians(_first(tags, code)) for code in (50, 51))
    yield from _round(tags, start, (end - start) % (2 * math.pi) or 2 * math.pi)


def _round(tags: Tags, start: float, sweep: float) -> Iterator[Curve]:
    centre, radius = np.array([_first(tags, 10), _first(tags, 20)]), _first(tags, 40)
    if radius > 0:
        yield Arc(centre, radius * np.eye(2), start, sweep).moved(_system(tags))


def _ellipse(tags: Tags) -> Iterator[Curve]:
    centre, major = (np.array([_first(tags, n), _first(tags, n + 10)]) for n in (10, 11))
    ratio, start, end = (_first(tags, code) for code in (40, 41, 42))
    side = -1.0 if _is_mirrored(tags) else 1.0
    minor = side * ratio * np.array([-major[1], major[0]])
    sweep = (end - start) % (2 * math.pi) or 2 * math.pi
    yield Arc(centre, np.stack([major, minor], axis=1), start, sweep)


def _spline(tags: Tags) -> Iterator[Curve]:
    degree = int(_first(tags, 71))
    control = np.stack([_all(tags, 10, "an x"), _all(tags, 20, "a y")], axis=1)
    knots, weights = _all(tags, 40, "a knot"), _all(tags, 41, "a weight")
    if not len(control):
        raise PatternError(
            "a SPLINE has points to fit and no control points; save the drawing with control "
            "points, or as polylines."
        )
    if not len(weights):
        weights = np.ones(len(control))
    if degree > _HIGHEST_DEGREE:
        raise PatternError(
            f"a SPLINE is of degree {degree:.4g}; {_HIGHEST_DEGREE} is the highest that is read."
        )
    sound = 1 <= degree < len(control) and len(knots) == len(control) + degree + 1
    if not sound or len(weights) != len(control):
        raise PatternError(
            f"a SPLINE of degree {degree} has {len(control)} control points, {len(knots)} knots "
            f"and {len(weights)} weights, which do not go together."
        )
    if (np.diff(knots) < 0).any() or not knots[degree] < knots[len(control)]:
        raise PatternError("a SPLINE has knots that do not rise.")
    if not (weights > 0).all():
        raise PatternError("a SPLINE has a weight that is not positive.")
    yield Spline(degree, knots, control, weights)


def _polyline(tags: Tags) -> Iterator[Curve]:
    """Its straight and its bulged sides, straight ones in one piece as far as they hang together.

    The vertices of a POLYLINE are entities of their own behind it. Those of the frame of a spline
    are no corners of it.
    """
    corners: list[list[float]] = []
    vertex = list[Tags]()
    if any(tag == (0, "VERTEX") for tag in tags):
        for code, value in tags:
            if code == 0:
                vertex.append([])
            elif vertex:
                vertex[-1].append((code, value))
        vertex = [each for each in vertex if not int(_first(each, 70)) & _FRAME]
    else:
        for code, value in tags:
            if code == 10:
                vertex.append([])
            if vertex:
                vertex[-1].append((code, value))
    for each in vertex:
        if not {10, 20} <= {code for code, _ in each}:
            raise PatternError("a polyline has a vertex without an x or a y.")
        corners.append([_first(each, code) for code in (10, 20, 42)])
    if len(corners) < 2:
        return
    if int(_first(tags, 70)) & _CLOSED:
        corners.append(corners[0])
    system = _system(tags)
    run = [np.array(corners[0][:2])]
    for (x, y, bulge), (to_x, to_y, _) in itertools.pairwise(corners):
        end = np.array([to_x, to_y])
        if bulge == 0:
            run.append(end)
            continue
        if len(run) > 1:
            yield Polyline(np.array(run)).moved(system)
        yield bulged(np.array([x, y]), end, bulge).moved(system)
        run = [end]
    if len(run) > 1:
        yield Polyline(np.array(run)).moved(system)


_COURSES = {
    "LINE": _line,
    "ARC": _arc,
    "CIRCLE": _circle,
    "ELLIPSE": _ellipse,
    "SPLINE": _spline,
    "LWPOLYLINE": _polyline,
    "POLYLINE": _polyline,
}


def _is_mirrored(tags: Tags) -> bool:
    return _first(tags, 230) < 0


def _system(tags: Tags) -> Floats:
    return _MIRRORED if _is_mirrored(tags) else _UPRIGHT


def _entities(text: str) -> Iterator[tuple[str, Tags]]:
    """The kind and the (group code, value) pairs of each entity of the ENTITIES section.

    The pairs of a POLYLINE include those of its vertices.
    """
    rows = text.splitlines()
    if len(rows) < 4 or rows[0].strip() != "0" or rows[1].strip() != "SECTION":
        raise PatternError("it is not a DXF file in text form.")
    section, kind, tags = "", "", Tags()
    for number in range(0, len(rows) - 1, 2):
        value = rows[number + 1].strip()
        try:
            code = int(rows[number])
        except ValueError:
            raise PatternError(
                f"line {number + 1} is '{rows[number].strip()[:40]}', not a DXF group code."
            ) from None
        if code != 0:
            if code == 2 and kind == "SECTION":
                section = value
            tags.append((code, value))
            continue
        if kind == "POLYLINE" and value == "VERTEX":
            tags.append((code, value))
            continue
        if section == "ENTITIES" and kind not in ("", "SECTION"):
            yield kind, tags
        kind, tags = value, []


def _dxf_letter(tags: Tags) -> str:
    """The assignment by the layer's name, else by the colour, else unassigned."""
    first = dict(reversed(tags))  # the first tag of each code
    layer = first.get(8, "").lower()
    for part, letter in (
        ("mountain", "M"), ("valley", "V"), ("cut", "B"), ("border", "B"), ("boundary", "B"),
        ("aux", "F"), ("flat", "F"),
    ):  # fmt: skip
        if part in layer:
            return letter
    colour = int(finite_number(first.get(62, "0"), "a colour"))
    return {1: "M", 5: "V", 3: "B"}.get(colour, "U")


def _first(tags: Tags, code: int) -> float:
    value = next((value for group, value in tags if group == code), "0")
    return finite_number(value, f"group {code}")


def _all(tags: Tags, code: int, what: str) -> Floats:
    return np.array([finite_number(value, what) for group, value in tags if group == code])
