"""Points of the plane moved a little, so that given lengths come out: rounding spread evenly."""

from __future__ import annotations

import numpy as np

from miurafab.geometry.arrays import Floats, Ints

_RIDGE = 1e-9
"""Of the squared moves, beside squared lengths: the points neither shift nor turn as a whole."""


def evened(points: Floats, pairs: Ints, lengths: Floats) -> Floats:
    """The ``points`` (V, 2) after one Gauss-Newton step of least squares towards ``lengths``.

    Parameters
    ----------
    points : (V, 2) array of float
        The points, of which no two of a pair lie at one place.
    pairs : (n, 2) array of int
        The two points of each length.
    lengths : (n,) array of float
        The lengths that are wanted.
    """
    from scipy.sparse import coo_array, eye_array

    from miurafab.geometry.sparse import SymmetricSolver

    gap = points[pairs[:, 1]] - points[pairs[:, 0]]
    found = np.linalg.norm(gap, axis=1)
    along = gap / found[:, None]
    row = np.repeat(np.arange(len(pairs)), 4)
    column = (2 * pairs[:, :, None] + [0, 1]).reshape(-1)
    values = np.stack([-along, along], axis=1).reshape(-1)
    jacobian = coo_array((values, (row, column)), shape=(len(pairs), points.size)).tocsr()
    normal = (jacobian.T @ jacobian + _RIDGE * eye_array(points.size)).tocsc()
    normal.sort_indices()
    moves = SymmetricSolver().factor(normal).solve(jacobian.T @ (lengths - found))
    return points + moves.reshape(-1, 2)
