"""Self-contact of a sheet: facets that pass through each other or lie on each other.

Facets are split into triangles. Two facets meet where the insides of triangles (without sides and
corners) have a common point. It depends on the heights of each triangle's corners over the plane of
the other triangle:

- all heights of one sign or zero, not all zero: the insides are apart;
- all zero: the triangles lie in one plane, and overlap unless one of their six sides separates
  them;
- else each triangle cuts the plane of the other in a segment of the common line of both planes, and
  the triangles cross where the two segments overlap.

Touching is not meeting. The height of a corner shared by two facets is set to zero, so facets with
a common side or corner need no special case. Layers of a sheet folded flat count as meeting;
their order is that of :mod:`miurafab.origami.folding.layers`.
"""

from __future__ import annotations

import numpy as np

from miurafab.geometry.arrays import Bools, Floats, Ints, places_in_runs, run_starts, vector_product
from miurafab.geometry.boxes import meeting_pairs
from miurafab.geometry.polygons import edge_lengths, facet_means, facet_normals, signed_areas
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.triangles import facet_triangles

IN_PLANE = 1e-9
"""A corner closer to a plane than this part of the mean triangle side lies in the plane."""

TOUCH = 1e-6
"""Facets that overlap by less than this part of the mean side only touch."""
TOGETHER = 1e-6
"""Radians, and mean edges: facets nearer to one plane lie on each other."""

_CHUNK = 30_000
_MANY = 8
"""Triangles to a facet, in the mean, from which pairs of triangles are looked for at once."""
_SIDES = ((0, 1), (1, 2), (2, 0))


def self_intersections(pattern: CreasePattern) -> Ints:
    """(n, 2) the pairs of facets of the folded form that pass through or lie on each other, sorted.

    Raises ``ValueError`` for a pattern without a folded form.
    """
    if pattern.folded_coords is None:
        raise ValueError("the pattern has no folded form")
    return meeting_facets(pattern, pattern.folded_coords)


def most_meeting(pattern: CreasePattern, shapes: Floats) -> int:
    """The most pairs of facets that pass through each other in one of the ``shapes`` (n, V, 3).

    Bent facets are the triangles of the bar-and-hinge model. Layers that lie on each other pass
    through nothing.
    """
    flat = np.pad(pattern.vertices_coords, ((0, 0), (0, 1)))
    split = facet_triangles(flat, pattern.faces_vertices)
    met = ((points, meeting_facets(pattern, points, split)) for points in shapes)
    return max((int((~lie_together(pattern, *each)).sum()) for each in met), default=0)


def lie_together(
    pattern: CreasePattern, points: Floats, pairs: Ints, near: float = TOGETHER
) -> Bools:
    """(n,) whether the two facets of each of ``pairs`` (n, 2) lie in one plane, as layers do.

    The vertices of ``pattern`` are at ``points`` (V, 3); ``near`` is in radians and mean edges.
    """
    faces = pattern.faces_vertices
    normals, middles = facet_normals(points, faces), facet_means(points, faces)
    one, other = pairs.T
    level = np.linalg.norm(vector_product(normals[one], normals[other]), axis=1) <= near
    apart = np.abs(np.einsum("nk,nk->n", middles[other] - middles[one], normals[one]))
    mean = float(edge_lengths(points, pattern.edges_vertices).mean())
    return np.asarray(level & (apart <= near * mean))


def crossing_triangles(points: Floats, triangles: Ints) -> Ints:
    """(n, 2) the pairs of ``triangles`` (T, 3) over ``points`` (V, 3) that pass through or lie on
    each other, sorted.
    """
    mesh = CreasePattern(
        vertices_coords=np.zeros((len(points), 2)),
        edges_vertices=np.empty((0, 2), dtype=np.int64),
        edges_assignment=np.empty(0, dtype="U1"),
        edges_fold_angle=np.empty(0),
        faces_vertices=triangles,
    )
    return meeting_facets(mesh, points)


def overlaps(pattern: CreasePattern) -> Ints:
    """(n, 2) the pairs of facets of the flat pattern that cover a common area, sorted.

    A facet that is turned over overlaps its neighbours.
    """
    flat = pattern.vertices_coords
    return meeting_facets(pattern, np.pad(flat, ((0, 0), (0, 1))))


