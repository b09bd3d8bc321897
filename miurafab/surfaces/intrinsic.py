"""Intrinsic Delaunay triangles: the same surface, cut into better triangles along itself.

Sums over cotangents are good where no edge lies between wide angles. Such an edge is flipped: the
two triangles are unfolded into a plane, and their other diagonal, which is a straight way over the
surface, takes its place (Fisher, Springborn, Bobenko and Schroeder, SIGGRAPH courses 2006). The
vertices stay, and so does every function that is given at them. The new triangles have lengths of
sides and no corners in space; two of them may share two sides.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from miurafab.geometry.arrays import Floats, Ints

_FLAT = -1e-9
"""Edges with a sum of cotangents below this are flipped."""


@dataclass(frozen=True, eq=False)
class IntrinsicMesh:
    """An oriented mesh of ``count`` vertices by the lengths of its sides.

    Side k of triangle f runs from ``faces[f, k]`` to ``faces[f, k + 1]`` and has the number
    3 f + k. ``lengths`` (F, 3) belong to the sides, and ``mates`` (3 F,) is the number of the same
    side in the neighbouring triangle, or -1 on the border.
    """

    faces: Ints
    lengths: Floats
    mates: Ints
    count: int

    @cached_property
    def heads(self) -> Ints:
        """(3 F,) the vertex at which each side ends."""
        return np.roll(self.faces, -1, axis=1).ravel()

    @cached_property
    def doubled_areas(self) -> Floats:
        """(F,) twice the areas."""
        return _doubled_areas(self.lengths)

    @cached_property
    def weights(self) -> Floats:
        """(3 F,) half the sum of the cotangents opposite to each side."""
        squares = self.lengths**2
        far = squares.sum(axis=1)[:, None] - 2 * squares
        half = (far / (4 * self.doubled_areas[:, None])).ravel()
        return np.asarray(half + np.where(self.mates >= 0, half[self.mates], 0.0))

    @cached_property
    def once(self) -> Ints:
        """The numbers of sides, each edge once."""
        return np.flatnonzero(self.mates < np.arange(self.faces.size))

    @cached_property
    def laplacian(self) -> sparse.csc_array:
        """(V, V) the matrix of sum over edges of weight * (f_j - f_i)^2."""
        a, b, w = self.faces.ravel()[self.once], self.heads[self.once], self.weights[self.once]
        rows, columns = np.concatenate([a, b, a, b]), np.concatenate([a, b, b, a])
        values = np.concatenate([w, w, -w, -w])
        return sparse.coo_array((values, (rows, columns)), shape=(self.count, self.count)).tocsc()


def intrinsic_mesh(vertices: Floats, faces: Ints) -> IntrinsicMesh:
    """The Delaunay triangles of the oriented mesh ``vertices`` (V, 3), ``faces`` (F, 3)."""
    heads = np.roll(faces, -1, axis=1)
    lengths = np.linalg.norm(vertices[heads] - vertices[faces], axis=2)
    out = (faces * len(vertices) + heads).ravel()
    back = (heads * len(vertices) + faces).ravel()
    order = np.argsort(out)
    place = order[np.searchsorted(out, back, sorter=order).clip(max=len(out) - 1)]
    mates = np.where(out[place] == back, place, -1)
    mesh = IntrinsicMesh(faces, lengths, mates, len(vertices))
    bad = mesh.once[(mesh.weights[mesh.once] < _FLAT) & (mesh.mates[mesh.once] >= 0)]
    return _flipped(mesh, bad.tolist()) if len(bad) else mesh


def _flipped(mesh: IntrinsicMesh, pending: list[int]) -> IntrinsicMesh:
    """The mesh after all edges of ``pending``, and those that turn bad on the way, are flipped."""
    tail, length, mate = (
        mesh.faces.ravel().tolist(),
        mesh.lengths.ravel().tolist(),
        mesh.mates.tolist(),
    )

    def after(side: int) -> int:
        return side - 2 if side % 3 == 2 else side + 1

    while pending:
        h = pending.pop()
        t = mate[h]
        if t < 0:
            continue
        a, c = after(h), after(t)
        b, d = after(a), after(c)
        if t in (a, b):
            continue
        x = length[h]
        up, left = _apex(x, length[b], length[a])
        down, right = _apex(x, length[c], length[d])
        # the sum of the cotangents of the angles opposite to the edge, times its length
        cotangents = (left * (left - x) + up * up) / up
        cotangents += (right * (right - x) + down * down) / down
        if cotangents >= 2 * _FLAT * x:
            continue
        across = ((left - right) ** 2 + (up + down) ** 2) ** 0.5
        i, j, k, m = tail[h], tail[t], tail[b], tail[d]
        moved = {b: a, c: b, d: c, a: d}
        rows = {new: (length[old], mate[old]) for old, new in moved.items()}
        for new, (side, other) in rows.items():
            length[new], mate[new] = side, moved.get(other, other)
            if other >= 0:
                mate[mate[new]] = new
        tail[h], tail[a], tail[b] = m, k, i
        tail[t], tail[c], tail[d] = k, m, j
        length[h] = length[t] = across
        pending += [a, b, c, d]
    faces = np.array(tail, dtype=np.int64).reshape(-1, 3)
    lengths = np.array(length, dtype=np.float64).reshape(-1, 3)
    return IntrinsicMesh(faces, lengths, np.array(mate, dtype=np.int64), mesh.count)


def _apex(base: float, first: float, second: float) -> tuple[float, float]:
    """The height over the base and the place along it of the corner ``first`` from its start and
    ``second`` from its end."""
    along = (base * base + first * first - second * second) / (2 * base)
    return max(first * first - along * along, 1e-24 * first * first) ** 0.5, along


def _doubled_areas(sides: Floats) -> Floats:
    """(F,) twice the areas of triangles with the ``sides`` (F, 3), by Heron's formula in Kahan's
    stable order."""
    small, middle, large = np.sort(sides, axis=1).T
    product = (
        (large + (middle + small))
        * (small - (large - middle))
        * (small + (large - middle))
        * (large + (middle - small))
    )
    return np.asarray(np.sqrt(np.maximum(product, 1e-24 * large**4)) / 2)
