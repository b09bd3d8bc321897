"""The topology of a regular quad grid, row-major: vertex index = row * columns + column.

Column index i runs along a row, row index j across. Facet (i, j) has the corners
(i, j), (i+1, j), (i+1, j+1), (i, j+1), counter-clockwise where i points right and j up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from miurafab.geometry.arrays import Ints


@dataclass(frozen=True)
class QuadGrid:
    """A grid of ``columns`` x ``rows`` vertices, both at least 2."""

    columns: int
    rows: int

    def __post_init__(self) -> None:
        if self.columns < 2 or self.rows < 2:
            raise ValueError(f"a quad grid of {self.columns} x {self.rows} vertices has no facet")

    @property
    def vertices(self) -> Ints:
        """(rows, columns) vertex indices."""
        return np.arange(self.rows * self.columns, dtype=np.int64).reshape(self.rows, self.columns)

    @property
    def faces_vertices(self) -> Ints:
        """(F, 4) corners of each facet, facets row-major."""
        v = self.vertices
        corners = (v[:-1, :-1], v[:-1, 1:], v[1:, 1:], v[1:, :-1])
        return np.stack([c.ravel() for c in corners], axis=1)

    @property
    def edges_vertices(self) -> Ints:
        """(E, 2) edges: first those along the rows (row-major), then those across."""
        v = self.vertices
        along = np.stack([v[:, :-1].ravel(), v[:, 1:].ravel()], axis=1)
        across = np.stack([v[:-1, :].ravel(), v[1:, :].ravel()], axis=1)
        return np.concatenate([along, across])

    @property
    def interior_vertices(self) -> Ints:
        """(I,) indices of the vertices with four facets around them."""
        return self.vertices[1:-1, 1:-1].ravel()

    @property
    def interior_neighbours(self) -> Ints:
        """(I, 4) the neighbours of each interior vertex, counter-clockwise from +i:
        right, up, left, down.
        """
        v = self.vertices
        ring = (v[1:-1, 2:], v[2:, 1:-1], v[1:-1, :-2], v[:-2, 1:-1])
        return np.stack([n.ravel() for n in ring], axis=1)
