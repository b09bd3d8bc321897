"""Poles: two places of a closed mesh from which it is seen as a tube.

A hole is cut round each pole along a level of the distance from it, through the triangles, so that
its border is smooth. Distances along the surface are found by heat (Crane, Weischedel and
Wardetzky, ACM Trans. Graph. 32, 2013): heat flows from the pole for a short time, and the distance
is the function whose gradient has length one and the direction of the heat's.

Candidates for the poles are the two ends of the longest way over the body, and the ends of its
principal axes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import sparse

from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.sparse import factor_symmetric
from miurafab.surfaces.intrinsic import intrinsic_mesh
from miurafab.surfaces.mesh_repair import doubled_areas

HOLE = 0.06
"""The radius of the hole round a pole over the root of the area. The two take 2 % of the area of a
sphere (measured: pins, bent bodies and heads; outline-and-gores.md, section B)."""

_SNAP = 0.1
"""A level closer to a vertex than this part of a triangle's span passes through the vertex."""


class HeatDistance:
    """Distances along a mesh from any of its vertices; two factors serve all."""

    def __init__(self, vertices: Floats, faces: Ints) -> None:
        mesh = intrinsic_mesh(vertices, faces)
        doubled = mesh.doubled_areas
        # each triangle in a plane of its own: corner 0 at the origin, corner 1 on x
        x, back = mesh.lengths[:, 0], mesh.lengths[:, 2]
        along = (x**2 + back**2 - mesh.lengths[:, 1] ** 2) / (2 * x)
        places = np.stack([0 * x, x, along + 1j * doubled / x], axis=1)
        # the gradient of the hat function of a corner: the opposite side turned, over the area
        self._slopes = 1j * (np.roll(places, 1, axis=1) - np.roll(places, -1, axis=1))
        self._slopes /= doubled[:, None]
        self._mesh = mesh
        mass = np.bincount(mesh.faces.ravel(), np.repeat(doubled / 6, 3), mesh.count)
        time = float(mesh.lengths.mean()) ** 2
        heat = sparse.diags_array(mass) + time * mesh.laplacian
        self._heat = factor_symmetric(heat.tocsc())
        self._poisson = factor_symmetric(mesh.laplacian[1:, 1:].tocsc())

    def from_vertices(self, sources: Ints) -> Floats:
        """(V,) the distance of each vertex from the nearest of ``sources``."""
        mesh, faces = self._mesh, self._mesh.faces
        start = np.zeros(mesh.count)
        start[sources] = 1.0
        heat = self._heat.solve(start)
        flow = -(self._slopes * heat[faces]).sum(axis=1)
        flow = flow / np.maximum(np.abs(flow), 1e-300)
        pull = (self._slopes.conj() * flow[:, None]).real * (mesh.doubled_areas / 2)[:, None]
        right = np.bincount(faces.ravel(), pull.ravel(), mesh.count)
        distance = np.concatenate([[0.0], self._poisson.solve(right[1:])])
        return np.asarray(distance - distance[sources].mean())

    def from_vertex(self, vertex: int) -> Floats:
        """(V,) the distance of each vertex from ``vertex``."""
        return self.from_vertices(np.array([vertex]))


def pole_candidates(vertices: Floats, faces: Ints, distance: HeatDistance) -> Ints:
    """(n, 2) pairs of vertices that may serve as poles.

    First the ends of the longest way: the vertex farthest from the middle, the farthest from that,
    and the farthest again. Each end moves to where it is farthest from the line half-way between,
    so that it sits in the middle of its cap. Then the ends as found, and those of the axes.
    """
    weight = np.bincount(faces.ravel(), np.repeat(doubled_areas(vertices, faces), 3), len(vertices))
    offset = vertices - (weight / weight.sum()) @ vertices
    start = int(np.argmax(np.linalg.norm(offset, axis=1)))
    first = int(np.argmax(distance.from_vertex(start)))
    from_first = distance.from_vertex(first)
    second = int(np.argmax(from_first))
    lead = from_first - distance.from_vertex(second)
    # one end of each edge that the line half-way between crosses
    side = lead[faces] > 0
    between = faces[side.any(axis=1) & ~side.all(axis=1)]
    away = distance.from_vertices(np.unique(between))
    pairs = [
        (
            int(np.argmax(np.where(lead < 0, away, -1))),
            int(np.argmax(np.where(lead > 0, away, -1))),
        ),
        (first, second),
    ]
    axes = np.linalg.eigh((offset * weight[:, None]).T @ offset)[1]
    for axis in axes.T[::-1]:
        along = offset @ axis
        pairs.append((int(np.argmin(along)), int(np.argmax(along))))
    known = dict.fromkeys((min(pair), max(pair)) for pair in pairs)
    return np.array([pair for pair in known if pair[0] != pair[1]], dtype=np.int64)


def open_at(
    vertices: Floats, faces: Ints, distances: Sequence[Floats], radius: float
) -> tuple[Floats, Ints]:
    """The largest part of the mesh that is at least ``radius`` away by each of ``distances``
    (V,).
    """
    for k in range(len(distances)):
        vertices, faces, distances = _cut_at(vertices, faces, distances, k, radius)
    import trimesh

    neighbours = trimesh.graph.face_adjacency(faces)
    label = trimesh.graph.connected_component_labels(neighbours, node_count=len(faces))
    largest = faces[label == np.argmax(np.bincount(label))]
    used, largest = np.unique(largest, return_inverse=True)
    return vertices[used], largest.reshape(-1, 3)


def _cut_at(
    vertices: Floats, faces: Ints, distances: Sequence[Floats], which: int, radius: float
) -> tuple[Floats, Ints, list[Floats]]:
    """The part where ``distances[which]`` is at least ``radius``; triangles are cut along the
    level, and the other distances go with the new vertices.
    """
    above = distances[which] - radius
    crossing = (above[faces].max(axis=1) > 0) & (above[faces].min(axis=1) < 0)
    if crossing.any():
        # a level that passes close to a vertex passes through it: no slivers
        span = float(np.median(np.ptp(above[faces[crossing]], axis=1)))
        above = np.where(np.abs(above) < _SNAP * span, 0.0, above)
    sign = np.sign(above[faces])
    kept = faces[(sign >= 0).all(axis=1) & (sign > 0).any(axis=1)]
    table = np.column_stack([vertices, *distances])
    added: list[Floats] = []
    between: dict[tuple[int, int], int] = {}

    def cut(a: int, b: int) -> int:
        key = (min(a, b), max(a, b))
        if key not in between:
            t = above[a] / (above[a] - above[b])
            between[key] = len(table) + len(added)
            added.append((1 - t) * table[a] + t * table[b])
        return between[key]

    parts: list[list[int]] = []
    for face in faces[(sign > 0).any(axis=1) & (sign < 0).any(axis=1)].tolist():
        polygon: list[int] = []
        for a, b in zip(face, face[1:] + face[:1], strict=True):
            if above[a] >= 0:
                polygon.append(a)
            if above[a] * above[b] < 0:
                polygon.append(cut(a, b))
        parts.extend([polygon[0], polygon[n], polygon[n + 1]] for n in range(1, len(polygon) - 1))
    table = np.vstack([table, *added])
    faces = np.concatenate([kept, np.array(parts, dtype=np.int64).reshape(-1, 3)])
    rest = [table[:, 3 + k] for k in range(len(distances))]
    return table[:, :3], faces, rest
