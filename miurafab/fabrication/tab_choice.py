"""The tabs of a layout: which patch bears the tab of each seam, and tabs on open borders.

Each seam gets one tab, on the patch that the options name, or on the other patch if there is more
room for glue. Tabs on open borders are made where they are asked for.
"""

from __future__ import annotations

import numpy as np

from miurafab.fabrication.borders import chosen_edges, open_tabs
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.seams import Seams, all_seams, border_seams
from miurafab.fabrication.tabs import TabRegions, tab_regions
from miurafab.geometry.arrays import Bools, Ints
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import Material


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
    up to :data:`RAISED` times as high, and as wide as its base. If a patch is glued to
    itself, the lower pattern edge counts as the lower patch. ``tight`` patches (P,) may carry
    standard tabs only.

    Returns the tabs, (N,) whether each is not standard, and (M,) the edges where no patch can bear
    the tab that is wanted. Cuts in the pattern (assignment C) get no tab.
    """
    options = options or LayoutOptions()
    seams = all_seams(pattern, face_patch)
    patch = face_patch[seams.faces]
    lower = patch[:, 0] < patch[:, 1]
    lower |= (patch[:, 0] == patch[:, 1]) & (seams.edges[:, 0] < seams.edges[:, 1])
    seams = seams.swapped(_by_lower(patch, options.tab_side) != lower)

    def made(seams: Seams, raised: Bools | None = None) -> TabRegions:
        bearing = _bearing(pattern, seams)
        full = options.full_facet
        return tab_regions(pattern, seams, material, bearing, full_facet=full, raised=raised)

    tabs = made(seams)
    weak = tabs.glue < material.tabs.min_area_mm2
    unusual = np.zeros(len(seams), dtype=bool)
    if weak.any():
        free = np.ones(face_patch.max() + 1, dtype=bool) if tight is None else ~tight
        better = made(seams.swapped(weak)).glue > tabs.glue
        swapped = weak & better & free[face_patch[seams.faces[:, 1]]]
        tabs = made(seams.swapped(swapped))
        weak = tabs.glue < material.tabs.min_area_mm2
        weak &= free[face_patch[tabs.own_face]]
        tabs = made(tabs.seams, weak)
        unusual = swapped | weak
    edges = chosen_edges(pattern, options.border_tabs)
    if len(edges):
        tabs = tabs.joined(open_tabs(pattern, edges, material))
        unusual = np.append(unusual, np.zeros(len(edges), dtype=bool))
    kept = tabs.glue > 0
    return tabs.take(kept), unusual[kept], tabs.edge[~kept]


def border_tabs(pattern: CreasePattern, material: Material, options: LayoutOptions) -> TabRegions:
    """All tabs that may stand on borders of the pattern, on either side of each seam."""
    seams = border_seams(pattern)
    seams = seams.joined(seams.swapped(np.ones(len(seams), dtype=bool)))
    tabs = tab_regions(pattern, seams, material, full_facet=options.full_facet)
    edges = chosen_edges(pattern, options.border_tabs)
    return tabs.joined(open_tabs(pattern, edges, material)) if len(edges) else tabs


def _by_lower(patch: Ints, side: str) -> Bools:
    """(N,) whether the lower of the two patches ``patch`` (N, 2) bears the tab."""
    if side != "alternate":
        return np.full(len(patch), side == "lower")
    # Every second edge of each seam, in the order of the edges.
    order = np.lexsort((np.arange(len(patch)), patch.max(axis=1), patch.min(axis=1)))
    pair = np.sort(patch, axis=1)[order]
    fresh = np.append(True, (pair[1:] != pair[:-1]).any(axis=1))[: len(patch)]
    place = np.arange(len(patch))
    first = np.maximum.accumulate(np.where(fresh, place, 0))
    found = np.empty(len(patch), dtype=bool)
    found[order] = (place - first) % 2 == 0
    return found


def _bearing(pattern: CreasePattern, seams: Seams) -> Bools:
    """(F, k) whether a tab is glued inside each side of each facet."""
    found = np.zeros(pattern.faces_edges.shape, dtype=bool)
    mate = seams.faces[:, 1]
    side = (pattern.faces_edges[mate] == seams.edges[:, 1:]).argmax(axis=1)
    found[mate, side] = True
    return found
