"""Measures of a sheet with their gradients: lengths, angles, ratios of sides, Kawasaki's residual.

A block holds n values, the k vertices that each depends on, and its gradient by them. The limits
(:mod:`~miurafab.origami.fitting.inequalities`) and the hinges of the fair objective
(:mod:`~miurafab.origami.fitting.objective`) are made of the same blocks. A vertex may stand twice
among the k; its gradients add up.
"""

from __future__ import annotations

import itertools

import numpy as np
from scipy import sparse

from miurafab.geometry.angles import sectors
from miurafab.geometry.arrays import Floats, Ints, vector_product
from miurafab.geometry.quads import QuadCharts

_AXES = np.arange(3, dtype=np.int32)

Block = tuple[Floats, Ints, Floats]
"""Values (n,), the vertices that each depends on (n, k), and its gradient (n, k, 3)."""


def lengths(points: Floats, edges: Ints) -> Block:
    """The lengths of ``edges`` (E, 2) in ``points`` (V, 3)."""
    along = points[edges[:, 1]] - points[edges[:, 0]]
    length = np.linalg.norm(along, axis=1)
    unit = along / length[:, None]
    return length, edges, np.stack([-unit, unit], axis=1)


def angles(points: Floats, corners: Ints) -> Block:
    """The angles at ``corners`` (n, 3), each a vertex and the ends of its two sides."""
    centre = points[corners[:, 0]]
    alpha, to_a, to_b = sectors(points[corners[:, 1]] - centre, points[corners[:, 2]] - centre)
    return alpha, corners, np.stack([-(to_a + to_b), to_a, to_b], axis=1)


def corner_angles(points: Floats, faces: Ints) -> Block:
    """The angles at all corners of ``faces`` (F, 4)."""
    corners = np.stack([faces, np.roll(faces, -1, axis=1), np.roll(faces, 1, axis=1)], axis=-1)
    return angles(points, corners.reshape(-1, 3))


def side_ratios(points: Floats, faces: Ints, limit: float) -> Block:
    """``limit`` |e| - |e'| for each ordered pair of sides e, e' of ``faces`` (F, 4)."""
    sides = [lengths(points, faces[:, [k, (k + 1) % 4]]) for k in range(4)]
    pairs = list(itertools.permutations(sides, 2))
    return (
        np.concatenate([limit * short[0] - long[0] for short, long in pairs]),
        np.concatenate([np.concatenate([short[1], long[1]], axis=1) for short, long in pairs]),
        np.concatenate(
            [np.concatenate([limit * short[2], -long[2]], axis=1) for short, long in pairs]
        ),
    )


def kawasaki(points: Floats, charts: QuadCharts) -> Block:
    """a0 + a2 - pi at each interior vertex of ``charts``."""
    centre, ring = charts.interior_vertices, charts.interior_neighbours
    first, third = (
        angles(points, np.stack([centre, ring[:, k], ring[:, k + 1]], axis=1)) for k in (0, 2)
    )
    return (
        first[0] + third[0] - np.pi,
        np.concatenate([first[1], third[1]], axis=1),
        np.concatenate([first[2], third[2]], axis=1),
    )


def folds(points: Floats, charts: QuadCharts) -> Block:
    """The fold angle at each of the :attr:`QuadCharts.neighbouring_facets` (f, g), in (-pi, pi],
    by its six vertices: the four of f, and the two of g that are not in f.

    With n_f and n_g the normals and e the direction of the crease, f to its left:
    rho = atan2(s, c), s = (n_f x n_g) . e, c = n_f . n_g, so that

        (s^2 + c^2) d rho = c ds - s dc.

    With N the area vector of a facet, its normal changes by that part of dN / |N| that is
    perpendicular to it; N = (p2 - p0) x (p3 - p1).
    """
    faces = charts.faces_vertices
    p = points[faces]
    a, b = p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]
    vector = vector_product(a, b)
    size = np.linalg.norm(vector, axis=1)
    normal = vector / size[:, None]
    f, g = charts.neighbouring_facets.T
    # the crease goes from the corner ``begin`` of f, the corner 0 of g, to the corner 2 of f
    is_beside = faces[f, 1] == faces[g, 0]
    begin = np.where(is_beside, 1, 3)
    along = points[faces[f, 2]] - points[faces[f, begin]]
    length = np.linalg.norm(along, axis=1)[:, None]
    e, n, m = along / length, normal[f], normal[g]
    both = vector_product(n, m)
    c, s = (np.einsum("nk,nk->n", *pair)[:, None] for pair in ((n, m), (both, e)))
    whole = c**2 + s**2
    by_diagonals = []
    for one, own, change in (
        (f, n, c * vector_product(m, e) - s * m),
        (g, m, c * vector_product(e, n) - s * n),
    ):
        change = change - own * np.einsum("nk,nk->n", own, change)[:, None]
        change = change / whole / size[one][:, None]
        by_diagonals.append((vector_product(b[one], change), vector_product(change, a[one])))
    (by_a, by_b), (of_a, of_b) = by_diagonals
    turn = c * (both - s * e) / whole / length
    of_b = np.where(is_beside[:, None], of_b, -of_b)  # by the corner of g at the end of the crease
    by_vertex = np.stack([-by_a, -by_b, by_a + turn + of_b, by_b, of_a, -of_b], axis=1)
    by_vertex[np.arange(len(f)), begin] -= turn + of_a
    vertices = np.concatenate([faces[f], faces[g, 2][:, None], faces[g, begin][:, None]], axis=1)
    return np.arctan2(s[:, 0], c[:, 0]), vertices, by_vertex


def stacked(blocks: list[Block], size: int) -> tuple[Floats, sparse.csr_array]:
    """The values (n,) of all ``blocks`` and their Jacobian (n, ``size``)."""
    columns, widths = [], []
    for _, vertices, _ in blocks:
        columns.append((vertices.astype(np.int32)[:, :, None] * 3 + _AXES).reshape(-1))
        widths.append(np.full(len(vertices), 3 * vertices.shape[1]))
    starts = np.concatenate([[0], np.cumsum(np.concatenate(widths))]).astype(np.int32)
    data = np.concatenate([gradient.reshape(-1) for _, _, gradient in blocks])
    values = np.concatenate([value for value, _, _ in blocks])
    matrix = sparse.csr_array((data, np.concatenate(columns), starts), shape=(len(values), size))
    return values, matrix
