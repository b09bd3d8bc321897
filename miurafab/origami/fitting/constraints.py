"""The conditions that make a grid of points an origami, with their sparse analytic Jacobians.

Notation: x (V, 3) points; L the mean edge length. Every residual is without dimension.

planarity          c_f = det(p1 - p0, p2 - p0, p3 - p0) / L^3                for each facet
developability     c_v = a0 + a1 + a2 + a3 - 2 pi                            interior vertices
flat-foldability   c_v = a0 + a2 - pi    (Kawasaki, given developability)    interior vertices

For a sector alpha at o between A = a - o and B = b - o, with n = A x B / |A x B|,

    d alpha / d a = (A x n) / |A|^2,   d alpha / d b = (n x B) / |B|^2,   d alpha / d o = -(sum).

(Dudte, Vouga, Tachi and Mahadevan, Nature Materials 15 (2016), Methods: the same three families.)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from miurafab.geometry.angles import sector_angles, sectors
from miurafab.geometry.arrays import Floats, vector_product
from miurafab.geometry.quads import QuadCharts, QuadGrid

Index = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class OrigamiConstraints:
    """All conditions on one grid, stacked into c(x) with Jacobian J; x is (3V,) row-major.

    ``length`` is the mean edge length, a constant. The rows are planarity of the facets, then
    developability and, with ``flat_foldable``, flat-foldability of the interior vertices.
    """

    grid: QuadGrid | QuadCharts
    length: float
    flat_foldable: bool

    @cached_property
    def _pattern(self) -> tuple[Index, Index]:
        """Column indices and row starts of J (CSR), as SciPy keeps them."""
        faces = self.grid.faces_vertices
        spokes = np.concatenate(
            [self.grid.interior_vertices[:, None], self.grid.interior_neighbours], axis=1
        )
        stencils = [faces, spokes, *([spokes] if self.flat_foldable else [])]
        columns = [(s[:, :, None] * 3 + np.arange(3)).reshape(-1) for s in stencils]
        sizes = np.concatenate([np.full(len(s), 3 * s.shape[1]) for s in stencils])
        starts = np.concatenate([[0], np.cumsum(sizes)])
        return np.concatenate(columns).astype(np.int32), starts.astype(np.int32)

    @property
    def count(self) -> int:
        facets, interior = len(self.grid.faces_vertices), len(self.grid.interior_vertices)
        return facets + interior * (2 if self.flat_foldable else 1)

    def __call__(self, x: Floats) -> tuple[Floats, sparse.csr_array]:
        """c (m,) and J (m, 3V) at ``x`` (3V,)."""
        points = x.reshape(-1, 3)
        flat, flat_rows = self._planarity(points)
        values, jacobian = [flat], [flat_rows.reshape(-1)]
        angles, gradients = self._sectors(points)
        if len(angles):
            values.append(angles.sum(axis=1) - 2 * np.pi)
            jacobian.append(_spoke_rows(gradients, (0, 1, 2, 3)))
            if self.flat_foldable:
                values.append(angles[:, 0] + angles[:, 2] - np.pi)
                jacobian.append(_spoke_rows(gradients, (0, 2)))
        matrix = sparse.csr_array(
            (np.concatenate(jacobian), *self._pattern), shape=(self.count, len(x))
        )
        return np.concatenate(values), matrix

    def values(self, x: Floats) -> Floats:
        """c (m,) alone, to the same bits, in a third of the time."""
        points = x.reshape(-1, 3)
        a, b, c = self._from_first_corner(points)
        flat = np.einsum("fk,fk->f", a, vector_product(b, c)) / self.length**3
        grid = self.grid
        angles = sector_angles(points, grid.interior_vertices, grid.interior_neighbours)
        values = [flat, angles.sum(axis=1) - 2 * np.pi]
        if self.flat_foldable:
            values.append(angles[:, 0] + angles[:, 2] - np.pi)
        return np.concatenate(values)

    def _from_first_corner(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        p = points[self.grid.faces_vertices]
        return p[:, 1] - p[:, 0], p[:, 2] - p[:, 0], p[:, 3] - p[:, 0]

    def _planarity(self, points: Floats) -> tuple[Floats, Floats]:
        a, b, c = self._from_first_corner(points)
        bc, ca, ab = vector_product(b, c), vector_product(c, a), vector_product(a, b)
        residual = np.einsum("fk,fk->f", a, bc) / self.length**3
        gradient = np.stack([-(bc + ca + ab), bc, ca, ab], axis=1) / self.length**3
        return residual, gradient

    def _sectors(self, points: Floats) -> tuple[Floats, Floats]:
        """Angles (I, 4) and gradients (I, 4, 2, 3): sector k to its first and second spoke."""
        centre = points[self.grid.interior_vertices][:, None, :]
        a = points[self.grid.interior_neighbours] - centre
        angles, to_a, to_b = sectors(a, np.roll(a, -1, axis=1))
        return angles, np.stack([to_a, to_b], axis=2)


def _spoke_rows(gradients: Floats, sectors: tuple[int, ...]) -> Floats:
    """Jacobian rows of a sum of sectors, over [centre, right, up, left, down] x 3, flat."""
    rows = np.zeros((len(gradients), 5, 3))
    for k in sectors:
        rows[:, 1 + k] += gradients[:, k, 0]
        rows[:, 1 + (k + 1) % 4] += gradients[:, k, 1]
    rows[:, 0] = -rows[:, 1:].sum(axis=1)
    return rows.reshape(-1)
