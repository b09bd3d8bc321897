"""The route over creases with little travel, as a postman problem.

Creases are the edges of a graph whose nodes are pattern vertices. Passing from a crease to the next
at a node costs no travel. The route starts at a given point and may end anywhere; this is a closed
tour with an additional edge from a node at distance 0 from every place to the starting point. A
closed tour without travel exists if the graph is connected and every node has an even degree. So
travel legs are added:

1. The odd nodes are matched in pairs of little total length. The assignment problem (every node is
   assigned another node) is a relaxation of matching: half its value is a lower bound. Its cycles
   of even length split into two matchings, and the shorter is taken. One node of each odd cycle is
   left and assigned again. Finally pairs of legs are exchanged while this shortens them.
2. Components that are still apart are joined by exchanging two legs ab, cd for ac, bd, the cheapest
   exchange first. If the starting point has no other leg by then, it is inserted where that costs
   least, into a leg or at the nearest node.
3. The tour passes each node by the cheapest of its pairings
   (:mod:`~miurafab.fabrication.route.tour`).

The rural postman problem is NP-hard for several components; for one component steps 1 and 3 give
the optimum whenever the matching is optimal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from miurafab.fabrication.route.tour import closed_tour
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.connected import components

_ASSIGNED = 1200
"""The number of odd nodes assigned at once; more nodes are halved along the longer side."""


@dataclass(frozen=True, eq=False)
class Route:
    """``order`` (M,) the creases in order, and ``backwards`` (M,) whether each runs from b to a.

    ``legs_mm`` is the travel between the nodes in mm, from the starting point on, and
    ``bound_mm`` what no route falls below (0 where it is not known).
    """

    order: Ints
    backwards: Bools
    legs_mm: float
    bound_mm: float


def find_route(
    a: Ints,
    b: Ints,
    positions: Floats,
    start: Floats,
    ends: Floats | None = None,
    corner: float = 1.0,
) -> Route:
    """The route over M creases between the nodes ``a`` and ``b`` (M,), none of which is a loop.

    ``positions`` (N, 2) in mm are those of the nodes; the route begins near ``start`` (2,).
    ``ends`` (M, 2, 2) are the ends of the creases as they are drawn, the nodes if not given, and a
    corner is taken to cost as much as ``corner`` mm of travel.
    """
    if not len(a):
        return Route(np.empty(0, dtype=np.int64), np.empty(0, dtype=bool), 0.0, 0.0)
    count, nodes = len(a), len(positions)
    # The extra edge runs from the starting point to a node whose position, NaN, means anywhere.
    tails, heads = np.append(a, nodes), np.append(b, nodes + 1)
    placed = np.concatenate([positions, [start], [[np.nan, np.nan]]])
    odd = np.flatnonzero(np.bincount(np.concatenate([tails, heads])) % 2)
    legs, bound = match(odd, placed)
    legs = _with_bare_components(tails, heads, legs, placed)
    begins = (np.sort(legs, axis=1) == [nodes, nodes + 1]).all(axis=1)
    if begins.any():
        # Nothing is tied to the starting point yet, so it goes in last and where that costs least.
        legs = _joined(a, b, legs[~begins], placed)
        legs = _begun(np.unique([a, b]), legs, nodes, placed)
    else:
        legs = _joined(tails, heads, legs, placed)
    drawn = placed[np.stack([np.append(tails, legs[:, 0]), np.append(heads, legs[:, 1])], axis=1)]
    if ends is not None:
        drawn[:count] = ends
    tour = closed_tour(np.append(tails, legs[:, 0]), np.append(heads, legs[:, 1]), drawn, corner)
    extra = int(np.flatnonzero(tour[:, 0] == count)[0])
    if tour[extra, 1] == 0:
        tour = np.column_stack([tour[::-1, 0], 1 - tour[::-1, 1]])
        extra = len(tour) - 1 - extra
    tour = np.roll(tour, -extra, axis=0)
    made = tour[tour[:, 0] < count]
    return Route(made[:, 0], made[:, 1] == 1, float(_lengths(legs, placed).sum()), bound)


def match(nodes: Ints, positions: Floats) -> tuple[Ints, float]:
    """Pairs (n / 2, 2) of an even number of ``nodes`` (n,), and a lower bound of their length in
    mm (0 where the nodes were halved).
    """
    import scipy.optimize

    if len(nodes) > _ASSIGNED:
        points = positions[nodes]
        axis = int(np.argmax(np.nanmax(points, axis=0) - np.nanmin(points, axis=0)))
        ordered = nodes[np.argsort(positions[nodes, axis], kind="stable")]
        half = len(nodes) // 4 * 2
        one, other = match(ordered[:half], positions)[0], match(ordered[half:], positions)[0]
        return np.concatenate([one, other]), 0.0
    pairs: list[tuple[int, int]] = []
    bound, left = 0.0, nodes
    while len(left):
        points = positions[left]
        apart = _apart(points[:, None], points[None])
        np.fill_diagonal(apart, 4 * apart.max() + 1.0)
        _, sent = scipy.optimize.linear_sum_assignment(apart)
        if left is nodes:
            bound = float(apart[np.arange(len(left)), sent].sum() / 2)
        alone = _split_cycles(sent, apart, left, pairs)
        left = np.array(alone, dtype=np.int64)
    legs = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    return _exchanged(legs, positions), bound


def _split_cycles(
    sent: Ints, apart: Floats, names: Ints, pairs: list[tuple[int, int]]
) -> list[int]:
    """Append the pairs of the cycles of ``sent``, and return the nodes without a pair."""
    alone: list[int] = []
    seen = np.zeros(len(sent), dtype=bool)
    for first in range(len(sent)):
        if seen[first]:
            continue
        cycle = [first]
        while (after := int(sent[cycle[-1]])) != first:
            cycle.append(after)
        seen[cycle] = True
        if len(cycle) % 2:
            # Without one node an odd cycle is a path; the best node to leave out is chosen.
            turns = [cycle[k + 1 :] + cycle[:k] for k in range(len(cycle))]
            costs = [apart[turn[0::2], turn[1::2]].sum() for turn in turns]
            k = int(np.argmin(costs))
            alone.append(int(names[cycle[k]]))
            chosen = turns[k]
        else:
            other = cycle[1:] + cycle[:1]
            shorter = apart[cycle[0::2], cycle[1::2]].sum() <= apart[other[0::2], other[1::2]].sum()
            chosen = cycle if shorter else other
        ends = names[chosen]
        pairs += zip(ends[0::2].tolist(), ends[1::2].tolist(), strict=True)
    return alone


def _apart(x: Floats, y: Floats) -> Floats:
    """The distances of points (..., 2); 0 to the point that is everywhere (NaN)."""
    return np.asarray(np.nan_to_num(np.linalg.norm(x - y, axis=-1), nan=0.0))


def _lengths(legs: Ints, positions: Floats) -> Floats:
    return _apart(positions[legs[:, 0]], positions[legs[:, 1]])


def _exchange_gains(some: Ints, legs: Ints, positions: Floats) -> tuple[Floats, Bools]:
    """(m, n) what is gained by exchanging ``some`` legs (m, 2) with ``legs`` (n, 2), and whether
    straight (ac, bd) or crossed (ad, bc).
    """
    a, b = positions[some[:, None, 0]], positions[some[:, None, 1]]
    c, d = positions[legs[:, 0]], positions[legs[:, 1]]
    straight, crossed = _apart(a, c) + _apart(b, d), _apart(a, d) + _apart(b, c)
    now = _lengths(some, positions)[:, None] + _lengths(legs, positions)
    return now - np.minimum(straight, crossed), straight <= crossed


def _exchange(legs: Ints, i: int, j: int, straight: bool) -> None:
    (a, b), (c, d) = legs[i].tolist(), legs[j].tolist()
    legs[i], legs[j] = ((a, c), (b, d)) if straight else ((a, d), (b, c))


def _exchanged(legs: Ints, positions: Floats) -> Ints:
    """The legs after all exchanges of two legs that shorten them."""
    if len(legs) < 2:
        return legs
    legs = legs.copy()
    while True:
        gains, straight = _exchange_gains(legs, legs, positions)
        np.fill_diagonal(gains, -np.inf)
        if gains.max() <= 1e-9:
            return legs
        used = np.zeros(len(legs), dtype=bool)
        for i in np.argsort(-gains.max(axis=1), kind="stable").tolist():
            j = int(np.argmax(gains[i]))
            if gains[i, j] > 1e-9 and not used[i] and not used[j]:
                used[[i, j]] = True
                _exchange(legs, i, j, bool(straight[i, j]))


def _joined(a: Ints, b: Ints, legs: Ints, positions: Floats) -> Ints:
    """The legs, exchanged so that creases and legs form one component."""
    _, label = _components(a, b, legs, len(positions))
    if label.max() == 0:
        return legs
    legs = legs.copy()
    of_leg = label[legs[:, 0]]
    gains, straight = _exchange_gains(legs, legs, positions)
    gains[of_leg[:, None] == of_leg] = -np.inf
    for _ in range(int(label.max())):
        i, j = divmod(int(np.argmax(gains)), len(legs))
        _exchange(legs, i, j, bool(straight[i, j]))
        of_leg[of_leg == of_leg[j]] = of_leg[i]
        both = [i, j]
        gains[both], straight[both] = _exchange_gains(legs[both], legs, positions)
        gains[:, both], straight[:, both] = gains[both].T, straight[both].T
        one = np.flatnonzero(of_leg == of_leg[i])
        gains[np.ix_(one, one)] = -np.inf
    return legs


def _begun(used: Ints, legs: Ints, start: int, positions: Floats) -> Ints:
    """The legs of a closed tour through the nodes ``used`` with node ``start``, and after it the
    node that is anywhere, let in: in place of the leg that saves most, or at the nearest node.
    """
    away = _apart(positions[used], positions[start])
    node = int(used[np.argmin(away)])
    cost = _apart(positions[legs], positions[start]) - _lengths(legs, positions)[:, None]
    if not len(legs) or away.min() <= cost.min():
        return np.concatenate([legs, [[start, node], [node, start + 1]]])
    k, end = divmod(int(np.argmin(cost)), 2)
    entry, last = legs[k, end], legs[k, 1 - end]
    return np.concatenate([np.delete(legs, k, axis=0), [[start, entry], [last, start + 1]]])


def _components(a: Ints, b: Ints, legs: Ints, nodes: int) -> tuple[Ints, Ints]:
    """The used nodes, and (N,) the component of each node, from 0; -1 for unused nodes."""
    raw = components(nodes, np.concatenate([a, legs[:, 0]]), np.concatenate([b, legs[:, 1]]))
    used = np.unique(np.concatenate([a, b]))
    label = np.full(nodes, -1, dtype=np.int64)
    label[used] = np.unique(raw[used], return_inverse=True)[1]
    return used, label


def _with_bare_components(a: Ints, b: Ints, legs: Ints, positions: Floats) -> Ints:
    """The legs, with every component without legs joined to a component with legs."""
    used, label = _components(a, b, legs, len(positions))
    for bare in np.setdiff1d(label[used], label[legs[:, 0]]).tolist():
        members = np.flatnonzero(label == bare)
        legs = _with_bare(members, legs[label[legs[:, 0]] != bare], positions)
    return legs


def _with_bare(members: Ints, legs: Ints, positions: Floats) -> Ints:
    """The legs, with the component ``members`` joined by the least detour of a leg."""
    ends = positions[legs]
    out = _apart(positions[members][:, None, None], ends[None]).sum(axis=2)
    extra = out - _lengths(legs, positions)
    w, k = divmod(int(np.argmin(extra)), len(legs))
    node, (c, d) = int(members[w]), legs[k].tolist()
    return np.concatenate([np.delete(legs, k, axis=0), [[c, node], [node, d]]])
