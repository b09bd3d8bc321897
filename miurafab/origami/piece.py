"""The pieces of a pattern, each as a pattern of its own, and shelves on which they stand apart."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from miurafab.geometry.arrays import Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern, restricted

SHELF = 3.0
"""The width at which things go on above, in sides of the square that holds their boxes."""


@dataclass(frozen=True, eq=False)
class Piece:
    """One piece of a pattern.

    Parameters
    ----------
    pattern : CreasePattern
        The piece alone, in its places in the whole pattern.
    vertices, edges, facets : (n,) int64
        The numbers of its vertices, edges and facets in the whole pattern.
    """

    pattern: CreasePattern
    vertices: Ints
    edges: Ints
    facets: Ints


def pieces_of(pattern: CreasePattern) -> tuple[Piece, ...]:
    """The pieces of ``pattern`` in their order. Seams between pieces are left out."""
    if pattern.pieces is None:
        counts = (pattern.vertices_coords, pattern.edges_vertices, pattern.faces_vertices)
        return (Piece(pattern, *(np.arange(len(array)) for array in counts)),)
    numbers = range(pattern.pieces_count)
    return tuple(piece_of(pattern, np.flatnonzero(pattern.pieces == n)) for n in numbers)


def piece_of(pattern: CreasePattern, facets: Ints) -> Piece:
    """The ``facets`` (n,) of ``pattern`` alone, in their order."""
    faces = pattern.faces_vertices[facets]
    vertices = np.unique(faces[faces >= 0])
    edges = np.unique(pattern.faces_edges[facets][faces >= 0])
    edge = np.full(len(pattern.edges_vertices), -1, dtype=np.int64)
    edge[edges] = np.arange(len(edges))
    cells = pattern.cells
    seams = None if pattern.seams is None else edge[pattern.seams]
    if seams is not None:
        seams = seams[(seams >= 0).all(axis=1)]
    alone = restricted(
        pattern,
        vertices,
        edges,
        faces,
        grid=None,
        pieces=None,
        seams=seams,
        cells=None if cells is None else cells[facets],
    )
    return Piece(alone, vertices, edges, facets)


def shelved(sizes: Floats, gap: float) -> Floats:
    """(n, 2) the places of boxes of ``sizes`` (n, 2) in rows, ``gap`` apart, in their order."""
    widest = max(SHELF * math.sqrt(float(sizes.prod(axis=1).sum())), float(sizes[:, 0].max()))
    places = []
    x = y = top = 0.0
    for width, height in sizes.tolist():
        if x > 0.0 and x + width > widest:
            x, y = 0.0, top + gap
        places.append([x, y])
        x, top = x + width + gap, max(top, y + height)
    return np.array(places)
