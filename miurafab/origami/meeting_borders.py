"""Borders that meet: pairs of border edges that are one line of the folded form.

Two border edges meet if, in the folded form,

- their ends coincide, and the edges run in opposite directions as seen from their facets;
- their lengths in the flat pattern are equal;
- no third edge coincides with them, and their facets do not lie on each other, as in a sheet that
  is folded flat without glue.

Such a pair is a seam, where two pieces or the two ends of a ring are glued together.
"""

from __future__ import annotations

import math

import numpy as np

from miurafab.geometry.angles import fold_angles
from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.nearest import tree_of
from miurafab.geometry.polygons import edge_lengths, facet_normals
from miurafab.origami.crease_pattern import CreasePattern

COINCIDENT = 1e-6
"""The distance of coincident points, over the diagonal of the box of the folded form."""

TOGETHER = math.radians(0.5)
"""Facets at a smaller angle lie on each other and are not glued."""


def meeting_borders(pattern: CreasePattern) -> Ints:
    """(S, 2) the pairs of border edges that meet, none if the folded form is unknown."""
    pairs = _coinciding(pattern)
    if not len(pairs):
        return pairs
    return np.asarray(pairs[np.abs(border_angles(pattern, pairs)) < math.pi - TOGETHER])


def border_angles(pattern: CreasePattern, pairs: Ints) -> Floats:
    """(S,) the fold angles of the creases on ``pairs`` (S, 2) of border edges that meet: radians,
    positive for a valley.
    """
    assert pattern.folded_coords is not None
    faces = pattern.edges_faces[pairs].max(axis=2)
    ends = with_facet_on_the_left(pattern, pairs[:, 0])
    normal = facet_normals(pattern.folded_coords, pattern.faces_vertices[faces.ravel()])
    left, right = normal.reshape(-1, 2, 3).swapaxes(0, 1)
    return fold_angles(pattern.folded_coords, ends, left, right)


def with_facet_on_the_left(pattern: CreasePattern, border: Ints) -> Ints:
    """(n, 2) the ends of the border edges ``border`` (n,), as their facet has them on its left."""
    turned = pattern.edges_faces[border, 0] < 0
    ends = pattern.edges_vertices[border]
    return np.where(turned[:, None], ends[:, ::-1], ends)


def _coinciding(pattern: CreasePattern) -> Ints:
    """(S, 2) the pairs of border edges of one length that coincide in the folded form."""
    border = np.flatnonzero((pattern.edges_faces >= 0).sum(axis=1) == 1)
    if pattern.folded_coords is None or len(border) < 2:
        return np.empty((0, 2), dtype=np.int64)
    ends = with_facet_on_the_left(pattern, border)
    folded = pattern.folded_coords[ends]
    near = COINCIDENT * float(np.linalg.norm(np.ptp(pattern.folded_coords, axis=0)))
    middles = tree_of(folded.mean(axis=1))
    pairs = middles.query_pairs(near, output_type="ndarray").astype(np.int64).reshape(-1, 2)
    pairs = np.sort(pairs, axis=1)
    one, other = folded[pairs[:, 0]], folded[pairs[:, 1]][:, ::-1]
    met = (np.linalg.norm(one - other, axis=2) <= near).all(axis=1)
    length = edge_lengths(pattern.vertices_coords, ends)
    met &= np.abs(length[pairs[:, 0]] - length[pairs[:, 1]]) <= near
    alone = np.bincount(pairs.ravel(), minlength=len(border)) == 1
    return np.asarray(border[pairs[met & alone[pairs].all(axis=1)]])
