"""From flat to folded, by mountains and valleys alone: one ramp for all creases of any pattern.

Every crease is a spring whose rest angle goes from 0 to its fold angle, and all go together.

1. The linear seed (:mod:`miurafab.origami.energy.seed`) chooses the side to which the sheet leaves
   the plane; a descent (:mod:`miurafab.origami.energy.ramp`) brings it into balance there.
2. The Newton iteration follows the balance along the ramp. A step that fails, or that turns a
   crease too far, is halved; one that holds lets the next be longer. Where the shortest step fails
   the sheet snaps: a descent from there finds the next balance.
3. Bars that stretch a little choose this path, since a sheet that cannot stretch locks on the way.
   In each frame the bars are then made stiff, from the soft shape. A frame whose stiff bars find no
   balance near the soft shape stays as it is, and its strain tells of it.

A state is stable where K has no negative pivot. What folds in one sequence and not together ends
with creases of the wrong sign; this is told and not repaired.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.sparse import negative_pivots
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.bar_hinge import SOFTNESS, BarHingeModel, flat_model
from miurafab.origami.energy.continuation import HISTORY, Known, extrapolate, follow
from miurafab.origami.energy.equilibrium import Balance, EquilibriumState, Factored, solve
from miurafab.origami.energy.ramp import LARGEST_TURN, Descent, Ramped, descend
from miurafab.origami.energy.seed import linear_seed
from miurafab.origami.energy.touching import REACH

Progress = Callable[[float, str], None]

FARTHEST = 0.9
"""The part of half a turn up to which creases go: on each other, facets have no one balance."""
ENOUGH = 1e-6
"""The force, in k_f, at which a descent hands over to Newton's iteration."""
ROUNDS = 200
"""The most steps of a descent."""
MOST_PIECES, PIECE_ROUNDS = 40, 30
"""The most pieces of a descent with facets that touch, and the most steps of each."""
FIRST_PARTS = (1.0, 0.25, 1.0 / 16.0)
"""The first balance, in steps between two frames: nearer to flat if it is not found."""
FIRST, LONGER, SHORTEST = 1.0 / 8.0, 1.6, 1.0 / 64.0
"""Of the step between two frames: the first step, the growth after one that holds, the least."""
SHAKEN = 1e-3
"""Mean edges by which vertices are moved at random before a descent out of a snap."""
MAX_SNAPS = 20
FIRMER = 100.0
"""The factor on the stiffness of facets in a frame."""
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


@dataclass(frozen=True, eq=False)
class RampPath:
    """The path of ``model`` through ``frames``, without the flat one.

    ``follow`` (n,) are the creases that follow their sign in the linear seed; ``snaps`` is the
    number of times that the sheet left the path for another. If ``converged`` is False the path
    ends early.
    """

    model: BarHingeModel
    frames: tuple[RampFrame, ...]
    follow: Bools
    snaps: int
    converged: bool

    @property
    def sprung(self) -> Ints:
        """(n,) the hinges with a rest angle."""
        return np.flatnonzero(self.model.rest != 0)

    @property
    def wrong(self) -> Bools:
        """(n,) the creases that end folded to the other side than their letter tells."""
        last = self.frames[-1].angles[self.sprung]
        return np.asarray(last * self.model.rest[self.sprung] < 0)

    @property
    def angle_error(self) -> float:
        """The mean distance of the creases from their rest angles at the end, radians."""
        last = self.frames[-1]
        wanted = last.part * self.model.rest[self.sprung]
        return float(np.abs(last.angles[self.sprung] - wanted).mean())


def ramp_parts(pattern: CreasePattern, steps: int) -> Floats:
    """(steps + 1,) the parts of the ramp of the frames of ``pattern``, the first of them 0."""
    largest = float(np.abs(pattern.edges_fold_angle).max(initial=0.0))
    last = 1.0 if largest == 0 else min(1.0, FARTHEST * np.pi / largest)
    return np.linspace(0.0, last, steps + 1)


