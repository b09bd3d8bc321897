"""Nested dissection: an order of elimination that keeps the factor of a sparse matrix small.

The matrix's pattern is a graph: unknowns i and j are joined where entry (i, j) is stored. A set of
unknowns whose removal leaves two parts without a join, a separator, is eliminated after both parts,
and each part is divided in turn (A. George, SIAM J. Numer. Anal. 10 (1973)).

Where to cut is read from places in the plane. No places are asked for: the hops to unknowns that
lie far apart serve as coordinates, and a few averages over neighbours make them smooth. Along each
axis the unknowns of a part are ranked. Cut at rank c, the low side's separator holds the unknowns
of rank r < c with a neighbour of rank c or more. So each unknown counts for the cuts c from r + 1
to the highest rank of its neighbours, and a running sum gives the size of the separator of every
cut at once. The high side likewise. All parts of one depth are cut in one pass over the arrays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order, connected_components

from miurafab.geometry.arrays import Bools, Floats, Ints

LEAF = 120
"""Parts of at most this many unknowns stay whole: dense factors of that size are fast."""
BALANCE = 0.35
"""The least share of a part that lies before or after a cut."""
AVERAGES = 3
"""Rounds of averaging: hops are whole numbers, which do not rank neighbours."""


@dataclass(frozen=True, eq=False)
class Separator:
    """The unknowns ``columns`` (k,) are eliminated together, after those of ``children``."""

    columns: Ints
    children: tuple[int, ...]


def dissect(pattern: sparse.csc_array) -> list[Separator]:
    """The separators and leaves of a symmetric ``pattern``, each after its children.

    The pattern's indices are sorted; its numbers do not count.
    """
    if not pattern.shape[0]:
        return []
    graph = sparse.csr_array(
        (np.ones(pattern.nnz), pattern.indices, pattern.indptr), shape=pattern.shape
    )
    places = _coordinates(graph)
    columns, children = _cut_all(graph, places)
    return _after_children(columns, children, places)


def _coordinates(graph: sparse.csr_array) -> Floats:
    """(n, 2) places of the unknowns, such that joined unknowns lie close together.

    One coordinate runs between the ends of the graph, the other from an unknown far from both.
    Components of the graph are laid apart.
    """
    _, start, component, size = np.unique(
        connected_components(graph, directed=False)[1],
        return_index=True,
        return_inverse=True,
        return_counts=True,
    )
    places = np.zeros((graph.shape[0], 2))
    for node in start[size > LEAF].tolist():
        first = _hops(graph, int(_hops(graph, node)[1][-1]))
        last = _hops(graph, int(first[1][-1]))
        aside = _hops(graph, int(np.argmax(np.minimum(first[0], last[0]))))
        mine = first[1]
        places[mine] = np.stack([first[0] - last[0], aside[0]], axis=1)[mine]
    neighbours = np.maximum(np.diff(graph.indptr), 1)[:, None]
    for _ in range(AVERAGES):
        places = (graph @ places) / neighbours
    return np.asarray(places + component[:, None] * (np.ptp(places, axis=0) + 1))


def _hops(graph: sparse.csr_array, start: int) -> tuple[Floats, Ints]:
    """The joins (n,) from ``start`` to each unknown, -1 where there is no way, and the unknowns
    that are reached, the farthest last.
    """
    order, before = breadth_first_order(graph, start)
    place = np.empty(graph.shape[0], dtype=np.int64)
    place[order] = np.arange(len(order))
    parents = place[before[order[1:]]]
    hops = np.full(graph.shape[0], -1.0)
    begin, end, hop = 0, 1, 0
    while begin < end:
        hops[order[begin:end]] = hop
        # an unknown is one hop farther than the one that it was reached from
        begin, end, hop = end, 1 + int(np.searchsorted(parents, end)), hop + 1
    return hops, order.astype(np.int64)


def _cut_all(
    graph: sparse.csr_array, places: Floats
) -> tuple[dict[int, Ints], dict[int, tuple[int, int]]]:
    """The unknowns of each separator or leaf by its number, and the two parts of each separator.

    The whole graph is number 0.
    """
    columns: dict[int, Ints] = {}
    children: dict[int, tuple[int, int]] = {}
    nodes: Ints = np.arange(graph.shape[0])
    number: Ints = np.zeros(len(nodes), dtype=np.int64)
    joins = _Joins.of(graph)
    count = 1
    while True:
        # the unknowns of a part stand together
        first = np.flatnonzero(np.diff(number, prepend=-1))
        size = np.diff(first, append=len(nodes))
        numbers = number[first]
        whole = size <= LEAF
        for k in np.flatnonzero(whole).tolist():
            columns[int(numbers[k])] = nodes[first[k] : first[k] + size[k]]
        if whole.all():
            break
        nodes = nodes[np.repeat(~whole, size)]
        numbers, size = numbers[~whole], size[~whole]
        part: Ints = np.repeat(np.arange(len(size)), size)
        joins = joins.among(nodes)
        side, separator = _best_cuts(nodes, part, size, joins, places)
        chosen = nodes[separator]
        ends = np.cumsum(np.bincount(part[separator], minlength=len(size))).tolist()
        for k, (begin, end) in enumerate(zip([0, *ends], ends, strict=False)):
            columns[int(numbers[k])] = chosen[begin:end]
            children[int(numbers[k])] = (count + 2 * k, count + 2 * k + 1)
        joins = joins.within_sides(nodes, side, separator)
        number = (count + 2 * part + side)[~separator]
        nodes = nodes[~separator]
        order = np.argsort(number, kind="stable")
        nodes, number = nodes[order], number[order]
        count += 2 * len(size)
    return columns, children


@dataclass(frozen=True, eq=False)
class _Joins:
    """The joins of ``count`` unknowns that no cut has parted, each in both directions.

    Sorted by the unknown ``at`` (e,); ``to`` (e,) is its neighbour.
    """

    count: int
    at: Ints
    to: Ints

    @classmethod
    def of(cls, graph: sparse.csr_array) -> _Joins:
        at = np.repeat(np.arange(graph.shape[0], dtype=np.int32), np.diff(graph.indptr))
        to = graph.indices.astype(np.int32)
        apart = at != to
        return cls(graph.shape[0], at[apart], to[apart])

    def among(self, nodes: Ints) -> _Joins:
        """The joins of the unknowns ``nodes``; no join leads out of them."""
        inside = np.zeros(self.count, dtype=bool)
        inside[nodes] = True
        return self.kept(inside[self.at])

    def within_sides(self, nodes: Ints, side: Bools, separator: Bools) -> _Joins:
        """The joins between unknowns of ``nodes`` on one side, without the separator."""
        place = np.zeros(self.count, dtype=np.int8)
        place[nodes] = np.where(separator, 2, side)
        here, there = place[self.at], place[self.to]
        return self.kept((here == there) & (here < 2))

    def kept(self, chosen: Bools) -> _Joins:
        return _Joins(self.count, self.at[chosen], self.to[chosen])


def _best_cuts(
    nodes: Ints, part: Ints, size: Ints, joins: _Joins, places: Floats
) -> tuple[Bools, Bools]:
    """Which of ``nodes`` (m,) lie on the high side of the cut through their part, and which are in
    its separator.
    """
    first = np.cumsum(size) - size
    share = (np.arange(len(nodes)) - first[part]) / size[part]
    within = np.minimum(share, 1 - share)
    starts = np.flatnonzero(np.diff(joins.at, prepend=-1))
    least = np.full(len(size), np.inf)
    side, separator = np.zeros(len(nodes), dtype=bool), np.zeros(len(nodes), dtype=bool)
    rank = np.zeros(joins.count, dtype=np.int32)
    lowest, highest = rank.copy(), rank.copy()
    for axis in range(places.shape[1]):
        order = np.lexsort((places[nodes, axis], part))
        rank[nodes[order]] = np.arange(len(nodes))
        lowest[nodes] = highest[nodes] = mine = rank[nodes]
        if len(starts):
            there = rank[joins.to]
            at = joins.at[starts]
            lowest[at] = np.minimum(rank[at], np.minimum.reduceat(there, starts))
            highest[at] = np.maximum(rank[at], np.maximum.reduceat(there, starts))
        # the sizes of both separators of the cut before each rank
        after_mine = np.bincount(mine + 1, minlength=len(nodes) + 1)
        low = after_mine - np.bincount(highest[nodes] + 1, minlength=len(nodes) + 1)
        high = np.bincount(lowest[nodes] + 1, minlength=len(nodes) + 1) - after_mine
        low, high = np.cumsum(low)[: len(nodes)], np.cumsum(high)[: len(nodes)]
        with np.errstate(divide="ignore", invalid="ignore"):
            cost = np.minimum(low, high) / (share * (1 - share))
        cost = np.where((within >= BALANCE) & (share > 0), cost, np.inf)
        smallest = np.minimum.reduceat(cost, first)
        hits = np.flatnonzero(cost == smallest[part])
        cut = hits[np.flatnonzero(np.diff(part[hits], prepend=-1))]
        better = (smallest < least)[part]
        least = np.minimum(least, smallest)
        above = mine >= cut[part]
        edge = np.where(
            (low[cut] <= high[cut])[part],
            ~above & (highest[nodes] >= cut[part]),
            above & (lowest[nodes] < cut[part]),
        )
        side, separator = np.where(better, above, side), np.where(better, edge, separator)
    return side, separator


def _after_children(
    columns: dict[int, Ints], children: dict[int, tuple[int, int]], places: Floats
) -> list[Separator]:
    """The separators in postorder. One without unknowns hands its children to its parent.

    The unknowns of a separator are sorted along it, so that its parts meet it in few runs.
    """
    ordered: list[Separator] = []
    below: dict[int, tuple[int, ...]] = {}
    waiting = [(0, False)]
    while waiting:
        number, visited = waiting.pop()
        parts = children.get(number, ())
        if parts and not visited:
            waiting += [(number, True), *((part, False) for part in reversed(parts))]
            continue
        beneath = tuple(k for part in parts for k in below.pop(part))
        mine = columns.get(number, np.zeros(0, dtype=np.int64))
        if len(mine):
            along = int(np.argmax(np.ptp(places[mine], axis=0)))
            mine = mine[np.argsort(places[mine, along], kind="stable")]
            ordered.append(Separator(mine, beneath))
            beneath = (len(ordered) - 1,)
        below[number] = beneath
    return ordered
