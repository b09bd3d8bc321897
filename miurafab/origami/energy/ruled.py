"""The paper beside curved creases, which has to bend: where, and how its model can do so.

Two folds that meet at a vertex, not in line, lock rigid facets. There flat edges are rulings, about
which the paper bends as easily as creases turn. The rulings of a drawing are a guess but where they
are parallel, so elsewhere facets bend as easily about their diagonals that come to such a vertex.
"""

from __future__ import annotations

import numpy as np

from miurafab.geometry.arrays import Bools, Floats, Ints, vector_product
from miurafab.geometry.polygons import previous_corners
from miurafab.origami.crease_pattern import UNCREASED, CreasePattern

IN_LINE = 1e-3
"""Radians; two folds that meet with a smaller turn are one straight crease."""
PARALLEL = 0.02
"""Radians; rulings that differ by less are those of a cylinder."""
PLUMP = 0.5
"""The height over the longest side from which on a triangle is not thin."""


def bent_corners(pattern: CreasePattern) -> Bools:
    """(V,) the interior vertices at which two folds meet that are not in line."""
    points, edges = pattern.vertices_coords, pattern.edges_vertices
    letters = pattern.edges_assignment
    count = np.bincount(edges[np.isin(letters, ("M", "V"))].ravel(), minlength=len(points))
    free = np.bincount(edges[np.isin(letters, ("U", "B", "C"))].ravel(), minlength=len(points))
    total = np.zeros((len(points), 2))
    folds = edges[np.isin(letters, ("M", "V"))]
    along = points[folds[:, 1]] - points[folds[:, 0]]
    along /= np.maximum(np.linalg.norm(along, axis=1), np.finfo(float).tiny)[:, None]
    np.add.at(total, folds[:, 0], along)
    np.add.at(total, folds[:, 1], -along)
    return np.asarray((count == 2) & (free == 0) & (np.linalg.norm(total, axis=1) > IN_LINE))


def rulings_among(pattern: CreasePattern, flat: Ints) -> Bools:
    """(n,) which of the ``flat`` edges (n,) are rulings: they come to one of the
    :func:`bent_corners`.
    """
    return np.asarray(bent_corners(pattern)[pattern.edges_vertices[flat]].any(axis=1))


def is_ruled(pattern: CreasePattern) -> bool:
    """Whether flat edges of ``pattern`` are rulings, so that its facets have to bend."""
    flat = np.isin(pattern.edges_assignment, UNCREASED) & (pattern.edges_faces >= 0).all(axis=1)
    return bool(rulings_among(pattern, np.flatnonzero(flat)).any())


def loose_diagonals(pattern: CreasePattern, diagonals: Ints) -> Ints:
    """(n,) which of the ``diagonals`` (D, 2) of all facets, in their order, bend as easily as
    rulings: those that come to one of the :func:`bent_corners`, in facets that are no part of a
    cylinder. Of those that are, the rulings are parallel and come to each such corner.
    """
    faces, edges = pattern.faces_vertices, pattern.faces_edges
    size = (faces >= 0).sum(axis=1)
    bent = bent_corners(pattern)
    flat = (edges >= 0) & np.isin(pattern.edges_assignment, UNCREASED)[edges]
    ends = pattern.vertices_coords[pattern.edges_vertices]
    along = np.angle((ends[:, 1] - ends[:, 0]) @ [1.0, 1.0j])[edges]
    first = along[np.arange(len(faces)), flat.argmax(axis=1)]
    turned = np.abs(np.sin(along - first[:, None])) > PARALLEL
    before = np.take_along_axis(flat, previous_corners(faces), axis=1)
    lone = (faces >= 0) & bent[faces] & ~flat & ~before
    cylinder = ~((flat & turned) | lone).any(axis=1)
    facet = np.repeat(np.arange(len(size)), size - 3)
    return np.flatnonzero(bent[diagonals].any(axis=1) & ~cylinder[facet])


def plumpness(points: Floats, triangles: Ints, bars: Ints) -> Floats:
    """(B,) the factor on the compliance of ``bars`` (B, 2): less than 1 at thin ``triangles``
    (T, 3), for ``points`` (V, 3).

    A triangle of height h over a side L falls flat where its sides change by some (h / L)^2 of
    their length, and turns over, which paper does not.
    """
    corners = points[triangles]
    sides = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    area = vector_product(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    height = np.linalg.norm(area, axis=1) / sides.max(axis=1) ** 2
    ends = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2), axis=2)
    key = ends[..., 0] * len(points) + ends[..., 1]
    bar = np.sort(bars, axis=1) @ [len(points), 1]
    order = np.argsort(bar)
    least = np.full(len(bars), PLUMP)
    place = order[np.searchsorted(bar, key, sorter=order)]
    np.minimum.at(least, place, np.broadcast_to(height[:, None], place.shape))
    return np.asarray((least / PLUMP) ** 2)
