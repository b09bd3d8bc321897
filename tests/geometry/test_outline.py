"""The region inside loops: signed distances in closed form, and the parts of cells."""

from __future__ import annotations

import numpy as np
import pytest

from miurafab.geometry.arrays import Floats
from miurafab.geometry.outline import Outline

SQUARE = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
HOLE = np.array([[1.0, 1.0], [3.0, 1.0], [3.0, 2.0], [1.0, 2.0]])


def circle(radius: float, count: int) -> Floats:
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def test_the_signed_distance_of_a_circle() -> None:
    random = np.random.default_rng(1)
    points = random.uniform(-3, 3, (500, 2))
    phi, gradient, _ = Outline.of_loops([circle(2.0, 4000)]).nearest(points)
    radius = np.linalg.norm(points, axis=1)
    assert np.abs(phi - (2.0 - radius)).max() < 1e-6
    clear = radius > 0.1
    assert np.abs(gradient + points / radius[:, None])[clear].max() < 2e-3


def test_the_signed_distance_of_a_square_with_a_hole() -> None:
    outline = Outline.of_loops([HOLE, SQUARE[::-1]])
    assert outline.area == pytest.approx(14.0)
    points = np.array([[0.5, 1.5], [2.0, 1.4], [2.0, 3.5], [5.0, 5.0], [-1.0, 2.0], [3.0, 3.0]])
    expected = [0.5, -0.4, 0.5, -np.sqrt(2), -1.0, 1.0]
    assert outline.signed_distance(points) == pytest.approx(expected, abs=1e-14)
    on_border = outline.nearest(np.array([[4.0, 1.0], [2.0, 1.0]]))
    assert on_border[0] == pytest.approx([0.0, 0.0])
    assert on_border[1] == pytest.approx(np.array([[-1.0, 0.0], [0.0, -1.0]]))


def test_the_gradient_is_that_of_the_signed_distance() -> None:
    random = np.random.default_rng(2)
    outline = Outline.of_loops([SQUARE, HOLE])
    points = random.uniform(-1, 5, (200, 2))
    h = 1e-6
    slope = np.stack(
        [
            (outline.signed_distance(points + d) - outline.signed_distance(points - d)) / (2 * h)
            for d in h * np.eye(2)
        ],
        axis=1,
    )
    smooth = np.abs(np.linalg.norm(slope, axis=1) - 1) < 1e-6  # off the ridges of the distance
    assert smooth.mean() > 0.99
    assert np.abs(slope - outline.nearest(points)[1])[smooth].max() < 1e-6


def test_the_parts_of_cells_add_up_to_the_area() -> None:
    outline = Outline.of_loops([SQUARE, HOLE])
    u, v = np.linspace(-1, 5, 13), np.linspace(-1, 5, 7)
    shares = outline.shares(u, v)
    assert shares.shape == (6, 12)
    assert (shares * 0.5 * 1.0).sum() == pytest.approx(14.0)
    assert shares[2, 4] == 0.0
    assert shares[1, 2] == 1.0
    zigzag = outline.shares(u, v, 3.0)
    # the border of the cells dips into the square by 1/2 four times at the top and at the bottom,
    # with a slope of 6: eight triangles of base 1/6
    assert (zigzag * 0.5 * 1.0).sum() == pytest.approx(14.0 - 8 * (1 / 6) * (1 / 2) / 2)


def test_the_corners_along_a_loop_follow_its_direction() -> None:
    outline = Outline.of_loops([SQUARE[::-1], HOLE])
    start, end = np.array([1.0, 0.0]), np.array([3.0, 4.0])
    sides = outline.nearest(np.stack([start, end]))[2].tolist()
    there = outline.along((sides[0], start), (sides[1], end))
    assert there.tolist() == [[4.0, 0.0], [4.0, 4.0]]
    back = outline.along((sides[1], end), (sides[0], start))
    assert back.tolist() == [[0.0, 4.0], [0.0, 0.0]]
    further = np.array([2.0, 0.0])
    assert len(outline.along((sides[0], start), (sides[0], further))) == 0
    assert len(outline.along((sides[0], further), (sides[0], start))) == 4
    inner = int(outline.nearest(np.array([[2.0, 1.1]]))[2][0])
    assert len(outline.along((sides[0], start), (inner, np.array([2.0, 1.0])))) == 0


def test_a_loop_that_crosses_itself_is_told() -> None:
    assert Outline.of_loops([SQUARE, HOLE]).simple
    bow = np.array([[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.2]])
    assert not Outline.of_loops([bow]).simple
