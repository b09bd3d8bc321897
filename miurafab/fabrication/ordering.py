"""The order of the strokes on a sheet: what loosens the sheet comes last, and little travel.

Operations follow each other as in :data:`~miurafab.profiles.OPERATIONS`: engrave, score,
perforate, cut. Within one:

- creases go by the postman's route (:mod:`~miurafab.fabrication.routing`), the dashes of a crease
  in turn, in the direction of the route;
- lettering goes text by text, each time to the nearest one that is left;
- small holes go first of all cuts, by their middles; then cuts within patches, rings around waste,
  and the outlines, each time to the nearest one left; a closed stroke is begun at its nearest
  point.

With heat to be spread, the outline that is made next is the one farthest from the two before it.

The strokes are the same before and after, but for their direction and where a closed one begins.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import scipy.spatial
from numpy.typing import NDArray

from miurafab.fabrication.routing import find_route
from miurafab.fabrication.toolpath import Toolpath
from miurafab.profiles import OPERATIONS

HOLE = 0
"""The rank of closed strokes so small that their middle says where they are."""


@dataclasses.dataclass(frozen=True, eq=False)
class Strokes:
    """A toolpath in no order, with what its order depends on.

    ``group`` (S,) int64: strokes of one crease or one text, which are consecutive and stay
    together, share it. ``rank`` (S,) int64: of the strokes of one operation a lower rank goes
    first.
    """

    toolpath: Toolpath
    group: NDArray[np.int64]
    rank: NDArray[np.int64]


OUTLINE = 3
"""The rank of the outlines of patches, last of all."""


def order_strokes(
    strokes: Strokes, edges_vertices: NDArray[np.int64], *, spread_heat: bool = False
) -> Toolpath:
    """The toolpath of ``strokes`` in order. ``edges_vertices`` (E, 2) of the pattern tells which
    creases meet; a crease's strokes run from its first vertex to its second.
    """
    raw = strokes.toolpath
    order = _Order(
        np.empty(0, dtype=np.int64), np.empty(0, dtype=bool), np.empty(0, dtype=np.int64)
    )
    here = np.zeros(2)
    for operation, name in enumerate(OPERATIONS):
        for rank in np.unique(strokes.rank[raw.operation == operation]).tolist():
            chosen = np.flatnonzero((raw.operation == operation) & (strokes.rank == rank))
            if name in ("score", "perforate"):
                part = _creases(raw, chosen, strokes.group[chosen], edges_vertices, here)
            elif name == "cut" and rank == HOLE:
                part = _holes(raw, chosen, here)
            else:
                spread = spread_heat and name == "cut" and rank == OUTLINE
                part = _nearest(raw, chosen, strokes.group[chosen], here, spread)
            order = _Order(
                np.concatenate([order.stroke, part.stroke]),
                np.concatenate([order.backwards, part.backwards]),
                np.concatenate([order.begin, part.begin]),
            )
            here = _arranged(raw, part).points[-1]
    return _arranged(raw, order)


@dataclasses.dataclass(frozen=True, eq=False)
class _Order:
    """The strokes in turn, whether each is made backwards, and at which point a closed one is
    begun.
    """

    stroke: NDArray[np.int64]
    backwards: NDArray[np.bool_]
    begin: NDArray[np.int64]


def _arranged(raw: Toolpath, order: _Order) -> Toolpath:
    """The strokes of ``raw`` in ``order``."""
    first, count = raw.offsets[order.stroke], np.diff(raw.offsets)[order.stroke]
    offsets = np.concatenate([[0], np.cumsum(count)])
    step = np.arange(offsets[-1]) - np.repeat(offsets[:-1], count)
    n, back = np.repeat(count, count), np.repeat(order.backwards, count)
    begin = np.repeat(order.begin, count)
    within = np.where(back, n - 1 - step, step)
    within = np.where(begin > 0, (begin + step) % np.maximum(n - 1, 1), within)
    return dataclasses.replace(
        raw,
        points=raw.points[np.repeat(first, count) + within],
        offsets=offsets,
        operation=raw.operation[order.stroke],
        patch=raw.patch[order.stroke],
        edge=raw.edge[order.stroke],
    )


def _groups(group: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Where each run of equal ``group`` begins, and how long it is."""
    begin = np.flatnonzero(np.diff(group, prepend=group[:1] - 1))
    return begin, np.diff(np.append(begin, len(group)))


