"""Holding bridges: gaps in an outline, so that a piece stays in its sheet until it is taken out."""

from __future__ import annotations

import numpy as np

from miurafab.geometry.arrays import Floats


def bridged(ring: Floats, count: int, gap: float) -> list[Floats]:
    """The closed ``ring`` (n, 2) in ``count`` pieces with gaps of ``gap`` mm between them.

    Each gap lies in the middle of a side of its own, so that no corner hangs on it; sides shorter
    than three gaps bear none. Of those that can, the ones nearest to evenly spaced points of the
    ring do. So there are fewer gaps than asked for only where fewer sides can bear one, and no
    fewer than two unless the ring stays whole.
    """
    side = np.linalg.norm(np.diff(ring, axis=0), axis=1)
    able = np.flatnonzero(side >= 3 * gap)
    count = min(count, len(able))
    if count < 2:
        return [ring]
    middle = np.cumsum(side) - side / 2
    first = middle[able[np.argmax(side[able])]]
    chosen: list[int] = []
    for k in range(count):
        target = (first + k * side.sum() / count) % side.sum()
        off = np.abs(middle[able] - target)
        off = np.minimum(off, side.sum() - off)
        off[np.isin(able, chosen)] = np.inf
        chosen.append(int(able[np.argmin(off)]))
    at = np.sort(chosen)
    way = (ring[at + 1] - ring[at]) / side[at, None] * (gap / 2)
    centre = (ring[at + 1] + ring[at]) / 2
    before, after = centre - way, centre + way
    corners = ring[:-1]
    found = []
    for k, start in enumerate(at.tolist()):
        stop = int(at[(k + 1) % len(at)])
        between = np.arange(start + 1, stop + 1 + (len(corners) if stop <= start else 0))
        ends = (after[k], corners[between % len(corners)], before[(k + 1) % len(at)])
        found.append(np.vstack(ends))
    return found
