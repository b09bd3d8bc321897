"""Harmonic coordinates of a tube: an annulus mesh as a cylinder, angle for angle.

``v`` is the harmonic function that is 0 on one border and 1 on the other. The angle ``u`` is its
conjugate: it grows by 1 once round the tube, and it has the least energy of all functions that do.
Both minimise

    sum over edges of w_ij (f_j - f_i + J_ij)^2,   w_ij = (cot a_ij + cot b_ij) / 2,

where a_ij and b_ij are the angles opposite to the edge (Pinkall and Polthier, Exper. Math. 2, 1993)
in the Delaunay triangles of the surface (:mod:`~miurafab.surfaces.intrinsic`). For v, J is zero.
For u, J is the jump by one turn: a path of edges joins the borders, and an edge that meets it from
the left has J = 1 or -1. The path leaves no trace in the map, since J changes by whole turns only.
No border value is given for u, so its gradient is parallel to the borders.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.sparse import factor_symmetric
from miurafab.surfaces.intrinsic import IntrinsicMesh, intrinsic_mesh


@dataclass(frozen=True, eq=False)
class CylinderMap:
    """``turns`` (V,) is the angle u of each vertex in [0, 1) and ``height`` (V,) is v in [0, 1]."""

    turns: Floats
    height: Floats

    def corners(self, faces: Ints) -> Floats:
        """(F, 3) the angles at the corners of triangles, without a jump inside any: a side spans
        less than half a turn."""
        step = self.turns[faces] - self.turns[faces[:, :1]]
        return np.asarray(self.turns[faces[:, :1]] + step - np.round(step))

    def turned_over(self, faces: Ints) -> int:
        """The number of triangles that the map turns over."""
        u, v = self.corners(faces), self.height[faces]
        u, v = u - u[:, :1], v - v[:, :1]
        doubled = u[:, 1] * v[:, 2] - u[:, 2] * v[:, 1]
        return int((doubled < -1e-9 * np.abs(doubled).max(initial=0.0)).sum())


def cylinder_map(vertices: Floats, faces: Ints, low: Ints, high: Ints) -> CylinderMap:
    """The harmonic coordinates of an oriented annulus mesh with the border loops ``low`` and
    ``high``. Seen from the side that the normals point to, u runs to the right where v runs up.
    """
    mesh = intrinsic_mesh(vertices, faces)
    turns = _conjugate(mesh, _jumps(mesh, _shortest_path(mesh, low, high)))
    return CylinderMap(turns % 1.0, _between(mesh, low, high))


def _between(mesh: IntrinsicMesh, low: Ints, high: Ints) -> Floats:
    """(V,) the harmonic function that is 0 on ``low`` and 1 on ``high``."""
    values = np.zeros(mesh.count)
    values[high] = 1.0
    free = np.setdiff1d(np.arange(mesh.count), np.concatenate([low, high]))
    rows = mesh.laplacian[free]
    right = -(rows[:, high] @ np.ones(len(high)))
    values[free] = factor_symmetric(rows[:, free].tocsc()).solve(right)
    return values


def _conjugate(mesh: IntrinsicMesh, jumps: Floats) -> Floats:
    """(V,) the function of least energy that jumps by ``jumps`` (3 F,) along the sides."""
    pull = (mesh.weights * jumps)[mesh.once]
    tails, heads = mesh.faces.ravel()[mesh.once], mesh.heads[mesh.once]
    right = np.bincount(tails, pull, mesh.count) - np.bincount(heads, pull, mesh.count)
    turns = np.zeros(mesh.count)
    turns[1:] = factor_symmetric(mesh.laplacian[1:, 1:].tocsc()).solve(right[1:])
    return turns


def _shortest_path(mesh: IntrinsicMesh, low: Ints, high: Ints) -> Ints:
    """The numbers of the sides along a shortest path from ``low`` to ``high``."""
    tails, heads, length = mesh.faces.ravel(), mesh.heads, mesh.lengths.ravel()
    # of sides with equal ends the shortest
    order = np.lexsort([length, heads, tails])
    ends = tails[order] * mesh.count + heads[order]
    side = order[np.concatenate([[True], np.diff(ends) > 0])]
    shape = (mesh.count, mesh.count)
    graph = sparse.coo_array((length[side], (tails[side], heads[side])), shape=shape).tocsr()
    distance, before, _ = dijkstra(graph, indices=low, min_only=True, return_predecessors=True)
    path = [int(high[np.argmin(distance[high])])]
    while before[path[-1]] >= 0:
        path.append(int(before[path[-1]]))
    steps = np.array(path[1:]) * mesh.count + np.array(path[:-1])
    return np.asarray(side[np.searchsorted(tails[side] * mesh.count + heads[side], steps)])


def _jumps(mesh: IntrinsicMesh, path: Ints) -> Floats:
    """(3 F,) how much more the angle grows along each side than its values at the ends say.

    At the corners on the path in the triangles to the left of it, the angle is larger by one turn.
    Those triangles are walked round the two ends of each side of the path.
    """
    more = np.zeros(mesh.faces.size)
    mates = mesh.mates.tolist()
    steps = set(path.tolist())
    for step in path.tolist():
        side = step
        while side >= 0:  # counter-clockwise round the tail
            more[side] = 1.0
            arriving = _after(_after(side))
            side = -1 if arriving in steps else mates[arriving]
        side = step
        while side >= 0:  # clockwise round the head
            leaving = _after(side)
            more[leaving] = 1.0
            side = -1 if leaving in steps else mates[leaving]
    corners = more.reshape(-1, 3)
    return np.asarray((np.roll(corners, -1, axis=1) - corners).ravel())


def _after(side: int) -> int:
    """The next side of the same triangle."""
    return side - 2 if side % 3 == 2 else side + 1
