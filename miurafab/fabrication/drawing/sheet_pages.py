"""The pages of the guide on one sheet: its strokes, and the places of its patches."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from reportlab.lib.units import mm
from reportlab.pdfbase.pdfmetrics import stringWidth

from miurafab.fabrication.drawing.callouts import Callout, Taken, draw_callouts
from miurafab.fabrication.drawing.neighbours import neighbours
from miurafab.fabrication.drawing.page import (
    BOTTOM,
    HEIGHT,
    INK,
    MARGIN,
    MOUNTAIN,
    QUIET,
    ROOM,
    RULE,
    VALLEY,
    Box,
    Page,
    chip,
    heading,
    legend,
    line_above,
    paragraph,
    polygon,
    scale_bar,
    text,
    tint,
    wrapped,
)
from miurafab.fabrication.drawing.pdf import draw_for_people
from miurafab.fabrication.drawing.svg_canvas import Pen
from miurafab.fabrication.drawing.views import OUTLINED, Views, named
from miurafab.fabrication.sheets import DrawnLayout, Placement, Sheet
from miurafab.fabrication.toolpath import Toolpath
from miurafab.fabrication.wording import count
from miurafab.geometry.arrays import Floats
from miurafab.profiles import OPERATIONS

_CARD = 33.0
"""The least height of a card below its sheet; cards are higher if there is room."""
_PICTURED = 12
"""With more patches on a sheet, cards have no picture: the sheet is the picture."""
_COLUMNS = 3
_CHIP, _CHIP_MM = 6.5, (9.0, 5.0)
"""The type size of the name of a neighbour, and its distances from the seam that are tried."""
_MADE = {"cut": "cut", "perforate": "perforated", "score": "scored"}
"""The operations whose lengths are shown, and their verbs."""

_Words = tuple[float, float, str, list[str]]
"""The places of the text on a card: its left edge, the name, and the lines below."""


@dataclass(frozen=True, eq=False)
class SheetPages:
    """The pages on one ``sheet`` and its ``toolpath``, in the guide with this ``title``."""

    views: Views
    sheet: Sheet
    toolpath: Toolpath
    title: str

    @property
    def layout(self) -> DrawnLayout:
        return self.views.layout

    @cached_property
    def behind(self) -> Toolpath | None:
        """The strokes made from the back of the sheet, seen from the front."""
        for back in self.layout.backs:
            if back.sheet == self.sheet.back:
                mirrored = back.points * [-1.0, 1.0] + [self.sheet.width_mm, 0.0]
                return replace(back, points=mirrored)
        return None

    def holes(self) -> str:
        """The places of the registration holes when the front is made."""
        path = self.behind
        assert path is not None
        cut = path.operation == OPERATIONS.index("cut")
        middles = [path.stroke(int(k))[:-1].mean(axis=0) for k in np.flatnonzero(cut)]
        places = [f"X{x:.1f} Y{y:.1f}" for x, y in sorted(each.tolist() for each in middles)]
        return f"{', '.join(places[:-1])} and {places[-1]}"

    def label(self, patch: int) -> str:
        return self.layout.patches[patch].label

    @property
    def scale(self) -> float:
        """Millimetres on paper for one of the sheet."""
        return min(ROOM / self.sheet.width_mm, 122.0 / self.sheet.height_mm)

    @property
    def tall(self) -> float:
        """The height of :meth:`draw_sheet` in mm."""
        return self.sheet.height_mm * self.scale + (16 if self.sheet.back is None else 26)

    def subtitle(self) -> str:
        """The patches of the sheet, its stock and its fibres."""
        sheet = self.sheet
        labels = [self.label(placed.patch) for placed in sheet.placements]
        subtitle = f"{'Patch' if len(labels) == 1 else 'Patches'} {', '.join(labels)}"
        if len(subtitle) > 95:
            subtitle = f"{len(labels)} patches"
        if sheet.stock:
            subtitle += f" from '{sheet.stock}'"
        if sheet.grain != "none":
            subtitle += f", fibres along the bed's {sheet.grain}"
        return subtitle

    def pages(self) -> Iterator[Page]:
        """Functions that draw one page each."""
        sheet, subtitle, scale = self.sheet, self.subtitle(), self.scale
        top = HEIGHT - MARGIN - 19
        under = top - self.tall
        placed = [each.patch for each in sheet.placements]
        if len(placed) > _PICTURED:
            yield from self.listed(placed, subtitle, scale, under)
            return
        # Cards below the drawing, and cards on a page of their own.
        first = int((under - BOTTOM) // _CARD) * 2

        def front(canvas: Pen) -> None:
            heading(canvas, f"{self.title}: {sheet.name}", subtitle)
            self.draw_sheet(canvas, top, scale)
            if len(placed) == 1:
                self.one_card(canvas, placed[0], under)
            else:
                self.cards(canvas, placed[:first], under)

        def more(canvas: Pen) -> None:
            heading(canvas, f"{self.title}: {sheet.name}", "Its patches, continued")
            self.cards(canvas, placed[first:], top)

        yield front
        if len(placed) > max(first, 1):
            yield more

    def listed(
        self, patches: list[int], subtitle: str, scale: float, under: float
    ) -> Iterator[Page]:
        """The sheet, and the texts of many patches in columns, on as many pages as needed."""
        top = HEIGHT - MARGIN - 19
        width = (ROOM - 6 * (_COLUMNS - 1)) / _COLUMNS
        blocks = [
            (
                self.label(patch),
                [n for r in neighbours(self.views, patch) for n in wrapped(r, width, 7.5)],
            )
            for patch in patches
        ]
        pages: list[list[_Words]] = [[]]
        column, start, y = 0, under, under
        for label, lines in blocks:
            tall = 7.5 + 3.6 * len(lines)
            if y - tall < BOTTOM:
                column, y = column + 1, start
            if column == _COLUMNS:
                pages.append([])
                column, start, y = 0, top, top
            pages[-1].append((MARGIN + column * (width + 6), y, label, lines))
            y -= tall

        def draw(canvas: Pen, part: list[_Words]) -> None:
            for x, upper, label, lines in part:
                line_above(canvas, x, upper, width)
                text(canvas, x, upper - 4.2, label, 8.5, bold=True)
                for number, line in enumerate(lines):
                    text(canvas, x, upper - 8 - 3.6 * number, line, 7.5)

        def front(canvas: Pen) -> None:
            heading(canvas, f"{self.title}: {self.sheet.name}", subtitle)
            self.draw_sheet(canvas, top, scale)
            draw(canvas, pages[0])

        yield front
        for part in pages[1:]:

            def more(canvas: Pen, part: list[_Words] = part) -> None:
                heading(canvas, f"{self.title}: {self.sheet.name}", "Its patches, continued")
                draw(canvas, part)

            yield more

    def draw_sheet(self, canvas: Pen, top: float, scale: float) -> None:
        """The sheet with its strokes, in the middle of the page."""
        sheet, toolpath = self.sheet, self.toolpath
        x = MARGIN + (ROOM - sheet.width_mm * scale) / 2
        low = top - sheet.height_mm * scale
        canvas.saveState()
        canvas.translate(x * mm, low * mm)
        canvas.scale(scale, scale)
        for placed in sheet.placements:
            patch = self.layout.patches[placed.patch]
            canvas.setFillColor(tint(self.views.base(patch.id), 0.4))
            polygon(canvas, placed.from_patch(patch.outline_mm))
        canvas.setFillColor(RULE)
        for ring in sheet.defects_mm:
            polygon(canvas, np.array(ring))
        draw_for_people(canvas, toolpath, self.views.letters, scale)
        if self.behind is not None:
            draw_for_people(canvas, self.behind, self.views.letters, scale)
        canvas.setStrokeColor(RULE)
        canvas.setLineWidth(0.3 / scale * mm)
        canvas.rect(0, 0, sheet.width_mm * mm, sheet.height_mm * mm)
        canvas.restoreState()
        written = Taken()
        for placed in sheet.placements:
            self.draw_names(canvas, placed, (x, low), scale, written)
        self.draw_absent(canvas, (x, low), scale, written)
        scale_bar(canvas, scale, MARGIN, low - 6)
        entries = [
            ("mountain", MOUNTAIN, 0.3),
            ("valley", VALLEY, 0.3),
            ("cut", INK, 0.45),
        ]
        legend(canvas, entries, MARGIN + ROOM, low - 6)
        passes = [toolpath] if self.behind is None else [toolpath, self.behind]
        lengths = {
            word: sum(each.length_of(operation) for each in passes) / 1000
            for operation, word in _MADE.items()
        }
        figures = (
            f"{sheet.width_mm:g} x {sheet.height_mm:g} mm, drawn at 1:{1 / scale:.3g}; "
            + ", ".join(f"{length:.2f} m {word}" for word, length in lengths.items() if length > 0)
        )
        text(canvas, MARGIN + ROOM, low - 11.5, figures, 8, colour=QUIET, align="right")
        if self.behind is not None:
            words = (
                f"First run {sheet.back}. Turn the sheet over, left to right, so that its three "
                f"holes lie at {self.holes()}; then run {sheet.name}."
            )
            paragraph(canvas, MARGIN, low - 17.5, words, ROOM, 9, bold=True)

    def draw_absent(
        self, canvas: Pen, corner: tuple[float, float], scale: float, written: Taken
    ) -> None:
        """The labels that are not on the sheet. Names are in the drawing anyway."""
        placed = {each.patch: each for each in self.sheet.placements}
        labels = []
        for label in self.layout.absent:
            if label.patch in placed and label.text != self.label(label.patch):
                place = placed[label.patch]
                at = np.array([[label.x_mm, label.y_mm]])
                ((x, y),) = (place.from_patch(at) * scale + corner).tolist()
                angle = math.radians(label.rotation_deg + place.rotation_deg)
                labels.append(Callout(label.text, x, y, angle, label.height_mm * scale))
        outlines = [
            place.from_patch(self.layout.patches[patch].outline_mm) * scale + corner
            for patch, place in placed.items()
        ]
        draw_callouts(canvas, labels, outlines, written)

    def draw_names(
        self,
        canvas: Pen,
        placed: Placement,
        corner: tuple[float, float],
        scale: float,
        written: Taken,
    ) -> None:
        """The name of a patch, and along each of its seams the name of the neighbour."""
        patch = self.layout.patches[placed.patch]
        pattern = self.views.pattern

        def on_page(points: Floats) -> Floats:
            moved = placed.from_patch(patch.from_pattern(points)) * scale
            return np.asarray(moved + np.array(corner))

        corners = pattern.faces_vertices[patch.faces]
        points = on_page(pattern.vertices_coords[corners[corners >= 0]])
        middle, span = points.mean(axis=0), float(np.ptp(points, axis=0).min())
        size = min(max(span / 2.2, 4.0), 16.0)
        strokes = self.engraved(patch.id) * scale + corner
        at = _clear_place(np.vstack([middle, points]), strokes, patch.label, size)
        name = float(at[0]), float(at[1])
        named(canvas, patch.label, *name, size)
        written.take(*name, stringWidth(patch.label, "Helvetica-Bold", size) / mm + 1, 0.35 * size)
        if span < 26:
            return
        for mate, edges in self.seams_of(patch.id).items():
            ends = on_page(pattern.vertices_coords[pattern.edges_vertices[edges]].mean(axis=1))
            near = np.argsort(np.linalg.norm(ends - ends.mean(axis=0), axis=1), kind="stable")
            way = middle - ends[near]
            way /= np.maximum(np.linalg.norm(way, axis=1), 1e-9)[:, None]
            # The middle of the seam first, then along it; inside the patch, clear of its name.
            places = np.concatenate([ends[near] + deep * way for deep in _CHIP_MM])
            wide = stringWidth(self.label(mate), "Helvetica-Bold", _CHIP) / mm + 0.32 * _CHIP
            x, y = places[int(np.argmax(written.clear(places, wide, 0.52 * _CHIP)))].tolist()
            written.take(x, y, wide, 0.52 * _CHIP)
            chip(canvas, self.label(mate), x, y, tint(self.views.base(mate)), _CHIP)

    def engraved(self, patch: int) -> Floats:
        """The points (n, 2) of what is engraved on a patch, seen from the front."""
        found = []
        for path in (self.toolpath, self.behind):
            if path is not None:
                own = (path.operation == OPERATIONS.index("engrave")) & (path.patch == patch)
                found.append(path.points[np.repeat(own, np.diff(path.offsets))])
        return np.concatenate(found)

    def seams_of(self, patch: int) -> dict[int, list[int]]:
        """The glued pattern edges of a patch, by neighbour."""
        found: dict[int, list[int]] = {}
        for other in self.layout.patches:
            for tab in other.tabs:
                if tab.mate_patch is None or tab.mate_edge is None:
                    continue
                if other.id == patch:
                    found.setdefault(tab.mate_patch, []).append(tab.edge)
                elif tab.mate_patch == patch:
                    found.setdefault(other.id, []).append(tab.mate_edge)
        return found

    def cards(self, canvas: Pen, patches: list[int], top: float) -> None:
        """The cards of the patches, in two columns."""
        rows = math.ceil(len(patches) / 2)
        width = (ROOM - 6) / 2
        beside = 0.4 * width
        height = min((top - BOTTOM) / rows, max(_CARD, beside * self.views.aspect + 14))
        for number, patch in enumerate(patches):
            row, column = divmod(number, 2)
            x, y = MARGIN + column * (width + 6), top - row * height
            line_above(canvas, x, y, width)
            tall = min(height - 8, beside * self.views.aspect)
            self.views.map(canvas, (x, y - 4 - tall, beside, tall), shown=(self.views.base(patch),))
            self.say(canvas, patch, (x + beside + 5, y, width - beside - 5, height))

    def one_card(self, canvas: Pen, patch: int, top: float) -> None:
        """The card of a single patch on its page, with its place in the folded form."""
        third = (ROOM - 12) / 3
        room = min(top - BOTTOM, 80.0)
        line_above(canvas, MARGIN, top, ROOM)
        tall = min(room - 10, third * self.views.aspect)
        self.views.map(
            canvas, (MARGIN, top - 5 - tall, third, tall), shown=(self.views.base(patch),)
        )
        if self.views.pattern.folded_coords is not None and len(self.views.face_patch) <= OUTLINED:
            box = (MARGIN + third + 6, top - room + 2, third, room - 5)
            self.views.folded_view(canvas, box, shown=(self.views.base(patch),))
        self.say(canvas, patch, (MARGIN + 2 * third + 12, top, third, room))

    def say(self, canvas: Pen, patch: int, box: Box) -> None:
        """The name of a patch and its neighbours, in the upper part of ``box``."""
        x, top, width, height = box
        facets = count(len(self.layout.patches[patch].faces), "facet", "facets")
        text(canvas, x, top - 6, self.label(patch), 11, bold=True)
        text(canvas, x + width, top - 6, facets, 8, colour=QUIET, align="right")
        lines = [
            line for words in neighbours(self.views, patch) for line in wrapped(words, width, 8)
        ]
        room = int((height - 12) / 4)
        if len(lines) > room:
            lines = [*lines[: room - 1], "and more: see the steps"]
        for number, line in enumerate(lines):
            text(canvas, x, top - 11.5 - 4 * number, line, 8)


def _clear_place(places: Floats, strokes: Floats, label: str, size: float) -> Floats:
    """The place of ``places`` (n, 2) nearest to the first place at which a ``label`` of type size
    ``size`` hides none of the points ``strokes`` (m, 2); the first place if there is none.
    """
    wide = stringWidth(label, "Helvetica-Bold", size) / mm / 2 + 1.5
    room = np.array([wide, 0.14 * size + 1.5])
    near = np.argsort(np.linalg.norm(places - places[0], axis=1), kind="stable").tolist()
    hidden = ((np.abs(strokes - places[k]) < room).all(axis=1).any() for k in near)
    best = next((k for k, hides in zip(near, hidden, strict=True) if not hides), 0)
    return np.asarray(places[best])
