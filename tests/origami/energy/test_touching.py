"""Springs between facets that touch: their derivatives, their sides, and what they keep apart."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import named_patterns
import numpy as np
import pytest
from scipy import sparse

from miurafab.geometry import multifrontal
from miurafab.geometry.arrays import Floats
from miurafab.geometry.dissection import Separator, dissect
from miurafab.geometry.sparse import Factor, SymmetricSolver
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.cut_open import cut_open
from miurafab.origami.energy.bar_hinge import BarHingeModel
from miurafab.origami.energy.continuation import follow
from miurafab.origami.energy.equilibrium import COARSEST, TOLERANCE, solve
from miurafab.origami.energy.ramp import Ramped
from miurafab.origami.energy.touch_pairs import PARALLEL, REACH, NearPairs
from miurafab.origami.energy.touching import (
    HEIGHT,
    TouchPairs,
    free_way,
    gaps,
    touch,
    touch_energy,
)
from miurafab.origami.folding.angles_csv import contacts
from miurafab.origami.folding.from_flat import fold_from_flat, ramp_parts
from miurafab.origami.folding.kinematics import CLOSED_FORM, FROM_FLAT, rigid_motion
from miurafab.origami.folding.motion import find_motion
from miurafab.origami.folding.ramp_motion import ramp_motion

NO_EDGES, NO_HINGES = (np.empty((0, k), dtype=np.int64) for k in (2, 4))
TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0.1, 1, 0]], float)
OVER_TRIANGLE = {
    "the inside": (0.3, 0.2, 0.0),
    "a side": (0.3, -0.007, 0.0),
    "the far side": (0.56, 0.51, 0.0),
    "a corner": (-0.005, -0.006, 0.0),
}
OVER_EDGE = {
    "each other": ((0.3, -0.4, 0.0), (0.5, 0.9, 0.0)),
    "an end": ((0.3, 0.036, 0.0), (0.5, 0.9, 0.0)),
    "two ends": ((-0.005, -0.006, 0.0), (-0.5, -0.9, 0.0)),
}
EDGE = np.array([[0, 0, 0], [1, 0.1, 0]], float)


def corners_of(name: str) -> Floats:
    """Two things whose nearest points are on ``name``, at about half of h, in a general place."""
    random = np.random.default_rng(5)
    if name in OVER_TRIANGLE:
        points = np.vstack([[OVER_TRIANGLE[name]], TRIANGLE])
        points[0, 2] += 0.4 * HEIGHT
    else:
        points = np.vstack([EDGE, OVER_EDGE[name]])
        points[2:, 2] += 0.4 * HEIGHT
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    return np.asarray(points @ turn.T + 0.01 * HEIGHT * random.normal(size=(4, 3)))


def pair_at(points: Floats, edges: bool, height: float = HEIGHT, weight: float = 0.7) -> TouchPairs:
    stencils, edge = np.array([[0, 1, 2, 3]]), np.array([edges])
    distance = gaps(points, stencils, edge).distance
    return TouchPairs(stencils, edge, np.array([height]), np.array([weight]), points, distance)


@pytest.mark.parametrize("name", [*OVER_TRIANGLE, *OVER_EDGE])
def test_forces_and_stiffness_are_the_slopes_of_the_energy(name: str) -> None:
    points = corners_of(name)
    pairs = pair_at(points, name in OVER_EDGE)
    h = 1e-7
    step = np.eye(12).reshape(12, 4, 3) * h
    slope = [(touch_energy(points + d, pairs) - touch_energy(points - d, pairs)) for d in step]
    found = touch(points, pairs)
    size = np.abs(found.forces).max()
    assert size > 1e-4
    assert found.forces.ravel() == pytest.approx(np.array(slope) / (2 * h), abs=1e-6 * size)
    assert found.forces.sum(axis=1) == pytest.approx(np.zeros((1, 3)), abs=1e-15)
    bend = [(touch(points + d, pairs).forces - touch(points - d, pairs).forces) for d in step]
    wanted = np.array(bend).reshape(12, 12) / (2 * h)
    stiffness = found.stiffness[0].swapaxes(1, 2).reshape(12, 12)
    assert stiffness == pytest.approx(wanted, abs=1e-5 * np.abs(wanted).max())
    definite = touch(points, pairs, definite=True).stiffness[0].swapaxes(1, 2).reshape(12, 12)
    assert np.linalg.eigvalsh(definite).min() > -1e-9


def test_the_distance_is_the_least_between_any_two_points() -> None:
    """Against many points of both things: never more, and less by no more than their spacing."""
    random = np.random.default_rng(1)
    corners = random.normal(size=(60, 4, 3))
    stencils, edges = np.arange(240).reshape(60, 4), np.arange(60) >= 30
    it = gaps(corners.reshape(-1, 3), stencils, edges)
    part = np.linspace(0.0, 1.0, 101)
    one, other = (grid.ravel() for grid in np.meshgrid(part, part))
    inside = one + other <= 1
    weights = np.stack([1 - one - other, one, other], axis=1)[inside]
    for number, x in enumerate(corners):
        if edges[number]:
            first = x[0] + part[:, None] * (x[1] - x[0])
            second = x[2] + part[:, None] * (x[3] - x[2])
            apart = np.linalg.norm(first[:, None] - second[None], axis=2).min()
        else:
            apart = np.linalg.norm(x[0] - weights @ x[1:], axis=1).min()
        assert it.distance[number] <= apart + 1e-12
        assert it.distance[number] >= apart - 0.05
    u = np.einsum("nk,nkx->nx", it.part, corners)
    assert it.distance == pytest.approx(np.linalg.norm(u, axis=1), abs=1e-12)


def test_a_step_ends_before_anything_passes_through_anything() -> None:
    """Random steps of random things: along the free part no distance falls to nothing; a step
    whose whole way is followed at 500 places and keeps its distance is free.
    """
    random = np.random.default_rng(3)
    free = blocked = 0
    for number in range(120):
        points = random.normal(size=(4, 3))
        step = random.normal(size=(4, 3)) * random.choice([0.3, 1.0, 3.0])
        pairs = pair_at(points, number % 2 == 1)
        way = free_way(points, step, pairs)
        at = np.linspace(0.0, 1.0, 501)
        places = (points + at[:, None, None] * step).reshape(-1, 3)
        stencils = np.arange(len(places)).reshape(-1, 4)
        along = gaps(places, stencils, np.full(len(at), number % 2 == 1)).distance
        assert along[at <= way].min() >= 0.19 * along[0]
        if along.min() >= 0.35 * along[0]:
            assert way == 1.0
            free += 1
        else:
            blocked += way < 1.0
    assert free >= 20
    assert blocked >= 8
    through = np.array([[0.3, 0.3, 0.1], *TRIANGLE])
    down = np.zeros((4, 3))
    down[0, 2] = -0.2
    assert 0.3 < free_way(through, down, pair_at(through, False)) <= 0.4
    assert free_way(through, 50 * np.tile(down[:1], (4, 1)), pair_at(through, False)) == 1.0
    through[0, 2] = 1e-3
    along = np.zeros((4, 3))
    along[0] = 0.3, 0.1, -2e-4
    assert free_way(through, along, pair_at(through, False)) == 1.0


@pytest.mark.parametrize("sine", [1e-6, 1e-5, 1e-4, 1e-3, 1e-2])
def test_edges_that_are_nearly_parallel_neither_pass_nor_stick(sine: float) -> None:
    """The direction of their distance is known to few digits."""
    random = np.random.default_rng(2)
    for _ in range(60):
        gap, shift = 10 ** random.uniform(-4, -1.5), random.uniform(-0.4, 0.4)
        across = sine / 2
        points = np.array([[-0.5, 0, 0], [0.5, 0, 0], [-0.5, -across, gap], [0.5, across, gap]])
        points[2:, 0] += shift
        step = np.zeros((4, 3))
        speed = gap * 10 ** random.uniform(-0.5, 1, 4) * random.choice([-1, 1], 4)
        step[:, 2] = speed * [1, 1, -1, -1]
        at = shift + 0.5
        nearer = step[:2, 2] @ [1 - at, at] - step[2:, 2].mean()
        turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
        placed = points @ turn.T + random.normal(size=3)
        way = free_way(placed, step @ turn.T, pair_at(placed, True))
        assert way > 1e-3
        assert gap - way * nearer > 0


FAN = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]])
FAN_BARS = np.array([[0, 1], [0, 2], [0, 3], [0, 4], [1, 2], [2, 3], [3, 4], [4, 1]])
FAN_HINGES = np.array([[0, 2, 3, 1], [0, 3, 4, 2], [0, 4, 1, 3], [0, 1, 2, 4]])


def fan(rest: list[float], last: float = 1.0) -> BarHingeModel:
    """Four triangles about a vertex; the last corner lies so far from it."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -last, 0]])
    lengths = np.linalg.norm(points[FAN_BARS[:, 0]] - points[FAN_BARS[:, 1]], axis=1)
    return BarHingeModel(
        points, FAN_BARS, lengths, 0.1 * lengths, FAN_HINGES, np.full(4, 0.01), np.array(rest),
        creases=FAN_HINGES, triangles=FAN,
    )  # fmt: skip


