"""A closed tour over a connected even graph, with cheap passes through its nodes.

A closed tour pairs the ends of edges that meet at each node: it arrives by one edge and leaves by
the other. The price of a pass is the distance between the drawn ends of the two strokes, plus the
time of the corner, expressed as travel. The price of a turn by the angle phi is

    corner * sin(phi / 2),

where ``corner`` is v^2 / a: at acceleration a the tool loses the time v / a to stop and start
again, in which it would travel v^2 / a.

1. At each node a cheap pairing is taken: the best of the three pairings at a node of degree 4; the
   cheapest pair first at nodes of higher degree.
2. The pairs form closed trails. While there is more than one trail, two trails that meet at a node
   are joined by exchanging the partners of two pairs there, the cheapest exchange first (Kruskal's
   rule). At nodes of degree 4 every such exchange joins the trails.

Half-edge h of M edges leaves its node along edge h % M: the tail for h < M, the head otherwise.
"""

from __future__ import annotations

import numpy as np

from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.connected import components


def closed_tour(tails: Ints, heads: Ints, ends: Floats, corner: float) -> Ints:
    """(M, 2) the edges in order and the direction of each (1: from head to tail).

    ``tails`` and ``heads`` (M,) are the nodes of each edge, ``ends`` (M, 2, 2) its drawn ends in
    mm, NaN for an end that is everywhere; ``corner`` is in mm. The graph must be connected, and
    every node must have an even degree.
    """
    count = len(tails)
    at = np.concatenate([tails, heads])
    places = np.concatenate([ends[:, 0], ends[:, 1]])
    step = ends[:, 1] - ends[:, 0]
    size = np.linalg.norm(step, axis=1)
    step = np.nan_to_num(step / np.where(size > 0, size, 1.0)[:, None])
    prices = _Prices(places, np.concatenate([step, -step]), corner)
    partner = _cheapest(at, prices)
    while True:
        trail = _trails(partner, count)
        if trail.max() == 0:
            break
        _join(partner, trail, at, prices)
    follow = partner.tolist()
    half, found = 0, []
    for _ in range(count):
        found.append(half)
        half = follow[(half + count) % (2 * count)]
    tour = np.array(found, dtype=np.int64)
    return np.column_stack([tour % count, tour // count])


class _Prices:
    """The prices of passes between half-edges, in mm."""

    def __init__(self, places: Floats, ways: Floats, corner: float) -> None:
        self.places, self.ways, self.corner = places, ways, corner

    def of(self, i: Ints, j: Ints) -> Floats:
        """The price of each pass from i to j, the same in both directions."""
        apart = np.nan_to_num(np.linalg.norm(self.places[i] - self.places[j], axis=-1))
        one, other = self.ways[i], self.ways[j]
        both = (one != 0).any(axis=-1) & (other != 0).any(axis=-1)
        turn = np.sqrt(np.clip((1 + np.einsum("...k,...k->...", one, other)) / 2, 0, 1))
        return np.asarray(apart + self.corner * np.where(both, turn, 0.0))


_PAIRINGS = np.array([[0, 1, 2, 3], [0, 2, 1, 3], [0, 3, 1, 2]])
"""The pairings of four items: the first with the second, the third with the fourth."""


def _cheapest(at: Ints, prices: _Prices) -> Ints:
    """(2 M,) the partner of each half-edge at its node."""
    partner = np.full(len(at), -1)
    order = np.argsort(at, kind="stable")
    begin = np.flatnonzero(np.diff(at[order], prepend=-1))
    degree = np.diff(np.append(begin, len(at)))
    two = order[begin[degree == 2][:, None] + np.arange(2)]
    partner[two] = two[:, ::-1]
    four = order[begin[degree == 4][:, None] + np.arange(4)]
    if len(four):
        options = four[:, _PAIRINGS]
        cost = prices.of(options[..., 0::2], options[..., 1::2]).sum(axis=2)
        # Of prices equal up to rounding the first is taken, so that rounding decides nothing.
        best = np.argmin(np.round(cost, 9), axis=1)
        chosen = options[np.arange(len(four)), best]
        partner[chosen] = chosen[:, [1, 0, 3, 2]]
    for first, size in zip(begin[degree > 4].tolist(), degree[degree > 4].tolist(), strict=True):
        here = order[first : first + size]
        i, j = np.triu_indices(size, 1)
        for k in np.argsort(np.round(prices.of(here[i], here[j]), 9), kind="stable").tolist():
            one, other = here[i[k]], here[j[k]]
            if partner[one] < 0 and partner[other] < 0:
                partner[one], partner[other] = other, one
    return partner


def _trails(partner: Ints, count: int) -> Ints:
    """(2 M,) the closed trail of each half-edge."""
    half = np.arange(2 * count)
    rows = np.concatenate([half, half])
    columns = np.concatenate([(half + count) % (2 * count), partner])
    return components(2 * count, rows, columns)


def _join(partner: Ints, trail: Ints, at: Ints, prices: _Prices) -> None:
    """Exchange partners that join two trails, the cheapest exchange first."""
    one, other = _meeting(partner, trail, at)
    partner_one, partner_other = partner[one], partner[other]
    now = prices.of(one, partner_one) + prices.of(other, partner_other)
    ways = np.stack(
        [
            prices.of(one, other) + prices.of(partner_one, partner_other),
            prices.of(one, partner_other) + prices.of(partner_one, other),
        ]
    )
    crossed = np.argmin(np.round(ways, 9), axis=0)
    extra = np.round(ways.min(axis=0) - now, 9)
    root = list(range(int(trail.max()) + 1))

    def find(name: int) -> int:
        while root[name] != name:
            root[name] = root[root[name]]
            name = root[name]
        return name

    for k in np.argsort(extra, kind="stable").tolist():
        a, b = int(one[k]), int(other[k])
        c, d = int(partner_one[k]), int(partner_other[k])
        first, second = find(int(trail[a])), find(int(trail[b]))
        # A pair that was exchanged already has changed; the next round looks at it again.
        if first == second or partner[a] != c or partner[b] != d:
            continue
        root[first] = second
        for i, j in ((a, b), (c, d)) if crossed[k] == 0 else ((a, d), (c, b)):
            partner[i], partner[j] = j, i


def _meeting(partner: Ints, trail: Ints, at: Ints) -> tuple[Ints, Ints]:
    """The half-edges, one per pair, of two pairs that meet at a node and lie on two trails."""
    pairs = np.flatnonzero(np.arange(len(partner)) < partner)
    pairs = pairs[np.argsort(at[pairs], kind="stable")]
    found = [np.empty((0, 2), dtype=np.int64)]
    node = at[pairs]
    # The pairs of a node are consecutive: each is compared with the next, the second next ...
    apart = 0
    while True:
        apart += 1
        same = np.flatnonzero(node[apart:] == node[:-apart])
        if not len(same):
            break
        both = np.column_stack([pairs[same], pairs[same + apart]])
        found.append(both[trail[both[:, 0]] != trail[both[:, 1]]])
    one, other = np.concatenate(found).T
    return one, other
