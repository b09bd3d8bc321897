"""Fit of point sets to a rectangle at any angle: support values and rotated boxes.

A set of points, turned by -θ, fits a rectangle of width w and height h if its extents along
u(θ) = (cos θ, sin θ) and v(θ) = (-sin θ, cos θ) are at most w and h. There are two tests:

- *Support values*: the largest p·u over the points, for a fixed fan of directions u. The support
  values of a union are the maxima of the support values of its parts, so a search computes the
  boxes of unions as maxima of arrays. The fan samples the angle, so this test can miss a fit; it
  never accepts a set that does not fit.
- :func:`best_turn`: exact, for one convex hull. Between two angles at which a side of the hull is
  parallel to the box, the supporting corners are fixed, and the extents d·u(θ) and g·v(θ) are
  concave. So the larger excess over the rectangle is least at an end of the interval or where both
  excesses are equal, (d_x - g_y) cos θ + (d_y + g_x) sin θ = w - h. The area is least at an end of
  the range in which the box fits, so also where an extent equals the side of the rectangle. All
  these angles are tried.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from miurafab.geometry.arrays import Bools, Floats

TOLERANCE = 1e-9
"""The excess in mm that is accepted as rounding."""

_ROUNDING = 0.005
"""Room in mm for the rounding of support values in single precision."""


_ANGLES = 48
"""The number of angles tried in a right angle: steps of 1.9 degrees."""


@dataclass(frozen=True)
class Space:
    """The rectangle ``width`` x ``height`` mm that shapes must fit, at any angle or by the quarter
    ``turns`` only (0: not turned, 1: turned by a right angle).
    """

    width: float
    height: float
    turns: tuple[int, ...] | None = None

    @property
    def directions(self) -> Floats:
        """(D, 2) directions of the support values for :meth:`holds`."""
        return fan(_ANGLES if self.turns is None else 1)

    def smaller(self, by: float) -> Space:
        """The space with ``by`` mm less width and height."""
        return Space(self.width - by, self.height - by, self.turns)

    def holds(self, values: NDArray[np.float32]) -> Bools:
        """(...,) whether shapes with support ``values`` (..., D) fit."""
        if self.turns is None:
            return fits(values, self.width, self.height)
        size = np.array([self.width, self.height]) - _ROUNDING
        extents = values[..., :2] + values[..., 2:]
        ways = [(extents <= (size if turn == 0 else size[::-1])).all(-1) for turn in self.turns]
        return np.asarray(np.logical_or.reduce(ways))

    def turn(self, points: Floats) -> float | None:
        """The angle θ in radians such that ``points`` (n, 2) turned by -θ fit: the angle of the
        smallest box, or 0 if the turns are given; None if they do not fit.
        """
        if self.turns is None:
            return best_turn(points, self.width, self.height)
        size = np.array([self.width, self.height]) + TOLERANCE
        extents = np.ptp(points, axis=0)
        ways = [(extents <= (size if turn == 0 else size[::-1])).all() for turn in self.turns]
        return 0.0 if any(ways) else None


def fan(turns: int) -> Floats:
    """(4 * turns, 2) unit directions: ``turns`` directions in the first quadrant, then the same
    turned by 90, 180 and 270 degrees.
    """
    angle = np.arange(turns) * (np.pi / 2 / turns)
    first = np.column_stack([np.cos(angle), np.sin(angle)])
    second = np.column_stack([-first[:, 1], first[:, 0]])
    return np.concatenate([first, second, -first, -second])


def support(polygons: Floats, present: Bools, directions: Floats) -> NDArray[np.float32]:
    """(N, D) support values in mm of N polygons of up to k corners.

    ``polygons`` (N, k, 2); ``present`` (N, k) whether a corner is real, real corners first;
    ``directions`` (D, 2) of :func:`fan`, the second half opposite to the first. A polygon without
    corners has support -inf, which is neutral in a union. Single precision keeps the search in the
    cache; :func:`fits` leaves room for its rounding.
    """
    values = np.full((len(directions), len(polygons)), -np.inf, dtype=np.float32)
    filled = np.where(present[..., None], polygons, polygons[:, :1])
    x, y = (np.ascontiguousarray(filled[..., axis].T) for axis in (0, 1))
    real = present.any(axis=1)
    half = len(directions) // 2
    for column, (u, v) in enumerate(directions[:half]):
        along = x * u + y * v
        values[column, real] = along.max(axis=0)[real]
        values[column + half, real] = -along.min(axis=0)[real]
    return np.ascontiguousarray(values.T)


def fits(values: NDArray[np.float32], width: float, height: float) -> Bools:
    """(...,) whether shapes with support ``values`` (..., 4 * turns) fit ``width`` x ``height`` mm,
    along or across, with room for the rounding of single precision.
    """
    quarter = values.shape[-1] // 4
    along = values[..., :quarter] + values[..., 2 * quarter : 3 * quarter]
    across = values[..., quarter : 2 * quarter] + values[..., 3 * quarter :]
    long, short = max(width, height) - _ROUNDING, min(width, height) - _ROUNDING
    return np.asarray(
        ((np.maximum(along, across) <= long) & (np.minimum(along, across) <= short)).any(axis=-1)
    )


def best_turn(points: Floats, width: float, height: float) -> float | None:
    """The angle θ in radians, -π/2 < θ <= π/2, whose turn by -θ fits ``points`` (n, 2) into the
    rectangle with the smallest box, or None if no angle fits. Exact up to :data:`TOLERANCE`.
    """
    angles, sizes = boxes_at(points, width, height)
    fit = (sizes[:, 0] <= width + TOLERANCE) & (sizes[:, 1] <= height + TOLERANCE)
    if not fit.any():
        return None
    angles, area = angles[fit], sizes[fit].prod(axis=1)
    # Of boxes equal up to rounding the least turned one is taken, so that rounding decides nothing.
    equal = area <= area.min() * (1 + 1e-9) + TOLERANCE
    angles = np.where(angles > np.pi / 2, angles - np.pi, angles)[equal]
    return float(angles[np.lexsort((angles, np.round(np.abs(angles), 9)))[0]])


def scale_to_fit(points: Floats, space: Space) -> float:
    """The largest s for which ``points`` (n, 2), s times as large, fit ``space``. Exact:

        s = max over θ of min(W / w(θ), H / h(θ)).

    Between two angles of :func:`_intervals` the extents w and h are concave, so the best θ is an
    end of such an interval, or the angle at which w / W = h / H:
    (d_x H - g_y W) cos θ + (d_y H + g_x W) sin θ = 0.
    """
    width, height = space.width, space.height
    if space.turns is None:
        hull, ends, d, g = _intervals(points)
        a, b = d[:, 0] * height - g[:, 1] * width, d[:, 1] * height + g[:, 0] * width
        sizes = _extents(hull, np.concatenate([ends, _solved(a, b, 0.0)]))
    else:
        upright = np.ptp(points, axis=0)
        sizes = np.array([upright if turn == 0 else upright[::-1] for turn in space.turns])
    return float((np.array([width, height]) / np.maximum(sizes, 1e-12)).min(axis=1).max())


def boxes_at(
    points: NDArray[Any], width: float, height: float
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Candidate angles (A,) in [0, π) and the extents (A, 2) along u and v at each."""
    hull, ends, d, g = _intervals(points)
    equal = _solved(d[:, 0] - g[:, 1], d[:, 1] + g[:, 0], width - height)
    full = [_solved(d[:, 0], d[:, 1], width), _solved(g[:, 1], -g[:, 0], height)]
    angles = np.unique(np.concatenate([ends, equal, *full]))
    return angles, _extents(hull, angles)


