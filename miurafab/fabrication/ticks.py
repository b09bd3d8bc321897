"""Ticks: small bars across the ends of folds on the outline of a patch.

One bar marks a mountain, two a valley. So a ruler finds both ends of a fold, and a folder sees
which way it goes, without a picture. A bar lies on the two facets beside its fold, with
:data:`CLEAR_MM` to their other sides; an end without room for its bars gets none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern

CLEAR_MM = 0.2
"""The distance of a bar from the other sides of its facets (judged: a kerf of 0.15 mm and more)."""
_FIRST, _APART = (0.8, 1.2, 1.8, 2.6, 3.6), 0.6
"""The places that are tried for the first bar, and of the second behind it, over the length of a
bar (judged).
"""


@dataclass(frozen=True, eq=False)
class Ticks:
    """B bars: their ``ends`` (B, 2, 2) in mm in the pattern's plane, the pattern ``edge`` (B,) and
    the ``patch`` (B,); the bars of one end have the same ``group`` (B,). ``left_out`` is the number
    of ends without room.
    """

    ends: Floats
    edge: Ints
    patch: Ints
    group: Ints
    left_out: int


def fold_ticks(
    pattern: CreasePattern, face_patch: Ints, edges: Ints, patches: Ints, length: float
) -> Ticks:
    """The bars of ``length`` mm on the folds ``edges`` (N,), M or V, within ``patches`` (N,)."""
    rim = _on_rim(pattern, face_patch)
    vertices = pattern.edges_vertices[edges]
    fold, end = np.nonzero(
        rim[vertices] & np.isin(pattern.edges_assignment[edges], ["M", "V"])[:, None]
    )
    here = pattern.vertices_coords[vertices[fold, end]]
    way = pattern.vertices_coords[vertices[fold, 1 - end]] - here
    size = np.linalg.norm(way, axis=1)
    way /= size[:, None]
    across = np.column_stack([-way[:, 1], way[:, 0]]) * (length / 2)
    valley = pattern.edges_assignment[edges[fold]] == "V"
    bars = np.zeros((len(fold), 2, 2, 2))
    room = np.zeros(len(fold), dtype=bool)
    for first in _FIRST:
        last = (first + _APART * valley) * length
        places = np.stack([np.full(len(fold), first * length), last], axis=1)
        middle = here[:, None] + places[..., None] * way[:, None]
        tried = np.stack([middle - across[:, None], middle + across[:, None]], axis=2)
        fits = (2 * last < size) & ~room
        for side in (0, 1):
            # The facet on one side of the fold holds the ends of the bars on that side.
            for face in pattern.edges_faces[edges[fold]].T:
                depth = _depth(pattern, face, tried[:, :, side], edges[fold])
                own = _left_of(pattern, face, here, across if side else -across)
                fits &= ~own | (depth >= CLEAR_MM).all(axis=1)
        bars[fits] = tried[fits]
        room |= fits
    kept = np.flatnonzero(room)
    count = 1 + valley[kept].astype(np.int64)
    which = np.repeat(kept, count)
    place = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    return Ticks(
        ends=bars[which, place],
        edge=edges[fold[which]],
        patch=patches[fold[which]],
        group=np.repeat(np.arange(len(kept)), count),
        left_out=int((~room).sum()),
    )


def _on_rim(pattern: CreasePattern, face_patch: Ints) -> Bools:
    """(V,) whether a vertex lies on the outline of a patch."""
    beside = np.where(pattern.edges_faces >= 0, face_patch[pattern.edges_faces], -1)
    found = np.zeros(len(pattern.vertices_coords), dtype=bool)
    found[pattern.edges_vertices[beside[:, 0] != beside[:, 1]]] = True
    return found


def _left_of(pattern: CreasePattern, face: Ints, here: Floats, across: Floats) -> Bools:
    """(n,) whether each ``face`` lies on the side of ``across`` (n, 2) of the fold at ``here``."""
    corners = pattern.faces_vertices[face]
    real = (corners >= 0)[..., None]
    middle = np.where(real, pattern.vertices_coords[corners], 0.0).sum(axis=1) / real.sum(axis=1)
    return np.asarray(np.einsum("ni,ni->n", middle - here, across) > 0)


def _depth(pattern: CreasePattern, face: Ints, points: Floats, edges: Ints) -> Floats:
    """(n, b) how far ``points`` (n, b, 2) lie inside the other sides of ``face`` (n,)."""
    sides = pattern.faces_edges[face]
    real = (pattern.faces_vertices[face] >= 0) & (sides != edges[:, None])
    start = pattern.vertices_coords[pattern.faces_vertices[face]]
    ends = pattern.vertices_coords[pattern.edges_vertices[sides]]
    ahead = ends.sum(axis=2) - 2 * start  # the facet has each side on its left
    normal = np.stack([-ahead[..., 1], ahead[..., 0]], axis=-1)
    normal /= np.maximum(np.linalg.norm(normal, axis=2), 1e-12)[..., None]
    depth = np.einsum("nki,nbki->nbk", normal, points[:, :, None] - start[:, None])
    return np.asarray(np.where(real[:, None], depth, np.inf).min(axis=2))