def test_what_was_not_iterated_is_no_balance_however_thin_a_facet_is() -> None:
    """Only where no step lowers the forces any more, what is left may be rounding."""
    ramped = Ramped(fan([3.0, 0, 0, 0], last=1e-6))
    assert ramped.tolerance == COARSEST
    start = ramped.state(ramped.model.points)
    assert TOLERANCE < ramped.size(ramped.residual(start, 1e-9)) < COARSEST
    assert not solve(ramped, start, 1e-9, factors=0).converged


def test_the_stiffness_of_what_touches_counts_between_neighbours_too() -> None:
    """All corners of two opposite edges about a vertex are joined by bars and hinges anyway."""
    model = fan([3.0, 3, 3, -3])
    near = np.array(
        [[0, 0, 0], [0, 0.3, 0.9], [0, -0.3, 0.2], [0.012, -0.3, 0.9], [0.01, 0.3, 0.2]]
    )
    pairs = NearPairs(FAN, FAN_BARS, FAN_HINGES, model.points).at(near)
    ramped = Ramped(model).with_pairs(pairs)
    assert pairs.stencils[pairs.touching(near)[0]].tolist() == [[1, 2, 3, 4]]
    ramped.accept(near)
    matrix = ramped.stiffness(ramped.state(near), 1.0).toarray()
    e, slopes = 1e-6, np.zeros_like(matrix)
    for column, place in enumerate(ramped.assembly.free):
        forces = []
        for way in (e, -e):
            moved = near.copy()
            moved.ravel()[place] += way
            forces.append(ramped.residual(ramped.state(moved), 1.0).force)
        slopes[:, column] = (forces[0] - forces[1]) / (2 * e)
    np.testing.assert_allclose(matrix, slopes, atol=1e-6)


