"""The largest distance of a triangle mesh from a set, by branch and bound.

The Hausdorff distance of two surfaces is the larger of two such distances. Let c be the centre of a
triangle, and K a convex part of the set (its witness): the triangle of the other mesh nearest to c,
or the point nearest to c. The distance from K is convex, so over the triangle it is largest at a
corner, and the distance from the set is no larger than that from K:

    d(c, set)  <=  max over the triangle of d(., set)  <=  max over its corners of d(., K).

A triangle whose upper bound is more than the largest distance found so far is divided in four. The
parts are judged by the witness of the whole before they get their own. The answer is the distance
of a point that was tried, so that it is never too large.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from miurafab.geometry.arrays import Floats
from miurafab.geometry.distances import MeshTrees, closest_on_triangle
from miurafab.geometry.nearest import tree_of

WITHIN = 0.005
"""The part by which the largest distance may be larger than the answer."""

_DIVISIONS = 12
_MOST = 60_000
"""The most triangles that get a witness of their own at a time, those with the largest bounds. Only
two surfaces that touch all over have so many: there no bound excludes anything."""
_MANY = 10_000
"""From this number of triangles on, a sample of them lends its witnesses to all the others."""

Nearest = Callable[[Floats], tuple[Floats, Floats]]
"""From points (n, 3) to the nearest points of the set (n, 3) and their witnesses (n, ...)."""
Reach = Callable[[Floats, Floats], Floats]
"""From points (n, 3) and witnesses (n, ...) to the distances (n,)."""


def farthest_from_mesh(triangles: Floats, mesh: Floats) -> float:
    """The largest distance of a point of ``triangles`` (n, 3, 3) from ``mesh`` (m, 3, 3)."""
    trees = MeshTrees.of(mesh)

    def nearest(points: Floats) -> tuple[Floats, Floats]:
        feet, triangle = trees.closest(points)
        return feet, mesh[triangle]

    def reach(points: Floats, witnesses: Floats) -> Floats:
        return _lengths(closest_on_triangle(points, witnesses) - points)

    return _farthest(triangles, nearest, reach, 0.0)


def farthest_from_map(triangles: Floats, projection: Callable[[Floats], Floats]) -> float:
    """The largest distance of a point of ``triangles`` (n, 3, 3) from a set.

    ``projection`` maps points (n, 3) to the nearest points of the set (n, 3).
    """

    def nearest(points: Floats) -> tuple[Floats, Floats]:
        feet = projection(points)
        return feet, feet

    def reach(points: Floats, witnesses: Floats) -> Floats:
        return _lengths(witnesses - points)

    corners = np.unique(triangles.reshape(-1, 3), axis=0)
    at_corners = float(_lengths(projection(corners) - corners).max())
    return _farthest(triangles, nearest, reach, at_corners)


def _farthest(triangles: Floats, nearest: Nearest, reach: Reach, best: float) -> float:
    def bounds(triangles: Floats, witnesses: Floats) -> Floats:
        each = reach(triangles.reshape(-1, 3), np.repeat(witnesses, 3, axis=0))
        return np.asarray(each.reshape(-1, 3).max(axis=1))

    if len(triangles) > _MANY:
        some = triangles[:: -(-len(triangles) // max(_MANY, len(triangles) // 16))].mean(axis=1)
        feet, witnesses = nearest(some)
        best = max(best, float(_lengths(feet - some).max()))
        lender = tree_of(some).query(triangles.mean(axis=1))[1]
        triangles = triangles[bounds(triangles, witnesses[lender]) > (1 + WITHIN) * best]
    for _ in range(_DIVISIONS):
        centres = triangles.mean(axis=1)
        feet, witnesses = nearest(centres)
        best = max(best, float(_lengths(feet - centres).max(initial=0.0)))
        left = bounds(triangles, witnesses) > (1 + WITHIN) * best
        triangles, witnesses = in_four(triangles[left]), np.concatenate([witnesses[left]] * 4)
        bound = bounds(triangles, witnesses)
        order = np.argsort(-bound, kind="stable")[:_MOST]
        triangles = triangles[np.sort(order[bound[order] > (1 + WITHIN) * best])]
        if not len(triangles):
            break
    return best


def in_four(triangles: Floats) -> Floats:
    """(4n, 3, 3) each of ``triangles`` (n, 3, 3) divided at the middles of its sides."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return np.concatenate([np.stack(part, axis=1) for part in parts])


def _lengths(vectors: Floats) -> Floats:
    return np.asarray(np.linalg.norm(vectors, axis=1))
