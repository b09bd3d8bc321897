"""The walk of a sheet along the ramp of its rest angles, from balance to balance.

A step is taken by Newton's iteration. One that fails, or that turns a crease too far, is halved;
one that holds lets the next be longer. Where the shortest step fails the sheet snaps: a descent
from there finds the next balance.

Where facets must not pass through each other, nothing passes through anything on the straight way
between two states. A step that fails there is gone by a descent at once, in full length: it goes
down in steps that nothing blocks, and so ends in a balance that the sheet can reach.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from miurafab.geometry.arrays import Floats
from miurafab.geometry.sparse import negative_pivots
from miurafab.origami.energy.bar_hinge import BarHingeModel
from miurafab.origami.energy.continuation import HISTORY, Known, extrapolate, follow
from miurafab.origami.energy.equilibrium import (
    MAX_ITERATIONS,
    ROUNDINGS,
    Balance,
    EquilibriumState,
    Factored,
    Solution,
    solve,
)
from miurafab.origami.energy.ramp import (
    LARGEST_TURN,
    Descent,
    Ramped,
    descend,
    nearing,
    raised_diagonal,
    softest_moves,
)
from miurafab.origami.energy.touch_pairs import (
    ARMED,
    LEASH,
    MOST_ARMINGS,
    REACH,
    Contacts,
    NearPairs,
)
from miurafab.origami.energy.touching import HEIGHT, free_way

ENOUGH = 1e-6
"""The force, in k_f, at which a descent hands over to Newton's iteration."""
ROUNDS = 200
"""The most steps of a descent."""
MOST_FACTORS = 4
"""How many factorisations Newton's iteration gets where facets may touch, before a descent."""
MOST_PIECES, PIECE_ROUNDS = 80, 60
"""The most pieces of a descent with facets that touch, and the most steps of each."""
FIRST, LONGER, SHORTEST = 1.0 / 8.0, 1.6, 1.0 / 64.0
"""Of the step between two frames: the first step, the growth after one that holds, the least."""
SHAKEN, SOFTLY_SHAKEN = 1e-3, 0.02
"""Mean edges by which vertices are moved at random before a descent out of a snap; with facets that
touch, along what is soft."""
SHAKES = 4
"""How often facets that touch are shaken for one snap."""
MAX_SNAPS = 20
"""A path that has to be shaken more often is lost."""
LEAST_PATIENCE = 8
"""How many factorisations a frame gets at least to find its stiff shape: each that finds none
halves what the next one gets.
"""
PAUSE = 3
"""The frames of a sheet with curved creases that are left as they are after one that found no stiff
shape with the least patience. Such a sheet has none, and spent most of its time looking for it.
"""
FIRMER = 100.0
"""The factor on the stiffness of facets in a frame."""
HALF_WAY = 0.1
"""The factor on the compliance of bars half-way to stiff ones."""
NEAR = np.radians(15.0)
"""A stiff shape whose creases differ more from the soft shape is another one."""


@dataclass(frozen=True, eq=False)
class RampFrame:
    """One state of the path: at the ``part`` of the ramp, ``points`` (V, 3) in mean edges.

    ``angles`` (H,) are those of the hinges, counted on from flat; ``unstable`` the number of
    directions in which the energy falls; ``stiff`` whether the bars keep their length.
    """

    part: float
    points: Floats
    angles: Floats
    unstable: int
    stiff: bool


