"""Kerf compensation: the line the beam follows so that the piece has its nominal outline.

The beam burns kerf / 2 to each side of its path, so the path is the outline moved outwards by
kerf / 2, with mitred corners so that corners stay sharp. A mitre is cut off at twice kerf / 2 from
its corner (below 60 degrees); the beam then takes less than 0.3 kerf off the tip. Where two parts
of an outline are nearer to each other than the kerf the path may close a ring around waste; those
rings are paths too.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

MITRE_LIMIT = 2.0


def allowance(kerf: float) -> float:
    """How far in mm the cut line may lie outside the nominal outline."""
    return MITRE_LIMIT * kerf / 2


def cut_lines(
    outlines: Sequence[NDArray[np.float64]], kerf: float
) -> list[list[NDArray[np.float64]]]:
    """For each simple closed outline (n, 2), not repeating its first point, the closed cut lines
    (m, 2) in mm, likewise: the outer one first, counter-clockwise.
    """
    if kerf == 0.0:
        return [[outline] for outline in outlines]
    polygons = np.array([shapely.Polygon(outline) for outline in outlines])
    moved = shapely.buffer(polygons, kerf / 2, join_style="mitre", mitre_limit=MITRE_LIMIT)
    found = []
    for polygon in moved:
        outer, *inner = shapely.get_rings(polygon)
        lines = [shapely.get_coordinates(ring)[:-1] for ring in (outer, *inner)]
        if not shapely.is_ccw(outer):
            lines[0] = lines[0][::-1]
        found.append(lines)
    return found
