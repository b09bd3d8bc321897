"""Springs between facets that touch: their derivatives, their sides, and what they keep apart."""

from __future__ import annotations

from collections.abc import Callable

import named_patterns
import numpy as np
import pytest

from miurafab.geometry.arrays import Floats
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.continuation import follow
from miurafab.origami.energy.equilibrium import solve
from miurafab.origami.energy.ramp import Ramped
from miurafab.origami.energy.touch_pairs import REACH, NearPairs
from miurafab.origami.energy.touching import HEIGHT, TouchPairs, over, touch, touch_energy
from miurafab.origami.folding.angles_csv import contacts
from miurafab.origami.folding.from_flat import fold_from_flat, ramp_parts
from miurafab.origami.folding.kinematics import CLOSED_FORM, FROM_FLAT, rigid_motion
from miurafab.origami.folding.motion import find_motion
from miurafab.origami.folding.ramp_motion import ramp_motion

STENCIL = np.array([[0, 1, 2, 3]])
OVER_TRIANGLE = np.array([[0.3, 0.2, 0.4 * HEIGHT], [0, 0, 0], [1, 0, 0], [0.1, 1, 0]], float)
OVER_EDGE = np.array(
    [[0, 0, 0], [1, 0.1, 0], [0.3, -0.4, 0.4 * HEIGHT], [0.5, 0.9, 0.4 * HEIGHT]], float
)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("points", [OVER_TRIANGLE, OVER_EDGE], ids=["triangle", "edge"])
def test_forces_and_stiffness_are_the_slopes_of_the_energy(points: Floats, side: float) -> None:
    random = np.random.default_rng(5)
    edges = np.array([points is OVER_EDGE])
    points = points * (1.0, 1.0, side)
    height = over(points, STENCIL, edges).height[0]
    side *= np.sign(height * side)  # of the pair, whichever way its normal points
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    points = points @ turn.T + 0.01 * HEIGHT * random.normal(size=(4, 3))
    pairs = TouchPairs(STENCIL, edges, np.array([side]), np.array([0.7]))
    h = 1e-6
    step = np.eye(12).reshape(12, 4, 3) * h
    slope = [(touch_energy(points + d, pairs) - touch_energy(points - d, pairs)) for d in step]
    found = touch(points, pairs)
    assert np.abs(found.forces).max() > 0.01
    assert found.forces.ravel() == pytest.approx(np.array(slope) / (2 * h), abs=1e-7)
    bend = [(touch(points + d, pairs).forces - touch(points - d, pairs).forces) for d in step]
    wanted = np.array(bend).reshape(12, 12) / (2 * h)
    stiffness = found.stiffness[0].swapaxes(1, 2).reshape(12, 12)
    assert stiffness == pytest.approx(wanted, abs=1e-5 * np.abs(wanted).max())
    definite = touch(points, pairs, definite=True).stiffness[0].swapaxes(1, 2).reshape(12, 12)
    assert np.linalg.eigvalsh(definite).min() > -1e-9


