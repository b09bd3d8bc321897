"""Parts of a drawing that lie loose inside a facet, such as windows and closed creases.

A facet with a part inside is no polygon. Two flat lines join each such part to what is left and
right of it: one from its corner that is farthest to the left, straight to the left up to the first
line, and one to the right. They run inside the facet alone and cut it into polygons.
"""

from __future__ import annotations

import numpy as np

from miurafab.errors import PatternError
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.boxes import meeting_pairs
from miurafab.geometry.polygons import filled

_AT_ONCE = 1_000_000
"""Corners of facets that are compared with a point in one step."""


class LoosePartsError(PatternError):
    """Parts lie loose inside facets; ``bridges`` (n, 2, 2) are the ends of lines that join them."""

    def __init__(self, sentence: str, bridges: Floats, parts: int) -> None:
        super().__init__(sentence)
        self.bridges = bridges
        self.parts = parts


def refuse_loose_parts(points: Floats, sides: Ints, faces: Ints, piece: Ints) -> None:
    """Refuse pieces that lie inside a facet of another: the first corner of each shows it.

    ``points`` (V, 2), ``sides`` (E, 2), ``faces`` (F, k), ``piece`` (F,) of each. Raises
    :class:`LoosePartsError`.
    """
    corner = faces[np.unique(piece, return_index=True)[1], 0]
    depth = facets_around(points, faces, piece, points[corner])
    loose = np.flatnonzero(depth)
    if not len(loose):
        return
    x, y = points[corner[loose[0]]]
    nested = loose[depth[loose] > 1]
    what = f"A part of the drawing, at ({x:.6g}, {y:.6g}), lies loose inside a facet of another"
    if len(nested):
        x, y = points[corner[nested[0]]]
        what = f"A part of the drawing, at ({x:.6g}, {y:.6g}), lies loose inside a loose part"
    bridges = [] if len(nested) else [_beside(points, sides, faces[piece == at]) for at in loose]
    raise LoosePartsError(
        what + "; join them by a crease, or give a larger `tolerance`.",
        np.array(bridges).reshape(-1, 2, 2),
        len(loose),
    )


def _beside(points: Floats, sides: Ints, faces: Ints) -> Floats:
    """(2, 2, 2) the flat lines to the left and to the right of a loose part of ``faces``."""
    own = np.unique(faces[faces >= 0])
    others = points[sides[~np.isin(sides, own).any(axis=1)]]
    lines = []
    for away in (-1.0, 1.0):
        start = points[own[np.argmax(away * points[own, 0])]]
        over = _passes(others[:, 0], others[:, 1], start)
        reach = away * (_crossing(others[over, 0], others[over, 1], start[1]) - start[0])
        lines.append([start, start + np.array([away * reach[reach > 0].min(), 0.0])])
    return np.array(lines)


def facets_around(points: Floats, faces: Ints, piece: Ints, places: Floats) -> Ints:
    """(n,) the number of facets of other pieces in which the place (n, 2) of each piece lies;
    of all facets where their ``piece`` (F,) is -1.
    """
    start = points[filled(faces)]
    end = np.roll(start, -1, axis=1)
    low, high = (
        np.pad(np.concatenate([ends, places]), ((0, 0), (0, 1)))
        for ends in (start.min(axis=1), start.max(axis=1))
    )
    facet, other = meeting_pairs(low, high)
    other = other - len(faces)
    near = (facet < len(faces)) & (other >= 0)
    near[near] = piece[facet[near]] != other[near]
    facet, other = facet[near], other[near]
    depth = np.zeros(len(places), dtype=np.int64)
    for at in np.array_split(np.arange(len(facet)), 1 + facet.size * faces.shape[1] // _AT_ONCE):
        a, b, place = start[facet[at]], end[facet[at]], places[other[at], None]
        with np.errstate(invalid="ignore", divide="ignore"):
            right = _passes(a, b, place) & (_crossing(a, b, place[..., 1]) > place[..., 0])
        np.add.at(depth, other[at], right.sum(axis=1) % 2)
    return depth


def _passes(a: Floats, b: Floats, place: Floats) -> Bools:
    """Whether the line from ``a`` to ``b`` passes the height of ``place``."""
    return np.asarray((a[..., 1] > place[..., 1]) != (b[..., 1] > place[..., 1]))


def _crossing(a: Floats, b: Floats, height: Floats) -> Floats:
    """Where the line through ``a`` and ``b`` passes a ``height``."""
    part = (height - a[..., 1]) / (b[..., 1] - a[..., 1])
    return np.asarray(a[..., 0] + part * (b[..., 0] - a[..., 0]))
