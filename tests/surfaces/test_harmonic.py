"""Harmonic coordinates of tubes against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from mesh_shapes import ball, mesh, ring

from miurafab.errors import TargetError
from miurafab.surfaces.harmonic import CylinderMap, cylinder_map
from miurafab.surfaces.intrinsic import intrinsic_mesh
from miurafab.surfaces.refine import refine
from miurafab.surfaces.topology import border_loops


def mapped(vertices, faces, height):
    """The map of a tube from its border of least ``height`` (V,)."""
    low, high = sorted(border_loops(faces), key=lambda loop: height[loop].mean())
    return cylinder_map(vertices, faces, low, high)


def off_turns(got, expected):
    """The largest difference of two angles in turns, up to a common offset."""
    gap = np.exp(2j * np.pi * (got - expected))
    return float(np.abs(np.angle(gap / (gap.mean() / abs(gap.mean())))).max() / (2 * np.pi))


def round_about(radius, height, around, along):
    """The surface of revolution r(t), z(t) with its angle in turns and t at each vertex."""

    def place(turn, t):
        angle = 2 * np.pi * turn
        return np.stack(
            [radius(t) * np.cos(angle), radius(t) * np.sin(angle), height(t) + 0 * turn], axis=-1
        )

    return ring(place, around, along)


def test_a_cylinder_is_its_own_map():
    vertices, faces = round_about(lambda t: 1 + 0 * t, lambda t: 3 * t, 24, 12)
    result = mapped(vertices, faces, vertices[:, 2])
    turn = np.arctan2(vertices[:, 1], vertices[:, 0]) / (2 * np.pi)
    assert np.abs(result.height - vertices[:, 2] / 3).max() < 1e-12
    assert off_turns(result.turns, turn) < 1e-12
    assert result.turned_over(faces) == 0


def test_a_ring_of_one_row_has_borders_alone():
    vertices, faces = round_about(lambda t: 1 + 0 * t, lambda t: 3 * t, 24, 2)
    result = mapped(vertices, faces, vertices[:, 2])
    assert result.height.tolist() == [0.0] * 24 + [1.0] * 24
    assert off_turns(result.turns, np.tile(np.arange(24) / 24, 2)) < 1e-12


def test_what_is_thousands_of_times_as_long_as_wide_is_not_divided_for_ever():
    vertices = np.array([[0, 0, 0], [1e9, 0, 0], [1e9, 1, 0], [0, 1, 0.0]])
    with pytest.raises(TargetError, match="too narrow for its length; cut it into shorter parts"):
        refine(vertices, np.array([[0, 1, 2], [0, 2, 3]]), 1.0)


def error_on_cone(cells):
    vertices, faces = round_about(lambda t: 2 - t, lambda t: 2 * t, 2 * cells, cells)
    result = mapped(vertices, faces, vertices[:, 2])
    radius = np.linalg.norm(vertices[:, :2], axis=1)
    return np.abs(result.height - np.log(2 / radius) / np.log(2)).max()


def error_on_zone(cells):
    """Mercator's map: v grows like artanh of the sine of the latitude."""
    vertices, faces = round_about(
        lambda t: np.cos(2.4 * t - 1.2), lambda t: np.sin(2.4 * t - 1.2), 2 * cells, cells
    )
    result = mapped(vertices, faces, vertices[:, 2])
    rise = np.arctanh(vertices[:, 2]) / np.arctanh(np.sin(1.2))
    return np.abs(result.height - (1 + rise) / 2).max()


@pytest.mark.parametrize(("error", "least"), [(error_on_cone, 5e-4), (error_on_zone, 3e-3)])
def test_the_height_comes_nearer_with_the_square_of_the_cells(error, least):
    coarse, fine = error(16), error(32)
    assert fine < least
    assert 3 < coarse / fine < 5


def test_the_angle_round_a_bent_pipe():
    """du is r da / (R + r cos a), so tan(pi u) = sqrt((k - 1) / (k + 1)) tan(a / 2), k = R / r."""

    def place(turn, t):
        angle, bend = 2 * np.pi * turn, np.pi / 2 * t
        out = 2 + 0.8 * np.cos(angle)
        return np.stack(
            [out * np.cos(bend), out * np.sin(bend), -0.8 * np.sin(angle) + 0 * t], axis=-1
        )

    vertices, faces = ring(place, 60, 40)
    bend = np.arctan2(vertices[:, 1], vertices[:, 0])
    result = mapped(vertices, faces, bend)
    assert np.abs(result.height - bend / (np.pi / 2)).max() < 1e-4
    out = np.linalg.norm(vertices[:, :2], axis=1) - 2
    half = np.arctan2(-vertices[:, 2], out) / 2
    k = 2 / 0.8
    expected = np.arctan2(np.sqrt(k - 1) * np.sin(half), np.sqrt(k + 1) * np.cos(half)) / np.pi
    assert off_turns(result.turns, expected) < 5e-4


