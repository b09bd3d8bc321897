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

from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import coo_array, eye_array, hstack

from miurafab.errors import PatternError
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.ruled import bent_corners
from miurafab.origami.invariants import interior_vertices

MOST_BENT = 5000
"""Vertices of a sheet whose facets may have to bend from the start; finding how takes minutes."""
BESIDE = 1e-5
"""n.s_e d_e of what counts as on the line of a vertex, to either side of it, for the rounding of a
drawing: a fold that turns some ten thousand times slower than the others rests."""
SLACK = 1e-5
"""What may be left of the sum around a vertex, where one fold turns by 1: drawings are rounded, and
without it the program finds no answer for some of them."""
MOST_PIVOTS = 20_000
"""The most steps of the program. If they are not enough, only those folds are told that wait for
what is around single vertices."""


def waiting_folds(pattern: CreasePattern) -> Ints:
    """The edges (n,) of mountains and valleys of ``pattern`` that cannot turn at first.

    Edges of letter U turn to either side.
    """
    ends = _ends_inside(pattern)
    folds, free, rests = ends.folds, ends.free, _rests_at_vertices(ends)
    waiting, folds, free = folds[rests[folds]], folds[~rests[folds]], free[~rests[free]]
    rows = 2 * ends.vertices
    if not len(folds) or not rows:
        return waiting
    places = np.concatenate([ends.at, ends.at + ends.vertices])
    entries = (ends.away.T.ravel(), (places, np.tile(ends.edge, 2)))
    turns = coo_array(entries, shape=(rows, len(ends.sign))).tocsc()
    signed = turns[:, folds] * ends.sign[folds]
    loose = turns[:, free]
    # r = m + more, so that m <= r
    system: Any = hstack([signed, signed, loose, -loose, eye_array(rows)])
    count, rest = len(folds), len(folds) + 2 * len(free)
    bounds: list[tuple[float, float | None]] = [(0.0, 1.0)] * count
    bounds += [(0.0, None)] * rest
    bounds += [(-SLACK, SLACK)] * rows
    from scipy.optimize import linprog  # takes a tenth of a second to load

    best = linprog(
        np.concatenate([-np.ones(count), np.zeros(rest + rows)]),
        A_eq=system,
        b_eq=np.zeros(rows),
        bounds=bounds,
        method="highs",
        options={"maxiter": MOST_PIVOTS},
    )
    if best.status != 0 or best.x is None:
        return waiting
    return np.sort(np.concatenate([waiting, folds[best.x[:count] < 0.5]]))


def refuse_locked(pattern: CreasePattern, edges: Ints) -> None:
    """Raise :class:`~miurafab.errors.PatternError` for a large ``pattern`` half of whose folds
    cannot begin for what is around single vertices, beside folds of curved creases, where facets
    bend in any case. The message names them by their numbers ``edges`` (E,) in the whole sheet.
    """
    if len(pattern.vertices_coords) <= MOST_BENT:
        return
    ends = _ends_inside(pattern)
    curved = np.asarray(bent_corners(pattern)[pattern.edges_vertices].any(axis=1))
    folds = ends.folds[~curved[ends.folds]]
    waiting = folds[_rests_at_vertices(ends)[folds]]
    if not len(folds) or 2 * len(waiting) < len(folds):
        return
    raise PatternError(
        f"The pattern was not folded: with flat facets {len(waiting)} of its {len(ends.folds)} "
        f"folds cannot begin from flat if none shall turn to its wrong side, the first being edge "
        f"{edges[waiting[0]]}. Either letters are wrong, or it folds in a sequence, or its facets "
        f"have to bend from the start, which is looked for in sheets of up to {MOST_BENT} vertices "
        f"(it has {len(pattern.vertices_coords)}). Fold a part of it."
    )


class _Ends(NamedTuple):
    """The n ends of edges at one of ``vertices`` inside: of the ``edge`` (n,), ``at`` (n,) the
    vertex, from which the unit vector ``away`` (n, 2) leads. The ``folds`` turn to the side
    ``sign`` (E,), which is 0 for others, and the edges ``free`` to both.
    """

    vertices: int
    edge: Ints
    at: Ints
    away: Floats
    sign: Ints
    folds: Ints
    free: Ints


def _ends_inside(pattern: CreasePattern) -> _Ends:
    inner = (pattern.edges_faces >= 0).all(axis=1)
    letters = pattern.edges_assignment
    sign = np.where(inner, np.select([letters == "M", letters == "V"], [-1, 1], 0), 0)
    vertices = interior_vertices(pattern)
    row = np.full(len(pattern.vertices_coords), -1, dtype=np.int64)
    row[vertices] = np.arange(len(vertices))
    ends = pattern.edges_vertices
    edge, end = np.nonzero(row[ends] >= 0)
    along = pattern.vertices_coords[ends[:, 1]] - pattern.vertices_coords[ends[:, 0]]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    away = np.where(end == 0, 1.0, -1.0)[:, None] * along[edge]
    free = np.flatnonzero(inner & (letters == "U"))
    at = row[ends[edge, end]]
    return _Ends(len(vertices), edge, at, away, sign, np.flatnonzero(sign), free)


def _rests_at_vertices(ends: _Ends) -> Bools:
    """(E,) which edges must rest for what is around one of their ends, or for what rests there."""
    sign, away = ends.sign, ends.away
    both = np.flatnonzero(np.isin(ends.edge, ends.free))
    signed = np.concatenate([sign[ends.edge, None] * away, away[both], -away[both]])
    edge, at = (np.concatenate([each, each[both], each[both]]) for each in (ends.edge, ends.at))
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
        one_side = np.minimum.reduceat(height, first) >= -BESIDE
        still = np.repeat(one_side, last - first + 1) & (height > BESIDE)
        if not still.any():
            break
        rests[edge[still]] = True
        moves = ~rests[edge]
        edge, at, signed, angle = edge[moves], at[moves], signed[moves], angle[moves]
    return rests
