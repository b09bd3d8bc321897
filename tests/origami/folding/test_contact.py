"""Collisions against an oracle that knows no special case, and against patterns broken by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from problems import fitted, regular
from scipy.optimize import linprog

from miurafab.geometry.boxes import meeting_pairs
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.contact import overlaps, self_intersections, triangulate


def soup(points: list[tuple[float, ...]], faces: list[list[int]]) -> CreasePattern:
    """Facets anywhere in space; the flat pattern is of no interest but must be there."""
    folded = np.array(points, dtype=np.float64)
    sides = sorted({tuple(sorted((f[n - 1], f[n]))) for f in faces for n in range(len(f))})
    return CreasePattern(
        vertices_coords=np.zeros((len(folded), 2)),
        edges_vertices=np.array(sides, dtype=np.int64),
        edges_assignment=np.array(["U"] * len(sides)),
        edges_fold_angle=np.zeros(len(sides)),
        faces_vertices=np.array(faces, dtype=np.int64),
        folded_coords=folded,
    )


def insides_meet(one: np.ndarray, other: np.ndarray) -> bool:
    """The oracle: convex polygons (k, 3) and (l, 3) have a common inner point.

    Inner points are the means of all corners with positive weights; the linear program looks for
    weights of both with the same mean, and makes the least weight as great as it can.
    """
    k, m = len(one), len(other)
    equal = np.zeros((5, k + m + 1))
    equal[:3, :k], equal[:3, k : k + m] = one.T, -other.T
    equal[3, :k] = equal[4, k : k + m] = 1
    above = np.concatenate([-np.eye(k + m), np.ones((k + m, 1))], axis=1)
    found = linprog(
        np.append(np.zeros(k + m), -1.0),
        A_ub=above,
        b_ub=np.zeros(k + m),
        A_eq=equal,
        b_eq=[0, 0, 0, 1, 1],
        bounds=[(0, 1)] * (k + m) + [(None, None)],
    )
    return bool(found.status == 0 and -found.fun > 1e-7)


def has_inside(corners: np.ndarray) -> bool:
    return bool(np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0])) > 1e-9)


integers = st.integers(-3, 3)
spots = st.tuples(integers, integers, integers)
plane_spots = st.tuples(integers, integers, st.just(0))


@settings(max_examples=150)
@given(st.lists(spots, min_size=6, max_size=6), st.integers(0, 2))
@example([(0, 0, 0), (3, 0, 0), (0, 3, 0), (1, 1, -1), (1, 1, 1), (3, 3, 0)], 0)
@example([(0, 0, 0), (2, 0, 0), (0, 2, 0), (1, 1, 1), (3, 1, 1), (1, 3, 1)], 1)
def test_two_triangles_that_share_up_to_two_corners(points, shared):
    """Integer corners put many examples exactly on a plane, a side or a corner."""
    faces = [[0, 1, 2], [0, 1, 2][:shared] + [3, 4, 5][shared:]]
    if shared == 2 and tuple(faces[0]) == tuple(faces[1]):
        return
    pattern = soup(points, faces)
    corners = pattern.folded_coords[pattern.faces_vertices]
    if not all(has_inside(c) for c in corners):
        return
    expected = insides_meet(*corners)
    assert (len(self_intersections(pattern)) == 1) == expected


@settings(max_examples=80)
@given(st.lists(plane_spots, min_size=6, max_size=6), st.integers(0, 2))
def test_two_triangles_in_one_plane(points, shared):
    faces = [[0, 1, 2], [0, 1, 2][:shared] + [3, 4, 5][shared:]]
    pattern = soup(points, faces)
    corners = pattern.folded_coords[pattern.faces_vertices]
    if not all(has_inside(c) for c in corners):
        return
    expected = insides_meet(*corners)
    assert (len(self_intersections(pattern)) == 1) == expected
    flat = replace(pattern, vertices_coords=pattern.folded_coords[:, :2])
    assert (len(overlaps(flat)) == 1) == expected


@settings(max_examples=8)
@given(st.integers(0, 2**32 - 1), st.floats(0.05, 1.2))
def test_a_crumpled_sheet_against_all_pairs(seed, crumple):
    """Facets that share a corner or a side, and facets that share nothing, all pairs by oracle."""
    pattern = triangles_of(regular(4, 4))
    shake = np.random.default_rng(seed).normal(scale=crumple * 8, size=pattern.folded_coords.shape)
    pattern = replace(pattern, folded_coords=pattern.folded_coords + shake)
    corners = pattern.folded_coords[pattern.faces_vertices]
    expected = [
        pair for pair in combinations(range(len(corners)), 2)
        if insides_meet(*corners[list(pair)])
    ]  # fmt: skip
    assert [tuple(pair) for pair in self_intersections(pattern).tolist()] == expected


@pytest.mark.parametrize("seed", range(3))
def test_facets_of_many_corners_meet_as_others_do(seed, monkeypatch):
    """Three bent combs of 40 corners across each other: pairs of triangles are looked for."""
    random = np.random.default_rng(seed)
    x = np.repeat(np.arange(10.0), 2)
    comb = np.concatenate(
        [np.stack([x, np.tile([3.0, 1.0, 1.0, 3.0], 5)], 1), np.stack([x[::-1], -np.ones(20)], 1)]
    )
    points = []
    for _ in range(3):
        turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
        bent = np.pad(comb - [4.5, 0.5], ((0, 0), (0, 1))) + random.normal(size=(40, 3)) * 0.1
        points.append(bent @ turn + random.normal(size=3))
    pattern = soup(
        [tuple(p) for p in np.concatenate(points)], np.arange(120).reshape(3, 40).tolist()
    )
    pattern = replace(pattern, vertices_coords=np.tile(comb, (3, 1)))
    found = self_intersections(pattern)
    monkeypatch.setattr("miurafab.origami.folding.contact._MANY", math.inf)
    assert len(found)
    assert np.array_equal(found, self_intersections(pattern))


def triangles_of(pattern: CreasePattern) -> CreasePattern:
    """The same sheet with each facet split in two."""
    faces, _ = triangulate(pattern.faces_vertices)
    return soup([tuple(p) for p in pattern.folded_coords], faces.tolist())


def rolled(angle: float, count: int, growth: float = 0.0) -> CreasePattern:
    """A strip of ``count`` rectangles folded by ``angle`` at each crease; each is longer by
    ``growth`` than the one before. Exact: the flat strip is straight.
    """
    lengths = 1 + growth * np.arange(count)
    turn = angle * np.arange(count)
    flat_x = np.concatenate([[0], np.cumsum(lengths)])
    x = np.concatenate([[0], np.cumsum(lengths * np.cos(turn))])
    z = np.concatenate([[0], np.cumsum(lengths * np.sin(turn))])
    low, high = np.zeros(count + 1), np.ones(count + 1)
    flat = np.concatenate([np.stack([flat_x, low], 1), np.stack([flat_x, high], 1)])
    folded = np.concatenate([np.stack([x, low, z], 1), np.stack([x, high, z], 1)])
    n = np.arange(count)
    faces = np.stack([n, n + 1, n + 2 + count, n + 1 + count], axis=1)
    edges = np.unique(
        np.sort(faces[:, [[0, 1], [1, 2], [2, 3], [3, 0]]].reshape(-1, 2), axis=1), axis=0
    )
    crease = (edges[:, 1] - edges[:, 0] == count + 1) & (edges[:, 0] > 0) & (edges[:, 0] < count)
    return CreasePattern(
        vertices_coords=flat,
        edges_vertices=edges,
        edges_assignment=np.where(crease, "V", "B"),
        edges_fold_angle=np.where(crease, angle, 0.0),
        faces_vertices=faces,
        folded_coords=folded,
    )


def test_a_strip_rolled_less_than_once_is_free():
    assert len(self_intersections(rolled(math.radians(60), 5))) == 0


def test_a_strip_that_closes_a_ring_touches_itself_and_no_more():
    assert len(self_intersections(rolled(math.radians(60), 6))) == 0


def test_a_strip_rolled_over_itself_lies_on_itself():
    assert self_intersections(rolled(math.radians(60), 8)).tolist() == [[0, 6], [1, 7]]


def test_a_strip_rolled_through_itself_and_its_mirror_image():
    tight = rolled(math.radians(75), 12, 0.01)
    corners = tight.folded_coords[tight.faces_vertices]
    expected = [
        pair for pair in combinations(range(12), 2) if insides_meet(*corners[list(pair)])
    ]  # fmt: skip
    assert expected
    mirrored = replace(tight, folded_coords=tight.folded_coords * [1, 1, -1])
    for pattern in (tight, mirrored):
        assert [tuple(p) for p in self_intersections(pattern).tolist()] == expected


def test_a_facet_folded_onto_its_neighbour_is_met():
    assert self_intersections(rolled(math.pi, 2)).tolist() == [[0, 1]]


def test_layers_of_an_accordion_folded_flat_all_lie_on_each_other():
    """Every facet comes down between the same two lines: all pairs, whatever they share."""
    layers = rolled(0.0, 5)
    folded = layers.folded_coords.copy()
    folded[:, 0] = folded[:, 0] % 2
    accordion = replace(layers, folded_coords=folded)
    assert len(self_intersections(accordion)) == 10
    assert len(overlaps(accordion)) == 0


def test_layers_apart_by_a_hair_are_free():
    layers = rolled(0.0, 5)
    folded = layers.folded_coords.copy()
    folded[:, 2] += 1e-6 * folded[:, 0]
    folded[:, 0] = folded[:, 0] % 2
    assert len(self_intersections(replace(layers, folded_coords=folded))) == 0


def test_facets_that_share_a_corner_and_pass_through_each_other():
    points = [(0, 0, 0), (2, -1, 0), (2, 1, 0), (2, 0, -1), (2, 0, 1)]
    assert self_intersections(soup(points, [[0, 1, 2], [0, 3, 4]])).tolist() == [[0, 1]]
    apart = [*points[:3], (-2, 0, -1), (-2, 0, 1)]
    assert len(self_intersections(soup(apart, [[0, 1, 2], [0, 3, 4]]))) == 0


def test_exact_sheets_are_free():
    for pattern in (regular(), fitted("hypar").pattern, fitted("sphere").pattern):
        assert len(self_intersections(pattern)) == 0
        assert len(overlaps(pattern)) == 0


def fan(turn: float, count: int) -> CreasePattern:
    """A ring of ``count`` trapezoids through the angle ``turn``, flat, folded as it lies."""
    at = np.linspace(0, turn, count + 1)
    rim = np.stack([np.cos(at), np.sin(at)], axis=1)
    flat = np.concatenate([rim, 2 * rim])
    n = np.arange(count)
    faces = np.stack([n, n + count + 1, n + count + 2, n + 1], axis=1)
    strip = rolled(0.0, count)
    edges = np.unique(
        np.sort(faces[:, [[0, 1], [1, 2], [2, 3], [3, 0]]].reshape(-1, 2), axis=1), axis=0
    )
    folded = np.concatenate([flat, np.zeros((len(flat), 1))], axis=1)
    return replace(
        strip, vertices_coords=flat, folded_coords=folded, faces_vertices=faces,
        edges_vertices=edges, edges_assignment=np.array(["U"] * len(edges)),
        edges_fold_angle=np.zeros(len(edges)),
    )  # fmt: skip


def test_a_fan_overlaps_from_a_full_turn_on():
    assert len(overlaps(fan(math.tau * 11 / 12, 11))) == 0
    assert len(overlaps(fan(math.tau, 12))) == 0
    assert overlaps(fan(math.tau * 14 / 12, 14)).tolist() == [[0, 12], [1, 13]]


def test_a_facet_turned_over_in_the_flat_pattern_overlaps_its_neighbours():
    pattern = regular(5, 5)
    flat = pattern.vertices_coords.copy()
    flat[12] = flat[12] + 1.8 * (flat[18] - flat[12])
    pairs = overlaps(replace(pattern, vertices_coords=flat))
    assert len(pairs)
    assert {int(f) for f in pairs.ravel()} >= {10}


def test_a_dented_facet_covers_only_itself():
    """A dart's first diagonal runs outside; fanned from there it would cover its neighbour."""
    flat = np.array([(0, 0), (2, -2), (0, 2), (-2, -2), (0, -3.0)])
    dart = soup([(*p, 0) for p in flat], [[1, 2, 3, 0], [1, 0, 3, 4]])
    dart = replace(dart, vertices_coords=flat)
    for start in range(4):
        faces = dart.faces_vertices.copy()
        faces[0] = np.roll(faces[0], start)
        assert len(overlaps(replace(dart, faces_vertices=faces))) == 0


