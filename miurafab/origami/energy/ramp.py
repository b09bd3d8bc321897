"""A sheet whose creases want to fold: their rest angles go along a ramp, and nothing is driven.

At the part t of the ramp a crease rests at t rho_0, with rho_0 its fold angle in the pattern.
Angles are counted on from the last state, so that half a turn can be reached and not be passed:
beyond ``LIMIT`` a stiff spring pushes back, as the other facet would.

Flat is where very many motions meet. K is indefinite there, and Newton's iteration goes to one of
the saddles. :func:`descend` takes K + mu I where it is definite. Elsewhere it leaves out what makes
K indefinite (Gauss-Newton): the energy is a sum of squares of fold angles and of strains, and only
the tension of bars is kept beside their squares,

    K = sum k grad rho grad rho' + sum n n' / delta + max(f, 0) / L + mu I,

with mu after Levenberg and Marquardt. So it only ever lowers the energy.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import sparse

from miurafab.geometry.arrays import Floats
from miurafab.geometry.polygons import edge_lengths
from miurafab.geometry.sparse import Factor
from miurafab.origami.energy.assembly import NO_TOUCH, Touch
from miurafab.origami.energy.bar_hinge import BarHingeModel
from miurafab.origami.energy.equilibrium import Balance, EquilibriumState, stretch_blocks
from miurafab.origami.energy.hinges import hinge_angles, hinge_gradients
from miurafab.origami.energy.touch_pairs import REACH
from miurafab.origami.energy.touching import (
    NO_PAIRS,
    TouchPairs,
    free_way,
    touch,
    touch_energy,
)

LIMIT = np.pi - 0.01
"""Beyond this fold angle a facet meets its neighbour."""
LIMIT_STIFFNESS = 1.0
"""Of the spring beyond the limit, for the length of its hinge: that of a facet."""
LARGEST_TURN = 1.0
"""Radians by which one step of a descent, or of a path, may turn a hinge."""
LARGEST_MOVE = 0.3
"""Mean edges by which one step of a descent may move a vertex."""
FIRST_MU, LEAST_MU, GREATEST_MU = 1e-3, 1e-12, 1e6
SHARPER, BLUNTER = 1.0 / 3.0, 4.0
"""The factors on mu after a step that is taken, and after one that is not."""
SHORTENINGS = 5
"""How often a step is halved before mu is raised: a new mu costs a factorisation."""
THIN = 0.05
"""The extent, over the largest, of a sheet in a direction in which it is thin."""
SOFT_MU = 1e-6
"""mu where the moves of soft parts are looked for."""


@dataclass(frozen=True, eq=False)
class Ramped(Balance):
    """A model whose hinges rest at the part ``target`` of their rest angles.

    ``last`` (H,) are the fold angles of the last accepted state, from which angles are counted on.
    It is the one array that changes, by :meth:`accept`. ``pairs`` are those that touch or may.
    """

    last: Floats = field(init=False)
    pairs: TouchPairs = NO_PAIRS

    def __post_init__(self) -> None:
        object.__setattr__(self, "last", np.zeros(len(self.model.hinges)))

    def angles(self, points: Floats) -> Floats:
        """(H,) the fold angles at ``points`` (V, 3), counted on from the last state."""
        return self._counted_on(hinge_angles(points, self.hinges))

    def accept(self, points: Floats) -> None:
        """Count angles on from ``points`` (V, 3)."""
        self.last[:] = self.angles(points)

    def with_pairs(self, pairs: TouchPairs) -> Ramped:
        """The same model with ``pairs``. It shares ``last``."""
        made = copy.copy(self)  # the sums as well, even if nothing has asked for them yet
        vars(made).update(pairs=pairs, assembly=self.assembly, _solver=self._solver)
        return made

    def made_of(self, model: BarHingeModel) -> Ramped:
        """``model``, whose springs join the same vertices, with the sums of this one."""
        made = Ramped(model)
        vars(made).update(assembly=self.assembly, _solver=self._solver)
        return made

    def touch(self, points: Floats, *, stiff: bool = True, definite: bool = False) -> Touch:
        """The springs of the pairs that touch."""
        if not len(self.pairs.edges):
            return NO_TOUCH
        return touch(points, self.pairs, stiff=stiff, definite=definite)

    def state(self, points: Floats) -> EquilibriumState:
        """The state at ``points`` (V, 3) whose bars pull by their strain; all have a compliance."""
        return EquilibriumState(points, self.model.strains(points) / self.model.compliance, 0.0)

    def moments(self, angle: Floats, target: float) -> tuple[Floats, Floats]:
        """The moments and slopes of hinges, with the springs beyond the limit."""
        angle = self._counted_on(angle)
        over = angle - np.clip(angle, -LIMIT, LIMIT)
        moment = self.model.stiffness * (angle - target * self.model.rest) + self._stop * over
        return moment, self.model.stiffness + np.where(over != 0, self._stop, 0.0)

    def energy(self, points: Floats, target: float) -> float:
        """The energy of hinges, limits and bars at ``points`` (V, 3)."""
        model = self.model
        angle = self.angles(points)
        over = angle - np.clip(angle, -LIMIT, LIMIT)
        bend = model.stiffness * (angle - target * model.rest) ** 2 + self._stop * over**2
        soft = model.compliance > 0
        strain = model.strains(points)[soft]
        stretch = (strain**2 / model.compliance[soft]).sum()
        return 0.5 * float(bend.sum() + stretch) + touch_energy(points, self.pairs)

    def gauss_newton(self, points: Floats, target: float) -> tuple[Floats, sparse.csc_array]:
        """The gradient of the energy at ``points`` (V, 3), and K without mu."""
        model = self.model
        angle, turn = hinge_gradients(points, self.hinges)
        moment, slope = self.moments(angle, target)
        bars = model.bar_vectors(points) / model.lengths[:, None]
        forces = model.strains(points) / model.compliance
        pull = forces[:, None] * bars
        push = self.touch(points, definite=True)
        bend = moment[:, None, None] * turn
        pulls = np.stack([-pull, pull], axis=1)
        gradient = self.assembly.gather([bend, pulls, np.zeros((0, 3))])
        gradient += self.assembly.scattered(push)
        outer = turn[:, :, None, :, None] * turn[:, None, :, None, :]
        block = bars[:, :, None] * bars[:, None, :] / model.compliance[:, None, None]
        block += (np.maximum(forces, 0.0) / model.lengths)[:, None, None] * np.eye(3)
        bent = slope[:, None, None, None, None] * outer
        stretched = stretch_blocks(block)
        none = np.zeros((1, 0, 0, 3, 3))
        return gradient, self.assembly.matrix([bent, stretched, none], push)

    def definite(self, matrix: sparse.csc_array) -> Factor:
        """The factor of ``matrix``. Raises ``RuntimeError`` where it is not positive definite."""
        return self._solver.factor(matrix)

    def _counted_on(self, angle: Floats) -> Floats:
        """``angle`` (H,) in (-pi, pi], with the whole turns nearest to the last state."""
        return np.asarray(angle + 2 * np.pi * np.round((self.last - angle) / (2 * np.pi)))

    @cached_property
    def _stop(self) -> Floats:
        return LIMIT_STIFFNESS * edge_lengths(self.model.points, self.hinges[:, :2])


class Descent(NamedTuple):
    """Where a descent ended: ``points`` (V, 3), the largest component of the ``force``, mu there,
    and whether its way was longer than its leash.
    """

    points: Floats
    force: float
    mu: float = FIRST_MU
    leashed: bool = False


def descend(
    ramped: Ramped,
    points: Floats,
    target: float,
    force: float,
    rounds: int,
    leash: float = np.inf,
    mu: float = FIRST_MU,
    on_round: Callable[[int], None] | None = None,
) -> Descent:
    """Lower the energy from ``points`` (V, 3) until no force is above ``force``.

    It takes at most ``rounds`` steps, and ends before points come nearer to each other by ``leash``
    (:func:`nearing`). No step leads through what touches. All bars need a compliance. ``ramped``
    accepts each step. ``on_round`` is told the number of each step before it.
    """
    start, energy = points, ramped.energy(points, target)
    down, leashed = _Downhill(ramped, points, target), False
    for number in range(rounds):
        if down.force <= force or mu > GREATEST_MU or leashed:
            break
        if on_round is not None:
            on_round(number)
        step = down.step(mu)
        if step is None:
            mu *= BLUNTER
            continue
        step *= min(1.0, LARGEST_MOVE / np.abs(step).max())
        while np.isfinite(leash) and nearing(start, points + step) > leash:
            leashed = True
            step /= 2
        way = free_way(points, step, ramped.pairs)
        leashed = leashed and way == 1.0
        step *= way
        for _ in range(SHORTENINGS):
            trial = points + step
            turned = np.abs(ramped.angles(trial) - ramped.last).max(initial=0.0)
            lower = ramped.energy(trial, target) if turned <= LARGEST_TURN else np.inf
            if lower < energy:
                break
            leashed = False
            step /= 2
        if lower < energy:
            points, energy, mu = trial, lower, max(mu * SHARPER, LEAST_MU)
            ramped.accept(points)
            down = _Downhill(ramped, points, target)
        else:
            mu *= BLUNTER
    return Descent(points, down.force, mu, leashed)


class _Downhill:
    """The ways down from ``points``, with K once for all of them."""

    def __init__(self, ramped: Ramped, points: Floats, target: float) -> None:
        self._ramped, self._points, self._target = ramped, points, target
        self._state = ramped.state(points)
        self._gradient = ramped.residual(self._state, target).force

    @property
    def force(self) -> float:
        """The largest component of the gradient."""
        return float(np.abs(self._gradient).max(initial=0.0))

    def step(self, mu: float) -> Floats | None:
        """The step (V, 3) of Newton with ``mu``, or that of Gauss and Newton where K with ``mu`` is
        not definite; None where rounding leaves neither definite.
        """
        ramped = self._ramped
        for whole in (True, False):
            matrix = self._exact if whole else self._loose
            with suppress(RuntimeError):
                factor = ramped.definite(raised_diagonal(matrix, mu))
                return ramped.assembly.vectors(-factor.solve(self._gradient))
        return None

    @cached_property
    def _exact(self) -> sparse.csc_array:
        return self._ramped.stiffness(self._state, self._target)

    @cached_property
    def _loose(self) -> sparse.csc_array:
        return self._ramped.gauss_newton(self._points, self._target)[1]


def softest_moves(ramped: Ramped, points: Floats, target: float, forces: Floats) -> Floats:
    """The moves (V, 3) that small ``forces`` (V, 3) cause: large where the sheet is soft."""
    matrix = raised_diagonal(ramped.gauss_newton(points, target)[1], SOFT_MU)
    pushed = ramped.definite(matrix).solve(forces.ravel()[ramped.assembly.free])
    return ramped.assembly.vectors(pushed)


def nearing(before: Floats, after: Floats) -> float:
    """By how much two points of a sheet that were ``REACH`` apart can have come nearer, at most.

    All moves as the affine motion that fits best, which shortens nothing by more than its least
    singular value, but for what each point (V, 3) moves beside it. In directions in which the sheet
    is thin it is no affine motion. Infinite for a motion that turns it inside out.
    """
    one, other = before - before.mean(axis=0), after - after.mean(axis=0)
    affine = np.eye(3) + np.linalg.lstsq(one, other - one, rcond=THIN)[0]
    if np.linalg.det(affine) <= 0:
        return np.inf
    least = float(np.linalg.svd(affine, compute_uv=False)[-1])
    beside = float(np.linalg.norm(other - one @ affine, axis=1).max())
    return REACH * max(1 - least, 0.0) + 2 * beside


def raised_diagonal(matrix: sparse.csc_array, by: float) -> sparse.csc_array:
    """``matrix`` plus ``by`` times the unit matrix; its diagonal is stored."""
    columns = np.repeat(np.arange(matrix.shape[1]), np.diff(matrix.indptr))
    data = matrix.data + np.where(matrix.indices == columns, by, 0.0)
    return sparse.csc_array((data, matrix.indices, matrix.indptr), shape=matrix.shape)
