"""Static equilibrium of bars and hinges: a saddle-point Newton iteration.

A quantity d(x) may be driven, a fold angle or a distance: it is held at s. Equilibrium is a
stationary point of L = E_hinges + f.c + mu (d - s) with c = delta f, that is F = 0 for

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
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import sparse

from miurafab.geometry.arrays import Floats, Ints, vector_product
from miurafab.geometry.sparse import Factor, SymmetricSolver, factor_symmetric
from miurafab.origami.energy.assembly import NO_TOUCH, Assembly, Touch
from miurafab.origami.energy.bar_hinge import BarHingeModel
from miurafab.origami.energy.hinges import hinge_derivatives, hinge_gradients

TOLERANCE = 1e-11
"""Limit of every component of F (forces over the stiffest hinge, if that is over 1). Convergence is
judged by F and not by the length of a step."""
EPS = 1e-10
"""The compliance of inextensible bars in K. Larger values slow the iteration down under large bar
forces, smaller values by rounding."""
PATIENCE = 6.0
"""K is factored again where, at the rate of the last iteration, more than these would follow. A
factorisation costs as much as seven."""
MAX_ITERATIONS = 25
SHORTEST_STEP = 1.0 / 64
ROUNDING = 1e-13
"""A residual up to this is rounding, and is not lowered further."""
ROUNDINGS = 8
"""So many roundings of a coordinate add up in one component of F."""
COARSEST = 1e-8
"""No component of F that is larger passes for rounding, however thin a facet is."""
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


class Drive(NamedTuple):
    """The driven quantity: its ``value``, ``gradient`` (k, 3) and ``hessian`` (k, k, 3, 3) by the
    k vertices of its stencil.
    """

    value: float
    gradient: Floats
    hessian: Floats


@dataclass(frozen=True, eq=False)
class Balance:
    """The forces of a model and what drives it; this class drives nothing.

    A subclass says what follows the ``target`` of a state: a driven quantity, or rest angles.
    """

    model: BarHingeModel

    @property
    def rest(self) -> EquilibriumState:
        """The form of the model without forces."""
        return EquilibriumState(self.model.points @ self.axes, np.zeros(len(self.model.bars)), 0.0)

    @cached_property
    def axes(self) -> Floats:
        """(3, 3) the axes of the own points of the model; a state has ``points @ axes``."""
        return self.axes_at(self.model.points)

    def axes_at(self, points: Floats) -> Floats:
        """(3, 3) orthonormal columns: along the first side of the held triangle at ``points``
        (V, 3), and in its plane.
        """
        p = points[self._held]
        x = (p[1] - p[0]) / np.linalg.norm(p[1] - p[0])
        z = vector_product(x, p[2] - p[0])
        z /= np.linalg.norm(z)
        return np.stack([x, vector_product(z, x), z], axis=1)

    @property
    def hinges(self) -> Ints:
        """(H, 4) the hinges that resist turning."""
        return self.model.hinges

    @property
    def drive_stencil(self) -> Ints:
        """(k,) the vertices of the driven quantity; none here."""
        return np.empty(0, dtype=np.int64)

    def moments(self, angle: Floats, target: float) -> tuple[Floats, Floats]:
        """(H,) the moment of each hinge at its ``angle`` (H,), and its slope by the angle."""
        return self.model.stiffness * (angle - self.model.rest), self.model.stiffness

    def drive(self, points: Floats, target: float) -> Drive:
        """The driven quantity at ``points`` (V, 3); with nothing driven it is always on target."""
        return Drive(target, np.zeros((0, 3)), np.zeros((0, 0, 3, 3)))

    def arrive(self, state: EquilibriumState) -> None:
        """Take note that the path has come to ``state``. Elastic hinges have no memory."""

    def touch(self, points: Floats, *, stiff: bool = True) -> Touch:
        """The springs between facets that touch at ``points``; none here."""
        return NO_TOUCH

    def free_part(self, points: Floats, step: Floats) -> float:
        """The part of a ``step`` (V, 3) from ``points`` (V, 3) that nothing blocks; all, here."""
        return 1.0

    def residual(self, state: EquilibriumState, target: float) -> Residual:
        """F at ``state``, with what is driven at ``target``."""
        model, points = self.model, state.points
        angle, gradient = hinge_gradients(points, self.hinges)
        bend = self.moments(angle, target)[0][:, None, None] * gradient
        along = model.bar_vectors(points)
        pull = (state.forces / model.lengths)[:, None] * along
        drive = self.drive(points, target)
        force = self._gather(bend, pull, state.mu * drive.gradient)
        force += self.assembly.scattered(self.touch(points, stiff=False))
        strain = model.strains_of(along) - model.compliance * state.forces
        return Residual(force, strain, drive.value - target)

    def size(self, residual: Residual) -> float:
        """The largest component of F; NaN where a triangle has degenerated."""
        force = np.abs(residual.force).max(initial=0.0) / self.stiffest
        strain = np.abs(residual.strain).max(initial=0.0)
        return float(np.max([force, strain, abs(residual.miss)]))

    def factor(self, state: EquilibriumState, target: float, *, definite: bool = False) -> Factored:
        """K at ``state``. Raises ``RuntimeError`` where it is singular, and with ``definite`` where
        it is not positive definite.
        """
        weights = 1.0 / (self.model.compliance + EPS)
        bars = self.model.bar_vectors(state.points) / self.model.lengths[:, None]
        drive = self.drive(state.points, target)
        matrix = self.stiffness(state, target)
        k = self._solver.factor(matrix) if definite else self.factored(matrix)
        return Factored(k, bars, weights, drive.gradient)

    def stiffness(self, state: EquilibriumState, target: float) -> sparse.csc_array:
        """K at ``state``, between the free coordinates."""
        model, points = self.model, state.points
        angle, gradient, hessian = hinge_derivatives(points, self.hinges)
        moment, slope = self.moments(angle, target)
        turn = gradient.reshape(-1, 12)
        bend = (slope[:, None] * turn)[:, :, None] * turn[:, None]
        bend += moment[:, None, None] * hessian.reshape(-1, 12, 12)
        blocks = bend.reshape(-1, 4, 3, 4, 3).swapaxes(2, 3)
        bars = model.bar_vectors(points) / model.lengths[:, None]
        weights = 1.0 / (model.compliance + EPS)
        block = weights[:, None, None] * bars[:, :, None] * bars[:, None, :]
        block += (state.forces / model.lengths)[:, None, None] * np.eye(3)
        drive = self.drive(points, target)
        across = drive.gradient[:, None, :, None] * drive.gradient[None, :, None, :]
        held = state.mu * drive.hessian + across / EPS
        groups = [blocks, stretch_blocks(block), held[None]]
        return self.assembly.matrix(groups, self.touch(points))

    def factored(self, matrix: sparse.csc_array) -> Factor:
        """The factor of a ``matrix`` of :attr:`assembly`: by Cholesky, five times as fast, where
        it is definite.
        """
        try:
            return self._solver.factor(matrix)
        except RuntimeError:  # an unstable state
            return factor_symmetric(matrix, reorder=False)

    def step(self, factored: Factored, residual: Residual) -> EquilibriumState:
        """The Newton step (dx, dn) for ``residual`` with K as ``factored``."""
        bars, weights, drive = factored.bars, factored.weights, factored.drive
        pull = (weights * residual.strain)[:, None] * bars
        right = residual.force + self._gather(None, pull, residual.miss / EPS * drive)
        dx = self.assembly.vectors(-factored.k.solve(right))
        first, second = self.model.bars.T
        stretch = np.einsum("bk,bk->b", bars, dx[second] - dx[first])
        return EquilibriumState(
            dx,
            weights * (stretch + residual.strain),
            (float((drive * dx[self.drive_stencil]).sum()) + residual.miss) / EPS,
        )

    @cached_property
    def stiffest(self) -> float:
        """The stiffness of the stiffest hinge, at least 1."""
        return float(self.moments(np.zeros(len(self.hinges)), 0.0)[1].max(initial=1.0))

    @cached_property
    def tolerance(self) -> float:
        """What may be left of each component of F: ``TOLERANCE``, or what rounding leaves, up to
        ``COARSEST``.

        At a distance D from the origin a coordinate is rounded by eps D, with eps = 2.2e-16. That
        turns a hinge over a wing of height h by eps D / h, and so changes its forces by
        k eps D / h^2. A bar of length L pulls by eps D / (delta L) more.
        """
        model = self.model
        stiffness = self.moments(np.zeros(len(self.hinges)), 0.0)[1]
        start, end, *wings = (model.points[ends] for ends in self.hinges.T)
        along = end - start
        length = np.linalg.norm(along, axis=1)
        across = [np.linalg.norm(vector_product(along, wing - start), axis=1) for wing in wings]
        height = np.minimum(*across) / length
        soft = model.compliance > 0
        most = max(
            float((stiffness / height**2).max(initial=0.0)),
            float((1.0 / (model.compliance * model.lengths)[soft]).max(initial=0.0)),
        )
        reach = float(np.abs(model.points).max())
        rounding = ROUNDINGS * 2.2e-16 * reach * most / self.stiffest
        return max(TOLERANCE, min(rounding, COARSEST))

    @cached_property
    def assembly(self) -> Assembly:
        """The sums over hinges, bars and the driven quantity."""
        stencils = (self.hinges, self.model.bars, self.drive_stencil[None])
        return Assembly(len(self.model.points), stencils, self._held)

    def _gather(self, bend: Floats | None, pull: Floats, drive: Floats) -> Floats:
        """The free coordinates of the sums at vertices of hinge, bar and drive vectors."""
        return self.assembly.gather([bend, np.stack([-pull, pull], axis=1), drive])

    @cached_property
    def _solver(self) -> SymmetricSolver:
        return SymmetricSolver()

    @cached_property
    def _held(self) -> Ints:
        """The corners (3,) of the held triangle, which is nearest to the middle."""
        model = self.model
        # Triangles do not bend; then creases have the corners.
        corners = (model.hinges if len(model.hinges) else model.creases)[:, :3]
        centres = model.points[corners].mean(axis=1)
        away = np.linalg.norm(centres - model.points.mean(axis=0), axis=1)
        return np.asarray(corners[np.argmin(away)])


def stretch_blocks(block: Floats) -> Floats:
    """(n, 2, 2, 3, 3) the stiffness between both ends of bars, from ``block`` (n, 3, 3)."""
    return np.stack([block, -block, -block, block], axis=1).reshape(-1, 2, 2, 3, 3)


def _iterations_left(before: float, now: float) -> float:
    """How many iterations follow if each lowers the residual as the last one did."""
    return 0.0 if now <= TOLERANCE else math.log(TOLERANCE / now) / math.log(now / before)


def solve(
    driven: Balance,
    guess: EquilibriumState,
    target: float,
    factored: Factored | None = None,
    *,
    definite: bool = False,
    factors: int = MAX_ITERATIONS,
) -> Solution:
    """The equilibrium near ``guess`` with what is driven at ``target``.

    ``factored`` is an earlier K to start with. A step that does not lower the largest component of
    F is repeated with a new K, then shortened; where none lowers it any more, what is left may be
    rounding (:attr:`Balance.tolerance`). With ``definite`` the iteration ends where K is not
    definite, and in any case after so many ``factors``. Failure is a result, not an exception.
    """
    state, fresh, made = guess, False, 0
    residual = driven.residual(state, target)
    size = driven.size(residual)
    for _ in range(MAX_ITERATIONS):
        if size <= TOLERANCE:
            if factored is not None and size > ROUNDING:
                step = driven.step(factored, residual)
                nearer = state.plus(step, driven.free_part(state.points, step.points))
                if driven.size(driven.residual(nearer, target)) < size:
                    state = nearer
            return Solution(state, factored, True)
        if not np.isfinite(size):
            break
        if factored is None:
            if made == factors:
                break
            try:
                factored, fresh = driven.factor(state, target, definite=definite), True
                made += 1
            except RuntimeError:  # exactly singular, or not definite
                break
        step = driven.step(factored, residual)
        length = free = driven.free_part(state.points, step.points)
        while True:
            trial = state.plus(step, length)
            left = driven.residual(trial, target)
            rest = driven.size(left)
            better = rest < (1 - ENOUGH * length) * size
            if better or not fresh or length <= SHORTEST_STEP * free:
                break
            length /= 2
        if better:
            stale = _iterations_left(size, rest) > PATIENCE
            state, residual, size = trial, left, rest
        elif fresh:  # no step lowers it any more
            return Solution(state, factored, size <= driven.tolerance)
        else:
            stale = True
        if stale:
            factored = None
        fresh = False
    return Solution(state, None, False)
