"""Fewer patches: covers by fewer and fewer frames.

To do with one frame less, one of those that hold the fewest facets alone is left out of a cover and
the rest are relaxed (:mod:`~miurafab.fabrication.partition.cover`). If something remains uncovered,
the frames about such a place are changed at random, with a seeded generator, and relaxed again,
until nothing remains or the effort is spent. There are three changes: another frame has to take
what is left out, one frame is turned by a right angle, or all frames within reach are shaken.
Several beginnings are followed at a time, the better ones more often.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from miurafab.fabrication.partition.cover import ENOUGH, UNITS, Relaxation, excess, nearest
from miurafab.geometry.arrays import Floats

_MARGINS_MM = (8.0, 3.0)
"""Margins at which frames are relaxed first, every other time."""

_EASED_MM = (8.0, 4.0, 2.0, 1.0)
"""The same once a cover is found."""

_LEAVES, _TRIES = 3, 4
"""Frames that are left out in turn, and beginnings that are followed up."""


@dataclass
class Chain:
    """One beginning of a search, and what it has come to: ``frames`` (K, 3) and their L in mm²."""

    frames: Floats
    loss: float


class CoverSearch(Relaxation):
    """The search for covers of ``shapes`` (N, c, 2) by frames ``width`` x ``height`` mm."""

    def __init__(self, shapes: Floats, width: float, height: float, seed: int = 0) -> None:
        super().__init__(shapes, width, height)
        self.random = np.random.default_rng(seed)

    def begin(self, frames: Floats) -> Chain:
        """A beginning with ``frames`` (K, 3)."""
        return Chain(*self.relax(frames))

    def needed(self, frames: Floats) -> Floats:
        """(K,) how many shapes of the sample each frame holds alone."""
        near, apart = nearest(self.centres, frames, *self.size, 2)
        if near.shape[1] < 2:
            return np.full(len(frames), float(len(near)))
        alone = apart.max(axis=1) > -self.radius
        holder = near[np.arange(len(near)), apart.argmin(axis=1)]
        return np.bincount(holder, alone.astype(np.float64), len(frames)).astype(np.float64)

    def fewer(self, chains: list[Chain], count: int, effort: float) -> Floats | None:
        """A cover by ``count`` frames at most, or None if it takes more than ``effort``.

        The search begins with ``chains``, which have ``count`` + 1 frames or other numbers of them,
        and leaves each of them with ``count`` where it had more.
        """
        end = self.spent + effort
        found = None
        for chain in chains:
            while len(chain.frames) > count:
                least = np.argsort(self.needed(chain.frames), kind="stable")[:_LEAVES]
                left = [self.relax(np.delete(chain.frames, leave, 0), rounds=1) for leave in least]
                chain.frames, chain.loss = min(left, key=lambda each: each[1])
            if found is None and len(chain.frames) <= count and chain.loss <= ENOUGH:
                chain.frames, chain.loss = self.settled(chain.frames)
                found = chain.frames if chain.loss <= ENOUGH else None
        if found is not None:
            return self._eased(found)
        tries = sorted(
            (chain for chain in chains if len(chain.frames) <= count), key=lambda each: each.loss
        )[:_TRIES]
        tries = [Chain(chain.frames, chain.loss) for chain in tries]
        fresh = list(tries)
        while tries and self.spent < end:
            margins: tuple[float, ...] = _MARGINS_MM
            if fresh:
                chain = fresh.pop(0)
                moved, loss = self.settled(chain.frames, margins)
            else:
                tries.sort(key=lambda each: each.loss)
                chain = tries[min(int(self.random.exponential(1.5)), len(tries) - 1)]
                margins = _MARGINS_MM if self.random.random() < 0.5 else ()
                moved, loss = self.settled(self._shaken(chain.frames), margins)
            if loss <= ENOUGH:
                return self._eased(moved)
            if loss < chain.loss or (loss < 1.05 * chain.loss and self.random.random() < 0.3):
                chain.frames, chain.loss = moved, loss
        return None

    def _eased(self, frames: Floats) -> Floats:
        """The cover ``frames`` with the room that is left over shared out, if it stays one."""
        eased, loss = self.settled(frames, _EASED_MM)
        return eased if loss <= ENOUGH else frames

    def _shaken(self, frames: Floats) -> Floats:
        """The frames with those about one place that they leave out changed at random."""
        self.margin = 0.0
        self.look(frames)
        _, over = self.least(frames)
        weight = np.maximum(over, 0.0) ** 2
        chance = weight / weight.sum() if weight.any() else None
        place = int(self.random.choice(len(over), p=chance))
        spot = self.centres[self.active[place]]
        away = np.linalg.norm(frames[:, :2] - spot, axis=1)
        way = self.random.random()
        frames = frames.copy()
        if way < 0.5:
            return self._taken_over(frames, over, place)
        if way < 0.65:
            frames[self.random.choice(np.argsort(away, kind="stable")[:8]), 2] += np.pi / 2
            return frames
        reach = float(self.random.choice([0.6, 1.2, 2.0])) * max(self.size)
        far = float(self.random.choice([0.003, 0.01, 0.03, 0.1])) * min(self.size)
        near = np.flatnonzero(away < reach)
        frames[near] += self.random.normal(size=(len(near), 3)) * far * UNITS
        return frames

    def _taken_over(self, frames: Floats, over: Floats, place: int) -> Floats:
        """The frames after another one than the nearest had to take what is left out about the
        active facet ``place``.
        """
        spots = self.centres[self.active]
        away = np.linalg.norm(spots - spots[place], axis=1)
        facet = np.repeat(self.corners[self.active[place]][None], self.near.shape[1], axis=0)
        order = np.argsort(excess(facet, frames[self.near[place]], *self.size), kind="stable")
        rank = min(1 + int(self.random.exponential(0.4)), len(order) - 1)
        reach = float(self.random.choice([0.1, 0.3, 0.8])) * min(self.size)
        self.near[(over > 0) & (away < reach)] = self.near[place][order[rank]]
        return self.descended(frames, 60)
