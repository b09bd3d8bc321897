"""Static equilibrium of bars and hinges with one quantity driven: a saddle-point Newton iteration.

The driven quantity d(x), a fold angle or a distance, is held at s. Equilibrium is a stationary
point of L = E_hinges + f.c + mu (d - s) with c = delta f, that is F = 0 for

    F_x = grad E_hinges + J' f + mu grad d,   F_c = c - delta f,   F_d = d - s

with bar forces f; -mu is the torque (or force) that has to be applied there. One step solves, with
A' = (J' grad d), n = (f, mu) and D = diag(delta, 0),

    [ H  A' ] [ dx ]       [ F_x ]
    [ A  -D ] [ dn ]  =  - [ F_a ],    H = Hessian of L,

by eliminating dn after D is raised by a tiny eps: K dx = -F_x - A' W F_a and
dn = W (A dx + F_a), with K = H + A' W A and W = 1 / (D + eps). K is as sparse as the mesh and a
third of the saddle system in size, with no zeros on its diagonal. So one fill-reducing order of
the vertices serves every factorisation, and no pivoting is needed. F is exact, so the solution
depends neither on eps nor on the age of K, and K is factored again only when convergence slows.

Parts of a sheet that hang on one crease, or on one facet, fold independently of the driven one. A
guide moves each of them: a stiff hinge at one of its creases, whose rest angle r follows the driven
angle s by the law of rigid folding, tan(r / 2) / tan(s / 2) constant. It holds without energy what
nothing else holds.

Six coordinates of one triangle are held, in axes along it, to exclude rigid motions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from miurafab.geometry.arrays import Floats, Ints, vector_product
from miurafab.geometry.sparse import Factor, factor_symmetric, minimum_degree
from miurafab.origami.energy.bar_hinge import BarHingeModel
from miurafab.origami.energy.hinges import hinge_angles, hinge_derivatives, hinge_gradients

TOLERANCE = 1e-11
"""Limit of every component of F (forces over the stiffest hinge, if that is over 1). Convergence is
judged by F and not by the length of a step."""
GUIDE = 100.0
"""The stiffness of a guide. A facet on one crease leaves it at rest to 1e-13; two halves of a hypar
that share one facet turn it by 1e-6, the torque of a half over this stiffness."""
EPS = 1e-10
"""The compliance of inextensible bars in K. Larger values slow the iteration down under large bar
forces, smaller values by rounding."""
SLOW = 0.2
"""K is factored again after an iteration that leaves more than this part of the residual."""
MAX_ITERATIONS = 25
SHORTEST_STEP = 1.0 / 64
ENOUGH = 0.1
"""A step must lower the residual by this part of the reduction in a linear problem."""


class EquilibriumState(NamedTuple):
    """``points`` (V, 3) in the axes of :attr:`Driven.axes`, the bar ``forces`` (B,) and the
    multiplier ``mu`` of the driven quantity.
    """

    points: Floats
    forces: Floats
    mu: float

    def plus(self, step: EquilibriumState, factor: float) -> EquilibriumState:
        """This state plus ``factor`` times ``step``."""
        return EquilibriumState(
            self.points + factor * step.points,
            self.forces + factor * step.forces,
            self.mu + factor * step.mu,
        )


class Residual(NamedTuple):
    """F: ``force`` (free coordinates,), ``strain`` (B,) and the ``miss`` of the driven quantity."""

    force: Floats
    strain: Floats
    miss: float


class Factored(NamedTuple):
    """K factored, with the ``bars`` gradients n (B, 3), their weights W (B,) and grad d."""

    k: Factor
    bars: Floats
    weights: Floats
    drive: Floats


class Solution(NamedTuple):
    """The last state of an iteration, its last factor (to start the next iteration with), and
    whether F is within the tolerance.
    """

    state: EquilibriumState
    factored: Factored | None
    converged: bool


@dataclass(frozen=True, eq=False)
class Driven:
    """A model with one driven quantity: the fold angle of the hinge ``stencil`` (4,), or the
    distance between the two vertices of ``stencil`` (2,).

    ``guided`` (m, 4) are hinges that go with the driven fold angle.
    """

    model: BarHingeModel
    stencil: Ints
    guided: Ints = field(default_factory=lambda: np.empty((0, 4), dtype=np.int64))

    @property
    def rest(self) -> EquilibriumState:
        """The folded form without forces."""
        return EquilibriumState(self.model.points @ self.axes, np.zeros(len(self.model.bars)), 0.0)

    @cached_property
    def axes(self) -> Floats:
        """(3, 3) orthonormal columns: along the first side of the held triangle, and in its plane.

        The points of a state are ``points @ axes``.
        """
        p = self.model.points[self._held]
        x = (p[1] - p[0]) / np.linalg.norm(p[1] - p[0])
        z = vector_product(x, p[2] - p[0])
        z /= np.linalg.norm(z)
        return np.stack([x, vector_product(z, x), z], axis=1)

    def value(self, points: Floats) -> float:
        """The driven quantity at ``points`` (V, 3)."""
        if len(self.stencil) == 4:
            return float(hinge_angles(points, self.stencil[None])[0])
        return float(np.linalg.norm(points[self.stencil[1]] - points[self.stencil[0]]))

    def load(self, state: EquilibriumState, target: float) -> float:
        """dE / d target: what drives the driven quantity, and the guides with it."""
        turned = hinge_angles(state.points, self.guided) - self._guides(target)
        step = 1e-6
        rate = (self._guides(target + step) - self._guides(target - step)) / (2 * step)
        return -state.mu - GUIDE * float(turned @ rate)

    def _guides(self, target: float) -> Floats:
        """(m,) the rest angles of the guided hinges, with the driven angle at ``target``."""
        if not len(self.guided):
            return np.empty(0)
        return np.asarray(2 * np.arctan(self._ratios * math.tan(target / 2)))

    @cached_property
    def _ratios(self) -> Floats:
        """(m,) tan(r / 2) / tan(s / 2) in the folded form."""
        half = np.tan(hinge_angles(self.model.points, self.guided) / 2)
        return np.asarray(half / math.tan(self.value(self.model.points) / 2))

    @cached_property
    def _hinges(self) -> Ints:
        return np.concatenate([self.model.hinges, self.guided])

    @cached_property
    def _stiffness(self) -> Floats:
        return np.concatenate([self.model.stiffness, np.full(len(self.guided), GUIDE)])

    def residual(self, state: EquilibriumState, target: float) -> Residual:
        """F at ``state``, with ``target`` for the driven quantity."""
        model, points = self.model, state.points
        angle, gradient = hinge_gradients(points, self._hinges)
        rest = np.concatenate([model.rest, self._guides(target)])
        bend = (self._stiffness * (angle - rest))[:, None, None] * gradient
        d = points[model.bars[:, 1]] - points[model.bars[:, 0]]
        pull = (state.forces / model.lengths)[:, None] * d
        value, drive = self._drive_gradient(points)
        force = self._gather(bend, pull, state.mu * drive)
        strain = model.strains(points) - model.compliance * state.forces
        return Residual(force, strain, value - target)

    def size(self, residual: Residual) -> float:
        """The largest component of F; NaN where a triangle has degenerated."""
        force = np.abs(residual.force).max(initial=0.0) / self._stiffest
        strain = np.abs(residual.strain).max(initial=0.0)
        return float(np.max([force, strain, abs(residual.miss)]))

    def factor(self, state: EquilibriumState) -> Factored:
        """K at ``state``. Raises ``RuntimeError`` where it is singular."""
        model, points = self.model, state.points
        angle, gradient, hessian = hinge_derivatives(points, self._hinges)
        k = self._stiffness[:, None, None, None, None]
        bend = k * (gradient[:, :, :, None, None] * gradient[:, None, None, :, :])
        count = len(model.hinges)  # guides are near their rest
        turned = model.stiffness * (angle[:count] - model.rest)
        bend[:count] += turned[:, None, None, None, None] * hessian[:count]
        bars = (points[model.bars[:, 1]] - points[model.bars[:, 0]]) / model.lengths[:, None]
        weights = 1.0 / (model.compliance + EPS)
        block = weights[:, None, None] * bars[:, :, None] * bars[:, None, :]
        block += (state.forces / model.lengths)[:, None, None] * np.eye(3)
        stretch = np.stack([block, -block, -block, block], axis=1)
        drive, turning = self._drive_hessian(points)
        held = state.mu * turning + drive[:, :, None, None] * drive / EPS
        values = (bend.swapaxes(2, 3), stretch, held.swapaxes(1, 2))
        rows, starts, place = self._sparsity
        data = np.bincount(place, np.concatenate([v.ravel() for v in values]), len(rows) + 1)[1:]
        size = len(starts) - 1
        matrix = sparse.csc_array((data, rows, starts), shape=(size, size))
        return Factored(factor_symmetric(matrix, reorder=False), bars, weights, drive)

    def step(self, factored: Factored, residual: Residual) -> EquilibriumState:
        """The Newton step (dx, dn) for ``residual`` with K as ``factored``."""
        bars, weights, drive = factored.bars, factored.weights, factored.drive
        pull = (weights * residual.strain)[:, None] * bars
        no_bend = np.zeros((len(self._hinges), 4, 3))
        right = residual.force + self._gather(no_bend, pull, residual.miss / EPS * drive)
        coordinates = np.zeros(self.model.points.size)
        coordinates[self._free] = -factored.k.solve(right)
        dx = coordinates.reshape(-1, 3)
        first, second = self.model.bars.T
        stretch = np.einsum("bk,bk->b", bars, dx[second] - dx[first])
        return EquilibriumState(
            dx,
            weights * (stretch + residual.strain),
            (float((drive * dx[self.stencil]).sum()) + residual.miss) / EPS,
        )

    def _drive_gradient(self, points: Floats) -> tuple[float, Floats]:
        if len(self.stencil) == 4:
            angle, gradient = hinge_gradients(points, self.stencil[None])
            return float(angle[0]), gradient[0]
        apart = points[self.stencil[1]] - points[self.stencil[0]]
        distance = float(np.linalg.norm(apart))
        return distance, np.stack([-apart, apart]) / distance

    def _drive_hessian(self, points: Floats) -> tuple[Floats, Floats]:
        """The driven quantity's gradient (k, 3) and Hessian (k, 3, k, 3)."""
        if len(self.stencil) == 4:
            _, gradients, hessians = hinge_derivatives(points, self.stencil[None])
            return gradients[0], hessians[0]
        distance, gradient = self._drive_gradient(points)
        across = (np.eye(3) - np.outer(gradient[1], gradient[1])) / distance
        signs = np.array([[1.0, -1.0], [-1.0, 1.0]])
        return gradient, signs[:, None, :, None] * across[None, :, None, :]

    def _gather(self, bend: Floats, pull: Floats, drive: Floats) -> Floats:
        """The free coordinates of the sums at the vertices of hinge, bar and drive vectors."""
        vectors = np.concatenate([bend.reshape(-1, 3), -pull, pull, drive])
        count = len(self.model.points)
        total = np.empty((count, 3))
        for axis in range(3):
            total[:, axis] = np.bincount(self._ends, vectors[:, axis], count)
        return total.ravel()[self._free]

    @cached_property
    def _stiffest(self) -> float:
        return float(self._stiffness.max(initial=1.0))

    @cached_property
    def _ends(self) -> Ints:
        hinges, bars = self._hinges, self.model.bars
        return np.concatenate([hinges.ravel(), bars[:, 0], bars[:, 1], self.stencil])

    @cached_property
    def _held(self) -> Ints:
        """The corners (3,) of the held triangle, which is nearest to the middle."""
        model = self.model
        # Triangles do not bend; then creases have the corners.
        corners = (model.hinges if len(model.hinges) else model.creases)[:, :3]
        centres = model.points[corners].mean(axis=1)
        away = np.linalg.norm(centres - model.points.mean(axis=0), axis=1)
        return np.asarray(corners[np.argmin(away)])

    @cached_property
    def _free(self) -> Ints:
        """The free coordinates (3 vertex + axis) in the order of elimination."""
        first, second, third = self._held * 3
        held = [first, first + 1, first + 2, second + 1, second + 2, third + 2]
        coordinates = (self._elimination[:, None] * 3 + np.arange(3)).ravel()
        return coordinates[~np.isin(coordinates, held)]

    @cached_property
    def _pairs(self) -> tuple[Ints, Ints]:
        """The vertex pairs of all 3x3 blocks of K, in the order of computation."""
        rows, columns = [], []
        for stencils in (self._hinges, self.model.bars, self.stencil[None]):
            size = stencils.shape[1]
            rows.append(np.repeat(stencils, size, axis=1).ravel())
            columns.append(np.tile(stencils, size).ravel())
        return np.concatenate(rows), np.concatenate(columns)

    @cached_property
    def _elimination(self) -> Ints:
        """(V,) vertices in a fill-reducing order, by minimum degree on the vertex graph."""
        count = len(self.model.points)
        rows, columns = self._pairs
        ones = np.ones(len(rows))
        graph = sparse.coo_array((ones, (rows, columns)), shape=(count, count)).tocsc()
        graph.data[:] = -1.0
        graph.setdiag(np.diff(graph.indptr) + 1.0)  # diagonally dominant: factored as it stands
        return minimum_degree(graph)

    @cached_property
    def _sparsity(self) -> tuple[NDArray[np.int32], NDArray[np.int32], Ints]:
        """Rows and column starts of K (CSC), and the place of each computed value in its data: 1 +
        the index, or 0 for a held coordinate.
        """
        free = self._free
        new = np.full(self.model.points.size, -1, dtype=np.int64)
        new[free] = np.arange(len(free))
        of_vertex = new.reshape(-1, 3)
        row, column = (of_vertex[ends] for ends in self._pairs)
        rows, columns = np.broadcast_arrays(row[:, :, None], column[:, None, :])
        real = (rows >= 0) & (columns >= 0)
        key = np.where(real, columns * len(free) + rows, -1).ravel()
        keys, place = np.unique(key, return_inverse=True)
        columns, rows = np.divmod(keys[keys >= 0], len(free))
        starts = np.searchsorted(columns, np.arange(len(free) + 1))
        offset = 1 - int((keys < 0).sum())
        return rows.astype(np.int32), starts.astype(np.int32), place + offset


