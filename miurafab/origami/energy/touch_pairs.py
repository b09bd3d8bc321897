"""Which vertices, triangles and edges are near each other.

What has a common vertex meets there. The two triangles at a hinge are kept apart by the limit of
its fold angle instead, so what has their four vertices is no pair. Diagonals of facets, which
hardly bend, do not count as edges.

Parallel edges have no one nearest point, so g is small there; the vertices of one are near facets
of the other. Things that are near each other in the flat sheet already have a smaller h, and what
touches there, as both sides of a cut do, is no pair: nothing could move.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from miurafab.geometry.arrays import Bools, Floats, Ints, places_among
from miurafab.geometry.nearest import tree_of
from miurafab.origami.energy.touching import CLOSEST, HEIGHT, NO_PAIRS, TouchPairs, gaps

REACH = 0.35
"""Mean edges within which two things are a pair."""
CROSSING, PARALLEL = 0.15, 0.1
"""The sine of the angle of two edges from which g is 1, and g of parallel ones."""
LOWER = 0.5
"""h is at most this part of the distance in the flat sheet."""
ARMED = 0.1
"""Mean edges within which a pair has its spring from the beginning of a step."""
MOST_ARMINGS = 5
"""How often a state is solved anew with springs between what came to touch in it."""
LEASH = REACH - HEIGHT
"""Mean edges by which two things may come nearer before it is looked anew which are near."""


class NearPairs:
    """The pairs that are near each other in a sheet of ``triangles`` (T, 3) with ``edges`` (E, 2),
    which lies flat at ``flat`` (V, 3). ``hinges`` (H, 4) are the vertices of each two triangles
    with a common side.
    """

    def __init__(self, triangles: Ints, edges: Ints, hinges: Ints, flat: Floats) -> None:
        self._triangles, self._edges, self._count = triangles, edges, len(flat)
        self._hinges = np.unique(self._keys(hinges))
        self._low = np.empty(0, dtype=np.int64)
        self._heights = np.empty(0)
        keys, pairs = self._within(flat, HEIGHT / LOWER)
        order = np.argsort(keys)
        self._low, self._heights = keys[order], LOWER * pairs.distance[order]

    def at(self, points: Floats) -> TouchPairs:
        """The pairs at ``points`` (V, 3) that are within ``REACH``."""
        return self._found(points)[1]

    def _found(self, points: Floats) -> tuple[Ints, TouchPairs]:
        keys, pairs = self._within(points, REACH)
        apart = pairs.height > LOWER * CLOSEST
        return keys[apart], pairs.those(apart)

    def _within(self, points: Floats, reach: float) -> tuple[Ints, TouchPairs]:
        vertex, triangle = self._vertices_and_triangles(points, reach)
        one, other = self._edges_and_edges(points, reach)
        stencils = np.concatenate(
            [
                np.column_stack([vertex, self._triangles[triangle]]),
                np.column_stack([self._edges[one], self._edges[other]]),
            ]
        )
        edges = np.arange(len(stencils)) >= len(vertex)
        distance = gaps(points, stencils, edges).distance
        # a triangle and an edge are known by their numbers
        keys = np.concatenate([vertex, self._count + one])
        keys *= len(self._triangles) + len(self._edges)
        keys += np.concatenate([triangle, len(self._triangles) + other])
        near = np.flatnonzero(distance <= reach)
        keys, stencils, edges = keys[near], stencils[near], edges[near]
        height = np.full(len(near), HEIGHT)
        at = places_among(self._low, keys)
        height[at >= 0] = self._heights[at[at >= 0]]
        weight = np.where(edges, _crossing(points, stencils), 1.0)
        return keys, TouchPairs(stencils, edges, height, weight, points, distance[near])

    def _vertices_and_triangles(self, points: Floats, reach: float) -> tuple[Ints, Ints]:
        corners = points[self._triangles]
        centre = corners.mean(axis=1)
        radius = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
        tree, found = tree_of(points), []
        for some in _alike(radius):
            farthest = float(radius[some].max()) + reach
            near = tree.sparse_distance_matrix(
                tree_of(centre[some]), farthest, output_type="ndarray"
            )
            found.append(np.stack([near["i"], some[near["j"]]]))
        vertex, triangle = _joined(found)
        low, high = corners.min(axis=1) - reach, corners.max(axis=1) + reach
        at = points[vertex]
        near = ((low[triangle] <= at) & (at <= high[triangle])).all(axis=1)
        vertex, triangle = vertex[near], triangle[near]
        apart = self._apart(vertex[:, None], self._triangles[triangle])
        return vertex[apart], triangle[apart]

    def _edges_and_edges(self, points: Floats, reach: float) -> tuple[Ints, Ints]:
        ends = points[self._edges]
        middle = ends.mean(axis=1)
        half = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / 2
        found, shorter = [], np.empty(0, dtype=np.int64)
        for some in _alike(half):
            farthest, tree = float(half[some].max()) + reach, tree_of(middle[some])
            within = tree.query_pairs(farthest + float(half[some].max()), output_type="ndarray")
            found.append(some[within].T)
            if len(shorter):
                farthest += float(half[shorter].max())
                near = tree.sparse_distance_matrix(
                    tree_of(middle[shorter]), farthest, output_type="ndarray"
                )
                found.append(np.stack([some[near["i"]], shorter[near["j"]]]))
            shorter = np.concatenate([shorter, some])
        one, other = np.sort(_joined(found), axis=0)
        apart = np.linalg.norm(middle[one] - middle[other], axis=1)
        near = apart <= half[one] + half[other] + reach
        one, other = one[near], other[near]
        low, high = ends.min(axis=1), ends.max(axis=1)
        beside = np.maximum(low[one] - high[other], low[other] - high[one])
        near = (beside <= reach).all(axis=1)
        one, other = one[near], other[near]
        free = self._apart(self._edges[one], self._edges[other])
        return one[free], other[free]

    def _apart(self, one: Ints, other: Ints) -> Bools:
        """(n,) whether what has the vertices ``one`` (n, k) and ``other`` (n, 4 - k) is a pair."""
        common = (one[:, :, None] == other[:, None, :]).any(axis=(1, 2))
        keys = self._keys(np.concatenate([one, other], axis=1))
        return np.asarray(~common & (places_among(self._hinges, keys) < 0))

    def _keys(self, corners: Ints) -> Ints:
        """(n,) a number for each set of four vertices (n, 4)."""
        a, b, c, d = np.sort(corners, axis=1).T
        return np.asarray(((a * self._count + b) * self._count + c) * self._count + d)


class LastingPairs(NearPairs):
    """Pairs that keep the g at which they were found first, so that the energy of their springs is
    one of the shape alone, on a long way too.
    """

    def __init__(self, triangles: Ints, edges: Ints, hinges: Ints, rest: Floats) -> None:
        self._known, self._weights = np.empty(0, dtype=np.int64), np.empty(0)
        super().__init__(triangles, edges, hinges, rest)

    def at(self, points: Floats) -> TouchPairs:
        """The pairs at ``points`` (V, 3) that are within ``REACH``."""
        keys, pairs = self._found(points)
        at, weight = places_among(self._known, keys), pairs.weight.copy()
        weight[at >= 0] = self._weights[at[at >= 0]]
        known = np.concatenate([self._known, keys[at < 0]])
        order = np.argsort(known)
        self._known = known[order]
        self._weights = np.concatenate([self._weights, weight[at < 0]])[order]
        return replace(pairs, weight=weight)


class Contacts:
    """The pairs that are ``near`` each other, of which some have springs; with None there are none.

    Attributes
    ----------
    pairs : TouchPairs
        All that are within ``REACH`` where it was last looked.
    sprung : TouchPairs
        Those of them with springs.
    """

    def __init__(self, near: NearPairs | None) -> None:
        self._near = near
        self.pairs = self.sprung = NO_PAIRS
        self._armed = np.empty(0, dtype=bool)

    def look(self, points: Floats, within: float) -> None:
        """Look which pairs are near each other at ``points`` (V, 3), and give springs to those that
        are nearer than ``within``.
        """
        if self._near is None:
            return
        self.pairs = self._near.at(points)
        self._armed = np.zeros(len(self.pairs.edges), dtype=bool)
        self.arm(points, within)

    def arm(self, points: Floats, within: float) -> None:
        """Give springs to the pairs that are nearer than ``within`` at ``points`` as well."""
        self._armed[self.pairs.nearer_than(within, points)[0]] = True
        self.sprung = self.pairs.those(self._armed)

    def lacking(self, points: Floats) -> bool:
        """Whether a pair without a spring touches at ``points``."""
        return not self._armed[self.pairs.touching(points)[0]].all()


def _alike(size: Floats) -> list[Ints]:
    """The numbers of things of about one ``size`` (n,), small ones first: with few large ones among
    them, a search as wide as for the largest finds mostly what is not near.
    """
    if not len(size):
        return []
    level = np.ceil(np.log2(np.maximum(size / np.median(size), 1.0)) - 1e-9)
    return [np.flatnonzero(level == each) for each in np.unique(level)]


def _joined(found: list[Ints]) -> Ints:
    """The pairs (2, n) of all ``found`` (2, m)."""
    return np.concatenate([np.empty((2, 0), dtype=np.int64), *found], axis=1).astype(np.int64)


def _crossing(points: Floats, stencils: Ints) -> Floats:
    """(n,) g of edges: 1 where they cross, little where they are parallel."""
    p, q, a, b = (points[stencils[:, corner]] for corner in range(4))
    one, other = q - p, b - a
    lengths = np.einsum("nk,nk->n", one, one) * np.einsum("nk,nk->n", other, other)
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine2 = np.einsum("nk,nk->n", one, other) ** 2 / lengths
        sine = np.sqrt(np.maximum(1.0 - cosine2, 0.0))
    return np.asarray(np.clip(sine / CROSSING, PARALLEL, 1.0))
