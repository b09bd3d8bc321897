"""A sheet that is driven and whose facets do not pass through each other.

Springs hold apart what comes near (:mod:`~miurafab.origami.energy.touching`), and the two triangles
at a hinge, whose gap is what is left of the fold angle to half a turn. Both have an energy of the
shape alone, so the work of the load is still what is stored and dissipated more. At rest, in the
folded form, no spring pushes.

Newton's iteration goes from the last state in steps that each are free on their straight way. So
the sheet can come to the next state without passing through itself, though not on one straight way:
where it slides on itself, that would be blocked at once.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.energy.assembly import NO_TOUCH, Touch
from miurafab.origami.energy.continuation import Walk
from miurafab.origami.energy.equilibrium import EquilibriumState, Solution, solve
from miurafab.origami.energy.hinges import hinge_angles
from miurafab.origami.energy.ramp import nearing
from miurafab.origami.energy.touch_pairs import (
    ARMED,
    LEASH,
    LOWER,
    MOST_ARMINGS,
    Contacts,
    LastingPairs,
)
from miurafab.origami.energy.touching import (
    HEIGHT,
    free_way,
    spring_energies,
    spring_slopes,
    touch,
    touch_energy,
)
from miurafab.origami.energy.yielding import YieldingDriven

CLOSING = 0.05
"""Radians to half a turn from which a hinge is pushed back."""
CLOSING_STIFFNESS = 1.0
"""k of that spring, for the length of its hinge: that of a facet."""
SHORTENINGS = 10
"""How often a step is halved that closes a hinge, or that goes too far at once."""


@dataclass(frozen=True, eq=False)
class TouchingDriven(YieldingDriven):
    """A driven model of which all triangles and ``edges`` (E, 2) are held apart."""

    edges: Ints = field(kw_only=True)

    @cached_property
    def contacts(self) -> Contacts:
        """The pairs near each other in the last state on the path."""
        model = self.model
        around = np.concatenate([model.hinges, model.creases])
        found = Contacts(LastingPairs(model.triangles, self.edges, around, model.points))
        found.look(self.rest.points, ARMED)
        return found

    def touch(self, points: Floats, *, stiff: bool = True) -> Touch:
        """The springs of the pairs that touch."""
        sprung = self.contacts.sprung
        return touch(points, sprung, stiff=stiff) if len(sprung.edges) else NO_TOUCH

    def moments(self, angle: Floats, target: float) -> tuple[Floats, Floats]:
        """The moments (H,) at fold angles ``angle`` (H,), and their slopes."""
        moment, stiffness = super().moments(angle, target)
        push, slope = spring_slopes(np.pi - np.abs(angle), *self._closing)
        return moment - np.sign(angle) * push, stiffness + slope

    def stored(self, state: EquilibriumState) -> float:
        """The energy at the last accepted ``state``."""
        gap = np.pi - np.abs(hinge_angles(state.points, self.model.hinges))
        closed = float(spring_energies(gap, *self._closing).sum())
        return super().stored(state) + closed + touch_energy(state.points, self.contacts.sprung)

    def arrive(self, state: EquilibriumState) -> None:
        """Let the hinges slip to their angles at ``state``, and look what is near there."""
        super().arrive(state)
        self.contacts.look(state.points, ARMED)

    def free_part(self, points: Floats, step: Floats) -> float:
        """The part of a ``step`` (V, 3) from ``points`` (V, 3) on which nothing passes through
        anything: neither what is known to be near nor the two sides of a hinge.
        """
        part = free_way(points, step, self.contacts.pairs)
        before = hinge_angles(points, self.model.hinges)
        seen = self.contacts.pairs.seen
        for _ in range(SHORTENINGS):
            after = points + part * step
            turn = hinge_angles(after, self.model.hinges) - before
            turn -= 2 * np.pi * np.round(turn / (2 * np.pi))
            is_open = np.abs(before + turn).max() < np.pi
            if is_open and nearing(seen, after) <= LEASH:
                return part
            part /= 2
        return 0.0

    @cached_property
    def _closing(self) -> tuple[Floats, Floats]:
        """(H,) h and k of the springs between the two sides of hinges."""
        model = self.model
        gap = np.pi - np.abs(hinge_angles(model.points, model.hinges))
        stiffness = CLOSING_STIFFNESS * edge_lengths(model.points, model.hinges[:, :2])
        return np.minimum(CLOSING, LOWER * gap), stiffness


class TouchingWalk(Walk):
    """A way on which nothing passes through anything."""

    driven: TouchingDriven

    def towards(self, drive: float) -> Solution:
        """The equilibrium at ``drive``, with springs between what comes to touch."""
        here, guess = self.start, self.start
        if self.known:
            here, guess = self.last.state, self._predicted(drive)
        step = guess.points - here.points
        part = self.driven.free_part(here.points, step)
        guess = guess._replace(points=here.points + part * step)
        for _ in range(MOST_ARMINGS):
            found = solve(self.driven, guess, drive, self._factored)
            self._factored = found.factored
            if not found.converged or not self.driven.contacts.lacking(found.state.points):
                return found
            self.driven.contacts.arm(found.state.points, HEIGHT)
        return found._replace(converged=False)
