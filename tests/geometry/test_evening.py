"""Points evened towards given lengths."""

import numpy as np

from miurafab.geometry.evening import evened

PAIRS = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [1, 3]])
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def _lengths(points):
    return np.linalg.norm(np.diff(points[PAIRS], axis=1)[:, 0], axis=1)


def test_a_step_takes_the_square_of_the_error_away():
    rng = np.random.default_rng(5)
    shaken = SQUARE + 1e-4 * rng.normal(size=SQUARE.shape)
    before = np.abs(_lengths(shaken) - _lengths(SQUARE)).max()
    after = np.abs(_lengths(evened(shaken, PAIRS, _lengths(SQUARE))) - _lengths(SQUARE)).max()
    assert after < before**2
    assert before > 1e-5


def test_the_points_neither_shift_nor_turn():
    moved = evened(SQUARE, PAIRS, 1.001 * _lengths(SQUARE)) - SQUARE
    np.testing.assert_allclose(moved.mean(axis=0), 0, atol=1e-9)
    x, y = (SQUARE - SQUARE.mean(axis=0)).T
    assert abs(float((x * moved[:, 1] - y * moved[:, 0]).sum())) < 1e-9
    np.testing.assert_allclose(moved, 0.001 * (SQUARE - SQUARE.mean(axis=0)), rtol=1e-6, atol=1e-9)