def _unrolled(
    begin: NDArray[np.int64], count: NDArray[np.int64], backwards: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """The members of runs, each run forwards or backwards."""
    step = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    back = np.repeat(backwards, count)
    return np.repeat(begin, count) + np.where(back, np.repeat(count, count) - 1 - step, step)


def _creases(
    raw: Toolpath,
    chosen: NDArray[np.int64],
    group: NDArray[np.int64],
    edges_vertices: NDArray[np.int64],
    here: NDArray[np.float64],
) -> _Order:
    begin, count = _groups(group)
    ends = np.stack([raw.starts[chosen[begin]], raw.ends[chosen[begin + count - 1]]], axis=1)
    # The same pattern vertex is another node on another patch.
    vertex = edges_vertices[raw.edge[chosen[begin]]]
    key = raw.patch[chosen[begin]][:, None] * (edges_vertices.max() + 1) + vertex
    nodes, node = np.unique(key, return_inverse=True)
    node = node.reshape(-1, 2)
    total = np.zeros((len(nodes), 2))
    np.add.at(total, node.ravel(), ends.reshape(-1, 2))
    positions = total / np.bincount(node.ravel())[:, None]
    route = find_route(node[:, 0], node[:, 1], positions, here)
    member = _unrolled(begin[route.order], count[route.order], route.backwards)
    back = np.repeat(route.backwards, count[route.order])
    return _Order(chosen[member], back, np.zeros(len(member), dtype=np.int64))


def _holes(raw: Toolpath, chosen: NDArray[np.int64], here: NDArray[np.float64]) -> _Order:
    """Small closed strokes, each time the nearest one left."""
    middle = np.array([raw.stroke(int(k))[:-1].mean(axis=0) for k in chosen])
    left = np.arange(len(chosen))
    taken, begin = [], []
    while len(left):
        k = int(np.argmin(((middle[left] - here) ** 2).sum(axis=1)))
        ring = raw.stroke(int(chosen[left[k]]))[:-1]
        corner = int(np.argmin(((ring - here) ** 2).sum(axis=1)))
        taken.append(int(left[k]))
        begin.append(corner)
        here = ring[corner]
        left = np.delete(left, k)
    return _Order(chosen[taken], np.zeros(len(taken), dtype=bool), np.array(begin))


def _nearest(
    raw: Toolpath,
    chosen: NDArray[np.int64],
    group: NDArray[np.int64],
    here: NDArray[np.float64],
    spread: bool = False,
) -> _Order:
    """Groups by the nearest entry: the beginning of a text, either end of an open stroke on its
    own, and any corner of a closed one. With ``spread`` each time the group farthest from the two
    before it, by its nearest entry.
    """
    begin, count = _groups(group)
    entries, exits, item, back, corner = [], [], [], [], []
    for k, (at, strokes) in enumerate(zip(begin.tolist(), count.tolist(), strict=True)):
        first, last = raw.stroke(int(chosen[at])), raw.stroke(int(chosen[at + strokes - 1]))
        cut = strokes == 1 and raw.operation[chosen[at]] == OPERATIONS.index("cut")
        if cut and np.array_equal(first[0], first[-1]):
            ways = [(point, point, False, n) for n, point in enumerate(first[:-1])]
        else:
            ways = [(first[0], last[-1], False, 0)]
            ways += [(first[-1], first[0], True, 0)] if cut else []
        for entry, leave, backwards, n in ways:
            entries.append(entry)
            exits.append(leave)
            item.append(k)
            back.append(backwards)
            corner.append(n)
    points, leaves, owner = np.array(entries), np.array(exits), np.array(item)
    left = np.ones(len(points), dtype=bool)
    taken: list[int] = []
    middles = _middles(raw, chosen, begin, count)
    for _ in range(len(begin)):
        open_now = left
        if spread and taken:
            waiting = np.unique(owner[left])
            last = middles[owner[taken[-2:]]]
            apart = np.linalg.norm(middles[waiting][:, None] - last, axis=2).min(axis=1)
            open_now = owner == waiting[int(np.argmax(np.round(apart, 6)))]
        way = np.where(open_now, np.hypot(*(points - here).T), np.inf)
        at = int(np.argmin(way))
        taken.append(at)
        left[owner == owner[at]] = False
        here = leaves[at]
    which = owner[taken]
    member = _unrolled(begin[which], count[which], np.zeros(len(which), dtype=bool))
    reverse = np.repeat(np.array(back)[taken], count[which])
    return _Order(chosen[member], reverse, np.repeat(np.array(corner)[taken], count[which]))


def _middles(
    raw: Toolpath,
    chosen: NDArray[np.int64],
    begin: NDArray[np.int64],
    count: NDArray[np.int64],
) -> NDArray[np.float64]:
    """(G, 2) the middle of the box around each group of strokes."""
    found = []
    for at, strokes in zip(begin.tolist(), count.tolist(), strict=True):
        points = np.concatenate([raw.stroke(int(k)) for k in chosen[at : at + strokes]])
        found.append((points.min(axis=0) + points.max(axis=0)) / 2)
    return np.array(found)


def travel_bound(toolpath: Toolpath) -> float:
    """A length in mm below which no order of these strokes, by any route, can bring the travel.

    Every leg has two ends, and an end of an open stroke, or the origin, is at least as far from
    the other end of its leg as from the nearest place where another stroke may be entered or left.
    Of closed strokes it is only said that they may be entered anywhere.
    """
    if not len(toolpath):
        return 0.0
    owner = np.repeat(np.arange(len(toolpath)), np.diff(toolpath.offsets))
    place = np.zeros(len(owner), dtype=bool)
    place[toolpath.offsets[:-1]] = True
    place[toolpath.offsets[1:] - 1] = True
    closed = (toolpath.starts == toolpath.ends).all(axis=1)[owner]
    ends = np.flatnonzero(place & ~closed)
    places = np.concatenate([ends, np.flatnonzero(closed)])
    points = np.concatenate([toolpath.points[places], np.zeros((1, 2))])
    owners = np.append(owner[places], -1)
    # Of three places at most two are the stroke's own.
    asking = np.append(np.arange(len(ends)), len(points) - 1)
    way, near = scipy.spatial.KDTree(points).query(points[asking], k=min(3, len(points)))
    way = np.where(owners[near] == owners[asking, None], np.inf, way).min(axis=1)
    return float(way[:-1].sum() + 2 * way[-1]) / 2
