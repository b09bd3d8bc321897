"""What is wrong with the folds, the slots and the double tabs of a written layout.

A slot is made anew from its tab, the fold angle of the seam and the material, and the slot that
the layout names must be the same. That it holds is judged by what it is, without the rules that
made it: it lies in the facet of the tab's mate, clear of its sides and of all other tabs there, as
wide as the neck in it, and narrower than the head behind it. Double tabs are mirror images about
their seam.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import shapely

from miurafab.errors import LayoutError
from miurafab.fabrication.double_tabs import mirrored
from miurafab.fabrication.nesting import turned
from miurafab.fabrication.partition.patch_outline import OutlinedPatches
from miurafab.fabrication.sheets import Layout
from miurafab.fabrication.slots import CLEAR_MM
from miurafab.fabrication.tabs import FOLDS, in_mate
from miurafab.geometry.arrays import Floats
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import Material

NEAR_MM = 1e-4
"""Coordinates in a layout are rounded to 1e-6 mm; its sums and turns stay below this."""


def held(
    outlined: OutlinedPatches,
    pattern: CreasePattern,
    material: Material,
    labels: tuple[str, ...],
    join: str,
) -> OutlinedPatches:
    """``outlined`` with its seams held as ``join`` says.

    Raises :class:`~miurafab.errors.LayoutError` for a tab that cannot go through a slot.
    """
    tabs = outlined.tabs
    wrong = np.flatnonzero((tabs.mate_face >= 0) & (tabs.count != 6))
    if join == "slots" and len(wrong):
        raise LayoutError(f"Tab {labels[wrong[0]]} is no tab for a slot: it has not six corners.")
    found = outlined.joined(pattern, material, join)
    if found.slots is not None:
        lost = np.flatnonzero(~np.isfinite(found.slots.corners).all(axis=(1, 2)))
        if len(lost):
            label = labels[int(found.slots.tab[lost[0]])]
            raise LayoutError(f"Tab {label} cannot be put through a slot in the facet at its edge.")
    return found


def joint_faults(
    layout: Layout,
    pattern: CreasePattern,
    outlined: OutlinedPatches,
    labels: tuple[str, ...],
    join: str,
) -> Iterator[str]:
    """What is wrong with the folds of the tabs, and with the slots and double tabs of the first
    model, in sentences.
    """
    for patch in layout.patches:
        for tab in patch.tabs:
            if tab.join != ("glue" if tab.mate_patch is None else join):
                yield f"Tab {tab.label} is not held as the options of the job say."
            letter = str(pattern.edges_assignment[tab.edge])
            inner = tab.edge == tab.mate_edge and tab.join != "double"
            if inner and tab.fold != FOLDS.get(letter, "flat"):
                yield f"Tab {tab.label} is told to fold {tab.fold}, and its edge is {letter}."
    yield from _slot_faults(layout, pattern, outlined, labels)
    if join == "double":
        yield from _pair_faults(pattern, outlined, labels)


def _slot_faults(
    layout: Layout, pattern: CreasePattern, outlined: OutlinedPatches, labels: tuple[str, ...]
) -> Iterator[str]:
    tabs, slots = outlined.tabs, outlined.slots
    listed = (tab.number for patch in layout.model.patches for tab in patch.tabs)
    rows = {number: row for row, number in enumerate(listed)}
    told: dict[int, tuple[int, int, int, Floats]] = {}
    for patch in layout.model.patches:
        for each in patch.slots:
            row = rows.get(each.tab, -1)
            if slots is None or row in told or row < 0 or each.label != labels[row]:
                yield f"The slot for tab {each.label} in {patch.label} is for no tab of its own."
            corners = turned(each.polygon_mm, -patch.rotation_deg) + patch.origin_mm
            told[row] = patch.id, each.edge, each.mate_patch, corners
    if slots is None:
        return
    for row, corners in zip(slots.tab.tolist(), slots.corners, strict=True):
        label, mate = labels[row], int(tabs.mate_face[row])
        own, edge = int(outlined.face_patch[tabs.own_face[row]]), int(tabs.seams.edges[row, 1])
        wanted = int(outlined.face_patch[mate]), edge, own
        if row not in told or told[row][:3] != wanted or told[row][3].shape != (4, 2):
            yield f"Tab {label} has no slot at the edge that it is joined to."
            continue
        if not np.allclose(told[row][3], corners, rtol=0, atol=NEAR_MM):
            yield f"The slot for tab {label} is not the one that its tab goes through."
            continue
        slot = shapely.Polygon(told[row][3])
        points = pattern.faces_vertices[mate]
        facet = shapely.Polygon(pattern.vertices_coords[points[points >= 0]])
        if not slot.covered_by(facet.buffer(NEAR_MM - CLEAR_MM)):
            yield f"The slot for tab {label} lies within {CLEAR_MM:g} mm of a side of its facet."
        for other in np.flatnonzero(tabs.mate_face == mate).tolist():
            glued = shapely.Polygon(tabs.glued[other, : tabs.count[other]])
            if other != row and slot.distance(glued) < CLEAR_MM - NEAR_MM:
                yield f"The slot for tab {label} lies in the way of tab {labels[other]}."
        yield from _lock_faults(slot, shapely.Polygon(tabs.glued[row, : tabs.count[row]]), label)


def _lock_faults(slot: shapely.Polygon, tab: shapely.Polygon, label: str) -> Iterator[str]:
    """Whether the neck of a tab fits its slot, and its head is too wide for it."""
    corners = shapely.get_coordinates(slot)[:4]
    along, across = corners[1] - corners[0], corners[3] - corners[0]
    length = float(np.linalg.norm(along))
    # What is wider than the slot counts, too: the strip between its long sides, and all behind it.
    aside = 1e3 * np.stack([-along, along, along, -along])
    far = aside + corners[2] + 1e3 * np.stack([0 * across, 0 * across, across, across])
    neck, head = (
        _width(tab.intersection(shapely.Polygon(part)), along / length)
        for part in (corners + aside, far)
    )
    if not neck <= length + NEAR_MM < head:
        yield f"Tab {label} does not lock: {neck:.2f}, {length:.2f} and {head:.2f} mm wide."


def _width(part: shapely.Geometry, along: Floats) -> float:
    """The extent of ``part`` along a unit vector (2,) in mm, 0 of nothing."""
    extent = shapely.get_coordinates(part) @ along
    return float(np.ptp(extent)) if len(extent) else 0.0


def _pair_faults(
    pattern: CreasePattern, outlined: OutlinedPatches, labels: tuple[str, ...]
) -> Iterator[str]:
    tabs = outlined.tabs
    joined = np.flatnonzero(tabs.mate_face >= 0)
    row_of: dict[tuple[int, int], int] = {
        (edge, face): row
        for row, edge, face in zip(
            joined.tolist(), tabs.edge[joined].tolist(), tabs.own_face[joined].tolist(), strict=True
        )
    }
    own = tabs.take(joined)
    local = in_mate(pattern, own)
    ends = pattern.edges_vertices[own.seams.edges[:, 1]]
    image = mirrored(local, edge_lengths(pattern.vertices_coords, ends))
    place = {row: k for k, row in enumerate(joined.tolist())}
    for k, row in enumerate(joined.tolist()):
        mate = row_of.get((int(tabs.seams.edges[row, 1]), int(tabs.mate_face[row])))
        if mate is None:
            yield f"Tab {labels[row]} has no mate on the other side of its seam."
            continue
        one = shapely.Polygon(image[k, : tabs.count[row]])
        other = shapely.Polygon(local[place[mate], : tabs.count[mate]])
        if one.symmetric_difference(other).area > NEAR_MM * one.length:
            yield f"Tab {labels[row]} is not the mirror image of the tab that it is glued to."
