"""A pattern with cuts, opened along them: each side of a cut has vertices and edges of its own.

Facets that touch at a vertex alone are parted there, since nothing holds them. Two corners of
facets are one vertex if facets around it join them across edges that are not cut. Facets and edges
keep their numbers. One fan of facets keeps the vertex, and the left side of a cut keeps the edge;
what is new comes behind. A cut whose two ends both stay one vertex stays one edge, of letter C.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from miurafab.findings import Finding
from miurafab.geometry.arrays import Ints
from miurafab.geometry.connected import components
from miurafab.geometry.polygons import connected_parts, next_corners
from miurafab.origami.crease_pattern import CreasePattern


def cut_open(pattern: CreasePattern) -> CreasePattern:
    """``pattern`` with its inner cuts as borders where they part, parted where it touches at a
    vertex alone; the pattern itself if there is neither.

    Edges of letter B or C with a facet on both sides are cuts.
    """
    inner = np.asarray((pattern.edges_faces >= 0).all(axis=1))
    cut = inner & np.isin(pattern.edges_assignment, ("B", "C"))
    told = opened_cuts(pattern)
    faces, width = pattern.faces_vertices, pattern.faces_vertices.shape[1]
    face, slot = np.nonzero(faces >= 0)
    start, end = face * width + slot, face * width + next_corners(faces)[face, slot]
    edge = pattern.faces_edges[face, slot]
    side = (pattern.edges_vertices[edge, 0] != faces[face, slot]).astype(np.int64)
    # (E, 2, 2) the corners at the tail and the head of each edge, in the facet on either side
    corners = np.full((len(pattern.edges_vertices), 2, 2), -1, dtype=np.int64)
    corners[edge, side, side] = start
    corners[edge, side, 1 - side] = end
    joined = corners[inner & ~cut]
    vertex = _fans(pattern, joined[:, 0].ravel(), joined[:, 1].ravel())
    if not cut.any() and np.array_equal(vertex[start], faces[face, slot]):
        return pattern
    own = np.where(corners[:, :1, 0] >= 0, corners[:, 0], corners[:, 1])
    edges = np.where(own >= 0, vertex[own], pattern.edges_vertices)
    across = np.where(corners[:, :1, 1] >= 0, corners[:, 1], corners[:, 0])
    parted = cut & (vertex[across] != edges).any(axis=1)
    other = vertex[corners[parted, 1]]
    source = np.arange(max(int(vertex.max()) + 1, len(pattern.vertices_coords)))
    source[vertex[start]] = faces[face, slot]
    opened = np.where(faces >= 0, vertex.reshape(faces.shape), -1)
    parts, piece = connected_parts(opened)
    letter = np.select([parted, cut], ["B", "C"], pattern.edges_assignment)
    angle = np.where(cut, 0.0, pattern.edges_fold_angle)
    folded = pattern.folded_coords
    return replace(
        pattern,
        vertices_coords=pattern.vertices_coords[source],
        edges_vertices=np.concatenate([edges, other]),
        edges_assignment=np.concatenate([letter, np.full(len(other), "B")]),
        edges_fold_angle=np.concatenate([angle, np.zeros(len(other))]),
        faces_vertices=opened,
        folded_coords=None if folded is None else folded[source],
        grid=None,
        pieces=piece if parts > 1 else None,
        told=(*pattern.told, *(each for each in told if each not in pattern.told)),
    )


def opened_cuts(pattern: CreasePattern) -> tuple[Finding, ...]:
    """What is told of the cuts within ``pattern``, along which the sheet opens; empty for none."""
    inner = np.asarray((pattern.edges_faces >= 0).all(axis=1))
    cuts = np.flatnonzero(inner & np.isin(pattern.edges_assignment, ("B", "C")))
    if not len(cuts):
        return ()
    joined = pattern.edges_faces[np.setdiff1d(np.flatnonzero(inner), cuts)]
    after = int(components(len(pattern.faces_vertices), *joined.T).max()) + 1
    before = pattern.pieces_count
    parts = f" and falls into {after} pieces" if after > before else ""
    several = f"{len(cuts)} edges within the sheet are cuts"
    says = (
        f"{'An edge within the sheet is a cut' if len(cuts) == 1 else several} (C): when folded, "
        f"the sheet opens there{parts}, and nothing holds the two sides together."
    )
    return (Finding("opened", says, tuple(cuts.tolist())),)


def _fans(pattern: CreasePattern, one: Ints, other: Ints) -> Ints:
    """(F k,) the vertex of each corner of a facet, where the corners ``one`` and ``other`` (n,) are
    the same vertex.
    """
    faces = pattern.faces_vertices.ravel()
    fan = components(len(faces), one, other)
    real = np.flatnonzero(faces >= 0)
    _, first, which = np.unique(fan[real], return_index=True, return_inverse=True)
    origin = faces[real][first]
    _, kept = np.unique(origin, return_index=True)
    again = np.ones(len(origin), dtype=bool)
    again[kept] = False
    number = origin.copy()
    number[again] = len(pattern.vertices_coords) + np.arange(int(again.sum()))
    vertex = np.full(len(faces), -1, dtype=np.int64)
    vertex[real] = number[which.reshape(-1)]
    return vertex
