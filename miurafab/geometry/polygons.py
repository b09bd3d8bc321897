"""Polygons for many at once: corners, means, normals and areas; lengths of edges; main axes.

``faces`` (F, k) are indices of corners, counter-clockwise, filled up with -1 where a face has fewer
than k corners. ``points`` are (V, 2) or (V, 3).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from miurafab.geometry.arrays import Bools, Floats, Ints, vector_product
from miurafab.geometry.connected import components


def filled(faces: Ints) -> Ints:
    """``faces`` (F, k) with the first corner of each face in place of -1."""
    return np.where(faces >= 0, faces, faces[:, :1])


def next_corners(faces: Ints) -> Ints:
    """(F, k) the slot of the corner after each corner; 0 after the last corner of a face."""
    slot = np.broadcast_to(np.arange(faces.shape[1]) + 1, faces.shape)
    return np.where(slot < (faces >= 0).sum(axis=1)[:, None], slot, 0)


def previous_corners(faces: Ints) -> Ints:
    """(F, k) the slot of the corner before each corner; the last corner before slot 0."""
    slot = np.broadcast_to(np.arange(faces.shape[1]), faces.shape)
    return np.where(slot > 0, slot - 1, (faces >= 0).sum(axis=1)[:, None] - 1)


def reversed_faces(faces: Ints) -> Ints:
    """``faces`` (F, k) with the corners of each face in the opposite order."""
    sizes = (faces >= 0).sum(axis=1)[:, None]
    slot = np.arange(faces.shape[1])
    return np.take_along_axis(faces, np.where(slot < sizes, sizes - 1 - slot, slot), axis=1)


def connected_parts(faces: Ints) -> tuple[int, Ints]:
    """The number of parts of ``faces`` (F, k), and the part (F,) of each face.

    Faces with a common corner belong to one part. Parts are numbered by their first face.
    """
    face, corner = np.nonzero(faces >= 0)
    vertex = faces[face, corner] + len(faces)
    count = len(faces) + int(faces.max(initial=-1)) + 1
    label = components(count, face, vertex)
    _, first, part = np.unique(label[: len(faces)], return_index=True, return_inverse=True)
    return len(first), np.argsort(np.argsort(first))[part].astype(np.int64)


def touching_themselves(faces: Ints) -> Ints:
    """(n,) which of ``faces`` (F, k) have one corner twice."""
    ordered = np.sort(faces, axis=1)
    again = (ordered[:, 1:] == ordered[:, :-1]) & (ordered[:, 1:] >= 0)
    return np.flatnonzero(again.any(axis=1))


def simple_loops(walk: Sequence[int]) -> list[list[int]]:
    """The places of a closed ``walk`` from vertex to vertex, parted into loops that have no vertex
    twice. Each begins at the vertex where it closes.

    >>> simple_loops([7, 1, 2, 1, 3])
    [[1, 2], [0, 3, 4]]
    """
    found, open_, place = list[list[int]](), list[int](), dict[int, int]()
    for at, vertex in enumerate(walk):
        if vertex in place:
            begin = place[vertex]
            found.append(open_[begin:])
            for each in open_[begin:]:
                del place[walk[each]]
            del open_[begin:]
        place[vertex] = len(open_)
        open_.append(at)
    return [*found, open_]


def no_polygons(points: Floats, faces: Ints) -> Ints:
    """(n,) which of ``faces`` (F, k) at ``points`` (V, 2) have no area, run clockwise, or have a
    border that meets itself.
    """
    count = (faces >= 0).sum(axis=1)
    bad = np.zeros(len(faces), dtype=bool)
    for corners in np.unique(count):
        own = np.flatnonzero(count == corners)
        shapes = points[faces[own, :corners]]
        bad[own] = signed_areas(shapes) <= 0
        if corners >= 3:
            bad[own] |= ~shapely.is_valid(shapely.polygons(shapes))
    return np.flatnonzero(bad)


def sides_and_diagonals(faces: Ints) -> Iterator[tuple[Ints, Ints]]:
    """For each pair of corners: the faces (n,) that have both, and the two vertices (n, 2)."""
    for pair in itertools.combinations(range(faces.shape[1]), 2):
        having = np.flatnonzero(faces[:, pair[1]] >= 0)
        yield having, faces[having][:, pair]


def facet_means(points: Floats, faces: Ints) -> Floats:
    """(F, d) the mean of the corners of each of ``faces`` (F, k) in ``points`` (V, d)."""
    real = faces >= 0
    corners = np.where(real[..., None], points[faces], 0.0)
    return np.asarray(corners.sum(axis=1) / real.sum(axis=1)[:, None])


def facet_normals(points: Floats, faces: Ints) -> Floats:
    """(F, 3) unit normals of ``faces`` (F, k) in ``points`` (V, 3); NaN for a face without area.

    The direction is that of the area vector, sum (p_i - p_0) x (p_i+1 - p_0) over the corners. With
    up to four corners the sum is the cross product of the diagonals, (p_2 - p_0) x (p_3 - p_1).
    """
    corners = points[filled(faces)]
    if corners.shape[1] == 4:
        normal = vector_product(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    else:
        spokes = corners - corners[:, :1]
        normal = vector_product(spokes, np.roll(spokes, -1, axis=1)).sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))


def reflex_corners(points: Floats, faces: Ints) -> Bools:
    """(F, k) the corners of ``faces`` (F, k) in ``points`` (V, 3) whose angle within the face is
    more than half a turn.

    These turn against the area vector of their face. A face without area has none.
    """
    here = points[filled(faces)]
    out = np.take_along_axis(here, next_corners(faces)[..., None], axis=1) - here
    back = np.take_along_axis(here, previous_corners(faces)[..., None], axis=1) - here
    turn = np.einsum("fck,fk->fc", vector_product(out, back), facet_normals(points, faces))
    return np.asarray((faces >= 0) & (turn < 0))


def facet_areas(points: Floats, faces: Ints) -> Floats:
    """(F,) the areas of planar ``faces`` (F, k) in ``points`` (V, 3): half the length of the area
    vector, sum (p_i - p_0) x (p_i+1 - p_0).
    """
    corners = points[filled(faces)]
    spokes = corners - corners[:, :1]
    vector = vector_product(spokes, np.roll(spokes, -1, axis=1)).sum(axis=1)
    return np.asarray(np.linalg.norm(vector, axis=1) / 2)


def edge_lengths(points: Floats, edges: Ints) -> Floats:
    """(E,) the lengths of ``edges`` (E, 2) in ``points`` (V, d)."""
    return np.asarray(np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1))


def signed_areas(polygons: Floats) -> Floats:
    """(n,) the areas of ``polygons`` (n, k, 2), negative for those that run clockwise.

    A polygon of fewer than k corners repeats its first corner at the end.
    """
    x, y = (polygons - polygons[:, :1]).transpose(2, 0, 1)
    return np.asarray((x[:, :-1] * y[:, 1:] - x[:, 1:] * y[:, :-1]).sum(axis=1) / 2)


def principal_axes(points: Floats) -> Floats:
    """(2, 2) the principal axes of ``points`` (n, 2) as columns, that of the least spread first.

    The sign of an eigenvector is arbitrary: its larger component is made positive.
    """
    centred = points - points.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    return np.asarray(axes * np.sign(axes[np.abs(axes).argmax(axis=0), [0, 1]]))


def smallest_box(points: Floats) -> tuple[float, Floats]:
    """The angle of the smallest box around ``points`` (n, 2), 0 to pi/2, and its extents (2,) along
    that angle and across it.

    A smallest box has a side along a side of the convex hull (Freeman and Shapira, Comm. ACM 18,
    1975). Of boxes within 0.01 % the one with the least angle is taken, so that rounding decides
    nothing.
    """
    hull = shapely.get_coordinates(shapely.convex_hull(shapely.multipoints(points)))
    sides = np.diff(hull[::-1], axis=0) if len(hull) > 1 else np.array([[1.0, 0.0]])
    angles = np.arctan2(sides[:, 1], sides[:, 0]) % (np.pi / 2)  # a right angle gives the same box
    angles = np.unique(np.round(np.where(np.pi / 2 - angles < 1e-6, 0.0, angles), 9))
    along = np.column_stack([np.cos(angles), np.sin(angles)])
    across = np.column_stack([-along[:, 1], along[:, 0]])
    sizes = np.column_stack([np.ptp(hull @ along.T, axis=0), np.ptp(hull @ across.T, axis=0)])
    areas = sizes.prod(axis=1)
    least = int(np.flatnonzero(areas <= 1.0001 * areas.min())[0])
    return float(angles[least]), sizes[least]