def fold_from_flat(
    pattern: CreasePattern,
    parts: Floats,
    *,
    touching: bool = False,
    softness: float = SOFTNESS,
    seed: int = 0,
    on_progress: Progress | None = None,
) -> RampPath:
    """The path of ``pattern``, of one piece, from flat through ``parts`` (n + 1,) of its ramp.

    With ``touching`` facets do not pass through each other. ``softness`` is the compliance of a bar
    over its length (:func:`~miurafab.origami.energy.bar_hinge.flat_model`), and ``seed`` is that of
    the shaking out of a snap. Raises what
    :func:`~miurafab.origami.energy.bar_hinge.flat_model` raises. Failure is a result.
    """
    model = flat_model(pattern, softness=softness)
    walk = _Walk(model, touching, np.random.default_rng(seed))
    start = linear_seed(model)
    frames: list[RampFrame] = []
    found = any(walk.leave_flat(start.heights, float(parts[1]) * first) for first in FIRST_PARTS)
    for number, part in enumerate(parts[1:].tolist()):
        found = found and walk.reach(part, float(parts[1]))
        if not found:
            break
        frame = walk.frame()
        if frame.unstable and walk.leave_saddle():
            frame = walk.frame()
        frames.append(frame)
        if on_progress is not None:
            on_progress((number + 1) / (len(parts) - 1), f"step {number + 1} of {len(parts) - 1}")
    if found and not touching:
        frames = walk.stiffened_back(frames)
    return RampPath(model, tuple(frames), start.follow, walk.snaps, bool(found))


