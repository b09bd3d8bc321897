"""The pieces that a beam has cut and creased, measured from what it burnt alone.

The layout says which edge of the pattern a burnt line is: the one on whose place it lies, within
:data:`NEAR_MM`. Where the edge then is, its burnt points alone say. They give a line (total least
squares); a cut line lies half a kerf outside its edge and is moved back. A corner of a patch is the
point nearest to the lines of all edges that meet there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from miurafab.fabrication.partition.patch_outline import OutlinedPatches
from miurafab.fabrication.strokes import RigidTransform
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern

NEAR_MM = 0.15
"""A burnt line is that of the edge on whose place it lies so near; facets are larger."""
SHORTEST_MM = 0.1
"""A shorter burnt segment has no direction worth measuring: a motor step is 0.0125 mm."""
REST_MM = 1.0
"""Where a tab leaves as much of its side at both ends, the cut there is a line of its own."""
PARALLEL = 0.05
"""Radians; lines that differ by less do not fix the point where they meet."""


@dataclass(frozen=True, eq=False)
class RecoveredCorners:
    """The K corners of all patches: ``patch`` and ``vertex`` (K,) of each, and its ``place``
    (K, 2) on the sheet in mm, NaN where no burnt line leads there. ``fixed`` (K,) tells where the
    lines are not parallel.
    """

    patch: Ints
    vertex: Ints
    place: Floats
    fixed: Bools


def recovered_corners(
    pattern: CreasePattern,
    outlined: OutlinedPatches,
    motion: RigidTransform,
    kerf_mm: float,
    burnt: list[Floats],
) -> RecoveredCorners:
    """The corners of the patches, from the segments (n, 4) that were ``burnt`` on each sheet."""
    patch, edge, ends, shift = _edges(pattern, outlined, kerf_mm)
    placed = np.einsum("nij,nkj->nki", motion.matrix[patch], ends + shift[:, None])
    placed = placed + motion.shift[patch][:, None]
    middle, along = _lines(placed, motion.sheet[patch], burnt)
    middle -= np.einsum("nij,nj->ni", motion.matrix[patch], shift)
    key = np.repeat(patch, 2) * len(pattern.vertices_coords) + pattern.edges_vertices[edge].ravel()
    corners, corner = np.unique(key, return_inverse=True)
    line = np.repeat(np.arange(len(edge)), 2)
    owner, vertex = np.divmod(corners, len(pattern.vertices_coords))
    meant = np.einsum("nij,nj->ni", motion.matrix[owner], pattern.vertices_coords[vertex])
    meant += motion.shift[owner]
    place, fixed = _meeting(corner.reshape(-1), middle[line], along[line], meant)
    return RecoveredCorners(owner, vertex, place, fixed)


def _edges(
    pattern: CreasePattern, outlined: OutlinedPatches, kerf: float
) -> tuple[Ints, Ints, Floats, Floats]:
    """The (patch, edge) of each line on a side of the patches, its ends (n, 2, 2), and how far it
    lies outside, (n, 2). A side has two lines where a tab leaves much of it: the fold of the tab,
    and the cut beside it.
    """
    beside = pattern.edges_faces
    owner = np.where(beside >= 0, outlined.face_patch[beside], -1)
    tabs, count = outlined.tabs, len(outlined.patches)
    folded = tabs.edge * count + outlined.face_patch[tabs.own_face]
    ends = pattern.vertices_coords[pattern.edges_vertices]
    step = ends[:, 1] - ends[:, 0]
    right = np.stack([step[:, 1], -step[:, 0]], axis=1) / np.linalg.norm(step, axis=1)[:, None]
    free = np.linalg.norm(ends[tabs.edge][:, None] - tabs.points[:, :2][:, :, None], axis=3)
    apart = free.min(axis=(1, 2)) >= REST_MM
    parts = []
    for side in (0, 1):
        own, other = owner[:, side], owner[:, 1 - side]
        chosen = np.flatnonzero((own >= 0) & ((own != other) | (side == 0)))
        cut = (own != other) & ~np.isin(np.arange(len(own)) * count + own, folded)
        out = right if side == 0 else -right  # the facet lies left of its edge
        stands = owner[tabs.edge, side] == outlined.face_patch[tabs.own_face]
        based = np.flatnonzero(apart & stands)
        line = ends.copy()
        line[tabs.edge[based]] = tabs.points[based, :2]
        parts.append((own[chosen], chosen, line[chosen], (out * (cut * kerf / 2)[:, None])[chosen]))
        beside_tab = tabs.edge[based]
        parts.append((own[beside_tab], beside_tab, ends[beside_tab], out[beside_tab] * (kerf / 2)))
    patches, edges, lines, shifts = (np.concatenate(each) for each in zip(*parts, strict=True))
    return patches, edges, lines, shifts


def _lines(placed: Floats, sheet: Ints, burnt: list[Floats]) -> tuple[Floats, Floats]:
    """A point (n, 2) and the direction (n, 2) of the line burnt where each of the edges ``placed``
    (n, 2, 2) should be; NaN where nothing was.
    """
    sums = np.zeros((len(placed), 6))
    for number, segments in enumerate(burnt):
        own = np.flatnonzero(sheet == number)
        lengths = np.linalg.norm(segments[:, 2:] - segments[:, :2], axis=1)
        long = segments[lengths > SHORTEST_MM]
        tree = shapely.STRtree(np.asarray(shapely.linestrings(placed[own]), dtype=object))
        middles = shapely.points((long[:, :2] + long[:, 2:]) / 2)
        which, found = tree.query_nearest(middles, max_distance=NEAR_MM, all_matches=False)
        segment, edge = long[which], own[found]
        near = shapely.linestrings(placed[edge])
        for point in (segment[:, :2], segment[:, 2:]):
            there = shapely.dwithin(shapely.points(point), near, NEAR_MM)
            x, y = point[there].T
            terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
            np.add.at(sums, edge[there], terms)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = sums[:, 1:3] / sums[:, :1]
        xx, xy, yy = (sums[:, 3:] / sums[:, :1]).T - np.stack(
            [mean[:, 0] ** 2, mean[:, 0] * mean[:, 1], mean[:, 1] ** 2]
        )
    angle = np.arctan2(2 * xy, xx - yy) / 2
    return mean, np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _meeting(corner: Ints, middle: Floats, along: Floats, meant: Floats) -> tuple[Floats, Bools]:
    """(n, 2) the point nearest to the lines of each corner, and to where it is ``meant`` (n, 2) to
    be where they are parallel, and (n,) whether they are not; NaN where there is none.
    """
    known = np.isfinite(middle).all(axis=1)
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1)[known]
    off = np.einsum("nk,nk->n", normal, middle[known] - meant[corner[known]])
    square = np.zeros((len(meant), 2, 2))
    side = np.zeros((len(meant), 2))
    np.add.at(square, corner[known], normal[:, :, None] * normal[:, None])
    np.add.at(side, corner[known], normal * off[:, None])
    size, axes = np.linalg.eigh(square)
    fixed = size[:, 0] > PARALLEL**2
    size[size <= PARALLEL**2] = np.inf
    place = meant + np.einsum("nij,nj,nkj,nk->ni", axes, 1 / size, axes, side)
    place[np.isinf(size).all(axis=1)] = np.nan
    return place, fixed