def test_what_was_far_from_each_other_is_found_when_it_comes_near() -> None:
    points = np.array([[0.3, 0.3, 1.0], *TRIANGLE])
    pairs = pair_at(points, False)
    assert not len(pairs.touching(points)[0])
    points = points - [[0, 0, 1.0 - 0.5 * HEIGHT], *np.zeros((3, 3))]
    assert len(pairs.touching(points)[0]) == 1
    assert touch_energy(points, pairs) > 0


def test_pairs_are_those_within_reach_that_no_sides_join() -> None:
    """A vertex over a triangle, and two triangles with a common side, folded onto each other."""
    flat = np.array([[0.3, 0.3, 9.0], *TRIANGLE])
    near = NearPairs(np.array([[1, 2, 3]]), NO_EDGES, NO_HINGES, flat)
    points = flat.copy()
    points[0, 2] = 0.9 * REACH
    assert near.at(points).distance == pytest.approx([0.9 * REACH])
    points[0, 2] = 1.1 * REACH
    assert not len(near.at(points).edges)
    shape = np.array([[0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.5, 1, 0.01]], float)
    triangles = np.array([[0, 1, 2], [1, 0, 3]])
    sides = np.array([[0, 1], [1, 2], [2, 0], [0, 3], [3, 1]])
    assert not len(NearPairs(triangles, sides, np.array([[0, 1, 2, 3]]), shape).at(shape).edges)


