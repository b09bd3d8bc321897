"""Laying a disk-shaped triangle mesh into the plane, and a rectangle into the layout.

A mesh that is a graph over its mean plane is simply projected. Any other disk is mapped by least
squares conformal maps (Levy, Petitjean, Ray and Maillot, SIGGRAPH 2002, section 2): for each
triangle with local coordinates, the map's complex derivative with respect to the conjugate vanishes
as nearly as possible, two vertices held fixed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from miurafab.errors import TargetError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def flatten(vertices: Floats, faces: Ints) -> Floats:
    """(V, 2) a one-to-one layout of the disk mesh ``vertices`` (V, 3), ``faces`` (F, 3).

    Areas agree in total. Raises :class:`~miurafab.errors.TargetError` where a triangle turns over.
    """
    projected = _projection(vertices, faces)
    if _signed_areas(projected, faces).min() > 0:
        return projected
    flat = _conformal(vertices, faces)
    areas = _signed_areas(flat, faces)
    if areas.sum() < 0:
        flat, areas = flat * np.array([1.0, -1.0]), -areas
    if areas.min() <= 0:
        turned = int((areas <= 0).sum())
        raise TargetError(
            f"The mesh cannot be laid flat one-to-one: {turned} triangles turn over. Cut it into "
            "flatter pieces, or remesh it with more even triangles."
        )
    corners = vertices[faces]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    ).sum()
    scaled: Floats = flat * np.sqrt(area / (2 * areas.sum()))
    return scaled


def _signed_areas(flat: Floats, faces: Ints) -> Floats:
    a, b, c = flat[faces[:, 0]], flat[faces[:, 1]], flat[faces[:, 2]]
    ab, ac = b - a, c - a
    areas: Floats = (ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]) / 2
    return areas


def _projection(vertices: Floats, faces: Ints) -> Floats:
    """Onto the plane across the mean normal, turned so that the longer principal axis is x."""
    corners = vertices[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).sum(axis=0)
    length = np.linalg.norm(normal)
    if length == 0:
        return np.zeros((len(vertices), 2))
    normal = normal / length
    axis = np.eye(3)[int(np.argmin(np.abs(normal)))]
    x = np.cross(np.cross(normal, axis), normal)
    x /= np.linalg.norm(x)
    projected: Floats = vertices @ np.stack([x, np.cross(normal, x)], axis=1)
    return projected


def _conformal(vertices: Floats, faces: Ints) -> Floats:
    corners = vertices[faces]
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    x = np.linalg.norm(e1, axis=1)
    unit = e1 / x[:, None]
    x2 = np.einsum("fk,fk->f", e2, unit)
    y2 = np.linalg.norm(e2 - x2[:, None] * unit, axis=1)
    root = np.sqrt(x * y2)
    # complex weights of the three corners: the opposite side, over the root of twice the area
    weights = np.stack([(x2 - x) + 1j * y2, -(x2 + 1j * y2), x + 0j], axis=1) / root[:, None]
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
    z[free] = splu(normal).solve(a.conj().T @ b)
    return np.stack([z.real, z.imag], axis=1)


def _far_apart(vertices: Floats) -> Ints:
    start = int(np.argmax(np.linalg.norm(vertices - vertices.mean(axis=0), axis=1)))
    end = int(np.argmax(np.linalg.norm(vertices - vertices[start], axis=1)))
    return np.array([start, end])


def locate(flat: Floats, faces: Ints, points: Floats) -> tuple[Ints, Floats]:
    """The triangle (n,) of the layout that holds each of ``points`` (n, 2), -1 for none, and the
    barycentric coordinates (n, 3) in it.

    Each triangle is rasterised over the sorted points of its bounding box.
    """
    corners = flat[faces]
    low, high = corners.min(axis=1), corners.max(axis=1)
    order = np.argsort(points[:, 0])
    sorted_x = points[order, 0]
    margin = 1e-12 * (high - low).max()
    first = np.searchsorted(sorted_x, low[:, 0] - margin)
    last = np.searchsorted(sorted_x, high[:, 0] + margin, side="right")
    found = np.full(len(points), -1, dtype=np.int64)
    coordinates = np.zeros((len(points), 3))
    for start in range(0, len(faces), 4096):
        block = np.arange(start, min(start + 4096, len(faces)))
        counts = last[block] - first[block]
        triangle = np.repeat(block, counts)
        if not len(triangle):
            continue
        within = np.arange(len(triangle)) - np.repeat(np.cumsum(counts) - counts, counts)
        point = order[first[triangle] + within]
        y = points[point, 1]
        close = (y >= low[triangle, 1] - margin) & (y <= high[triangle, 1] + margin)
        triangle, point = triangle[close], point[close]
        weights = _barycentric(corners[triangle], points[point])
        inside = weights.min(axis=1) >= -1e-9
        found[point[inside]] = triangle[inside]
        coordinates[point[inside]] = weights[inside]
    return found, coordinates


def _barycentric(corners: Floats, points: Floats) -> Floats:
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, ac, ap = b - a, c - a, points - a
    det = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    s = (ap[:, 0] * ac[:, 1] - ap[:, 1] * ac[:, 0]) / det
    t = (ab[:, 0] * ap[:, 1] - ab[:, 1] * ap[:, 0]) / det
    return np.stack([1 - s - t, s, t], axis=1)


def largest_rectangle(flat: Floats, faces: Ints) -> tuple[float, tuple[float, float, float, float]]:
    """The angle and (x0, x1, y0, y1), in the turned frame, of a large rectangle within the layout.

    Angles are tried every five degrees; at each, the largest block of covered cells of a lattice is
    found. The angle nearest to zero wins among those within a hundredth of the best area.
    """
    best: tuple[float, float, tuple[float, float, float, float]] | None = None
    for degrees in (0, *(sign * d for d in range(5, 45, 5) for sign in (1, -1)), 45):
        angle = np.radians(degrees)
        turned = flat @ _turn(angle)
        low, high = turned.min(axis=0), turned.max(axis=0)
        count = 81
        x, y = (np.linspace(low[k], high[k], count) for k in (0, 1))
        # cell corners pulled in by a hair, so that those on the border count as covered
        centre, shrink = (low + high) / 2, 1 - 1e-6
        lattice = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        lattice = centre + (lattice - centre) * shrink
        covered = locate(turned, faces, lattice)[0].reshape(count, count) >= 0
        i0, i1, j0, j1 = _largest_block(covered)
        area = (x[i1] - x[i0]) * (y[j1] - y[j0])
        if best is None or area > 1.01 * best[0]:
            best = (area, angle, (x[i0], x[i1], y[j0], y[j1]))
    assert best is not None
    return best[1], best[2]


def _turn(angle: float) -> Floats:
    return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


def _largest_block(covered: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """Column and row range of the largest rectangle of lattice points that are all covered.

    Row by row with the histogram of covered runs above (the stack algorithm).
    """
    rows, columns = covered.shape
    run = np.zeros(columns, dtype=np.int64)
    best, block = -1, (0, 0, 0, 0)
    for j in range(rows):
        run = np.where(covered[j], run + 1, 0)
        stack: list[tuple[int, int]] = []
        for i, height in enumerate([*run.tolist(), 0]):
            start = i
            while stack and stack[-1][1] >= height:
                start, tall = stack.pop()
                area = (i - 1 - start) * (tall - 1)
                if area > best:
                    best, block = area, (start, i - 1, j - tall + 1, j)
            stack.append((start, height))
    return block
