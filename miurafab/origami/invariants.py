"""The conditions of a pattern measured from its arrays alone, whatever its facets look like.

The solver works on a regular grid; this module does not, so that what the solver claims is
measured by other code. Corners are numbered h = facet * k + corner; going round a vertex is the
permutation that takes each corner to the next one counter-clockwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from miurafab.geometry.angles import angle_between
from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern

DEGENERATE = 1e-6
"""An edge shorter than this part of the mean edge cannot be creased."""


@dataclass(frozen=True, eq=False)
class CornerRing:
    """The corners of all facets: ``vertex`` (C,), the corner's sector ``angle`` (C,) in the folded
    form, and the next corner counter-clockwise about the vertex, -1 at a border; C = F * k, and
    corners that a facet does not have hold vertex -1.
    """

    vertex: Ints
    angle: Floats
    following: Ints


def corner_ring(pattern: CreasePattern, points: Floats) -> CornerRing:
    """The corners of ``pattern`` with their angles in ``points`` (V, 3)."""
    faces = pattern.faces_vertices
    count, k = faces.shape
    sizes = (faces >= 0).sum(axis=1)[:, None]
    slot = np.arange(k)[None, :]
    after = np.where(slot + 1 < sizes, slot + 1, 0)
    before = np.where(slot > 0, slot - 1, sizes - 1)
    real = faces >= 0
    here: Floats = points[faces]
    to_next = points[np.take_along_axis(faces, after, axis=1)] - here
    to_previous = points[np.take_along_axis(faces, before, axis=1)] - here
    angle = np.where(real, angle_between(to_next, to_previous), 0.0)

    # the corner that starts each directed side: sides[e, 0] runs with the edge, sides[e, 1] against
    sides = np.full((len(pattern.edges_vertices), 2), -1, dtype=np.int64)
    edges = pattern.faces_edges
    face, corner = np.nonzero(real)
    edge = edges[face, corner]
    against = (pattern.edges_vertices[edge, 0] != faces[face, corner]).astype(np.int64)
    sides[edge, against] = face * k + corner
    # counter-clockwise next: the side that leaves this vertex along our incoming side
    incoming = np.take_along_axis(edges, before, axis=1)[face, corner]
    leaves_against = (pattern.edges_vertices[incoming, 0] != faces[face, corner]).astype(np.int64)
    following = np.full(count * k, -1, dtype=np.int64)
    following[face * k + corner] = sides[incoming, leaves_against]
    return CornerRing(faces.reshape(-1), angle.reshape(-1), following)


def interior_vertices(pattern: CreasePattern) -> Ints:
    """(I,) the vertices that belong to a facet and lie on no border edge."""
    inside = np.zeros(len(pattern.vertices_coords), dtype=bool)
    inside[pattern.faces_vertices[pattern.faces_vertices >= 0]] = True
    open_edges = (pattern.edges_faces < 0).any(axis=1)
    inside[pattern.edges_vertices[open_edges]] = False
    return np.flatnonzero(inside)


def angle_surplus(ring: CornerRing, vertices: Ints) -> Floats:
    """(I,) sum of the sector angles minus 2 pi at ``vertices``, radians: developability."""
    real = ring.vertex >= 0
    total = np.bincount(ring.vertex[real], ring.angle[real], minlength=int(vertices.max()) + 1)
    return np.asarray(total[vertices] - 2 * np.pi, dtype=np.float64)


def kawasaki_residual(ring: CornerRing, vertices: Ints) -> Floats:
    """(I,) |alternate sum of sector angles - pi| at interior ``vertices``, radians.

    Kawasaki's condition for any even degree; a vertex of odd degree cannot fold flat and gets pi.
    """
    corners = np.flatnonzero(ring.vertex >= 0)
    start = np.full(int(ring.vertex.max()) + 1, -1, dtype=np.int64)
    start[ring.vertex[corners]] = corners
    first = start[vertices]
    at, done = first, np.zeros(len(vertices), dtype=bool)
    sums = np.zeros((2, len(vertices)))
    steps = np.zeros(len(vertices), dtype=np.int64)
    parity = 0
    while not done.all():
        sums[parity] += np.where(done, 0.0, ring.angle[at])
        steps += ~done
        at = np.where(done, at, ring.following[at])
        done |= at == first
        parity = 1 - parity
    odd = steps % 2 == 1
    residual: Floats = np.where(odd, np.pi, np.abs(sums[0] - np.pi))
    return residual


def facet_planarity(pattern: CreasePattern, points: Floats) -> Floats:
    """(F,) the largest |det(p1 - p0, p2 - p0, p3 - p0)| over four corners of each facet, divided by
    the cube of the mean edge length; 0 for triangles.
    """
    faces = pattern.faces_vertices
    mean = float(edge_lengths(points, pattern.edges_vertices).mean())
    worst = np.zeros(len(faces))
    for corner in range(3, faces.shape[1]):
        real = faces[:, corner] >= 0
        p = points[faces[real][:, [0, 1, 2, corner]]]
        a, b, c = (p[:, n] - p[:, 0] for n in (1, 2, 3))
        volume = np.abs(np.einsum("fk,fk->f", a, np.cross(b, c)))
        worst[real] = np.maximum(worst[real], volume / mean**3)
    return worst


def isometry(pattern: CreasePattern) -> Floats:
    """(F,) the largest relative difference, flat to folded, of each facet's sides and diagonals.

    The diagonals make it an isometry of the facet and not only of its border. A side that is
    degenerate in both forms has no relative difference; the audit names it by itself.
    """
    assert pattern.folded_coords is not None
    faces = pattern.faces_vertices
    mean = float(edge_lengths(pattern.folded_coords, pattern.edges_vertices).mean())
    worst = np.zeros(len(faces))
    k = faces.shape[1]
    for one in range(k):
        for other in range(one + 1, k):
            real = faces[:, other] >= 0
            ends = faces[real][:, [one, other]]
            flat = edge_lengths(pattern.vertices_coords, ends)
            folded = edge_lengths(pattern.folded_coords, ends)
            longer = np.maximum(flat, folded)
            sound = longer > DEGENERATE * mean
            difference = np.where(sound, np.abs(flat - folded) / np.where(sound, longer, 1.0), 0.0)
            worst[real] = np.maximum(worst[real], difference)
    return worst
