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
from miurafab.origami.energy.equilibrium import (
    Balance,
    EquilibriumState,
    Factored,
    Solution,
    solve,
)
from miurafab.origami.energy.ramp import LARGEST_TURN, Descent, Ramped, descend
from miurafab.origami.energy.seed import linear_seed
from miurafab.origami.energy.touch_pairs import ARMED, REACH, WIDENED, NearPairs
from miurafab.origami.energy.touching import HEIGHT
from miurafab.origami.energy.triangles import facet_triangles
from miurafab.origami.folding.contact import meeting_facets

Progress = Callable[[float, str], None]

FARTHEST = 0.9
"""The part of half a turn up to which creases go: on each other, facets have no one balance."""
ENOUGH = 1e-6
"""The force, in k_f, at which a descent hands over to Newton's iteration."""
ROUNDS = 200
"""The most steps of a descent."""
MOST_ARMINGS = 5
"""How often a step is solved anew with springs between what came to touch in it."""
MOST_PIECES, PIECE_ROUNDS, LEASH = 80, 30, WIDENED / 2
"""The most pieces of a descent with facets that touch, the most steps of each, and how far it may
go, mean edges."""
FIRST_PARTS = (1.0, 0.25, 1.0 / 16.0)
"""The first balance, in steps between two frames: nearer to flat if it is not found."""
FIRST, LONGER, SHORTEST = 1.0 / 8.0, 1.6, 1.0 / 64.0
"""Of the step between two frames: the first step, the growth after one that holds, the least."""
SHAKEN = 1e-3
"""Mean edges by which vertices are moved at random before a descent out of a snap."""
SHAKES = 4
"""How often facets that touch are shaken for one snap."""
MAX_SNAPS, MAX_SNAPS_TOUCHING = 20, 8
"""A path that snaps more often is lost; with facets that touch, each snap takes long."""
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
    finer: int = 1,
    seed: int = 0,
    on_progress: Progress | None = None,
) -> RampPath:
    """The path of ``pattern``, of one piece, from flat through ``parts`` (n + 1,) of its ramp.

    With ``touching`` facets do not pass through each other. ``softness`` is the compliance of a bar
    over its length (:func:`~miurafab.origami.energy.bar_hinge.flat_model`), ``finer`` the number of
    steps to a frame, and ``seed`` is that of the shaking out of a snap. Raises what
    :func:`~miurafab.origami.energy.bar_hinge.flat_model` raises. Failure is a result.
    """
    model = flat_model(pattern, softness=softness)
    near = None
    if touching:
        near = NearPairs(model.triangles, pattern.edges_vertices, len(model.points))
    walk = _Walk(pattern, model, near, np.random.default_rng(seed))
    start = linear_seed(model)
    frames: list[RampFrame] = []
    nominal = float(parts[1]) / finer
    found = any(walk.leave_flat(start.heights, nominal * first) for first in FIRST_PARTS)
    for number, part in enumerate(parts[1:].tolist()):
        found = found and walk.reach(part, nominal)
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

    def __init__(
        self,
        pattern: CreasePattern,
        model: BarHingeModel,
        near: NearPairs | None,
        random: np.random.Generator,
    ) -> None:
        self._pattern = pattern
        self._split = facet_triangles(model.points, pattern.faces_vertices)
        self.ramped = Ramped(model)
        firmer = np.where(model.rest == 0, FIRMER, 1.0) * model.stiffness
        firmer[model.ruled] = model.stiffness[model.ruled]
        hard = replace(model, compliance=np.zeros_like(model.compliance), stiffness=firmer)
        self.stiff = Ramped(hard)
        self.known: list[Known] = []
        self._factored: Factored | None = None
        self.step = FIRST
        self.snaps = 0
        self._near = near
        self._armed = np.empty(0, dtype=bool)
        self._random = random

    def leave_flat(self, heights: Floats, part: float) -> bool:
        """Find a balance at ``part`` by descent from the linear seed of ``heights`` (V,)."""
        raised = self.ramped.model.points.copy()
        raised[:, 2] += part * heights
        self.ramped.last[:] = 0.0
        return self.land(raised @ self.ramped.axes, part, beside=False)

    def land(self, points: Floats, part: float, *, beside: bool = True) -> bool:
        """Find a balance at ``part`` by descent from ``points``.

        With ``beside`` what comes to touch from beside is held off as well: in a flat sheet, where
        all lies beside each other, nothing touches.
        """
        ended = self._descend(points, part, beside)
        found = self._solved(False, self.ramped.state(ended.points), part)
        turned = np.abs(self.ramped.angles(found.state.points) - self.ramped.last)
        if not found.converged or turned.max(initial=0.0) > LARGEST_TURN:
            return False
        if self._pierces(found.state.points):
            return False
        self.known, self._factored = [Known(part, found.state)], found.factored
        self._accept(found.state.points)
        self.step = FIRST
        return True

    def _descend(self, points: Floats, part: float, beside: bool) -> Descent:
        """Where a descent from ``points`` ends. With facets that touch it goes in short pieces, and
        looks after each which facets are near each other.
        """
        if self._near is None:
            return descend(self.ramped, points, part, ENOUGH, ROUNDS)
        ended = Descent(points, np.inf)
        for _ in range(MOST_PIECES):
            self._arm(self._near.within(ended.points, np.inf))
            ended = descend(self.ramped, ended.points, part, ENOUGH, PIECE_ROUNDS, LEASH)
            if ended.force <= ENOUGH:
                break
            self._look(ended.points, beside=beside)
        return ended

    def reach(self, goal: float, nominal: float) -> bool:
        """Follow the path up to ``goal``, in steps of ``nominal`` at most; False if it is lost."""
        while self.known[-1].drive < goal - 1e-12:
            here = self.known[-1].drive
            part = min(goal, here + nominal * self.step)
            found = self._solved(False, extrapolate(self.known, part), part, self._factored)
            self._factored = found.factored
            short = found.converged and self._is_short(found.state.points)
            pierces = short and self._pierces(found.state.points)
            if short and not pierces:
                self._accept(found.state.points)
                self.known = [*self.known[1 - HISTORY :], Known(part, found.state)]
                self.step = min(1.0, self.step * LONGER)
            elif self.step > SHORTEST:
                self.step /= 2
                if pierces:
                    self._look(self.known[-1].state.points, beside=True)
            elif not self._snap(min(goal, here + nominal * FIRST)):
                return False
        return True

    def frame(self) -> RampFrame:
        """The last state with stiff bars, if they find a stable balance near it, or as it is."""
        here, soft, stiff = self.known[-1], self.ramped, self.stiff
        stiff.last[:] = soft.last
        found = self._solved(True, here.state, here.drive)
        if found.converged and not self._pierces(found.state.points):
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

        Where facets may touch, all move as one affine motion but for the reach, so that no two
        facets pass through each other between two looks.
        """
        turned = np.abs(self.ramped.angles(points) - self.ramped.last)
        if turned.max(initial=0.0) > LARGEST_TURN:
            return False
        return self._near is None or _strayed(self.known[-1].state.points, points) <= REACH / 2

    def _accept(self, points: Floats) -> None:
        """Count angles on from ``points``, and look which facets are near each other there."""
        self.ramped.accept(points)
        self._look(points)

    def _look(self, points: Floats, *, beside: bool = False) -> None:
        if self._near is not None:
            self._near.look(points, beside=beside)
            self._arm(self._near.within(points, ARMED))

    def _pierces(self, points: Floats) -> bool:
        """Whether facets that shall not pass through each other do."""
        if self._near is None:
            return False
        return len(meeting_facets(self._pattern, points, self._split)) > 0

    def _arm(self, armed: Bools) -> None:
        """Give the near pairs ``armed`` (n,) their springs."""
        assert self._near is not None
        self._armed = armed
        pairs = self._near.pairs.those(armed)
        self.ramped, self.stiff = self.ramped.with_pairs(pairs), self.stiff.with_pairs(pairs)

    def _solved(
        self, stiff: bool, guess: EquilibriumState, part: float, factored: Factored | None = None
    ) -> Solution:
        """The balance near ``guess``; pairs that come to touch get their springs on the way."""
        for _ in range(MOST_ARMINGS):
            found = solve(self.stiff if stiff else self.ramped, guess, part, factored)
            if self._near is None or not found.converged:
                return found
            late = self._near.within(found.state.points, HEIGHT) & ~self._armed
            if not late.any():
                return found
            self._arm(self._armed | late)
        return found._replace(converged=False)

    def leave_saddle(self) -> bool:
        """Go down from an unstable state at the same part of the ramp."""
        return self._snap(self.known[-1].drive)

    def _snap(self, part: float) -> bool:
        """Find another balance at ``part`` by descent, shaken anew until there is one."""
        here, last = self.known[-1].state.points, self.ramped.last.copy()
        shakes, most = (1, MAX_SNAPS) if self._near is None else (SHAKES, MAX_SNAPS_TOUCHING)
        for _ in range(shakes):
            self.snaps += 1
            if self.snaps > most:
                return False
            self.ramped.last[:] = last
            self._look(here, beside=True)
            shaken = here + SHAKEN * self._random.normal(size=here.shape)
            if self.land(shaken, part):
                return True
        return False


def _frame(balance: Ramped, known: Known, stiff: bool) -> RampFrame:
    return RampFrame(
        known.drive,
        known.state.points @ balance.axes.T,
        balance.angles(known.state.points),
        unstable_directions(balance, known.state, known.drive),
        stiff,
    )


def _strayed(before: Floats, after: Floats) -> float:
    """The farthest move of a point (V, 3) beyond the affine motion that fits best."""
    one, other = before - before.mean(axis=0), after - after.mean(axis=0)
    turn = np.linalg.lstsq(one, other, rcond=1e-6)[0]
    return float(np.linalg.norm(other - one @ turn, axis=1).max())


def unstable_directions(balance: Balance, state: EquilibriumState, target: float) -> int:
    """The number of directions in which the energy falls from a ``state`` in balance."""
    return negative_pivots(balance.factor(state, target).k)
