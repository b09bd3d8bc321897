"""Refinement: long edges of a triangle mesh are halved until none is longer than a limit.

A triangle with one, two or three halved edges becomes two, three or four triangles. Neighbours see
the same middle of a common edge, so the mesh stays whole.
"""

from __future__ import annotations

import numpy as np

from miurafab.errors import TargetError
from miurafab.geometry.arrays import Floats, Ints

_MOST_FACES = 100_000
"""A mesh gets fewer, or four times as many as it has, unless it is a strip that is thousands of
times as long as it is wide."""


def refine(vertices: Floats, faces: Ints, limit: float) -> tuple[Floats, Ints]:
    """The same surface with no edge longer than ``limit``; the first vertices are the old ones."""
    most = max(_MOST_FACES, 4 * len(faces))
    while True:
        count = len(vertices)
        tail, head = faces, np.roll(faces, -1, axis=1)
        keys = np.minimum(tail, head) * count + np.maximum(tail, head)
        unique, place = np.unique(keys, return_inverse=True)
        a, b = unique // count, unique % count
        long = np.linalg.norm(vertices[a] - vertices[b], axis=1) > limit
        if not long.any():
            return vertices, faces
        if len(faces) > most:
            raise TargetError("The mesh is too narrow for its length; cut it into shorter parts.")
        middle = np.full(len(unique), -1, dtype=np.int64)
        middle[long] = count + np.arange(int(long.sum()))
        vertices = np.concatenate([vertices, (vertices[a[long]] + vertices[b[long]]) / 2])
        faces = _split(vertices, faces, middle[place.reshape(-1, 3)])


def _split(vertices: Floats, faces: Ints, middle: Ints) -> Ints:
    """The triangles with ``middle`` (F, 3) the vertex on each side, or -1."""
    halved = (middle >= 0).sum(axis=1)
    # turn each triangle so that a single halved side, or a single whole one, comes first
    first = np.where(halved == 1, np.argmax(middle >= 0, axis=1), np.argmin(middle >= 0, axis=1))
    order = (first[:, None] + np.arange(3)) % 3
    faces, middle = (np.take_along_axis(x, order, axis=1) for x in (faces, middle))
    out = [faces[halved == 0]]
    a, b, c = faces[halved == 1].T
    m = middle[halved == 1, 0]
    out += [np.stack([a, m, c], axis=1), np.stack([m, b, c], axis=1)]
    a, b, c = faces[halved == 2].T
    m, n = middle[halved == 2, 1], middle[halved == 2, 2]
    # corner c is cut off; the shorter diagonal parts the rest
    across = np.linalg.norm(vertices[a] - vertices[m], axis=1) <= np.linalg.norm(
        vertices[b] - vertices[n], axis=1
    )
    out.append(np.stack([n, m, c], axis=1))
    out.append(np.stack([a, b, np.where(across, m, n)], axis=1))
    out.append(np.stack([np.where(across, a, b), m, n], axis=1))
    a, b, c = faces[halved == 3].T
    m, n, o = middle[halved == 3].T
    corners = ((a, m, o), (m, b, n), (o, n, c), (m, n, o))
    out += [np.stack(three, axis=1) for three in corners]
    return np.concatenate(out)