def _intervals(
    points: NDArray[Any],
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]:
    """The convex hull of ``points``; the angles (A,) in [0, π) at which a side of it is parallel to
    the box; and between each and the next the spans d and g (A, 2) that do not change there.
    """
    hull = shapely.get_coordinates(shapely.convex_hull(shapely.multipoints(points)))
    sides = np.diff(hull, axis=0) if len(hull) > 1 else np.array([[1.0, 0.0]])
    flush = np.arctan2(sides[:, 1], sides[:, 0])
    ends = np.unique(np.concatenate([flush, flush + np.pi / 2, [0.0]]) % np.pi)
    middle = (ends + np.append(ends[1:], np.pi)) / 2
    return hull, ends, _spans(hull, middle), _spans(hull, middle + np.pi / 2)


def _extents(hull: NDArray[Any], angles: NDArray[Any]) -> NDArray[Any]:
    """(A, 2) the extents of ``hull`` along u and v at each of ``angles``."""
    u = np.column_stack([np.cos(angles), np.sin(angles)])
    v = np.column_stack([-u[:, 1], u[:, 0]])
    return np.column_stack([np.ptp(hull @ u.T, axis=0), np.ptp(hull @ v.T, axis=0)])


def _solved(a: NDArray[Any], b: NDArray[Any], level: float) -> NDArray[Any]:
    """The angles in [0, π) with a cos θ + b sin θ = level, for all a and b (n,) that have any."""
    size = np.hypot(a, b)
    part = np.divide(level, size, out=np.full_like(size, 2.0), where=size > 0)
    real = np.abs(part) <= 1
    peak, swing = np.arctan2(b, a)[real], np.arccos(part[real])
    return np.concatenate([peak + swing, peak - swing]) % np.pi


def _spans(hull: NDArray[Any], angles: NDArray[Any]) -> NDArray[Any]:
    """(A, 2) from the least to the greatest hull corner along each angle."""
    along = hull @ np.stack([np.cos(angles), np.sin(angles)])
    return np.asarray(hull[along.argmax(axis=0)] - hull[along.argmin(axis=0)])
