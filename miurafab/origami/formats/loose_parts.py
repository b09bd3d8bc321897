"""Parts of a drawing in the middle of a facet: windows, closed creases, and slits that end there.

A facet with a part inside is no polygon, nor is one whose border meets itself: at the end of a
slit, or at the corner of a window that touches another line. Flat lines make polygons of it. Two
join a loose part to what is left and right of it: one from its corner that is farthest to the left,
straight to the left up to the first line, and one to the right. One line goes on from a part that
hangs at one vertex: straight on from the end of a slit, else to the left or to the right. They run
inside the facet alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from miurafab.errors import PatternError
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.boxes import meeting_pairs
from miurafab.geometry.connected import components
from miurafab.geometry.polygons import filled, signed_areas, simple_loops, touching_themselves

_Start = tuple[int, Floats]
"""A vertex, and the direction of a flat line from there."""
_AT_ONCE = 1_000_000
"""Corners of facets that are compared with a point in one step."""


@dataclass(frozen=True, eq=False)
class InnerParts:
    """The parts within facets: the number that lies ``loose``, that of ends of ``slits``, and that
    of other parts ``hanging`` at one vertex; the ``bridges`` (b, 2, 2) are the ends of flat lines
    that make polygons of the facets, and ``waits`` (E,) tells which sides are of a loose part.
    """

    loose: int
    slits: int
    hanging: int
    bridges: Floats
    waits: Bools

    def refusal(self) -> PatternError:
        """The error for a drawing in which they are not joined."""
        x, y = self.bridges[0, 0]
        what = "lies loose inside a facet" if self.loose else "hangs in a facet at one vertex"
        return PatternError(
            f"A part of the drawing, at ({x:.6g}, {y:.6g}), {what}; join it to the lines around "
            "by a flat line (F), or give a larger `tolerance`."
        )


def inner_parts(points: Floats, sides: Ints, faces: Ints) -> InnerParts:
    """The parts inside of ``faces`` (F, k), of the plane graph of ``sides`` (E, 2) at ``points``
    (V, 2).
    """
    used = np.unique(sides)
    part = components(len(points), *sides.T)
    _, first, order = np.unique(part[used], return_index=True, return_inverse=True)
    part[used], first = order, used[first]
    around = facets_around(points, faces, part[faces[:, 0]], points[first]) > 0
    loose, slits, hanging = list[_Start](), list[_Start](), list[_Start]()
    for number in np.flatnonzero(around).tolist():
        ends = _slit_ends(points, sides[part[sides[:, 0]] == number])
        slits += ends
        if not ends:
            own = used[part[used] == number]
            for away in (-1.0, 1.0):
                corner = int(own[np.argmax(away * points[own, 0])])
                loose.append((corner, np.array([away, 0.0])))
    for face in faces[touching_themselves(faces)]:
        for is_end, start in _hanging(points, face):
            (slits if is_end else hanging).append(start)
    starts = (*loose, *slits, *hanging)
    bridges = np.array([_bridge(points, sides, *start) for start in starts]).reshape(-1, 2, 2)
    waits = around[part[sides[:, 0]]]
    return InnerParts(len(loose) // 2, len(slits), len(hanging), bridges, waits)


def _slit_ends(points: Floats, sides: Ints) -> list[_Start]:
    """Where lines of ``sides`` end, and the directions straight on."""
    vertices, degree = np.unique(sides, return_counts=True)
    found = []
    for end in vertices[degree == 1].tolist():
        other = int(sides[(sides == end).any(axis=1)].sum()) - end
        found.append((end, points[end] - points[other]))
    return found


def _hanging(points: Floats, face: Ints) -> Iterator[tuple[bool, _Start]]:
    """From where a flat line goes on from each part that hangs at one vertex of ``face``, and at
    which none hangs, and whether that is the end of a slit.
    """
    walk = face[face >= 0]
    walk = np.roll(walk, -int(np.argmin(points[walk, 0])))
    loops = [walk[places].tolist() for places in simple_loops(walk.tolist())]
    bases = {base for base, *_ in loops}
    for base, *others in loops:
        corners = points[[base, *others]]
        if bases.intersection(others) or signed_areas(corners[None])[0] > 0:
            continue  # what hangs there comes first; the border around the facet does not hang
        if len(others) == 1:
            yield True, (others[0], corners[1] - corners[0])
            continue
        left, right = (int(np.argmax(away * corners[1:, 0])) for away in (-1.0, 1.0))
        leftmost = corners[1 + left, 0] <= corners[0, 0]
        away = np.array([-1.0 if leftmost else 1.0, 0.0])
        yield False, (others[left if leftmost else right], away)


def _bridge(points: Floats, sides: Ints, vertex: int, along: Floats) -> Floats:
    """(2, 2) the line from a ``vertex`` ``along`` a direction to the first of ``sides``."""
    others = points[sides[(sides != vertex).all(axis=1)]] - points[vertex]
    height = along[0] * others[..., 1] - along[1] * others[..., 0]
    passes = (height[:, 0] > 0) != (height[:, 1] > 0)
    others, height = others[passes], height[passes]
    part = height[:, 0] / (height[:, 0] - height[:, 1])
    reach = (others[:, 0] + part[:, None] * (others[:, 1] - others[:, 0])) @ along / (along @ along)
    return np.array([points[vertex], points[vertex] + reach[reach > 0].min() * along])


def facets_around(points: Floats, faces: Ints, piece: Ints, places: Floats) -> Ints:
    """(n,) the number of facets of other pieces in which the place (n, 2) of each piece lies;
    of all facets where their ``piece`` (F,) is -1.
    """
    start = points[filled(faces)]
    end = np.roll(start, -1, axis=1)
    low, high = (
        np.pad(np.concatenate([ends, places]), ((0, 0), (0, 1)))
        for ends in (start.min(axis=1), start.max(axis=1))
    )
    facet, other = meeting_pairs(low, high)
    other = other - len(faces)
    near = (facet < len(faces)) & (other >= 0)
    near[near] = piece[facet[near]] != other[near]
    facet, other = facet[near], other[near]
    depth = np.zeros(len(places), dtype=np.int64)
    for at in np.array_split(np.arange(len(facet)), 1 + facet.size * faces.shape[1] // _AT_ONCE):
        a, b, place = start[facet[at]], end[facet[at]], places[other[at], None]
        with np.errstate(invalid="ignore", divide="ignore"):
            right = _passes(a, b, place) & (_crossing(a, b, place[..., 1]) > place[..., 0])
        np.add.at(depth, other[at], right.sum(axis=1) % 2)
    return depth


def _passes(a: Floats, b: Floats, place: Floats) -> Bools:
    """Whether the line from ``a`` to ``b`` passes the height of ``place``."""
    return np.asarray((a[..., 1] > place[..., 1]) != (b[..., 1] > place[..., 1]))


def _crossing(a: Floats, b: Floats, height: Floats) -> Floats:
    """Where the line through ``a`` and ``b`` passes a ``height``."""
    part = (height - a[..., 1]) / (b[..., 1] - a[..., 1])
    return np.asarray(a[..., 0] + part * (b[..., 0] - a[..., 0]))
