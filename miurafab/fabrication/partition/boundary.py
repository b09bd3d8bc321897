"""Boundaries of patches: closed loops of edges with the facets of the patch on their left.

Facets are counter-clockwise, so the outer loop of a patch is, too, and the loop around a hole is
clockwise. A patch overlaps itself in the plane, or touches itself, if its loops do not bound a
valid polygon with holes.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import shapely

from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.polygons import signed_areas, simple_loops
from miurafab.origami.crease_pattern import CreasePattern


@dataclass(frozen=True, eq=False)
class Boundary:
    """The outer loop of a patch, counter-clockwise: ``vertices`` and ``edges`` (n,) int64 of the
    pattern; edge i follows vertex i. ``holes`` are the loops around its holes, clockwise.
    """

    vertices: Ints
    edges: Ints
    holes: tuple[Boundary, ...] = ()

    @property
    def loops(self) -> tuple[Boundary, ...]:
        """The outer loop, then the loops around holes."""
        return (self, *self.holes)


def boundaries(pattern: CreasePattern, face_patch: Ints) -> list[Boundary]:
    """The boundary of each patch of ``face_patch`` (F,), by patch id, each loop from its lowest
    edge on. Where a patch touches itself in a vertex two loops meet, as no loop has one twice.
    """
    face, corner = np.nonzero(pattern.faces_vertices >= 0)
    edge = pattern.faces_edges[face, corner]
    tail = pattern.faces_vertices[face, corner]
    sides = pattern.edges_faces[edge]
    other = np.where(sides[:, 0] == face, sides[:, 1], sides[:, 0])
    patch = face_patch[face]
    border = np.flatnonzero((other < 0) | (face_patch[other] != patch))
    border = border[np.lexsort((edge[border], patch[border]))]
    patch, edge, tail = patch[border], edge[border], tail[border]
    head = pattern.edges_vertices[edge].sum(axis=1) - tail
    vertices = len(pattern.vertices_coords)
    # the n-th side that ends at a vertex is followed by the n-th that starts there
    starts = np.argsort(patch * vertices + tail, kind="stable")
    stops = np.argsort(patch * vertices + head, kind="stable")
    following = np.empty(len(border), dtype=np.int64)
    following[stops] = starts
    found: list[Boundary] = []
    left = np.ones(len(border), dtype=bool)
    bounds = np.searchsorted(patch, np.arange(int(face_patch.max(initial=-1)) + 2)).tolist()
    for start, end in itertools.pairwise(bounds):
        loops = []
        for first in range(start, end):
            if not left[first]:
                continue
            steps = [first]
            while following[steps[-1]] != first:
                steps.append(int(following[steps[-1]]))
            left[steps] = False
            for places in simple_loops(tail[steps].tolist()):
                own = np.array(steps)[places]
                own = np.roll(own, -int(np.argmin(own)))
                loops.append(Boundary(tail[own], edge[own]))
        if len(loops) > 1:
            loops.sort(key=lambda loop: -_area(pattern, loop))
        found.append(Boundary(loops[0].vertices, loops[0].edges, tuple(loops[1:])))
    return found


def overlapping(pattern: CreasePattern, around: list[Boundary]) -> list[int]:
    """The numbers of the patches whose boundary crosses or touches itself in the plane."""
    shapes = [
        shapely.Polygon(outer, holes)
        for outer, *holes in (
            [pattern.vertices_coords[loop.vertices] for loop in each.loops] for each in around
        )
    ]
    return np.flatnonzero(~shapely.is_valid(np.array(shapes))).tolist()


def _area(pattern: CreasePattern, loop: Boundary) -> float:
    points: Floats = pattern.vertices_coords[loop.vertices]
    return float(signed_areas(points[None])[0])
