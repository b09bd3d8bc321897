"""Which vertices, triangles and edges are near each other, and who stands on which side.

A pair has the side on which it was when it came near, and keeps it while it is near: it came from
beside, where one does not stand over the other, or from afar. Facets of origami lie exactly on each
other, so that vertices come down on sides and corners. Triangles and edges are therefore widened:
g = 1 inside them, and falls to 0 at -``WIDENED`` in barycentric coordinates. It falls to 0 as well
where two edges become parallel and have no side; there the vertices of one meet facets of the
other. Diagonals of facets, which hardly bend, do not count as edges.

What sides join cannot pass through each other by itself: a vertex joined to two corners of a
triangle, and two edges of which two sides join the ends, are kept apart by the limit of the fold
angle between them instead.
"""

from __future__ import annotations

import numpy as np

from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.nearest import tree_of
from miurafab.origami.energy.touching import HEIGHT, NO_PAIRS, Over, TouchPairs, over

WIDENED = 0.1
"""How far a triangle or an edge reaches beyond its sides, in barycentric coordinates."""
REACH = 0.35
"""Mean edges within which two things are a pair."""
ARMED = 0.1
"""Mean edges within which a pair has its spring from the beginning of a step."""
UNDECIDED = HEIGHT / 10
"""Mean edges; nearer than this, what comes near has no side yet: it comes in the same plane."""
STEEP = 3.0
"""What is beside a triangle or an edge is over it if it is so much higher than it is beside."""
PARALLEL, CROSSING = 0.05, 0.15
"""The sine of the angle of two edges, up to which they have no side, and from which g is 1."""


class NearPairs:
    """The pairs that are near each other in a sheet of ``triangles`` (T, 3) with ``edges`` (E, 2).

    It remembers: ``pairs`` are those of the last points that it was shown.
    """

    def __init__(self, triangles: Ints, edges: Ints, count: int) -> None:
        self._triangles, self._edges, self._count = triangles, edges, count
        ends = np.stack([triangles, np.roll(triangles, 1, axis=1)]).reshape(2, -1).T
        ends = np.concatenate([ends, ends[:, ::-1]])
        self._joined = np.unique(ends[:, 0] * count + ends[:, 1])
        self.pairs = NO_PAIRS
        self._keys = np.empty(0, dtype=np.int64)

    def look(self, points: Floats, *, beside: bool = False) -> None:
        """Find the pairs at ``points`` (V, 3), with the sides of those that were known before.

        With ``beside``, what is beside a triangle or an edge has a side as well.
        """
        vertex, triangle = self._vertices_over_triangles(points)
        one, other = self._edges_over_edges(points)
        stencils = np.concatenate(
            [
                np.column_stack([vertex, self._triangles[triangle]]),
                np.column_stack([self._edges[one], self._edges[other]]),
            ]
        )
        edges = np.arange(len(stencils)) >= len(vertex)
        # a triangle and an edge are known by their numbers
        first = np.concatenate([vertex, self._count + one])
        keys = first * (len(self._triangles) + len(self._edges))
        keys += np.concatenate([triangle, len(self._triangles) + other])
        it = over(points, stencils, edges)
        inside = _inside(it, edges)
        weight = np.clip(1 + np.minimum(inside, 0.0) / WIDENED, 0.0, 1.0) * _across(it, edges)
        size = np.where(edges, np.linalg.norm(it.legs, axis=2).max(axis=1), it.size2**0.25)
        least = 0.0 if beside else np.maximum(UNDECIDED, -STEEP * inside * size)
        side = np.where(np.abs(it.height) < least, 0.0, np.sign(it.height))
        if len(self._keys):
            at = np.searchsorted(self._keys, keys).clip(max=len(self._keys) - 1)
            side = np.where(self._keys[at] == keys, self.pairs.side[at], side)
        live = np.flatnonzero((weight > 0) & (np.abs(it.height) <= REACH) & (side != 0))
        live = live[np.argsort(keys[live])]
        self._keys = keys[live]
        self.pairs = TouchPairs(stencils[live], edges[live], side[live], weight[live])

    def within(self, points: Floats, distance: float) -> Bools:
        """(n,) which of the pairs are nearer than ``distance`` at ``points``, or have crossed."""
        pairs = self.pairs
        height = over(points, pairs.stencils, pairs.edges).height
        return np.asarray(pairs.side * height < distance)

    def _vertices_over_triangles(self, points: Floats) -> tuple[Ints, Ints]:
        corners = points[self._triangles]
        centre = corners.mean(axis=1)
        radius = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
        reach = float(radius.max(initial=0.0)) + REACH
        found = tree_of(points).sparse_distance_matrix(
            tree_of(centre), reach, output_type="ndarray"
        )
        vertex, triangle = found["i"].astype(np.int64), found["j"].astype(np.int64)
        near = found["v"] <= radius[triangle] + REACH
        vertex, triangle = vertex[near], triangle[near]
        bond = self._bond(vertex[:, None], self._triangles[triangle])
        apart = ~((bond == 2).any(axis=1) | ((bond == 1).sum(axis=1) >= 2))
        return vertex[apart], triangle[apart]

    def _edges_over_edges(self, points: Floats) -> tuple[Ints, Ints]:
        ends = points[self._edges]
        middle = ends.mean(axis=1)
        half = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / 2
        reach = 2 * float(half.max(initial=0.0)) + REACH
        pairs = tree_of(middle).query_pairs(reach, output_type="ndarray").astype(np.int64)
        one, other = pairs.T
        apart = np.linalg.norm(middle[one] - middle[other], axis=1)
        near = apart <= half[one] + half[other] + REACH
        one, other = one[near], other[near]
        p, q = self._edges[one], self._edges[other]
        bond = self._bond(p[:, [0, 0, 1, 1]], q[:, [0, 1, 0, 1]])
        apart = ~((bond == 2).any(axis=1) | ((bond == 1).sum(axis=1) >= 2))
        return one[apart], other[apart]

    def _bond(self, one: Ints, other: Ints) -> Ints:
        """2 for the same vertex, 1 for two that a side joins, else 0."""
        key = one * self._count + other
        at = np.searchsorted(self._joined, key).clip(max=len(self._joined) - 1)
        return np.where(one == other, 2, (self._joined[at] == key).astype(np.int64))


def _inside(it: Over, edges: Bools) -> Floats:
    """(n,) the least barycentric coordinate of the points of pairs."""
    s, t = it.place.T
    least = np.minimum(s, t)
    return np.asarray(np.minimum(least, np.where(edges, np.minimum(1 - s, 1 - t), 1 - s - t)))


def _across(it: Over, edges: Bools) -> Floats:
    """(n,) 1 for edges that cross, 0 for parallel ones, and 1 for a vertex over a triangle."""
    with np.errstate(invalid="ignore", divide="ignore"):
        sine = np.sqrt(it.size2 / np.einsum("nik,nik->ni", it.legs, it.legs).prod(axis=1))
    across = np.clip((sine - PARALLEL) / (CROSSING - PARALLEL), 0.0, 1.0)
    return np.where(edges, np.nan_to_num(across), 1.0)
