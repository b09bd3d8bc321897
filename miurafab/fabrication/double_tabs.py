"""Double tabs: both patches of a seam bear a tab, and the two are glued to each other.

Both tabs are folded behind the shell, front to front, and stand there as one fin. So a clip can
press them together, and neither facet is glued; makers of paper models wish for it at seams deep
inside (issue 86 of Export-Paper-Model-from-Blender). The two tabs must be mirror images about
their seam edge. Each is what a tab for glue in the one facet has in common with the mirror image of
one in the other facet, so it is no larger than either. Both are folded as mountains, whatever the
seam is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from miurafab.fabrication.kerf import SHORTEST_MM
from miurafab.fabrication.seams import Seams
from miurafab.fabrication.tabs import (
    NO_LIMIT,
    TabRegions,
    clip_convex,
    in_mate,
    in_plane,
    tab_regions,
    with_base,
)
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import Material


def double_tabs(
    pattern: CreasePattern, seams: Seams, material: Material, bearing: Bools
) -> TabRegions:
    """The tabs on both sides of N ``seams``: N on the first sides, then N on the others."""
    seams = replace(seams, fold=np.full(len(seams), "M"))
    facing = seams.swapped(np.full(len(seams), True))
    own, other = (tab_regions(pattern, each, material, bearing) for each in (seams, facing))
    length = edge_lengths(pattern.vertices_coords, pattern.edges_vertices[seams.edges[:, 1]])
    points, count = in_mate(pattern, own), own.count
    points[:, :2, 1] = 0.0
    image = mirrored(in_mate(pattern, other), length)
    slot = np.arange(image.shape[1])
    ahead = np.where(slot + 1 < other.count[:, None], slot + 1, 0)
    step = np.take_along_axis(image, ahead[..., None], axis=1) - image
    size = np.linalg.norm(step, axis=2)
    step /= np.where(size > 0, size, 1.0)[..., None]
    # The mirror image runs clockwise. Its first side is the base, which both have in common.
    normal = np.stack([step[..., 1], -step[..., 0]], axis=-1)
    # Both often meet in the end of their base, which must not be cut off by rounding.
    limit = np.einsum("nki,nki->nk", normal, image) - 1e-6
    limit = np.where((slot < other.count[:, None]) & (size > 0), limit, NO_LIMIT)
    for k in range(1, image.shape[1]):
        points, count = clip_convex(points, count, normal[:, k], limit[:, k])
    count = with_base(points, np.where(other.count >= 3, count, 0))
    points, count = _without_specks(points, count)
    slot = np.arange(points.shape[1])
    back = np.where(slot < count[:, None], (1 - slot) % np.maximum(count, 1)[:, None], slot)
    turned = np.take_along_axis(mirrored(points, length), back[..., None], axis=1)
    return in_plane(pattern, seams, points, count).joined(in_plane(pattern, facing, turned, count))


def _without_specks(points: Floats, count: Ints) -> tuple[Floats, Ints]:
    """The polygons without sides that programs drop, and rounding turns; the base stays."""
    slot = np.arange(points.shape[1])
    behind = np.linalg.norm(points - np.roll(points, 1, axis=1), axis=2)
    first = np.linalg.norm(points - points[:, :1], axis=2)
    last = slot == count[:, None] - 1
    speck = (slot >= 2) & ((behind < SHORTEST_MM) | (last & (first < SHORTEST_MM)))
    kept = (slot < count[:, None]) & ~speck
    order = np.argsort(~kept, axis=1, kind="stable")
    return np.take_along_axis(points, order[..., None], axis=1), kept.sum(axis=1)


def mirrored(points: Floats, length: Floats) -> Floats:
    """``points`` (N, m, 2) in the frame of one side of seams of ``length`` (N,), seen from the
    other side, and laid over it.
    """
    image = points.copy()
    image[..., 0] = length[:, None] - image[..., 0]
    return image


def in_pairs(tabs: TabRegions, kept: Bools) -> Bools:
    """(N,) ``kept`` without the tabs whose mates are not kept."""
    found = kept.copy()
    joined = np.flatnonzero(tabs.mate_face >= 0)
    pairs = np.sort(tabs.seams.edges[joined], axis=1)
    _, which = np.unique(pairs, axis=0, return_inverse=True)
    whole = np.bincount(which.reshape(-1), kept[joined]) == 2
    found[joined] = whole[which.reshape(-1)]
    return found