def meeting_facets(
    pattern: CreasePattern, points: Floats, split: tuple[Ints, Ints] | None = None
) -> Ints:
    """(n, 2) the pairs of facets of ``pattern`` that meet with its vertices at ``points`` (V, 3).

    ``split`` are the triangles (T, 3) of bent facets, and the facet (T,) of each.
    """
    faces = pattern.faces_vertices
    triangles, owner = triangulate(faces, pattern.vertices_coords) if split is None else split
    shapes = _Triangles.of(points, triangles)
    if len(triangles) > _MANY * len(faces):
        return _meeting_owners(points, triangles, owner, shapes)
    real = (faces >= 0)[..., None]
    corners = points[faces]
    low = np.where(real, corners, np.inf).min(axis=1)
    high = np.where(real, corners, -np.inf).max(axis=1)
    order = np.argsort(owner, kind="stable")
    counts = np.bincount(owner, minlength=len(faces))
    start = run_starts(counts)
    meeting = []
    first, second = meeting_pairs(low, high)
    for begin in range(0, len(first), _CHUNK):
        a, b = first[begin : begin + _CHUNK], second[begin : begin + _CHUNK]
        # every triangle of one facet against every triangle of the other
        each = counts[a] * counts[b]
        pair = np.repeat(np.arange(len(a)), each)
        within = places_in_runs(each)
        one = order[start[a[pair]] + within // counts[b[pair]]]
        other = order[start[b[pair]] + within % counts[b[pair]]]
        hit = np.unique(pair[shapes.meet(one, other)])
        meeting.append(np.stack([a[hit], b[hit]], axis=1))
    pairs = np.concatenate(meeting) if meeting else np.empty((0, 2), dtype=np.int64)
    return np.unique(np.sort(pairs, axis=1), axis=0)


def _meeting_owners(points: Floats, triangles: Ints, owner: Ints, shapes: _Triangles) -> Ints:
    """:func:`meeting_facets` for facets of many triangles, of which few meet."""
    corners = points[triangles]
    one, other = meeting_pairs(corners.min(axis=1), corners.max(axis=1))
    apart = owner[one] != owner[other]
    one, other = one[apart], other[apart]
    hits = [
        at[shapes.meet(one[at], other[at])]
        for at in np.array_split(np.arange(len(one)), 1 + len(one) // _CHUNK)
    ]
    hit = np.concatenate(hits)
    pairs = np.stack([owner[one[hit]], owner[other[hit]]], axis=1)
    return np.unique(np.sort(pairs, axis=1), axis=0)


class _Triangles:
    """Triangles with their planes. Triangles without an inside meet nothing."""

    def __init__(self, index: Ints, corners: Floats, normals: Floats, size: float) -> None:
        self.index, self.corners, self.normals, self.size = index, corners, normals, size
        self.sound: Bools = np.asarray(np.isfinite(normals).all(axis=1))
        self.flat = not corners[..., 2].any()

    @classmethod
    def of(cls, points: Floats, triangles: Ints) -> _Triangles:
        corners = points[triangles]
        normals = vector_product(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        size = float(sides.mean()) if len(sides) else 0.0
        longest = sides.max(axis=1, initial=0.0)[:, None]
        with np.errstate(invalid="ignore", divide="ignore"):
            normals = np.where(length > TOUCH * size * longest, normals / length, np.nan)
        return cls(triangles, corners, normals, size)

    def meet(self, one: Ints, other: Ints) -> Bools:
        """(n,) whether the insides of triangles ``one`` (n,) and ``other`` (n,) meet."""
        result = np.zeros(len(one), dtype=bool)
        left = np.flatnonzero(self.sound[one] & self.sound[other])
        if self.flat:
            result[left] = self._overlap(one[left], other[left])
            return result
        above = self._heights(one[left], other[left])
        near = ~_one_sided(above)
        left, above = left[near], above[near]
        below = self._heights(other[left], one[left])
        near = ~_one_sided(below)
        left, above, below = left[near], above[near], below[near]
        flat = (above == 0).all(axis=1) | (below == 0).all(axis=1)
        a, b = one[left], other[left]
        result[left[flat]] = self._overlap(a[flat], b[flat])
        result[left[~flat]] = self._cross(a[~flat], b[~flat], above[~flat], below[~flat])
        return result

    def _heights(self, one: Ints, other: Ints) -> Floats:
        """(n, 3) the heights of the corners of ``one`` over the planes of ``other``."""
        gap = self.corners[one] - self.corners[other][:, :1]
        height = np.einsum("nck,nk->nc", gap, self.normals[other])
        shared = (self.index[one][:, :, None] == self.index[other][:, None, :]).any(axis=2)
        return np.where(shared | (np.abs(height) <= IN_PLANE * self.size), 0.0, height)

    def _cross(self, one: Ints, other: Ints, above: Floats, below: Floats) -> Bools:
        """Whether triangles that straddle each other's planes cross."""
        line = vector_product(self.normals[one], self.normals[other])
        with np.errstate(invalid="ignore", divide="ignore"):
            line /= np.linalg.norm(line, axis=1, keepdims=True)
        origin = self.corners[one][:, :1]
        low_a, high_a = _segment(self.corners[one] - origin, above, line)
        low_b, high_b = _segment(self.corners[other] - origin, below, line)
        overlap = np.minimum(high_a, high_b) - np.maximum(low_a, low_b)
        return np.asarray(overlap > TOUCH * self.size)

    def _overlap(self, one: Ints, other: Ints) -> Bools:
        """Whether triangles in one plane cover a common area: no side of either triangle has the
        other triangle wholly on its outer side.
        """
        result = np.zeros(len(one), dtype=bool)
        left = np.arange(len(one))
        for here, there in ((one, other), (other, one)):
            for start, end in _SIDES:
                a, b = self.corners[here[left]], self.corners[there[left]]
                inward = vector_product(self.normals[here[left]], a[:, end] - a[:, start])
                length = np.linalg.norm(inward, axis=1)
                reach = np.einsum("nck,nk->nc", b - a[:, start][:, None], inward).max(axis=1)
                left = left[reach > TOUCH * self.size * length]
        result[left] = True
        return result


def _one_sided(heights: Floats) -> Bools:
    """Whether the inside of a triangle with these corner heights (n, 3) is off the plane."""
    some = (heights != 0).any(axis=1)
    return np.asarray(some & ((heights >= 0).all(axis=1) | (heights <= 0).all(axis=1)))


def _segment(corners: Floats, heights: Floats, line: Floats) -> tuple[Floats, Floats]:
    """The ends, along ``line`` (n, 3), of the cut of triangles (n, 3, 3) by the plane of height 0.

    The cut ends at corners in the plane and on sides that cross the plane.
    """
    along = np.einsum("nck,nk->nc", corners, line)
    low, high = np.full(len(line), np.inf), np.full(len(line), -np.inf)
    for start, end in _SIDES:
        p, q = heights[:, start], heights[:, end]
        with np.errstate(invalid="ignore", divide="ignore"):
            at = along[:, start] + p / (p - q) * (along[:, end] - along[:, start])
        for where, cut in ((p * q < 0, at), (p == 0, along[:, start])):
            low = np.where(where, np.minimum(low, cut), low)
            high = np.where(where, np.maximum(high, cut), high)
    return low, high


def triangulate(faces: Ints, flat: Floats | None = None) -> tuple[Ints, Ints]:
    """Triangles (T, 3) of polygons (F, k), -1 padded, and the face (T,) of each.

    Polygons are fanned from their first corner. With ``flat`` positions (V, 2), a polygon that is
    not convex is fanned from another corner or cut ear by ear.
    """
    faces = faces if flat is None else _fannable(faces, flat)
    k = faces.shape[1]
    fans = [faces[:, [0, c, c + 1]] for c in range(1, k - 1)]
    triangles = np.concatenate(fans)
    owner = np.tile(np.arange(len(faces)), k - 2)
    real = (triangles >= 0).all(axis=1)
    triangles, owner = triangles[real], owner[real]
    if flat is None or k <= 4:
        return triangles, owner
    turned = np.sign(signed_areas(flat[triangles]))
    whole = np.sign(np.bincount(owner, signed_areas(flat[triangles]), minlength=len(faces)))
    dented = np.unique(owner[turned * whole[owner] < 0])
    kept = ~np.isin(owner, dented)
    pieces, owners = [triangles[kept]], [owner[kept]]
    for face in dented.tolist():
        ears = _ears([v for v in faces[face].tolist() if v >= 0], flat)
        pieces.append(np.array(ears, dtype=np.int64).reshape(-1, 3))
        owners.append(np.full(len(ears), face))
    return np.concatenate(pieces), np.concatenate(owners)


def _fannable(faces: Ints, flat: Floats) -> Ints:
    """``faces`` with quads turned by one corner where only their second diagonal lies inside."""
    quads = (faces >= 0).sum(axis=1) == 4
    if not quads.any():
        return faces
    q = faces[quads][:, :4]
    first = signed_areas(flat[q[:, [0, 1, 2]]]) * signed_areas(flat[q[:, [0, 2, 3]]])
    second = signed_areas(flat[q[:, [1, 2, 3]]]) * signed_areas(flat[q[:, [1, 3, 0]]])
    turned = faces.copy()
    q = np.where(((first <= 0) & (second > 0))[:, None], np.roll(q, -1, axis=1), q)
    turned[np.flatnonzero(quads)[:, None], np.arange(4)] = q
    return turned


def _ears(polygon: list[int], flat: Floats) -> list[list[int]]:
    """The polygon cut ear by ear: a convex corner whose triangle holds no other corner."""
    area = float(signed_areas(flat[polygon][None])[0])
    rest, ears = list(polygon), []
    while len(rest) > 3:
        for n in range(len(rest)):
            ear = [rest[n - 1], rest[n], rest[(n + 1) % len(rest)]]
            others = np.array([v for v in rest if v not in ear], dtype=np.int64)
            turns = [
                signed_areas(flat[np.stack(np.broadcast_arrays(s, e, others), axis=1)]) * area
                for s, e in zip(ear, [*ear[1:], ear[0]], strict=True)
            ]
            convex = float(signed_areas(flat[ear][None])[0]) * area > 0
            if convex and not (np.min(turns, axis=0) >= 0).any():
                break
        else:
            n = 1
        ears.append([rest[n - 1], rest[n], rest[(n + 1) % len(rest)]])
        del rest[n]
    return [*ears, rest]
