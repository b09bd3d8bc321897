"""Fold angle multipliers: the ratios of tan(rho / 2), from mountains and valleys alone.

At a flat-foldable vertex of degree four one crease differs in assignment from the three others.
This crease and the opposite crease fold by equal and opposite angles; the other two fold by equal
angles. With t = tan(rho / 2), and a and b the sectors on both sides of one of the other two,

    |t of the unequal pair| / |t of the equal pair| = |sin((a - b) / 2) / sin((a + b) / 2)|

(Tachi, "Generalization of rigid foldable quadrilateral mesh origami", IASS 2009, eq. 1.) The
logarithms satisfy linear equations between creases, which are solved for the whole sheet at once.
The equations are consistent only if the sheet folds rigidly, which the loop mismatch shows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from miurafab.errors import PatternError
from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.connected import components
from miurafab.origami.crease_pattern import UNCREASED, CreasePattern
from miurafab.origami.invariants import corner_ring, interior_vertices


def fold_angle_multipliers(pattern: CreasePattern) -> Floats:
    """(E,) tan(rho / 2) of each crease when the median of the folding creases is at 90 degrees.

    Mountains are negative; creases that are neither mountain nor valley do not fold. At a vertex of
    two creases both fold alike. Vertices of other degrees than two and four are skipped; edges of
    letter F do not count. Raises :class:`~miurafab.errors.PatternError` for a vertex
    whose creases cannot fold together.
    """
    sign = np.where(pattern.edges_assignment == "V", 1.0, 0.0)
    sign[pattern.edges_assignment == "M"] = -1.0
    spokes, sectors, vertices = _vertices_of(pattern, 4)
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
            f"The creases at vertex {vertices[stuck[0]]} fold one pair after the other and not "
            "together, so the closed form does not hold for them."
        )
    straight = _vertices_of(pattern, 2).spokes
    more = np.concatenate([unequal[0], equal[0], unequal[0], straight[:, 0]])
    less = np.concatenate([unequal[1], equal[1], equal[0], straight[:, 1]])
    step = np.concatenate([np.zeros(2 * len(row)), np.log(ratio), np.zeros(len(straight))])
    multipliers = sign * np.exp(_potential(len(sign), more, less, step))
    folding = np.abs(multipliers[multipliers != 0])
    return multipliers / float(np.median(folding)) if len(folding) else multipliers


class _Vertices(NamedTuple):
    """n interior vertices at which d creases fold and all other edges are flat (F or J).

    Their creases ``spokes`` (n, d) counter-clockwise, the ``sectors`` (n, d) after each in radians,
    and their ``numbers`` (n,).
    """

    spokes: Ints
    sectors: Floats
    numbers: Ints


def _vertices_of(pattern: CreasePattern, degree: int) -> _Vertices:
    """The interior vertices at which ``degree`` creases fold."""
    ring = corner_ring(pattern, np.pad(pattern.vertices_coords, ((0, 0), (0, 1))))
    corners = np.flatnonzero(ring.vertex >= 0)
    start = np.full(len(pattern.vertices_coords), -1, dtype=np.int64)
    start[ring.vertex[corners]] = corners
    numbers = interior_vertices(pattern)
    first = start[numbers]
    edge = pattern.faces_edges.reshape(-1)
    folds = np.isin(pattern.edges_assignment, ("M", "V"))
    still = np.isin(pattern.edges_assignment, UNCREASED)
    spokes = np.full((len(first), degree), -1, dtype=np.int64)
    at = np.zeros((len(first), degree))
    count, turned = np.zeros(len(first), dtype=np.int64), np.zeros(len(first))
    sound = np.ones(len(first), dtype=bool)
    corner, going = first.copy(), np.ones(len(first), dtype=bool)
    while going.any():
        here = edge[corner]
        sound &= ~going | folds[here] | still[here]
        row = np.flatnonzero(going & folds[here] & (count < degree))
        spokes[row, count[row]], at[row, count[row]] = here[row], turned[row]
        count += going & folds[here]
        turned += np.where(going, ring.angle[corner], 0.0)
        corner = np.where(going, ring.following[corner], corner)
        going &= corner != first
    chosen = sound & (count == degree)
    at, turned = at[chosen], turned[chosen, None]
    sectors = np.diff(at, axis=1, append=at[:, :1] + turned)
    return _Vertices(spokes[chosen], sectors, numbers[chosen])


def _potential(count: int, more: Ints, less: Ints, step: Floats) -> Floats:
    """(count,) w with w[more] - w[less] = step by least squares, of mean zero in each part."""
    from scipy.sparse import coo_array

    from miurafab.geometry.sparse import factor_symmetric

    rows = np.tile(np.arange(len(more)), 2)
    ends = np.concatenate([more, less])
    signs = np.repeat([1.0, -1.0], len(more))
    difference = coo_array((signs, (rows, ends)), shape=(len(more), count)).tocsc()
    laplacian = difference.T @ difference
    part = components(count, more, less)
    # the first of each part is anchored at 0; the mean is removed at the end
    anchored = np.zeros(count)
    anchored[np.unique(part, return_index=True)[1]] = 1.0
    system = coo_array((anchored, (np.arange(count), np.arange(count)))).tocsc() + laplacian
    potential = factor_symmetric(system).solve(difference.T @ step)
    mean = np.bincount(part, potential) / np.bincount(part)
    return np.asarray(potential - mean[part])
