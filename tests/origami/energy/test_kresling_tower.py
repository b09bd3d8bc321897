"""A closed Kresling storey with elastic creases: two stable states, and a saddle between them."""

from __future__ import annotations

import numpy as np
import pytest
from energy_problems import APEX, HEIGHT, SIDES, kresling, kresling_other_state

from miurafab.origami.energy.continuation import follow
from miurafab.origami.energy.driven import Driven
from miurafab.origami.energy.equilibrium import Balance, EquilibriumState, solve
from miurafab.origami.folding.ramp_walk import unstable_directions


def height(state: EquilibriumState) -> float:
    """The distance of the two rings."""
    tips = state.points[[2 * SIDES, 2 * SIDES + 1]]
    return float(np.linalg.norm(tips[1] - tips[0])) - 2 * APEX


def test_a_closed_storey_with_compliant_bars_has_two_stable_states() -> None:
    model = kresling(1e-3)
    other, _ = kresling_other_state()
    driven = Driven(model, np.array([2 * SIDES, 2 * SIDES + 1]))
    free = Balance(model)  # nothing is held
    heights = np.linspace(HEIGHT, other, 31)
    way = follow(driven, driven.rest, heights + 2 * APEX)
    energies = np.array([model.energy(state.points) for state in way])
    for end, wanted in ((way[0], HEIGHT), (way[-1], other)):
        found = solve(free, end._replace(mu=0.0), 0.0)
        assert found.converged
        assert height(found.state) == pytest.approx(wanted, abs=1e-6)
        assert model.energy(found.state.points) <= 1e-15 * energies.max()
        assert unstable_directions(free, found.state, 0.0) == 0
    top = way[int(np.argmax(energies))]._replace(mu=0.0)
    saddle = solve(free, top, 0.0)
    assert saddle.converged
    assert other < height(saddle.state) < HEIGHT
    assert unstable_directions(free, saddle.state, 0.0) == 1
    assert model.energy(saddle.state.points) >= energies.max()
