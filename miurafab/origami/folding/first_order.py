"""Which folds of a flat sheet can begin together, with flat facets: by linear programming.

As a sheet leaves flat its facets turn, and around each vertex inside they come back to where they
were: the turns rho_e about its creases, along the unit vectors d_e from the vertex, add up to none,

    sum rho_e d_e = 0.

Where the letters say on which side each fold lies, rho_e = s_e r_e with r_e >= 0, the motions form
a cone, and a sum of motions is a motion. So there is a largest set of folds that turn at once, and
the others cannot turn with it, whatever their speeds. The linear program

    maximise sum m_e,   0 <= m_e <= 1,  m_e <= r_e

finds it: at the best m_e is 1 on the set and 0 beside it. This is true to first order, and of flat
facets: it is not enough for a motion, but without it there is none.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, hstack

from miurafab.geometry.arrays import Ints
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.invariants import interior_vertices


def waiting_folds(pattern: CreasePattern) -> Ints:
    """The edges (n,) of mountains and valleys of ``pattern`` that cannot turn at first.

    Edges of letter U turn to either side. The program has a solution: no crease may turn.
    """
    inner = (pattern.edges_faces >= 0).all(axis=1)
    sign = np.select([pattern.edges_assignment == "M", pattern.edges_assignment == "V"], [-1, 1], 0)
    folds = np.flatnonzero(inner & (sign != 0))
    free = np.flatnonzero(inner & (pattern.edges_assignment == "U"))
    vertices = interior_vertices(pattern)
    if not len(folds) or not len(vertices):
        return np.empty(0, dtype=np.int64)
    row = np.full(len(pattern.vertices_coords), -1, dtype=np.int64)
    row[vertices] = np.arange(len(vertices))
    ends = pattern.edges_vertices
    along = pattern.vertices_coords[ends[:, 1]] - pattern.vertices_coords[ends[:, 0]]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    edge, end = np.nonzero(row[ends] >= 0)
    away = np.where(end == 0, 1.0, -1.0)[:, None] * along[edge]
    at = row[ends[edge, end]]
    entries = (away.T.ravel(), (np.concatenate([at, at + len(vertices)]), np.tile(edge, 2)))
    turns = coo_array(entries, shape=(2 * len(vertices), len(ends))).tocsc()
    signed = turns[:, folds] * sign[folds]
    loose = turns[:, free]
    # r = m + more, so that m <= r
    system = hstack([signed, signed, loose, -loose])
    count, rest = len(folds), len(folds) + 2 * len(free)
    from scipy.optimize import linprog  # takes a tenth of a second to load

    best = linprog(
        np.concatenate([-np.ones(count), np.zeros(rest)]),
        A_eq=system,
        b_eq=np.zeros(2 * len(vertices)),
        bounds=[(0, 1)] * count + [(0, None)] * rest,
        method="highs",
    )
    assert best.x is not None
    return np.asarray(folds[best.x[:count] < 0.5])