def test_pairs_of_any_sizes_are_found_as_by_trying_all() -> None:
    """Few long edges and large triangles among short and small ones; all vertices move at random,
    so that of two edges the other may become the longer one.
    """
    random = np.random.default_rng(3)
    corners_of = [2] * 20 + [3] * 20
    size = np.repeat(10 ** random.uniform(-1.5, 0.5, 40), corners_of)[:, None]
    middle = np.repeat(random.uniform(0, 1, (40, 3)), corners_of, axis=0)
    flat = middle + size * random.uniform(-0.5, 0.5, (100, 3))
    points = flat + 0.05 * random.normal(size=(100, 3))
    edges, triangles = np.arange(40).reshape(-1, 2), np.arange(40, 100).reshape(-1, 3)
    corners = [[v, *triangle] for v in range(100) for triangle in triangles if v not in triangle]
    ends = [[*edges[one], *edges[other]] for one in range(20) for other in range(one + 1, 20)]
    stencils = np.array(corners + ends)
    crossing = np.arange(len(stencils)) >= len(corners)
    apart = gaps(points, stencils, crossing).distance
    height = np.minimum(HEIGHT, 0.5 * gaps(flat, stencils, crossing).distance)
    wanted = {tuple(stencils[n]): (apart[n], height[n]) for n in np.flatnonzero(apart <= REACH)}
    found = NearPairs(triangles, edges, NO_HINGES, flat).at(points)
    assert len(found.edges) == len(wanted) > 100
    assert sum(low < HEIGHT for _, low in wanted.values()) > 5
    for row, distance, low in zip(found.stencils, found.distance, found.height, strict=True):
        assert wanted[tuple(row)] == pytest.approx((distance, low))


def test_parallel_edges_push_less_than_edges_that_cross() -> None:
    far = [[9, 9, 9], [9, 8, 9], [8, 9, 9]]
    flat = np.array([[0, 0, 0], [1, 0, 0], [0, 5, 0], [1, 5, 0], *far], float)
    near = NearPairs(np.array([[4, 5, 6]]), np.array([[0, 1], [2, 3]]), NO_HINGES, flat)
    points = flat.copy()
    points[2:4] = ((0.5, -0.5, 0.01), (0.5, 0.5, 0.01))
    assert near.at(points).weight.tolist() == [1.0]
    points[2:4] = ((0.0, 0.0, 0.01), (1.0, 0.0, 0.01))
    assert near.at(points).weight.tolist() == [PARALLEL]


def test_what_is_near_in_the_flat_sheet_does_not_push() -> None:
    flat = np.array([[0.3, -0.5 * HEIGHT, 0.0], *TRIANGLE])
    near = NearPairs(np.array([[1, 2, 3]]), NO_EDGES, NO_HINGES, flat)
    pairs = near.at(flat)
    assert pairs.height == pytest.approx([0.25 * HEIGHT])
    assert touch_energy(flat, pairs) == 0.0


