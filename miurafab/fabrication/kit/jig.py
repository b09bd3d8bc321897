"""A jig: ribs of board that carry the folded shell while its glue sets.

Ribs in two directions are halved into each other and stand on a table. The upper edge of a rib
follows the target from below. In the plane of the rib, f(s) is the lowest point of the folded form
and p(s) the cubic next to it. The edge is

    p + opening(f - p)

where the opening (the greatest of the least, over a window of two median edges) cuts off what is
narrower than a pleat. An opening is never above its function, so no rib reaches into the shell, and
it touches the shell at the lowest pleats.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from miurafab.errors import OptionError
from miurafab.geometry.arrays import Floats
from miurafab.geometry.polygons import edge_lengths, filled
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.contact import triangulate

PLACES = (0.2, 0.5, 0.8)
"""Where the ribs stand, over the extent of the shell."""
BASE_MM = 20.0
"""The least height of a rib (judged: less would bend)."""
STEP_MM = 0.5
"""Between two points of an upper edge."""
PLAY_MM = 0.1
"""A slot is wider than the board by this."""
OPEN = 0.15
"""The sum of the area vectors over the sum of their lengths. A regular Miura-ori has 0.4; a shell
below this limit turns back under itself."""


@dataclass(frozen=True, eq=False)
class Rib:
    """A rib called ``name``: its ``outline`` (n, 2) in mm, the table at 0, and the point that lies
    at ``place_mm`` of the other direction.
    """

    name: str
    outline: Floats
    place_mm: float


@dataclass(frozen=True, eq=False)
class Jig:
    """The ``ribs`` for board that is ``thickness_mm`` thick. ``shell`` (V, 3) is the folded form as
    it lies on them: along the U ribs, along the V ribs, above the table.
    """

    thickness_mm: float
    ribs: tuple[Rib, ...]
    shell: Floats


def jig_of(pattern: CreasePattern, thickness: float | None) -> Jig | None:
    """The jig of ``pattern`` for board of this ``thickness`` in mm; None without a thickness.

    Raises :class:`~miurafab.errors.OptionError` for a shell that cannot lie on ribs.
    """
    if thickness is None:
        return None
    shell = _lying(pattern)
    triangles, _ = triangulate(pattern.faces_vertices, pattern.vertices_coords)
    lengths = edge_lengths(pattern.vertices_coords, pattern.edges_vertices)
    window = 2 * float(np.median(lengths))
    low, high = shell[:, :2].min(axis=0), shell[:, :2].max(axis=0)
    edges = []
    for axis, family in enumerate("UV"):
        for number, part in enumerate(PLACES, start=1):
            place = float(low[1 - axis] + part * (high - low)[1 - axis])
            at, height = _edge(shell[triangles], axis, place, window)
            edges.append((f"{family}{number}", axis, place, at, height))
    floor = min(float(height.min()) for *_, height in edges) - BASE_MM
    ribs = []
    for name, axis, place, at, height in edges:
        tall = height - floor
        body: BaseGeometry = shapely.Polygon(
            np.concatenate([[[at[0], 0.0], [at[-1], 0.0]], np.stack([at, tall], axis=1)[::-1]])
        )
        for _, other_axis, other_place, other_at, other_height in edges:
            if other_axis == axis or not at[0] < other_place < at[-1]:
                continue
            if not other_at[0] < place < other_at[-1]:
                continue
            meet = min(
                float(np.interp(other_place, at, tall)),
                float(np.interp(place, other_at, other_height - floor)),
            )
            half, wide = meet / 2, (thickness + PLAY_MM) / 2
            ends = (half, float(tall.max()) + 1) if axis == 0 else (-1.0, half)
            slot = shapely.box(other_place - wide, ends[0], other_place + wide, ends[1])
            body = body.difference(slot)
        assert isinstance(body, shapely.Polygon)  # a slot goes half way
        ribs.append(Rib(name, np.asarray(body.exterior.coords)[:-1], place))
    return Jig(thickness, tuple(ribs), shell - [0.0, 0.0, floor])


def _lying(pattern: CreasePattern) -> Floats:
    """(V, 3) the folded form with its front up, the flat pattern's x to the right."""
    points = pattern.folded_coords
    if points is None:
        raise OptionError("jig", "needs a folded form, which the pattern has not; leave it out")
    corners = points[filled(pattern.faces_vertices)]
    spokes = corners - corners[:, :1]
    areas = np.cross(spokes, np.roll(spokes, -1, axis=1)).sum(axis=1)
    up = areas.sum(axis=0)
    if np.linalg.norm(up) < OPEN * np.linalg.norm(areas, axis=1).sum():
        raise OptionError(
            "jig", "is for a shell that lies open on ribs, and this one closes round; leave it out"
        )
    up /= np.linalg.norm(up)
    flat = pattern.vertices_coords[:, 0]
    across = (flat - flat.mean()) @ points
    across -= (across @ up) * up
    across /= np.linalg.norm(across)
    return np.asarray(points @ np.stack([across, np.cross(up, across), up], axis=1))


def _edge(triangles: Floats, axis: int, place: float, window: float) -> tuple[Floats, Floats]:
    """The places along a rib and its upper edge there, in the plane in which the other direction is
    ``place``.
    """
    at, lowest = lower_side(triangles, axis, place)
    cubic = np.polynomial.Polynomial.fit(at, lowest, 3)(at)
    size = max(int(window / STEP_MM) | 1, 3)
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    opened = maximum_filter1d(minimum_filter1d(lowest - cubic, size), size)
    return at, np.asarray(cubic + np.minimum(opened, lowest - cubic))


def lower_side(triangles: Floats, axis: int, place: float) -> tuple[Floats, Floats]:
    """The longest run of places along ``axis`` where ``triangles`` (T, 3, 3) are above the plane's
    line at ``place``, and the height of the lowest of them there.
    """
    off = triangles[:, :, 1 - axis] - place
    crossed = (off.min(axis=1) < 0) & (off.max(axis=1) > 0)
    own, off = triangles[crossed][:, :, [axis, 2]], off[crossed]
    low, high = own[:, :, 0].min(), own[:, :, 0].max()
    at = np.arange(np.ceil(low / STEP_MM), np.floor(high / STEP_MM) + 1) * STEP_MM
    lowest = np.full(len(at), np.inf)
    for points, away in zip(own, off, strict=True):
        ends = [
            points[i] + away[i] / (away[i] - away[j]) * (points[j] - points[i])
            for i, j in ((0, 1), (1, 2), (2, 0))
            if (away[i] < 0) != (away[j] < 0)
        ]
        (s0, h0), (s1, h1) = sorted(map(tuple, ends))
        inside = (at >= s0) & (at <= s1)
        heights = h0 + (at[inside] - s0) * (h1 - h0) / max(s1 - s0, 1e-12)
        lowest[inside] = np.minimum(lowest[inside], heights)
    known = np.isfinite(lowest)
    breaks = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(int)))
    starts, stops = breaks[::2], breaks[1::2]
    longest = int(np.argmax(stops - starts))
    run = slice(int(starts[longest]), int(stops[longest]))
    return at[run], lowest[run]
