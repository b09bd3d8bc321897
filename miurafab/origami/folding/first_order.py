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

What cannot turn for one vertex alone is left out first, since the program takes minutes at 30,000
vertices. If all s_e d_e of a vertex lie on one side of a line through it, n.s_e d_e >= 0, those
beside the line must rest, since nothing balances them. What rests counts for nothing at its other
end, and so on.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, eye_array, hstack

from miurafab.errors import PatternError
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.ruled import bent_corners
from miurafab.origami.invariants import interior_vertices

MOST_BENT = 5000
"""Vertices of a sheet whose facets may have to bend from the start; finding how takes minutes."""
BEHIND, BESIDE = 1e-9, 1e-5
"""n.s_e d_e of what counts as on the line of a vertex, and as beside it: a fold that turns some ten
thousand times slower than the others rests."""
SLACK = 1e-5
"""What may be left of the sum around a vertex, where one fold turns by 1: drawings are rounded, and
without it the program finds no answer for some of them."""
MOST_PIVOTS = 20_000
"""The most steps of the program, which take half a minute. If they are not enough, only those folds
are told that wait for what is around single vertices."""


def waiting_folds(pattern: CreasePattern) -> Ints:
    """The edges (n,) of mountains and valleys of ``pattern`` that cannot turn at first.

    Edges of letter U turn to either side.
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
    rests = _rests_at_vertices(edge, at, away, np.where(inner, sign, 0), free)
    waiting, folds, free = folds[rests[folds]], folds[~rests[folds]], free[~rests[free]]
    if not len(folds):
        return waiting
    entries = (away.T.ravel(), (np.concatenate([at, at + len(vertices)]), np.tile(edge, 2)))
    turns = coo_array(entries, shape=(2 * len(vertices), len(ends))).tocsc()
    signed = turns[:, folds] * sign[folds]
    loose = turns[:, free]
    # r = m + more, so that m <= r
    system = hstack([signed, signed, loose, -loose, eye_array(2 * len(vertices))])
    count, rest = len(folds), len(folds) + 2 * len(free)
    from scipy.optimize import linprog  # takes a tenth of a second to load

    best = linprog(
        np.concatenate([-np.ones(count), np.zeros(rest + 2 * len(vertices))]),
        A_eq=system,
        b_eq=np.zeros(2 * len(vertices)),
        bounds=[(0, 1)] * count + [(0, None)] * rest + [(-SLACK, SLACK)] * 2 * len(vertices),
        method="highs",
        options={"maxiter": MOST_PIVOTS},
    )
    if best.status != 0:
        return waiting
    return np.sort(np.concatenate([waiting, folds[best.x[:count] < 0.5]]))


def refuse_locked(pattern: CreasePattern) -> None:
    """Raise :class:`~miurafab.errors.PatternError` for a large ``pattern`` half of whose folds
    cannot begin, beside those of curved creases, where facets bend in any case.
    """
    if len(pattern.vertices_coords) <= MOST_BENT:
        return
    curved = bent_corners(pattern)[pattern.edges_vertices].any(axis=1)
    inner = (pattern.edges_faces >= 0).all(axis=1)
    folds = np.flatnonzero(inner & np.isin(pattern.edges_assignment, ("M", "V")) & ~curved)
    waiting = waiting_folds(pattern)
    waiting = waiting[~curved[waiting]]
    if 2 * len(waiting) < len(folds):
        return
    raise PatternError(
        f"The pattern was not folded: with flat facets {len(waiting)} of its {len(folds)} folds "
        f"cannot begin from flat if none shall turn to its wrong side, the first being edge "
        f"{waiting[0]}. Either letters are wrong, or it folds in a sequence, or its facets have to "
        f"bend from the start, which is looked for in sheets of up to {MOST_BENT} vertices (it has "
        f"{len(pattern.vertices_coords)}). Fold a part of it."
    )


def _rests_at_vertices(edge: Ints, at: Ints, away: Floats, sign: Ints, free: Ints) -> Bools:
    """(E,) which edges must rest for what is around one of their ends, or for what rests there.

    The ends are n rays along ``away`` (n, 2) of the ``edge`` (n,) from the vertex ``at`` (n,). An
    edge turns to the side ``sign`` (E,), if not 0, or is one of those ``free`` to turn to both.
    """
    both = np.flatnonzero(np.isin(edge, free))
    signed = np.concatenate([sign[edge, None] * away, away[both], -away[both]])
    edge, at = (np.concatenate([each, each[both], each[both]]) for each in (edge, at))
    angle = np.arctan2(signed[:, 1], signed[:, 0])
    order = np.lexsort([angle, at])
    order = order[signed[order].any(axis=1)]
    edge, at, signed, angle = edge[order], at[order], signed[order], angle[order]
    rests = np.zeros(len(sign), dtype=bool)
    while len(edge):
        first = np.flatnonzero(np.diff(at, prepend=-1))
        last = np.append(first[1:], len(at)) - 1
        gap = np.diff(angle, append=0.0)
        gap[last] = angle[first] + 2 * np.pi - angle[last]
        widest = np.maximum.reduceat(gap, first)
        # the middle of the widest gap lies behind the line, if there is one
        place = np.flatnonzero(gap == np.repeat(widest, last - first + 1))
        place = place[np.diff(at[place], prepend=-1) != 0]
        middle = angle[place] + gap[place] / 2
        across = -np.stack([np.cos(middle), np.sin(middle)], axis=1)
        height = np.einsum("nk,nk->n", signed, np.repeat(across, last - first + 1, axis=0))
        one_side = np.minimum.reduceat(height, first) >= -BEHIND
        still = np.repeat(one_side, last - first + 1) & (height > BESIDE)
        if not still.any():
            break
        rests[edge[still]] = True
        moves = ~rests[edge]
        edge, at, signed, angle = edge[moves], at[moves], signed[moves], angle[moves]
    return rests
