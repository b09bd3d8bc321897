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

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.origami.energy.assembly import Touch

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

_SLOPES: Floats = np.expand_dims(
    [[[0.0, 1, -1, 0], [0, 1, 0, -1]], [[1, -1, 0, 0], [0, 0, -1, 1]]], -1
)
"""The slopes of the parts, of a vertex over a triangle and of edges that cross."""
_SIDES: Floats = np.array(
    [
        [
            [[1.0, -1, 0, 0], [1, 0, -1, 0], [1, 0, 0, -1], [1, 0, 0, -1]],
            [[0, 1, -1, 0], [0, 0, 1, -1], [0, -1, 0, 1], [0, -1, 0, 1]],
        ],
        [
            [[-1.0, 0, 1, 0], [0, -1, 1, 0], [-1, 0, 1, 0], [-1, 0, 0, 1]],
            [[0, 0, -1, 1], [0, 0, -1, 1], [1, -1, 0, 0], [1, -1, 0, 0]],
        ],
    ]
)
"""The bases and slopes with one place: a vertex and a side, the third of which stands twice, and an
end of an edge and the other edge.
"""


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
        own = _corners(moves, self.stencils)
        own -= own.sum(axis=1, keepdims=True) / 4
        far = np.sqrt(_dot(own, own))
        other = np.maximum(far[2], far[3])
        one = np.where(self.edges, np.maximum(far[0], far[1]), np.maximum(far[1], other))
        return np.asarray(np.where(self.edges, other, far[0]) + one)

    def nearer_than(self, within: Floats | float, points: Floats) -> tuple[Ints, Gap]:
        """The numbers of the pairs nearer than ``within`` at ``points`` (V, 3), and their gaps."""
        moves = points - self.seen
        may = np.flatnonzero(self.distance - most_closing(moves) < within)
        if not len(may):
            return may, NO_GAP
        pairs = self.those(may)
        limit = within[may] if isinstance(within, np.ndarray) else within
        near = np.flatnonzero(pairs.distance - pairs.closing(moves) < limit)
        may = may[near]
        it = gaps(points, pairs.stencils[near], pairs.edges[near])
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


def most_closing(moves: Floats) -> float:
    """By how much ``moves`` (V, 3) of the vertices can bring any pair nearer, at most."""
    apart = moves - moves.mean(axis=0)
    # a mean of four vertices is within this of the mean of all, and each is within 3/2 of it
    return 3 * math.sqrt(float(np.einsum("vx,vx->v", apart, apart).max(initial=0.0)))


def gaps(points: Floats, stencils: Ints, edges: Bools) -> Gap:
    """The nearest points of pairs at ``points`` (V, 3)."""
    return _gaps(_corners(points, stencils), edges)


def _gaps(x: Floats, edges: Bools) -> Gap:
    """The nearest points of pairs with the corners ``x`` (3, 4, n)."""
    count = x.shape[2]
    if not count:
        return NO_GAP
    u = np.where(edges, x[:, 2] - x[:, 0], x[:, 0] - x[:, 1])
    first = np.where(edges, x[:, 0], x[:, 1]) - np.where(edges, x[:, 1], x[:, 2])
    second = np.where(edges, x[:, 3] - x[:, 2], x[:, 1] - x[:, 3])
    d11, d12, d22 = _dot(first, first), _dot(first, second), _dot(second, second)
    p1, p2 = _dot(u, first), _dot(u, second)
    det = d11 * d22 - d12 * d12
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        s, t = (d12 * p2 - d22 * p1) / det, (d12 * p1 - d11 * p2) / det
        last = 1 - np.where(edges, np.maximum(s, t), s + t)
        free = (det > SLENDER * d11 * d22) & (np.minimum(np.minimum(s, t), last) > 0)
    s, t = np.where(free, s, 0.0), np.where(free, t, 0.0)
    part = np.stack(
        [
            np.where(edges, s - 1, 1.0),
            np.where(edges, -s, s + t - 1),
            np.where(edges, 1 - t, -s),
            np.where(edges, t, -t),
        ]
    )
    slope = np.where(edges, _SLOPES[1], _SLOPES[0]) * free
    rest = np.flatnonzero(~free)
    if len(rest):
        part[:, rest], slope[0][:, rest] = _on_sides(x[..., rest], edges[rest])
    direction = (part * x).sum(axis=1)
    distance = np.sqrt(_dot(direction, direction))
    return Gap(distance, direction.T, part.T, slope.transpose(2, 0, 1))


