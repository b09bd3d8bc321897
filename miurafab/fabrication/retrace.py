"""The strokes that a written layout stands for, made again from the pattern.

``layout.json`` says which facets a patch has, where its tabs are, and where it lies on its sheet.
The creases, holes, texts and cut lines of the patch follow from these and from the pattern, by the
rules of the material. So a sheet can be proven stroke by stroke: nothing of the split, the nesting,
the order or the program is used here.

What the layout says of a tab is proven, too: it stands on its edge, and moved to the edge that it
is glued to, it lies inside the facet there. Slots and double tabs are proven by their mates
(:mod:`~miurafab.fabrication.retrace_joints`). So are the outlines: they surround the facets and
tabs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely

from miurafab.errors import LayoutError
from miurafab.fabrication.kerf import cut_lines
from miurafab.fabrication.kit.plan import folders_kit
from miurafab.fabrication.kit.rim_texts import rim_texts
from miurafab.fabrication.labels import AbsentLabel
from miurafab.fabrication.nesting import turned
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.boundary import boundaries
from miurafab.fabrication.partition.patch_frame import Patch
from miurafab.fabrication.partition.patch_outline import (
    OutlinedPatch,
    OutlinedPatches,
    rings_of,
)
from miurafab.fabrication.placing import absent_labels, motion_of, texts_of
from miurafab.fabrication.retrace_joints import NEAR_MM, held, joint_faults
from miurafab.fabrication.route.order import StrokeSet
from miurafab.fabrication.seams import Seams, all_seams
from miurafab.fabrication.sheets import Layout, worked
from miurafab.fabrication.strokes import Blank, RigidTransform, sheet_strokes
from miurafab.fabrication.tabs import FOLDS, TabRegions, edge_axes
from miurafab.geometry.arrays import Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import MachineProfile, Material

_LETTERS = {name: letter for letter, name in FOLDS.items()}


def retraced(
    layout: Layout,
    pattern: CreasePattern,
    machine: MachineProfile,
    material: Material,
    options: LayoutOptions,
) -> tuple[list[StrokeSet], list[str]]:
    """The strokes of each pass in the order in which they are made, and what does not fit of the
    layout itself, in sentences.

    Raises :class:`~miurafab.errors.LayoutError` for a layout that names what the pattern lacks.
    """
    material = worked(material, machine, options)
    outlined, labels, motion = patches_on_sheets(layout, pattern)
    outlined = held(outlined, pattern, material, labels, options.join)
    margin = options.nesting.margin_mm
    margin = machine.bed.margin_mm if margin is None else margin
    lettering = texts_of(pattern, outlined, labels, layout.patches, motion, options)
    blanks = [Blank(each.name, each.width_mm, each.height_mm, margin) for each in layout.sheets]
    defects = [sheet.defects_mm for sheet in layout.sheets]
    rim = rim_texts(pattern, outlined.face_patch, layout.patches, motion, blanks, defects, options)
    texts = (*lettering.texts, *rim.texts)
    drawn = sheet_strokes(pattern, outlined, texts, motion, material, blanks, options)
    passes = [
        each
        for back, front in zip(drawn.backs, drawn.fronts, strict=True)
        for each in ([] if back is None else [back]) + [front]
    ]
    faults = [*_tab_faults(pattern, outlined, labels), *_seam_faults(layout, pattern, outlined)]
    faults += joint_faults(layout, pattern, outlined, labels, options.join)
    if layout.kit is not None and layout.kit != folders_kit(pattern):
        faults.append("The rows and angles of the folder's kit are not those of the pattern.")
    if not _same_labels(layout.absent, absent_labels(lettering, layout.patches)):
        faults.append("The labels that the layout calls absent are not those without room.")
    right = cut_lines([made.rings for made in outlined.patches], material.kerf_mm)
    for patch, made, lines in zip(layout.model.patches, outlined.patches, right, strict=True):
        told, own = (shapely.Polygon(each[0], each[1:]) for each in (made.cut_lines, lines))
        if not told.is_valid or told.symmetric_difference(own).area > NEAR_MM * own.length:
            faults.append(f"The outline of {patch.label} does not surround its facets and tabs.")
    return passes, faults


def _same_labels(told: tuple[AbsentLabel, ...], own: tuple[AbsentLabel, ...]) -> bool:
    names = [[(each.patch, each.text) for each in labels] for labels in (told, own)]
    if names[0] != names[1]:
        return False
    apart = [
        (
            one.x_mm - other.x_mm,
            one.y_mm - other.y_mm,
            one.height_mm - other.height_mm,
            math.remainder(one.rotation_deg - other.rotation_deg, 360.0),  # -180 is 180
        )
        for one, other in zip(told, own, strict=True)
    ]
    return np.allclose(apart, 0.0, atol=NEAR_MM)


def patches_on_sheets(
    layout: Layout, pattern: CreasePattern
) -> tuple[OutlinedPatches, tuple[str, ...], RigidTransform]:
    """The patches of the first model in the plane of the pattern, the labels of their tabs, and
    the motions of all patches to their sheets.

    Raises :class:`~miurafab.errors.LayoutError` for a layout that names what the pattern lacks.
    """
    outlined, labels = _outlined(layout, pattern)
    placed = {
        placement.patch: (number, placement)
        for number, sheet in enumerate(layout.sheets)
        for placement in sheet.placements
    }
    if sorted(placed) != list(range(len(layout.patches))):
        raise LayoutError("The layout does not place each patch once on a sheet.")
    sheets = np.array([placed[patch.id][0] for patch in layout.patches])
    places = [placed[patch.id][1] for patch in layout.patches]
    return outlined, labels, motion_of(layout.patches, places, sheets)


def _outlined(layout: Layout, pattern: CreasePattern) -> tuple[OutlinedPatches, tuple[str, ...]]:
    """The patches of the first model in the plane of the pattern, and the labels of their tabs."""
    patches = layout.model.patches
    if [patch.id for patch in patches] != list(range(len(patches))):
        raise LayoutError("The patches of the layout are not numbered from 0 in their order.")
    facets = np.concatenate([patch.faces for patch in patches])
    count = len(pattern.faces_vertices)
    if not np.array_equal(np.sort(facets), np.arange(count)):
        raise LayoutError("The patches of the layout do not hold each facet of the pattern once.")
    face_patch = np.empty(count, dtype=np.int64)
    face_patch[facets] = np.repeat([p.id for p in patches], [len(p.faces) for p in patches])
    tabs = _tabs(patches, pattern, face_patch)
    rings, standing = rings_of(pattern, face_patch, boundaries(pattern, face_patch), tabs)
    made = [
        OutlinedPatch(patch.faces, own, outline, _lines(patch))
        for patch, own, outline in zip(patches, standing, rings, strict=True)
    ]
    labels = tuple(tab.label for patch in patches for tab in patch.tabs)
    return OutlinedPatches(made, face_patch, tabs, np.array(layout.untabbed)), labels


def _lines(patch: Patch) -> list[Floats]:
    """The cut lines of a patch in the plane of the pattern."""
    rings = (patch.outline_mm, *patch.waste_mm)
    return [turned(ring, -patch.rotation_deg) + patch.origin_mm for ring in rings]


def _tabs(patches: tuple[Patch, ...], pattern: CreasePattern, face_patch: Ints) -> TabRegions:
    """All tabs of ``patches``, patch by patch."""
    listed = [(patch, tab) for patch in patches for tab in patch.tabs]
    edges, faces = np.full((2, len(listed), 2), -1)
    fold = np.empty(len(listed), "U1")
    sizes = np.array([len(tab.polygon_mm) for _, tab in listed])
    points = np.zeros((len(listed), int(sizes.max(initial=3)), 2))
    for row, (patch, tab) in enumerate(listed):
        sides = [(tab.edge, patch.id)]
        if tab.mate_edge is not None and tab.mate_patch is not None:
            sides.append((tab.mate_edge, tab.mate_patch))
        for side, (edge, owner) in enumerate(sides):
            if not 0 <= edge < len(pattern.edges_faces):
                raise LayoutError(f"Tab {tab.label} names edge {edge}, which is not there.")
            beside = pattern.edges_faces[edge]
            own = beside[(beside >= 0) & (face_patch[beside] == owner)]
            if not len(own):
                raise LayoutError(f"Tab {tab.label} stands on edge {edge}, of another patch.")
            edges[row, side], faces[row, side] = edge, own[0]
        inner = tab.edge == tab.mate_edge and tab.join != "double"
        fold[row] = pattern.edges_assignment[tab.edge] if inner else _LETTERS.get(tab.fold, "F")
        if sizes[row] < 3 or not np.ptp(tab.polygon_mm[:2], axis=0).any():
            raise LayoutError(
                f"Tab {tab.label} has no base: it needs three corners, two at its edge."
            )
        points[row, : sizes[row]] = turned(tab.polygon_mm, -patch.rotation_deg) + patch.origin_mm
    seams = Seams(edges, faces, fold)
    return TabRegions(seams, points, _glued(pattern, seams, points), sizes)


def _glued(pattern: CreasePattern, seams: Seams, points: Floats) -> Floats:
    """``points`` (N, m, 2) of tabs, moved to the edges that they are glued to."""
    glued = points.copy()
    moved = np.flatnonzero((seams.edges[:, 1] >= 0) & (seams.edges[:, 0] != seams.edges[:, 1]))
    if len(moved):
        own, mate = seams.edges[moved].T
        _, last, frame = edge_axes(pattern, own, seams.faces[moved, 0])
        local = np.einsum("nij,nkj->nki", frame, last[:, None] - points[moved])
        first, _, frame = edge_axes(pattern, mate, seams.faces[moved, 1])
        glued[moved] = first[:, None] + np.einsum("nij,nki->nkj", frame, local)
    return glued


def _tab_faults(
    pattern: CreasePattern, outlined: OutlinedPatches, labels: tuple[str, ...]
) -> Iterator[str]:
    """What is wrong with the tabs."""
    tabs = outlined.tabs
    for row, label in enumerate(labels):
        ends = pattern.vertices_coords[pattern.edges_vertices[tabs.edge[row]]]
        base = shapely.LineString(tabs.polygon(row)[:2])
        if not base.covered_by(shapely.LineString(ends).buffer(NEAR_MM)):
            yield f"Tab {label} does not stand on its edge."
        glued = shapely.Polygon(tabs.glued[row, : tabs.count[row]])
        mate = int(tabs.mate_face[row])
        corners = pattern.faces_vertices[mate if mate >= 0 else tabs.own_face[row]]
        facet = shapely.Polygon(pattern.vertices_coords[corners[corners >= 0]])
        if mate < 0:
            if glued.intersection(facet).area > NEAR_MM * glued.length:
                yield f"Tab {label} lies over the facet that bears it."
        elif not glued.covered_by(facet.buffer(NEAR_MM)):
            yield f"Tab {label} does not fit the facet that it is glued to."


def _seam_faults(
    layout: Layout, pattern: CreasePattern, outlined: OutlinedPatches
) -> Iterator[str]:
    """Seams without a tab of which the layout says nothing."""
    seams = all_seams(pattern, outlined.face_patch).edges.tolist()
    tabbed = {frozenset(pair) for pair in outlined.tabs.seams.edges.tolist()}
    told = set(layout.untabbed)
    missing = [pair for pair in seams if frozenset(pair) not in tabbed and told.isdisjoint(pair)]
    if missing:
        count = (
            f"{len(missing)} seam edge has"
            if len(missing) == 1
            else f"{len(missing)} seam edges have"
        )
        yield f"{count} no tab, and no finding says so, the first is edge {missing[0][0]}."
