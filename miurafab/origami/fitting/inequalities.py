"""The limits of a sheet as inequalities g(x) >= 0, each with its sparse gradient.

    edge       |e| - s                               each edge, s the shortest allowed
    angle      alpha - low  and  high - alpha        each corner of each facet
    aspect     A |e| - |e'|                          each ordered pair of sides of one facet
    kawasaki   eps -+ (a0 + a2 - pi)                 each interior vertex

Lengths are divided by the mean edge length L, so that all values have the same scale.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from miurafab.geometry.angles import sectors
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.quads import QuadCharts
from miurafab.origami.fitting.reduction import Unknowns
from miurafab.origami.fitting.request import FitOptions
from miurafab.origami.verify import EXACT


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
        points = x.reshape(-1, 3)
        blocks = [block for _, block in self._blocks(points)]
        values = np.concatenate([value for value, _ in blocks])
        return values, _stacked([rows for _, rows in blocks])

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

    def _blocks(self, points: Floats) -> list[tuple[str, tuple[Floats, sparse.csr_array]]]:
        blocks: list[tuple[str, tuple[Floats, sparse.csr_array]]] = []
        if self.min_edge is not None:
            lengths, along = _lengths(points, self.charts.edges_vertices)
            gradient = sparse.csr_array(along / self.length)
            blocks.append(("edge", ((lengths - self.min_edge) / self.length, gradient)))
        if self.angles is not None:
            low, high = self.angles
            alpha, rows = self._corner_angles(points)
            both = _stacked([rows, -rows])
            blocks.append(("angle", (np.concatenate([alpha - low, high - alpha]), both)))
        if self.aspect is not None:
            blocks.append(("aspect", self._aspect(points, self.aspect)))
        if self.kawasaki is not None:
            residual, rows = self._kawasaki(points)
            both = _stacked([-rows, rows])
            slack = np.concatenate([self.kawasaki - residual, self.kawasaki + residual])
            blocks.append(("kawasaki", (slack, both)))
        return blocks

    def _corner_angles(self, points: Floats) -> tuple[Floats, sparse.csr_array]:
        faces = self.charts.faces_vertices
        corners = np.stack([faces, np.roll(faces, -1, axis=1), np.roll(faces, 1, axis=1)], axis=-1)
        return _angles(points, corners.reshape(-1, 3))

    def _kawasaki(self, points: Floats) -> tuple[Floats, sparse.csr_array]:
        centre, ring = self.charts.interior_vertices, self.charts.interior_neighbours
        first, by_first = _angles(points, np.stack([centre, ring[:, 0], ring[:, 1]], axis=1))
        third, by_third = _angles(points, np.stack([centre, ring[:, 2], ring[:, 3]], axis=1))
        return first + third - np.pi, by_first + by_third

    def _aspect(self, points: Floats, limit: float) -> tuple[Floats, sparse.csr_array]:
        faces = self.charts.faces_vertices
        sides = [_lengths(points, faces[:, [k, (k + 1) % 4]]) for k in range(4)]
        values, rows = [], []
        for (short, by_short), (long, by_long) in itertools.permutations(sides, 2):
            values.append((limit * short - long) / self.length)
            rows.append((limit * by_short - by_long) / self.length)
        return np.concatenate(values), _stacked(rows)


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


def _lengths(points: Floats, edges: Ints) -> tuple[Floats, sparse.csr_array]:
    """(E,) lengths of ``edges`` (E, 2) and their gradient (E, 3V)."""
    along = points[edges[:, 1]] - points[edges[:, 0]]
    lengths = np.linalg.norm(along, axis=1)
    unit = along / lengths[:, None]
    return lengths, _rows(edges, np.stack([-unit, unit], axis=1), points.size)


def _angles(points: Floats, corners: Ints) -> tuple[Floats, sparse.csr_array]:
    """(n,) angles at ``corners`` (n, 3), each a vertex and the ends of its two sides."""
    centre = points[corners[:, 0]]
    alpha, to_a, to_b = sectors(points[corners[:, 1]] - centre, points[corners[:, 2]] - centre)
    return alpha, _rows(corners, np.stack([-(to_a + to_b), to_a, to_b], axis=1), points.size)


def _rows(stencil: Ints, gradient: Floats, unknowns: int) -> sparse.csr_array:
    """The matrix with the rows ``gradient`` (n, k, 3) over the vertices ``stencil`` (n, k)."""
    n, k = stencil.shape
    columns = (stencil[:, :, None] * 3 + np.arange(3)).reshape(-1)
    starts = np.arange(0, 3 * n * k + 1, 3 * k)
    return sparse.csr_array((gradient.reshape(-1), columns, starts), shape=(n, unknowns))


def _stacked(matrices: list[sparse.csr_array]) -> sparse.csr_array:
    return sparse.csr_array(sparse.vstack(matrices, format="csr"))
