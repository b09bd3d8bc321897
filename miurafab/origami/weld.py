"""Welding: the two ends of an edge that is too short to fold become one vertex.

Programs that cut a mesh leave edges of 1e-14 mm. Such an edge cannot be folded, and a facet with
one is no simple polygon to a program that counts its turns. With the edge goes a facet that has
fewer than three corners left, and of two edges between the same vertices the second. What a pattern
says of a grid or lattice does not hold for one that was welded.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from miurafab.geometry.arrays import Ints, group_means
from miurafab.geometry.connected import components
from miurafab.origami.crease_pattern import CreasePattern


def welded(pattern: CreasePattern, tolerance: float) -> CreasePattern:
    """``pattern`` with the ends of each edge shorter than ``tolerance`` (mm, in the flat pattern)
    in their middle; ``pattern`` itself if there is none.

    Vertices that no edge joins stay apart, however near: they may be of two pieces.
    """
    ends = pattern.vertices_coords[pattern.edges_vertices]
    short = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) < tolerance
    if not short.any():
        return pattern
    number = components(len(pattern.vertices_coords), *pattern.edges_vertices[short].T)
    lines = np.sort(number[pattern.edges_vertices], axis=1)
    _, first = np.unique(lines, axis=0, return_index=True)
    kept = np.sort(first[lines[first, 0] != lines[first, 1]])
    place = np.full(len(lines), -1)
    place[kept] = np.arange(len(kept))
    faces = [_corners(number[corners[corners >= 0]]) for corners in pattern.faces_vertices]
    whole = np.array([len(corners) > 2 for corners in faces])
    seams = None if pattern.seams is None else place[pattern.seams]
    folded = pattern.folded_coords
    return replace(
        pattern,
        vertices_coords=group_means(pattern.vertices_coords, number),
        edges_vertices=number[pattern.edges_vertices[kept]],
        edges_assignment=pattern.edges_assignment[kept],
        edges_fold_angle=pattern.edges_fold_angle[kept],
        faces_vertices=_padded([corners for corners in faces if len(corners) > 2]),
        folded_coords=None if folded is None else group_means(folded, number),
        grid=None,
        pieces=None if pattern.pieces is None else pattern.pieces[whole],
        seams=None if seams is None else seams[(seams >= 0).all(axis=1)],
        cells=None,
    )


def _corners(corners: Ints) -> Ints:
    """``corners`` (n,) round a facet without those that repeat the one before."""
    return np.asarray(corners[corners != np.roll(corners, 1)])


def _padded(faces: list[Ints]) -> Ints:
    """``faces`` as one array, with -1 behind the corners of smaller facets."""
    padded = np.full((len(faces), max(map(len, faces), default=3)), -1, dtype=np.int64)
    for row, corners in zip(padded, faces, strict=True):
        row[: len(corners)] = corners
    return padded
