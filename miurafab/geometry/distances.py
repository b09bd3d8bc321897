"""Distances from points to triangle meshes, exactly, for many points at once.

A tree over triangle centroids gives an upper bound from the nearest few; every triangle whose
centroid is nearer than that bound plus the largest triangle radius could be nearer still, and those
are all measured. The bound makes the result exact and not a guess.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Floats = NDArray[np.float64]


def closest_on_triangle(points: Floats, triangles: Floats) -> Floats:
    """(n, 3) the point of each triangle (n, 3, 3) nearest to each of ``points`` (n, 3).

    The foot in the triangle's plane where it lies inside, else the nearest foot on a side.
    """
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    ab, ac, ap = b - a, c - a, points - a
    d11, d12, d22 = _dot(ab, ab), _dot(ab, ac), _dot(ac, ac)
    p1, p2 = _dot(ap, ab), _dot(ap, ac)
    det = d11 * d22 - d12 * d12
    with np.errstate(invalid="ignore", divide="ignore"):
        s, t = (d22 * p1 - d12 * p2) / det, (d11 * p2 - d12 * p1) / det
    inside = (det > 0) & (s >= 0) & (t >= 0) & (s + t <= 1)
    best = a + np.where(inside, s, 0.0)[:, None] * ab + np.where(inside, t, 0.0)[:, None] * ac
    least = np.where(inside, _dot(best - points, best - points), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        side = end - start
        length = _dot(side, side)
        with np.errstate(invalid="ignore", divide="ignore"):
            at = np.where(length > 0, np.clip(_dot(points - start, side) / length, 0, 1), 0.0)
        foot = start + at[:, None] * side
        gap = _dot(foot - points, foot - points)
        nearer = ~inside & (gap < least)
        best = np.where(nearer[:, None], foot, best)
        least = np.where(nearer, gap, least)
    return best


def closest_on_mesh(points: Floats, triangles: Floats) -> Floats:
    """(n, 3) the points of the mesh ``triangles`` (m, 3, 3) nearest to ``points`` (n, 3)."""
    centroids = triangles.mean(axis=1)
    radius = float(np.linalg.norm(triangles - centroids[:, None], axis=2).max())
    tree = cKDTree(centroids)
    few = min(6, len(triangles))
    near = np.asarray(tree.query(points, k=few)[1]).reshape(len(points), few)
    row = np.repeat(np.arange(len(points)), few)
    best = np.empty_like(points)
    bound = _keep_nearest(points, triangles, row, near.ravel(), best, np.full(len(points), np.inf))
    candidates = tree.query_ball_point(points, bound + radius, return_sorted=False)
    counts = np.array([len(c) for c in candidates])
    if (counts > few).any():
        row = np.repeat(np.arange(len(points)), counts)
        column = np.concatenate([np.asarray(c, dtype=np.int64) for c in candidates])
        _keep_nearest(points, triangles, row, column, best, bound)
    return best


def _keep_nearest(
    points: Floats,
    triangles: Floats,
    row: NDArray[np.int64],
    column: NDArray[np.int64],
    best: Floats,
    bound: Floats,
) -> Floats:
    """Lower ``bound`` (n,) and move ``best`` (n, 3) by the pairs (point row, triangle column)."""
    chunk = 500_000
    for start in range(0, len(row), chunk):
        rows, columns = row[start : start + chunk], column[start : start + chunk]
        foot = closest_on_triangle(points[rows], triangles[columns])
        gap = np.linalg.norm(foot - points[rows], axis=1)
        order = np.lexsort((gap, rows))
        first = order[np.unique(rows[order], return_index=True)[1]]
        winners = first[gap[first] < bound[rows[first]]]
        best[rows[winners]] = foot[winners]
        bound[rows[winners]] = gap[winners]
    return bound


def _dot(a: Floats, b: Floats) -> Floats:
    product: Floats = np.einsum("nk,nk->n", a, b)
    return product
