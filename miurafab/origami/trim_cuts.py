"""Where the outline of a target cuts the edges and facets of a sheet.

A point of the sheet is inside where its nearest point of the target has a positive signed distance
phi from the outline. Each edge is parted into intervals that are inside or outside in turn: phi is
taken at its ends and at a few points between, and each change of sign is bisected. Facets on both
sides of an edge, and both edges of a seam, get the same cut points.

Intervals under ``SNAP`` of the edge vanish: at an end the cut moves to the vertex. Within a facet
the cut is the straight chord between two points of its border, or bends where the outline has a
corner: at the points of the facet's plane that lie along the target's normal on the outline.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from miurafab.geometry.arrays import Bools, Floats, Ints, vector_product
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.surfaces.outline import WholeMesh

SNAP = 0.15
"""The shortest part of an edge that is cut off or left."""
BETWEEN = 7
"""Points between the ends of an edge at which phi is taken."""
BISECTIONS = 20
STRAIGHT = 0.08
"""A cut follows the outline up to this part of the mean edge."""
LONGEST = 6.0
"""The outline within one facet is no longer than so many mean edges."""


@dataclass(frozen=True, eq=False)
class EdgeCuts:
    """The intervals of each edge of a pattern.

    Both edges of a seam have one line, which runs from the vertex of lower number ``meeting`` (V,)
    to the other: vertices that meet at seams have equal numbers. ``line`` (E,) is the line of each
    edge, ``breaks`` of a line the places between 0 and 1 where it is cut, ``starts_inside``
    (lines,) whether its first interval is inside. ``feet`` (V, 2) are the parameters of the points
    of the target nearest to the vertices.
    """

    meeting: Ints
    line: Ints
    breaks: tuple[tuple[float, ...], ...]
    starts_inside: Bools
    feet: Floats

    def walk(self, edge: int, tail: int, head: int) -> tuple[list[float], list[bool]]:
        """The cuts of ``edge`` from the vertex ``tail`` to ``head`` as places on its line, and
        whether each interval is inside.
        """
        line = int(self.line[edge])
        breaks = list(self.breaks[line])
        inside = [bool(self.starts_inside[line]) ^ (n % 2 == 1) for n in range(len(breaks) + 1)]
        if self.meeting[tail] > self.meeting[head]:
            return breaks[::-1], inside[::-1]
        return breaks, inside


def meeting_vertices(pattern: CreasePattern) -> Ints:
    """(V,) the least number of the vertices that meet each vertex at seams."""
    least = np.arange(len(pattern.vertices_coords))
    pairs = pattern.seam_vertices.reshape(-1, 2)
    while True:
        lower = least.copy()
        np.minimum.at(lower, pairs[:, 0], least[pairs[:, 1]])
        np.minimum.at(lower, pairs[:, 1], least[pairs[:, 0]])
        if np.array_equal(lower, least):
            return least
        least = lower


def edge_cuts(pattern: CreasePattern, target: WholeMesh, near: Floats) -> EdgeCuts:
    """The cuts of the edges of ``pattern`` by the outline of ``target``; ``near`` (V, 2) are
    parameters near the place of each vertex.
    """
    assert pattern.folded_coords is not None
    points = pattern.folded_coords / pattern.scale
    meeting = meeting_vertices(pattern)
    lines, line = np.unique(
        np.sort(meeting[pattern.edges_vertices], axis=1), axis=0, return_inverse=True
    )
    feet = target.feet(points, near)
    phi = target.outline.signed_distance(feet)
    ends = phi[lines]
    close = np.flatnonzero(np.abs(ends).min(axis=1) < 1.5 * edge_lengths(points, lines))
    at = np.linspace(0.0, 1.0, BETWEEN + 2)
    values = np.repeat(ends[:, :1], BETWEEN + 2, axis=1)
    values[:, -1] = ends[:, 1]
    where = np.broadcast_to(at[1:-1], (len(close), BETWEEN)).reshape(-1)
    values[close, 1:-1] = _phi(
        points, feet, lines[np.repeat(close, BETWEEN)], where, target
    ).reshape(-1, BETWEEN)
    row, change = np.nonzero((values[:, 1:] > 0) != (values[:, :-1] > 0))
    low, high = at[change], at[change + 1]
    rising = values[row, change] <= 0
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        before = (_phi(points, feet, lines[row], middle, target) > 0) != rising
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    found: list[list[float]] = [[] for _ in lines]
    for index, place in zip(row.tolist(), ((low + high) / 2).tolist(), strict=True):
        found[index].append(place)
    parted = [_snapped(b, bool(v > 0)) for b, v in zip(found, values[:, 0], strict=True)]
    return EdgeCuts(
        meeting,
        line.reshape(-1),
        tuple(breaks for breaks, _ in parted),
        np.array([inside for _, inside in parted], dtype=bool),
        feet,
    )


def _phi(points: Floats, feet: Floats, lines: Ints, at: Floats, target: WholeMesh) -> Floats:
    """(n,) the signed distance at the part ``at`` (n,) of ``lines`` (n, 2)."""
    a, b, t = lines[:, 0], lines[:, 1], at[:, None]
    return target.outline.signed_distance(
        target.feet((1 - t) * points[a] + t * points[b], (1 - t) * feet[a] + t * feet[b])
    )


def _snapped(breaks: list[float], starts_inside: bool) -> tuple[tuple[float, ...], bool]:
    """The ``breaks`` of a line without intervals under ``SNAP``, and its first state then."""
    ends = [0.0, *breaks, 1.0]
    while len(ends) > 2:
        lengths = np.diff(ends)
        least = int(lengths.argmin())
        if lengths[least] >= SNAP:
            break
        if least == 0:
            del ends[1]
            starts_inside = not starts_inside
        elif least == len(lengths) - 1:
            del ends[-2]
        else:
            del ends[least : least + 2]
    return tuple(ends[1:-1]), starts_inside


def bend(
    corners: Floats, start: Floats, end: Floats, length: float, target: WholeMesh, near: Floats
) -> list[Floats]:
    """The points (3,) in the plane of a facet at which its cut from ``start`` to ``end`` bends.

    ``corners`` (k, 3) are those of the facet, ``length`` is the mean edge, and the facet lies left
    of the cut. ``near`` (2,) are parameters near it. There is none where the outline within the
    facet is as good as straight.
    """
    uv = target.feet(np.stack([start, end]), np.stack([near, near]))
    sides = target.outline.nearest(uv)[2].tolist()
    normal = vector_product(corners[2] - corners[0], corners[-1] - corners[1])
    normal /= np.linalg.norm(normal)
    facing = float(normal @ target.normal(uv.mean(axis=0)))
    one, other = (sides[0], uv[0]), (sides[1], uv[1])
    places = target.outline.along(one, other) if facing > 0 else target.outline.along(other, one)
    if not len(places):
        return []
    route = np.concatenate([uv[:1], places if facing > 0 else places[::-1], uv[1:]])
    if np.linalg.norm(np.diff(route, axis=0), axis=1).sum() > LONGEST * length:
        return []
    rays = target.normal(route[1:-1])
    slope = rays @ normal
    if (np.abs(slope) < 0.1).any():
        return []
    base = target.point(route[1:-1])
    on_plane = base + ((corners[0] - base) @ normal / slope)[:, None] * rays
    path = np.concatenate([start[None], on_plane, end[None]])
    return [
        path[n]
        for n in _bends(path, 0, len(path) - 1, STRAIGHT * length)
        if _depth(path[n], corners, normal) > STRAIGHT * length / 2
    ]


def _bends(path: Floats, first: int, last: int, tolerance: float) -> list[int]:
    """Which points of ``path`` (n, 3) between ``first`` and ``last`` keep it within ``tolerance``
    (D. H. Douglas and T. K. Peucker, Cartographica 10 (1973)).
    """
    if last - first < 2:
        return []
    chord = path[last] - path[first]
    inner = path[first + 1 : last] - path[first]
    at = np.clip(inner @ chord / max(float(chord @ chord), 1e-300), 0.0, 1.0)
    off = np.linalg.norm(inner - at[:, None] * chord, axis=1)
    farthest = int(off.argmax())
    if off[farthest] <= tolerance:
        return []
    middle = first + 1 + farthest
    return [
        *_bends(path, first, middle, tolerance),
        middle,
        *_bends(path, middle, last, tolerance),
    ]


def _depth(point: Floats, corners: Floats, normal: Floats) -> float:
    """How far ``point`` lies inside the convex facet, negative outside."""
    along = np.roll(corners, -1, axis=0) - corners
    inward = vector_product(normal, along)
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    return float(np.einsum("ck,ck->c", point - corners, inward).min())
