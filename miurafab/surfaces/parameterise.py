"""Parameterisation: a disk-shaped triangle mesh laid into the plane with little stretch.

Three maps, each the start of the next:

- the least squares conformal map (Levy, Petitjean, Ray and Maillot, SIGGRAPH 2002, section 2): two
  vertices are fixed, and in the local coordinates of each triangle the derivative of the map by the
  complex conjugate is least in the sum of squares;
- if that turns a triangle over, Tutte's map, which never does (Tutte, Proc. London Math. Soc. 13,
  1963): the border is on a circle, every other vertex is the mean of its neighbours;
- as rigid as possible from there (Liu, Zhang, Xu, Gotsman and Gortler, Eurographics SGP 2008,
  section 4): in turn the rotation nearest to the map of each triangle, and the vertices that fit
  those rotations best. The matrix is constant and is factored once.

Inside, points of the plane are complex numbers.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.polygons import smallest_box
from miurafab.geometry.sparse import factor_symmetric
from miurafab.surfaces.topology import border_loops

Complexes = NDArray[np.complex128]

RIGID_ROUNDS = 60


def flatten(vertices: Floats, faces: Ints) -> Floats:
    """(V, 2) a layout of the disk mesh ``vertices`` (V, 3), ``faces`` (F, 3), in its own lengths.

    No triangle is turned over. The smallest box around the layout is upright, with its longer side
    along x. Triangles must have an area and the same orientation.
    """
    z = conformal(vertices, faces)
    if turned_over(z, faces).any():
        z = tutte(vertices, faces)
    z = _rigid(z, _local(vertices, faces), faces)
    return _upright(z)


def _upright(z: Complexes) -> Floats:
    """(V, 2) the layout turned so that its box is the smallest, the longer side along x."""
    angle, (along, across) = smallest_box(np.stack([z.real, z.imag], axis=1))
    z = z * np.exp(-1j * angle) * (1 if along >= 0.9999 * across else -1j)
    z = z - z.mean()
    return np.stack([z.real, z.imag], axis=1)


def turned_over(z: Complexes, faces: Ints) -> Bools:
    """(F,) which triangles of the layout ``z`` (V,) have no area or the wrong orientation."""
    e1, e2 = z[faces[:, 1]] - z[faces[:, 0]], z[faces[:, 2]] - z[faces[:, 0]]
    return np.asarray((e1.conj() * e2).imag <= 0)


def _local(vertices: Floats, faces: Ints) -> Complexes:
    """(F, 3) each triangle in a plane of its own: the first corner at 0, the second on x."""
    corners = vertices[faces]
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    x = np.linalg.norm(e1, axis=1)
    unit = e1 / x[:, None]
    x2 = np.einsum("fk,fk->f", e2, unit)
    y2 = np.linalg.norm(e2 - x2[:, None] * unit, axis=1)
    return np.stack([0j * x, x + 0j, x2 + 1j * y2], axis=1)


def conformal(vertices: Floats, faces: Ints) -> Complexes:
    """(V,) the least squares conformal layout, scaled to the area of the mesh."""
    local = _local(vertices, faces)
    area = (local[:, 1].conj() * local[:, 2]).imag
    # complex weights of the corners: the opposite side over the root of twice the area
    weights = (np.roll(local, -2, axis=1) - np.roll(local, -1, axis=1)) / np.sqrt(area)[:, None]
    row = np.repeat(np.arange(len(faces)), 3)
    matrix = sparse.coo_array(
        (weights.ravel(), (row, faces.ravel())), shape=(len(faces), len(vertices))
    ).tocsc()
    held = _far_apart(vertices)
    free = np.setdiff1d(np.arange(len(vertices)), held)
    pinned = np.array([0.0 + 0j, np.linalg.norm(vertices[held[1]] - vertices[held[0]]) + 0j])
    a, b = matrix[:, free], -(matrix[:, held] @ pinned)
    normal = (a.conj().T @ a).tocsc()
    z = np.zeros(len(vertices), dtype=complex)
    z[held] = pinned
    # in real and imaginary parts: SuperLU is ten times faster on a real matrix of twice the size
    real = sparse.block_array([[normal.real, -normal.imag], [normal.imag, normal.real]]).tocsc()
    right = a.conj().T @ b
    parts = factor_symmetric(real).solve(np.concatenate([right.real, right.imag]))
    z[free] = parts[: len(free)] + 1j * parts[len(free) :]
    e1, e2 = z[faces[:, 1]] - z[faces[:, 0]], z[faces[:, 2]] - z[faces[:, 0]]
    laid = float((e1.conj() * e2).imag.sum())
    scaled: Complexes = z * np.sqrt(area.sum() / max(laid, 1e-300))
    return scaled


def _far_apart(vertices: Floats) -> Ints:
    start = _first_of_the_largest(np.linalg.norm(vertices - vertices.mean(axis=0), axis=1))
    end = _first_of_the_largest(np.linalg.norm(vertices - vertices[start], axis=1))
    return np.array([start, end])


def _first_of_the_largest(values: Floats) -> int:
    """The first index of a value equal to the largest, up to rounding: symmetry makes equals."""
    return int(np.flatnonzero(values >= (1 - 1e-6) * values.max())[0])


def tutte(vertices: Floats, faces: Ints) -> Complexes:
    """(V,) Tutte's layout, with the border on a circle by its length and equal weights."""
    loop = border_loops(faces)[0]
    steps = np.linalg.norm(vertices[np.roll(loop, -1)] - vertices[loop], axis=1)
    at = np.concatenate([[0.0], np.cumsum(steps[:-1])]) / steps.sum()
    z = np.zeros(len(vertices), dtype=complex)
    z[loop] = steps.sum() / (2 * np.pi) * np.exp(2j * np.pi * at)
    sides = np.unique(np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    count = len(vertices)
    ones = np.ones(len(sides))
    graph = sparse.coo_array((ones, (sides[:, 0], sides[:, 1])), shape=(count, count)).tocsr()
    graph = graph + graph.T
    free = np.setdiff1d(np.arange(count), loop)
    degree = np.asarray(graph.sum(axis=1), dtype=np.float64).ravel()[free]
    matrix = (sparse.diags_array(degree) - graph[free][:, free]).tocsc()
    right = graph[free][:, loop] @ z[loop]
    factor = factor_symmetric(matrix)
    z[free] = factor.solve(right.real) + 1j * factor.solve(right.imag)
    return z


def _rigid(z: Complexes, local: Complexes, faces: Ints) -> Complexes:
    """The layout made as rigid as possible: the last in which no triangle is turned over."""
    # side k runs from corner k to the next; its weight is the cotangent of the opposite angle
    side = np.roll(local, -1, axis=1) - local
    to, back = np.roll(local, -2, axis=1), local
    opposite = (back - to).conj() * (np.roll(local, -1, axis=1) - to)
    weight = np.clip(opposite.real / np.abs(opposite.imag), 0.05, 20.0)
    tail, head = faces, np.roll(faces, -1, axis=1)
    count = len(z)
    rows = np.concatenate([tail.ravel(), head.ravel(), tail.ravel(), head.ravel()])
    columns = np.concatenate([tail.ravel(), head.ravel(), head.ravel(), tail.ravel()])
    w = weight.ravel()
    matrix = sparse.coo_array(
        (np.concatenate([w, w, -w, -w]), (rows, columns)), shape=(count, count)
    ).tocsc()
    matrix = matrix + sparse.coo_array(([w.mean()], ([0], [0])), shape=(count, count)).tocsc()
    factor = factor_symmetric(matrix)
    best = z
    energy = np.inf
    for _ in range(RIGID_ROUNDS):
        turn = (weight * (z[head] - z[tail]) * side.conj()).sum(axis=1)
        turn = turn / np.maximum(np.abs(turn), 1e-300)
        pull = (weight * turn[:, None] * side).ravel()
        x, y = (
            factor.solve(
                np.bincount(head.ravel(), part, count) - np.bincount(tail.ravel(), part, count)
            )
            for part in (pull.real, pull.imag)
        )
        z = x + 1j * y
        if turned_over(z, faces).any():
            # half the step keeps part of the gain
            z = (z - z.mean() + best - best.mean()) / 2
            if turned_over(z, faces).any():
                break
        best = z
        misfit = weight * np.abs(z[head] - z[tail] - turn[:, None] * side) ** 2
        if misfit.sum() > (1 - 1e-4) * energy:
            break
        energy = float(misfit.sum())
    return best
