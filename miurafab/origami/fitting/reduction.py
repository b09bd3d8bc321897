"""The unknowns of a fit: all vertices of a sheet, or those of the part that it repeats.

Conditions are stated on charts of vertices. For a whole sheet these are the sheet's own, and the
unknowns are their vertices. A sheet on a surface of revolution repeats itself, and only the part
that repeats is unknown:

ring    X_{j+2} = R_z(2 beta) X_j. The unknowns are the rows 0 and 1; the charts have the five rows
        R^-1 X_1, X_0, X_1, R X_0, R X_1, so that each row has neighbours on both sides.
gore    each gore is the one before, turned by beta. The unknowns are the columns 0 to C - 1 of one
        gore; the charts are that gore, whose last column is R X_0.

The vertices of the charts are T times the unknowns, with a constant matrix T, and the Jacobian by
the unknowns is that of the charts times T. The number of unknowns does not depend on the number of
repetitions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.quads import QuadCharts
from miurafab.origami.fitting.constraints import OrigamiConstraints
from miurafab.origami.fitting.solver import Constraints


@dataclass(frozen=True, eq=False)
class Unknowns:
    """The unknowns x (n,) of a sheet; ``charts`` is where the conditions are stated.

    ``length`` is the mean edge length. ``whole`` makes the charts and the vertices (V, 3) of the
    whole sheet of the unknowns. ``substitution`` (3V, n) is T, and None where the unknowns are the
    coordinates of the vertices. ``stated`` (F,) and ``interior`` (I,) choose the facets and the
    interior vertices whose conditions are stated, where others repeat them.
    """

    charts: QuadCharts
    length: float
    whole: Callable[[Floats], tuple[QuadCharts, Floats]]
    substitution: sparse.csr_array | None = None
    stated: Bools | None = None
    interior: Bools | None = None

    @classmethod
    def all_of(cls, charts: QuadCharts, length: float) -> Unknowns:
        """The coordinates of all vertices of ``charts``."""
        return cls(charts, length, lambda x: (charts, x.reshape(-1, 3)))

    @classmethod
    def ring(cls, piece_of_column: Ints, rows: int, length: float, turn: float) -> Unknowns:
        """Two rows of a sheet of ``rows`` rows of cells, which repeats by ``turn`` radians about z.

        ``piece_of_column`` (columns,) parts the sheet into bands along columns of vertices.
        """
        columns = len(piece_of_column)
        charts = QuadCharts.of_cells(np.ones((4, columns), dtype=bool), piece_of_column)
        # the window starts a row before the first row of the sheet
        charts = QuadCharts(
            charts.faces_vertices,
            charts.cells - np.array([0, 1]),
            charts.pieces,
            charts.vertices_count,
        )
        wide = columns + 1
        one = sparse.eye_array(wide)
        back, here, on = (sparse.kron(one, about_z(k * turn)) for k in (-1, 0, 1))
        blocks = [[None, back], [here, None], [None, here], [on, None], [None, on]]
        inner = charts.lattice[charts.interior_vertices, 1]
        sheet = QuadCharts.of_cells(np.ones((rows, columns), dtype=bool), piece_of_column)

        def whole(x: Floats) -> tuple[QuadCharts, Floats]:
            period = x.reshape(2, wide, 3)
            turned = np.array([about_z(k * turn) for k in range((rows + 2) // 2)])
            points = np.einsum("kab,rcb->krca", turned, period).reshape(-1, wide, 3)
            return sheet, points[: rows + 1].reshape(-1, 3)

        return cls(
            charts,
            length,
            whole,
            sparse.csr_array(sparse.block_array(blocks, format="csr")),
            stated=np.isin(charts.cells[:, 1], (0, 1)),
            interior=np.isin(inner, (0, 1)),
        )

    @classmethod
    def gore(cls, columns: int, rows: int, gores: int, length: float, turn: float) -> Unknowns:
        """One of ``gores`` charts of ``columns`` x ``rows`` cells, each the one before turned by
        ``turn`` radians about z. They close where ``gores * turn`` is a full turn.
        """
        charts = QuadCharts.of_cells(np.ones((rows, columns), dtype=bool))
        vertices = charts.vertices_count
        column, row = charts.lattice.T
        unknown = row * columns + column % columns
        rotation = np.where((column == columns)[:, None, None], about_z(turn), np.eye(3))
        count = 3 * columns * (rows + 1)
        entries = (unknown[:, None, None] * 3 + np.arange(3)) + np.zeros((1, 3, 1), dtype=np.int64)
        substitution = sparse.csr_array(
            (rotation.ravel(), entries.ravel(), np.arange(0, 9 * vertices + 1, 3)),
            shape=(3 * vertices, count),
        )
        substitution.eliminate_zeros()
        closed = bool(abs(gores * turn - 2 * np.pi) < 1e-9)
        pieces = np.repeat(np.arange(gores), columns)
        kept = np.ones((rows, gores * columns), dtype=bool)
        body = QuadCharts.of_cells(kept, pieces, closed)
        around, up = body.lattice.T

        def whole(x: Floats) -> tuple[QuadCharts, Floats]:
            grid = x.reshape(rows + 1, columns, 3)
            turned = np.array([about_z(k * turn) for k in range(gores + 1)])
            points = grid[up, around % columns]
            return body, np.einsum("vab,vb->va", turned[around // columns], points)

        return cls(charts, length, whole, substitution)

    def vertices(self, x: Floats) -> Floats:
        """(V, 3) the vertices of ``charts``."""
        return (x if self.substitution is None else self.substitution @ x).reshape(-1, 3)

    def by_unknowns(self, jacobian: sparse.csr_array) -> sparse.csr_array:
        """A Jacobian by the vertices of ``charts`` as one by the unknowns."""
        if self.substitution is None:
            return jacobian
        return sparse.csr_array(jacobian @ self.substitution)

    def constraints(self, flat_foldable: bool) -> Constraints:
        """The conditions of an origami as a function of x."""
        on_charts = OrigamiConstraints(self.charts, self.length, flat_foldable)
        return self.of_unknowns(on_charts, self._chosen(flat_foldable))

    def residuals(self, flat_foldable: bool) -> Callable[[Floats], Floats]:
        """The values of :meth:`constraints` without their Jacobian."""
        on_charts = OrigamiConstraints(self.charts, self.length, flat_foldable)
        chosen = self._chosen(flat_foldable)

        def values(x: Floats) -> Floats:
            all_values = on_charts.values(self.vertices(x).ravel())
            return all_values if chosen is None else all_values[chosen]

        return values

    def _chosen(self, flat_foldable: bool) -> Ints | None:
        """The conditions that are stated; None: all."""
        if self.stated is None or self.interior is None:
            return None
        inner = [self.interior] * (2 if flat_foldable else 1)
        return np.flatnonzero(np.concatenate([self.stated, *inner]))

    def of_unknowns(self, on_charts: Constraints, chosen: Ints | None = None) -> Constraints:
        """Conditions on ``charts``, or the ``chosen`` ones of them, as a function of x."""
        if self.substitution is None and chosen is None:
            return on_charts

        def conditions(x: Floats) -> tuple[Floats, sparse.csr_array]:
            values, jacobian = on_charts(self.vertices(x).ravel())
            if chosen is not None:
                values, jacobian = values[chosen], jacobian[chosen]
            return values, self.by_unknowns(jacobian)

        return conditions


def about_z(angle: float) -> Floats:
    """(3, 3) the rotation by ``angle`` about the z axis."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
