"""Sums over the vertices of a mesh: forces and stiffness of springs, each between a few vertices.

A stencil is a row of vertices that one spring joins: two for a bar, four for a hinge. The matrix is
as sparse as the stencils, and its sparsity and the order of elimination are found once. Springs
that come and go, of facets that touch, belong to no group. Where they join vertices that nothing
has joined before, the sparsity grows, by all that may touch soon as well; it never shrinks, so it
is seldom found anew. Six coordinates of one triangle are held, in axes along it, to exclude rigid
motions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from miurafab.geometry.arrays import Floats, Ints, places_among
from miurafab.geometry.sparse import minimum_degree


class Touch(NamedTuple):
    """n springs of no group, between four vertices each: their ``stencils`` (n, 4), and the
    ``forces`` (n, 4, 3) and ``stiffness`` (n, 4, 4, 3, 3), gradient and Hessian of their energy;
    the stiffness may be left out. ``soon`` (m, 4) are the stencils of those that may touch next.
    """

    stencils: Ints
    forces: Floats
    stiffness: Floats
    soon: Ints


_NONE: Ints = np.empty((0, 4), dtype=np.int64)
NO_TOUCH = Touch(_NONE, np.empty((0, 4, 3)), np.empty((0, 4, 4, 3, 3)), _NONE)


class Entries(NamedTuple):
    """The entries of a matrix of blocks with the ``keys`` (n,): its ``rows`` and column ``starts``
    (CSC), and the ``place`` of each of its numbers among those of the blocks.
    """

    keys: Ints
    rows: NDArray[np.int32]
    starts: NDArray[np.int32]
    place: Ints


@dataclass(frozen=True, eq=False)
class Assembly:
    """The sums of springs over ``count`` vertices.

    ``stencils`` are the groups of springs, each (n, k) with k vertices a spring; ``held`` (3,) is
    the held triangle. What changes is the sparsity, which grows by springs of no group.
    """

    count: int
    stencils: tuple[Ints, ...]
    held: Ints
    _entries: list[Entries] = field(default_factory=list)

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

    def matrix(self, blocks: Sequence[Floats], touch: Touch = NO_TOUCH) -> sparse.csc_array:
        """The sum of ``blocks``, (n, k, k, 3, 3) for each group, and of the stiffness of ``touch``,
        between the free coordinates.
        """
        sums, known = self._sums
        total = sums[0] @ blocks[0].reshape(-1, 9)
        for group, block in zip(sums[1:], blocks[1:], strict=True):
            total += group @ block.reshape(-1, 9)
        keys = self._keys(*_block_ends(touch.stencils))
        entries = self._met(keys, touch.soon)
        if len(keys) or len(entries.keys) > len(known):
            whole = np.zeros((len(entries.keys), 9))
            whole[np.searchsorted(entries.keys, known)] = total
            at = 9 * np.searchsorted(entries.keys, keys)[:, None] + np.arange(9)
            pushed = np.bincount(at.ravel(), touch.stiffness.ravel(), whole.size)
            total = whole + pushed.reshape(-1, 9)
        size = len(entries.starts) - 1
        numbers = total.ravel()[entries.place]
        return sparse.csc_array((numbers, entries.rows, entries.starts), shape=(size, size))

    def scattered(self, touch: Touch) -> Floats:
        """As :meth:`gather`, of the forces of ``touch``."""
        total = np.zeros((self.count, 3))
        np.add.at(total, touch.stencils, touch.forces)
        return np.asarray(total.ravel()[self.free])

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
        return [_block_ends(stencils) for stencils in self.stencils]

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
    def _sums(self) -> tuple[list[sparse.csr_array], Ints]:
        """What sums the given blocks, group by group, to the blocks with the keys that follow."""
        keys = [self._keys(*ends) for ends in self._pairs]
        known, block = np.unique(np.concatenate(keys), return_inverse=True)
        groups = np.split(block, np.cumsum([len(key) for key in keys])[:-1])
        return [_summing(group, len(known)) for group in groups], known

    @cached_property
    def _place(self) -> Ints:
        """(V,) the place of each vertex in the order of elimination."""
        return np.argsort(self._elimination)

    def _keys(self, rows: Ints, columns: Ints) -> Ints:
        """(n,) a number for each block; ascending by columns, and in each by rows."""
        return np.asarray(self._place[columns] * self.count + self._place[rows])

    def _met(self, keys: Ints, soon: Ints) -> Entries:
        """The entries of the matrices so far, and of blocks with the ``keys`` (n,). Where these are
        new, blocks of springs at ``soon`` (m, 4) get entries as well.
        """
        if not self._entries:
            self._entries.append(self._entries_of(self._sums[1]))
        old = self._entries[-1].keys
        if (places_among(old, keys) < 0).any():
            more = self._keys(*_block_ends(soon))
            self._entries[:] = [self._entries_of(np.unique(np.concatenate([old, keys, more])))]
        return self._entries[-1]

    def _entries_of(self, keys: Ints) -> Entries:
        """The entries of matrices whose blocks have the ``keys`` (n,)."""
        columns, rows = np.divmod(keys, self.count)
        starts = np.searchsorted(columns, np.arange(self.count + 1))
        # the numbers of a block lie row by row, those of the matrix column by column
        numbers = np.arange(9 * len(keys)).reshape(-1, 3, 3).swapaxes(1, 2)
        whole = sparse.bsr_array((numbers, rows, starts), 2 * (3 * self.count,)).tocsr()
        coordinates = (self._elimination[:, None] * 3 + np.arange(3)).ravel()
        free = np.flatnonzero(np.isin(coordinates, self.free))
        inner = whole[:, free][free]
        inner.sort_indices()
        ends = inner.indices.astype(np.int32), inner.indptr.astype(np.int32)
        return Entries(keys, *ends, inner.data)


def _block_ends(stencils: Ints) -> tuple[Ints, Ints]:
    """The rows and columns, as vertices, of the 3x3 blocks of springs at ``stencils`` (n, k)."""
    size = stencils.shape[1]
    return np.repeat(stencils, size, axis=1).ravel(), np.tile(stencils, size).ravel()


def _summing(block: Ints, count: int) -> sparse.csr_array:
    """What sums given blocks, each to its number ``block`` (n,) of ``count``."""
    given = np.arange(len(block) + 1)
    ones = np.ones(len(block))
    return sparse.csc_array((ones, block, given), (count, len(block))).tocsr()
