"""Pairs of axis-aligned boxes that meet, for many boxes at once: the broad phase of collisions.

Each box is entered in every cell of a uniform grid that it reaches. Boxes that meet share a cell.
Boxes much larger than most would fill too many cells, so boxes are sorted into levels by size. The
cells double from level to level, and a box is compared in its own level and all coarser levels.
"""

from __future__ import annotations

import numpy as np

from miurafab.geometry.arrays import Bools, Floats, Ints, places_in_runs


def meeting_pairs(low: Floats, high: Floats) -> tuple[Ints, Ints]:
    """The indices (n,), (n,) of the pairs of closed boxes ``low`` to ``high`` (B, 3) that meet.

    Each pair comes once. The same input gives the same order.
    """
    extent = (high - low).max(axis=1)
    typical = float(np.median(extent)) if len(extent) else 0.0
    if typical <= 0:
        typical = max(float(extent.max(initial=0.0)), 1.0)
    ratio = np.maximum(extent / typical, 1.0)
    level = np.ceil(np.log2(ratio) - 1e-9).astype(np.int64)
    origin = low.min(axis=0) if len(low) else np.zeros(3)
    firsts, seconds = [], []
    for coarse in np.unique(level).tolist():
        cell = typical * 2.0**coarse
        boxes = np.flatnonzero(level <= coarse)
        large = level[boxes] == coarse
        a, b = _sharing_cells(
            np.floor((low[boxes] - origin) / cell).astype(np.int64),
            np.floor((high[boxes] - origin) / cell).astype(np.int64),
            large,
        )
        a, b = boxes[a], boxes[b]
        meet = ((low[a] <= high[b]) & (low[b] <= high[a])).all(axis=1)
        firsts.append(a[meet])
        seconds.append(b[meet])
    if not firsts:
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    keys = np.unique(np.concatenate(firsts) * len(low) + np.concatenate(seconds))
    return keys // len(low), keys % len(low)


def _sharing_cells(first: Ints, last: Ints, large: Bools) -> tuple[Ints, Ints]:
    """Pairs (a < b) of boxes that share a cell, at least one of them ``large``; pairs may repeat.

    ``first`` and ``last`` (B, 3) are the range of cells of each box.
    """
    spans = last - first + 1
    counts = spans.prod(axis=1)
    box = np.repeat(np.arange(len(first)), counts)
    within = places_in_runs(counts)
    cell = first[box].copy()
    for axis in range(3):
        cell[:, axis] += within % spans[box, axis]
        within //= spans[box, axis]
    size = last.max(axis=0, initial=0) + 1
    key = (cell[:, 0] * size[1] + cell[:, 1]) * size[2] + cell[:, 2]
    order = np.argsort(key, kind="stable")
    key, box = key[order], box[order]
    pairs_a, pairs_b = [], []
    # the n-th entry after each entry in the same cell, for n = 1, 2, ... while there are any
    here = np.arange(len(key))
    step = 1
    while len(here):
        here = here[here + step < len(key)]
        here = here[key[here] == key[here + step]]
        a, b = box[here], box[here + step]
        wanted = large[a] | large[b]
        pairs_a.append(np.minimum(a[wanted], b[wanted]))
        pairs_b.append(np.maximum(a[wanted], b[wanted]))
        step += 1
    return np.concatenate(pairs_a), np.concatenate(pairs_b)
