"""Array types, and runs of different lengths laid end to end in one array.

``counts`` (n,) are the lengths of the runs: counts 2, 0, 3 describe five items, of which the first
two belong to run 0 and the last three to run 2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def run_starts(counts: Ints) -> Ints:
    """(n,) the index of the first item of each run: 0, 2, 2 for counts 2, 0, 3."""
    return np.cumsum(counts) - counts


def group_means(points: Floats | Ints, group: Ints) -> Floats:
    """(g, d) the mean of the ``points`` (n, d) of each ``group`` (n,), numbered from 0."""
    sums = [np.bincount(group, points[:, axis]) for axis in range(points.shape[1])]
    return np.stack(sums, axis=1) / np.bincount(group)[:, None]


def nearest_to_means(points: Floats | Ints, group: Ints) -> Ints:
    """(g,) of each ``group`` (n,) the first of its ``points`` (n, d) nearest to their mean."""
    away = np.linalg.norm(points - group_means(points, group)[group], axis=1)
    return np.lexsort((away, group))[run_starts(np.bincount(group))]


def places_in_runs(counts: Ints) -> Ints:
    """(sum of counts,) the place of each item in its own run: 0, 1, 0, 1, 2 for counts 2, 0, 3."""
    return np.arange(counts.sum()) - np.repeat(run_starts(counts), counts)


def places_among(known: Ints, wanted: Ints) -> Ints:
    """(n,) the place of each of ``wanted`` (n,) among the ``known`` (m,), which ascend; -1 where it
    is none of them.
    """
    if not len(known):
        return np.full(len(wanted), -1, dtype=np.int64)
    at = np.searchsorted(known, wanted).clip(max=len(known) - 1)
    return np.asarray(np.where(known[at] == wanted, at, -1))


def vector_product(a: Floats, b: Floats) -> Floats:
    """(..., 3) the vector product of ``a`` and ``b``, of which the last axis holds x, y, z.

    The numbers of ``numpy.cross``, which spends most of its time on the choice of axes where the
    arrays are small: it took a tenth of a fit.
    """
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    u, v, w = b[..., 0], b[..., 1], b[..., 2]
    product = np.empty(np.broadcast(a, b).shape)
    np.subtract(y * w, z * v, out=product[..., 0])
    np.subtract(z * u, x * w, out=product[..., 1])
    np.subtract(x * v, y * u, out=product[..., 2])
    return product
