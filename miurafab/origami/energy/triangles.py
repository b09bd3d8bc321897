"""Facets of any shape split into triangles on their short diagonals, about which they bend.

A quad is split on its shorter diagonal; if it is not convex, on the diagonal from its reflex or
straight corner, which lies inside. A facet of more corners is split so that its worst triangle is
as good as can be: the triangle of the least area for the square of its longest side.
"""

from __future__ import annotations

import numpy as np

from miurafab.geometry.arrays import Floats, Ints, vector_product
from miurafab.geometry.polygons import edge_lengths, facet_normals

STRAIGHT = 1e-6
"""A corner whose triangle is a smaller part of its quad lies on the line of its neighbours."""


def split_facets(points: Floats, faces: Ints) -> tuple[Ints, Ints]:
    """The triangles (T, 3) of ``faces`` (F, k) in ``points`` (V, 3), and their diagonals (D, 2).

    Triangles run round as their facets do; diagonals are in the order of the facets.
    """
    triangles, _, diagonals = _split(points, faces)
    return triangles, diagonals


def facet_triangles(points: Floats, faces: Ints) -> tuple[Ints, Ints]:
    """The triangles (T, 3) of :func:`split_facets`, and the facet (T,) of each."""
    triangles, facets, _ = _split(points, faces)
    return triangles, facets


def _split(points: Floats, faces: Ints) -> tuple[Ints, Ints, Ints]:
    size = (faces >= 0).sum(axis=1)
    triangles, diagonals = [faces[size == 3][:, :3]], [np.empty((0, 2), dtype=np.int64)]
    facets, owners = [np.flatnonzero(size == 3)], [np.empty(0, dtype=np.int64)]
    if (size == 4).any():
        quads = np.flatnonzero(size == 4)
        q = _turned(points, faces[quads][:, :4])
        triangles += [q[:, [0, 1, 2]], q[:, [0, 2, 3]]]
        facets += [quads, quads]
        diagonals.append(q[:, [0, 2]])
        owners.append(quads)
    for face in np.flatnonzero(size > 4).tolist():
        corners = faces[face, : size[face]].tolist()
        found = _best(points, corners)
        triangles.append(np.array(found))
        facets.append(np.full(len(found), face))
        # the longest run is the whole facet, whose last side is no diagonal
        diagonals.append(np.array([[last, first] for first, _, last in found[1:]]))
        owners.append(np.full(len(found) - 1, face))
    order = np.argsort(np.concatenate(owners), kind="stable")
    ordered = np.concatenate(diagonals)[order]
    return np.concatenate(triangles), np.concatenate(facets), ordered


def _turned(points: Floats, q: Ints) -> Ints:
    """The quads ``q`` (n, 4), turned until their diagonal runs from the first to the third."""
    p = points[q]
    normal = vector_product(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    turn = np.stack(
        [vector_product(p[:, k] - p[:, k - 1], p[:, (k + 1) % 4] - p[:, k]) for k in range(4)],
        axis=1,
    )
    reflex = np.einsum("qck,qk->qc", turn, normal) < STRAIGHT * (normal**2).sum(axis=1)[:, None]
    first, second = edge_lengths(points, q[:, [0, 2]]), edge_lengths(points, q[:, [1, 3]])
    across = np.where(reflex.any(axis=1), reflex[:, 1] | reflex[:, 3], second < first)
    return np.where(across[:, None], np.roll(q, -1, axis=1), q)


def _best(points: Floats, face: list[int]) -> list[list[int]]:
    """The triangles of the polygon ``face`` whose worst triangle is the best of all ways.

    Dynamic programming over the runs of corners i..j: the best worst triangle of a run is known
    from those of the two runs that a third corner parts it into (Klincsek 1980). Where all
    triangles run round, they cover the polygon once, so diagonals lie inside.
    """
    normal = facet_normals(points, np.array([face]))[0]
    count = len(face)
    corners = points[face]
    best = np.full((count, count), np.inf)
    third = np.zeros((count, count), dtype=np.int64)
    for run in range(2, count):
        i = np.arange(count - run)[:, None]
        j, between = i + run, i + np.arange(1, run)
        worst = np.minimum(best[i, between], best[between, j])
        worst = np.minimum(worst, _shapes(corners, i, between, j, normal))
        chosen = worst.argmax(axis=1)[:, None]
        third[i, j] = np.take_along_axis(between, chosen, axis=1)
        best[i, j] = np.take_along_axis(worst, chosen, axis=1)
    triangles, runs = [], [(0, count - 1)]
    while runs:
        first, last = runs.pop()
        if last - first > 1:
            middle = int(third[first, last])
            triangles.append([face[first], face[middle], face[last]])
            runs += [(first, middle), (middle, last)]
    return triangles


def _shapes(corners: Floats, i: Ints, between: Ints, j: Ints, normal: Floats) -> Floats:
    """Twice the area over the square of the longest side, of triangles i, ``between``, j."""
    a, b, c = corners[i], corners[between], corners[j]
    area = vector_product(b - a, c - a) @ normal
    sides = [((b - a) ** 2).sum(axis=-1), ((c - b) ** 2).sum(axis=-1)]
    longest = np.maximum(np.maximum(*sides), ((c - a) ** 2).sum(axis=-1))
    return np.asarray(np.where(longest > 0, area / np.where(longest > 0, longest, 1.0), -np.inf))
