"""A tessellation: a regular grid of vertices in folded form, exact or not yet exact.

Vertices with the same row index j form a polyline that zig-zags along i. Ridges and valleys
alternate in j.
"""

from __future__ import annotations

from dataclasses import dataclass

from miurafab.geometry.arrays import Floats
from miurafab.geometry.polygons import edge_lengths
from miurafab.geometry.quads import QuadGrid


@dataclass(frozen=True, eq=False)
class Tessellation:
    """``points`` (rows, columns, 3) float64: vertex (i, j) is ``points[j, i]``."""

    points: Floats

    @property
    def grid(self) -> QuadGrid:
        """The topology."""
        return QuadGrid(self.points.shape[1], self.points.shape[0])

    @property
    def vertices(self) -> Floats:
        """(V, 3) the points in row-major order."""
        return self.points.reshape(-1, 3)

    @property
    def edge_lengths(self) -> Floats:
        """(E,) lengths in the order of ``grid.edges_vertices``."""
        return edge_lengths(self.vertices, self.grid.edges_vertices)

    def scaled(self, factor: float) -> Tessellation:
        """The same tessellation, ``factor`` times as large."""
        return Tessellation(self.points * factor)
