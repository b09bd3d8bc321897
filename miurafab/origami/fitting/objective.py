"""The fair objective: what makes one exact sheet better than another.

L is the mean edge length, m_f the mean of the corners of facet f, S(c_f) the target at the centre
of its cell, q_f the point of the target nearest to m_f, n_f the normal there. The objective is the
sum of the squares of these residuals, each times its weight:

distance    n_f . (m_f - q_f) / L                        to the tangent plane, each facet
place       (m_f - S(c_f)) / L                           each facet, three components
rim         b . (p - m_f) / L                            facets at the border: no retreat
sectors     how far a corner lies outside 45..135 deg    each corner, radians
folds       how far cos(fold) lies outside 60..150 deg   each crease
edges       max(0, 0.3 - l / L)                          each edge
convexity   max(0, 4k - h) / 4                           each facet and diagonal
fairness    (X_a - 2 X_b + X_c) - (S_a - 2 S_b + S_c)    over L, at stride 2 along i and along j

with b the outward direction in the target across its border and p the place of the border, and

    h = (u x v) . (v x w) / (A/2)^2,   u = p1 - p0, v = p2 - p0, w = p3 - p0,

which is positive where the quad p0 p1 p2 p3 is convex and negative for a bow-tie, whose unsigned
angles look right. All terms are needed: without folds the sheet becomes a smooth developable or a
pile, without the rim it shrinks from the border. The weights were found on the sixteen named
surfaces, on gores of spheres and on scans.

The limits that a user gives replace or join the hinges: shortest edge, sectors, aspect, Kawasaki.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy import sparse

from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.polygons import edge_lengths
from miurafab.geometry.quads import QuadCharts
from miurafab.origami.fitting.blocks import (
    Block,
    corner_angles,
    kawasaki,
    lengths,
    side_ratios,
    stacked,
)
from miurafab.origami.fitting.nominal import (
    Follow,
    Nominal,
    Rim,
    chains_of,
    feet_of,
    rim_of_domain,
)
from miurafab.surfaces.surface import TargetSurface

INACTIVE = 1e-30
"""The weight of an inactive hinge: nothing, but not zero, so that the products of the Jacobian keep
their pattern of entries and the order of elimination is found once."""

KAWASAKI = 10.0
"""The weight of Kawasaki's residual over that of a sector."""

LEAST_AREA = 0.15
"""A of a facet in the convexity term is at least this part of the median."""


@dataclass(frozen=True)
class Weights:
    """The weight of each term, and the limits of the hinges (angles in radians)."""

    distance: float = 3.0
    place: float = 0.05
    rim: float = 3.0
    sectors: float = 4.0
    folds: float = 2.0
    edges: float = 8.0
    convexity: float = 10.0
    fairness: float = 0.3
    least_sector: float = np.pi / 4
    greatest_sector: float = 3 * np.pi / 4
    least_fold: float = np.pi / 3
    greatest_fold: float = 5 * np.pi / 6
    shortest_edge: float = 0.3
    convex: float = 0.2


