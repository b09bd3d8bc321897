"""Cut lines: the paths of the beam, with kerf compensation and holding bridges.

The beam burns kerf / 2 to each side of its path, so the path is the outline offset outwards by
kerf / 2, with mitred corners so that corners stay sharp. The mitre of a corner below 60 degrees is
cut off square, at a distance of kerf from the corner; that is farther than kerf / 2, so the corner
stays whole. The path around a hole lies inside it. If two parts of an outline are nearer than the
kerf, the path may close a ring around waste; these rings are paths, too. Holding bridges are gaps
in a path that keep a patch in its sheet until it is taken out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely

from miurafab.geometry.arrays import Floats

MITRE_LIMIT = 2.0


def allowance(kerf: float) -> float:
    """The largest distance in mm of the cut line from the nominal outline. The ends of a mitre that
    is cut off lie less than kerf / 2 to the side of its middle.
    """
    return math.hypot(MITRE_LIMIT, 1.0) * kerf / 2


def cut_lines(outlines: Sequence[Sequence[Floats]], kerf: float) -> list[list[Floats]]:
    """The closed cut lines (m, 2) in mm of each outline, whose rings (n, 2) are the outer one and
    those around holes: the outer line first, counter-clockwise. No line repeats its first point.
    """
    if kerf == 0.0:
        return [list(rings) for rings in outlines]
    polygons = np.array([shapely.Polygon(rings[0], rings[1:]) for rings in outlines])
    moved = shapely.buffer(polygons, kerf / 2, join_style="mitre", mitre_limit=MITRE_LIMIT)
    found = []
    for polygon in moved:
        outer, *inner = shapely.get_rings(polygon)
        lines = [shapely.get_coordinates(ring)[:-1] for ring in (outer, *inner)]
        if not shapely.is_ccw(outer):
            lines[0] = lines[0][::-1]
        found.append(lines)
    return found


def bridged(ring: Floats, count: int, gap: float) -> list[Floats]:
    """The closed ``ring`` (n, 2) cut in ``count`` lines with bridges of ``gap`` mm between them.

    Each bridge lies in the middle of a side of its own, so that it holds no corner; a side shorter
    than three gaps gets none. The bridges go to the sides nearest to evenly spaced points of the
    ring. There are fewer bridges than asked for only if fewer sides can bear one; a ring that could
    have only one stays whole.
    """
    # Of places equal up to rounding the first is taken, so that rounding decides nothing.
    length = np.linalg.norm(np.diff(ring, axis=0), axis=1)
    side = np.round(length, 3)
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
        chosen.append(int(able[np.argmin(np.round(off, 3))]))
    at = np.sort(chosen)
    way = (ring[at + 1] - ring[at]) / length[at, None] * (gap / 2)
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
