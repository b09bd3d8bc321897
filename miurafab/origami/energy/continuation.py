"""Equilibria along a row of drives: each state predicts the next, which the solver corrects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from miurafab.geometry.arrays import Floats
from miurafab.origami.energy.equilibrium import Balance, EquilibriumState, Factored, solve

Progress = Callable[[float, str], None]

HISTORY = 4
"""The number of states for the prediction: a cubic through the last four."""
MAX_HALVINGS = 7


class Known(NamedTuple):
    """A state in equilibrium and its drive."""

    drive: float
    state: EquilibriumState


def follow(
    driven: Balance, start: EquilibriumState, drives: Floats, on_progress: Progress | None = None
) -> list[EquilibriumState]:
    """The equilibria at ``drives`` (n,), the first of them near ``start``.

    The polynomial through the last four states predicts the next. A step that does not converge is
    halved, up to seven times; if that fails, the list is shorter than ``drives``.
    """
    known: list[Known] = []
    states: list[EquilibriumState] = []
    factored: Factored | None = None
    for number, drive in enumerate(drives):
        goals = [float(drive)]
        while goals:
            guess = extrapolate(known, goals[-1]) if known else start
            solution = solve(driven, guess, goals[-1], factored)
            factored = solution.factored
            if solution.converged:
                new = Known(goals.pop(), solution.state)
                known = [*(k for k in known[1 - HISTORY :] if k.drive != new.drive), new]
            elif known and len(goals) <= MAX_HALVINGS:
                goals.append((known[-1].drive + goals[-1]) / 2)
            else:
                return states
        states.append(known[-1].state)
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
