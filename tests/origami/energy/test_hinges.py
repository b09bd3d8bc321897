"""Fold angles against the definition, and their derivatives against finite differences."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from miurafab.geometry.angles import fold_angles
from miurafab.origami.energy.hinges import hinge_angles, hinge_derivatives, hinge_gradients

HINGE = np.array([[0, 1, 2, 3]])


def random_hinge(seed):
    """A hinge in general position: heights over 0.3, fold angle not within 0.2 of pi."""
    random = np.random.default_rng(seed)
    while True:
        points = random.normal(size=(4, 3))
        base = points[1] - points[0]
        areas = np.linalg.norm(np.cross(base, points[2:] - points[0]), axis=1)
        if areas.min() > 0.3 * np.linalg.norm(base) and abs(hinge_angles(points, HINGE)[0]) < 2.9:
            return points


def difference(function, points, step=1e-5):
    """Central differences of ``function`` (4, 3) -> (...) by every coordinate, last axes (4, 3)."""
    columns = []
    for vertex in range(4):
        for axis in range(3):
            there, back = points.copy(), points.copy()
            there[vertex, axis] += step
            back[vertex, axis] -= step
            columns.append((function(there) - function(back)) / (2 * step))
    return np.moveaxis(np.array(columns), 0, -1).reshape(*np.shape(columns[0]), 4, 3)


@given(st.integers(0, 10**6))
def test_gradient_and_hessian_are_the_finite_differences(seed):
    points = random_hinge(seed)
    angle, gradient, hessian = hinge_derivatives(points, HINGE)
    numeric = difference(lambda p: hinge_angles(p, HINGE)[0], points)
    assert np.abs(gradient[0] - numeric).max() <= 1e-8 * (1 + np.abs(hessian).max() ** 1.5)
    numeric = difference(lambda p: hinge_gradients(p, HINGE)[1][0], points)
    assert np.abs(hessian[0] - numeric).max() <= 1e-8 * (1 + np.abs(hessian).max() ** 2)
    assert angle == hinge_gradients(points, HINGE)[0] == hinge_angles(points, HINGE)


@given(st.integers(0, 10**6))
def test_hessian_is_symmetric_and_blind_to_rigid_motion(seed):
    points = random_hinge(seed)
    _, gradient, hessian = hinge_derivatives(points, HINGE)
    size = 1 + np.abs(hessian).max()
    assert np.abs(hessian - hessian.transpose(0, 3, 4, 1, 2)).max() <= 1e-13 * size
    assert np.abs(gradient.sum(axis=1)).max() <= 1e-13 * size
    assert np.abs(np.cross(points, gradient[0]).sum(axis=0)).max() <= 1e-12 * size
    assert np.abs(hessian.sum(axis=3)).max() <= 1e-12 * size


def test_angles_follow_the_fold_format():
    random = np.random.default_rng(5)
    points = random.normal(size=(40, 3))
    hinges = np.array([random.permutation(40)[:4] for _ in range(50)])
    u, v, a, b = (points[hinges[:, k]] for k in range(4))

    def unit(vectors):
        return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)

    left, right = unit(np.cross(v - u, a - u)), unit(np.cross(b - u, v - u))
    wanted = fold_angles(points, hinges[:, :2], left, right)
    assert hinge_angles(points, hinges) == pytest.approx(wanted, abs=1e-14)


def test_lifting_a_wing_makes_a_valley():
    points = np.array([[0, 0, 0], [1, 0, 0], [0.3, 2, 0], [0.6, -1, 0.0]])
    assert hinge_angles(points, HINGE) == 0.0
    points[2] = [0.3, 2 * np.cos(0.4), 2 * np.sin(0.4)]
    assert hinge_angles(points, HINGE) == pytest.approx(0.4, abs=1e-15)
