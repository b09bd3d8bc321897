"""The fair objective: what makes one exact sheet better than another.

L is the mean edge length, m_f the mean of the corners of facet f, S(c_f) the target at the centre
of its cell, q_f the point of the target nearest to m_f, n_f the normal there. The objective is the
sum of the squares of these residuals, each times its weight:

distance    n_f . (m_f - q_f) / L                        to the tangent plane, each facet
place       (m_f - S(c_f)) / L                           each facet, three components
rim         b . (p - m_f) / L                            facets at the border: no retreat
sectors     how far a corner lies outside 45..135 deg    each corner, radians
folds       how far a fold lies outside 60..140 deg      each crease, radians; to 150 all round
closed      how far a fold lies over 172 deg             each crease, radians
edges       max(0, 0.2 - l / L)                          each edge
convexity   max(0, 4k - h) / 4                           each facet and diagonal
reach       max(0, d - limit) / L                        each vertex, where the distance has a limit
fairness    (X_a - 2 X_b + X_c) - (S_a - 2 S_b + S_c)    over L, at stride 2 along i and along j

with b the outward direction in the target across its border and p the place of the border, and

    h = (u x v) . (v x w) / (A/2)^2,   u = p1 - p0, v = p2 - p0, w = p3 - p0,

which is positive where the quad p0 p1 p2 p3 is convex and negative for a bow-tie, whose unsigned
angles look right. All terms are needed: without folds the sheet becomes a smooth developable or a
pile, without the rim it shrinks from the border. The weights were found on the sixteen named
surfaces, on gores of spheres and on scans.

A fold is measured in the sense that it has in a Miura tessellation, so that it may be over 180
degrees: then its facets have passed through each other. Near a pole the paper is wide and the folds
must close; a heavy weight on ``folds`` lifts the sheet off the target there, and without ``closed``
its facets pass through each other. On a globe to 85 degrees in 6, 8 and 12 gores of 24 rows the
distance is 0.52, 0.51 and 0.37 % of the diagonal with 3.0 on cosines without a sense, and the 6
gores cross themselves; it is 0.12, 0.13 and 0.08 % with 0.5 on signed folds, the weight of several
pieces. One piece takes less paper with a heavier weight: two rows that fold by 150 degrees lie 75
degrees steep, four layers of paper over one of target. The sheets of candlestick, catenoid,
ellipsoid and hyperboloid have 4.1 to 5.3 times the area of the target with folds of 150 degrees and
a weight of 6 on sectors, and 3.1 to 3.6 with 140 degrees and 8. With a weight of 2 on folds of 150
degrees they have a quarter less too, but corners of the candlestick reach 40 degrees.

The limits that a user gives replace or join the hinges: shortest edge, sectors, aspect, Kawasaki,
and the distance of vertices from the target (:mod:`~miurafab.origami.fitting.reach`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy import sparse

from miurafab.geometry.arrays import Floats, Ints, vector_product
from miurafab.geometry.polygons import edge_lengths
from miurafab.geometry.quads import QuadCharts
from miurafab.origami.fitting.blocks import (
    Block,
    corner_angles,
    folds,
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
from miurafab.origami.fitting.reach import Reach
from miurafab.surfaces.surface import TargetSurface

INACTIVE = 1e-30
"""The weight of a fold within its limits: nothing, but not zero. Every two vertices of a facet or
of two neighbouring facets stand in the row of a fold, so that the products of the Jacobian keep
their pattern of entries, and the order of elimination is found once. Other inactive hinges have no
row.
"""

KAWASAKI = 10.0
"""The weight of Kawasaki's residual over that of a sector."""

LEAST_AREA = 0.15
"""A of a facet in the convexity term is at least this part of the median."""


@dataclass(frozen=True)
class Weights:
    """The weight of each term, and the limits of the hinges (angles in radians)."""

    distance: float = 6.0
    place: float = 0.05
    rim: float = 4.0
    sectors: float = 8.0
    folds: float = 1.0
    closed: float = 4.0
    edges: float = 8.0
    convexity: float = 10.0
    reach: float = 30.0
    fairness: float = 0.3
    least_sector: float = math.radians(45)
    greatest_sector: float = math.radians(135)
    least_fold: float = math.radians(60)
    greatest_fold: float = math.radians(140)
    closed_fold: float = math.radians(172)
    shortest_edge: float = 0.2
    convex: float = 0.2

    @classmethod
    def of(cls, pieces: int, all_round: bool) -> Weights:
        """Those of so many pieces: several may crowd at poles, where their folds must close, and so
        may the rows of a ring that goes all round an axis.
        """
        if pieces == 1 and not all_round:
            return cls()
        folds = 0.5 if pieces > 1 else 1.0
        return cls(sectors=6.0, folds=folds, greatest_fold=math.radians(150))


