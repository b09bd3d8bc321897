"""Curved lines of a drawing, as straight lines that stay within a tolerance of them.

A curve B(t) on a parameter range of length h lies within h^2 max |B''| / 8 of its chord (D. Filip,
R. Magedson and R. Markot, Surface algorithms using bounds on derivatives, Computer Aided Geometric
Design 3, 1986). So a curve is cut at equal steps of its parameter, as few as this allows:

- a Bezier curve of degree d has |B''| <= d (d - 1) max |P_i - 2 P_i+1 + P_i+2|;
- an arc c + A (cos t, sin t) has |B''| <= |A|, the larger radius of its ellipse;
- of a spline the number of steps between two knots is doubled until the middles lie near enough.

Curves of one shape are cut into as many lines as the largest of them, so that the creases of a
pleat have their corners opposite to each other, where the paper between them is ruled.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from miurafab.errors import PatternError
from miurafab.geometry.arrays import Floats

SHARE = 1e-3
"""The tolerance of curves, as a part of the longer side of the drawing, where none is given."""

MOST = 10_000
"""A curve of more straight lines is refused: its tolerance is too fine."""

_LEAST_FLAT = 1e-12
_STRAIGHT = 1e-6


@dataclass(frozen=True, eq=False)
class Polyline:
    """Straight lines through ``corners`` (n, 2)."""

    corners: Floats

    def moved(self, matrix: Floats) -> Polyline:
        """The same under ``matrix`` (2, 3)."""
        return Polyline(_moved(self.corners, matrix))

    def hull(self) -> Floats:
        """(n, 2) points whose box holds it."""
        return self.corners

    def points(self, tolerance: float) -> Floats:
        """(n, 2) its corners; it needs no ``tolerance``."""
        return self.corners


@dataclass(frozen=True, eq=False)
class Bezier:
    """A Bezier curve with the ``control`` points (d + 1, 2), of degree d = 2 or 3."""

    control: Floats

    def moved(self, matrix: Floats) -> Bezier:
        """The same curve under ``matrix`` (2, 3)."""
        return Bezier(_moved(self.control, matrix))

    def hull(self) -> Floats:
        """(n, 2) points whose box holds the curve."""
        return self.control

    def points(self, tolerance: float) -> Floats:
        """(n, 2) points on it whose straight lines lie within ``tolerance`` of it."""
        degree = len(self.control) - 1
        second = np.linalg.norm(np.diff(self.control, 2, axis=0), axis=1).max()
        t = np.linspace(0.0, 1.0, _steps(degree * (degree - 1) * float(second), tolerance) + 1)
        level = np.repeat(self.control[:, None], len(t), axis=1)
        while len(level) > 1:  # de Casteljau
            level = level[:-1] + t[None, :, None] * (level[1:] - level[:-1])
        found = level[0]
        found[[0, -1]] = self.control[[0, -1]]
        return np.asarray(found)


@dataclass(frozen=True, eq=False)
class Arc:
    """The points ``centre`` + ``axes`` (cos t, sin t) for t from ``start`` on by ``sweep``."""

    centre: Floats
    axes: Floats
    start: float
    sweep: float

    def moved(self, matrix: Floats) -> Arc:
        """The same arc under ``matrix`` (2, 3)."""
        return Arc(_moved(self.centre, matrix), matrix[:, :2] @ self.axes, self.start, self.sweep)

    def hull(self) -> Floats:
        """(n, 2) points whose box holds the arc: its ends, and where it turns back in x or y."""
        low = min(self.start, self.start + self.sweep)
        peak = np.arctan2(self.axes[:, 1], self.axes[:, 0])
        turns = low + (np.concatenate([peak, peak + math.pi]) - low) % (2 * math.pi)
        ends = np.array([self.start, self.start + self.sweep])
        t = np.concatenate([ends, turns[turns < low + abs(self.sweep)]])
        return np.asarray(self.centre + np.stack([np.cos(t), np.sin(t)], axis=1) @ self.axes.T)

    def points(self, tolerance: float) -> Floats:
        """(n, 2) points on it whose straight lines lie within ``tolerance`` of it.

        A whole turn is three lines at least, and half a turn two.
        """
        radius = float(np.linalg.norm(self.axes, 2))
        least = math.ceil(abs(self.sweep) / (0.7 * math.pi) - 1e-9)
        count = max(_steps(radius * self.sweep**2, tolerance), least, 1)
        t = self.start + self.sweep * np.linspace(0.0, 1.0, count + 1)
        points = self.centre + np.stack([np.cos(t), np.sin(t)], axis=1) @ self.axes.T
        if abs(abs(self.sweep) - 2 * math.pi) < 1e-9:
            points[-1] = points[0]
        return np.asarray(points)


@dataclass(frozen=True, eq=False)
class Spline:
    """A rational B-spline of ``degree`` with ``knots`` (n + degree + 1,), ``control`` points (n, 2)
    and ``weights`` (n,).
    """

    degree: int
    knots: Floats
    control: Floats
    weights: Floats

    def hull(self) -> Floats:
        """(n, 2) points whose box holds the spline, as its weights are positive."""
        return self.control

    def points(self, tolerance: float) -> Floats:
        """(n, 2) points on it whose straight lines lie within ``tolerance`` of it."""
        from scipy.interpolate import BSpline

        lifted = np.column_stack([self.control * self.weights[:, None], self.weights])
        curve = BSpline(self.knots, lifted, self.degree)
        breaks = np.unique(self.knots[self.degree : len(self.control) + 1])

        def on(t: Floats) -> Floats:
            at = np.asarray(curve(t), dtype=np.float64)
            return np.asarray(at[:, :2] / at[:, 2:])

        found, whole = [on(breaks[:1])], 0
        for low, high in zip(breaks[:-1].tolist(), breaks[1:].tolist(), strict=True):
            count = 1
            while True:
                if whole + count > MOST:
                    raise _too_fine()
                t = np.linspace(low, high, 4 * count + 1)
                p = on(t)
                ends = np.stack([p[:-1:4], p[4::4]], axis=1)
                inner = np.stack([p[1::4], p[2::4], p[3::4]], axis=1)
                if _distances(inner, ends).max() <= tolerance:
                    break
                count *= 2
            whole += count
            found.append(p[4::4])
        return np.concatenate(found)


PlainCurve = Polyline | Bezier | Arc
"""A curve of SVG, which may be moved."""
Curve = PlainCurve | Spline


def default_tolerance(curves: Sequence[Curve]) -> float:
    """:data:`SHARE` of the longer side of the box around ``curves``."""
    if not curves:
        return SHARE
    hull = np.concatenate([curve.hull() for curve in curves])
    with np.errstate(invalid="ignore", over="ignore"):
        size = float(np.ptp(hull, axis=0).max())
    return SHARE * size if math.isfinite(size) and size > 0 else SHARE


def shared_tolerances(curves: Sequence[Curve], tolerance: float) -> list[float]:
    """For each of ``curves`` the ``tolerance`` with which it is cut into as many lines as the
    largest one of its shape, as far as that is up to 16 times as large.
    """
    shapes = [_shape(curve) for curve in curves]
    largest: dict[bytes, float] = {}
    for shape, size in shapes:
        largest[shape] = max(size, largest.get(shape, 0.0))
    return [
        tolerance * max(size / largest[shape], 1.0 / 16.0) if largest[shape] > 0 else tolerance
        for shape, size in shapes
    ]


def _shape(curve: Curve) -> tuple[bytes, float]:
    """The shape of a ``curve``, in steps of a twentieth of its size, and its size; 0 for a curve
    that is compared with no other.
    """
    if isinstance(curve, Bezier):
        numbers = (curve.control[1:] - curve.control[0]).ravel()
    elif isinstance(curve, Arc):
        numbers = curve.axes.ravel()
    else:
        return b"", 0.0
    size = float(np.abs(numbers).max())
    if size == 0:
        return b"", 0.0
    turns = [curve.start, curve.sweep] if isinstance(curve, Arc) else []
    return np.rint(20 * np.append(numbers / size, turns)).astype(np.int64).tobytes(), size


def bulged(start: Floats, end: Floats, bulge: float) -> PlainCurve:
    """The arc from ``start`` to ``end`` whose ``bulge`` is the tangent of a quarter of its angle,
    positive where it turns left (DXF reference, LWPOLYLINE, group 42); a straight line where it
    rises by less than a millionth of its chord.
    """
    chord = end - start
    length = float(np.linalg.norm(chord))
    if abs(bulge) < 2 * _STRAIGHT or length == 0:
        return Polyline(np.stack([start, end]))
    sweep = 4 * math.atan(bulge)
    radius = length / (2 * math.sin(sweep / 2))
    left = np.array([-chord[1], chord[0]]) / length
    centre = (start + end) / 2 + left * radius * math.cos(sweep / 2)
    first = start - centre
    size = float(np.linalg.norm(first))
    angle = math.atan2(first[1], first[0])
    return Arc(centre, size * np.eye(2), angle, sweep)


def svg_arc(
    start: Floats, end: Floats, radii: Floats, turn: float, large: bool, sweep: bool
) -> PlainCurve:
    """The elliptical arc of an SVG path; ``turn`` of its axes in radians (SVG 1.1, appendix F.6).

    Radii that do not reach from ``start`` to ``end`` are enlarged; without a radius it is straight.
    """
    rx, ry = np.abs(radii).tolist()
    if rx == 0 or ry == 0 or (start == end).all():
        return Polyline(np.stack([start, end]))
    c, s = math.cos(turn), math.sin(turn)
    turned = np.array([[c, -s], [s, c]])
    x, y = (turned.T @ (start - end) / 2).tolist()
    over = (x / rx) ** 2 + (y / ry) ** 2
    if over > 1:
        rx, ry = rx * math.sqrt(over), ry * math.sqrt(over)
    share = max(0.0, (rx * ry) ** 2 / ((rx * y) ** 2 + (ry * x) ** 2) - 1)
    sign = 1.0 if large != sweep else -1.0
    middle = sign * math.sqrt(share) * np.array([rx * y / ry, -ry * x / rx])
    centre = turned @ middle + (start + end) / 2
    first = math.atan2((y - middle[1]) / ry, (x - middle[0]) / rx)
    last = math.atan2((-y - middle[1]) / ry, (-x - middle[0]) / rx)
    angle = (last - first) % (2 * math.pi)
    if not sweep:
        angle -= 2 * math.pi
    return Arc(centre, turned * np.array([rx, ry]), first, angle)


def _moved(points: Floats, matrix: Floats) -> Floats:
    with np.errstate(invalid="ignore", over="ignore"):
        return np.asarray(points @ matrix[:, :2].T + matrix[:, 2])


def _steps(second: float, tolerance: float) -> int:
    """Equal steps over a unit range on which the second derivative is at most ``second``."""
    steps = math.sqrt(second / (8 * tolerance))
    if not steps <= MOST:
        raise _too_fine()
    return max(1, math.ceil(steps - 1e-9))


def _too_fine() -> PatternError:
    return PatternError(
        f"A curved line would become more than {MOST} straight lines; give a larger "
        "`curve_tolerance`."
    )


def _distances(points: Floats, ends: Floats) -> Floats:
    """(n, m) how far ``points`` (n, m, 2) are from the lines between ``ends`` (n, 2, 2)."""
    along = ends[:, 1] - ends[:, 0]
    square = np.maximum((along**2).sum(axis=1), _LEAST_FLAT**2)
    offset = points - ends[:, :1]
    place = np.clip(np.einsum("nmk,nk->nm", offset, along) / square[:, None], 0.0, 1.0)
    return np.asarray(np.linalg.norm(offset - place[..., None] * along[:, None], axis=2))