class _Walk:
    """The walk along the ramp: where it is, the last states, and the length of the next step."""

    def __init__(self, model: BarHingeModel, touching: bool, random: np.random.Generator) -> None:
        self.ramped = Ramped(model)
        firmer = np.where(model.rest == 0, FIRMER, 1.0) * model.stiffness
        hard = replace(model, compliance=np.zeros_like(model.compliance), stiffness=firmer)
        self.stiff = Ramped(hard)
        self.known: list[Known] = []
        self._factored: Factored | None = None
        self.step = FIRST
        self.snaps = 0
        self._touching = touching
        self._random = random

    def leave_flat(self, heights: Floats, part: float) -> bool:
        """Find a balance at ``part`` by descent from the linear seed of ``heights`` (V,)."""
        raised = self.ramped.model.points.copy()
        raised[:, 2] += part * heights
        self.ramped.last[:] = 0.0
        return self.land(raised @ self.ramped.axes, part)

    def land(self, points: Floats, part: float) -> bool:
        """Find a balance at ``part`` by descent from ``points``."""
        ended = self._descend(points, part)
        found = solve(self.ramped, self.ramped.state(ended.points), part)
        turned = np.abs(self.ramped.angles(found.state.points) - self.ramped.last)
        if not found.converged or turned.max(initial=0.0) > LARGEST_TURN:
            return False
        self.known, self._factored = [Known(part, found.state)], found.factored
        self._accept(found.state.points)
        self.step = FIRST
        return True

    def _descend(self, points: Floats, part: float) -> Descent:
        """Where a descent from ``points`` ends. With facets that touch it goes in short pieces, and
        looks after each which facets are near each other.
        """
        if not self._touching:
            return descend(self.ramped, points, part, ENOUGH, ROUNDS)
        ended = Descent(points, np.inf)
        for _ in range(MOST_PIECES):
            ended = descend(self.ramped, ended.points, part, ENOUGH, PIECE_ROUNDS, REACH / 2)
            if ended.force <= ENOUGH:
                break
            self._accept(ended.points)
        return ended

    def reach(self, goal: float, nominal: float) -> bool:
        """Follow the path up to ``goal``, in steps of ``nominal`` at most; False if it is lost."""
        while self.known[-1].drive < goal - 1e-12:
            here = self.known[-1].drive
            part = min(goal, here + nominal * self.step)
            found = solve(self.ramped, extrapolate(self.known, part), part, self._factored)
            self._factored = found.factored
            if found.converged and self._is_short(found.state.points):
                self._accept(found.state.points)
                self.known = [*self.known[1 - HISTORY :], Known(part, found.state)]
                self.step = min(1.0, self.step * LONGER)
            elif self.step > SHORTEST:
                self.step /= 2
            elif not self._snap(min(goal, here + nominal * FIRST)):
                return False
        return True

    def frame(self) -> RampFrame:
        """The last state with stiff bars, if they find a stable balance near it, or as it is."""
        here, soft, stiff = self.known[-1], self.ramped, self.stiff
        stiff.last[:] = soft.last
        found = solve(stiff, here.state, here.drive)
        if found.converged:
            turned = np.abs(stiff.angles(found.state.points) - soft.last).max(initial=0.0)
            hard = _frame(stiff, Known(here.drive, found.state), True)
            if turned <= NEAR and not hard.unstable:
                return hard
        return _frame(soft, here, False)

    def stiffened_back(self, frames: list[RampFrame]) -> list[RampFrame]:
        """``frames``, all with stiff bars if the stiff path leads back to the first of them.

        Near flat a soft sheet may lie far from every stiff shape. The path with stiff bars is
        followed back there from the first of the frames from which all are stiff.
        """
        stiff = [frame.stiff for frame in frames]
        first = len(stiff) - stiff[::-1].index(False) if False in stiff else 0
        if not 0 < first < len(frames):
            return frames
        self.stiff.last[:] = frames[first].angles
        rest = EquilibriumState(
            frames[first].points @ self.stiff.axes, np.zeros(len(self.stiff.model.bars)), 0.0
        )
        goals = np.array([frame.part for frame in frames[first::-1]])
        back = follow(self.stiff, rest, goals)
        if len(back) < len(goals):
            return frames
        hard = []
        for part, state in zip(goals.tolist(), back, strict=True):
            if np.abs(self.stiff.angles(state.points) - self.stiff.last).max() > LARGEST_TURN:
                return frames
            hard.append(_frame(self.stiff, Known(part, state), True))
            self.stiff.accept(state.points)
        unstable = any(frame.unstable for frame in hard)
        return frames if unstable else [*hard[:0:-1], *frames[first:]]

    def _is_short(self, points: Floats) -> bool:
        """Whether the way to ``points`` is short enough for one step.

        Two facets that may touch come nearer by less than the reach, so that neither is overlooked.
        """
        turned = np.abs(self.ramped.angles(points) - self.ramped.last)
        moved = np.abs(points - self.known[-1].state.points).max() if self._touching else 0.0
        return bool(turned.max(initial=0.0) <= LARGEST_TURN and moved <= REACH / 2)

    def _accept(self, points: Floats) -> None:
        """Count angles on from ``points``, and look which facets are near each other there."""
        self.ramped.accept(points)
        if self._touching:
            now = self.ramped.touching_at(points)
            if now is not self.ramped:
                self.ramped, self._factored = now, None
                self.stiff = replace(self.stiff, pairs=now.pairs)

    def leave_saddle(self) -> bool:
        """Go down from an unstable state at the same part of the ramp."""
        return self._snap(self.known[-1].drive)

    def _snap(self, part: float) -> bool:
        self.snaps += 1
        shaken = self.known[-1].state.points
        shaken = shaken + SHAKEN * self._random.normal(size=shaken.shape)
        return self.snaps <= MAX_SNAPS and self.land(shaken, part)


def _frame(balance: Ramped, known: Known, stiff: bool) -> RampFrame:
    return RampFrame(
        known.drive,
        known.state.points @ balance.axes.T,
        balance.angles(known.state.points),
        unstable_directions(balance, known.state, known.drive),
        stiff,
    )


def unstable_directions(balance: Balance, state: EquilibriumState, target: float) -> int:
    """The number of directions in which the energy falls from a ``state`` in balance."""
    return negative_pivots(balance.factor(state, target).k)