def test_a_dented_polygon_is_cut_ear_by_ear():
    at = np.arange(10) * math.pi / 5
    star = np.where(np.arange(10) % 2, 2.0, 0.8)[:, None] * np.stack([np.cos(at), np.sin(at)], 1)
    faces = np.array([list(range(10))])
    triangles, owner = triangulate(faces, star)
    a, b, c = (star[triangles[:, n]] for n in range(3))
    areas = np.cross(np.pad(b - a, ((0, 0), (0, 1))), np.pad(c - a, ((0, 0), (0, 1))))[:, 2] / 2
    following = np.roll(star, -1, axis=0)
    whole = (star[:, 0] * following[:, 1] - star[:, 1] * following[:, 0]).sum() / 2
    assert len(triangles) == 8
    assert (owner == 0).all()
    assert areas.min() > 0
    assert areas.sum() == pytest.approx(whole, rel=1e-12)


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(0, 60), st.floats(0, 4))
def test_boxes_meet_as_all_pairs_do(seed, count, spread):
    random = np.random.default_rng(seed)
    low = random.uniform(0, 5, (count, 3))
    high = low + random.lognormal(-1, spread, (count, 1)) * random.uniform(0, 1, (count, 3))
    first, second = meeting_pairs(low, high)
    expected = [
        (a, b) for a, b in combinations(range(count), 2)
        if (low[a] <= high[b]).all() and (low[b] <= high[a]).all()
    ]  # fmt: skip
    assert list(zip(first.tolist(), second.tolist(), strict=True)) == expected


def test_a_pattern_without_a_folded_form_has_no_contacts_to_look_for():
    with pytest.raises(ValueError, match="no folded form"):
        self_intersections(replace(regular(), folded_coords=None))
