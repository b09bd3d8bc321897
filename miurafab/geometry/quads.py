"""The topology of a regular quad grid, row-major: vertex index = row * columns + column.

Column index i runs along a row, row index j across. Facet (i, j) has the corners
(i, j), (i+1, j), (i+1, j+1), (i, j+1), counter-clockwise where i points right and j up.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from miurafab.geometry.arrays import Bools, Ints


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


@dataclass(frozen=True, eq=False)
class QuadCharts:
    """Quads in charts over one table of vertices; neighbouring charts share the vertices of a seam.

    ``faces_vertices`` (F, 4) are the corners (i, j), (i+1, j), (i+1, j+1), (i, j+1) of each facet,
    ``cells`` (F, 2) its column and row in the lattice of the parameter domain, and ``pieces`` (F,)
    its chart. A whole grid, a grid with missing cells, gores, and a ring that closes on itself are
    all of this kind.
    """

    faces_vertices: Ints
    cells: Ints
    pieces: Ints
    vertices_count: int

    @classmethod
    def of_cells(
        cls, kept: Bools, piece_of_column: Ints | None = None, closed: bool = False
    ) -> QuadCharts:
        """The charts of the cells ``kept`` (rows, columns), numbered row-major.

        ``piece_of_column`` (columns,) parts them into charts along columns of vertices; without it
        there is one chart. ``closed`` joins the last column to the first.
        """
        columns = kept.shape[1]
        row, column = np.nonzero(kept)
        across = columns if closed else columns + 1
        right = (column + 1) % across
        corners = np.stack(
            [
                row * across + column,
                row * across + right,
                (row + 1) * across + right,
                (row + 1) * across + column,
            ],
            axis=1,
        )
        used, faces = np.unique(corners, return_inverse=True)
        pieces = np.zeros(columns, dtype=np.int64) if piece_of_column is None else piece_of_column
        return cls(
            faces.reshape(-1, 4).astype(np.int64),
            np.stack([column, row], axis=1).astype(np.int64),
            pieces[column],
            len(used),
        )

    @cached_property
    def edges_vertices(self) -> Ints:
        """(E, 2) edges: first those along the rows, then those across, each once."""
        f = self.faces_vertices
        along = np.concatenate([f[:, [0, 1]], f[:, [3, 2]]])
        across = np.concatenate([f[:, [0, 3]], f[:, [1, 2]]])
        return np.concatenate([np.unique(along, axis=0), np.unique(across, axis=0)])

    @cached_property
    def _facet_with_corner(self) -> Ints:
        """(V, 4) the facet that has each vertex as its corner 0, 1, 2, 3; -1 for none."""
        facet = np.full((self.vertices_count, 4), -1, dtype=np.int64)
        for corner in range(4):
            facet[self.faces_vertices[:, corner], corner] = np.arange(len(self.faces_vertices))
        return facet

    def next_facets(self, direction: int) -> Ints:
        """(F,) the next facet in the same chart along i (``direction`` 0) or j (1), -1 for none."""
        corner = self.faces_vertices[:, 1 if direction == 0 else 3]
        facet = self._facet_with_corner[corner, 0]
        return np.where((facet >= 0) & (self.pieces[facet] == self.pieces), facet, -1)

    @cached_property
    def interior_vertices(self) -> Ints:
        """(I,) the vertices with four facets of one chart around them."""
        facet = self._facet_with_corner
        piece = np.where(facet >= 0, self.pieces[facet], -1)
        return np.flatnonzero((piece >= 0).all(axis=1) & (piece == piece[:, :1]).all(axis=1))

    @cached_property
    def interior_neighbours(self) -> Ints:
        """(I, 4) the neighbours of each interior vertex, counter-clockwise from +i:
        right, up, left, down.
        """
        facet = self._facet_with_corner[self.interior_vertices]
        after, before = self.faces_vertices[facet[:, 0]], self.faces_vertices[facet[:, 2]]
        return np.stack([after[:, 1], after[:, 3], before[:, 3], before[:, 1]], axis=1)

    @cached_property
    def neighbouring_facets(self) -> Ints:
        """(P, 2) the facets on both sides of each crease inside a chart."""
        f, cells = self.faces_vertices, self.cells
        sides = np.concatenate([f[:, [1, 2]], f[:, [0, 3]], f[:, [3, 2]], f[:, [0, 1]]])
        facets = np.tile(np.arange(len(cells)), 4)
        edges, edge = np.unique(sides, axis=0, return_inverse=True)
        order = np.argsort(edge.ravel(), kind="stable")
        first = np.concatenate([[0], np.cumsum(np.bincount(edge.ravel(), minlength=len(edges)))])
        two = np.flatnonzero(np.diff(first) == 2)
        pairs = np.stack([facets[order[first[two]]], facets[order[first[two] + 1]]], axis=1)
        return np.asarray(pairs[self.pieces[pairs[:, 0]] == self.pieces[pairs[:, 1]]])

    def on_two_facets(self, edges: Ints) -> Bools:
        """(n,) whether a facet lies on both sides of each of ``edges`` (n, 2), from any chart."""
        f = self.faces_vertices
        sides = np.sort(np.concatenate([f[:, [k, (k + 1) % 4]] for k in range(4)]), axis=1)
        key = sides[:, 0] * self.vertices_count + sides[:, 1]
        found, count = np.unique(key, return_counts=True)
        ends = np.sort(edges, axis=1)
        return np.isin(ends[:, 0] * self.vertices_count + ends[:, 1], found[count == 2])

    @cached_property
    def lattice(self) -> Ints:
        """(V, 2) the column and row of each vertex; a vertex of a closing seam has the lower."""
        place = np.full((self.vertices_count, 2), np.iinfo(np.int64).max)
        for corner, offset in enumerate(np.array([[0, 0], [1, 0], [1, 1], [0, 1]])):
            np.minimum.at(place, self.faces_vertices[:, corner], self.cells + offset)
        return place
