"""The postman's route over creases."""

from __future__ import annotations

import functools

import flat_patterns
import numpy as np
import pytest
from flat_patterns import miura
from hypothesis import given, settings
from hypothesis import strategies as st

from miurafab.fabrication.route.postman import find_route, match


def walk(route, a, b, positions, start) -> float:
    """Check that every crease is made once, and return the travel."""
    assert sorted(route.order.tolist()) == list(range(len(a)))
    tails = np.where(route.backwards, b[route.order], a[route.order])
    heads = np.where(route.backwards, a[route.order], b[route.order])
    at = np.concatenate([[start], positions[heads]])
    return float(np.linalg.norm(positions[tails] - at[:-1], axis=1).sum())


def least_travel(a, b, positions, start) -> float:
    """The optimum by dynamic programming over sets of creases and the node arrived at."""
    n = len(a)

    @functools.cache
    def rest(done: int, node: int) -> float:
        here = start if node < 0 else positions[node]
        best = 0.0 if done == (1 << n) - 1 else np.inf
        for k in range(n):
            if not done >> k & 1:
                for entry, leave in ((a[k], b[k]), (b[k], a[k])):
                    way = np.linalg.norm(positions[entry] - here)
                    best = min(best, way + rest(done | 1 << k, int(leave)))
        return best

    return rest(0, -1)


def graph(seed: int, nodes: int, edges: int):
    rng = np.random.default_rng(seed)
    positions = rng.uniform(0, 100, (nodes, 2))
    pairs = {tuple(sorted(rng.choice(nodes, 2, replace=False).tolist())) for _ in range(edges)}
    a, b = np.array(sorted(pairs)).T
    return a, b, positions


@settings(derandomize=True, max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.integers(3, 8), st.integers(1, 8))
def test_small_routes_lie_between_the_bounds_and_the_optimum(seed, nodes, edges):
    a, b, positions = graph(seed, nodes, edges)
    start = np.array([-10.0, -10.0])
    route = find_route(a, b, positions, start)
    travel = walk(route, a, b, positions, start)
    best = least_travel(a, b, positions, start)
    assert travel <= route.legs_mm + 1e-9
    assert route.bound_mm <= best + 1e-9
    assert best <= travel + 1e-9


@pytest.mark.parametrize("size", [3, 5, 7])
def test_small_routes_are_within_2_percent_of_the_optimum_on_average(size):
    start = np.array([-10.0, -10.0])
    total = optimum = 0.0
    for seed in range(40):
        a, b, positions = graph(seed, size, size)
        total += walk(find_route(a, b, positions, start), a, b, positions, start)
        optimum += least_travel(a, b, positions, start)
    assert total <= 1.02 * optimum


def test_the_route_begins_in_the_middle_of_a_stroke_of_creases_if_that_is_near():
    # Two creases from a corner near the start, whose far ends lie close to each other.
    positions = np.array([[0.0, 0.0], [100.0, 2.0], [100.0, -2.0]])
    a, b, start = np.array([0, 0]), np.array([1, 2]), np.array([-1.0, 0.0])
    route = find_route(a, b, positions, start)
    assert walk(route, a, b, positions, start) == pytest.approx(1.0 + 4.0)


@pytest.mark.parametrize(
    "pattern",
    [
        pytest.param(miura(31, 31), id="miura"),
        pytest.param(flat_patterns.fan(40, 25, radius=300.0), id="fan"),
        pytest.param(flat_patterns.triangles(5, 14, 300.0), id="triangles"),
    ],
)
def test_the_route_over_one_pattern_is_the_matching_optimum(pattern):
    creases = np.flatnonzero(pattern.edges_assignment != "B")
    a, b = pattern.edges_vertices[creases].T
    # From a node where the route may begin, so that the way there is not counted.
    start = pattern.vertices_coords[np.flatnonzero(np.bincount(np.append(a, b)) % 2)[0]]
    route = find_route(a, b, pattern.vertices_coords, start)
    travel = walk(route, a, b, pattern.vertices_coords, start)
    assert travel <= route.legs_mm + 1e-9
    assert route.legs_mm <= 1.01 * route.bound_mm


def test_parallel_creases_are_drawn_to_and_fro():
    pattern = miura(30, 1, a=10.0)
    creases = np.flatnonzero(pattern.edges_assignment != "B")
    a, b = pattern.edges_vertices[creases].T
    start = pattern.vertices_coords[1]
    route = find_route(a, b, pattern.vertices_coords, start)
    travel = walk(route, a, b, pattern.vertices_coords, start)
    assert travel == pytest.approx(28 * 10.0)


def test_a_closed_loop_far_from_the_rest_is_joined():
    square = np.array([[0.0, 0], [10, 0], [10, 10], [0, 10]])
    positions = np.concatenate([square, square + 100.0, [[50.0, 50.0], [60.0, 50.0]]])
    a = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8])
    b = np.array([1, 2, 3, 0, 5, 6, 7, 4, 9])
    route = find_route(a, b, positions, np.zeros(2))
    travel = walk(route, a, b, positions, np.zeros(2))
    assert travel <= np.hypot(50, 50) + np.hypot(40, 50) + 15.0


def test_a_closed_loop_needs_no_travel_at_all():
    square = np.array([[0.0, 0], [10, 0], [10, 10], [0, 10]])
    route = find_route(np.array([0, 1, 2, 3]), np.array([1, 2, 3, 0]), square, np.zeros(2))
    assert walk(route, np.array([0, 1, 2, 3]), np.array([1, 2, 3, 0]), square, np.zeros(2)) == 0.0


def test_at_a_crossing_the_route_goes_straight_on():
    ring = np.array([[0.0, 0], [1, 0], [2, 0], [1, -1], [1, 1]])
    a, b = np.array([0, 1, 3, 1, 2, 4]), np.array([1, 2, 1, 4, 3, 0])
    route = find_route(a, b, ring, np.zeros(2))
    order = route.order.tolist()
    assert abs(order.index(0) - order.index(1)) == 1
    assert abs(order.index(2) - order.index(3)) == 1


def test_many_odd_nodes_are_matched_in_parts():
    rng = np.random.default_rng(0)
    positions = rng.uniform(0, 1000, (2600, 2))
    pairs, _ = match(np.arange(2600), positions)
    np.testing.assert_array_equal(np.sort(pairs.ravel()), np.arange(2600))
    length = np.linalg.norm(positions[pairs[:, 0]] - positions[pairs[:, 1]], axis=1).sum()
    # For n random points in an area A the least matching tends to about 0.31 sqrt(n A).
    assert length <= 1.1 * 0.31 * np.sqrt(2600 * 1e6)


def test_no_creases_are_no_route():
    empty = np.empty(0, dtype=np.int64)
    assert len(find_route(empty, empty, np.empty((0, 2)), np.zeros(2)).order) == 0
