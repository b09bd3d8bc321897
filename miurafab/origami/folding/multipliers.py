"""How fast each crease folds, where a pattern tells no more than mountains from valleys.

At a flat-foldable vertex of degree four one crease differs in assignment from the three others. It
and the one opposite fold by equal and opposite angles, the other two by equal ones, and with
t = tan(rho / 2), a and b the sectors to either side of one of these two,

    |t of the unequal pair| / |t of the equal pair| = |sin((a - b) / 2) / sin((a + b) / 2)|

(Tachi, "Generalization of rigid foldable quadrilateral mesh origami", IASS 2009, eq. 1.) In
logarithms these are linear equations between the creases, which are solved for the whole sheet at
once. They are consistent only where the sheet folds rigidly: the loop mismatch tells.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import spsolve

from miurafab.errors import PatternError
from miurafab.geometry.arrays import Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.invariants import corner_ring, interior_vertices


def fold_speeds(pattern: CreasePattern) -> Floats:
    """(E,) tan(rho / 2) of each crease when the median crease that folds does so by 90 degrees.

    Mountains are negative; creases that are neither mountain nor valley do not fold. Vertices of
    another degree than four are passed over. Raises :class:`~miurafab.errors.PatternError` for a
    vertex whose creases cannot fold at once.
    """
    sign = np.where(pattern.edges_assignment == "V", 1.0, 0.0)
    sign[pattern.edges_assignment == "M"] = -1.0
    spokes, sectors, vertices = _vertices_of_four(pattern)
    around = sign[spokes]
    odd_one = np.argmax(around * around.sum(axis=1, keepdims=True) < 0, axis=1)
    wrong = np.flatnonzero(np.abs(around.sum(axis=1)) != 2)
    if len(wrong):
        raise PatternError(
            f"The four creases at vertex {vertices[wrong[0]]} are not three of one kind and one of "
            "the other, so they cannot fold flat."
        )
    row = np.arange(len(spokes))
    unequal = spokes[row, odd_one], spokes[row, (odd_one + 2) % 4]
    equal = spokes[row, (odd_one + 1) % 4], spokes[row, (odd_one + 3) % 4]
    a, b = sectors[row, (odd_one + 1) % 4], sectors[row, odd_one]
    ratio = np.abs(np.sin((a - b) / 2) / np.sin((a + b) / 2))
    stuck = np.flatnonzero(ratio < 1e-9)
    if len(stuck):
        raise PatternError(
            f"The creases at vertex {vertices[stuck[0]]} fold one pair after the other and not at "
            "once, so the closed form does not hold for them."
        )
    more = np.concatenate([unequal[0], equal[0], unequal[0]])
    less = np.concatenate([unequal[1], equal[1], equal[0]])
    step = np.concatenate([np.zeros(2 * len(row)), np.log(ratio)])
    speeds = sign * np.exp(_potential(len(sign), more, less, step))
    folding = speeds[speeds != 0]
    return speeds / float(np.median(np.abs(folding))) if len(folding) else speeds


def _vertices_of_four(pattern: CreasePattern) -> tuple[Ints, Floats, Ints]:
    """The interior vertices of degree four: their edges (n, 4) counter-clockwise, the sector (n, 4)
    after each edge, radians, and their numbers (n,). All of their edges fold.
    """
    ring = corner_ring(pattern, np.pad(pattern.vertices_coords, ((0, 0), (0, 1))))
    corners = np.flatnonzero(ring.vertex >= 0)
    start = np.full(len(pattern.vertices_coords), -1, dtype=np.int64)
    start[ring.vertex[corners]] = corners
    first = start[interior_vertices(pattern)]
    around = [first]
    for _ in range(4):
        around.append(ring.following[around[-1]])
    four = around[4] == first
    corner = np.stack(around[:4], axis=1)[four]
    spokes = pattern.faces_edges.reshape(-1)[corner]
    folds = np.isin(pattern.edges_assignment[spokes], ("M", "V")).all(axis=1)
    return spokes[folds], ring.angle[corner[folds]], ring.vertex[first[four][folds]]


def _potential(count: int, more: Ints, less: Ints, step: Floats) -> Floats:
    """(count,) w with w[more] - w[less] = step in the least squares, of mean zero in each part."""
    rows = np.tile(np.arange(len(more)), 2)
    ends = np.concatenate([more, less])
    signs = np.repeat([1.0, -1.0], len(more))
    difference = coo_array((signs, (rows, ends)), shape=(len(more), count)).tocsc()
    laplacian = difference.T @ difference
    _, part = connected_components(laplacian, directed=False)
    # an anchor on the first of each part, which the mean then replaces
    anchored = np.zeros(count)
    anchored[np.unique(part, return_index=True)[1]] = 1.0
    system = coo_array((anchored, (np.arange(count), np.arange(count)))).tocsc() + laplacian
    potential = np.asarray(spsolve(system, difference.T @ step))
    mean = np.bincount(part, potential) / np.bincount(part)
    centred: Floats = potential - mean[part]
    return centred
