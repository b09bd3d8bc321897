"""Rays and triangles: the first triangle that each of many rays meets.

The triangles are sorted along a curve that fills space (Morton order) and put into leaves of
eight. Over the leaves stands a binary tree of boxes. All pairs of ray and box that meet go down the
tree together, level by level; in the leaves each ray is compared with the triangles (Moller and
Trumbore, J. Graphics Tools 2, 1997).
"""

from __future__ import annotations

import numpy as np

from miurafab.geometry.arrays import Floats, Ints, vector_product

_LEAF = 8
_AT_ONCE = 4096
"""Rays that go down the tree together."""


def first_hits(starts: Floats, directions: Floats, triangles: Floats) -> tuple[Floats, Ints]:
    """The distance (n,) to the first of ``triangles`` (T, 3, 3) on each ray, inf for none, and its
    index (n,), -1 for none. ``directions`` (n, 3) have the length one.
    """
    order = _morton_order(triangles.mean(axis=1))
    levels = max(int(np.ceil(np.log2(max(len(order) / _LEAF, 1)))), 0)
    slots = np.full(_LEAF << levels, -1, dtype=np.int64)
    slots[: len(order)] = order
    boxes = _boxes(triangles, slots, levels)
    distance = np.full(len(starts), np.inf)
    hit = np.full(len(starts), -1, dtype=np.int64)
    for first in range(0, len(starts), _AT_ONCE):
        some = slice(first, min(first + _AT_ONCE, len(starts)))
        ray, leaf = _leaves(starts[some], directions[some], boxes)
        triangle = slots.reshape(-1, _LEAF)[leaf].ravel()
        ray = np.repeat(ray, _LEAF)[triangle >= 0]
        triangle = triangle[triangle >= 0]
        t = _meet(starts[some][ray], directions[some][ray], triangles[triangle])
        met = np.isfinite(t)
        ray, triangle, t = ray[met], triangle[met], t[met]
        nearest = np.lexsort((triangle, t, ray))
        ray, triangle, t = ray[nearest], triangle[nearest], t[nearest]
        one, at = np.unique(ray, return_index=True)
        distance[first + one], hit[first + one] = t[at], triangle[at]
    return distance, hit


def _morton_order(points: Floats) -> Ints:
    low, size = points.min(axis=0), max(float(np.ptp(points, axis=0).max()), 1e-300)
    cell = np.minimum((points - low) / size * 1024, 1023).astype(np.int64)
    code = np.zeros(len(points), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


def _boxes(triangles: Floats, slots: Ints, levels: int) -> list[tuple[Floats, Floats]]:
    """The boxes (low, high) of each level, the root first; an empty slot has an empty box."""
    corners = triangles[slots]
    empty = (slots < 0)[:, None]
    low = np.where(empty, np.inf, corners.min(axis=1)).reshape(-1, _LEAF, 3).min(axis=1)
    high = np.where(empty, -np.inf, corners.max(axis=1)).reshape(-1, _LEAF, 3).max(axis=1)
    boxes = [(low, high)]
    for _ in range(levels):
        low, high = low.reshape(-1, 2, 3).min(axis=1), high.reshape(-1, 2, 3).max(axis=1)
        boxes.append((low, high))
    return boxes[::-1]


def _leaves(
    starts: Floats, directions: Floats, boxes: list[tuple[Floats, Floats]]
) -> tuple[Ints, Ints]:
    """The pairs of ray and leaf whose box the ray meets."""
    ray, node = np.arange(len(starts)), np.zeros(len(starts), dtype=np.int64)
    # a direction of zero stands for a very small one, so that no product is 0 * inf
    inverse = 1 / np.where(np.abs(directions) < 1e-150, 1e-150, directions)
    for level, (low, high) in enumerate(boxes):
        if level:
            ray, node = np.repeat(ray, 2), np.repeat(2 * node, 2)
            node[1::2] += 1
        with np.errstate(invalid="ignore", over="ignore"):
            a = (low[node] - starts[ray]) * inverse[ray]
            b = (high[node] - starts[ray]) * inverse[ray]
            near = np.minimum(a, b).max(axis=1)
            far = np.maximum(a, b).min(axis=1)
        # an empty box has low > high and is never met
        meets = (near <= far) & (far >= 0) & (low[node, 0] <= high[node, 0])
        ray, node = ray[meets], node[meets]
    return ray, node


def _meet(starts: Floats, directions: Floats, triangles: Floats) -> Floats:
    """(n,) where each ray meets its triangle, inf where it does not."""
    a = triangles[:, 0]
    e1, e2 = triangles[:, 1] - a, triangles[:, 2] - a
    p = vector_product(directions, e2)
    det = np.einsum("nk,nk->n", e1, p)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = starts - a
        u = np.einsum("nk,nk->n", s, p) / det
        q = vector_product(s, e1)
        v = np.einsum("nk,nk->n", directions, q) / det
        t = np.einsum("nk,nk->n", e2, q) / det
        # the sides belong to both triangles, so that no ray slips between them
        inside = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (t >= 0) & np.isfinite(t)
    return np.where(inside, t, np.inf)