class RampWalk:
    """Where a sheet is on the ramp, the last states, and the length of the next step.

    With ``near`` its facets do not pass through each other. ``on_round`` is called before each step
    of a descent, and with 0 before each step along the ramp.
    """

    def __init__(
        self,
        model: BarHingeModel,
        near: NearPairs | None,
        random: np.random.Generator,
        on_round: Callable[[int], None] | None = None,
    ) -> None:
        self._on_round = on_round
        self._soft = Ramped(model)
        firmer = np.where(model.rest == 0, FIRMER, 1.0) * model.stiffness
        firmer[model.ruled] = model.stiffness[model.ruled]
        hard = replace(model, compliance=np.zeros_like(model.compliance), stiffness=firmer)
        self._stiff = self._soft.made_of(hard)
        half = replace(hard, compliance=HALF_WAY * model.compliance)
        self._half = self._soft.made_of(half)
        self._known: list[Known] = []
        self._factored: Factored | None = None
        self._step = FIRST
        self._patience, self._pause = MAX_ITERATIONS, 0
        self.snaps = 0
        self._near = near
        self._contacts = Contacts(near)
        self._random = random

    def leave_flat(self, heights: Floats, part: float) -> bool:
        """Find a balance at ``part`` by descent from the linear seed of ``heights`` (V,)."""
        raised = self._soft.model.points.copy()
        raised[:, 2] += part * heights
        self._soft.last[:] = 0.0
        return self._land(raised @ self._soft.axes, part)

    def reach(self, goal: float, nominal: float) -> bool:
        """Follow the path up to ``goal``, in steps of ``nominal`` at most; False if it is lost."""
        while self._known[-1].drive < goal - 1e-12:
            if self._on_round is not None:
                self._on_round(0)
            here = self._known[-1]
            part = min(goal, here.drive + nominal * self._step)
            found = self._solved(self._soft, extrapolate(self._known, part), part, self._factored)
            self._factored = found.factored
            short = found.converged and self._is_short(found.state.points)
            if short and self._is_free(here.state.points, found.state.points):
                self._accept(found.state.points)
                self._known = [*self._known[1 - HISTORY :], Known(part, found.state)]
                self._step = min(1.0, self._step * LONGER)
            elif self._near is not None and (short or not found.converged):
                if not self._settle(part):
                    return False
            elif self._step > SHORTEST:
                self._step /= 2
            elif not self._snap(min(goal, here.drive + nominal * FIRST)):
                return False
        return True

    def leave_saddle(self) -> bool:
        """Go down from an unstable state at the same part of the ramp."""
        return self._snap(self._known[-1].drive)

    def frame(self) -> RampFrame:
        """The last state with stiff bars, if they find a stable balance near it, or as it is."""
        here = self._known[-1]
        if self._pause:
            self._pause -= 1
            return _frame(self._soft, here, False)
        hard = self._hardened(here)
        if hard is not None:
            self._patience = MAX_ITERATIONS
            return hard
        curved = len(self._soft.model.ruled) > 0
        self._pause = PAUSE if curved and self._patience == LEAST_PATIENCE else 0
        self._patience = max(LEAST_PATIENCE, self._patience // 2)
        return _frame(self._soft, here, False)

    def _hardened(self, here: Known) -> RampFrame | None:
        """The stable balance with stiff bars near ``here``; None where none is found."""
        self._stiff.last[:] = self._soft.last
        found = self._solved(self._stiff, here.state, here.drive, factors=self._patience)
        half_way = self._near is not None and self._patience > LEAST_PATIENCE
        if half_way and not found.converged:
            self._half.last[:] = self._soft.last
            self._arm(here.state.points, REACH)
            ended = descend(self._half, here.state.points, here.drive, ENOUGH, PIECE_ROUNDS, LEASH)
            half = self._half.state(ended.points)
            found = self._solved(self._stiff, half, here.drive, factors=self._patience)
        if not found.converged or not self._is_free(here.state.points, found.state.points):
            return None
        turned = self._stiff.angles(found.state.points) - self._soft.last
        if np.abs(turned).max(initial=0.0) > NEAR:
            return None
        hard = _frame(self._stiff, Known(here.drive, found.state), True)
        return None if hard.unstable else hard

    def stiffened_back(self, frames: list[RampFrame]) -> list[RampFrame]:
        """``frames``, all with stiff bars if the stiff path leads back to the first of them.

        Near flat a soft sheet may lie far from every stiff shape. The path with stiff bars is
        followed back there from the first of the frames from which all are stiff.
        """
        stiff = [frame.stiff for frame in frames]
        first = len(stiff) - stiff[::-1].index(False) if False in stiff else 0
        if not 0 < first < len(frames):
            return frames
        self._stiff.last[:] = frames[first].angles
        rest = EquilibriumState(
            frames[first].points @ self._stiff.axes, np.zeros(len(self._stiff.model.bars)), 0.0
        )
        goals = np.array([frame.part for frame in frames[first::-1]])
        back = follow(self._stiff, rest, goals)
        if len(back) < len(goals):
            return frames
        hard = []
        for part, state in zip(goals.tolist(), back, strict=True):
            if np.abs(self._stiff.angles(state.points) - self._stiff.last).max() > LARGEST_TURN:
                return frames
            hard.append(_frame(self._stiff, Known(part, state), True))
            self._stiff.accept(state.points)
        unstable = any(frame.unstable for frame in hard)
        return frames if unstable else [*hard[:0:-1], *frames[first:]]

    def _land(self, points: Floats, part: float) -> bool:
        """Find a balance at ``part`` by descent from ``points``."""
        ended = self._descend(points, part)
        found = self._solved(self._soft, self._soft.state(ended.points), part)
        turned = np.abs(self._soft.angles(found.state.points) - self._soft.last)
        if not found.converged or turned.max(initial=0.0) > LARGEST_TURN:
            return False
        if not self._is_free(ended.points, found.state.points):
            return False
        self._known, self._factored = [Known(part, found.state)], found.factored
        self._accept(found.state.points)
        self._step = FIRST
        return True

    def _descend(self, points: Floats, part: float) -> Descent:
        """Where a descent from ``points`` ends. With facets that touch it goes in pieces, and looks
        before each which facets are near each other.
        """
        if self._near is None:
            return descend(self._soft, points, part, ENOUGH, ROUNDS, on_round=self._on_round)
        ended = Descent(points, np.inf)
        for _ in range(MOST_PIECES):
            self._look(ended.points, REACH)
            here, mu = ended.points, ended.mu
            ended = descend(self._soft, here, part, ENOUGH, PIECE_ROUNDS, LEASH, mu, self._on_round)
            if not ended.leashed:
                break
        self._arm(ended.points, ARMED)
        return ended

    def _settle(self, part: float) -> bool:
        """Go down to a balance at ``part``; how far it is tells whether the sheet snapped there."""
        before, last = self._known, self._soft.last.copy()
        here = before[-1].state.points
        if not self._land(here, part):
            self._soft.last[:] = last
            return self._snap(part)
        if nearing(here, self._known[-1].state.points) > LEASH:
            self.snaps += 1
        else:
            self._known = [*before[1 - HISTORY :], *self._known]
        self._step = 1.0
        return True

    def _snap(self, part: float) -> bool:
        """Find another balance at ``part`` by descent, shaken anew until there is one."""
        here, last = self._known[-1].state.points, self._soft.last.copy()
        for _ in range(1 if self._near is None else SHAKES):
            self.snaps += 1
            if self.snaps > MAX_SNAPS:
                return False
            self._soft.last[:] = last
            if self._land(here + self._shake(here, part), part):
                return True
        return False

    def _shake(self, here: Floats, part: float) -> Floats:
        """Random moves (V, 3). Where facets touch they bend what is soft: each vertex by itself
        would be held off at once.
        """
        moves = SHAKEN * self._random.normal(size=here.shape)
        if self._near is None:
            return np.asarray(moves)
        self._look(here, ARMED)
        moves = softest_moves(self._soft, here, part, moves)
        moves *= SOFTLY_SHAKEN / np.abs(moves).max()
        return moves * free_way(here, moves, self._contacts.pairs)

    def _is_short(self, points: Floats) -> bool:
        """Whether the way to ``points`` is short enough for one step.

        Where facets may touch, all move as one affine motion but for the leash, so that only pairs
        that are known come near each other.
        """
        turned = np.abs(self._soft.angles(points) - self._soft.last)
        if turned.max(initial=0.0) > LARGEST_TURN:
            return False
        return self._near is None or nearing(self._known[-1].state.points, points) <= LEASH

    def _is_free(self, before: Floats, after: Floats) -> bool:
        """Whether nothing passes through anything on the straight way."""
        return free_way(before, after - before, self._contacts.pairs) == 1.0

    def _accept(self, points: Floats) -> None:
        """Count angles on from ``points``, and look which facets are near each other there."""
        self._soft.accept(points)
        self._look(points, ARMED)

    def _look(self, points: Floats, within: float) -> None:
        """Look which facets are near each other; those nearer than ``within`` get springs."""
        self._contacts.look(points, within)
        self._give_springs()

    def _arm(self, points: Floats, within: float) -> None:
        """Give springs to the pairs that are nearer than ``within`` at ``points`` as well."""
        self._contacts.arm(points, within)
        self._give_springs()

    def _give_springs(self) -> None:
        self._soft, self._half, self._stiff = (
            balance.with_pairs(self._contacts.sprung)
            for balance in (self._soft, self._half, self._stiff)
        )

    def _solved(
        self,
        balance: Ramped,
        guess: EquilibriumState,
        part: float,
        factored: Factored | None = None,
        factors: int = MAX_ITERATIONS,
    ) -> Solution:
        """The balance near ``guess``; pairs that come to touch get their springs on the way."""
        definite = self._near is not None
        factors = MOST_FACTORS if definite and balance is self._soft else factors
        for _ in range(MOST_ARMINGS):
            balance = balance.with_pairs(self._contacts.sprung)
            found = solve(balance, guess, part, factored, definite=definite, factors=factors)
            if self._near is None or not found.converged:
                return found
            if not self._contacts.lacking(found.state.points):
                return found
            self._arm(found.state.points, HEIGHT)
        return found._replace(converged=False)


def _frame(balance: Ramped, known: Known, stiff: bool) -> RampFrame:
    return RampFrame(
        known.drive,
        known.state.points @ balance.axes.T,
        balance.angles(known.state.points),
        unstable_directions(balance, known.state, known.drive),
        stiff,
    )


def unstable_directions(balance: Balance, state: EquilibriumState, target: float) -> int:
    """The number of directions in which the energy falls from a ``state`` in balance.

    Loose facets move without force, and in such a direction the energy does not fall: the diagonal
    of K is raised by its rounding, so that an eigenvalue of 0 counts as none below it.
    """
    matrix = balance.stiffness(state, target)
    rounding = ROUNDINGS * np.finfo(np.float64).eps * np.abs(matrix.data).max(initial=0.0)
    return negative_pivots(balance.factored(raised_diagonal(matrix, float(rounding))))