def _on_sides(x: Floats, edges: Bools) -> tuple[Floats, Floats]:
    """The parts (4, n) of pairs with corners ``x`` (3, 4, n) whose nearest points have one place or
    none, and its slopes (4, n); zero where it ends at a corner.
    """
    u, along = (np.where(edges, _SIDES[1, k] @ x, _SIDES[0, k] @ x) for k in (0, 1))
    with np.errstate(invalid="ignore", divide="ignore"):
        at = np.clip(-_dot(u, along) / _dot(along, along), 0.0, 1.0)
    u += at * along
    side = np.argmin(_dot(u, u), axis=0)
    place = at[side, np.arange(len(side))]
    kind = edges.astype(np.int64)
    base, slope = (_SIDES[kind, k, side].T for k in (0, 1))
    return base + slope * place, slope * ((place > 0) & (place < 1))


def touch(
    points: Floats, pairs: TouchPairs, *, stiff: bool = True, definite: bool = False
) -> Touch:
    """The forces of those of ``pairs`` that touch at ``points`` (V, 3), and where ``stiff`` their
    stiffness.

    With ``definite`` the stiffness leaves out the curvature of the distances.
    """
    soon = pairs.stencils
    live, it = pairs.touching(points)
    pairs = pairs.those(live)
    normal = it.direction / it.distance[:, None]
    gradient = it.part[:, :, None] * normal[:, None]
    push, slope = spring_slopes(it.distance, pairs.height, STIFFNESS * pairs.weight)
    forces = push[:, None, None] * gradient
    if not stiff:
        return Touch(pairs.stencils, forces, np.empty((0, 4, 4, 3, 3)), soon)
    outer = gradient[:, :, None, :, None] * gradient[:, None, :, None, :]
    stiffness = slope[:, None, None, None, None] * outer
    if not definite:
        curved = _curvature(points[pairs.stencils], it, normal)
        stiffness += push[:, None, None, None, None] * curved
    return Touch(pairs.stencils, forces, stiffness, soon)


def touch_energy(points: Floats, pairs: TouchPairs) -> float:
    """The energy of the springs of ``pairs`` at ``points`` (V, 3)."""
    live, it = pairs.touching(points)
    springs = spring_energies(it.distance, pairs.height[live], pairs.weight[live])
    return STIFFNESS * float(springs.sum())


def spring_energies(d: Floats, h: Floats, k: Floats) -> Floats:
    """k (h - d)^2 log(h / d) of springs at the distances ``d`` (n,), and 0 beyond ``h`` (n,)."""
    return np.asarray(k * np.maximum(h - d, 0.0) ** 2 * np.log(np.maximum(h / d, 1.0)))


def spring_slopes(d: Floats, h: Floats, k: Floats) -> tuple[Floats, Floats]:
    """The first and the second derivatives of :func:`spring_energies` by the distances."""
    near, log = np.maximum(h - d, 0.0), np.log(np.maximum(h / d, 1.0))
    return -k * near * (2 * log + near / d), k * (2 * log + (4 + near / d) * near / d)


