"""``assembly.pdf``, the assembly guide on A4, and ``assembly.html``, the same for a tablet.

The first page shows the folded form and the flat pattern, with the patches in the same colours, and
the settings. Then follow each sheet with its patches and their places, and the folding and gluing,
step by step, unless the pattern is of loose parts. Everything is drawn from the layout and the
pattern; the same input gives the same bytes.
"""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np
from reportlab.lib.colors import HexColor
from reportlab.lib.units import mm
from reportlab.pdfgen.canvas import Canvas

from miurafab.fabrication.borders import is_loose
from miurafab.fabrication.drawing.flow import flow
from miurafab.fabrication.drawing.glue_sections import GlueSections
from miurafab.fabrication.drawing.jig_section import jig_section
from miurafab.fabrication.drawing.kit_sections import KitSections
from miurafab.fabrication.drawing.page import (
    BOTTOM,
    HEIGHT,
    INK,
    MARGIN,
    MOUNTAIN,
    QUIET,
    ROOM,
    VALLEY,
    WIDTH,
    Page,
    caption,
    foot,
    heading,
    legend,
    paragraph,
    paragraph_height,
    scale_bar,
    text,
)
from miurafab.fabrication.drawing.sheet_pages import SheetPages
from miurafab.fabrication.drawing.tablet_page import tablet_page
from miurafab.fabrication.drawing.views import Views
from miurafab.fabrication.sheets import DrawnLayout
from miurafab.fabrication.tooling import made_by
from miurafab.fabrication.wording import count
from miurafab.geometry.arrays import Floats
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.seam_lines import SEAM_WORDS
from miurafab.profiles import MachineProfile, Material

BESIDE, FACTS = 106.0, ROOM - 118.0
"""The widths of the flat view on the first page, and of the facts beside it, mm."""
LEAST_VIEW = 98.0
"""The least height of the folded view there, mm."""


@dataclass(frozen=True)
class AssemblyGuide:
    """The guide as PDF, and as a page for a tablet."""

    pdf: bytes
    page: str


def assembly_guide(
    layout: DrawnLayout,
    pattern: CreasePattern,
    machine: MachineProfile,
    material: Material,
    title: str,
) -> AssemblyGuide:
    """Both forms of the guide. ``layout`` must have its toolpaths."""
    views = Views(layout, pattern)
    overview = _Overview(views, machine, material, title)
    sections = []
    if not is_loose(pattern):
        sections = [*KitSections(views).sections(), *GlueSections(views).sections()]
    if layout.jig is not None:
        sections.append(jig_section(layout.jig, pattern))
    pages: list[Page] = [overview.page]
    for sheet, toolpath in zip(layout.sheets, layout.toolpaths, strict=True):
        pages += SheetPages(views, sheet, toolpath, title).pages()
    pages += flow(sections, title)
    return AssemblyGuide(
        _pdf(pages, title),
        tablet_page(views, title, overview.facts(), overview.subtitle(), sections),
    )


def _pdf(pages: list[Page], title: str) -> bytes:
    stream = io.BytesIO()
    canvas = Canvas(stream, invariant=1, pagesize=(WIDTH * mm, HEIGHT * mm))
    canvas.setTitle(f"{title}: assembly")
    canvas.setCreator("miurafab")
    for number, page in enumerate(pages, start=1):
        page(canvas)
        foot(canvas, title, number, len(pages))
        canvas.showPage()
    canvas.save()
    return stream.getvalue()