def test_u_v_and_the_normal_are_right_handed():
    vertices, faces = mesh("vase")
    low, high = border_loops(faces)
    for start, end in ((low, high), (high, low)):
        result = cylinder_map(vertices, faces, start, end)
        assert result.turned_over(faces) == 0
        assert result.turned_over(faces[:, ::-1]) == len(faces)


def test_corners_have_no_jump_inside_a_triangle():
    turns = np.array([0.95, 0.05, 0.5])
    corners = CylinderMap(turns, np.zeros(3)).corners(np.array([[0, 1, 2], [1, 0, 2]]))
    assert corners[0] == pytest.approx([0.95, 1.05, 0.5])
    assert corners[1] == pytest.approx([0.05, -0.05, 0.5])


def test_a_spike_that_leans_over_ends_in_a_triangle_glued_to_itself():
    """The angles round its tip add up to so little that flips leave one triangle there."""
    turn = 2 * np.pi * np.arange(3) / 3
    inner, outer = (
        np.stack([r * np.cos(turn + a), r * np.sin(turn + a), 0 * turn], axis=1)
        for r, a in ((1.0, 0.0), (3.0, 0.5))
    )
    vertices = np.concatenate([[[-5.0, -2.5, 1.0]], inner, outer])
    after = np.array([2, 3, 1])
    k = np.array([1, 2, 3])
    spike = np.stack([0 * k, k, after], axis=1)
    strip = [np.stack([k, k + 3, after], axis=1), np.stack([after, k + 3, after + 3], axis=1)]
    made = intrinsic_mesh(vertices, np.concatenate([spike, *strip]))
    corners = np.sort(made.faces, axis=1)
    assert (np.diff(corners, axis=1) == 0).any()
    assert (made.faces == 0).sum() == 1
    assert made.weights[made.mates >= 0].min() > 0
    assert np.abs(made.laplacian @ np.ones(7)).max() < 1e-12


@pytest.fixture(scope="module")
def stretched():
    """A ball of oblique triangles."""
    vertices, faces = ball(lambda p: p * [1.0, 1.0, 6.0], 3)
    return vertices, faces, intrinsic_mesh(vertices, faces)


def test_flips_leave_no_negative_weight(stretched):
    _, faces, made = stretched
    assert len(made.faces) == len(faces)
    assert made.weights.min() > -1e-8
    assert made.faces.tolist() != faces.tolist()


def test_flips_keep_the_area_and_the_sides_fit(stretched):
    vertices, faces, made = stretched
    p = vertices[faces]
    area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum()
    assert made.doubled_areas.sum() == pytest.approx(area, rel=1e-11)
    assert np.array_equal(made.mates[made.mates], np.arange(made.faces.size))
    assert np.array_equal(made.heads, made.faces.ravel()[made.mates])
    assert np.allclose(made.lengths.ravel(), made.lengths.ravel()[made.mates], rtol=1e-12)


def test_a_flat_sheet_keeps_its_linear_functions():
    """On a plane the Laplacian of x is zero whatever the triangles, flipped or not."""
    random = np.random.default_rng(3)
    vertices, faces = ring(
        lambda u, t: np.stack(
            [(1 + t) * np.cos(2 * np.pi * u), 9 * (1 + t) * np.sin(2 * np.pi * u), 0 * (u + t)], -1
        ),
        20,
        8,
    )
    inner = np.setdiff1d(np.arange(len(vertices)), np.concatenate(border_loops(faces)))
    vertices[inner, :2] += random.uniform(-0.01, 0.01, (len(inner), 2))
    made = intrinsic_mesh(vertices, faces)
    assert made.weights[made.mates >= 0].min() > -1e-8
    for k in (0, 1):
        assert np.abs((made.laplacian @ vertices[:, k])[inner]).max() < 1e-10


def test_refinement_keeps_the_surface_whole():
    vertices, faces = mesh("vase")
    limit = 0.4 * np.linalg.norm(vertices[faces[:, 0]] - vertices[faces[:, 1]], axis=1).max()
    fine, triangles = refine(vertices, faces, limit)
    sides = fine[triangles] - fine[np.roll(triangles, -1, axis=1)]
    assert np.linalg.norm(sides, axis=2).max() <= limit
    assert np.array_equal(fine[: len(vertices)], vertices)

    def area(points, some):
        p = points[some]
        return np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum()

    assert area(fine, triangles) == pytest.approx(area(vertices, faces), rel=1e-12)
    assert np.array_equal(np.unique(triangles), np.arange(len(fine)))
    assert len(border_loops(triangles)) == 2
