"""A tessellation: a regular grid of vertices in folded form, exact or not yet exact.

Vertices with the same row index j form a polyline that zig-zags along i. Ridges and valleys
alternate in j.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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
    def facet_count(self) -> int:
        return len(self.grid.faces_vertices)

    @property
    def edge_lengths(self) -> Floats:
        """(E,) lengths in the order of ``grid.edges_vertices``."""
        return edge_lengths(self.vertices, self.grid.edges_vertices)

    @property
    def midsurface(self) -> Floats:
        """(F, 3) the mean of each facet's corners, where the up and down of the rows cancels."""
        return np.asarray(self.vertices[self.grid.faces_vertices].mean(axis=1))

    def scaled(self, factor: float) -> Tessellation:
        """The same tessellation, ``factor`` times as large."""
        return Tessellation(self.points * factor)
