"""The limits of a sheet as inequalities g(x) >= 0, each with its sparse gradient.

    edge       |e| - s                               each edge, s the shortest allowed
    angle      alpha - low  and  high - alpha        each corner of each facet
    aspect     A |e| - |e'|                          each ordered pair of sides of one facet
    kawasaki   eps -+ (a0 + a2 - pi)                 each interior vertex

Lengths are divided by the mean edge length L, so that all values have the same scale.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from miurafab.geometry.arrays import Bools, Floats
from miurafab.geometry.quads import QuadCharts
from miurafab.origami.fitting.blocks import (
    Block,
    corner_angles,
    kawasaki,
    lengths,
    side_ratios,
    stacked,
)
from miurafab.origami.fitting.reduction import Unknowns
from miurafab.origami.fitting.request import FitOptions
from miurafab.origami.invariants import EXACT


@dataclass(frozen=True, eq=False)
class Bounds:
    """The bounds on one sheet over ``charts``; None is no bound. x is (3V,).

    ``min_edge`` in the unit of x, ``angles`` the least and greatest sector angle in radians,
    ``aspect`` the greatest ratio of two sides of a facet, ``kawasaki`` the greatest
    |a0 + a2 - pi| in radians.
    """

    charts: QuadCharts
    length: float
    min_edge: float | None = None
    angles: tuple[float, float] | None = None
    aspect: float | None = None
    kawasaki: float | None = None

    def __call__(self, x: Floats) -> tuple[Floats, sparse.csr_array]:
        """g (p,) and its gradient (p, 3V), kind after kind in the order above."""
        return stacked(list(self._blocks(x.reshape(-1, 3))), x.size)

    @property
    def any(self) -> bool:
        """Whether there is a bound at all."""
        limits = (self.min_edge, self.angles, self.aspect, self.kawasaki)
        return any(limit is not None for limit in limits)

    def count(self, held: Bools) -> dict[str, int]:
        """The number of inequalities of each kind among ``held`` (p,)."""
        faces, interior = len(self.charts.faces_vertices), len(self.charts.interior_vertices)
        sizes = {
            "edge": len(self.charts.edges_vertices) if self.min_edge is not None else 0,
            "angle": 8 * faces if self.angles is not None else 0,
            "aspect": 12 * faces if self.aspect is not None else 0,
            "kawasaki": 2 * interior if self.kawasaki is not None else 0,
        }
        parts = np.split(held, np.cumsum(list(sizes.values()))[:-1])
        counts = {kind: int(part.sum()) for kind, part in zip(sizes, parts, strict=True)}
        return {kind: number for kind, number in counts.items() if sizes[kind]}

    def _blocks(self, points: Floats) -> Iterator[Block]:
        if self.min_edge is not None:
            length, edges, rows = lengths(points, self.charts.edges_vertices)
            yield (length - self.min_edge) / self.length, edges, rows / self.length
        if self.angles is not None:
            low, high = self.angles
            alpha, corners, rows = corner_angles(points, self.charts.faces_vertices)
            yield alpha - low, corners, rows
            yield high - alpha, corners, -rows
        if self.aspect is not None:
            ratio, sides, rows = side_ratios(points, self.charts.faces_vertices, self.aspect)
            yield ratio / self.length, sides, rows / self.length
        if self.kawasaki is not None:
            residual, spokes, rows = kawasaki(points, self.charts)
            yield self.kawasaki - residual, spokes, -rows
            yield self.kawasaki + residual, spokes, rows


def limits(options: FitOptions, unknowns: Unknowns, scale: float, margin: float = 0.0) -> Bounds:
    """The limits among ``options``, tightened by the part ``margin``.

    Lengths are in the target's own unit, which is ``scale`` mm long.
    """
    tighter, looser = 1 + margin, 1 - margin
    bounded = options.min_angle is not None or options.max_angle is not None
    low, high = options.angles
    tolerance = options.flat_foldable
    return Bounds(
        unknowns.charts,
        unknowns.length,
        min_edge=None if options.min_edge_mm is None else options.min_edge_mm / scale * tighter,
        angles=(low * tighter, np.pi - (np.pi - high) * tighter) if bounded else None,
        aspect=None if options.max_aspect is None else options.max_aspect * looser,
        kawasaki=None if tolerance is None or tolerance <= EXACT else tolerance * looser,
    )
