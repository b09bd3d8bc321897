"""Facets that must not pass through each other: springs between things that come near each other.

A pair is a vertex w and a triangle (a, b, c), or an edge (p, q) and an edge (a, b). Its distance d
is that of their nearest points, the difference of which is a sum over its four vertices,

    u = sum part_k x_k,   d = |u|,   part = base + sum_i theta_i slope_i,

with places theta_i on a side, on an edge or in the triangle where the nearest points are free to
slide, and none at a corner. Nearer than h the pair is pushed apart,

    E = k g (h - d)^2 log(h / d)   where d < h,

which sets in without a jump of the stiffness and grows without bound, so that a soft spring can
hold whatever leans on it (a barrier after M. Li et al., Incremental potential contact, ACM Trans.
Graph. 39 (2020)). As theta is where d is least, it drops out of the first derivative. With
n = u / d, J_i = sum_k slope_ik x_k and C_ki = part_k J_i + slope_ik u,

    d d / d x_k       = part_k n
    d2 d / d x_k d x_l = (part_k part_l (1 - n n') - sum_ij C_ki (J'J)^-1_ij C_lj') / d.

Which pairs there are, their h and g: :mod:`miurafab.origami.energy.touch_pairs`. They stay during
an iteration, so the forces have an energy. :func:`free_way` tells how far a step may go before
something would pass through something else, so that nothing ever does.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.origami.energy.equilibrium import Touch

HEIGHT = 0.02
"""h, in mean edges."""
STIFFNESS = 0.3
"""k, in k_f: 30 times that of a crease."""
CLOSEST = 1e-5
"""Mean edges; what is nearer does not move. It is more than facets may overlap where they touch."""
SLENDER = 1e-12
"""Edges whose angle has a smaller squared sine are parallel."""
NEARER, LEFT, LOOKS = 0.9, 0.2, 40
"""Of a way: the part of what is certainly free that is gone before the next look, the part of the
distance that has to be left, and the most looks."""

_INSIDE = np.array(
    [
        [[1.0, -1, 0, 0], [0, 1, -1, 0], [0, 1, 0, -1]],
        [[-1.0, 0, 1, 0], [1, -1, 0, 0], [0, 0, -1, 1]],
    ]
)
"""The base and both slopes of the parts, of a vertex over a triangle and of edges that cross."""
_SIDES = (
    np.array([[[1.0, -1, 0, 0], [1, 0, -1, 0], [1, 0, 0, -1]]] * 2),
    np.array([[[-1.0, 0, 1, 0], [0, -1, 1, 0], [-1, 0, 1, 0], [-1, 0, 0, 1]]] * 2),
)
_SIDES[0][1] = [[0, 1, -1, 0], [0, 0, 1, -1], [0, -1, 0, 1]]
_SIDES[1][1] = [[0, 0, -1, 1], [0, 0, -1, 1], [1, -1, 0, 0], [1, -1, 0, 0]]
"""The bases and slopes with one place: a vertex and a side, or an end of an edge and the other."""


class Gap(NamedTuple):
    """The nearest points of n pairs: their ``distance`` (n,), its ``direction`` u (n, 3), the
    ``part`` (n, 4) of each vertex in it, and the ``slopes`` (n, 2, 4) of the parts by the places
    that are free; zero for those that are not.
    """

    distance: Floats
    direction: Floats
    part: Floats
    slopes: Floats


NO_GAP = Gap(np.empty(0), np.empty((0, 3)), np.empty((0, 4)), np.empty((0, 2, 4)))


@dataclass(frozen=True, eq=False)
class TouchPairs:
    """n pairs: their ``stencils`` (n, 4), a vertex and a triangle or two ``edges`` (n,), and the
    ``height`` (n,) h and ``weight`` (n,) g of their springs. At the points ``seen`` (V, 3) they
    have the ``distance`` (n,).

    It keeps what it found at the points that it was last asked for, which are the same for forces,
    stiffness and energy.
    """

    stencils: Ints
    edges: Bools
    height: Floats
    weight: Floats
    seen: Floats
    distance: Floats
    _last: list[tuple[Floats, Ints, Gap]] = field(default_factory=list)

    def those(self, chosen: Bools | Ints) -> TouchPairs:
        """The pairs ``chosen``, as a mask (n,) or by number."""
        return TouchPairs(
            self.stencils[chosen],
            self.edges[chosen],
            self.height[chosen],
            self.weight[chosen],
            self.seen,
            self.distance[chosen],
        )

    def closing(self, moves: Floats) -> Floats:
        """(n,) by how much ``moves`` (V, 3) of the vertices can bring pairs nearer, at most."""
        own = moves[self.stencils]
        own = own - own.mean(axis=1, keepdims=True)
        far = np.sqrt(np.einsum("nck,nck->nc", own, own))
        other = np.maximum(far[:, 2], far[:, 3])
        on_edges = np.maximum(far[:, 0], far[:, 1]) + other
        return np.asarray(np.where(self.edges, on_edges, far[:, 0] + np.maximum(far[:, 1], other)))

    def nearer_than(self, within: Floats | float, points: Floats) -> tuple[Ints, Gap]:
        """The numbers of the pairs nearer than ``within`` at ``points`` (V, 3), and their gaps."""
        if not len(self.edges):
            return np.empty(0, dtype=np.int64), NO_GAP
        may = np.flatnonzero(self.distance - self.closing(points - self.seen) < within)
        it = gaps(points, self.stencils[may], self.edges[may])
        limit = within[may] if isinstance(within, np.ndarray) else within
        live = np.flatnonzero(it.distance < limit)
        return may[live], Gap(*(array[live] for array in it))

    def touching(self, points: Floats) -> tuple[Ints, Gap]:
        """The numbers of the pairs nearer than h at ``points`` (V, 3), and their gaps."""
        if not self._last or self._last[0][0] is not points:
            self._last[:] = [(points, *self.nearer_than(self.height, points))]
        return self._last[0][1:]


NO_PAIRS = TouchPairs(
    np.empty((0, 4), dtype=np.int64),
    np.empty(0, dtype=bool),
    np.empty(0),
    np.empty(0),
    np.zeros((1, 3)),
    np.empty(0),
)


def gaps(points: Floats, stencils: Ints, edges: Bools) -> Gap:
    """The nearest points of pairs at ``points`` (V, 3)."""
    corners = points[stencils]
    crossing = len(edges) - int(edges.sum())  # vertices and triangles stand first
    parts = (_gaps(corners[:crossing], 0), _gaps(corners[crossing:], 1))
    return Gap(*(np.concatenate(both) for both in zip(*parts, strict=True)))


def _gaps(corners: Floats, kind: int) -> Gap:
    """The nearest points of pairs of one kind with ``corners`` (n, 4, 3)."""
    count = len(corners)
    if not count:
        return NO_GAP
    x = corners.transpose(1, 2, 0).reshape(4, -1)  # coordinates in rows
    base, slopes = _INSIDE[kind][0], _INSIDE[kind][1:]
    u, first, second = (_INSIDE[kind] @ x).reshape(3, 3, count)
    d11, d12, d22 = _dot(first, first), _dot(first, second), _dot(second, second)
    p1, p2 = _dot(u, first), _dot(u, second)
    det = d11 * d22 - d12 * d12
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        s, t = (d12 * p2 - d22 * p1) / det, (d12 * p1 - d11 * p2) / det
        least = np.minimum(s, t)
        last = 1 - (np.maximum(s, t) if kind else s + t)
        free = (det > SLENDER * d11 * d22) & (np.minimum(least, last) > 0)
    s, t = np.where(free, s, 0.0), np.where(free, t, 0.0)
    part = base[:, None] + slopes[0][:, None] * s + slopes[1][:, None] * t
    slope = np.where(free, slopes[:, :, None], 0.0)
    rest = np.flatnonzero(~free)
    if len(rest):
        own = x.reshape(4, 3, count)[..., rest].reshape(4, -1)
        part[:, rest], slope[0][:, rest] = _on_sides(own, len(rest), kind)
    direction = np.einsum("kn,kxn->nx", part, x.reshape(4, 3, count))
    distance = np.sqrt(np.einsum("nx,nx->n", direction, direction))
    return Gap(distance, direction, part.T, slope.transpose(2, 0, 1))


def _on_sides(x: Floats, count: int, kind: int) -> tuple[Floats, Floats]:
    """The parts (4, n) of pairs with corners ``x`` (4, 3 n) whose nearest points have one place or
    none, and its slopes (4, n); zero where it ends at a corner.
    """
    bases, slopes = _SIDES[kind]
    u, along = (bases @ x).reshape(-1, 3, count), (slopes @ x).reshape(-1, 3, count)
    with np.errstate(invalid="ignore", divide="ignore"):
        at = np.clip(-(u * along).sum(axis=1) / (along * along).sum(axis=1), 0.0, 1.0)
    u += at[:, None] * along
    side = np.argmin((u * u).sum(axis=1), axis=0)
    place = at[side, np.arange(count)]
    slope = slopes[side].T
    return bases[side].T + slope * place, slope * ((place > 0) & (place < 1))


def touch(
    points: Floats, pairs: TouchPairs, *, stiff: bool = True, definite: bool = False
) -> Touch:
    """The forces of those of ``pairs`` that touch at ``points`` (V, 3), and where ``stiff`` their
    stiffness.

    With ``definite`` the stiffness leaves out the curvature of the distances.
    """
    live, it = pairs.touching(points)
    pairs = pairs.those(live)
    normal = it.direction / it.distance[:, None]
    gradient = it.part[:, :, None] * normal[:, None]
    d, h = it.distance, pairs.height
    near, log = h - d, np.log(h / d)
    push = -STIFFNESS * pairs.weight * near * (2 * log + near / d)
    slope = STIFFNESS * pairs.weight * (2 * log + (4 + near / d) * near / d)
    forces = push[:, None, None] * gradient
    if not stiff:
        return Touch(pairs.stencils, forces, np.empty((0, 4, 4, 3, 3)))
    outer = gradient[:, :, None, :, None] * gradient[:, None, :, None, :]
    stiffness = slope[:, None, None, None, None] * outer
    if not definite:
        curved = _curvature(points[pairs.stencils], it, normal)
        stiffness += push[:, None, None, None, None] * curved
    return Touch(pairs.stencils, forces, stiffness)


def touch_energy(points: Floats, pairs: TouchPairs) -> float:
    """The energy of the springs of ``pairs`` at ``points`` (V, 3)."""
    live, it = pairs.touching(points)
    h = pairs.height[live]
    springs = pairs.weight[live] * (h - it.distance) ** 2 * np.log(h / it.distance)
    return STIFFNESS * float(springs.sum())


def _curvature(corners: Floats, it: Gap, normal: Floats) -> Floats:
    """(n, 4, 4, 3, 3) the Hessian of the distances."""
    legs = it.slopes @ corners
    c = it.part[:, :, None, None] * legs[:, None]
    c += it.slopes.transpose(0, 2, 1)[..., None] * it.direction[:, None, None]
    square = legs @ legs.transpose(0, 2, 1)
    for place in (0, 1):  # one that is not free does not slide
        square[:, place, place] += ~it.slopes[:, place].any(axis=1)
    slid = np.linalg.solve(square[:, None], c)
    across = np.eye(3) - normal[:, :, None] * normal[:, None, :]
    parts = it.part[:, :, None] * it.part[:, None, :]
    curved = parts[..., None, None] * across[:, None, None]
    curved -= np.einsum("nkix,nliy->nklxy", c, slid)
    return np.asarray(curved / it.distance[:, None, None, None, None])


def free_way(points: Floats, step: Floats, pairs: TouchPairs) -> float:
    """The part of the ``step`` (V, 3) from ``points`` (V, 3), at most 1, on which all ``pairs``
    keep a fifth of their distance.

    Each pair is followed by conservative advancement: it cannot come nearer by more than its
    vertices move beyond their mean.
    """
    certain = pairs.distance - pairs.closing(points - pairs.seen)
    speed = pairs.closing(step)
    may = np.flatnonzero(NEARER * (1 - LEFT) * certain < speed)
    if not len(may):
        return 1.0
    pairs, speed = pairs.those(may), speed[may]
    distance = gaps(points, pairs.stencils, pairs.edges).distance
    left = np.maximum(LEFT * distance, np.minimum(distance, CLOSEST))
    at, least = np.zeros(len(speed)), 1.0
    for _ in range(LOOKS):
        with np.errstate(divide="ignore"):  # what does not move comes no nearer
            at = at + NEARER * np.maximum(distance - left, 0.0) / speed
        going = np.flatnonzero(at < least)
        if not len(going):
            return least
        at, speed, left, pairs = at[going], speed[going], left[going], pairs.those(going)
        corners = points[pairs.stencils] + at[:, None, None] * step[pairs.stencils]
        numbers = np.arange(4 * len(at)).reshape(-1, 4)
        distance = gaps(corners.reshape(-1, 3), numbers, pairs.edges).distance
        ended = distance <= 1.5 * left
        least = min(least, float(at[ended].min(initial=least)))
    return min(least, float(at.min()))


def _dot(a: Floats, b: Floats) -> Floats:
    """(n,) the products of the columns of ``a`` and ``b`` (3, n)."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
