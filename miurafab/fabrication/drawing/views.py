"""Views of a pattern and its patches on a printed page: folded, flat, and as a small map.

All views of a guide show a patch in the same colour, and all flat views have the same orientation.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from reportlab.lib.colors import Color, HexColor, white
from reportlab.lib.units import mm
from reportlab.pdfgen.pathobject import PDFPathObject

from miurafab.fabrication.borders import OpenBorder
from miurafab.fabrication.drawing.page import (
    CREASE_COLOURS,
    INK,
    PALE,
    Box,
    disk,
    fitted,
    fold_lines,
    polygon,
    text,
    tint,
)
from miurafab.fabrication.drawing.svg_canvas import Pen, SvgPath
from miurafab.fabrication.partition.boundary import boundaries
from miurafab.fabrication.partition.patch_frame import Patch
from miurafab.fabrication.seams import with_seams
from miurafab.fabrication.sheets import DrawnLayout, Layout
from miurafab.fabrication.slots import TabSlot
from miurafab.geometry.arrays import Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.picture import View, project
from miurafab.origami.seam_lines import SeamLine, seam_lines

_TALL = 1.25
"""A flat pattern with a larger ratio of height to width is turned by a right angle."""

OUTLINED = 30_000
"""Views with more facets omit the outlines of facets, which would hide everything else."""


def edge_letters(layout: Layout, pattern: CreasePattern) -> NDArray[np.str_]:
    """(E,) the assignment of each edge; a glued border has the assignment of its fold, and double
    tabs are folded as mountains.
    """
    letters = pattern.edges_assignment.copy()
    for patch in layout.patches:
        for tab in patch.tabs:
            if tab.mate_edge is None:
                letters[tab.edge] = "U"
            elif tab.join == "double":
                letters[tab.edge] = "M"
            elif tab.edge != tab.mate_edge:
                fold = {"mountain": "M", "valley": "V"}.get(tab.fold, "F")
                letters[[tab.edge, tab.mate_edge]] = fold
    return letters


_EVEN_ODD = 0
"""The fill of reportlab that leaves holes open."""


@dataclass(frozen=True, eq=False)
class Views:
    """The views of one ``layout`` of ``pattern``."""

    layout: DrawnLayout
    pattern: CreasePattern

    @cached_property
    def patches(self) -> tuple[Patch, ...]:
        """The patches of the first copy of the model, which the views show."""
        return self.layout.model.patches

    def base(self, patch: int) -> int:
        """The patch of the first copy that corresponds to a patch."""
        return patch % len(self.patches)

    def name(self, patch: int) -> str:
        """The name of a patch, the same in every copy."""
        return self.patches[self.base(patch)].label.partition("-")[0]

    @cached_property
    def face_patch(self) -> Ints:
        """(F,) the patch of each facet."""
        found = np.zeros(len(self.pattern.faces_vertices), dtype=np.int64)
        for patch in self.patches:
            found[patch.faces] = patch.id
        return found

    @cached_property
    def flat(self) -> Floats:
        """(V, 2) the flat pattern, turned by a right angle if it is tall."""
        return self.upright(self.pattern.vertices_coords)

    def upright(self, points: Floats) -> Floats:
        """``points`` (n, 2) of the flat pattern in flat views."""
        width, height = np.ptp(self.pattern.vertices_coords, axis=0)
        return points[:, ::-1] * [-1.0, 1.0] if height > _TALL * width else points

    @cached_property
    def seams(self) -> tuple[SeamLine, ...]:
        """The lines along which borders are glued."""
        return seam_lines(with_seams(self.pattern))

    @property
    def aspect(self) -> float:
        """The height of flat views over their width."""
        width, height = np.ptp(self.flat, axis=0)
        return float(height / max(width, 1e-9))

    @property
    def folded_aspect(self) -> float:
        """The height of the folded view over its width."""
        assert self.pattern.folded_coords is not None
        view = project(self.pattern.folded_coords, self.pattern.faces_vertices)
        width, height = np.ptp(view.places, axis=0)
        return float(height / max(width, 1e-9))

    @cached_property
    def rings(self) -> list[list[Ints]]:
        """The vertices around each patch, and around each of its holes."""
        around = boundaries(self.pattern, self.face_patch)
        return [[loop.vertices for loop in each.loops] for each in around]

    @cached_property
    def letters(self) -> NDArray[np.str_]:
        """(E,) as :func:`edge_letters`."""
        return edge_letters(self.layout, self.pattern)

    @cached_property
    def labels(self) -> dict[int, str]:
        """The label of each tab by its number."""
        return {tab.number: tab.label for patch in self.patches for tab in patch.tabs}

    @cached_property
    def join(self) -> str:
        """What holds the seams."""
        joins = (t.join for p in self.patches for t in p.tabs if t.mate_patch is not None)
        return next(joins, "glue")

    @cached_property
    def slots(self) -> dict[int, tuple[Patch, TabSlot]]:
        """The slot for each tab by its number, and the patch that has it."""
        return {slot.tab: (patch, slot) for patch in self.patches for slot in patch.slots}

    def standing(self, border: OpenBorder) -> tuple[str, ...]:
        """The labels of the tabs on an open border."""
        edges = set(border.edges)
        return tuple(tab.label for p in self.patches for tab in p.tabs if tab.edge in edges)

    def folded_view(self, canvas: Pen, box: Box, shown: Collection[int] | None = None) -> float:
        """An orthographic view, far facets first, lit from the upper left; returns its scale. If
        ``shown`` is given, other patches are pale.
        """
        assert self.pattern.folded_coords is not None
        view = project(self.pattern.folded_coords, self.pattern.faces_vertices)
        seen, scale = fitted(view.places, box)
        fills = [
            tint(patch.id) if shown is None or patch.id in shown else PALE for patch in self.patches
        ]
        for face in view.order.tolist():
            self.facet(canvas, seen, view, face, fills[self.face_patch[face]])
        return scale

    def facet(self, canvas: Pen, seen: Floats, view: View, face: int, fill: Color) -> None:
        """One facet of a ``view``, at its places ``seen`` on the page."""
        level = min(float(view.shade[face]), 1.0)
        shaded = Color(fill.red * level, fill.green * level, fill.blue * level)
        canvas.setFillColor(shaded)
        canvas.setStrokeColor(Color(shaded.red * 0.75, shaded.green * 0.75, shaded.blue * 0.75))
        canvas.setLineWidth(0.08 * mm)
        canvas.setLineJoin(1)
        faces = self.pattern.faces_vertices
        corners = faces[face][faces[face] >= 0]
        polygon(canvas, seen[corners], stroke=len(faces) <= OUTLINED)

    def flat_view(self, canvas: Pen, box: Box) -> float:
        """The flat pattern with its creases, its seams with their numbers and the names of its
        patches; returns its scale.
        """
        count = len(self.pattern.vertices_coords)
        marks = (self.upright(line.places) for line in self.seams)
        points, scale = fitted(np.concatenate([self.flat, *marks]), box)
        for patch in self.patches:
            self.fill(canvas, points, patch.id, 0.75)
        ends = points[self.pattern.edges_vertices] * mm
        canvas.setLineCap(1)
        for letter, colour in CREASE_COLOURS.items():
            canvas.setStrokeColor(colour)
            canvas.setLineWidth(0.12 * mm)
            folds = fold_lines(ends[self.pattern.edges_assignment == letter], letter, 1 / mm)
            canvas.lines(folds.reshape(-1, 4).tolist())
        self._around(canvas, points, 0.3, INK)
        for line in self.seams:
            canvas.setStrokeColor(HexColor(line.colour))
            canvas.setLineWidth(0.6 * mm)
            canvas.lines(ends[line.edges.ravel()].reshape(-1, 4).tolist())
        size = _fitting(11.0, len(self.patches))
        for patch in self.patches:
            self._name(canvas, points, patch.id, size)
        for place, line in enumerate(self.seams):
            for x, y in points[count + 2 * place :][:2].tolist():
                disk(canvas, str(line.number), x, y, HexColor(line.colour))
        borders = self.layout.borders if len(self.layout.borders) > 1 else ()
        for border in borders:
            own = np.array(border.edges)
            patch = self.face_patch[self.pattern.edges_faces[own].max(axis=1)]
            for number in np.unique(patch).tolist():
                middle = ends[own[patch == number]].reshape(-1, 2) / mm
                far = np.linalg.norm(middle - middle.mean(axis=0), axis=1)
                x, y = middle[int(np.argmin(far))].tolist()
                disk(canvas, f"B{border.number}", x, y, INK)
        return scale

    def fill(self, canvas: Pen, points: Floats, patch: int, strength: float) -> None:
        """A patch in its colour, its vertices at ``points`` (V, 2) of the page."""
        canvas.setFillColor(tint(patch, strength))
        self._filled(canvas, points, patch)

    def _filled(self, canvas: Pen, points: Floats, patch: int) -> None:
        """A patch in the current colour; its holes stay open."""
        path = _closed(canvas, [points[ring] for ring in self.rings[patch]])
        canvas.drawPath(path, stroke=0, fill=1, fillMode=_EVEN_ODD)

    def _around(self, canvas: Pen, points: Floats, weight: float, colour: Color) -> None:
        canvas.setStrokeColor(colour)
        canvas.setLineWidth(weight * mm)
        canvas.setLineJoin(1)
        path = _closed(canvas, [points[ring] for rings in self.rings for ring in rings])
        canvas.drawPath(path, stroke=1, fill=0)

    def _name(self, canvas: Pen, points: Floats, patch: int, size: float) -> None:
        """The name of a patch in its middle."""
        corners = self.pattern.faces_vertices[self.patches[patch].faces]
        x, y = points[corners[corners >= 0]].mean(axis=0)
        named(canvas, self.name(patch), x, y, size)

    def map(
        self,
        canvas: Pen,
        box: Box,
        shown: Collection[int],
        done: Collection[int] = (),
        seams: Ints | None = None,
    ) -> None:
        """The patches without creases: ``shown`` patches in colour, ``done`` patches lighter, other
        patches pale; the pattern edges ``seams`` are heavy.
        """
        points, _ = fitted(self.flat, box)
        for patch in range(len(self.patches)):
            strength = 1.0 if patch in shown else 0.45
            known = patch in shown or patch in done
            canvas.setFillColor(tint(patch, strength) if known else PALE)
            self._filled(canvas, points, patch)
        self._around(canvas, points, 0.2, white)
        if seams is not None and len(seams):
            canvas.setStrokeColor(INK)
            canvas.setLineWidth(0.7 * mm)
            canvas.setLineCap(1)
            canvas.lines((points[self.pattern.edges_vertices[seams]] * mm).reshape(-1, 4).tolist())
        size = _fitting(8.0, len(self.patches))
        for patch in {*shown, *done}:
            self._name(canvas, points, patch, size)


def _closed(canvas: Pen, rings: Iterable[Floats]) -> PDFPathObject | SvgPath:
    """One path around all ``rings`` (n, 2)."""
    path = canvas.beginPath()
    for ring in rings:
        for k, (x, y) in enumerate((ring * mm).tolist()):
            (path.lineTo if k else path.moveTo)(x, y)
        path.close()
    return path


def named(canvas: Pen, label: str, x: float, y: float, size: float) -> None:
    """A label centred on a point of a drawing, with a white rim."""
    width = canvas.stringWidth(label, "Helvetica-Bold", size)
    canvas.setFont("Helvetica-Bold", size)
    canvas.setLineWidth(0.14 * size / 72 * 25.4 * mm)
    canvas.setLineJoin(1)
    canvas.setStrokeColor(white)
    canvas.drawString(x * mm - width / 2, y * mm - 0.35 * size, label, mode=1)
    text(canvas, x, y - 0.35 * size / 72 * 25.4, label, size, bold=True, align="middle")


def _fitting(size: float, patches: int) -> float:
    """The type size for the names of ``count`` patches."""
    return max(size * min(1.0, math.sqrt(16 / max(patches, 1))), 3.5)
