"""Decimation keeps the topology and the outline, and stays on the surface."""

from __future__ import annotations

import numpy as np
import pytest

from miurafab.surfaces import mesh
from miurafab.surfaces.decimation import decimated
from miurafab.surfaces.mesh_repair import doubled_areas
from miurafab.surfaces.topology import border_loops, classify, edges_of


def sheet(side, hole=False, noise=0.0):
    """A bumpy sheet with uneven vertices, all in a random order."""
    random = np.random.default_rng(5)
    x, y = np.meshgrid(np.arange(side + 1.0), np.arange(side + 1.0))
    inner = (x > 0) & (x < side) & (y > 0) & (y < side)
    x = x + 0.3 * inner * random.uniform(-1, 1, x.shape)
    y = y + 0.3 * inner * random.uniform(-1, 1, x.shape)
    z = 0.1 * side * np.sin(5 * x / side) * np.cos(4 * y / side)
    z = z + noise * random.normal(size=x.shape)
    v = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (q.ravel() for q in (v[:-1, :-1], v[:-1, 1:], v[1:, 1:], v[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    if hole:
        middle = points[faces].mean(axis=1)[:, :2]
        faces = faces[np.linalg.norm(middle - side / 2, axis=1) > side / 6]
    used, faces = np.unique(faces, return_inverse=True)
    order = random.permutation(len(used))
    return points[used[np.argsort(order)]], order[faces.reshape(-1, 3)]


@pytest.mark.parametrize(
    ("hole", "noise", "most"), [(False, 0.0, 800), (True, 0.0, 800), (False, 0.4, 2500)]
)
def test_the_topology_and_the_outline_stay(hole, noise, most):
    vertices, faces = sheet(48, hole, noise)
    points, fewer = decimated(vertices, faces, most)
    assert len(fewer) <= 1.1 * most
    before, after = classify(vertices, faces), classify(points, fewer)
    assert (after.kind, after.handles) == (before.kind, 0)
    assert edges_of(fewer)[1].max() == 2
    for old, new in zip(before.loops, after.loops, strict=True):
        assert sorted(vertices[old].tolist()) == sorted(points[new].tolist())
    assert len(border_loops(fewer)) == 1 + hole
    kept = {tuple(point) for point in vertices.tolist()}
    assert kept.issuperset(map(tuple, points.tolist()))
    assert doubled_areas(points, fewer).min() > 0


def test_a_smooth_sheet_keeps_its_area_and_its_side():
    vertices, faces = sheet(48)
    points, fewer = decimated(vertices, faces, 1000)
    areas = [doubled_areas(vertices, faces).sum(), doubled_areas(points, fewer).sum()]
    assert areas[1] == pytest.approx(areas[0], rel=0.02)
    p = points[fewer]
    assert (np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])[:, 2] > 0).all()


def test_a_small_mesh_stays_as_it_is():
    vertices, faces = sheet(6)
    points, same = decimated(vertices, faces, 72)
    assert np.array_equal(points, vertices)
    assert np.array_equal(same, faces)


def test_a_strip_without_inner_vertices_stays_as_it_is():
    vertices, faces = sheet(40)
    strip = faces[(vertices[faces][..., 1] <= 1).all(axis=1)]
    used, strip = np.unique(strip, return_inverse=True)
    points, same = decimated(vertices[used], strip.reshape(-1, 3), 10)
    assert np.array_equal(points, vertices[used])
    assert np.array_equal(same, strip.reshape(-1, 3))


def test_a_large_mesh_is_laid_flat_simplified_and_measured_whole(monkeypatch):
    vertices, faces = sheet(48)
    before = mesh.mesh_surface(vertices, faces)
    monkeypatch.setattr(mesh, "LARGE", 3000)
    monkeypatch.setattr(mesh, "LAID_FLAT", 1500)
    after = mesh.mesh_surface(vertices, faces)
    assert len(after.layout.faces) <= 1.25 * 1500  # the longest edges are halved again
    assert len(after.layout.bare.triangles) == len(before.layout.bare.triangles)
    assert after.domain.width == pytest.approx(before.domain.width, rel=0.03)
    points = after.point(after.domain.lattice(9, 9).reshape(-1, 2))
    assert np.linalg.norm(before.closest_point(points) - points, axis=1).max() < 0.1