def piercings(pattern: CreasePattern, steps: int, *, touching: bool, error: float = 180) -> int:
    motion, verdict = ramp_motion(pattern, steps, touching=touching)
    if touching:
        assert verdict.complete
        assert not verdict.unstable.any()
        assert verdict.strain.max() <= 1e-11
        assert math.degrees(verdict.angle_error) <= error
    return max((len(each.facets) for each in contacts(motion)), default=0)


Closing = tuple[Callable[[], CreasePattern], int, float]
CLOSING: dict[str, Closing] = {
    "spiral": (lambda: named_patterns.roll(10, 95.0, 0.93), 10, 2.0),
    "Yoshimura": (lambda: named_patterns.yoshimura(4, 2, 150.0), 6, 45.0),
    "Kresling": (lambda: named_patterns.kresling(8, 4, 120.0), 10, 6.0),
}
CLOSING_FAR: dict[str, Closing] = {
    "roll": (lambda: named_patterns.roll(8, 100.0), 20, 14.0),
    "Yoshimura": (lambda: named_patterns.yoshimura(8, 8, 60.0), 20, 10.0),
    "Yoshimura, farther": (lambda: named_patterns.yoshimura(8, 8, 72.0), 20, 16.0),
}
"""Patterns, steps, and the mean distance from the fold angles, degrees, that is not exceeded."""


@pytest.mark.parametrize("name", CLOSING)
def test_a_sheet_that_closes_on_itself_is_held_off(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What touches may change with every step, but seldom does the order of elimination."""
    orders = []

    def counted(pattern: sparse.csc_array) -> list[Separator]:
        orders.append(pattern.nnz)
        return dissect(pattern)

    make, steps, error = CLOSING[name]
    assert piercings(make(), steps, touching=False) > 0
    monkeypatch.setattr(multifrontal, "dissect", counted)
    assert piercings(make(), steps, touching=True, error=error) == 0
    assert len(orders) <= 5


@pytest.mark.large
@pytest.mark.parametrize("name", CLOSING_FAR)
def test_larger_sheets_are_held_off_as_well(name: str) -> None:
    make, steps, error = CLOSING_FAR[name]
    assert piercings(make(), steps, touching=False) > 0
    assert piercings(make(), steps, touching=True, error=error) == 0


def test_a_sheet_that_touches_nowhere_goes_its_way_at_the_same_cost(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The same frames, by as many factorisations."""
    made = []
    factor = SymmetricSolver.factor

    def counted(solver: SymmetricSolver, matrix: sparse.csc_array) -> Factor:
        made.append(matrix.shape)
        return factor(solver, matrix)

    monkeypatch.setattr(SymmetricSolver, "factor", counted)
    pattern = named_patterns.miura(4)
    free = ramp_motion(pattern, 6)[0]
    without = len(made)
    held = ramp_motion(pattern, 6, touching=True)[0]
    assert held.frames == pytest.approx(free.frames, abs=1e-9)
    assert without < len(made) <= 2 * without


def test_the_two_sides_of_a_cut_do_not_hold_the_sheet() -> None:
    """They lie on each other in the flat sheet, from where "it could not be followed to its first
    position" with contact.
    """
    whole = named_patterns.kresling(8, 4, 120.0)
    inner = np.flatnonzero((whole.edges_faces >= 0).all(axis=1))
    letters = whole.edges_assignment.copy()
    letters[inner[len(inner) // 3]] = "C"
    sheet = cut_open(replace(whole, edges_assignment=letters))
    assert piercings(sheet, 5, touching=False) > 0
    assert piercings(sheet, 5, touching=True, error=8.0) == 0


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
    hinges = np.concatenate([model.hinges, model.creases])
    near = NearPairs(model.triangles, pattern.edges_vertices, hinges, model.points)
    ramped = Ramped(model)
    shapes = [frame.points @ ramped.axes for frame in path.frames]
    for points in shapes:
        ramped.accept(points)
    ramped = ramped.with_pairs(near.at(shapes[-1]))
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
