"""Split of any mesh of facets into valid patches, by region growing.

A patch starts at one facet and adds neighbours one by one. A facet is added only if the patch still
fits the bed with its tabs and stays a disk: the sides that the facet shares with the patch must
form one chain, and the facet must touch the patch in no vertex outside of this chain. So no patch
has a hole or a pinched vertex, even if the mesh has rings, holes, cuts or several components.

Facets are added in the order of the box, of the bed's proportions, that reaches them from the first
facet; the smallest box comes first. Finally neighbouring patches that fit together are merged.
"""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import NDArray

from miurafab.fabrication.partition.fit_box import Space
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.polygons import facet_means, principal_axes
from miurafab.origami.crease_pattern import CreasePattern


class _Growth:
    """The state of a split: the patch of each facet (-1: none yet), the last patch of a vertex."""

    def __init__(
        self,
        pattern: CreasePattern,
        reach: NDArray[np.float32],
        space: Space,
        free: Bools,
        most: int,
    ) -> None:
        self.corners = [[v for v in face if v >= 0] for face in pattern.faces_vertices.tolist()]
        across = np.where(
            pattern.edges_faces[pattern.faces_edges, 0]
            == np.arange(len(pattern.faces_vertices))[:, None],
            pattern.edges_faces[pattern.faces_edges, 1],
            pattern.edges_faces[pattern.faces_edges, 0],
        )
        self.across = [
            row[: len(face)] for row, face in zip(across.tolist(), self.corners, strict=True)
        ]
        self.reach, self.space, self.most = reach, space, most
        self.patch: list[int] = np.where(free, -1, -2).tolist()
        self.stamp = [-1] * len(pattern.vertices_coords)
        self.rank = _ranks(pattern, space)

    def keeps_disk(self, face: int, patch: int) -> bool:
        """Whether ``patch`` stays a disk with ``face`` added."""
        shared = [other >= 0 and self.patch[other] == patch for other in self.across[face]]
        chains = sum(here and not shared[k - 1] for k, here in enumerate(shared))
        touched = sum(self.stamp[v] == patch for v in self.corners[face])
        return bool(chains == 1 and touched == sum(shared) + 1)

    def grow(self, seed: int, patch: int) -> None:
        """Grow ``patch`` from ``seed`` until no neighbour can be added."""
        taken, values = 0, self.reach[seed]
        x0, y0 = self.rank[seed]
        waiting = [(0.0, seed)]
        tried = {seed: 0}
        while waiting and taken < self.most:
            _, face = heapq.heappop(waiting)
            if taken:
                if not self.keeps_disk(face, patch):
                    continue
                grown = np.maximum(values, self.reach[face])
                if not self.space.holds(grown):
                    tried[face] = len(self.corners[face])
                    continue
                values = grown
            self.patch[face] = patch
            taken += 1
            for v in self.corners[face]:
                self.stamp[v] = patch
            for other in self.across[face]:
                # A facet that would have closed a ring may be added once more sides touch it.
                if other >= 0 and self.patch[other] == -1:
                    times = tried.get(other, 0)
                    if times < len(self.corners[other]):
                        tried[other] = times + 1
                        x, y = self.rank[other]
                        heapq.heappush(waiting, (max(abs(x - x0), abs(y - y0)), other))


def grow_patches(
    pattern: CreasePattern,
    reach: NDArray[np.float32],
    space: Space,
    faces: Ints,
    most: int | None = None,
) -> Ints:
    """(F,) patch ids from 0 of ``faces``, -1 for other facets.

    ``reach`` (F, D) are the support values of each facet with all tabs that may stand on it; every
    facet must fit ``space`` alone. ``most`` limits the number of facets of a patch.
    """
    total = len(pattern.faces_vertices)
    free = np.zeros(total, dtype=bool)
    free[faces] = True
    growth = _Growth(pattern, reach, space, free, most or total)
    order = np.lexsort((np.arange(total), growth.rank.sum(axis=1)))
    patch = 0
    for seed in order.tolist():
        if growth.patch[seed] == -1:
            growth.grow(seed, patch)
            patch += 1
    found = np.maximum(np.array(growth.patch), -1)
    return found if most else _merged(pattern, reach, space, found)


def _ranks(pattern: CreasePattern, space: Space) -> Floats:
    """(F, 2) facet centres along the principal axes of the pattern, in units of the bed's sides."""
    centres = facet_means(pattern.vertices_coords, pattern.faces_vertices)
    centred, axes = centres - centres.mean(axis=0), principal_axes(centres)
    sides = max(space.width, space.height), min(space.width, space.height)
    return np.asarray((centred @ axes[:, ::-1]) / sides)


def _merged(
    pattern: CreasePattern, reach: NDArray[np.float32], space: Space, face_patch: Ints
) -> Ints:
    """Neighbouring patches merged, the smallest first, if the union is a disk that fits."""
    count = int(face_patch.max(initial=-1)) + 1
    members = [np.flatnonzero(face_patch == patch) for patch in range(count)]
    values = [reach[faces].max(axis=0) for faces in members]
    sides = face_patch[pattern.edges_faces]
    inner = (pattern.edges_faces >= 0).all(axis=1)
    pairs = np.unique(np.sort(sides[inner & (sides[:, 0] != sides[:, 1])], axis=1), axis=0)
    beside: list[set[int]] = [set() for _ in range(count)]
    for p, q in pairs.tolist():
        if p >= 0:
            beside[p].add(q)
            beside[q].add(p)
    waiting = [(len(members[p]), p) for p in range(count)]
    heapq.heapify(waiting)
    while waiting:
        number, p = heapq.heappop(waiting)
        if number != len(members[p]):
            continue
        for q in sorted(beside[p], key=lambda other: (len(members[other]), other)):
            both = np.maximum(values[p], values[q])
            union = np.concatenate([members[p], members[q]])
            if space.holds(both) and is_disk(pattern, union):
                members[p], values[p] = np.sort(union), both
                members[q] = members[q][:0]
                for other in beside[q]:
                    beside[other].discard(q)
                    if other != p:
                        beside[other].add(p)
                        beside[p].add(other)
                beside[q] = set()
                heapq.heappush(waiting, (len(members[p]), p))
                break
    merged = np.full_like(face_patch, -1)
    for patch, faces in enumerate(f for f in members if len(f)):
        merged[faces] = patch
    return merged


def is_disk(pattern: CreasePattern, faces: Ints) -> bool:
    """Whether the facets ``faces`` form a disk: connected, no holes, no pinched vertices.

    They do if their boundary is one simple closed loop of vertices and their Euler characteristic
    is 1.
    """
    inside = np.zeros(len(pattern.faces_vertices), dtype=bool)
    inside[faces] = True
    edges = np.unique(pattern.faces_edges[faces])
    edges = edges[edges >= 0]
    sides = pattern.edges_faces[edges]
    within = (sides >= 0) & inside[sides]
    border = pattern.edges_vertices[edges[within.sum(axis=1) == 1]]
    _, degree = np.unique(border, return_counts=True)
    if not (degree == 2).all():
        return False
    vertices = len(np.unique(pattern.edges_vertices[edges]))
    if vertices - len(edges) + len(faces) != 1:
        return False
    following: dict[int, list[int]] = {}
    for a, b in border.tolist():
        following.setdefault(a, []).append(b)
        following.setdefault(b, []).append(a)
    start = int(border[0, 0])
    before, here, steps = -1, start, 0
    while True:
        ahead = following[here]
        before, here = here, ahead[0] if ahead[0] != before else ahead[1]
        steps += 1
        if here == start:
            return steps == len(border)