def test_a_side_is_remembered_and_a_far_vertex_has_none() -> None:
    points = np.array([[0.3, 0.3, 0.1], [0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
    near = NearPairs(np.array([[1, 2, 3]]), np.empty((0, 2), dtype=np.int64), 4)
    near.look(points)
    assert near.pairs.side.tolist() == [1.0]
    assert near.pairs.weight.tolist() == [1.0]
    assert not near.within(points, HEIGHT).any()
    points[0, 2] = -0.01
    assert near.within(points, 0.0).all()
    near.look(points)
    assert near.pairs.side.tolist() == [1.0]
    points[0] = (0.3, -0.05, -0.01)  # half-way out of the widened triangle
    near.look(points)
    assert near.pairs.weight == pytest.approx([0.5])
    points[0] = (0.3, 0.3, REACH + 0.01)
    near.look(points)
    assert not len(near.pairs.side)


def test_two_edges_have_a_side_where_they_cross_and_none_where_they_are_parallel() -> None:
    far = [[9, 9, 9], [9, 8, 9], [8, 9, 9]]
    points = np.array([[0, 0, 0], [1, 0, 0], [0.5, -0.5, 0.1], [0.5, 0.5, 0.1], *far], float)
    near = NearPairs(np.array([[4, 5, 6]]), np.array([[0, 1], [2, 3]]), 7)
    near.look(points)
    assert near.pairs.edges.tolist() == [True]
    assert near.pairs.weight.tolist() == [1.0]
    points[2:4, 2] = -0.01
    assert near.within(points, 0.0).all()
    near.look(points)
    assert near.within(points, 0.0).all()  # the side is that of before
    points[2:4] = ((0.0, 0.01, 0.01), (1.0, -0.01, 0.01))
    near.look(points)
    assert not len(near.pairs.side)


def test_what_comes_from_beside_has_no_side_yet() -> None:
    points = np.array([[0.3, -0.05, 0.02], [0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
    near = NearPairs(np.array([[1, 2, 3]]), np.empty((0, 2), dtype=np.int64), 4)
    near.look(points)
    assert not len(near.pairs.side)
    near.look(points, beside=True)
    assert near.pairs.side.tolist() == [1.0]


def test_what_sides_join_is_no_pair() -> None:
    """Two triangles with a common side, folded onto each other: their hinge holds them apart."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.5, 1, 0.01]], float)
    triangles = np.array([[0, 1, 2], [1, 0, 3]])
    edges = np.array([[0, 1], [1, 2], [2, 0], [0, 3], [3, 1]])
    near = NearPairs(triangles, edges, 4)
    near.look(points, beside=True)
    assert not len(near.pairs.side)


def piercings(pattern: CreasePattern, steps: int, *, touching: bool) -> int:
    motion, verdict = ramp_motion(pattern, steps, touching=touching)
    assert not touching or not verdict.unstable.any()
    return max((len(each.facets) for each in contacts(motion)), default=0)


CLOSING: dict[str, tuple[Callable[[], CreasePattern], int]] = {
    "spiral": (lambda: named_patterns.roll(10, 95.0, 0.93), 10),
    "Yoshimura": (lambda: named_patterns.yoshimura(4, 2, 150.0), 6),
    "Kresling": (lambda: named_patterns.kresling(8, 4, 120.0), 10),
}
CLOSING_FAR: dict[str, tuple[Callable[[], CreasePattern], int]] = {
    "roll": (lambda: named_patterns.roll(8, 100.0), 10),
    "Yoshimura": (lambda: named_patterns.yoshimura(8, 8, 60.0), 20),
    "Yoshimura, farther": (lambda: named_patterns.yoshimura(8, 8, 72.0), 20),
}


@pytest.mark.parametrize("name", CLOSING)
def test_a_sheet_that_closes_on_itself_is_held_off(name: str) -> None:
    make, steps = CLOSING[name]
    assert piercings(make(), steps, touching=False) > 0
    assert piercings(make(), steps, touching=True) == 0


@pytest.mark.large
@pytest.mark.parametrize("name", CLOSING_FAR)
def test_larger_sheets_are_held_off_as_well(name: str) -> None:
    make, steps = CLOSING_FAR[name]
    assert piercings(make(), steps, touching=False) > 0
    assert piercings(make(), steps, touching=True) == 0


def test_a_sheet_that_touches_nowhere_goes_its_way() -> None:
    pattern = named_patterns.miura(4)
    free, held = (ramp_motion(pattern, 6, touching=touching)[0] for touching in (False, True))
    assert held.frames == pytest.approx(free.frames, abs=1e-9)


def test_contact_is_taken_up_where_it_is_needed() -> None:
    found = find_motion(named_patterns.yoshimura(4, 2, 150.0), 6)
    assert found.verdict is not None
    assert found.verdict.touching
    assert contacts(found.motion) == ()
    spared = find_motion(named_patterns.waterbomb_base(), 5).verdict
    assert spared is not None
    assert not spared.touching


def test_a_strip_whose_closed_form_passes_through_itself_goes_another_way() -> None:
    pattern = named_patterns.roll(10, 95.0, 0.93)
    assert contacts(rigid_motion(pattern, [0.0, 0.5, 1.0]))
    found = find_motion(pattern, 10)
    assert found.motion.method == FROM_FLAT
    assert contacts(found.motion) == ()
    assert find_motion(named_patterns.roll(2, 80.0), 4).motion.method == CLOSED_FORM


def touching_spiral() -> tuple[Ramped, list[Floats], Floats]:
    """A spiral that comes to lie on itself, with its springs as they are remembered; the shapes of
    its path, and their parts of the ramp.
    """
    pattern = named_patterns.roll(10, 105.0, 0.93)
    path = fold_from_flat(pattern, ramp_parts(pattern, 20), touching=True)
    model = path.model
    near = NearPairs(model.triangles, pattern.edges_vertices, len(model.points))
    ramped = Ramped(model)
    shapes = [frame.points @ ramped.axes for frame in path.frames]
    for points in shapes:
        near.look(points)
        ramped.accept(points)
    ramped = ramped.with_pairs(near.pairs)
    return ramped, shapes, np.array([frame.part for frame in path.frames])


def test_the_work_of_the_ramp_is_the_energy_to_second_order_with_contact() -> None:
    """dE / dt = -sum k rho_0 (rho - t rho_0) in balance; and the way back leads to the start."""
    ramped, shapes, parts = touching_spiral()
    rest, k = ramped.model.rest, ramped.model.stiffness

    def energy_and_slope(points: Floats, part: float) -> tuple[float, float]:
        turned = ramped.angles(points) - part * rest
        return ramped.energy(points, part), -float((k * rest) @ turned)

    last = solve(ramped, ramped.state(shapes[-1]), parts[-1]).state
    ends = [parts[-1], parts[-1] - 0.03]
    errors = []
    for steps in (5, 10, 20):
        goals = np.linspace(*ends, steps + 1)
        there = follow(ramped, last, goals)
        assert len(there) == len(goals)
        told = np.array([energy_and_slope(s.points, t) for s, t in zip(there, goals, strict=True)])
        change = np.trapezoid(told[:, 1], goals)
        errors.append(abs(told[-1, 0] - told[0, 0] - change) / np.ptp(told[:, 0]))
    assert touch_energy(last.points, ramped.pairs) > 1e-3 * told[0, 0]
    assert errors[-1] <= 2e-4
    assert errors[0] >= 3 * errors[1] >= 9 * errors[2]
    back = follow(ramped, there[-1], goals[::-1])
    assert ramped.energy(back[-1].points, ends[0]) == pytest.approx(told[0, 0], rel=1e-10)
