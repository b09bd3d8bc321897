"""Cut lines: the paths of the beam, with kerf compensation and holding bridges.

The beam burns kerf / 2 to each side of its path, so the path is the outline offset outwards by
kerf / 2, with mitred corners so that corners stay sharp. The mitre of a corner below 60 degrees is
cut off square, at a distance of kerf from the corner; that is farther than kerf / 2, so the corner
stays whole. At a corner that is hardly below 60 degrees this end would be a speck, which some
programs drop. It is made :data:`SHORTEST_MM` wide, which moves it nearer to the corner; where it
would come nearer than kerf / 2, the mitre is left whole. The path around a hole lies inside it. If
two parts of an outline are nearer than the kerf, the path may close a ring around waste; these
rings are paths, too. Holding bridges are gaps in a path that keep a patch in its sheet until it is
taken out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely

from miurafab.geometry.arrays import Floats

MITRE_LIMIT = 2.0
SHORTEST_MM = 0.05
"""No end of a mitre is shorter: programs merge points that are nearer (judged; issue 57 of boxes.py
tells of one that does within 0.1 mm).
"""
_TIP_MM = 0.2
"""A whole mitre is at most so much longer than a mitre that is cut off."""


def allowance(kerf: float) -> float:
    """The largest distance in mm of the cut line from the nominal outline. The ends of a mitre that
    is cut off lie less than kerf / 2 to the side of its middle. A wider end than that lies nearer;
    only below a kerf of 0.0866 mm (tan 60 deg times :data:`SHORTEST_MM`) mitres are left whole.
    """
    cut_off = math.hypot(MITRE_LIMIT, 1.0) * kerf / 2
    whole = kerf >= math.tan(math.pi / 3) * SHORTEST_MM or kerf == 0.0
    return cut_off if whole else max(cut_off, kerf + _TIP_MM)


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
        lines = [
            _without_specks(shapely.get_coordinates(ring)[:-1], kerf, hole=place > 0)
            for place, ring in enumerate((outer, *inner))
        ]
        if not shapely.is_ccw(outer):
            lines[0] = lines[0][::-1]
        found.append(lines)
    return found


def _without_specks(ring: Floats, kerf: float, hole: bool) -> Floats:
    """The closed ``ring`` (n, 2), in which no cut-off mitre ends in less than :data:`SHORTEST_MM`,
    and no side is shorter beside a corner that points into the piece. Such a corner, as between two
    tabs that nearly meet, is left out, so that the line goes round the piece a little farther away.

    With half the turn t at such an end, the mitre's tip lies kerf / (2 cos t) from the corner, and
    an end of width w lies (w / 2) tan t nearer. It goes back from the tip by w / (2 cos t) along
    both sides.
    """
    step = np.roll(ring, -1, axis=0) - ring
    length = np.linalg.norm(step, axis=1)
    specks = np.flatnonzero(length < SHORTEST_MM)
    if not len(specks):
        return ring
    ahead = step / length[:, None]
    inwards = -1.0 if shapely.LinearRing(ring).is_ccw != hole else 1.0
    points: list[Floats] = [corner[None] for corner in ring]
    for k in specks.tolist():
        following = (k + 1) % len(ring)
        into, out = ahead[k - 1], ahead[following]
        turn = math.atan2(into[0] * out[1] - into[1] * out[0], into @ out) % (2 * math.pi)
        half = min(turn, 2 * math.pi - turn) / 2
        if not math.pi / 3 - 1e-6 < half < math.pi / 2:  # no mitre
            for place in (k, following):
                one, other = ahead[place - 1], ahead[place]
                if inwards * (one[0] * other[1] - one[1] * other[0]) > 0:
                    points[place] = np.empty((0, 2))
                    break
            continue
        to_tip = length[k] / (2 * math.cos(half))
        tip = ring[k] + to_tip * into
        back = SHORTEST_MM / (2 * math.cos(half))
        if kerf / (2 * math.cos(half)) - back * math.sin(half) >= kerf / 2:
            points[k], points[following] = (tip - back * into)[None], (tip + back * out)[None]
        elif to_tip * math.sin(half) <= _TIP_MM:
            points[k], points[following] = tip[None], np.empty((0, 2))
    return np.concatenate(points)


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
