"""Outlines of patches with their tabs, and their cut lines, in the plane of the pattern.

The outline of a patch is its boundary, with each of its tabs inserted at its seam edge. A hole has
a ring as well. Tabs lie in facets of other patches, so the rings are simple closed curves and do
not meet. There are two exceptions: the flat pattern overlaps itself, or a tab stands on the border
of a piece and meets the patch. Tabs that collide there are left out and listed. If a patch exceeds
the bed because of tabs on the other side of a seam or of higher tabs, it gets standard tabs only.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from miurafab.fabrication.double_tabs import in_pairs
from miurafab.fabrication.kerf import allowance, cut_lines
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.boundary import Boundary, boundaries
from miurafab.fabrication.partition.fit_box import Space
from miurafab.fabrication.partition.split import split
from miurafab.fabrication.slots import Slots, heads, slots_of
from miurafab.fabrication.tab_choice import choose_tabs
from miurafab.fabrication.tabs import TabRegions
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.shapes import common_area
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import Material


@dataclass(frozen=True, eq=False)
class OutlinedPatch:
    """One patch in the plane of the pattern, in mm.

    ``faces`` (n,) int64 are its facets, ``tabs`` (t,) int64 its tabs in order along the rings,
    ``rings`` are the finished outline (m, 2), counter-clockwise, and those around its holes,
    clockwise. ``cut_lines`` are the paths of the beam: the outer one first, then those around holes
    and enclosed waste.
    """

    faces: Ints
    tabs: Ints
    rings: list[Floats]
    cut_lines: list[Floats]


@dataclass(frozen=True, eq=False)
class OutlinedPatches:
    """All ``patches`` of a pattern: ``face_patch`` (F,) the patch of each facet, ``tabs`` all tabs,
    ``untabbed`` (u,) the edges where no side can bear the tab that is wanted. ``join`` is what
    holds the seams, ``slots`` the slots that tabs go through, None where there are none.
    """

    patches: list[OutlinedPatch]
    face_patch: Ints
    tabs: TabRegions
    untabbed: Ints
    join: str = "glue"
    slots: Slots | None = None

    def joined(self, pattern: CreasePattern, material: Material, join: str) -> OutlinedPatches:
        """The same, held as ``join`` says."""
        slotted = join == "slots" and bool((self.tabs.mate_face >= 0).any())
        slots = slots_of(pattern, self.tabs, material) if slotted else None
        return replace(self, join=join, slots=slots)

    @property
    def lettered(self) -> TabRegions:
        """The tabs as they bear their labels: heads alone, and double tabs on no facet."""
        if self.slots is not None:
            return heads(self.tabs, self.slots)
        if self.join == "double":
            seams = self.tabs.seams
            alone = np.column_stack([seams.faces[:, 0], np.full(len(seams), -1)])
            return replace(self.tabs, seams=replace(seams, faces=alone))
        return self.tabs


def patch_space(sheet: Space, material: Material, options: LayoutOptions) -> Space:
    """The room for the outline of a patch that is cut out of ``sheet``, the usable part of one."""
    width, height = sheet.width, sheet.height
    if options.max_patch_mm is not None:
        long, short = options.max_patch_mm
        along, across = (long, short) if width >= height else (short, long)
        width, height = min(width, along), min(height, across)
    return Space(width, height, sheet.turns).smaller(2 * allowance(material.kerf_mm))


def outline_patches(
    pattern: CreasePattern,
    width: float,
    height: float,
    material: Material,
    options: LayoutOptions | None = None,
    *,
    turns: tuple[int, ...] | None = None,
) -> OutlinedPatches:
    """The pattern split into patches that each fit ``width`` x ``height`` mm with their cut lines,
    at any angle or by quarter ``turns`` only.

    Raises :class:`~miurafab.errors.LayoutError` as
    :func:`~miurafab.fabrication.partition.split.split`.
    """
    options = options or LayoutOptions()
    space = patch_space(Space(width, height, turns), material, options)
    face_patch = split(pattern, space.width, space.height, material, options, turns=turns)
    return outline_split(pattern, face_patch, space, material, options)


def outline_split(
    pattern: CreasePattern,
    face_patch: Ints,
    space: Space,
    material: Material,
    options: LayoutOptions,
) -> OutlinedPatches:
    """The patches of a split ``face_patch`` (F,) whose patches fit ``space`` with standard tabs."""
    around = boundaries(pattern, face_patch)
    tight = np.zeros(len(around), dtype=bool)
    while True:
        tabs, unusual, untabbed = choose_tabs(pattern, face_patch, material, options, tight)
        outlines, standing = rings_of(pattern, face_patch, around, tabs)
        outgrown = [
            bool(unusual[own].any()) and space.turn(rings[0]) is None
            for rings, own in zip(outlines, standing, strict=True)
        ]
        if not any(outgrown):
            break
        tight |= outgrown
    kept = _without_collisions(pattern, around, outlines, standing, tabs)
    if options.join == "double":
        kept = in_pairs(tabs, kept)
    untabbed = np.sort(np.concatenate([untabbed, tabs.edge[~kept]]))
    tabs = tabs.take(kept)

    outlines, standing = rings_of(pattern, face_patch, around, tabs)
    lines = cut_lines(outlines, material.kerf_mm)
    order = np.argsort(face_patch, kind="stable")
    faces = np.split(order, np.flatnonzero(np.diff(face_patch[order])) + 1)
    patches = [
        OutlinedPatch(*parts) for parts in zip(faces, standing, outlines, lines, strict=True)
    ]
    outlined = OutlinedPatches(patches, face_patch, tabs, untabbed)
    return outlined.joined(pattern, material, options.join)


def rings_of(
    pattern: CreasePattern, face_patch: Ints, around: list[Boundary], tabs: TabRegions
) -> tuple[list[list[Floats]], list[Ints]]:
    """The rings of each patch, and its tabs in order along them."""
    tab_of_edge = np.full(len(pattern.edges_vertices), -1)
    owner = face_patch[tabs.own_face]
    order = np.argsort(owner, kind="stable")
    first = np.searchsorted(owner[order], np.arange(len(around) + 1))
    outlines, standing = [], []
    for patch, boundary in enumerate(around):
        rings, own = [], []
        borne = order[first[patch] : first[patch + 1]]
        tab_of_edge[tabs.edge[borne]] = borne
        for loop in boundary.loops:
            found = tab_of_edge[loop.edges]
            corners = pattern.vertices_coords[loop.vertices]
            parts = []
            before = 0
            for at in np.flatnonzero(found >= 0).tolist():
                # The base is the first side of the tab; the outline goes around the tab instead.
                parts += [corners[before : at + 1], np.roll(tabs.polygon(found[at]), -1, axis=0)]
                before = at + 1
            rings.append(np.concatenate([*parts, corners[before:]]))
            own.append(found[found >= 0])
        tab_of_edge[tabs.edge[borne]] = -1
        outlines.append(rings)
        standing.append(np.concatenate(own))
    return outlines, standing


def _without_collisions(
    pattern: CreasePattern,
    around: list[Boundary],
    outlines: list[list[Floats]],
    standing: list[Ints],
    tabs: TabRegions,
) -> Bools:
    """(N,) whether each tab is free of collisions."""
    kept = np.ones(len(tabs), dtype=bool)
    shapes = [shapely.Polygon(rings[0], rings[1:]) for rings in outlines]
    for patch in np.flatnonzero(~shapely.is_valid(np.array(shapes))).tolist():
        outer, *holes = (pattern.vertices_coords[loop.vertices] for loop in around[patch].loops)
        taken: BaseGeometry = shapely.Polygon(outer, holes)
        own = standing[patch]
        # What is glued comes before what stands on an open border.
        for tab in own[np.argsort(tabs.mate_face[own] < 0, kind="stable")].tolist():
            shape = shapely.Polygon(tabs.polygon(tab))
            if common_area(taken, shape) < 1e-6 and _meets_in_base(taken, shape):
                taken = shapely.union(taken, shape, grid_size=1e-9)
            else:
                kept[tab] = False
    return kept


def _meets_in_base(taken: BaseGeometry, tab: shapely.Polygon) -> bool:
    """Whether ``tab`` touches ``taken`` in its base only, its first side."""
    base = shapely.LineString(shapely.get_coordinates(tab)[:2])
    rest = shapely.difference(tab.exterior, base.buffer(1e-6))
    return bool(shapely.distance(rest, taken) > 0)
