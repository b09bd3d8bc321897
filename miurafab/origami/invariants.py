"""The invariants of a pattern, measured from its arrays alone, for facets of any shape.

The solver works on a regular grid and this module does not, so that other code measures what the
solver claims. Corners are numbered h = facet * k + corner. The ring around a vertex is a
permutation that maps each corner to the next corner counter-clockwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from miurafab.geometry.angles import angle_between
from miurafab.geometry.arrays import Bools, Floats, Ints, vector_product
from miurafab.geometry.polygons import (
    edge_lengths,
    filled,
    next_corners,
    previous_corners,
    reflex_corners,
    sides_and_diagonals,
)
from miurafab.origami.crease_pattern import CreasePattern

EXACT = 1e-10
"""The residual up to which planarity, developability and isometry count as exact."""

DEGENERATE = 1e-6
"""An edge shorter than this part of the mean edge cannot be creased."""


ROUNDINGS = 64
"""A residual may be as many roundings of a coordinate, as a part of the mean edge."""


@dataclass(frozen=True, eq=False)
class Residuals:
    """The residuals of a folded pattern: of its facets (F,), of its ``interior`` vertices (I,), of
    its seams (S,), and the largest residual that counts as exact.
    """

    ring: CornerRing
    interior: Ints
    planarity: Floats
    developability: Floats
    flat_foldability: Floats
    isometry: Floats
    exact: float

    @property
    def worst(self) -> float:
        """The largest residual of planarity, developability and isometry."""
        found = (self.planarity, self.developability, self.isometry)
        return max(float(each.max(initial=0.0)) for each in found)


def residuals(pattern: CreasePattern) -> Residuals:
    """All residuals of the folded ``pattern``."""
    assert pattern.folded_coords is not None
    ring, inner = corner_ring(pattern, pattern.folded_coords), interior_vertices(pattern)
    return Residuals(
        ring,
        inner,
        facet_planarity(pattern, pattern.folded_coords),
        np.abs(angle_defect(ring, inner)),
        kawasaki_residual(ring, inner, pattern.edges_creased),
        isometry(pattern),
        exactness(pattern),
    )


def exactness(pattern: CreasePattern) -> float:
    """The largest residual that counts as exact.

    It is ``EXACT``, and more where the sheet lies so far from the origin that its coordinates have
    no digits left for that: at a distance D, a coordinate is rounded by D times 1.1e-16. A flat
    pattern that was unfolded from a rounded folded form is as exact as that, and so are two forms
    that their file has rounded.
    """
    assert pattern.folded_coords is not None
    mean = float(edge_lengths(pattern.folded_coords, pattern.edges_vertices).mean())
    rounding = float(np.spacing(np.abs(pattern.folded_coords).max()))
    known = max(2 * (pattern.unfolded or 0.0), pattern.rounded or 0.0)
    return max(EXACT + ROUNDINGS * rounding / mean, known)


@dataclass(frozen=True, eq=False)
class CornerRing:
    """The C = F * k corners of all facets.

    ``vertex`` (C,) is -1 where a facet has fewer corners; ``angle`` (C,) is the sector angle, which
    is more than pi where the facet is not convex;
    ``following`` (C,) the next corner counter-clockwise about the vertex, -1 at a border, and
    ``edge`` (C,) the edge on the way there, -1 where a facet has fewer corners.
    """

    vertex: Ints
    angle: Floats
    following: Ints
    edge: Ints


def corner_ring(pattern: CreasePattern, points: Floats) -> CornerRing:
    """The corners of ``pattern`` with their angles in ``points`` (V, 3)."""
    faces = pattern.faces_vertices
    count, k = faces.shape
    angle = corner_angles(points, faces)

    # the corner that starts each directed side: sides[e, 0] along the edge, sides[e, 1] against it
    sides = np.full(pattern.edges_vertices.shape, -1)
    edges = pattern.faces_edges
    face, corner = np.nonzero(faces >= 0)
    here, vertex = face * k + corner, faces[face, corner]
    outgoing = edges[face, corner]
    sides[outgoing, (pattern.edges_vertices[outgoing, 0] != vertex).astype(np.int64)] = here
    # the next corner counter-clockwise starts the side opposite to the incoming side
    incoming = edges[face, previous_corners(faces)[face, corner]]
    leaves_against = (pattern.edges_vertices[incoming, 0] != vertex).astype(np.int64)
    following, edge = np.full((2, count * k), -1)
    following[here], edge[here] = sides[incoming, leaves_against], incoming
    return CornerRing(faces.reshape(-1), angle.reshape(-1), following, edge)


def corner_angles(points: Floats, faces: Ints) -> Floats:
    """(F, k) the angles at the corners of ``faces`` (F, k) in ``points`` (V, 2 or 3), radians, more
    than pi where a facet is not convex; 0 where it has fewer corners.
    """
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    here = points[faces]
    to_next, to_previous = (
        points[np.take_along_axis(faces, beside, axis=1)] - here
        for beside in (next_corners(faces), previous_corners(faces))
    )
    angle = np.where(faces >= 0, angle_between(to_next, to_previous), 0.0)
    return np.asarray(np.where(reflex_corners(points, faces), 2 * np.pi - angle, angle))


def interior_vertices(pattern: CreasePattern) -> Ints:
    """(I,) the vertices that belong to a facet and lie on no border edge."""
    open_edges = (pattern.edges_faces < 0).any(axis=1)
    inside = np.setdiff1d(pattern.faces_vertices, pattern.edges_vertices[open_edges])
    return np.asarray(inside[inside >= 0])


def angle_defect(ring: CornerRing, vertices: Ints) -> Floats:
    """(I,) 2 pi minus the sum of the sector angles at interior ``vertices``, radians; 0 is
    developable.
    """
    real = ring.vertex >= 0
    total = np.bincount(ring.vertex[real], ring.angle[real])
    return np.asarray(2 * np.pi - total[vertices])


def kawasaki_residual(ring: CornerRing, vertices: Ints, creased: Bools) -> Floats:
    """(I,) |alternate sum of sector angles - pi| at interior ``vertices``, radians, of both sums
    the larger.

    A sector runs from one of the ``creased`` edges (E,) to the next. It is Kawasaki's condition for
    any even number of creases; a vertex of an odd number cannot fold flat and gets pi, and one
    without creases gets 0.
    """
    names, start = np.unique(ring.vertex, return_index=True)
    first = start[np.searchsorted(names, vertices)]
    at, done = first, np.zeros(len(vertices), dtype=bool)
    sums = np.zeros((2, len(vertices)))
    creases, here = np.zeros(len(vertices), dtype=np.int64), np.arange(len(vertices))
    while not done.all():
        sums[creases % 2, here] += np.where(done, 0.0, ring.angle[at])
        creases += ~done & creased[ring.edge[at]]
        at = np.where(done, at, ring.following[at])
        done = at == first
    odd = creases % 2 == 1
    off = np.abs(sums - np.pi).max(axis=0)
    return np.where(creases == 0, 0.0, np.where(odd, np.pi, off))


def facet_planarity(pattern: CreasePattern, points: Floats) -> Floats:
    """(F,) the largest |det(a - p0, b - p0, p - p0)| over the corners p of each facet, divided by
    the cube of the mean edge length; 0 for triangles.

    Of a quad it is the determinant of its corners. The corner a is the farthest from p0, and b
    that of the largest triangle with the two: corners in line say nothing of a plane.
    """
    faces = pattern.faces_vertices
    mean = float(edge_lengths(points, pattern.edges_vertices).mean())
    corners = points[filled(faces)]
    spokes = corners - corners[:, :1]
    here = np.arange(len(faces))
    a = spokes[here, np.linalg.norm(spokes, axis=2).argmax(axis=1)]
    across = vector_product(a[:, None], spokes)
    normal = across[here, np.linalg.norm(across, axis=2).argmax(axis=1)]
    volume = np.abs(np.einsum("fk,fck->fc", normal, spokes)).max(axis=1)
    return np.asarray(np.where((faces >= 0).sum(axis=1) > 3, volume, 0.0) / mean**3)


def isometry(pattern: CreasePattern) -> Floats:
    """(F,) the largest relative difference, flat to folded, of each facet's sides and diagonals.

    With the diagonals it is an isometry of the facet and not of its border alone. A side that is
    degenerate in both forms counts as 0; verification reports it on its own.
    """
    assert pattern.folded_coords is not None
    faces = pattern.faces_vertices
    mean = float(edge_lengths(pattern.folded_coords, pattern.edges_vertices).mean())
    worst = np.zeros(len(faces))
    for facets, ends in sides_and_diagonals(faces):
        flat = edge_lengths(pattern.vertices_coords, ends)
        folded = edge_lengths(pattern.folded_coords, ends)
        longer = np.maximum(flat, folded)
        sound = longer > DEGENERATE * mean
        difference = np.abs(flat[sound] - folded[sound]) / longer[sound]
        worst[facets[sound]] = np.maximum(worst[facets[sound]], difference)
    return worst


def seam_gaps(pattern: CreasePattern) -> Floats:
    """(S,) how far the two edges of each seam are from being one, in mean edges.

    It is the difference of their lengths when flat or, if larger, the distance of their ends in the
    folded form.
    """
    pairs = pattern.seam_vertices
    if not len(pairs):
        return np.empty(0)
    ends = pattern.vertices_coords[pairs]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=2)
    gaps = np.abs(lengths[:, 1] - lengths[:, 0])
    if pattern.folded_coords is not None:
        ends = pattern.folded_coords[pairs]
        gaps = np.maximum(gaps, np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2).max(axis=1))
    mean = float(edge_lengths(pattern.vertices_coords, pattern.edges_vertices).mean())
    return np.asarray(gaps / mean)


def crossed_facets(pattern: CreasePattern) -> Ints:
    """The facets of the flat pattern of which two sides cross: bow-ties.

    Their corners turn to both sides, so that sector angles say little of them.
    """
    faces, points = pattern.faces_vertices, pattern.vertices_coords
    sizes, k = (faces >= 0).sum(axis=1), faces.shape[1]
    after = next_corners(faces)
    heads = np.take_along_axis(faces, after, axis=1)
    crossed = np.zeros(len(faces), dtype=bool)
    for one in range(k):
        for other in range(one + 2, k):
            apart = np.flatnonzero((other < sizes) & (after[:, other] != one))
            a, b = points[faces[apart, one]], points[heads[apart, one]]
            c, d = points[faces[apart, other]], points[heads[apart, other]]
            across = _turn(a, b, c) * _turn(a, b, d) < 0
            crossed[apart] |= across & (_turn(c, d, a) * _turn(c, d, b) < 0)
    return np.flatnonzero(crossed)


def dented_facets(pattern: CreasePattern) -> Ints:
    """The quads of the flat pattern that are not convex, bow-ties left out.

    None in a trimmed pattern, where the cut may leave a facet of any shape.
    """
    faces = pattern.faces_vertices
    if faces.shape[1] != 4 or (faces < 0).any():
        return np.empty(0, dtype=np.int64)
    p = pattern.vertices_coords[faces]
    turns = np.stack([_turn(p[:, k - 1], p[:, k], p[:, (k + 1) % 4]) for k in range(4)], axis=1)
    sides = np.linalg.norm(p - np.roll(p, 1, axis=1), axis=2).max(axis=1)
    whole = np.sign(turns.sum(axis=1))[:, None]
    dented = (turns * whole < -DEGENERATE * sides[:, None] ** 2).any(axis=1)
    return np.setdiff1d(np.flatnonzero(dented), crossed_facets(pattern))


def _turn(a: Floats, b: Floats, c: Floats) -> Floats:
    """(n,) twice the signed areas of the triangles a, b, c (n, 2)."""
    u, v = b - a, c - a
    return np.asarray(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
