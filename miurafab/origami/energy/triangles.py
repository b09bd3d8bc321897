"""Facets of any shape split into triangles on their short diagonals, about which they bend.

A quad is split on its shorter diagonal; if it is not convex, on the diagonal from its reflex
corner, which lies inside. From a facet of more corners, ears are cut one by one: of the convex
corners whose triangle holds no other corner, that with the shortest diagonal across it.
"""

from __future__ import annotations

import itertools

import numpy as np

from miurafab.geometry.arrays import Floats, Ints, vector_product
from miurafab.geometry.polygons import edge_lengths, facet_normals

_THIN = 1e-9
"""Of the area of its facet; a thinner triangle is no ear."""


def split_facets(points: Floats, faces: Ints) -> tuple[Ints, Ints]:
    """The triangles (T, 3) of ``faces`` (F, k) in ``points`` (V, 3), and their diagonals (D, 2).

    Triangles run round as their facets do; diagonals are in the order of the facets.
    """
    size = (faces >= 0).sum(axis=1)
    triangles, diagonals = [faces[size == 3][:, :3]], [np.empty((0, 2), dtype=np.int64)]
    owners = [np.empty(0, dtype=np.int64)]
    if (size == 4).any():
        q = _turned(points, faces[size == 4][:, :4])
        triangles += [q[:, [0, 1, 2]], q[:, [0, 2, 3]]]
        diagonals.append(q[:, [0, 2]])
        owners.append(np.flatnonzero(size == 4))
    for face in np.flatnonzero(size > 4).tolist():
        ears = _ears(points, faces[face, : size[face]].tolist())
        triangles.append(np.array(ears))
        diagonals.append(np.array([[after, before] for before, _, after in ears[:-1]]))
        owners.append(np.full(len(ears) - 1, face))
    order = np.argsort(np.concatenate(owners), kind="stable")
    return np.concatenate(triangles), np.concatenate(diagonals)[order]


def _turned(points: Floats, q: Ints) -> Ints:
    """The quads ``q`` (n, 4), turned until their diagonal runs from the first to the third."""
    p = points[q]
    normal = vector_product(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    turn = np.stack(
        [vector_product(p[:, k] - p[:, k - 1], p[:, (k + 1) % 4] - p[:, k]) for k in range(4)],
        axis=1,
    )
    reflex = np.einsum("qck,qk->qc", turn, normal) < 0
    first, second = edge_lengths(points, q[:, [0, 2]]), edge_lengths(points, q[:, [1, 3]])
    across = np.where(reflex.any(axis=1), reflex[:, 1] | reflex[:, 3], second < first)
    return np.where(across[:, None], np.roll(q, -1, axis=1), q)


def _ears(points: Floats, rest: list[int]) -> list[list[int]]:
    """The triangles of the polygon ``rest``, each with its ear in the middle; the last is left."""
    normal = facet_normals(points, np.array([rest]))[0]
    fan = np.array([[rest[0], *pair] for pair in itertools.pairwise(rest[1:])])
    thin = _THIN * float(_areas(points, fan, normal).sum())
    ears = []
    while len(rest) > 3:
        corners = np.stack([np.roll(rest, 1), rest, np.roll(rest, -1)], axis=1)
        across = edge_lengths(points, corners[:, [0, 2]])
        area = _areas(points, corners, normal)
        sound = area > thin
        for at in np.flatnonzero(sound).tolist():
            others = np.setdiff1d(rest, corners[at])
            sides = np.stack([corners[at], np.roll(corners[at], -1)], axis=1)
            inside = np.ones(len(others), dtype=bool)
            for side in sides:
                three = np.column_stack([np.tile(side, (len(others), 1)), others])
                inside &= _areas(points, three, normal) >= -thin
            sound[at] = not inside.any()
        ear = int(np.argmin(np.where(sound, across, np.inf))) if sound.any() else int(area.argmax())
        ears.append(corners[ear].tolist())
        rest = rest[:ear] + rest[ear + 1 :]
    return [*ears, rest]


def _areas(points: Floats, triangles: Ints, normal: Floats) -> Floats:
    """(n,) twice the areas of ``triangles`` (n, 3), positive where they run round ``normal``."""
    p = points[triangles]
    return np.asarray(vector_product(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) @ normal)
