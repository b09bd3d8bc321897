"""Where the frames of a motion lie in space: each on the frame before, all on a known form.

Only the shape of a frame follows from its fold angles. The frame nearest to the folded form (or to
flat, where no folded form is known) is laid on that form by the best rigid motion, and each other
frame on its neighbour. Each of several pieces folds by itself: it starts from its place in the flat
pattern, and the pieces stand as far apart as all their frames need.
"""

from __future__ import annotations

import numpy as np

from miurafab.geometry.arrays import Floats
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.piece import pieces_of, shelved

PLANAR = 1e-9
"""A shape that is thinner, as part of its size, lies in a plane."""


def laid_on_each_other(pattern: CreasePattern, states: Floats, frames: Floats) -> Floats:
    """``frames`` (T, V, 3) of ``pattern`` at ``states`` (T,), moved rigidly, piece by piece."""
    flat = np.pad(pattern.vertices_coords, ((0, 0), (0, 1)))
    pieces = pieces_of(pattern)
    if len(pieces) == 1:
        if pattern.folded_coords is None:
            return _laid(states, frames, flat, 0.0)
        return _laid(states, frames, pattern.folded_coords, 1.0)
    laid = np.empty_like(frames)
    for piece in pieces:
        own = piece.vertices
        laid[:, own] = _laid(states, frames[:, own], flat[own], 0.0)
    low = np.array([laid[:, piece.vertices, :2].min(axis=(0, 1)) for piece in pieces])
    high = np.array([laid[:, piece.vertices, :2].max(axis=(0, 1)) for piece in pieces])
    gap = float(edge_lengths(pattern.vertices_coords, pattern.edges_vertices).mean())
    for piece, move in zip(pieces, shelved(high - low, gap) - low, strict=True):
        laid[:, piece.vertices, :2] += move
    return laid


def _laid(states: Floats, frames: Floats, known: Floats, goal: float) -> Floats:
    """``frames`` laid on each other, that nearest to the state ``goal`` on ``known`` (V, 3)."""
    order = np.argsort(states, kind="stable")
    start = int(np.argmin(np.abs(states[order] - goal)))
    laid = np.empty_like(frames)
    laid[order[start]] = laid_on(frames[order[start]], known)
    for step in (1, -1):
        at = start + step
        while 0 <= at < len(order):
            laid[order[at]] = laid_on(frames[order[at]], laid[order[at - step]])
            at += step
    return laid


def laid_on(points: Floats, onto: Floats) -> Floats:
    """``points`` (V, 3) moved rigidly to lie on ``onto`` (V, 3) with the least squared distance.

    Two shapes in the plane of x and y stay in it: a sheet folded to a strip would leave the turn
    about the strip open. (W. Kabsch, Acta Cryst. A 32 (1976) 922.)
    """
    centre, goal = points.mean(axis=0), onto.mean(axis=0)
    size = float(np.ptp(onto, axis=0).max())
    planar = max(np.abs(points[:, 2]).max(), np.abs(onto[:, 2]).max()) <= PLANAR * size
    n = 2 if planar else 3
    u, _, vt = np.linalg.svd((points - centre)[:, :n].T @ (onto - goal)[:, :n])
    u[:, -1] *= np.sign(np.linalg.det(u @ vt))
    turn = np.eye(3)
    turn[:n, :n] = u @ vt
    return np.asarray((points - centre) @ turn + goal)
