"""Springs between facets that touch: their derivatives, their sides, and what they keep apart."""

from __future__ import annotations

import named_patterns
import numpy as np
import pytest

from miurafab.origami.energy.touching import (
    HEIGHT,
    REACH,
    TouchPairs,
    near_pairs,
    touch,
    touch_energy,
)
from miurafab.origami.folding.angles_csv import contacts
from miurafab.origami.folding.motion import find_motion
from miurafab.origami.folding.ramp_motion import ramp_motion

STENCIL = np.array([[0, 1, 2, 3]])
TRIANGLE = np.array([[1, 2, 3]])


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_forces_and_stiffness_are_the_slopes_of_the_energy(side: float) -> None:
    random = np.random.default_rng(5)
    points = np.array([[0.3, 0.2, 0.4 * side * HEIGHT], [0, 0, 0], [1, 0, 0], [0.1, 1, 0]], float)
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    points = points @ turn.T
    pairs = TouchPairs(STENCIL, np.array([side]), np.array([0.7]))
    h = 1e-6
    step = np.eye(12).reshape(12, 4, 3) * h
    slope = [(touch_energy(points + d, pairs) - touch_energy(points - d, pairs)) for d in step]
    found = touch(points, pairs)
    assert found.forces.ravel() == pytest.approx(np.array(slope) / (2 * h), abs=1e-7)
    bend = [(touch(points + d, pairs).forces - touch(points - d, pairs).forces) for d in step]
    wanted = np.array(bend).reshape(12, 12) / (2 * h)
    stiffness = found.stiffness[0].swapaxes(1, 2).reshape(12, 12)
    assert stiffness == pytest.approx(wanted, abs=1e-5 * np.abs(wanted).max())
    assert (
        np.linalg.eigvalsh(
            touch(points, pairs, definite=True).stiffness[0].swapaxes(1, 2).reshape(12, 12)
        ).min()
        > -1e-9
    )


def test_a_side_is_remembered_and_a_far_vertex_has_none() -> None:
    points = np.array([[0.3, 0.3, 0.1], [0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
    above = near_pairs(points, TRIANGLE, TouchPairs(STENCIL[:0], np.empty(0), np.empty(0)))
    assert above.side.tolist() == [1.0]
    assert above.weight.tolist() == [1.0]
    points[0, 2] = -0.01
    assert near_pairs(points, TRIANGLE, above).side.tolist() == [1.0]
    points[0] = (0.3, -0.05, -0.01)  # half-way out of the widened triangle
    assert near_pairs(points, TRIANGLE, above).weight == pytest.approx([0.5])
    points[0] = (0.3, 0.3, REACH + 0.01)
    assert not len(near_pairs(points, TRIANGLE, above).side)


@pytest.mark.parametrize(("count", "angle", "shrinking"), [(8, 100.0, 1.0), (10, 95.0, 0.93)])
def test_a_roll_comes_to_lie_on_itself(count: int, angle: float, shrinking: float) -> None:
    pattern = named_patterns.roll(count, angle, shrinking)
    assert contacts(ramp_motion(pattern, 10)[0])
    motion, verdict = ramp_motion(pattern, 10, touching=True)
    assert verdict.complete
    assert contacts(motion) == ()


def test_contact_is_taken_up_where_it_is_needed() -> None:
    pattern = named_patterns.yoshimura(4, 2, 150.0)
    without = max(len(contact.facets) for contact in contacts(ramp_motion(pattern, 6)[0]))
    found = find_motion(pattern, 6)
    assert found.verdict is not None
    assert found.verdict.touching
    assert max((len(each.facets) for each in contacts(found.motion)), default=0) < without
    spared = find_motion(named_patterns.waterbomb_base(), 5).verdict
    assert spared is not None
    assert not spared.touching
