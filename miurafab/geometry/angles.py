"""Angles between edges at a vertex, and between facets at an edge."""

from __future__ import annotations

import numpy as np

from miurafab.geometry.arrays import Floats, Ints, vector_product


def angle_between(a: Floats, b: Floats) -> Floats:
    """The angles in [0, pi] between vectors ``a`` and ``b``, both (..., 3), radians.

    atan2(|a x b|, a . b), which keeps its accuracy near 0 and pi, unlike arccos.
    """
    cross = np.linalg.norm(vector_product(a, b), axis=-1)
    return np.asarray(np.arctan2(cross, np.einsum("...k,...k->...", a, b)))


def sectors(a: Floats, b: Floats) -> tuple[Floats, Floats, Floats]:
    """The angles between ``a`` and ``b``, both (..., 3), and their gradients by ``a`` and by ``b``.

    With n = a x b / |a x b|: d alpha / d a = (a x n) / |a|^2 and d alpha / d b = (n x b) / |b|^2.
    """
    cross = vector_product(a, b)
    sine = np.linalg.norm(cross, axis=-1)
    angle = np.arctan2(sine, np.einsum("...k,...k->...", a, b))
    n = cross / sine[..., None]
    to_a = vector_product(a, n) / np.einsum("...k,...k->...", a, a)[..., None]
    to_b = vector_product(n, b) / np.einsum("...k,...k->...", b, b)[..., None]
    return angle, to_a, to_b


def sector_angles(points: Floats, vertices: Ints, ring: Ints) -> Floats:
    """(I, 4) sector angles at ``vertices`` (I,) with neighbours ``ring`` (I, 4), radians.

    Sector k lies between neighbour k and the next. ``points`` is (V, 3).
    """
    spokes = points[ring] - points[vertices][:, None, :]
    return angle_between(spokes, np.roll(spokes, -1, axis=1))


def fold_angles(points: Floats, edges: Ints, left: Floats, right: Floats) -> Floats:
    """(E,) signed fold angles, valley positive, radians.

    ``edges`` (E, 2) run from tail to head; ``left`` and ``right`` (E, 3) are the unit normals of
    the facets on either side: rho = -atan2((left x right) . e, left . right), the FOLD 1.2
    convention for counter-clockwise faces.
    """
    along = points[edges[:, 1]] - points[edges[:, 0]]
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    sine = np.einsum("ek,ek->e", vector_product(left, right), along)
    return np.asarray(-np.arctan2(sine, np.einsum("ek,ek->e", left, right)))
