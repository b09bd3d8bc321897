"""The cycles of a pull, state by state: out to the largest extension, and back to no force."""

from __future__ import annotations

import math

import numpy as np

from miurafab.geometry.arrays import Floats
from miurafab.origami.energy.continuation import Known, Progress, Walk, without_load
from miurafab.origami.energy.yielding import YieldingDriven


class PullCycles:
    """The cycles of one sheet as they are walked; ``rows`` hold what each state was."""

    def __init__(
        self,
        driven: YieldingDriven,
        walk: Walk,
        strain: float,
        steps: int,
        cycles: int,
        on_progress: Progress | None,
    ) -> None:
        self.driven, self.strain, self.on_progress = driven, strain, on_progress
        self.first = driven.value(driven.model.points)
        self.drives = self.first * (1 + strain * np.linspace(0, 1, steps + 1))
        self.outward = math.copysign(1.0, strain)
        self.count = cycles
        self.walk = walk
        self.rows: list[tuple[float, ...]] = []
        self.shapes: list[Floats] = []

    def run(self) -> bool:
        """Whether all cycles were walked to their end."""
        return all(self._out(c) and self._back(c) for c in range(1, self.count + 1))

    def _out(self, cycle: int) -> bool:
        start = -math.inf if cycle == 1 else self.outward * self.walk.last.drive
        if cycle > 1:
            self.walk.turn()
            self._note(cycle, True)
        for drive in self.drives[self.outward * self.drives > start]:
            if not self.walk.to(float(drive)):
                return False
            self._note(cycle, True)
        return True

    def _back(self, cycle: int) -> bool:
        """Back until there is no force left."""
        self.walk.turn()
        step = abs(self.drives[-1] - self.drives[-2])
        while self.outward * self._load() > 0:
            drive = self.walk.last.drive - self.outward * step
            met = self.walk.towards(drive)
            if not met.converged:
                if not self.walk.to(drive):
                    return False
            elif self.outward * self.driven.load(met.state, drive) > 0:
                self.walk.take(Known(drive, met.state))
            else:
                left, right = self.walk.last, Known(drive, met.state)
                self.walk.take(without_load(self.driven, left, right, self.walk.towards))
                self._note(cycle, False)
                break
            self._note(cycle, False)
        return True

    def _load(self) -> float:
        return self.driven.load(self.walk.last.state, self.walk.last.drive)

    def _note(self, cycle: int, loading: bool) -> None:
        drive, state = self.walk.last
        lost = sum(self.driven.spent)
        load, stored = self._load(), self.driven.stored(state)
        self.rows.append((cycle, loading, drive, load, stored, lost))
        self.shapes.append(state.points)
        if self.on_progress is not None:
            share = (cycle - 1 + 0.5 * (not loading)) / self.count
            self.on_progress(share, f"cycle {cycle} of {self.count}")
