"""From flat to folded, by mountains and valleys alone: one ramp for all creases of any pattern.

Every crease is a spring whose rest angle goes from 0 to its fold angle, and all go together.

1. The linear seed (:mod:`miurafab.origami.energy.seed`) chooses the side to which the sheet leaves
   the plane; a descent (:mod:`miurafab.origami.energy.ramp`) brings it into balance there.
2. The Newton iteration follows the balance along the ramp, and a descent goes on where it fails
   (:mod:`miurafab.origami.folding.ramp_walk`).
3. Bars that stretch a little choose this path, since a sheet that cannot stretch locks on the way.
   In each frame the bars are then made stiff, from the soft shape. A frame whose stiff bars find no
   balance near the soft shape stays as it is, and its strain tells of it.

A state is stable where K has no negative pivot. What folds in one sequence and not together ends
with creases of the wrong sign; this is told and not repaired.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.bar_hinge import SOFTNESS, BarHingeModel, flat_model
from miurafab.origami.energy.seed import linear_seed
from miurafab.origami.energy.touch_pairs import NearPairs
from miurafab.origami.folding.ramp_walk import RampFrame, RampWalk

Progress = Callable[[float, str], None]

FARTHEST = 0.9
"""The part of half a turn up to which creases go: on each other, facets have no one balance."""
FIRST_PARTS = (1.0, 0.25, 1.0 / 16.0)
"""The first balance, in steps between two frames: nearer to flat if it is not found."""


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
        hinges = np.concatenate([model.hinges, model.creases])
        near = NearPairs(model.triangles, pattern.edges_vertices, hinges, model.points)
    frames: list[RampFrame] = []

    def tell(rounds: int) -> None:
        if on_progress is not None:
            done, steps = len(frames), len(parts) - 1
            on_progress(done / steps, f"step {done + 1} of {steps}, round {rounds + 1}")

    walk = RampWalk(model, near, np.random.default_rng(seed), tell)
    start = linear_seed(model)
    nominal, stuck = float(parts[1]) / finer, 0
    found = any(walk.leave_flat(start.heights, nominal * first) for first in FIRST_PARTS)
    for number, part in enumerate(parts[1:].tolist()):
        found = found and walk.reach(part, nominal)
        if not found:
            break
        frame = walk.frame()
        if frame.unstable > stuck:
            if walk.leave_saddle():
                frame = walk.frame()
            else:  # few that follow can be left
                stuck = frame.unstable
        stuck = min(stuck, frame.unstable)
        frames.append(frame)
        if on_progress is not None:
            on_progress((number + 1) / (len(parts) - 1), f"step {number + 1} of {len(parts) - 1}")
    if found and not touching:
        frames = walk.stiffened_back(frames)
    return RampPath(model, tuple(frames), start.follow, walk.snaps, bool(found))
