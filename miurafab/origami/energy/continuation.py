"""Equilibria along a row of drives: each state predicts the next, which the solver corrects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from miurafab.geometry.arrays import Floats
from miurafab.origami.energy.driven import Driven
from miurafab.origami.energy.equilibrium import (
    Balance,
    EquilibriumState,
    Factored,
    Solution,
    solve,
)

Progress = Callable[[float, str], None]

HISTORY = 4
"""The states of a prediction that cannot be tested: a cubic through the last four."""
LONGEST = 9
"""The most states that a prediction is made of."""
MAX_HALVINGS = 7
MAX_FALSI = 30
ZERO_LOAD = 1e-9
"""The load at a state without load, over the largest of its neighbours."""


class Known(NamedTuple):
    """A state in equilibrium and its drive."""

    drive: float
    state: EquilibriumState


class Walk:
    """A way along equilibria of ``driven``, from ``start``; it holds the last states."""

    def __init__(self, driven: Balance, start: EquilibriumState) -> None:
        self.driven, self.start = driven, start
        self.known: list[Known] = []
        self._factored: Factored | None = None

    @property
    def last(self) -> Known:
        """Where the way has come to."""
        return self.known[-1]

    def to(self, drive: float) -> bool:
        """Go on to ``drive``; whether it was reached.

        A step that does not converge is halved, up to seven times.
        """
        goals = [drive]
        while goals:
            solution = self.towards(goals[-1])
            if solution.converged:
                self.take(Known(goals.pop(), solution.state))
            elif self.known and len(goals) <= MAX_HALVINGS:
                goals.append((self.last.drive + goals[-1]) / 2)
            else:
                return False
        return True

    def towards(self, drive: float) -> Solution:
        """The equilibrium at ``drive`` in one step, without going there."""
        guess = self._predicted(drive) if self.known else self.start
        solution = solve(self.driven, guess, drive, self._factored)
        self._factored = solution.factored
        return solution

    def take(self, new: Known) -> None:
        """Go to ``new``, which is in equilibrium."""
        self.driven.arrive(new.state)
        self.known = [*(k for k in self.known[-LONGEST:] if k.drive != new.drive), new]

    def _predicted(self, drive: float) -> EquilibriumState:
        """The state at ``drive`` after the polynomial through the last states; through as many of
        them as would have predicted the last one best.
        """
        *before, last = self.known
        best, least = HISTORY, np.inf
        for count in range(2, len(before) + 1):
            missed = extrapolate(before[-count:], last.drive).points - last.state.points
            miss = np.abs(missed).max()
            if miss < least:
                best, least = count, miss
        return extrapolate(self.known[-best:], drive)

    def turn(self) -> None:
        """Turn back: earlier states predict nothing of what follows."""
        self.known = self.known[-1:]


def follow(
    driven: Balance, start: EquilibriumState, drives: Floats, on_progress: Progress | None = None
) -> list[EquilibriumState]:
    """The equilibria at ``drives`` (n,), the first of them near ``start``.

    If one cannot be reached (:meth:`Walk.to`), the list is shorter than ``drives``.
    """
    walk, states = Walk(driven, start), []
    for number, drive in enumerate(drives):
        if not walk.to(float(drive)):
            break
        states.append(walk.last.state)
        if on_progress is not None:
            on_progress((number + 1) / len(drives), f"step {number} of {len(drives) - 1}")
    return states


def extrapolate(known: Sequence[Known], drive: float) -> EquilibriumState:
    """The polynomial through ``known`` states (Lagrange) at ``drive``."""
    at = np.array([k.drive for k in known])
    guess = EquilibriumState(np.zeros(()), np.zeros(()), 0.0)
    for i, k in enumerate(known):
        others = np.delete(at, i)
        guess = guess.plus(k.state, float(np.prod((drive - others) / (at[i] - others))))
    return guess


def between(driven: Balance, known: Sequence[Known]) -> Callable[[float], Solution]:
    """What finds the equilibrium at a drive between ``known`` states."""
    factored: Factored | None = None

    def towards(drive: float) -> Solution:
        nonlocal factored
        solution = solve(driven, extrapolate(known, drive), drive, factored)
        factored = solution.factored
        return solution

    return towards


def without_load(
    driven: Driven, left: Known, right: Known, towards: Callable[[float], Solution]
) -> Known:
    """The state without load between ``left`` and ``right``, by regula falsi (Illinois).

    ``towards`` finds the state at a drive between theirs.
    """
    a, b = ((known.drive, driven.load(known.state, known.drive)) for known in (left, right))
    scale = max(abs(a[1]), abs(b[1]))
    best = left if abs(a[1]) < abs(b[1]) else right
    load = min(a[1], b[1], key=abs)
    for _ in range(MAX_FALSI):
        if abs(load) <= ZERO_LOAD * scale:
            break
        drive = (a[0] * b[1] - b[0] * a[1]) / (b[1] - a[1])
        solution = towards(drive)
        if not solution.converged:
            break
        load = driven.load(solution.state, drive)
        best = Known(drive, solution.state)
        a = (a[0], a[1] / 2) if (load < 0) == (b[1] < 0) else b
        b = (drive, load)
    return best


def named(on_progress: Progress | None, way: str) -> Progress | None:
    """``on_progress`` of a further ``way``, whose steps are counted anew."""
    if on_progress is None:
        return None
    return lambda part, text: on_progress(part, f"{way}, {text}")
