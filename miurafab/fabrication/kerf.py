"""Kerf compensation: the line the beam follows so that the piece has its nominal outline.

The beam burns kerf / 2 to each side of its path, so the path is the outline moved outwards by
kerf / 2, with mitred corners so that corners stay sharp. The mitre of a corner below 60 degrees is
cut off square, at a distance of kerf from the corner: farther than kerf / 2, so the tip stays
whole. Where two parts of an outline are nearer to each other than the kerf the path may close a
ring around waste; those rings are paths too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely

from miurafab.geometry.arrays import Floats

MITRE_LIMIT = 2.0


def allowance(kerf: float) -> float:
    """How far in mm the cut line may lie outside the nominal outline: the ends of a mitre that is
    cut off lie less than kerf / 2 to the side of its middle.
    """
    return math.hypot(MITRE_LIMIT, 1.0) * kerf / 2


def cut_lines(outlines: Sequence[Floats], kerf: float) -> list[list[Floats]]:
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
