"""The unknowns of a fit: the vertices of a whole sheet, or of one period of it.

Conditions are stated on a grid of vertices, which for a whole sheet is the sheet's own grid. A
sheet on a surface of revolution repeats itself after two rows, turned about the axis,

    X_{j+2} = R_z(2 beta) X_j,

so its unknowns are the rows 0 and 1 alone, and the grid has the four rows

    R^-1 X_1,  X_0,  X_1,  R X_0.

The grid is T times the unknowns, with a constant matrix T, and the Jacobian by the unknowns is that
of the grid times T. The number of unknowns does not depend on the number of periods.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.quads import QuadGrid
from miurafab.origami.fitting.constraints import OrigamiConstraints
from miurafab.origami.fitting.solver import Constraints
from miurafab.origami.tessellation import Tessellation


@dataclass(frozen=True, eq=False)
class Unknowns:
    """The vertices of a sheet of ``columns`` x ``rows``; x (n,) is row-major.

    ``turn`` is the angle 2 beta of a period in radians, or None where the unknowns are the whole
    sheet; ``length`` is the mean edge length.
    """

    columns: int
    rows: int
    length: float
    turn: float | None = None

    @property
    def grid(self) -> QuadGrid:
        """The grid on which conditions are stated."""
        return QuadGrid(self.columns, self.rows if self.turn is None else 4)

    @property
    def first_row(self) -> int:
        """The row of the sheet that is row 0 of ``grid``."""
        return 0 if self.turn is None else -1

    @cached_property
    def places(self) -> Ints:
        """(n, 2) the column and row of the vertex of each unknown; for a period, which is a chain
        of columns, the row is 0.
        """
        solved = self.rows if self.turn is None else 2
        vertex = np.arange(self.columns * solved, dtype=np.int64).repeat(3)
        row = vertex // self.columns
        return np.stack([vertex % self.columns, row if self.turn is None else 0 * row], axis=1)

    @cached_property
    def substitution(self) -> sparse.csr_array:
        """T, (3V, n): the coordinates of ``grid`` are T times the unknowns."""
        if self.turn is None:
            return sparse.csr_array(sparse.eye_array(3 * self.columns * self.rows, format="csr"))
        one = sparse.eye_array(self.columns)
        blocks = [
            [None, sparse.kron(one, about_z(-self.turn))],
            [sparse.kron(one, np.eye(3)), None],
            [None, sparse.kron(one, np.eye(3))],
            [sparse.kron(one, about_z(self.turn)), None],
        ]
        return sparse.csr_array(sparse.block_array(blocks, format="csr"))

    def constraints(self, flat_foldable: bool) -> Constraints:
        """The conditions of an origami as a function of x."""
        on_grid = OrigamiConstraints(self.grid, self.length, flat_foldable)
        if self.turn is None:
            return on_grid
        # the first row of facets repeats the last row
        return self._of_unknowns(on_grid, np.arange(self.columns - 1, on_grid.count))

    def on_unknowns(self, on_grid: Constraints) -> Constraints:
        """Conditions on ``grid`` as a function of x."""
        return on_grid if self.turn is None else self._of_unknowns(on_grid, None)

    def _of_unknowns(self, on_grid: Constraints, chosen: Ints | None) -> Constraints:
        def conditions(x: Floats) -> tuple[Floats, sparse.csr_array]:
            values, jacobian = on_grid(self.substitution @ x)
            if chosen is not None:
                values, jacobian = values[chosen], jacobian[chosen]
            return values, jacobian @ self.substitution

        return conditions

    def sheet(self, x: Floats) -> Tessellation:
        """The whole sheet."""
        if self.turn is None:
            return Tessellation(x.reshape(self.rows, self.columns, 3))
        period = x.reshape(2, self.columns, 3)
        turned = np.array([about_z(k * self.turn) for k in range((self.rows + 1) // 2)])
        points = np.einsum("kab,rcb->krca", turned, period).reshape(-1, self.columns, 3)
        return Tessellation(points[: self.rows])


def about_z(angle: float) -> Floats:
    """(3, 3) the rotation by ``angle`` about the z axis."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
