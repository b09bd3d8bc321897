"""What kind of surface a triangle mesh is: its pieces, its sides, its borders, its handles.

Triangles are neighbours where exactly two of them share an edge. A piece is a set of triangles that
are joined by neighbours; so parts that meet only in a vertex, and walls that meet in one edge, are
pieces of their own. Of one piece with one orientation, V vertices, E edges, F triangles and b
borders,

    V - E + F = 2 - 2 handles - b.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from miurafab.errors import TargetError
from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.connected import components, shortest_ways

MeshKind = Literal["disk", "tube", "holes", "sphere", "handles"]
"""``disk``: one border. ``tube``: two. ``holes``: more. ``sphere``: none. ``handles``: a torus, or
any surface with a handle."""


@dataclass(frozen=True, eq=False)
class Topology:
    """The ``kind`` of an oriented mesh, and its number of ``handles``.

    ``loops`` are its borders, the longest first: the indices of their vertices in the direction of
    the triangles. ``lengths`` are theirs.
    """

    kind: MeshKind
    loops: tuple[Ints, ...]
    lengths: tuple[float, ...]
    handles: int


def classify(vertices: Floats, faces: Ints) -> Topology:
    """The topology of one oriented piece: ``vertices`` (V, 3), ``faces`` (F, 3).

    No vertex lies in two fans of triangles (:func:`one_sheet`), and every vertex is used.
    """
    loops = border_loops(faces) if (edges_of(faces)[1] == 1).any() else []
    lengths = [
        float(np.linalg.norm(vertices[np.roll(loop, -1)] - vertices[loop], axis=1).sum())
        for loop in loops
    ]
    order = sorted(range(len(loops)), key=lambda n: -lengths[n])
    euler = len(vertices) - len(edges_of(faces)[0]) + len(faces)
    handles = (2 - len(loops) - euler) // 2
    kinds: dict[int, MeshKind] = {0: "sphere", 1: "disk", 2: "tube"}
    kind = "handles" if handles else kinds.get(len(loops), "holes")
    return Topology(kind, tuple(loops[n] for n in order), tuple(lengths[n] for n in order), handles)


def one_sheet(vertices: Floats, faces: Ints, name: str) -> tuple[Floats, Ints]:
    """One piece as an oriented mesh in which every vertex lies in one fan of triangles.

    A vertex where a border touches itself is doubled. Raises
    :class:`~miurafab.errors.TargetError` for an edge with more than two triangles and for a surface
    with one side.
    """
    _, uses = edges_of(faces)
    if (uses > 2).any():
        count = int((uses > 2).sum())
        which = "one edge has" if count == 1 else f"{count} edges have"
        raise TargetError(
            f"{name} is not a surface: {which} more than two triangles; remove the inner walls or "
            "duplicate triangles."
        )
    faces = _oriented(faces, name)
    corner = np.arange(3 * len(faces)).reshape(-1, 3)
    first, second = _shared_sides(faces)
    # the corners of two neighbours at each end of their side are one vertex
    a, b = corner.ravel()[first], np.roll(corner, -1, axis=1).ravel()[first]
    d, c = corner.ravel()[second], np.roll(corner, -1, axis=1).ravel()[second]
    label = components(corner.size, np.concatenate([a, b]), np.concatenate([c, d]))
    _, place = np.unique(label, return_index=True)
    source = faces.ravel()[place]
    order = np.argsort(source, kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return vertices[source[order]], rank[label].reshape(-1, 3)


def pieces_of(faces: Ints) -> Ints:
    """(F,) the piece of each triangle, numbered from 0."""
    first, second = _shared_sides(faces)
    return components(len(faces), first // 3, second // 3)


def edges_of(faces: Ints) -> tuple[Ints, Ints]:
    """(E, 2) the edges of a triangle mesh, and (E,) the number of triangles at each."""
    count = int(faces.max(initial=0)) + 1
    following = np.roll(faces, -1, axis=1)
    # one number for each side: sorting numbers is much faster than sorting pairs
    keys = np.sort((np.minimum(faces, following) * count + np.maximum(faces, following)).ravel())
    first = np.flatnonzero(np.diff(keys, prepend=-1))
    edges = np.stack(np.divmod(keys[first], count), axis=1)
    return edges, np.diff(first, append=len(keys))


def neighbours(faces: Ints) -> tuple[Ints, Ints]:
    """The pairs (n,), (n,) of neighbouring triangles."""
    first, second = _shared_sides(faces)
    return first // 3, second // 3


def used_alone(vertices: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """The mesh without the vertices that no triangle uses."""
    used, faces = np.unique(faces, return_inverse=True)
    return vertices[used], faces.reshape(-1, 3)


def _shared_sides(faces: Ints) -> tuple[Ints, Ints]:
    """The pairs of sides (3 * triangle + corner where it starts) that share an edge of two."""
    sides = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    key = sides[:, 0] * (int(faces.max()) + 1) + sides[:, 1]
    order = np.argsort(key, kind="stable")
    sorted_key = key[order]
    starts = np.flatnonzero(np.concatenate([[True], np.diff(sorted_key) != 0]))
    counts = np.diff(np.concatenate([starts, [len(key)]]))
    pairs = starts[counts == 2]
    return order[pairs], order[pairs + 1]


def _oriented(faces: Ints, name: str) -> Ints:
    """One piece with each triangle turned as the first neighbour on the way from the start."""
    first, second = _shared_sides(faces)
    ends = faces.ravel()
    # neighbours agree if they run along their side in opposite directions
    agree = ends[first] != ends[second]
    if agree.all():
        return faces
    count = len(faces)
    f, g = first // 3, second // 3
    hops, before, link = shortest_ways(count, f, g, np.ones(len(f)), np.array([0]))
    order = np.argsort(hops, kind="stable")[1 : np.isfinite(hops).sum()]
    turned = np.zeros(count, dtype=bool)
    for triangle, keeps in zip(order.tolist(), agree[link[order]].tolist(), strict=True):
        turned[triangle] = turned[before[triangle]] != (not keeps)
    # most triangles keep their side
    if turned.sum() * 2 > count:
        turned = ~turned
    if (agree == (turned[f] != turned[g])).any():
        raise TargetError(f"{name} has one side only, like a Moebius strip; cut it open across.")
    return np.where(turned[:, None], faces[:, ::-1], faces)


def border_loops(faces: Ints) -> list[Ints]:
    """The border of an oriented mesh as loops of vertices, the loop of most vertices first."""
    sides = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    count = int(faces.max()) + 1
    keys = sides.min(axis=1) * count + sides.max(axis=1)
    order = np.argsort(keys, kind="stable")
    first = np.flatnonzero(np.diff(keys[order], prepend=-1))
    alone = np.diff(first, append=len(keys)) == 1
    open_sides = sides[np.sort(order[first[alone]])]
    following = dict(open_sides.tolist())
    loops = []
    while following:
        start, at = following.popitem()
        loop = [start]
        while at != start:
            loop.append(at)
            at = following.pop(at)
        loops.append(np.array(loop, dtype=np.int64))
    return sorted(loops, key=lambda loop: (-len(loop), int(loop.min())))
