"""Welds: borders of a mesh that should meet and do not quite.

Patches that were meshed apart leave gaps of the size of a rounding error. Two steps close them:

- vertices of borders that lie nearer together than a tolerance become one vertex, in their middle;
- where a border vertex lies on the inside of a border edge, as near, the triangle of that edge is
  split there.

Inner vertices stay where they are, so fine detail is not lost.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.connected import components
from miurafab.geometry.nearest import tree_of
from miurafab.surfaces.topology import edges_of

WELD = 1e-5
"""Borders are welded over gaps of up to this part of the mesh's size. Patches in single precision
lie 1e-7 to 1e-6 of the size apart."""

SHORT = 0.25
"""No weld is wider than this part of the shortest border edge at either vertex."""

_ROUNDS = 8


def weld(vertices: Floats, faces: Ints) -> tuple[Floats, Ints, int, float]:
    """The mesh with its borders welded, the number of vertices welded, and the widest gap."""
    size = float(np.ptp(vertices, axis=0).max())
    vertices, faces, welded, widest = _joined(vertices, faces, WELD * size)
    for _ in range(_ROUNDS):
        split, count, gap = _split(vertices, faces, WELD * size)
        if not count:
            break
        faces, welded, widest = split, welded + count, max(widest, gap)
    return vertices, faces, welded, widest


def _border(faces: Ints) -> Ints:
    edges, uses = edges_of(faces)
    border: Ints = edges[uses == 1]
    return border


def _joined(vertices: Floats, faces: Ints, reach: float) -> tuple[Floats, Ints, int, float]:
    border = _border(faces)
    if not len(border):
        return vertices, faces, 0, 0.0
    rim = np.unique(border)
    lengths = np.linalg.norm(vertices[border[:, 1]] - vertices[border[:, 0]], axis=1)
    shortest = np.full(len(vertices), np.inf)
    np.minimum.at(shortest, border, lengths[:, None])
    a, b = rim[tree_of(vertices[rim]).query_pairs(reach, output_type="ndarray")].T
    gap = np.linalg.norm(vertices[b] - vertices[a], axis=1)
    close = gap <= SHORT * np.minimum(shortest[a], shortest[b])
    a, b, gap = a[close], b[close], gap[close]
    if not len(a):
        return vertices, faces, 0, 0.0
    label = components(len(vertices), a, b)
    members = np.bincount(label)
    middle = np.stack([np.bincount(label, vertices[:, k]) for k in range(3)], axis=1)
    _, first = np.unique(label, return_index=True)
    alone = members == 1
    points = np.where(alone[:, None], vertices[first], middle / members[:, None])
    faces = label.astype(np.int64)[faces]
    faces = faces[(np.diff(np.sort(faces, axis=1), axis=1) > 0).all(axis=1)]
    return points, faces, len(vertices) - len(members), float(gap.max())


def _split(vertices: Floats, faces: Ints, reach: float) -> tuple[Ints, int, float]:
    """The triangles, of those at borders one for each vertex that lies on their border edge."""
    sides = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    key = np.sort(sides, axis=1) @ np.array([len(vertices), 1])
    _, inverse, uses = np.unique(key, return_inverse=True, return_counts=True)
    open_sides = np.flatnonzero(uses[inverse.reshape(-1)] == 1)
    if not len(open_sides):
        return faces, 0, 0.0
    rim = np.unique(_border(faces))
    start, end = vertices[sides[open_sides, 0]], vertices[sides[open_sides, 1]]
    along = end - start
    length = np.linalg.norm(along, axis=1)
    near = tree_of(vertices[rim]).query_ball_point((start + end) / 2, length / 2 + reach)
    counts = np.array([len(found) for found in near])
    side = np.repeat(np.arange(len(open_sides)), counts)
    vertex = rim[np.concatenate([np.asarray(found, dtype=np.int64) for found in near])]
    offset = vertices[vertex] - start[side]
    part = np.einsum("nk,nk->n", offset, along[side]) / length[side] ** 2
    gap = np.linalg.norm(offset - part[:, None] * along[side], axis=1)
    inside = np.minimum(part, 1 - part) * length[side] > np.maximum(reach, 1e-3 * length[side])
    on = inside & (gap <= reach)
    if not on.any():
        return faces, 0, 0.0
    new, dropped, welded = [], [], 0
    split = np.unique(side[on])
    # one side of a triangle in each round
    for n in split[np.unique(open_sides[split] // 3, return_index=True)[1]].tolist():
        here = np.flatnonzero(on & (side == n))
        between = vertex[here[np.argsort(part[here])]].tolist()
        triangle, corner = divmod(int(open_sides[n]), 3)
        a, b, c = np.roll(faces[triangle], -corner).tolist()
        path = [a, *between, b]
        new += [[p, q, c] for p, q in pairwise(path)]
        dropped.append(triangle)
        welded += len(between)
    kept = np.delete(faces, dropped, axis=0)
    return (
        np.concatenate([kept, np.array(new, dtype=np.int64)]),
        welded,
        float(gap[on].max()),
    )
