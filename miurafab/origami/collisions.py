"""Where paper meets paper: facets that pass through each other, and flat facets that overlap.

Folded facets are split into triangles. Two triangles that cross do so along a segment, each end of
which is a side of one piercing the other; so testing sides against triangles finds every crossing
in general position. Facets that share a vertex are tested with the sides that do not end there:
their crossing starts at that vertex and ends on such a side. Facets that share an edge can only lie
on each other, which their fold angle shows.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from miurafab.origami.crease_pattern import CreasePattern

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_SIDES = ((0, 1), (1, 2), (2, 0))


def self_intersections(pattern: CreasePattern) -> Ints:
    """(n, 2) the pairs of facets of the folded form that pass through each other, sorted."""
    assert pattern.folded_coords is not None
    triangles, owner = triangulate(pattern.faces_vertices)
    points = pattern.folded_coords[triangles]
    first, second = _near_pairs(points)
    different = owner[first] != owner[second]
    first, second = first[different], second[different]
    adjacent = _share_an_edge(pattern, owner[first], owner[second])
    first, second = first[~adjacent], second[~adjacent]
    crossing = _sides_pierce(points, triangles, first, second)
    crossing |= _sides_pierce(points, triangles, second, first)
    pairs = np.sort(np.stack([owner[first], owner[second]], axis=1)[crossing], axis=1)
    folded_over = _folded_onto_each_other(pattern)
    return np.unique(np.concatenate([pairs, folded_over]), axis=0)


def overlaps(pattern: CreasePattern) -> Ints:
    """(n, 2) the pairs of facets of the flat pattern that cover a common area, sorted.

    Two triangles of positive area overlap unless one of their six sides separates them; overlap
    less than a millionth of a side deep is rounding. A facet turned over overlaps its neighbours.
    """
    triangles, owner = triangulate(pattern.faces_vertices)
    points = pattern.vertices_coords[triangles]
    first, second = _near_pairs(points)
    different = owner[first] != owner[second]
    first, second = first[different], second[different]
    depth = np.minimum(_least_depth(points, first, second), _least_depth(points, second, first))
    meet = depth > 1e-6 * float(np.linalg.norm(points[:, 1] - points[:, 0], axis=1).mean())
    pairs = np.sort(np.stack([owner[first], owner[second]], axis=1)[meet], axis=1)
    return np.unique(pairs, axis=0)


def _least_depth(points: Floats, one: Ints, other: Ints) -> Floats:
    """How deep triangle ``other`` reaches behind the sides of triangle ``one``, the least over the
    sides; negative where a side separates them. ``points`` (T, 3, 2), pair by pair.
    """
    a, b = points[one], points[other]
    area = np.cross(
        np.append(a[:, 1] - a[:, 0], np.zeros((len(a), 1)), axis=1),
        np.append(a[:, 2] - a[:, 0], np.zeros((len(a), 1)), axis=1),
    )[:, 2]
    depth = np.full(len(one), np.inf)
    for start, end in _SIDES:
        side = a[:, end] - a[:, start]
        inward = np.stack([-side[:, 1], side[:, 0]], axis=1) * np.sign(area)[:, None]
        with np.errstate(invalid="ignore", divide="ignore"):
            inward /= np.linalg.norm(side, axis=1, keepdims=True)
        reach = np.einsum("nck,nk->nc", b - a[:, start][:, None], inward).max(axis=1)
        depth = np.fmin(depth, reach)
    return depth


def triangulate(faces: Ints) -> tuple[Ints, Ints]:
    """Fan triangles (T, 3) of polygons (F, k), -1 padded, and the face (T,) of each."""
    k = faces.shape[1]
    fans = [faces[:, [0, c, c + 1]] for c in range(1, k - 1)]
    triangles = np.concatenate(fans)
    owner = np.tile(np.arange(len(faces)), k - 2)
    real = (triangles >= 0).all(axis=1)
    return triangles[real], owner[real]


def _near_pairs(points: Floats) -> tuple[Ints, Ints]:
    """Pairs of triangles (T, 3, 3) whose bounding boxes meet."""
    low, high = points.min(axis=1), points.max(axis=1)
    centre = (low + high) / 2
    radius = np.linalg.norm(high - low, axis=1) / 2
    pairs = cKDTree(centre).query_pairs(2 * float(radius.max()), output_type="ndarray")
    a, b = pairs[:, 0].astype(np.int64), pairs[:, 1].astype(np.int64)
    meet = ((low[a] <= high[b]) & (low[b] <= high[a])).all(axis=1)
    return a[meet], b[meet]


def _share_an_edge(pattern: CreasePattern, a: Ints, b: Ints) -> NDArray[np.bool_]:
    faces = len(pattern.faces_vertices)
    inner = pattern.edges_faces[(pattern.edges_faces >= 0).all(axis=1)]
    keys = np.sort(inner, axis=1) @ np.array([faces, 1])
    pairs = np.minimum(a, b) * faces + np.maximum(a, b)
    return np.isin(pairs, keys)


def _folded_onto_each_other(pattern: CreasePattern) -> Ints:
    flat_folded = np.abs(pattern.edges_fold_angle) > np.pi - 1e-6
    pairs = pattern.edges_faces[flat_folded & (pattern.edges_faces >= 0).all(axis=1)]
    return np.sort(pairs, axis=1)


def _sides_pierce(points: Floats, triangles: Ints, one: Ints, other: Ints) -> NDArray[np.bool_]:
    """Whether a side of triangle ``one`` passes through triangle ``other``, pair by pair.

    Sides that end at a vertex of ``other`` touch it there by construction and do not count.
    """
    crossing = np.zeros(len(one), dtype=bool)
    a = points[other, 0]
    e1, e2 = points[other, 1] - a, points[other, 2] - a
    normal = np.cross(e1, e2)
    for start, end in _SIDES:
        shared = (
            (triangles[one, start][:, None] == triangles[other])
            | (triangles[one, end][:, None] == triangles[other])
        ).any(axis=1)
        p, q = points[one, start], points[one, end]
        height_p = np.einsum("nk,nk->n", p - a, normal)
        height_q = np.einsum("nk,nk->n", q - a, normal)
        with np.errstate(invalid="ignore", divide="ignore"):
            at = height_p / (height_p - height_q)
            hit = p + at[:, None] * (q - p) - a
            d11, d12 = np.einsum("nk,nk->n", e1, e1), np.einsum("nk,nk->n", e1, e2)
            d22 = np.einsum("nk,nk->n", e2, e2)
            h1, h2 = np.einsum("nk,nk->n", hit, e1), np.einsum("nk,nk->n", hit, e2)
            det = d11 * d22 - d12 * d12
            s, t = (d22 * h1 - d12 * h2) / det, (d11 * h2 - d12 * h1) / det
            margin = 1e-9
            inside = (s > -margin) & (t > -margin) & (s + t < 1 + margin)
            crossing |= ~shared & (height_p * height_q < 0) & inside
    return crossing