@dataclass(frozen=True, eq=False)
class FairObjective:
    """The residuals of one sheet over ``charts``, and their gradients.

    ``followers`` (K, k) are the vertices whose means follow the target, ``places`` (K, 3) where
    they belong, ``feet`` (K, 2) the parameters of the nearest points to start from. ``area`` (F,)
    is A of each facet, ``sense`` (P,) the sign that each fold is to have. ``aspect`` is the
    greatest ratio of two sides, ``kawasaki`` the greatest |a0 + a2 - pi| in radians, ``reach`` the
    greatest distance; None is no limit.
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
    sense: Floats
    weights: Weights = field(default_factory=Weights)
    aspect: float | None = None
    kawasaki: float | None = None
    reach: Reach | None = None

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
        reach: float | None = None,
    ) -> FairObjective:
        """The objective of the sheet ``start`` (V, 3) over ``charts``, which are cells of a lattice
        of ``cells`` columns and rows. ``rim`` is that of the domain where it is not given.
        """
        nominal = Nominal.of(surface, charts, *cells)
        if rim is None:
            rim = rim_of_domain(surface, charts, nominal, cells)
        corners = start[charts.faces_vertices]
        area = np.linalg.norm(
            vector_product(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]), axis=1
        )
        if follow == "middle":
            followers, places, feet = charts.faces_vertices, nominal.centres, nominal.parameters
        else:
            level = 1 if follow == "top" else 0
            followers = np.flatnonzero(charts.lattice[:, 1] % 2 == level)[:, None]
            feet = surface.domain.at(charts.lattice[followers[:, 0]], cells)
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
            rim,
            np.maximum(area, LEAST_AREA * np.median(area)),
            sense_of_folds(start, charts),
            weights or Weights(),
            aspect,
            kawasaki,
            None if reach is None else Reach.of(surface, charts, cells, rim, reach),
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
        yield from self._folds(points)
        length, edges, rows = lengths(points, self.charts.edges_vertices)
        short = w.shortest_edge - length / self.length
        yield _hinge(w.edges, short, edges, -rows / self.length)
        for turn in (0, 1):
            yield self._convexity(points, np.roll(faces, -turn, axis=1))
        if self.aspect is not None:
            ratio, sides, rows = side_ratios(points, faces, self.aspect)
            yield _hinge(w.edges, -ratio / self.length, sides, -rows / self.length)
        for over, near, rows in () if self.reach is None else self.reach.over(points):
            yield _hinge(w.reach, over / self.length, near, rows / self.length)
        if self.kawasaki is not None:
            residual, spokes, rows = kawasaki(points, self.charts)
            for sign in (1.0, -1.0):
                over = sign * residual - self.kawasaki
                yield _hinge(KAWASAKI * w.sectors, over, spokes, sign * rows)

    def _sectors(self, points: Floats, faces: Ints) -> Block:
        alpha, corners, rows = corner_angles(points, faces)
        w = self.weights
        low, high = w.least_sector - alpha, alpha - w.greatest_sector
        over = np.maximum(low, high)
        return _hinge(w.sectors, over, corners, np.where(high > low, 1, -1)[:, None, None] * rows)

    def _folds(self, points: Floats) -> Iterator[Block]:
        """The fold in its own sense: one pressed past 180 degrees reads as more than that, and not
        as less than 180 the other way round, where its facets have passed through each other.
        """
        rho, vertices, rows = folds(points, self.charts)
        rows = self.sense[:, None, None] * rows
        fold = (self.sense * rho + np.pi / 2) % (2 * np.pi) - np.pi / 2
        w = self.weights
        low, high = w.least_fold - fold, fold - w.greatest_fold
        sign = np.where(high > 0, w.folds, np.where(low > 0, -w.folds, INACTIVE))
        yield sign * np.where(high > 0, high, -low), vertices, sign[:, None, None] * rows
        yield _hinge(w.closed, fold - w.closed_fold, vertices, rows)

    def _convexity(self, points: Floats, faces: Ints) -> Block:
        p = points[faces]
        u, v, w = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0], p[:, 3] - p[:, 0]
        a, b = vector_product(u, v), vector_product(v, w)
        scale = (self.area / 2) ** 2
        h = _dot(a, b) / scale
        by_u, by_w = vector_product(v, b), vector_product(a, v)
        by_v = vector_product(b, u) + vector_product(w, a)
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


def sense_of_folds(points: Floats, charts: QuadCharts) -> Floats:
    """(P,) 1 or -1, the sign of each fold in a Miura tessellation of the same hand as ``points``
    (V, 3).

    All folds between two rows have one sign and those of the next two the other; along the rows and
    along the columns the signs of the other folds alternate. The hand is that of most folds.
    """
    rho = folds(points, charts)[0]
    f, g = charts.neighbouring_facets.T
    column, row = charts.cells[f].T
    beside = charts.faces_vertices[f, 1] == charts.faces_vertices[g, 0]
    sense = 1.0 - 2 * ((row + column * beside) % 2)
    for kind in (beside, ~beside):
        sense[kind] *= np.sign((np.sign(rho) * sense)[kind].sum() + 0.5)
    return np.asarray(sense)


def _hinge(weight: float, over: Floats, vertices: Ints, gradient: Floats) -> Block:
    """``weight`` times ``over`` where it is positive; ``gradient`` is that of ``over``."""
    active = over > 0
    return weight * over[active], vertices[active], weight * gradient[active]


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("nk,nk->n", a, b))