@dataclass(frozen=True, eq=False)
class _Overview:
    views: Views
    machine: MachineProfile
    material: Material
    title: str

    def subtitle(self) -> str:
        """How many facets, patches and sheets there are."""
        layout, pattern = self.views.layout, self.views.pattern
        facets = len(pattern.faces_vertices)
        several = pattern.pieces_count > 1
        pieces = f"{count(pattern.pieces_count, 'piece', 'pieces')}, " if several else ""
        copies = f", {layout.copies} copies," if layout.copies > 1 else ""
        return (
            f"{count(facets, 'facet', 'facets')} in {pieces}"
            f"{count(len(self.views.patches), 'patch', 'patches')}{copies} on "
            f"{count(len(layout.sheets), 'sheet', 'sheets')}"
        )

    def page(self, canvas: Canvas) -> None:
        pattern = self.views.pattern
        top = heading(canvas, self.title, self.subtitle())
        if pattern.folded_coords is not None:
            caption(canvas, "Folded", MARGIN, top)
            tall = self._folded_height(top - BOTTOM)
            scale = self.views.folded_view(canvas, (MARGIN, top - 6 - tall, ROOM, tall))
            scale_bar(canvas, scale, MARGIN, top - 10 - tall)
            top -= tall + 20
        caption(canvas, "Flat, seen from the front", MARGIN, top)
        tall = min(top - BOTTOM - 22, BESIDE * self.views.aspect)
        scale = self.views.flat_view(canvas, (MARGIN, top - 8 - tall, BESIDE, tall))
        below = top - 8 - tall - 6
        scale_bar(canvas, scale, MARGIN, below)
        entries = [("mountain", MOUNTAIN, 0.3), ("valley", VALLEY, 0.3), ("cut", INK, 0.45)]
        legend(canvas, entries, MARGIN + BESIDE, below - 7)
        if self.views.seams:
            colour = HexColor(self.views.seams[0].colour)
            legend(canvas, [(SEAM_WORDS, colour, 0.6)], MARGIN + BESIDE, below - 12)
        x, y = WIDTH - MARGIN - FACTS, top - 3.2
        for name, lines in self.facts():
            text(canvas, x, y, name, 7.5, colour=QUIET)
            y -= 4.4
            for line in lines:
                y = paragraph(canvas, x, y, line, FACTS, 9)
            y -= 2.2

    def _folded_height(self, room: float) -> float:
        """The height of the folded view: what flat view and facts leave of ``room``, but no more
        than the view fills.
        """
        flat = BESIDE * self.views.aspect + 30
        facts = sum(
            6.6 + sum(paragraph_height(line, FACTS, 9) for line in lines)
            for _, lines in self.facts()
        )
        left = room - 20 - max(flat, facts)
        return max(LEAST_VIEW, min(left, ROOM * self.views.folded_aspect))

    def facts(self) -> list[tuple[str, list[str]]]:
        """The text of the overview beside the pictures."""
        pattern, material, totals = self.views.pattern, self.material, self.views.layout.totals

        def size(points: Floats) -> str:
            return " x ".join(f"{side:.0f}" for side in np.ptp(points, axis=0)) + " mm"

        found = [("Flat size", [size(pattern.vertices_coords)])]
        if pattern.folded_coords is not None:
            found.insert(0, ("Folded size", [size(pattern.folded_coords)]))
        found += [
            ("Machine", [f"{self.machine.title} ({self.machine.name})"]),
            (
                "Material",
                [f"{material.title} ({material.name}), {material.thickness_mm:g} mm thick"],
            ),
            ("Creases", [*_ways(material, self.machine), f"kerf {material.kerf_mm:g} mm"]),
            ("Settings", _settings(self.machine, material)),
        ]
        on_borders = totals.border_tabs
        on_seams = count(totals.tabs - on_borders, "tab", "tabs")
        glue = []
        if totals.tabs > on_borders:
            glue.append(f"{on_seams} on {totals.seam_mm / 1000:.2f} m of seams")
        if on_borders:
            glue.append(f"{count(on_borders, 'tab', 'tabs')} on open borders")
        if glue:
            held = {"glue": "Glue", "slots": "Slots", "double": "Glue, double tabs"}
            found.append((held[self.views.join], glue))
        borders = self.views.layout.borders
        if pattern.pieces_count > 1 or len(borders) != 1:
            lines = [f"B{border.number}: {border.size}" for border in borders]
            found.append(("Open borders", lines or ["none: the shell is closed"]))
        if totals.seconds is not None:
            minutes = max(round(totals.seconds / 60), 1)
            hours = (
                f"{minutes // 60} h {minutes % 60:02d} min" if minutes >= 60 else f"{minutes} min"
            )
            found.append(("Time on the machine", [f"about {hours}"]))
        return found


def _ways(material: Material, machine: MachineProfile) -> list[str]:
    """How the creases are made; kinds made alike share a line."""
    kinds: dict[str, list[str]] = {}
    material, pen = made_by(material, machine), machine.tool.kind == "pen"
    for kind, crease in material.creases.items():
        rule = material.perforation_of(kind)
        way = {
            "perforate": f"{rule.cut_mm:g} mm {'drawn' if pen else 'cut'}, {rule.gap_mm:g} mm left",
            "score": "drawn as lines" if pen else "scored",
            "cut": f"cut but for {rule.bridge_mm:g} mm at both ends",
            "none": "not made",
        }[crease.mode]
        kinds.setdefault(way, []).append("tab fold" if kind == "tab" else kind)
    found = [way if len(kinds) == 1 else f"{', '.join(own)}: {way}" for way, own in kinds.items()]
    if material.relief_hole_mm:
        found.append(f"holes of {material.relief_hole_mm:g} mm where they meet")
    return found


def _settings(machine: MachineProfile, material: Material) -> list[str]:
    """The power or force, the feed and the passes of each operation."""
    found = []
    for name, each in material.on(machine).operations.items():
        strength = "" if each.force is None else f"S{each.force}, "
        if each.power is not None:
            strength = f"{each.power:.3g} W ({machine.share(each.power):.0%}), "
        passes = f", {each.passes} passes" if each.passes > 1 else ""
        found.append(f"{name}: {strength}{each.feed_mm_min:.4g} mm/min{passes}")
    return found
