"""Laying meshes flat, rectangles in the layout, smoothing splines: by what must hold of each."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from problems import saddle_mesh
from scipy.spatial import Delaunay
from test_mesh import dome, square

from miurafab.surfaces.parameterise import (
    conformal,
    flatten,
    turned_over,
    tutte,
)
from miurafab.surfaces.placement import (
    _largest_block,
    covered,
    largest_rectangle,
    locate,
    placements,
    turned,
)
from miurafab.surfaces.smoothing import smooth
from miurafab.surfaces.surface import Domain
from miurafab.surfaces.topology import border_loops


def stretches(vertices, flat, faces):
    """(F, 2) the singular values of each triangle's map from the layout to space."""
    p, q = vertices[faces], flat[faces]
    e, f = p[:, 1:] - p[:, :1], q[:, 1:] - q[:, :1]
    return np.linalg.svd(np.linalg.solve(f, e), compute_uv=False)


def test_a_developable_mesh_is_laid_flat_without_stretch():
    v, f = square(15)
    bent = np.stack([50 * np.sin(v[:, 0] / 50), v[:, 1], 50 * np.cos(v[:, 0] / 50)], axis=1)
    found = stretches(bent, flatten(bent, f), f)
    assert np.abs(found - 1).max() < 0.01


def test_a_dome_is_laid_flat_with_little_stretch():
    v, f = dome(31)
    found = stretches(v, flatten(v, f), f)
    assert found.min() > 0.8
    assert found.max() < 1.25


def test_conformal_maps_keep_angles_where_they_can():
    v, f = dome(31)
    z = conformal(v, f)
    found = stretches(v, np.stack([z.real, z.imag], axis=1), f)
    assert np.quantile(found[:, 0] / found[:, 1], 0.99) < 1.05


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.integers(8, 120), st.floats(0, 1.0))
def test_no_triangle_turns_over_however_crumpled_the_mesh(seed, count, noise):
    random = np.random.default_rng(seed)
    plane = random.uniform(size=(count, 2))
    faces = Delaunay(plane).simplices.astype(np.int64)
    a, b, c = (plane[faces[:, n]] for n in range(3))
    turn = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    faces = np.where((turn < 0)[:, None], faces[:, ::-1], faces)
    vertices = np.pad(plane, ((0, 0), (0, 1))) + noise * random.normal(size=(count, 3))
    z = tutte(vertices, faces)
    assert not turned_over(z, faces).any()
    flat = flatten(vertices, faces)
    assert not turned_over(flat[:, 0] + 1j * flat[:, 1], faces).any()


def test_a_polygon_of_border_alone_lies_on_its_circle():
    v, f = square(2)
    z = tutte(v, f)
    assert np.abs(z) == pytest.approx(400 / (2 * np.pi))
    assert z[f[0, 1]] / z[f[0, 0]] == pytest.approx(1j)


def test_the_border_runs_with_its_triangles():
    _, f = square(4)
    (loop,) = border_loops(f)
    assert sorted(loop.tolist()) == [0, 1, 2, 3, 4, 7, 8, 11, 12, 13, 14, 15]
    at = loop.tolist().index(0)
    assert np.roll(loop, -at)[:4].tolist() == [0, 1, 2, 3]


def test_points_are_located_in_their_triangles():
    mesh = saddle_mesh(11)
    flat = flatten(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    faces = np.asarray(mesh.faces)
    weights = np.random.default_rng(1).dirichlet((1, 1, 1), len(faces))
    points = np.einsum("fc,fck->fk", weights, flat[faces])
    triangle, found = locate(flat, faces, points)
    assert triangle.tolist() == list(range(len(faces)))
    np.testing.assert_allclose(found, weights, atol=1e-9)
    assert (locate(flat, faces, points + 1e4)[0] == -1).all()


@settings(max_examples=80)
@given(st.integers(0, 2**32 - 1), st.integers(2, 9), st.integers(2, 9), st.floats(0.5, 1))
def test_the_largest_block_is_the_largest_of_all(seed, rows, columns, density):
    grid = np.random.default_rng(seed).random((rows, columns)) < density
    i0, i1, j0, j1 = _largest_block(grid)
    best = max(
        (
            (b - a) * (d - c)
            for a in range(columns) for b in range(a, columns)
            for c in range(rows) for d in range(c, rows)
            if grid[c : d + 1, a : b + 1].all()
        ),
        default=0,
    )  # fmt: skip
    assert (i1 - i0) * (j1 - j0) == best
    if best:
        assert grid[j0 : j1 + 1, i0 : i1 + 1].all()


def test_placements_lie_within_the_mesh_and_the_first_is_the_best():
    v, f = dome(31)
    flat = flatten(v, f)
    found = placements(v, flat, f)
    assert len(found) == 12
    assert found[0][0] >= 0.97 * max(score for score, _ in found)
    for _, placement in found:
        assert covered(turned(flat, placement.angle), f, placement.domain)


def test_a_square_is_covered_whole():
    v, f = square(11)
    domain = largest_rectangle(turned(v[:, :2], 0.0), f)
    assert domain.width == pytest.approx(100)
    assert domain.height == pytest.approx(100)


def waves(uv):
    x, y = uv.T
    return np.stack([x, y, 0.2 * np.sin(2 * x + y)], axis=1)


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.05])
def test_smoothing_is_as_strong_as_the_noise(noise):
    random = np.random.default_rng(3)
    places = random.uniform(-1, 1, (1500, 2))
    true = waves(places)
    found = smooth(
        places, true + noise * random.normal(size=true.shape), Domain(-1, 1, -1, 1), (20, 20)
    )
    error = np.sqrt(((np.asarray(found.spline(places)) - true) ** 2).sum(axis=1).mean())
    assert error < max(1e-3, 0.5 * noise)
    assert found.roughness == pytest.approx(noise * np.sqrt(3), rel=0.15, abs=1e-3)


def test_smoothing_bridges_gaps_straight_on():
    places = np.stack(np.meshgrid(np.linspace(-1, -0.3, 20), np.linspace(-1, 1, 30)), -1)
    places = places.reshape(-1, 2)
    plane = np.stack([places[:, 0], places[:, 1], 0.5 * places[:, 0]], axis=1)
    found = smooth(places, plane, Domain(-1, 1, -1, 1), (12, 12))
    np.testing.assert_allclose(found.spline(np.array([0.9, 0.2])), [0.9, 0.2, 0.45], atol=1e-3)
