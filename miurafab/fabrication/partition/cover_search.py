"""Search for covers with fewer rectangles.

To remove a rectangle, drop one of the three with the fewest exclusively covered facets and relax
the rest (:mod:`~miurafab.fabrication.partition.cover`). If facets remain uncovered, change the
rectangles about such a place at random, with a seeded generator, and relax again, until all facets
are covered or the effort is spent. There are three changes: assign the uncovered facets to another
rectangle, turn a rectangle by a right angle, or move all rectangles within reach at random. Several
starts are followed at the same time, the better starts more often.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from miurafab.fabrication.partition.cover import ENOUGH, UNITS, Relaxation, excess, nearest
from miurafab.geometry.arrays import Floats

_MARGINS_MM = (8.0, 3.0)
"""Margins tried first, every other time."""

_EASED_MM = (8.0, 4.0, 2.0, 1.0)
"""Margins tried once a cover is found."""

_LEAVES, _TRIES = 3, 4
"""The number of rectangles tried for removal, and of starts followed."""


@dataclass
class Chain:
    """One start of a search: its current ``rectangles`` (K, 3) and their L in mm²."""

    rectangles: Floats
    loss: float


class CoverSearch(Relaxation):
    """Searches covers of ``shapes`` (N, c, 2) by rectangles of ``width`` x ``height`` mm."""

    def __init__(self, shapes: Floats, width: float, height: float, seed: int = 0) -> None:
        super().__init__(shapes, width, height)
        self.random = np.random.default_rng(seed)

    def begin(self, rectangles: Floats) -> Chain:
        """A start with ``rectangles`` (K, 3)."""
        return Chain(*self.relax(rectangles))

    def needed(self, rectangles: Floats) -> Floats:
        """(K,) the number of shapes of the sample that each rectangle covers exclusively."""
        near, apart = nearest(self.centres, rectangles, *self.size, 2)
        if near.shape[1] < 2:
            return np.full(len(rectangles), float(len(near)))
        alone = apart.max(axis=1) > -self.radius
        holder = near[np.arange(len(near)), apart.argmin(axis=1)]
        return np.bincount(holder, alone.astype(np.float64), len(rectangles)).astype(np.float64)

    def fewer(self, chains: list[Chain], count: int, effort: float) -> Floats | None:
        """A cover with at most ``count`` rectangles, or None if it takes more than ``effort``.

        The search starts with ``chains`` and reduces every chain to at most ``count`` rectangles.
        """
        end = self.spent + effort
        found = None
        for chain in chains:
            while len(chain.rectangles) > count:
                least = np.argsort(self.needed(chain.rectangles), kind="stable")[:_LEAVES]
                left = [
                    self.relax(np.delete(chain.rectangles, leave, 0), rounds=1) for leave in least
                ]
                chain.rectangles, chain.loss = min(left, key=lambda each: each[1])
            if found is None and len(chain.rectangles) <= count and chain.loss <= ENOUGH:
                chain.rectangles, chain.loss = self.settled(chain.rectangles)
                found = chain.rectangles if chain.loss <= ENOUGH else None
        if found is not None:
            return self._eased(found)
        tries = sorted(
            (chain for chain in chains if len(chain.rectangles) <= count),
            key=lambda each: each.loss,
        )[:_TRIES]
        tries = [Chain(chain.rectangles, chain.loss) for chain in tries]
        fresh = list(tries)
        while tries and self.spent < end:
            margins: tuple[float, ...] = _MARGINS_MM
            if fresh:
                chain = fresh.pop(0)
                moved, loss = self.settled(chain.rectangles, margins)
            else:
                tries.sort(key=lambda each: each.loss)
                chain = tries[min(int(self.random.exponential(1.5)), len(tries) - 1)]
                margins = _MARGINS_MM if self.random.random() < 0.5 else ()
                moved, loss = self.settled(self._shaken(chain.rectangles), margins)
            if loss <= ENOUGH:
                return self._eased(moved)
            if loss < chain.loss or (loss < 1.05 * chain.loss and self.random.random() < 0.3):
                chain.rectangles, chain.loss = moved, loss
        return None

    def _eased(self, rectangles: Floats) -> Floats:
        """The cover with its unused room spread evenly, if it stays a cover."""
        eased, loss = self.settled(rectangles, _EASED_MM)
        return eased if loss <= ENOUGH else rectangles

    def _shaken(self, rectangles: Floats) -> Floats:
        """The rectangles, changed at random about an uncovered place."""
        self.margin = 0.0
        self.look(rectangles)
        _, over = self.least(rectangles)
        weight = np.maximum(over, 0.0) ** 2
        chance = weight / weight.sum() if weight.any() else None
        place = int(self.random.choice(len(over), p=chance))
        spot = self.centres[self.active[place]]
        away = np.linalg.norm(rectangles[:, :2] - spot, axis=1)
        way = self.random.random()
        rectangles = rectangles.copy()
        if way < 0.5:
            return self._taken_over(rectangles, over, place)
        if way < 0.65:
            rectangles[self.random.choice(np.argsort(away, kind="stable")[:8]), 2] += np.pi / 2
            return rectangles
        reach = float(self.random.choice([0.6, 1.2, 2.0])) * max(self.size)
        far = float(self.random.choice([0.003, 0.01, 0.03, 0.1])) * min(self.size)
        near = np.flatnonzero(away < reach)
        rectangles[near] += self.random.normal(size=(len(near), 3)) * far * UNITS
        return rectangles

    def _taken_over(self, rectangles: Floats, over: Floats, place: int) -> Floats:
        """The rectangles after the uncovered facets about the active facet ``place`` are assigned
        to a rectangle other than the nearest.
        """
        spots = self.centres[self.active]
        away = np.linalg.norm(spots - spots[place], axis=1)
        facet = np.repeat(self.corners[self.active[place]][None], self.near.shape[1], axis=0)
        order = np.argsort(excess(facet, rectangles[self.near[place]], *self.size), kind="stable")
        rank = min(1 + int(self.random.exponential(0.4)), len(order) - 1)
        reach = float(self.random.choice([0.1, 0.3, 0.8])) * min(self.size)
        self.near[(over > 0) & (away < reach)] = self.near[place][order[rank]]
        return self.descended(rectangles, 60)
