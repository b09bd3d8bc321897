"""Tubes as targets: a mesh with two borders as a smooth map that closes on itself in u.

The harmonic coordinates of the mesh (:mod:`~miurafab.surfaces.harmonic`) are turned into lengths.
The mean length s along the meridians obeys

    ds/dv = mean over one turn of 1 / |grad v|,

which is also proportional to the girth at that level, since the map keeps angles. Along the new v,
s grows like the root of the girth, so that rows are closer where the tube is narrow; its range is
the mean length of the meridians. u is stretched to the mean girth, the area over that length. A
spline that is periodic in u goes through the vertices at these places. Rows of a sheet run round
the tube along u, columns run along v, and u, v and the outward normal are right-handed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from miurafab.findings import Finding
from miurafab.geometry.arrays import Floats, Ints, vector_product
from miurafab.geometry.distances import MeshTrees
from miurafab.surfaces.harmonic import CylinderMap, cylinder_map
from miurafab.surfaces.smoothing import smooth
from miurafab.surfaces.spline import continued
from miurafab.surfaces.surface import Domain, ParametricSurface, normal_to, tangents
from miurafab.surfaces.tube_figures import TubeFigures, figures

if TYPE_CHECKING:
    from scipy.interpolate import NdBSpline, PchipInterpolator

NARROWING = 0.5
"""The row spacing grows like the girth to this power. Gores of a pin, 8 x (4 x 36), lie 0.46 % of
the diagonal from it with 0, at the last row before the pole, 0.21 % with 0.5 and 0.13 % with 1,
where the areas of facets differ 24-fold."""

_LEVELS = 80
_SPANS = 40


@dataclass(frozen=True, eq=False)
class TubeChart:
    """A tube laid flat: ``flat`` (V, 2) holds the place of each vertex in lengths, u from 0 to
    ``girth`` and v from 0 to ``length``; ``turned_over`` counts the triangles that the map turns
    over.
    """

    vertices: Floats
    faces: Ints
    flat: Floats
    girth: float
    length: float
    turned_over: int

    def upside_down(self) -> TubeChart:
        """The same tube with both directions turned round."""
        flat = np.stack([-self.flat[:, 0] % self.girth, self.length - self.flat[:, 1]], axis=1)
        return replace(self, flat=flat)

    def surface(
        self, whole: Floats, stiffness: float = 0.0, pieces: int | None = None
    ) -> TubeSurface:
        """The target for ``pieces`` gores, or the fewest that serve; the spline is as stiff as the
        data ask, or ``stiffness``. Distances are measured to ``whole`` (T, 3, 3), the triangles
        that the user gave.
        """
        domain = Domain(0.0, self.girth, 0.0, self.length)
        sides = self.vertices[self.faces] - self.vertices[np.roll(self.faces, 1, axis=1)]
        step = 1.5 * float(np.median(np.linalg.norm(sides, axis=2)))
        spans = (_spans(self.girth, step), _spans(self.length, step))
        smoothed = smooth(self.flat, self.vertices, domain, spans, stiffness, closed=True)
        plain = ParametricSurface(
            lambda u, v: _round(smoothed.spline, self.girth, np.stack([u, v], axis=-1)), domain
        )
        size = float(np.linalg.norm(np.ptp(whole.reshape(-1, 3), axis=0)))
        told = figures(plain, smoothed.roughness / size, self.turned_over, pieces)
        start = told.start * self.girth / told.gores
        domain = Domain(start, start + self.girth, 0.0, self.length)
        return TubeSurface(smoothed.spline, domain, whole, told, self)


@dataclass(frozen=True, eq=False)
class TubeSurface:
    """A target that closes on itself: u has the period of the domain's width. ``triangles`` are all
    that the user gave. ``figures`` say how many gores serve; their first seam is at the start of
    the domain. ``description`` is what makes the target again from the same mesh.
    """

    spline: NdBSpline
    domain: Domain
    triangles: Floats
    figures: TubeFigures
    layout: TubeChart = field(repr=False)
    findings: tuple[Finding, ...] = ()
    description: Mapping[str, Any] = field(default_factory=dict)

    @property
    def gores(self) -> int:
        """The number of gores that serves."""
        return self.figures.gores

    def point(self, uv: Floats) -> Floats:
        """The spline; beyond both borders its straight continuation."""
        return _round(self.spline, self.domain.width, uv)

    def normal(self, uv: Floats) -> Floats:
        return normal_to(*tangents(self, uv))

    def closest_point(self, points: Floats) -> Floats:
        return self.nearest(points)

    def nearest(self, points: Floats) -> Floats:
        return self._trees.closest(points)[0]

    @cached_property
    def _trees(self) -> MeshTrees:
        return MeshTrees.of(self.triangles)

    def tiles(self) -> Floats:
        return self.triangles

    def __repr__(self) -> str:
        return f"<TubeSurface {self.domain.width:.4g} x {self.domain.height:.4g} mm>"


def _round(spline: NdBSpline, girth: float, uv: Floats) -> Floats:
    return continued(spline, np.stack([uv[..., 0] % girth, uv[..., 1]], axis=-1))


def tube_chart(vertices: Floats, faces: Ints, low: Ints, high: Ints) -> TubeChart:
    """The chart of the oriented annulus mesh whose border loops are ``low`` and ``high``; v is 0 at
    ``low``.
    """
    mapped = cylinder_map(vertices, faces, low, high)
    places, length = _places(vertices, faces, mapped)
    corners = vertices[faces]
    cross = vector_product(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled = np.linalg.norm(cross, axis=1)
    girth = float(doubled.sum()) / 2 / length
    turns = _from_fullest(mapped, faces, doubled)
    along = np.clip(places(mapped.height), 0.0, length)
    flat = np.stack([girth * np.where(turns < 1, turns, 0.0), along], axis=1)
    return TubeChart(vertices, faces, flat, girth, length, mapped.turned_over(faces))


def _from_fullest(mapped: CylinderMap, faces: Ints, doubled: Floats) -> Floats:
    """(V,) the angle counted from where the tube has most area round about, so that it does not
    depend on the order of the vertices."""
    middle = mapped.corners(faces).mean(axis=1)
    moment = complex(doubled @ np.exp(2j * np.pi * middle))
    return np.asarray((mapped.turns - np.angle(moment) / (2 * np.pi)) % 1.0)


def _places(vertices: Floats, faces: Ints, mapped: CylinderMap) -> tuple[PchipInterpolator, float]:
    """The new v as a function of the old, and the mean length of the meridians.

    The mean of 1 / |grad v| over one turn is summed at levels of v that part the area evenly. In a
    triangle the level is a line, and its share of the turn is the part of u along it.
    """
    from scipy.interpolate import PchipInterpolator

    corners = vertices[faces]
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    cross = vector_product(e1, e2)
    doubled = np.linalg.norm(cross, axis=1)
    v = mapped.height[faces]
    v1, v2 = (v[:, 1] - v[:, 0])[:, None], (v[:, 2] - v[:, 0])[:, None]
    # |grad v| = |v1 e2 - v2 e1| / doubled area
    steep = np.linalg.norm(v1 * e2 - v2 * e1, axis=1) / doubled
    order = np.argsort(v.mean(axis=1))
    part = np.cumsum(doubled[order]) / doubled.sum()
    at = np.interp((np.arange(_LEVELS) + 0.5) / _LEVELS, part, v.mean(axis=1)[order])
    u = mapped.corners(faces)
    rates = np.array([_mean_over_turn(u, v, 1 / np.maximum(steep, 1e-300), level)
                      for level in at.tolist()])  # fmt: skip
    ends = np.concatenate([[0.0], at, [1.0]])
    logs = np.log(np.concatenate([rates[:1], rates, rates[-1:]]))
    fine = np.interp(np.arange(8 * len(ends) - 7) / 8, np.arange(len(ends)), ends)
    rate = np.exp(PchipInterpolator(ends, logs)(fine))
    length = float(np.diff(fine) @ (rate[1:] + rate[:-1])) / 2
    rate = rate ** (1 - NARROWING)
    sums = np.concatenate([[0.0], np.cumsum(np.diff(fine) * (rate[1:] + rate[:-1]) / 2)])
    return PchipInterpolator(fine, length / sums[-1] * sums), length


def _mean_over_turn(u: Floats, v: Floats, values: Floats, level: float) -> float:
    """The mean of ``values`` (F,) along the line v = ``level``, weighted by the change of u."""
    crossed = (v.min(axis=1) < level) & (v.max(axis=1) > level)
    u, v, values = u[crossed], v[crossed], values[crossed]
    order = np.argsort(v, axis=1)
    u, v = np.take_along_axis(u, order, axis=1), np.take_along_axis(v, order, axis=1)
    long = u[:, 0] + (u[:, 2] - u[:, 0]) * (level - v[:, 0]) / (v[:, 2] - v[:, 0])
    below = level < v[:, 1]
    start, end = np.where(below, 0, 1), np.where(below, 1, 2)
    row = np.arange(len(u))
    rise = v[row, end] - v[row, start]
    t = (level - v[row, start]) / np.where(rise > 0, rise, 1.0)
    short = u[row, start] + (u[row, end] - u[row, start]) * t
    share = np.abs(long - short)
    return float(share @ values / share.sum())


def _spans(width: float, step: float) -> int:
    return max(math.ceil(width / max(step, width / _SPANS)), 4)
