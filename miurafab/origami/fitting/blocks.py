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
from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.quads import QuadCharts

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
    """The fold angle at each of the :attr:`QuadCharts.neighbouring_facets` (f, g), in (-pi, pi].

    With n_f and n_g the normals and e the direction of the crease, f to its left:
    rho = atan2(s, c), s = (n_f x n_g) . e, c = n_f . n_g, so that

        (s^2 + c^2) d rho = c ds - s dc.

    With N the area vector of a facet, its normal changes by that part of dN / |N| that is
    perpendicular to it; N = (p2 - p0) x (p3 - p1).
    """
    faces = charts.faces_vertices
    p = points[faces]
    a, b = p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]
    vector = np.cross(a, b)
    size = np.linalg.norm(vector, axis=1)
    normal = vector / size[:, None]
    f, g = charts.neighbouring_facets.T
    beside = faces[f, 1] == faces[g, 0]
    ends = np.stack([np.where(beside, faces[f, 1], faces[f, 3]), faces[f, 2]], axis=1)
    along = points[ends[:, 1]] - points[ends[:, 0]]
    length = np.linalg.norm(along, axis=1)[:, None]
    e, n, m = along / length, normal[f], normal[g]
    both = np.cross(n, m)
    c, s = (np.einsum("nk,nk->n", *pair)[:, None] for pair in ((n, m), (both, e)))
    whole = c**2 + s**2
    parts = []
    for one, own, change in (
        (f, n, c * np.cross(m, e) - s * m),
        (g, m, c * np.cross(e, n) - s * n),
    ):
        change = change - own * np.einsum("nk,nk->n", own, change)[:, None]
        change = change / whole / size[one][:, None]
        by_a, by_b = np.cross(b[one], change), np.cross(change, a[one])
        parts += [-by_a, -by_b, by_a, by_b]
    turn = c * (both - s * e) / whole / length
    vertices = np.concatenate([faces[f], faces[g], ends], axis=1)
    rho = np.arctan2(s[:, 0], c[:, 0])
    return rho, vertices, np.stack([*parts, -turn, turn], axis=1)


def stacked(blocks: list[Block], size: int) -> tuple[Floats, sparse.csr_array]:
    """The values (n,) of all ``blocks`` and their Jacobian (n, ``size``)."""
    columns, widths = [], []
    for _, vertices, _ in blocks:
        columns.append((vertices[:, :, None] * 3 + np.arange(3)).reshape(-1))
        widths.append(np.full(len(vertices), 3 * vertices.shape[1]))
    starts = np.concatenate([[0], np.cumsum(np.concatenate(widths))])
    data = np.concatenate([gradient.reshape(-1) for _, _, gradient in blocks])
    values = np.concatenate([value for value, _, _ in blocks])
    matrix = sparse.csr_array((data, np.concatenate(columns), starts), shape=(len(values), size))
    return values, matrix
