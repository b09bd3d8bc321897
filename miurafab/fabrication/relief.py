"""Relief holes: a small circle is burnt out where creases meet, so that folds tear no paper.

For a hole of diameter d the beam follows a circle of diameter d - kerf. The creases that meet there
start at its rim, d / 2 from the vertex, so nothing is burnt twice. A vertex on the border of a
patch gets no hole, because the outline opens it already. A vertex gets none, too, if one of its
creases is too short for a dash and its bridges between two holes; these vertices are counted and
reported.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from miurafab.geometry.arrays import Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern

_SIDE_MM = 0.15
"""The least side of the polygon drawn for a circle: importers merge points below 0.1 mm."""


@dataclass(frozen=True, eq=False)
class Holes:
    """``vertex`` (H,) int64 the pattern vertices with a hole, ``patch`` (H,) their patches and
    ``edge`` (H,) a crease of each; ``left_out`` is the number of vertices without room.
    """

    vertex: Ints
    patch: Ints
    edge: Ints
    left_out: int


def relief_holes(
    pattern: CreasePattern, face_patch: Ints, edges: Ints, room: Floats, diameter: float
) -> Holes:
    """The holes of ``diameter`` mm where the creases ``edges`` (n,) meet.

    ``face_patch`` (F,) is the patch of each facet, ``room`` (n,) the length in mm that each crease
    needs between two holes.
    """
    if diameter == 0.0 or not len(edges):
        none = np.empty(0, dtype=np.int64)
        return Holes(none, none, none, 0)
    vertices = len(pattern.vertices_coords)
    faces = pattern.edges_faces
    patch = np.where(faces >= 0, face_patch[faces], -1)
    open_side = (patch[:, 0] != patch[:, 1]) | (patch[:, 0] < 0)
    closed = np.ones(vertices, dtype=bool)
    closed[pattern.edges_vertices[open_side]] = False
    ends = pattern.edges_vertices[edges]
    meeting = np.bincount(ends.ravel(), minlength=vertices)
    wanted = closed & (meeting >= 2)
    span = np.diff(pattern.vertices_coords[ends], axis=1)[:, 0]
    short = np.linalg.norm(span, axis=1) < diameter + room
    cramped = np.zeros(vertices, dtype=bool)
    cramped[ends[short]] = True
    vertex = np.flatnonzero(wanted & ~cramped)
    first = np.full(vertices, len(pattern.edges_vertices))
    np.minimum.at(first, ends.ravel(), np.repeat(edges, 2))
    return Holes(vertex, patch[first[vertex], 0], first[vertex], int((wanted & cramped).sum()))


def circles(centres: Floats, diameter: float) -> tuple[Floats, int]:
    """The closed polygons of circles of ``diameter`` mm around ``centres`` (n, 2): their points
    (n * count, 2), the first point repeated at the end, and the count.
    """
    sides = min(max(int(math.pi * diameter / _SIDE_MM), 6), 48)
    angle = np.arange(sides + 1) % sides * (2 * math.pi / sides)
    ring = diameter / 2 * np.column_stack([np.cos(angle), np.sin(angle)])
    return (centres[:, None] + ring).reshape(-1, 2), sides + 1
