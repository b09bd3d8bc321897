"""Sums over the vertices of a mesh: forces and stiffness of springs, each between a few vertices.

A stencil is a row of vertices that one spring joins: two for a bar, four for a hinge. The matrix is
as sparse as the stencils, and its sparsity and the order of elimination are found once. Springs
that come and go, of facets that touch, belong to no group: they are added to it. Six coordinates of
one triangle are held, in axes along it, to exclude rigid motions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.sparse import minimum_degree


@dataclass(frozen=True, eq=False)
class Assembly:
    """The sums of springs over ``count`` vertices.

    ``stencils`` are the groups of springs, each (n, k) with k vertices a spring; ``held`` (3,) is
    the held triangle.
    """

    count: int
    stencils: tuple[Ints, ...]
    held: Ints

    def gather(self, vectors: Sequence[Floats | None]) -> Floats:
        """The free coordinates of the sums at vertices of ``vectors``, (n, k, 3) for each group, or
        None for a group without forces.
        """
        total = np.zeros((3, self.count))
        for stencils, group in zip(self.stencils, vectors, strict=True):
            if group is not None and len(stencils):
                ends, flat = stencils.ravel(), group.reshape(-1, 3)
                for axis in range(3):
                    total[axis] += np.bincount(ends, flat[:, axis], self.count)
        return np.asarray(total.T.ravel()[self.free])

    def matrix(self, blocks: Sequence[Floats]) -> sparse.csc_array:
        """The sum of ``blocks``, (n, k, k, 3, 3) for each group, between the free coordinates."""
        sums, rows, starts, place = self._sparsity
        total = sums[0] @ blocks[0].reshape(-1, 9)
        for group, block in zip(sums[1:], blocks[1:], strict=True):
            total += group @ block.reshape(-1, 9)
        size = len(starts) - 1
        return sparse.csc_array((total.ravel()[place], rows, starts), shape=(size, size))

    def scattered(self, stencils: Ints, vectors: Floats) -> Floats:
        """As :meth:`gather`, of ``vectors`` (n, k, 3) at ``stencils`` (n, k) of no group."""
        total = np.zeros((self.count, 3))
        np.add.at(total, stencils, vectors)
        return np.asarray(total.ravel()[self.free])

    def joined(self, matrix: sparse.csc_array, stencils: Ints, blocks: Floats) -> sparse.csc_array:
        """``matrix`` plus ``blocks`` (n, k, k, 3, 3) at ``stencils`` (n, k) of no group."""
        if not len(stencils):
            return matrix
        at = self._places[stencils]
        k = stencils.shape[1]
        rows = np.broadcast_to(at[:, :, None, :, None], (len(at), k, k, 3, 3))
        columns = np.broadcast_to(at[:, None, :, None, :], rows.shape)
        real = (rows >= 0) & (columns >= 0)
        more = sparse.coo_array((blocks[real], (rows[real], columns[real])), shape=matrix.shape)
        return sparse.csc_array(matrix + more.tocsc())

    def vectors(self, coordinates: Floats) -> Floats:
        """(V, 3) the free ``coordinates`` at their vertices, and zeros where they are held."""
        whole = np.zeros(3 * self.count)
        whole[self.free] = coordinates
        return whole.reshape(-1, 3)

    @cached_property
    def free(self) -> Ints:
        """The free coordinates (3 vertex + axis) in the order of elimination."""
        first, second, third = self.held * 3
        held = [first, first + 1, first + 2, second + 1, second + 2, third + 2]
        coordinates = (self._elimination[:, None] * 3 + np.arange(3)).ravel()
        return coordinates[~np.isin(coordinates, held)]

    @cached_property
    def _pairs(self) -> list[tuple[Ints, Ints]]:
        """The rows and columns, as vertices, of the 3x3 blocks of each group as they are given."""
        pairs = []
        for stencils in self.stencils:
            size = stencils.shape[1]
            pairs.append(
                (np.repeat(stencils, size, axis=1).ravel(), np.tile(stencils, size).ravel())
            )
        return pairs

    @cached_property
    def _elimination(self) -> Ints:
        """(V,) vertices in a fill-reducing order, by minimum degree on the vertex graph."""
        rows, columns = (np.concatenate(ends) for ends in zip(*self._pairs, strict=True))
        shape = (self.count, self.count)
        graph = sparse.coo_array((np.ones(len(rows)), (rows, columns)), shape=shape).tocsc()
        graph.data[:] = -1.0
        graph.setdiag(np.diff(graph.indptr) + 1.0)  # diagonally dominant: factored as it stands
        return minimum_degree(graph)

    @cached_property
    def _places(self) -> Ints:
        """(V, 3) the place of each coordinate among the free ones, -1 for a held one."""
        places = np.full(3 * self.count, -1, dtype=np.int64)
        places[self.free] = np.arange(len(self.free))
        return places.reshape(-1, 3)

    @cached_property
    def _sparsity(
        self,
    ) -> tuple[list[sparse.csr_array], NDArray[np.int32], NDArray[np.int32], Ints]:
        """What sums the given blocks, group by group, to the blocks of the matrix; rows and column
        starts of the matrix (CSC); and the place of each of its numbers among the summed blocks.
        """
        place = np.argsort(self._elimination)
        keys = [place[columns] * self.count + place[rows] for rows, columns in self._pairs]
        known, block = np.unique(np.concatenate(keys), return_inverse=True)
        ends = np.cumsum([len(key) for key in keys])[:-1]
        sums = []
        for group in np.split(block, ends):
            given = np.arange(len(group) + 1)
            ones = np.ones(len(group))
            sums.append(sparse.csc_array((ones, group, given), (len(known), len(group))).tocsr())
        columns, rows = np.divmod(known, self.count)
        starts = np.searchsorted(columns, np.arange(self.count + 1))
        # the numbers of a block lie row by row, those of the matrix column by column
        numbers = np.arange(9 * len(known)).reshape(-1, 3, 3).swapaxes(1, 2)
        whole = sparse.bsr_array((numbers, rows, starts), 2 * (3 * self.count,)).tocsr()
        coordinates = (self._elimination[:, None] * 3 + np.arange(3)).ravel()
        free = np.flatnonzero(np.isin(coordinates, self.free))
        inner = whole[:, free][free]
        inner.sort_indices()
        return sums, inner.indices.astype(np.int32), inner.indptr.astype(np.int32), inner.data