def solve(
    driven: Driven, guess: EquilibriumState, target: float, factored: Factored | None = None
) -> Solution:
    """The equilibrium near ``guess`` with the driven quantity at ``target``.

    ``factored`` is an earlier K to start with. A step that does not lower the largest component of
    F is repeated with a new K, then shortened. Failure is a result, not an exception.
    """
    state, fresh = guess, False
    residual = driven.residual(state, target)
    size = driven.size(residual)
    for _ in range(MAX_ITERATIONS):
        if size <= TOLERANCE:
            return Solution(_polished(driven, state, target, factored), factored, True)
        if not np.isfinite(size):
            break
        if factored is None:
            try:
                factored, fresh = driven.factor(state), True
            except RuntimeError:  # exactly singular
                break
        step = driven.step(factored, residual)
        length = 1.0
        while True:
            trial = state.plus(step, length)
            left = driven.residual(trial, target)
            better = driven.size(left) < (1 - ENOUGH * length) * size
            if better or not fresh or length <= SHORTEST_STEP:
                break
            length /= 2
        if better:
            stale = driven.size(left) > SLOW * size
            state, residual, size = trial, left, driven.size(left)
        elif fresh:
            break
        else:
            stale = True
        if stale:
            factored = None
        fresh = False
    return Solution(state, None, False)


def _polished(
    driven: Driven, state: EquilibriumState, target: float, factored: Factored | None
) -> EquilibriumState:
    """``state`` after one more step with the last K, if that lowers the residual."""
    if factored is None:
        return state
    residual = driven.residual(state, target)
    better = state.plus(driven.step(factored, residual), 1.0)
    is_better = driven.size(driven.residual(better, target)) < driven.size(residual)
    return better if is_better else state
