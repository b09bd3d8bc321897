"""Surfaces of revolution: one period of the pattern solved, and turned about the axis.

Rows run along the profile and repeat themselves after two, turned by the angle of two facets:

    X_{j+2} = R_z(2 beta) X_j,   beta = angle / (rows - 1)

so the unknowns are the rows 0 and 1 alone. The constraints are those of the four rows
R^-1 X_1, X_0, X_1, R X_0, of which the facets next to X_1 and the vertices of X_0 and X_1 make up
one period; J of the strip is J of the four rows times the constant matrix of this substitution.
The work does not depend on how far the pattern goes round.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from miurafab.geometry.quads import QuadGrid
from miurafab.origami.constraints import OrigamiConstraints
from miurafab.origami.seed import Corrugation, seed
from miurafab.origami.solver import Projection, project
from miurafab.surfaces.analytic import Revolution, revolution

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

STEP_CAP = 0.25
"""The farthest that a coordinate moves in one step, in mean edge lengths."""


@dataclass(frozen=True, eq=False)
class StripConstraints:
    """The conditions on one period; x is (6 columns,): row 0, then row 1.

    ``turn`` is the angle 2 beta of a period; ``length`` the mean edge length.
    """

    columns: int
    turn: float
    length: float

    @cached_property
    def places(self) -> Ints:
        """(6 columns, 2) the column of each unknown."""
        column = np.tile(np.arange(self.columns, dtype=np.int64).repeat(3), 2)
        return np.stack([column, np.zeros_like(column)], axis=1)

    @cached_property
    def _rows(self) -> OrigamiConstraints:
        return OrigamiConstraints(QuadGrid(self.columns, 4), self.length)

    @cached_property
    def _substitution(self) -> sparse.csr_array:
        """(12 columns, 6 columns) from the two rows to the four."""
        one = sparse.eye_array(self.columns)
        blocks = [
            [None, sparse.kron(one, about_z(-self.turn))],
            [sparse.kron(one, np.eye(3)), None],
            [None, sparse.kron(one, np.eye(3))],
            [sparse.kron(one, about_z(self.turn)), None],
        ]
        return sparse.csr_array(sparse.block_array(blocks, format="csr"))

    @cached_property
    def _chosen(self) -> Ints:
        """The facets on both sides of row 1, and all interior vertices."""
        return np.arange(self.columns - 1, self._rows.count, dtype=np.int64)

    def __call__(self, x: Floats) -> tuple[Floats, sparse.csr_array]:
        """c (m,) and J (m, 6 columns) at ``x``."""
        values, jacobian = self._rows(self._substitution @ x)
        return values[self._chosen], jacobian[self._chosen] @ self._substitution


def about_z(angle: float) -> Floats:
    """(3, 3) the rotation by ``angle`` about the z axis."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def solve_strip(
    surface: Revolution, columns: int, rows: int, corrugation: Corrugation
) -> Projection:
    """The tessellation of ``columns`` x ``rows`` vertices on ``surface``, as the flat vector of its
    vertices, from one period.
    """
    beta = surface.angle / (rows - 1)
    start, _ = seed(revolution(surface.profile, beta), columns, 2, corrugation)
    constraints = StripConstraints(columns, 2 * beta, float(start.edge_lengths.mean()))
    solution = project(
        constraints,
        start.vertices.ravel(),
        constraints.places,
        cap=STEP_CAP * constraints.length,
    )
    period = solution.x.reshape(2, columns, 3)
    turned = np.array([about_z(k * 2 * beta) for k in range((rows + 1) // 2)])
    points = np.einsum("kab,rcb->krca", turned, period).reshape(-1, columns, 3)[:rows]
    centred = points @ about_z(-(surface.angle - beta) / 2).T
    return replace(solution, x=centred.ravel())
