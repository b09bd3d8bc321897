"""Decimation: a triangle mesh with fewer vertices, for steps that need not see every detail.

A vertex v inside the mesh is removed by moving it onto a neighbour r: of the triangles around v
those at the edge v r vanish, the others fan out from r. Many vertices that are no neighbours are
removed in one round, those with the shortest edges first, so that the mesh becomes even.

The surface keeps its topology, whatever its shape: v is removed only if each new edge joins
vertices that no edge joined before (the link condition: T. Dey, H. Edelsbrunner, S. Guha and
D. Nekhayev, Publ. Inst. Math. 66 (1999)). Of the neighbours the one is chosen whose fan has the
best worst triangle. Vertices on the border stay, so the outline is exact; vertices do not move.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from miurafab.geometry.arrays import Bools, Floats, Ints, places_in_runs, vector_product

FAIR = 0.15
"""The least quality of a new triangle; 1 is equilateral, 0 has no area."""
SHARE = 0.6
"""The part of the vertices, those with the shortest edges, that may go in one round."""
DEGREES = range(3, 10)
"""The numbers of neighbours of a vertex that may go."""
LEAST_GAIN = 0.01
"""Rounds end when one removes a smaller part of the vertices."""


def decimated(vertices: Floats, faces: Ints, most: int) -> tuple[Floats, Ints]:
    """The oriented mesh ``vertices`` (V, 3), ``faces`` (F, 3) with about ``most`` triangles.

    The vertices that are left keep their order. Fewer may be left out where triangles would become
    slivers, and none if there are no more triangles than ``most``.
    """
    jitter = np.random.default_rng(0).uniform(0.9, 1.1, len(vertices))
    while len(faces) > most:
        chosen = _to_remove(vertices, faces, jitter, (len(faces) - most) // 2)
        removed, faces = _without(vertices, faces, chosen)
        if removed < LEAST_GAIN * len(faces) / 2 and len(faces) > most:
            break
    used, faces = np.unique(faces, return_inverse=True)
    return vertices[used], faces.reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class _Corners:
    """The corners of the triangles (3F,), sorted by their vertex ``at``, with the ``following``
    and the ``previous`` vertex of the triangle; ``first`` and ``count`` (V,) are the runs.
    """

    triangle: Ints
    following: Ints
    previous: Ints
    first: Ints
    count: Ints

    @classmethod
    def of(cls, faces: Ints, vertices: int) -> _Corners:
        at = faces.ravel()
        order = np.argsort(at, kind="stable")
        count = np.bincount(at, minlength=vertices)
        return cls(
            order // 3,
            np.roll(faces, -1, axis=1).ravel()[order],
            np.roll(faces, 1, axis=1).ravel()[order],
            np.cumsum(count) - count,
            count,
        )

    def least(self, values: Floats) -> Floats:
        """(V,) the least of ``values`` (3F,) around each vertex; infinite where there is none."""
        result = np.full(len(self.count), np.inf)
        used = self.count > 0
        result[used] = np.minimum.reduceat(values, self.first[used])
        return result

    def joined(self, a: Ints, b: Ints) -> Bools:
        """(n,) whether an edge joins the vertices ``a`` (n,) and ``b`` (n,)."""
        count = self.count[a]
        pair = np.repeat(np.arange(len(a)), count)
        corner = np.repeat(self.first[a], count) + places_in_runs(count)
        found = (self.following[corner] == b[pair]) | (self.previous[corner] == b[pair])
        result = np.zeros(len(a), dtype=bool)
        result[pair[found]] = True
        return result


def _to_remove(vertices: Floats, faces: Ints, jitter: Floats, most: int) -> _Chosen:
    """Up to ``most`` vertices inside the mesh of which no two are neighbours, shortest first."""
    corners = _Corners.of(faces, len(vertices))
    at = np.repeat(np.arange(len(vertices)), corners.count)
    length = np.linalg.norm(vertices[corners.following] - vertices[at], axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        score = jitter * np.bincount(at, length, len(vertices)) / corners.count
    # around a vertex inside the mesh the followers are the same vertices as the previous ones
    inner = np.bincount(at, corners.following - corners.previous, len(vertices)) == 0
    free = inner & (corners.count >= DEGREES[0]) & (corners.count <= DEGREES[-1])
    if free.any():
        free &= score <= np.quantile(score[corners.count > 0], SHARE)
    picked = np.zeros(len(vertices), dtype=bool)
    for _ in range(2):
        ranked = np.where(free, score, np.inf)
        around = np.minimum(
            corners.least(ranked[corners.following]), corners.least(ranked[corners.previous])
        )
        picked |= free & (ranked < around)
        near = corners.least(np.where(picked[corners.following], 0.0, 1.0)) == 0
        free &= ~picked & ~near
    chosen = np.flatnonzero(picked)
    if len(chosen) > most:
        chosen = np.sort(chosen[np.argsort(score[chosen], kind="stable")[:most]])
    return _Chosen(chosen, corners)


@dataclass(frozen=True, eq=False)
class _Chosen:
    vertices: Ints
    corners: _Corners


def _without(vertices: Floats, faces: Ints, chosen: _Chosen) -> tuple[int, Ints]:
    """How many of the ``chosen`` vertices could be removed, and the triangles without them."""
    count = len(vertices)
    fans, edges, owner, gone = [], [], [], []
    for degree in DEGREES:
        some = chosen.vertices[chosen.corners.count[chosen.vertices] == degree]
        if not len(some):
            continue
        corner = chosen.corners.first[some][:, None] + np.arange(degree)
        ring, whole = _rings(chosen.corners, corner)
        fan, fair = _best_fans(vertices, some, ring)
        good = whole & fair
        fans.append(fan[good])
        # the new edges run from the apex to the corners of the fan between its first and last
        edges.append(fan[good][:, 1:, :2].reshape(-1, 2))
        owner.append(np.repeat(some[good], degree - 3))
        gone.append((some[good], corner[good]))
    new = np.concatenate(edges) if edges else np.zeros((0, 2), dtype=np.int64)
    taken = chosen.corners.joined(new[:, 0], new[:, 1])
    key = np.sort(new, axis=1) @ np.array([count, 1])
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    taken |= first[inverse] != np.arange(len(key))
    refused = np.zeros(count, dtype=bool)
    if owner:
        refused[np.concatenate(owner)[taken]] = True
    kept = np.ones(len(faces), dtype=bool)
    added = []
    removed = 0
    for fan, (some, corner) in zip(fans, gone, strict=True):
        sure = ~refused[some]
        removed += int(sure.sum())
        kept[chosen.corners.triangle[corner[sure]]] = False
        added.append(fan[sure].reshape(-1, 3))
    return removed, np.concatenate([faces[kept], *added])


def _rings(corners: _Corners, corner: Ints) -> tuple[Ints, Bools]:
    """The neighbours (n, d) of vertices with the ``corner`` (n, d) in the order around them, and
    which of them are one closed ring.
    """
    following, previous = corners.following[corner], corners.previous[corner]
    ring = np.empty_like(following)
    ring[:, 0] = following[:, 0]
    here = previous[:, 0]
    row = np.arange(len(ring))
    for k in range(1, ring.shape[1]):
        ring[:, k] = here
        here = previous[row, np.argmax(following == here[:, None], axis=1)]
    ordered = np.sort(ring, axis=1)
    return ring, (here == ring[:, 0]) & (np.diff(ordered, axis=1) > 0).all(axis=1)


def _best_fans(vertices: Floats, middle: Ints, ring: Ints) -> tuple[Ints, Bools]:
    """The triangles (n, d - 2, 3) that replace those around ``middle`` (n,), and which are fair.

    Of the fans of all neighbours the one whose worst triangle is best. A triangle that faces
    against those around the middle counts half: only a noisy surface needs it.
    """
    degree = ring.shape[1]
    rim = vertices[ring]
    spokes = rim - vertices[middle][:, None]
    normal = vector_product(spokes, np.roll(spokes, -1, axis=1)).sum(axis=1)
    best = np.full(len(ring), -np.inf)
    apex = np.zeros(len(ring), dtype=np.int64)
    for k in range(degree):
        others = np.roll(rim, -k, axis=1)
        side = others[:, 1:] - others[:, :1]
        cross = vector_product(side[:, :-1], side[:, 1:])
        squares = (side**2).sum(axis=2)
        across = ((others[:, 2:] - others[:, 1:-1]) ** 2).sum(axis=2)
        with np.errstate(invalid="ignore", divide="ignore"):
            quality = 2 * np.sqrt(3) * np.linalg.norm(cross, axis=2)
            quality = quality / (squares[:, :-1] + squares[:, 1:] + across)
        facing = np.einsum("nkd,nd->nk", cross, normal) > 0
        worst = np.where(facing, quality, quality / 2).min(axis=1)
        apex = np.where(worst > best, k, apex)
        best = np.maximum(best, worst)
    turned = np.take_along_axis(ring, (apex[:, None] + np.arange(degree)) % degree, axis=1)
    fan = np.stack(
        [np.repeat(turned[:, :1], degree - 2, axis=1), turned[:, 1:-1], turned[:, 2:]], axis=2
    )
    return fan, best >= FAIR
