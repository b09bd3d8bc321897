"""Facets that must not pass through each other: one-sided springs between vertices and triangles.

A vertex w stands over the plane of a triangle (a, b, c) at the height d, on the side s = +-1 that
is remembered from the last accepted state. Nearer than h it is pushed off,

    E = 1/3 k g (h - s d)^3 / h   where s d < h,

which sets in without a jump of the stiffness. With e_1 = b - a, e_2 = c - a, the unit normal n, the
coordinates beta, gamma of the foot of w along e_1 and e_2, and m_1, m_2 the basis dual to e_1, e_2
in the plane, over the vertices (w, a, b, c)

    d d   = n.u,     u = dw - (1 - beta - gamma) da - beta db - gamma dc
    d2 d  = -2 sum_i (n.de_i)(m_i.u) - d sum_ij (n.de_i)(n.de_j) m_i.m_j.

Facets of origami lie exactly on each other, so that vertices come down on sides and corners. The
triangle is therefore widened: g = 1 inside it, and falls to 0 at -``WIDENED`` in barycentric
coordinates. Sides, pairs and g belong to the last accepted state and stay during an iteration, so
the forces have an energy. A triangle and a vertex that sides join to two of its corners are kept
apart by the limit of the fold angle between them instead.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from miurafab.geometry.arrays import Bools, Floats, Ints, vector_product
from miurafab.origami.energy.equilibrium import Touch

HEIGHT = 0.02
"""h, in mean edges."""
STIFFNESS = 30.0
"""k, in k_f: 3,000 times that of a crease."""
WIDENED = 0.1
"""How far a triangle reaches beyond its sides, in barycentric coordinates."""
REACH = 0.35
"""Mean edges beyond its largest radius within which a triangle looks for vertices."""


class TouchPairs(NamedTuple):
    """n pairs: their ``stencils`` (n, 4), vertex and triangle, ``side`` (n,) of +1 or -1, and the
    ``weight`` (n,) g of their springs.
    """

    stencils: Ints
    side: Floats
    weight: Floats


NO_PAIRS = TouchPairs(np.empty((0, 4), dtype=np.int64), np.empty(0), np.empty(0))


def near_pairs(points: Floats, triangles: Ints, before: TouchPairs) -> TouchPairs:
    """The pairs within reach at ``points`` (V, 3), of vertices and ``triangles`` (T, 3).

    A pair that was known ``before`` keeps its side, and a new one has that on which it is: it came
    from beside the triangle, or from afar.
    """
    corners = points[triangles]
    centre = corners.mean(axis=1)
    radius = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
    reach = float(radius.max(initial=0.0)) + REACH
    found = cKDTree(points).sparse_distance_matrix(cKDTree(centre), reach, output_type="ndarray")
    vertex, triangle = found["i"].astype(np.int64), found["j"].astype(np.int64)
    order = np.lexsort((triangle, vertex))
    vertex, triangle = vertex[order], triangle[order]
    near = np.linalg.norm(points[vertex] - centre[triangle], axis=1) <= radius[triangle] + REACH
    vertex, triangle = vertex[near], triangle[near]
    apart = ~_neighbours(vertex, triangle, triangles, len(points))
    stencils = np.column_stack([vertex[apart], triangles[triangle[apart]]])
    height, inside = _place(points, stencils)
    weight = np.clip(1 + np.minimum(inside.min(axis=1), 0.0) / WIDENED, 0.0, 1.0)
    live = (weight > 0) & (np.abs(height) <= REACH)
    stencils, height, weight = stencils[live], height[live], weight[live]
    side = np.where(height < 0, -1.0, 1.0)
    if len(before.side):
        key, old = (_keys(each, len(points)) for each in (stencils, before.stencils))
        order = np.argsort(old)
        at = order[np.searchsorted(old, key, sorter=order).clip(max=len(old) - 1)]
        side = np.where(old[at] == key, before.side[at], side)
    return TouchPairs(stencils, side, weight)


def touch(points: Floats, pairs: TouchPairs, *, definite: bool = False) -> Touch:
    """The forces and stiffness of ``pairs`` at ``points`` (V, 3).

    With ``definite`` the stiffness leaves out the curvature of the heights.
    """
    height, inside = _place(points, pairs.stencils)
    over = np.maximum(HEIGHT - pairs.side * height, 0.0)
    live = np.flatnonzero((over > 0) & (pairs.weight > 0))
    forces = np.zeros((len(pairs.side), 4, 3))
    stiffness = np.zeros((len(pairs.side), 4, 4, 3, 3))
    gradient, hessian = _height_derivatives(
        points, pairs.stencils[live], height[live], inside[live]
    )
    k = STIFFNESS / HEIGHT * pairs.weight[live] * over[live]
    push = -(k * over[live] * pairs.side[live])
    forces[live] = push[:, None, None] * gradient
    outer = gradient[:, :, None, :, None] * gradient[:, None, :, None, :]
    stiffness[live] = 2 * k[:, None, None, None, None] * outer
    if not definite:
        stiffness[live] += push[:, None, None, None, None] * hessian
    return Touch(pairs.stencils, forces, stiffness)


def touch_energy(points: Floats, pairs: TouchPairs) -> float:
    """The energy of the springs of ``pairs`` at ``points`` (V, 3)."""
    height, _ = _place(points, pairs.stencils)
    over = np.maximum(HEIGHT - pairs.side * height, 0.0)
    return STIFFNESS / (3 * HEIGHT) * float((pairs.weight * over**3).sum())


def _keys(stencils: Ints, count: int) -> Ints:
    """A number for each pair: a triangle is known by its first two corners."""
    return (stencils[:, 0] * count + stencils[:, 1]) * count + stencils[:, 2]


def _neighbours(vertex: Ints, triangle: Ints, triangles: Ints, count: int) -> Bools:
    """(n,) whether the vertex is a corner of the triangle, or joined to two of them."""
    ends = np.stack([triangles, np.roll(triangles, 1, axis=1)]).reshape(2, -1)
    pairs = np.unique(np.concatenate([ends[0] * count + ends[1], ends[1] * count + ends[0]]))
    met = triangles[triangle] == vertex[:, None]
    key = vertex[:, None] * count + triangles[triangle]
    at = np.searchsorted(pairs, key).clip(max=len(pairs) - 1)
    return np.asarray(met.any(axis=1) | ((pairs[at] == key).sum(axis=1) >= 2))


def _place(points: Floats, stencils: Ints) -> tuple[Floats, Floats]:
    """The heights (n,) of the vertices over their planes, and the barycentric coordinates (n, 3) of
    their feet.
    """
    w, a, b, c = (points[stencils[:, corner]] for corner in range(4))
    first, second, up = b - a, c - a, w - a
    normal = vector_product(first, second)
    size2 = np.einsum("nk,nk->n", normal, normal)
    height = np.einsum("nk,nk->n", up, normal) / np.sqrt(size2)
    beta = np.einsum("nk,nk->n", vector_product(up, second), normal) / size2
    gamma = np.einsum("nk,nk->n", vector_product(first, up), normal) / size2
    return height, np.stack([1 - beta - gamma, beta, gamma], axis=1)


def _height_derivatives(
    points: Floats, stencils: Ints, height: Floats, inside: Floats
) -> tuple[Floats, Floats]:
    """The gradient (n, 4, 3) and Hessian (n, 4, 4, 3, 3) of the heights."""
    _, a, b, c = (points[stencils[:, corner]] for corner in range(4))
    first, second = b - a, c - a
    normal = vector_product(first, second)
    size2 = np.einsum("nk,nk->n", normal, normal)
    dual = np.stack([vector_product(second, normal), vector_product(normal, first)], axis=1)
    dual /= size2[:, None, None]
    n = normal / np.sqrt(size2)[:, None]
    part = np.concatenate([np.ones((len(n), 1)), -inside], axis=1)  # u = sum part_k dx_k
    gradient = part[:, :, None] * n[:, None]
    leg = np.array([[0.0, -1.0, 1.0, 0.0], [0.0, -1.0, 0.0, 1.0]])  # de_i = sum leg_ik dx_k
    # -2 (n.de_i)(m_i.u) made symmetric, and -d (n.de_i)(n.de_j) m_i.m_j
    mixed = np.einsum("ik,nx,nl,niy->nklxy", leg, n, part, dual)
    hessian = -(mixed + mixed.transpose(0, 2, 1, 4, 3))
    products = np.einsum("nix,njx->nij", dual, dual)
    square = np.einsum("nij,ik,jl,nx,ny->nklxy", products, leg, leg, n, n, optimize=True)
    return gradient, hessian - height[:, None, None, None, None] * square
