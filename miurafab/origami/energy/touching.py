"""Facets that must not pass through each other: one-sided springs over two kinds of pairs.

A vertex w over a triangle (a, b, c), and an edge (p, q) over an edge (a, b), have a height d along
the unit normal n to two directions e_1, e_2: two sides of the triangle, or the two edges. The pair
has a side s = +-1. Nearer than h it is pushed off,

    E = 1/3 k g (h - s d)^3 / h   where s d < h,

which sets in without a jump of the stiffness. Two points stand over each other there, the vertex
and its foot, or the nearest points of both lines. With u the difference of their displacements, as
if both were fixed to their bodies, and m_1, m_2 the basis dual to e_1, e_2 in the plane,

    d d   = n.u
    d2 d  = -2 sum_i (n.de_i)(m_i.u) - d sum_ij (n.de_i)(n.de_j) m_i.m_j.

In d2 d^2 / 2 = (n.u)^2 + |v|^2 + 2 d n.(de_2 dt - de_1 ds) the points slide by ds, dt such that
v = u + e_2 dt - e_1 ds has v.e_i = -d n.de_i; so both kinds have the same form.

Which pairs there are, their sides and g: :mod:`miurafab.origami.energy.touch_pairs`. They belong to
the last accepted state and stay during an iteration, so the forces have an energy.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from miurafab.geometry.arrays import Bools, Floats, Ints, vector_product
from miurafab.origami.energy.equilibrium import Touch

HEIGHT = 0.02
"""h, in mean edges."""
STIFFNESS = 30.0
"""k, in k_f: 3,000 times that of a crease."""
_LEGS = np.array(
    [
        [[0.0, -1.0, 1.0, 0.0], [0.0, -1.0, 0.0, 1.0]],
        [[-1.0, 1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 1.0]],
    ]
)
"""e_i = sum _LEGS_ik x_k over the vertices of a pair of either kind."""


class TouchPairs(NamedTuple):
    """n pairs: their ``stencils`` (n, 4), a vertex and a triangle or two ``edges`` (n,), their
    ``side`` (n,) of +1 or -1, and the ``weight`` (n,) g of their springs.
    """

    stencils: Ints
    edges: Bools
    side: Floats
    weight: Floats

    def those(self, chosen: Bools | Ints) -> TouchPairs:
        """The pairs ``chosen``, as a mask (n,) or by number."""
        side, weight = self.side[chosen], self.weight[chosen]
        return TouchPairs(self.stencils[chosen], self.edges[chosen], side, weight)


NO_PAIRS = TouchPairs(
    np.empty((0, 4), dtype=np.int64), np.empty(0, dtype=bool), np.empty(0), np.empty(0)
)


class Over(NamedTuple):
    """How the points of n pairs stand over each other: the ``height`` (n,), the unit ``normal``
    (n, 3), e_1 and e_2 ``legs`` (n, 2, 3), the size of their vector product squared ``size2`` (n,),
    and the ``place`` (n, 2) of the points along e_1 and e_2, from 0 to 1.
    """

    height: Floats
    normal: Floats
    legs: Floats
    size2: Floats
    place: Floats


def over(points: Floats, stencils: Ints, edges: Bools) -> Over:
    """The heights of pairs at ``points`` (V, 3).

    Of a triangle the place is that of the foot, (beta, gamma); of two edges that on either edge.
    Parallel edges have no height: it is NaN.
    """
    w, a, b, c = (points[stencils[:, corner]] for corner in range(4))
    two = edges[:, None]
    first = np.where(two, a - w, b - a)
    second = np.where(two, c - b, c - a)
    apart = np.where(two, b - w, w - a)
    normal = vector_product(first, second)
    size2 = np.einsum("nk,nk->n", normal, normal)
    with np.errstate(invalid="ignore", divide="ignore"):
        unit = normal / np.sqrt(size2)[:, None]
        along = np.einsum("nk,nk->n", vector_product(apart, second), normal) / size2
        across = np.einsum("nk,nk->n", vector_product(first, apart), normal) / size2
    across = np.where(edges, -across, across)
    height = np.einsum("nk,nk->n", apart, unit)
    legs = np.stack([first, second], axis=1)
    return Over(height, unit, legs, size2, np.stack([along, across], axis=1))


def touch(
    points: Floats, pairs: TouchPairs, *, stiff: bool = True, definite: bool = False
) -> Touch:
    """The forces of those of ``pairs`` that touch at ``points`` (V, 3), and where ``stiff`` their
    stiffness.

    With ``definite`` the stiffness leaves out the curvature of the heights.
    """
    it = over(points, pairs.stencils, pairs.edges)
    near = HEIGHT - pairs.side * it.height
    live = np.flatnonzero((near > 0) & (pairs.weight > 0))
    it, pairs, near = Over(*(array[live] for array in it)), pairs.those(live), near[live]
    part = _parts(it, pairs.edges)
    gradient = part[:, :, None] * it.normal[:, None]
    k = STIFFNESS / HEIGHT * pairs.weight * near
    push = -(k * near * pairs.side)
    forces = push[:, None, None] * gradient
    if not stiff:
        return Touch(pairs.stencils, forces, np.empty((0, 4, 4, 3, 3)))
    outer = gradient[:, :, None, :, None] * gradient[:, None, :, None, :]
    stiffness = 2 * k[:, None, None, None, None] * outer
    if not definite:
        stiffness += push[:, None, None, None, None] * _curvature(it, pairs.edges, part)
    return Touch(pairs.stencils, forces, stiffness)


def touch_energy(points: Floats, pairs: TouchPairs) -> float:
    """The energy of the springs of ``pairs`` at ``points`` (V, 3)."""
    height = over(points, pairs.stencils, pairs.edges).height
    near = np.maximum(HEIGHT - pairs.side * height, 0.0)
    return STIFFNESS / (3 * HEIGHT) * float((pairs.weight * near**3).sum())


def _parts(it: Over, edges: Bools) -> Floats:
    """(n, 4) the parts of the vertices in u = sum part_k dx_k."""
    s, t = it.place.T
    one = np.ones(len(s))
    on_triangle = np.stack([one, s + t - 1, -s, -t], axis=1)
    on_edges = np.stack([s - 1, -s, 1 - t, t], axis=1)
    return np.where(edges[:, None], on_edges, on_triangle)


def _curvature(it: Over, edges: Bools, part: Floats) -> Floats:
    """(n, 4, 4, 3, 3) the Hessian of the heights, with m = sum_i e_i m_i by the vertices."""
    n, first, second = it.normal, it.legs[:, 0], it.legs[:, 1]
    normal = n * np.sqrt(it.size2)[:, None]
    dual = np.stack([vector_product(second, normal), vector_product(normal, first)], axis=1)
    dual /= it.size2[:, None, None]
    m = _LEGS[edges.astype(np.int64)].transpose(0, 2, 1) @ dual
    # -2 (n.de_i)(m_i.u) made symmetric, and -d (n.de_i)(n.de_j) m_i.m_j
    mixed = m[:, :, None, None, :] * n[:, None, None, :, None] * part[:, None, :, None, None]
    square = it.height[:, None, None] * (m @ m.transpose(0, 2, 1))
    across = n[:, None, None, :, None] * n[:, None, None, None, :]
    return -(mixed + mixed.transpose(0, 2, 1, 4, 3)) - square[..., None, None] * across
