"""Seam lines: which borders of a pattern meet, as a person reads it in a drawing.

A seam is a pair of border edges that are glued to each other. A person glues whole lines of them:
the seams between the same two parts of the flat pattern that follow one another in the shell, where
the doubled vertices of a seam are one point. The lines are numbered from 1. A drawing shows each
line on both of its sides in one colour, with its number, so that what meets bears the same number.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.connected import components
from miurafab.geometry.polygons import connected_parts, edge_lengths
from miurafab.origami.crease_pattern import CreasePattern

SEAM_COLOURS = ("#2f8f46", "#d9730d", "#8e3bb0", "#0a8a99", "#a58500", "#cc3a86")
"""The colours of seam lines in turn; none is like those of mountains and valleys."""


SEAM_WORDS = "seam: what bears the same number meets"
"""What a legend says of seam lines."""


@dataclass(frozen=True, eq=False)
class SeamLine:
    """The seam line with this ``number``: ``edges`` (n, 2) int64 are its pairs of border edges.

    ``places`` (2, 2) are points in mm near the middle of each side, inside the paper.
    """

    number: int
    edges: Ints
    places: Floats

    @property
    def colour(self) -> str:
        """The colour of the line, ``#rrggbb``."""
        return SEAM_COLOURS[(self.number - 1) % len(SEAM_COLOURS)]


def seam_lines(pattern: CreasePattern) -> tuple[SeamLine, ...]:
    """The seam lines of ``pattern``, in the order of their lowest edges."""
    if pattern.seams is None or not len(pattern.seams):
        return ()
    part = connected_parts(pattern.faces_vertices)[1]
    parts = part[pattern.edges_faces[pattern.seams].max(axis=2)]
    lines = _chains(pattern, np.sort(parts, axis=1))
    # Each side of a line is one unbroken border of one part.
    border = connected_parts(pattern.edges_vertices[pattern.seams.T.ravel()])[1].reshape(2, -1).T
    side = parts * (border.max() + 1) + border
    edges = np.where((side[:, 0] > side[:, 1])[:, None], pattern.seams[:, ::-1], pattern.seams)
    first = [int(edges[lines == line].min()) for line in range(lines.max() + 1)]
    return tuple(
        SeamLine(number, own, _places(pattern, own))
        for number, own in enumerate(
            (edges[lines == line] for line in np.argsort(first).tolist()), start=1
        )
    )


def _chains(pattern: CreasePattern, parts: Ints) -> Ints:
    """(S,) the line of each seam: seams of one pair of ``parts`` (S, 2) that share a point."""
    vertices = len(pattern.vertices_coords)
    met = pattern.seam_vertices.reshape(-1, 2)
    points = components(vertices, *met.T)
    seams, pair = len(parts), np.unique(parts, axis=0, return_inverse=True)[1].ravel()
    ends = points[pattern.seam_vertices[:, :, 0]]
    # A point counts once for each pair of parts that meets there.
    keys = np.unique((pair[:, None] * vertices + ends).ravel(), return_inverse=True)[1]
    size = seams + int(keys.max()) + 1
    return components(size, np.repeat(np.arange(seams), 2), seams + keys.ravel())[:seams]


def _places(pattern: CreasePattern, edges: Ints) -> Floats:
    """(2, 2) a point near the middle of each side of a seam line, inside the paper."""
    found = []
    for side in (0, 1):
        own = edges[:, side]
        ends = pattern.vertices_coords[pattern.edges_vertices[own]]
        middles = ends.mean(axis=1)
        # Where the line is closed all round, its first edge is as good as any.
        middle = int(np.argmin(np.linalg.norm(middles - middles.mean(axis=0), axis=1)))
        face = pattern.faces_vertices[pattern.edges_faces[own[middle]].max()]
        inside = pattern.vertices_coords[face[face >= 0]].mean(axis=0)
        length = float(edge_lengths(pattern.vertices_coords, pattern.edges_vertices[own]).mean())
        way = inside - middles[middle]
        reach = min(0.35 * length, float(np.linalg.norm(way)))
        found.append(middles[middle] + way / max(float(np.linalg.norm(way)), 1e-12) * reach)
    return np.array(found)
