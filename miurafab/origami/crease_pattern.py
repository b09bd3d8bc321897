"""The crease pattern: one mesh with two shapes, flat paper and folded form.

Arrays carry their FOLD names. A crease is an edge with an assignment (B border, M mountain,
V valley, F flat, U unassigned, C cut, J join) and a fold angle, positive for a valley, measured
from flat (FOLD 1.2, https://github.com/edemaine/fold).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from miurafab.errors import PatternError
from miurafab.geometry.arrays import Floats, Ints

ASSIGNMENTS = ("B", "M", "V", "F", "U", "C", "J")


@dataclass(frozen=True, eq=False)
class CreasePattern:
    """A pattern of V vertices, E edges and F facets; lengths in mm, angles in radians.

    ``vertices_coords`` (V, 2) float64 is the flat pattern and ``folded_coords`` (V, 3) float64 its
    folded form, or None where only the flat pattern is known. ``edges_vertices`` (E, 2) int64,
    ``edges_assignment`` (E,) of one-letter strings, ``edges_fold_angle`` (E,) float64.
    ``faces_vertices`` (F, k) int64, counter-clockwise in the flat pattern, rows of polygons with
    fewer than k corners filled with -1. ``grid`` is ``(columns, rows)`` of vertices where the
    vertices form a grid in row-major order. ``target`` names the surface and its parameters, and
    the folded form lies on ``scale`` times it.
    """

    vertices_coords: Floats
    edges_vertices: Ints
    edges_assignment: NDArray[np.str_]
    edges_fold_angle: Floats
    faces_vertices: Ints
    folded_coords: Floats | None = None
    grid: tuple[int, int] | None = None
    scale: float = 1.0
    target: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        vertices, edges = len(self.vertices_coords), len(self.edges_vertices)
        if not np.isfinite(self.vertices_coords).all():
            raise PatternError("The flat pattern holds a coordinate that is not a finite number.")
        if self.folded_coords is not None:
            if self.folded_coords.shape != (vertices, 3):
                raise PatternError("The folded form does not have one 3D point for each vertex.")
            if not np.isfinite(self.folded_coords).all():
                raise PatternError("The folded form holds a coordinate that is not finite.")
        if len(self.edges_assignment) != edges or len(self.edges_fold_angle) != edges:
            raise PatternError("The pattern does not have one assignment and angle for each edge.")
        for name, indices in (
            ("edges_vertices", self.edges_vertices),
            ("faces_vertices", self.faces_vertices),
        ):
            if indices.size and (indices.max() >= vertices or indices.min() < -1):
                raise PatternError(f"{name} refers to a vertex that does not exist.")
        if self.grid is not None and self.grid[0] * self.grid[1] != vertices:
            raise PatternError(f"The grid {self.grid} does not have {vertices} vertices.")

    @cached_property
    def faces_edges(self) -> Ints:
        """(F, k) index of the edge from each face corner to the next, -1 where there is none."""
        return self._faces_edges_and_edges_faces[0]

    @cached_property
    def edges_faces(self) -> Ints:
        """(E, 2) the faces left and right of each edge in its own direction, -1 for none."""
        return self._faces_edges_and_edges_faces[1]

    @cached_property
    def _faces_edges_and_edges_faces(self) -> tuple[Ints, Ints]:
        faces, k = self.faces_vertices.shape
        count = (self.faces_vertices >= 0).sum(axis=1)
        slot = np.broadcast_to(np.arange(k), (faces, k))
        following = np.where(slot + 1 < count[:, None], slot + 1, 0)
        tail = self.faces_vertices
        head = np.take_along_axis(self.faces_vertices, following, axis=1)
        vertices = len(self.vertices_coords)
        key = np.minimum(tail, head) * vertices + np.maximum(tail, head)
        ends = np.sort(self.edges_vertices, axis=1)
        edge_keys = ends[:, 0] * vertices + ends[:, 1]
        order = np.argsort(edge_keys)
        place = np.searchsorted(edge_keys, key, sorter=order).clip(max=max(len(order) - 1, 0))
        found = order[place]
        real = tail >= 0
        if np.any(real & (edge_keys[found] != key)):
            raise PatternError("A facet has a side that is not among edges_vertices.")
        faces_edges = np.where(real, found, -1)
        edges_faces = np.full((len(self.edges_vertices), 2), -1, dtype=np.int64)
        face, corner = np.nonzero(real)
        edge = faces_edges[face, corner]
        right = (self.edges_vertices[edge, 0] != tail[face, corner]).astype(np.int64)
        if len(np.unique(edge * 2 + right)) != len(edge):
            raise PatternError("Two facets lie on the same side of one edge.")
        edges_faces[edge, right] = face
        return faces_edges, edges_faces