@dataclass(frozen=True, eq=False)
class FairObjective:
    """The residuals of one sheet over ``charts``, and their gradients.

    ``followers`` (K, k) are the vertices whose means follow the target, ``places`` (K, 3) where
    they belong, ``feet`` (K, 2) the parameters of the nearest points to start from. ``area`` (F,)
    is A of each facet. ``aspect`` is the greatest ratio of two sides, ``kawasaki`` the greatest
    |a0 + a2 - pi| in radians; None is no limit.
    """

    surface: TargetSurface
    charts: QuadCharts
    length: float
    nominal: Nominal
    followers: Ints
    places: Floats
    feet: Floats
    rim: Rim
    area: Floats
    weights: Weights = field(default_factory=Weights)
    aspect: float | None = None
    kawasaki: float | None = None

    @classmethod
    def of(
        cls,
        surface: TargetSurface,
        charts: QuadCharts,
        cells: tuple[int, int],
        start: Floats,
        *,
        follow: Follow = "middle",
        rim: Rim | None = None,
        weights: Weights | None = None,
        aspect: float | None = None,
        kawasaki: float | None = None,
    ) -> FairObjective:
        """The objective of the sheet ``start`` (V, 3) over ``charts``, which are cells of a lattice
        of ``cells`` columns and rows. ``rim`` is that of the domain where it is not given.
        """
        nominal = Nominal.of(surface, charts, *cells)
        corners = start[charts.faces_vertices]
        area = np.linalg.norm(
            np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]), axis=1
        )
        if follow == "middle":
            followers, places, feet = charts.faces_vertices, nominal.centres, nominal.parameters
        else:
            level = 1 if follow == "top" else 0
            followers = np.flatnonzero(charts.lattice[:, 1] % 2 == level)[:, None]
            d = surface.domain
            step = np.array([d.width / cells[0], d.height / cells[1]])
            feet = np.array([d.u0, d.v0]) + charts.lattice[followers[:, 0]] * step
            feet = feet_of(surface, start[followers[:, 0]], feet, steps=10)
            places = surface.point(feet)
        return cls(
            surface,
            charts,
            float(edge_lengths(start, charts.edges_vertices).mean()),
            nominal,
            followers,
            places,
            feet,
            rim_of_domain(surface, charts, nominal, cells) if rim is None else rim,
            np.maximum(area, LEAST_AREA * np.median(area)),
            weights or Weights(),
            aspect,
            kawasaki,
        )

    def __call__(self, points: Floats, feet: Floats) -> tuple[Floats, sparse.csr_array, Floats]:
        """The residuals (n,), their Jacobian (n, 3V) and the new feet, at ``points`` (V, 3)."""
        middle = points[self.followers].mean(axis=1)
        feet = feet_of(self.surface, middle, feet)
        blocks = [*self._near(points, middle, feet), *self._hinges(points), *self._fair(points)]
        return (*stacked(blocks, points.size), feet)

    def _near(self, points: Floats, middle: Floats, feet: Floats) -> Iterator[Block]:
        w, scale = self.weights, 1 / self.length
        share = 1 / self.followers.shape[1]
        normal = self.surface.normal(feet)
        off = _dot(normal, middle - self.surface.point(feet))
        rows = np.broadcast_to(normal[:, None] * share, (*self.followers.shape, 3))
        yield w.distance * scale * off, self.followers, w.distance * scale * rows
        gap = middle - self.places
        for axis in np.eye(3):
            rows = np.broadcast_to(axis * share, (*self.followers.shape, 3))
            yield w.place * scale * (gap @ axis), self.followers, w.place * scale * rows
        corners = self.charts.faces_vertices[self.rim.facets]
        short = _dot(self.rim.outward, self.rim.places - points[corners].mean(axis=1))
        active = np.where(short > 0, w.rim, w.rim * self.rim.overhang) * scale
        rows = np.broadcast_to(self.rim.outward[:, None] / 4, (*corners.shape, 3))
        yield active * short, corners, -active[:, None, None] * rows

    def _hinges(self, points: Floats) -> Iterator[Block]:
        faces, w = self.charts.faces_vertices, self.weights
        yield self._sectors(points, faces)
        yield self._folds(points)
        length, edges, rows = lengths(points, self.charts.edges_vertices)
        short = w.shortest_edge - length / self.length
        yield _hinge(w.edges, short, edges, -rows / self.length)
        for turn in (0, 1):
            yield self._convexity(points, np.roll(faces, -turn, axis=1))
        if self.aspect is not None:
            ratio, sides, rows = side_ratios(points, faces, self.aspect)
            yield _hinge(w.edges, -ratio / self.length, sides, -rows / self.length)
        if self.kawasaki is not None:
            residual, spokes, rows = kawasaki(points, self.charts)
            for sign in (1.0, -1.0):
                over = sign * residual - self.kawasaki
                yield _hinge(KAWASAKI * w.sectors, over, spokes, sign * rows)

    def _sectors(self, points: Floats, faces: Ints) -> Block:
        alpha, corners, rows = corner_angles(points, faces)
        w = self.weights
        low, high = w.least_sector - alpha, alpha - w.greatest_sector
        sign = np.where(high > 0, w.sectors, np.where(low > 0, -w.sectors, INACTIVE))
        return sign * np.where(high > 0, high, -low), corners, sign[:, None, None] * rows

    def _folds(self, points: Floats) -> Block:
        """With N the area vector of a facet and w = n_g - c n_f the change of c = n_f . n_g with
        N is w / |N|; N = (p2 - p0) x (p3 - p1).
        """
        pairs = self.charts.neighbouring_facets
        faces = self.charts.faces_vertices
        p = points[faces]
        a, b = p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]
        vector = np.cross(a, b)
        size = np.linalg.norm(vector, axis=1)
        normal = vector / size[:, None]
        f, g = pairs[:, 0], pairs[:, 1]
        c = _dot(normal[f], normal[g])
        parts = []
        for one, other in ((f, g), (g, f)):
            w = (normal[other] - c[:, None] * normal[one]) / size[one][:, None]
            by_a, by_b = np.cross(b[one], w), np.cross(w, a[one])
            parts.append(np.stack([-by_a, -by_b, by_a, by_b], axis=1))
        weights = self.weights
        flat, tight = c - np.cos(weights.least_fold), np.cos(weights.greatest_fold) - c
        sign = np.where(flat > 0, weights.folds, np.where(tight > 0, -weights.folds, INACTIVE))
        value = sign * np.where(flat > 0, flat, -tight)
        vertices = np.concatenate([faces[f], faces[g]], axis=1)
        return value, vertices, sign[:, None, None] * np.concatenate(parts, axis=1)

    def _convexity(self, points: Floats, faces: Ints) -> Block:
        p = points[faces]
        u, v, w = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0], p[:, 3] - p[:, 0]
        a, b = np.cross(u, v), np.cross(v, w)
        scale = (self.area / 2) ** 2
        h = _dot(a, b) / scale
        by_u, by_w = np.cross(v, b), np.cross(a, v)
        by_v = np.cross(b, u) + np.cross(w, a)
        rows = np.stack([-(by_u + by_v + by_w), by_u, by_v, by_w], axis=1) / scale[:, None, None]
        return _hinge(self.weights.convexity / 4, 4 * self.weights.convex - h, faces, -rows)

    def _fair(self, points: Floats) -> Iterator[Block]:
        chains, bend = self.chains
        w = self.weights.fairness / self.length
        second = points[chains[:, 0]] - 2 * points[chains[:, 1]] + points[chains[:, 2]] - bend
        for axis in np.eye(3):
            rows = np.broadcast_to(np.array([1.0, -2.0, 1.0])[:, None] * axis, (len(chains), 3, 3))
            yield w * (second @ axis), chains, w * rows

    @cached_property
    def chains(self) -> tuple[Ints, Floats]:
        """Three vertices at stride 2 in one chart (n, 3), and the second difference (n, 3) of their
        places on the target.
        """
        return chains_of(self.charts, self.nominal.corners)


def _hinge(weight: float, over: Floats, vertices: Ints, gradient: Floats) -> Block:
    """max(0, ``over``) times ``weight``; ``gradient`` is that of ``over``."""
    active = np.where(over > 0, weight, INACTIVE)
    return active * over, vertices, active[:, None, None] * gradient


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("nk,nk->n", a, b))
