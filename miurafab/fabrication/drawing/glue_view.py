"""A step of gluing in space: the patch, what it is glued to, and its tabs in place.

A tab lies under the facet of its mate. It is drawn in its place as if all paper over it were
clear. Along its edge it has its length from the flat pattern, and across the edge its height, in
the plane of the mate's facet. A tab for a slot is drawn with the slot across it. Double tabs stand
behind the shell, in the plane between the two facets.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from functools import cached_property

import numpy as np
from reportlab.lib.colors import HexColor
from reportlab.lib.units import mm

from miurafab.fabrication.assembly import GlueStep
from miurafab.fabrication.drawing.page import INK, PALE, Box, fitted, polygon, text, tint
from miurafab.fabrication.drawing.svg_canvas import Pen
from miurafab.fabrication.drawing.views import Views, named
from miurafab.fabrication.nesting import turned
from miurafab.fabrication.partition.patch_frame import Patch
from miurafab.fabrication.tabs import Tab
from miurafab.geometry.arrays import Bools, Floats
from miurafab.geometry.polygons import facet_normals, filled
from miurafab.origami.picture import AZIMUTH, ELEVATION, project

TAB = HexColor("#ffb000")
"""The tabs of a step: no patch is so bright."""
_NAME = 4.5, 7.0
"""The least and the greatest type size of the label on a tab, in points."""

_WHOLE = 0.55
"""The part of the height that shows the whole."""
_NO_FACES = np.empty((0, 3), dtype=np.int64)

_ASIDE, _LEAST = math.radians(20), math.radians(25)
"""A step of gluing is seen this far from the side, so that the folds have depth, and at least from
this elevation if it is seen from above."""
_CLOSED = 0.2
"""A seam is on the outside of a round shell if it lies so far out, over the size of the shell,
along the mean normal of its facets."""
_LEVEL = 0.02
"""A mean of unit normals that is shorter says nothing."""


class GlueView:
    """The views of all steps of gluing, in space."""

    def __init__(self, views: Views) -> None:
        assert views.pattern.folded_coords is not None
        self.views, self.pattern = views, views.pattern
        self.points: Floats = views.pattern.folded_coords

    def step(self, canvas: Pen, box: Box, step: GlueStep, done: Collection[int]) -> None:
        """The whole, and below it the facets at the seam, with the tabs on them.

        The patch of ``step`` is in colour, the patches it is glued to lighter, and those ``done``
        pale behind them. All is seen from outside.
        """
        x, y, width, height = box
        face_patch = self.views.face_patch
        shown = np.isin(face_patch, [step.patch, *step.onto, *done])
        if not step.edges:
            self._drawn(canvas, box, step, shown, named_too=True)
            return
        low = (1 - _WHOLE) * height
        self._drawn(canvas, (x, y + low, width, height - low), step, shown, named_too=True)
        ends = np.unique(self.pattern.edges_vertices[list(step.edges)])
        at_seam = np.isin(self.pattern.faces_vertices, ends).any(axis=1)
        at_seam &= np.isin(face_patch, [step.patch, *step.onto])
        self._drawn(canvas, (x, y, width, low - 2), step, at_seam, named_too=False)

    def _drawn(
        self, canvas: Pen, box: Box, step: GlueStep, shown: Bools, *, named_too: bool
    ) -> None:
        """The facets ``shown`` (F,) in a box, the seam heavy. If ``named_too``, the patch has its
        name; else the seam runs from left to right and the tabs are there.
        """
        faces, face_patch = self.pattern.faces_vertices, self.views.face_patch
        tabs = {} if named_too else self._tabs_on(step)
        if named_too:
            towards = _aside(*_angles(self._towards(step)))
        else:
            towards = _angles(self._at_tabs(step, tabs))
        view = project(self.points, faces, *towards)
        corners = faces[shown]
        used = np.unique(corners[corners >= 0])
        turn = np.eye(2) if named_too else _level(view.places[used])
        placed, scale = fitted(view.places[used] @ turn, box)
        shift = placed[0] - scale * view.places[used[0]] @ turn
        seen = view.places @ turn * scale + shift
        outlines = {
            face: [
                (k, project(o, _NO_FACES, *towards).places @ turn * scale + shift) for k, o in own
            ]
            for face, own in tabs.items()
        }
        near = {patch: tint(patch, 0.45) for patch in step.onto} | {step.patch: tint(step.patch)}
        marked: dict[int, list[int]] = {}
        for edge in step.edges:
            for face in self.pattern.edges_faces[edge].tolist():
                marked.setdefault(face, []).append(edge)
        ordered = [face for face in view.order.tolist() if shown[face]]
        canvas.setFillColor(PALE)
        for face in ordered:
            if int(face_patch[face]) not in near:
                polygon(canvas, seen[faces[face][faces[face] >= 0]])
        for face in ordered:
            own = int(face_patch[face])
            if own not in near:
                continue
            self.views.facet(canvas, seen, view, face, near[own])
            canvas.setStrokeColor(INK)
            # Nearer facets hide the part of a seam that is not seen.
            heavy = self.pattern.edges_vertices[marked.get(face, [])]
            canvas.setLineWidth((0.6 if named_too else 0.35) * mm)
            canvas.setLineCap(1)
            canvas.lines((seen[heavy] * mm).reshape(-1, 4).tolist())
        on_top = [each for face in ordered for each in outlines.get(face, ())]
        for label, outline in on_top:
            canvas.setFillColor(TAB if label else INK)
            canvas.setStrokeColor(INK)
            canvas.setLineWidth(0.2 * mm)
            polygon(canvas, outline, stroke=True)
            _labelled(canvas, label, outline)
        if named_too:
            own_corners = faces[face_patch == step.patch]
            x, y = seen[own_corners[own_corners >= 0]].mean(axis=0).tolist()
            named(canvas, self.views.name(step.patch), x, y, 9.0)

    def _tabs_on(self, step: GlueStep) -> dict[int, list[tuple[str, Floats]]]:
        """The labels and outlines in space of the tabs of a step, by the facet over each, and of
        slots, without labels.
        """
        found: dict[int, list[tuple[str, Floats]]] = {}
        for number in step.tabs:
            patch, tab = self._numbered[number]
            mate, outline = self.glued(patch, tab)
            found.setdefault(mate, []).append((tab.label, outline))
            if number in self.views.slots:
                found[mate].append(("", self._slot(number, mate)))
        return found

    def _slot(self, number: int, mate: int) -> Floats:
        """(4, 3) the slot for the tab of this number, in the facet ``mate``."""
        patch, slot = self.views.slots[number]
        flat = turned(slot.polygon_mm, -patch.rotation_deg) + patch.origin_mm
        return self._in_space(slot.edge, flat, self._inward(slot.edge, mate))

    def _in_space(self, edge: int, flat: Floats, away: Floats) -> Floats:
        """The points ``flat`` (n, 2) of the pattern beside ``edge``, in space: along the
        edge, and as far from it in the direction ``away`` (3,).
        """
        ends = self.pattern.edges_vertices[edge]
        a, b = self.pattern.vertices_coords[ends]
        along = (b - a) / np.linalg.norm(b - a)
        across = np.abs((flat - a) @ np.array([-along[1], along[0]]))
        start, end = self.points[ends]
        way = (end - start) / np.linalg.norm(end - start)
        return np.asarray(start + np.outer((flat - a) @ along, way) + np.outer(across, away))

    def _inward(self, edge: int, face: int) -> Floats:
        """The unit vector (3,) from ``edge`` into ``face``, in its plane."""
        start, end = self.points[self.pattern.edges_vertices[edge]]
        way = (end - start) / np.linalg.norm(end - start)
        corners = self.pattern.faces_vertices[face]
        inward = self.points[corners[corners >= 0]].mean(axis=0) - start
        inward -= (inward @ way) * way
        return np.asarray(inward / np.linalg.norm(inward))

    @cached_property
    def _numbered(self) -> dict[int, tuple[Patch, Tab]]:
        return {tab.number: (patch, tab) for patch in self.views.patches for tab in patch.tabs}

    def glued(self, patch: Patch, tab: Tab) -> tuple[int, Floats]:
        """The facet that a tab of a seam is joined to, and the tab (n, 3) there."""
        assert tab.mate_edge is not None
        pattern, face_patch = self.pattern, self.views.face_patch
        beside, facing = pattern.edges_faces[[tab.edge, tab.mate_edge]].tolist()
        own = next(f for f in beside if f >= 0 and face_patch[f] == patch.id)
        others = (f for f in facing if f >= 0 and face_patch[f] == tab.mate_patch)
        mate = next(f for f in others if f != own or tab.edge != tab.mate_edge)
        flat = turned(tab.polygon_mm, -patch.rotation_deg) + patch.origin_mm
        away = self._inward(tab.edge, mate)
        if tab.join == "double":
            normals = facet_normals(self.points, pattern.faces_vertices[[own, mate]])
            away = -normals.sum(axis=0)
            away /= max(float(np.linalg.norm(away)), 1e-12)
        return mate, self._in_space(tab.edge, flat, away)

    def _towards(self, step: GlueStep) -> Floats:
        """The direction (3,) to a viewer who sees both sides of the seam, or the first patch.

        It is the mean normal of their facets, outwards: away from the middle of the shell, or, if
        the middle of the shell lies among them, to the front.
        """
        if step.edges:
            own = np.unique(self.pattern.edges_faces[list(step.edges)])
            own = own[own >= 0]
        else:
            own = self.views.patches[step.patch].faces
        faces = self.pattern.faces_vertices[own]
        normal = facet_normals(self.points, faces).mean(axis=0)
        middle = (self.points.min(axis=0) + self.points.max(axis=0)) / 2
        out = self.points[filled(faces)].mean(axis=(0, 1)) - middle
        far = abs(out @ normal) > _CLOSED * float(np.ptp(self.points, axis=0).max())
        outside = far or self.pattern.pieces_count > 1
        return np.asarray(-normal if outside and out @ normal < 0 else normal)

    def _at_tabs(self, step: GlueStep, over: Collection[int]) -> Floats:
        """The direction (3,) to a viewer who sees the facets ``over`` tabs alike, on the side from
        which the whole is seen.
        """
        whole = self._towards(step)
        if not over:
            return whole
        faces = self.pattern.faces_vertices[list(over)]
        normal = facet_normals(self.points, faces).mean(axis=0)
        sizes = float(np.linalg.norm(normal) * np.linalg.norm(whole))
        return normal if normal @ whole > sizes / 5 else whole


def _angles(way: Floats) -> tuple[float, float]:
    """The azimuth and elevation of a direction (3,)."""
    across = math.hypot(way[0], way[1])
    if np.linalg.norm(way) < _LEVEL:
        return AZIMUTH, ELEVATION
    azimuth = math.atan2(way[1], way[0]) if across > _LEVEL else AZIMUTH
    return azimuth, math.atan2(way[2], across)


def _aside(azimuth: float, rise: float) -> tuple[float, float]:
    """A view a little from the side."""
    if rise > 0:
        rise = min(max(rise, _LEAST), math.pi / 2 - _ASIDE)
    return azimuth + _ASIDE, rise


def _level(points: Floats) -> Floats:
    """(2, 2) what ``points`` (n, 2) are multiplied with so that they extend from left to right."""
    _, _, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    x, y = (axes[0] if axes[0, 0] > 0 else -axes[0]).tolist()
    return np.array([[x, -y], [y, x]])


def _labelled(canvas: Pen, label: str, placed: Floats) -> None:
    """The label of a tab on it, if it can be read there."""
    room = float(np.ptp(placed, axis=0).min())
    size = min(room * 2.2, _NAME[1])
    if size < _NAME[0]:
        return
    x, y = placed.mean(axis=0).tolist()
    text(canvas, x, y - 0.12 * size, label, size, bold=True, align="middle")