def _curvature(corners: Floats, it: Gap, normal: Floats) -> Floats:
    """(n, 4, 4, 3, 3) the Hessian of the distances."""
    legs = it.slopes @ corners
    c = it.part[:, :, None, None] * legs[:, None]
    c += it.slopes.transpose(0, 2, 1)[..., None] * it.direction[:, None, None]
    slid = c.transpose(0, 1, 3, 2).reshape(-1, 12, 2)
    square = legs @ legs.transpose(0, 2, 1)
    for place in (0, 1):  # one that is not free does not slide
        square[:, place, place] += ~it.slopes[:, place].any(axis=1)
    adjoint = np.empty_like(square)
    adjoint[:, 0, 0], adjoint[:, 1, 1] = square[:, 1, 1], square[:, 0, 0]
    adjoint[:, 0, 1] = adjoint[:, 1, 0] = -square[:, 0, 1]
    adjoint /= (square[:, 0, 0] * square[:, 1, 1] - square[:, 0, 1] ** 2)[:, None, None]
    across = np.eye(3) - normal[:, :, None] * normal[:, None, :]
    parts = it.part[:, :, None] * it.part[:, None, :]
    curved = parts[..., None, None] * across[:, None, None]
    sliding = slid @ adjoint @ slid.transpose(0, 2, 1)
    curved -= sliding.reshape(-1, 4, 3, 4, 3).swapaxes(2, 3)
    return np.asarray(curved / it.distance[:, None, None, None, None])


def free_way(points: Floats, step: Floats, pairs: TouchPairs) -> float:
    """The part of the ``step`` (V, 3) from ``points`` (V, 3), at most 1, on which all ``pairs``
    keep a fifth of their distance.

    Each pair is followed by conservative advancement, from one time to the next up to which it is
    certain to stay apart.
    """
    moves = points - pairs.seen
    kept = NEARER * (1 - LEFT)
    pairs = pairs.those(kept * (pairs.distance - most_closing(moves)) < most_closing(step))
    speed = pairs.closing(step)
    may = np.flatnonzero(kept * (pairs.distance - pairs.closing(moves)) < speed)
    if not len(may):
        return 1.0
    edges, speed, at, least = pairs.edges[may], speed[may], np.zeros(len(may)), 1.0
    start, going = (_corners(each, pairs.stencils[may]) for each in (points, step))
    it = _gaps(start, edges)
    left = np.maximum(LEFT * it.distance, np.minimum(it.distance, CLOSEST))
    for _ in range(LOOKS):
        at = at + NEARER * _free_time(start + at * going, going, it, left, edges, speed)
        on = np.flatnonzero(at < least)
        if not len(on):
            return least
        at, left, edges, speed = at[on], left[on], edges[on], speed[on]
        start, going = start[..., on], going[..., on]
        it = _gaps(start + at * going, edges)
        ended = it.distance <= 1.5 * left
        least = min(least, float(at[ended].min(initial=least)))
    return min(least, float(at.min()))


def _free_time(
    x: Floats, going: Floats, it: Gap, left: Floats, edges: Bools, fastest: Floats
) -> Floats:
    """(n,) how long pairs with corners ``x`` (3, 4, n), which move by ``going`` (3, 4, n) in the
    time 1 and so come nearer by ``fastest`` (n,) at most, certainly stay farther from each other
    than ``left`` (n,).

    A pair is never nearer than its corners are along any one direction. Along that of its distance
    they are just as far, but for the rounding of a direction between edges that are nearly
    parallel; so the time in which they could come that near in any way counts where it is longer.
    """
    normal = (it.direction / it.distance[:, None]).T[:, None]
    far, fast = ((normal * each).sum(axis=0) for each in (x, going))
    apart, speed = (
        np.where(edges, each[[2, 2, 3, 3]] - each[[0, 1, 0, 1]], each[0] - each[[1, 2, 3, 3]])
        for each in (far, fast)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        time = np.where(speed < 0, (apart - left) / -speed, np.where(apart < left, 0.0, np.inf))
        anyhow = (it.distance - left) / fastest
    time = np.maximum(time.min(axis=0), np.maximum(anyhow, 0.0))
    return np.asarray(np.where(it.distance > CLOSEST, time, 0.0))


def _corners(points: Floats, stencils: Ints) -> Floats:
    """(3, 4, n) the coordinates of the ``stencils`` (n, 4) among ``points`` (V, 3)."""
    return np.ascontiguousarray(points.T).take(stencils.T, axis=1)


def _dot(a: Floats, b: Floats) -> Floats:
    """The products of ``a`` and ``b`` (3, ...), over the first axis."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
