"""Polishing: the exact sheet near a solution that follows the target most closely.

The points m_k of the sheet that follow the target are the means of the facets (the middle of the
sheet), or the vertices of the upper or of the lower rows. With f_k the point of the target nearest
to m_k, n_k the normal there, and u = x - x0 the displacement from the first solution, each round
minimises

    1/2 sum_k (n_k . (m_k - f_k))^2  +  w/2 sum_edges |u_a - u_b|^2

linearised (Gauss-Newton), over the steps that keep the constraints and held bounds to first order.
This is a quadratic problem in the null space of J. Projected conjugate gradients solve it; the
projection I - J^T (J J^T)^-1 J uses the solver's own factor (Gould, Hribar and Nocedal, SIAM J.
Sci. Comput. 23 (2001), algorithm 6.2), and no KKT matrix is formed. The solver then projects the
sheet onto the constraints exactly. A round without gain is undone and repeated with a shorter step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import sparse

from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.quads import QuadGrid
from miurafab.origami.fitting.reduction import Unknowns
from miurafab.origami.fitting.solver import (
    Constraints,
    GramFactor,
    Projection,
    elimination_order,
    project,
)
from miurafab.surfaces.surface import TargetSurface

Follow = Literal["middle", "top", "bottom"]

FAIRNESS = 1e-4
"""w: large enough to keep neighbours together, small enough to let the sheet move."""
ROUNDS = 6
INNER = 60
"""Conjugate gradient iterations in one round."""
CAP = 0.25
"""The largest move of a coordinate in one round, in mean edge lengths."""
CLOSE = 0.003
"""A sheet this close to the target, in mean edge lengths, is close enough: paper is thicker."""
ENOUGH = 0.98
"""A round that lowers the objective by less than 1 - ENOUGH of it is the last."""


def followers(grid: QuadGrid, follow: Follow, first_row: int = 0) -> sparse.csr_array:
    """(K, V) the weights that make the points which follow the target from the vertices.

    Rows of the sheet with odd index are upper rows; the grid starts at row ``first_row``.
    """
    if follow == "middle":
        faces = grid.faces_vertices
        starts = np.arange(0, faces.size + 1, 4)
        weights = np.full(faces.size, 0.25)
        return sparse.csr_array((weights, faces.ravel(), starts), (len(faces), grid.vertices.size))
    upper = (np.arange(grid.rows) + first_row) % 2 == 1
    chosen = grid.vertices[upper if follow == "top" else ~upper].ravel()
    return sparse.csr_array(sparse.eye_array(grid.vertices.size, format="csr")[chosen])


@dataclass(frozen=True, eq=False)
class Polish:
    """The polished sheet as the solver left it, and the objective before and after."""

    projection: Projection
    rounds: int
    before: float
    after: float


def polish(
    start: Projection,
    surface: TargetSurface,
    unknowns: Unknowns,
    constraints: Constraints,
    *,
    follow: Follow = "middle",
    bounds: Constraints | None = None,
) -> Polish:
    """Bring the exact sheet ``start`` closer to ``surface``, within ``constraints`` and ``bounds``.

    Both are functions of ``unknowns``. A sheet that cannot come closer is returned unchanged.
    """
    places, length = unknowns.places, unknowns.length
    problem = _Objective.of(start.x, surface, unknowns, follow)
    now = start
    value, _ = problem.value(start.x)
    before = value
    cap = CAP
    rounds = 0
    while rounds < ROUNDS and cap > CAP / 30:
        rounds += 1
        step = problem.step(now, constraints, places, bounds)
        if step is None:
            break
        longest = float(np.abs(step).max())
        trial = now.x + step * min(1.0, cap * length / longest) if longest > 0 else now.x
        back = project(
            constraints,
            trial,
            places,
            inequalities=bounds,
            cap=CAP * length,
            max_iterations=25,
        )
        reached, farthest = problem.value(back.x) if back.converged else (np.inf, np.inf)
        if reached >= value:
            cap = min(cap, longest / length) / 3
            continue
        done = reached > ENOUGH * value or farthest < CLOSE * length
        now, value = back, reached
        if done:
            break
    return Polish(now, rounds, before, value)


@dataclass(frozen=True, eq=False)
class _Objective:
    """``points`` (3K, n) makes the points that follow the target from the unknowns, and
    ``differences`` (3E, n) the edges.
    """

    surface: TargetSurface
    points: sparse.csr_array
    differences: sparse.csr_array
    origin: Floats

    @classmethod
    def of(
        cls, x: Floats, surface: TargetSurface, unknowns: Unknowns, follow: Follow
    ) -> _Objective:
        grid = unknowns.grid
        edges = grid.edges_vertices
        ends = sparse.csr_array(
            (np.tile([1.0, -1.0], len(edges)), edges.ravel(), np.arange(0, edges.size + 1, 2)),
            shape=(len(edges), grid.vertices.size),
        )

        def of_unknowns(weights: sparse.csr_array) -> sparse.csr_array:
            coordinates = sparse.kron(weights, np.eye(3), format="csr")
            return sparse.csr_array(coordinates @ unknowns.substitution)

        points = followers(grid, follow, unknowns.first_row)
        return cls(surface, of_unknowns(points), of_unknowns(ends), x.copy())

    def value(self, x: Floats) -> tuple[float, float]:
        """The objective, and the greatest distance."""
        gap, _ = self._gaps(x)
        fair = self.differences @ (x - self.origin)
        return float((gap**2).sum() + FAIRNESS * (fair**2).sum()) / 2, float(gap.max())

    def _gaps(self, x: Floats) -> tuple[Floats, Floats]:
        """The distances (K,) and the directions (K, 3) in which they grow."""
        points = (self.points @ x).reshape(-1, 3)
        offset = points - self.surface.closest_point(points)
        gap = np.linalg.norm(offset, axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            direction = offset / gap[:, None]
        # a point on the surface has no such direction and needs none
        return gap, np.where(gap[:, None] > 0, direction, 0.0)

    def step(
        self,
        now: Projection,
        constraints: Constraints,
        places: Ints,
        bounds: Constraints | None,
    ) -> Floats | None:
        """The minimiser in the null space of the constraints and held bounds, (3V,)."""
        x = now.x
        gap, direction = self._gaps(x)
        along = sparse.csr_array(
            (direction.ravel(), np.arange(direction.size), np.arange(0, direction.size + 1, 3)),
            shape=(len(gap), direction.size),
        )
        distances = along @ self.points
        distances_t, differences_t = distances.T.tocsr(), self.differences.T.tocsr()

        moved = differences_t @ (self.differences @ (x - self.origin))
        slope = np.asarray(distances_t @ gap + FAIRNESS * moved)

        equalities = constraints(x)[1]
        jacobian, held = equalities, np.zeros(0, dtype=np.int64)
        if bounds is not None:
            held, gradient = np.flatnonzero(now.active), bounds(x)[1]
            jacobian = sparse.vstack([equalities, gradient[held]], format="csr")
        factor = GramFactor.of(jacobian, elimination_order(jacobian, places))
        if factor is not None and len(held):
            # release the bounds that the objective moves away from
            pressing = factor.solve(jacobian @ slope)[equalities.shape[0] :] > 0
            if not pressing.all():
                jacobian = sparse.vstack([equalities, gradient[held[pressing]]], format="csr")
                factor = GramFactor.of(jacobian, elimination_order(jacobian, places))
        if factor is None:
            return None
        solve, transposed = factor.solve, jacobian.T.tocsr()

        def times(d: Floats) -> Floats:
            fair = differences_t @ (self.differences @ d)
            return np.asarray(distances_t @ (distances @ d) + FAIRNESS * fair)

        def onto_null_space(r: Floats) -> Floats:
            return np.asarray(r - transposed @ solve(jacobian @ r))

        return _conjugate_gradients(times, onto_null_space, -slope)


def _conjugate_gradients(
    times: Callable[[Floats], Floats], onto_null_space: Callable[[Floats], Floats], right: Floats
) -> Floats:
    """The solution d of H d = ``right`` in the null space, to a thousandth."""
    solution = np.zeros_like(right)
    residual = onto_null_space(onto_null_space(right))
    direction = residual.copy()
    size = first = float(residual @ residual)
    for _ in range(INNER):
        if size <= 1e-6 * first:
            break
        image = times(direction)
        curvature = float(direction @ image)
        if curvature <= 0:
            break
        length = size / curvature
        solution += length * direction
        residual = onto_null_space(residual - length * image)
        following = float(residual @ residual)
        direction = residual + following / size * direction
        size = following
    return solution
