"""Improvement of a valid split: fewer patches, then shorter seams.

Covers with fewer and fewer rectangles are searched, starting with the rectangles of the current
patches and with rows of rectangles (:mod:`~miurafab.fabrication.partition.cover_search`). Each
facet is assigned to the rectangle in which it lies deepest, and the seams are recomputed as minimum
cuts between rectangles (:mod:`~miurafab.fabrication.partition.min_cut`). The result is used only if
every facet and every tab lies in the rectangle of its patch and every patch is a disk. Otherwise
the split keeps its patches; seams that follow no grid may still become shorter.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.cover import brickwork, excess, nearest, rectangle_around
from miurafab.fabrication.partition.cover_search import CoverSearch
from miurafab.fabrication.partition.min_cut import Recut
from miurafab.fabrication.partition.pieces import StandingTabs
from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.polygons import edge_lengths, signed_areas
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import Material

_EFFORT, _EFFORT_EACH = 500.0, 1.5
"""The effort of a search for one patch less is at most ``_EFFORT`` evaluations of L, and
``_EFFORT_EACH`` times the number of facets to the power 0.6."""

_MORE = 3
"""Rows with this many more rectangles than patches are not tried."""

_LENIENT_MM = 0.6
"""Cover rectangles are this much oversize; the overhang is usually removed when rectangles are
refitted to the final patches."""

_CUTS, _GAIN = 4, 0.001
"""The number of times rectangles are refitted, and the relative gain in seam cost that is required
for another time."""


def improved(
    pattern: CreasePattern,
    patch: Ints,
    part: Ints,
    size: tuple[float, float],
    border: StandingTabs,
    depth: float,
    material: Material,
    options: LayoutOptions,
    *,
    straight: bool,
) -> Ints:
    """(F,) a split no worse than ``patch`` (F,), ids from 0; of two patches the lower bears tabs.

    Each patch lies within one ``part`` (F,) of the pattern, and patches of a lower part have lower
    numbers. ``size`` is the bed in mm, ``border`` the tabs on the border of the pattern; no tab
    reaches farther than ``depth`` mm from its facet. ``straight`` seams, along the lines of a grid,
    are the easiest to glue: they stay unless a patch is saved.
    """
    room = _room(pattern, border)
    alternate = options.tabs_on_both_sides

    def recut(patch: Ints, rectangles: Floats) -> Ints | None:
        """The split with shorter seams, or None if it is invalid."""
        cut = Recut(
            pattern,
            patch,
            rectangles,
            size,
            room,
            part,
            material,
            full_facet=options.full_facet,
            alternate=alternate,
        )
        for turn in range(_CUTS):
            before = cut.seam_cost
            cut.run(2)
            if turn and cut.seam_cost > (1 - _GAIN) * before and not cut.faults():
                break
            cut.refit()
        return None if cut.faults() or cut.misshapen() else cut.patch

    for fewer in _fewer(pattern, part, patch, size, room, (2 if alternate else 1) * depth):
        found = recut(*fewer)
        if found is not None:
            break
    else:
        if straight:
            return patch
        found = recut(patch, _rectangles(room, patch, np.arange(len(patch)), size))
        if found is not None and _seam_mm(pattern, found) >= _seam_mm(pattern, patch):
            found = None
    if found is None:
        return patch
    return np.unique(found, return_inverse=True)[1].astype(np.int64)


def _seam_mm(pattern: CreasePattern, patch: Ints) -> float:
    pair = pattern.edges_faces
    seam = (pair >= 0).all(axis=1) & (patch[pair[:, 0]] != patch[pair[:, 1]])
    return float(edge_lengths(pattern.vertices_coords, pattern.edges_vertices[seam]).sum())


def _rectangles(room: Floats, patch: Ints, facets: Ints, size: tuple[float, float]) -> Floats:
    """(K, 3) the rectangles around the patches of ``facets``."""
    order = facets[np.argsort(patch[facets], kind="stable")]
    ends = np.flatnonzero(np.diff(patch[order])) + 1
    return np.array(
        [rectangle_around(room[f].reshape(-1, 2), *size) for f in np.split(order, ends)]
    )


def _fewer(
    pattern: CreasePattern,
    part: Ints,
    patch: Ints,
    size: tuple[float, float],
    room: Floats,
    depth: float,
) -> Iterator[tuple[Ints, Floats]]:
    """Splits with fewer patches than ``patch`` and their rectangles, the fewest first; tabs may
    still reach out of the rectangles.
    """
    shapes = _without_rim(pattern, room, depth / 2)
    small = (size[0] - depth + _LENIENT_MM, size[1] - depth + _LENIENT_MM)
    if min(small) <= 0:
        return
    area = np.abs(signed_areas(shapes[:, : pattern.faces_vertices.shape[1]]))
    chains = []
    for name in np.unique(part).tolist():
        facets = np.flatnonzero(part == name)
        least = math.ceil(area[facets].sum() / (small[0] * small[1]) - 1e-9)
        search = CoverSearch(shapes[facets], *small)
        effort = min(_EFFORT, _EFFORT_EACH * len(facets) ** 0.6)
        rectangles = _rectangles(room, patch, facets, size)
        starts = [
            search.begin(each)
            for each in (rectangles, *brickwork(room[facets], small))
            if len(each) < len(rectangles) + _MORE
        ]
        chain = [starts[0].rectangles]
        while len(chain[-1]) > least:
            cover = search.fewer(starts, len(chain[-1]) - 1, effort)
            if cover is None:
                break
            chain.append(cover)
        chains.append((facets, chain))
    for back in range(max(len(chain) for _, chain in chains) - 1):
        covers = [chain[max(len(chain) - 1 - back, 0)] for _, chain in chains]
        found = np.empty_like(part)
        for (facets, _), cover, first in zip(
            chains, covers, np.cumsum([0, *(len(c) for c in covers)]), strict=False
        ):
            found[facets] = first + _deepest(room[facets], cover, size)
        yield found, np.concatenate(covers)


def _deepest(room: Floats, rectangles: Floats, size: tuple[float, float]) -> Ints:
    """(N,) the rectangle in which each facet lies deepest."""
    near, _ = nearest(room.mean(axis=1), rectangles, *size, 4)
    over = np.stack([excess(room, rectangles[column], *size) for column in near.T], axis=1)
    return np.asarray(near[np.arange(len(near)), over.argmin(axis=1)])


def _room(pattern: CreasePattern, tabs: StandingTabs) -> Floats:
    """(F, c, 2) the corners of each facet and of its tabs on the border of the pattern."""
    corners = pattern.faces_vertices
    room = pattern.vertices_coords[np.where(corners >= 0, corners, corners[:, :1])]
    order = np.argsort(tabs.face, kind="stable")
    own = tabs.face[order]
    place = np.arange(len(own)) - np.searchsorted(own, own)
    points = np.where(tabs.present[..., None], tabs.points, tabs.points[:, :1])
    for turn in range(int(place.max(initial=-1)) + 1):
        # One tab of each facet at a time; a facet without a tab repeats its first corner.
        tab = order[place == turn]
        tab = tab[tabs.present[tab].any(axis=1)]
        more = np.repeat(room[:, :1], points.shape[1], axis=1)
        more[tabs.face[tab]] = points[tab]
        room = np.concatenate([room, more], axis=1)
    return room


def _without_rim(pattern: CreasePattern, room: Floats, depth: float) -> Floats:
    """``room`` with the border of the pattern moved inwards by ``depth`` mm, at most half way to
    the centre of the facet: no tab of another patch stands there.
    """
    border = np.flatnonzero((pattern.edges_faces >= 0).sum(axis=1) == 1)
    face = pattern.edges_faces[border].max(axis=1)
    middle = room.mean(axis=1)
    found = room.copy()
    ends = pattern.vertices_coords[pattern.edges_vertices[border]]
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1)
    inwards = np.column_stack([-along[:, 1], along[:, 0]]) / np.maximum(length, 1e-12)[:, None]
    far = ((middle[face] - ends[:, 0]) * inwards).sum(axis=1)
    inwards *= np.sign(far)[:, None]
    far = np.abs(far)
    for slot in range(room.shape[1]):
        off = ((found[face, slot] - ends[:, 0]) * inwards).sum(axis=1)
        push = np.clip(np.minimum(depth, far / 2) - off, 0.0, None)
        np.add.at(found, (face, slot), push[:, None] * inwards)
    return found
