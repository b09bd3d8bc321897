"""The order of the strokes on a sheet: little travel, and cuts that loosen the sheet last.

The operations follow :data:`~miurafab.profiles.OPERATIONS`: engrave, score, perforate, cut. Within
an operation:

- creases follow the postman's route (:mod:`~miurafab.fabrication.route.postman`); the dashes of a
  crease are made in the direction of the route;
- texts are made one by one, the nearest remaining text next;
- cuts are made in the order small holes, slots, slits in patches, rings of waste, outlines, the
  nearest remaining cut next; a closed stroke starts at its nearest point.

To spread heat, the next outline is the outline farthest from the last two, and so is the next patch
for creases. Within a patch every second trail of the route is left out on the way through and made
on the way back, so neighbouring trails are far apart in time.

Ordering changes only the direction of strokes and the start of closed strokes.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from miurafab.fabrication.route.postman import Route, find_route
from miurafab.fabrication.toolpath import Toolpath
from miurafab.geometry.arrays import Bools, Floats, Ints, places_in_runs
from miurafab.profiles import OPERATIONS, MachineProfile, Material

HOLE = 0
"""The rank of small closed strokes, which are ordered by their centres."""


@dataclasses.dataclass(frozen=True, eq=False)
class StrokeSet:
    """An unordered toolpath with the data for ordering it.

    ``group`` (S,) int64: the strokes of a crease or a text are consecutive, have the same group and
    stay together. ``rank`` (S,) int64: within an operation lower ranks come first.
    """

    toolpath: Toolpath
    group: Ints
    rank: Ints


OUTLINE = 4
"""The rank of the outlines of patches, last of all."""


def corner_of(machine: MachineProfile, material: Material) -> float:
    """The travel in mm for which there is time while the tool turns from one dash to another.

    It slows down into the leg between them and out of it, each time by up to v / a of lost time.
    """
    feed = material.on(machine).operations["perforate"].feed_mm_min
    speed = min(feed, *machine.motion.max_rate_mm_min) / 60
    return 2 * speed**2 / min(machine.motion.acceleration_mm_s2)


def order_strokes(
    strokes: StrokeSet, edges_vertices: Ints, *, spread_heat: bool = False, corner_mm: float = 1.0
) -> Toolpath:
    """The toolpath of ``strokes`` in order. ``edges_vertices`` (E, 2) of the pattern says which
    creases meet; the strokes of a crease run from its first vertex to its second. ``corner_mm`` is
    the travel that takes as long as a corner between two creases.
    """
    raw = strokes.toolpath
    parts: list[_StrokeOrder] = []
    here = np.zeros(2)
    for operation, name in enumerate(OPERATIONS):
        for rank in np.unique(strokes.rank[raw.operation == operation]).tolist():
            chosen = np.flatnonzero((raw.operation == operation) & (strokes.rank == rank))
            if name in ("score", "perforate"):
                made = _spread_creases if spread_heat else _creases
                part = made(raw, chosen, strokes.group[chosen], edges_vertices, here, corner_mm)
            elif name == "cut" and rank == HOLE:
                part = _holes(raw, chosen, here)
            else:
                spread = spread_heat and name == "cut" and rank == OUTLINE
                part = _nearest(raw, chosen, strokes.group[chosen], here, spread)
            parts.append(part)
            here = _arranged(raw, part).points[-1]
    return _arranged(raw, _joined(parts)) if parts else raw


@dataclasses.dataclass(frozen=True, eq=False)
class _StrokeOrder:
    """The strokes in order, whether each is reversed, and the index of the point at which a closed
    stroke starts.
    """

    stroke: Ints
    backwards: Bools
    begin: Ints


def _joined(parts: list[_StrokeOrder]) -> _StrokeOrder:
    return _StrokeOrder(
        np.concatenate([part.stroke for part in parts]),
        np.concatenate([part.backwards for part in parts]),
        np.concatenate([part.begin for part in parts]),
    )


def _arranged(raw: Toolpath, order: _StrokeOrder) -> Toolpath:
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


def _groups(group: Ints) -> tuple[Ints, Ints]:
    """The start and the length of each run of equal ``group``."""
    begin = np.flatnonzero(np.diff(group, prepend=group[:1] - 1))
    return begin, np.diff(np.append(begin, len(group)))


def _unrolled(begin: Ints, count: Ints, backwards: Bools) -> Ints:
    """The members of runs, each run forwards or backwards."""
    step = places_in_runs(count)
    back = np.repeat(backwards, count)
    return np.repeat(begin, count) + np.where(back, np.repeat(count, count) - 1 - step, step)


def _creases(
    raw: Toolpath, chosen: Ints, group: Ints, edges_vertices: Ints, here: Floats, corner: float
) -> _StrokeOrder:
    runs = _runs(raw, chosen, group, edges_vertices)
    route = runs.route(here, corner)
    return runs.made(chosen, route.order, route.backwards)


def _spread_creases(
    raw: Toolpath, chosen: Ints, group: Ints, edges_vertices: Ints, here: Floats, corner: float
) -> _StrokeOrder:
    """Patch after patch; in each, every second trail on the way through and the rest on the way
    back, each from its nearer end.
    """
    patches = np.unique(raw.patch[chosen])
    middles = np.array([raw.starts[chosen[raw.patch[chosen] == p]].mean(axis=0) for p in patches])
    begin = int(np.argmin(((middles - here) ** 2).sum(axis=1)))
    parts = []
    for k in _far_apart(middles, begin):
        own = raw.patch[chosen] == patches[k]
        runs = _runs(raw, chosen[own], group[own], edges_vertices)
        route = runs.route(here, corner)
        way = runs.node[route.order]
        way = np.where(route.backwards[:, None], way[:, ::-1], way)
        trails = np.split(np.arange(len(way)), np.flatnonzero(way[:-1, 1] != way[1:, 0]) + 1)
        order, backwards = [], []
        for trail in trails[::2] + trails[1::2][::-1]:
            first, last = runs.positions[way[trail[0], 0]], runs.positions[way[trail[-1], 1]]
            turned = np.hypot(*(last - here)) < np.hypot(*(first - here))
            order.append(route.order[trail[::-1] if turned else trail])
            backwards.append(route.backwards[trail[::-1] if turned else trail] != turned)
            here = first if turned else last
        parts.append(runs.made(chosen[own], np.concatenate(order), np.concatenate(backwards)))
    return _joined(parts)


def _far_apart(middles: Floats, begin: int) -> list[int]:
    """The order of ``middles`` (n, 2) from ``begin``, the farthest from the last two next."""
    left = np.ones(len(middles), dtype=bool)
    taken = [begin]
    left[begin] = False
    while left.any():
        apart = np.linalg.norm(middles[:, None] - middles[taken[-2:]], axis=2).min(axis=1)
        taken.append(int(np.argmax(np.where(left, np.round(apart, 6), -1.0))))
        left[taken[-1]] = False
    return taken


@dataclasses.dataclass(frozen=True, eq=False)
class _Runs:
    """C creases, each a run of strokes: its first stroke ``begin`` among the chosen strokes, their
    ``count``, its two nodes ``node`` (C, 2), its drawn ``ends`` (C, 2, 2), and the ``positions`` of
    all nodes.
    """

    begin: Ints
    count: Ints
    node: Ints
    ends: Floats
    positions: Floats

    def route(self, here: Floats, corner: float) -> Route:
        """The route over the creases from ``here``."""
        a, b = self.node.T
        return find_route(a, b, self.positions, here, self.ends, corner)

    def made(self, chosen: Ints, order: Ints, backwards: Bools) -> _StrokeOrder:
        """The strokes of the creases in ``order``."""
        member = _unrolled(self.begin[order], self.count[order], backwards)
        back = np.repeat(backwards, self.count[order])
        return _StrokeOrder(chosen[member], back, np.zeros(len(member), dtype=np.int64))


def _runs(raw: Toolpath, chosen: Ints, group: Ints, edges_vertices: Ints) -> _Runs:
    begin, count = _groups(group)
    ends = np.stack([raw.starts[chosen[begin]], raw.ends[chosen[begin + count - 1]]], axis=1)
    # A pattern vertex is a different node on each patch.
    vertex = edges_vertices[raw.edge[chosen[begin]]]
    key = raw.patch[chosen[begin]][:, None] * (edges_vertices.max() + 1) + vertex
    nodes, node = np.unique(key, return_inverse=True)
    node = node.reshape(-1, 2)
    total = np.zeros((len(nodes), 2))
    np.add.at(total, node.ravel(), ends.reshape(-1, 2))
    return _Runs(begin, count, node, ends, total / np.bincount(node.ravel())[:, None])


def _holes(raw: Toolpath, chosen: Ints, here: Floats) -> _StrokeOrder:
    """Small closed strokes, the nearest remaining stroke next."""
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
    return _StrokeOrder(chosen[taken], np.zeros(len(taken), dtype=bool), np.array(begin))


def _nearest(
    raw: Toolpath, chosen: Ints, group: Ints, here: Floats, spread: bool = False
) -> _StrokeOrder:
    """Groups, the nearest entry next. The entries of a group are the start of a text, both ends of
    a single open stroke, and all corners of a closed stroke. With ``spread`` the group farthest
    from the last two is next, entered at its nearest entry.
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
    turns = [-1] * len(begin)
    if spread:
        nearest = int(owner[np.argmin(np.hypot(*(points - here).T))])
        turns = _far_apart(_middles(raw, chosen, begin, count), nearest)
    for turn in turns:
        open_now = left if turn < 0 else owner == turn
        way = np.where(open_now, np.hypot(*(points - here).T), np.inf)
        at = int(np.argmin(way))
        taken.append(at)
        left[owner == owner[at]] = False
        here = leaves[at]
    which = owner[taken]
    member = _unrolled(begin[which], count[which], np.zeros(len(which), dtype=bool))
    reverse = np.repeat(np.array(back)[taken], count[which])
    return _StrokeOrder(chosen[member], reverse, np.repeat(np.array(corner)[taken], count[which]))


def _middles(raw: Toolpath, chosen: Ints, begin: Ints, count: Ints) -> Floats:
    """(G, 2) the centre of the box around each group of strokes."""
    found = []
    for at, strokes in zip(begin.tolist(), count.tolist(), strict=True):
        points = np.concatenate([raw.stroke(int(k)) for k in chosen[at : at + strokes]])
        found.append((points.min(axis=0) + points.max(axis=0)) / 2)
    return np.array(found)
