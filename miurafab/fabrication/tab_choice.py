"""The tabs of a layout: which patch bears the tab of each seam, and tabs on open borders.

Each seam gets one tab, on the patch that the options name, or on the other patch if there is more
room for glue, or room for a slot. Double tabs stand on both. Tabs on open borders are made where
they are asked for.
"""

from __future__ import annotations

import numpy as np

from miurafab.fabrication.borders import chosen_edges, open_tabs
from miurafab.fabrication.double_tabs import double_tabs, in_pairs
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.seams import Seams, all_seams, border_seams
from miurafab.fabrication.slots import slotted_tabs
from miurafab.fabrication.tabs import TabRegions, tab_regions
from miurafab.geometry.arrays import Bools, Ints, places_in_runs
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import Material

LARGER = 1 + 1e-9
"""The glue of a tab over that of another of the same size, at least: rounding chooses no side."""


def choose_tabs(
    pattern: CreasePattern,
    face_patch: Ints,
    material: Material,
    options: LayoutOptions | None = None,
    tight: Bools | None = None,
) -> tuple[TabRegions, Bools, Ints]:
    """One tab for each seam of ``face_patch`` (F,), the patch id of each facet, and then the tabs
    on open borders that ``options`` ask for.

    The patch that ``options`` name bears the tab. If the tab has less glue area than the material
    requires, it goes to the other patch if it is larger there. If that is not enough, it is raised:
    up to :data:`RAISED` times as high, and as wide as its base. A tab for a slot goes to the other
    patch if there is room for it only there. If a patch is glued to
    itself, the lower pattern edge counts as the lower patch. ``tight`` patches (P,) may carry
    standard tabs only, and tabs for slots that are no larger.

    Returns the tabs, (N,) whether each is not standard, and (M,) the edges where no patch can bear
    the tab that is wanted. Cuts in the pattern (assignment C) get no tab.
    """
    options = options or LayoutOptions()
    seams = all_seams(pattern, face_patch)
    patch = face_patch[seams.faces]
    lower = patch[:, 0] <= patch[:, 1]  # a seam names its lower edge first
    seams = seams.swapped(_by_lower(patch, options.tab_side) != lower)
    free = np.ones(len(face_patch), dtype=bool) if tight is None else ~tight
    if options.join == "slots":
        tabs, unusual = _slotted(pattern, seams, face_patch, material, options, free)
    elif options.join == "double":
        tabs = double_tabs(pattern, seams, material, _drawn_twice(pattern, seams, face_patch))
        unusual = np.full(len(tabs), False)
    else:
        tabs, unusual = _glued(pattern, seams, face_patch, material, options, free)
    edges = chosen_edges(pattern, options.border_tabs)
    tabs = tabs.joined(open_tabs(pattern, edges, material))
    unusual = np.append(unusual, np.full(len(edges), False))
    kept = tabs.usable
    if options.join == "double":
        kept = in_pairs(tabs, kept)
    return tabs.take(kept), unusual[kept], np.unique(tabs.edge[~kept])


def _glued(
    pattern: CreasePattern,
    seams: Seams,
    face_patch: Ints,
    material: Material,
    options: LayoutOptions,
    free: Bools,
) -> tuple[TabRegions, Bools]:
    """One tab for glue for each of N ``seams``, and (N,) whether each is not standard."""

    def made(seams: Seams, raised: Bools | None = None) -> TabRegions:
        bearing = _bearing(pattern, seams)
        full = options.full_facet
        return tab_regions(pattern, seams, material, bearing, full_facet=full, raised=raised)

    def too_weak(tabs: TabRegions) -> Bools:
        return tabs.glue < material.tabs.min_area_mm2

    tabs = made(seams)
    weak = too_weak(tabs)
    unusual = np.full(len(seams), False)
    if weak.any():
        better = made(seams.swapped(weak)).glue > tabs.glue * LARGER
        swapped = weak & better & free[face_patch[seams.faces[:, 1]]]
        tabs = made(seams.swapped(swapped))
        weak = too_weak(tabs) & free[face_patch[tabs.own_face]]
        tabs = made(tabs.seams, weak)
        unusual = swapped | weak
    return tabs, unusual


def _slotted(
    pattern: CreasePattern,
    seams: Seams,
    face_patch: Ints,
    material: Material,
    options: LayoutOptions,
    free: Bools,
) -> tuple[TabRegions, Bools]:
    """One tab for a slot for each of N ``seams``, and (N,) whether each is larger than a tab for
    glue may be, or on the other side.
    """

    def made(seams: Seams) -> TabRegions:
        tight = ~free[face_patch[seams.faces[:, 0]]]
        bearing, ticks = _bearing(pattern, seams), options.ticks_mm or 0.0
        return slotted_tabs(pattern, seams, material, bearing, tight, ticks)

    tabs = made(seams)
    missing = ~tabs.usable
    if missing.any():
        there = made(seams.swapped(missing)).usable
        tabs = made(seams.swapped(missing & there & free[face_patch[seams.faces[:, 1]]]))
    return tabs, free[face_patch[tabs.own_face]]


def border_tabs(pattern: CreasePattern, material: Material, options: LayoutOptions) -> TabRegions:
    """All tabs that may stand on borders of the pattern, on either side of each seam."""
    seams = border_seams(pattern)
    seams = seams.joined(seams.swapped(np.full(len(seams), True)))
    tabs = tab_regions(pattern, seams, material, full_facet=options.full_facet)
    edges = chosen_edges(pattern, options.border_tabs)
    return tabs.joined(open_tabs(pattern, edges, material))


def _by_lower(patch: Ints, side: str) -> Bools:
    """(N,) whether the lower of the two patches ``patch`` (N, 2) bears the tab."""
    if side != "alternate":
        return np.full(len(patch), side == "lower")
    # Every second edge of each seam, in the order of the edges.
    pairs = np.unique(np.sort(patch), axis=0, return_inverse=True, return_counts=True)
    which, place = pairs[1].reshape(-1), np.arange(len(patch))
    place[np.argsort(which, kind="stable")] = places_in_runs(pairs[2])
    return np.asarray(place % 2 == 0)


def _drawn_twice(pattern: CreasePattern, seams: Seams, face_patch: Ints) -> Bools:
    """:func:`_bearing` of double tabs, which lie on no facet: only where two tabs of one patch are
    drawn on one facet they must share it.
    """
    both = seams.joined(seams.swapped(np.full(len(seams), True)))
    pairs = np.column_stack([face_patch[both.faces[:, 0]], both.faces[:, 1]])
    _, which, times = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
    return _bearing(pattern, both.take(times[which.reshape(-1)] > 1))


def _bearing(pattern: CreasePattern, seams: Seams) -> Bools:
    """(F, k) whether a tab is glued inside each side of each facet."""
    found = np.zeros(pattern.faces_edges.shape, dtype=bool)
    mate = seams.faces[:, 1]
    side = (pattern.faces_edges[mate] == seams.edges[:, 1:]).argmax(axis=1)
    found[mate, side] = True
    return found
