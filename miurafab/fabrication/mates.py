"""Where each tab lies on its sheet, and where the edge that it is joined to lies on its own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from miurafab.fabrication.sheets import Layout
from miurafab.geometry.arrays import Floats
from miurafab.origami.crease_pattern import CreasePattern


@dataclass(frozen=True, eq=False)
class SeamTab:
    """The tab ``number`` of the patch ``patch``, and its mate.

    ``polygon_mm`` (n, 2) float64 is its outline on the sheet ``sheet``; ``mate_mm`` (2, 2) float64
    are the ends of its mate's edge on the sheet ``mate_sheet``. Patches and sheets are given by
    their names. On an open border there is no mate: its names are empty, and ``mate_mm`` is None.
    """

    number: int
    label: str
    patch: str
    sheet: str
    polygon_mm: Floats
    mate_patch: str = ""
    mate_sheet: str = ""
    mate_mm: Floats | None = None


def seam_tabs(layout: Layout, pattern: CreasePattern) -> Iterator[SeamTab]:
    """The tabs of ``layout``, patch by patch; ``pattern`` is the one that was laid out.

    A tab stands on the pattern edge ``edge`` of its patch, and is joined to ``mate_edge`` of the
    other patch. A point of the pattern lies on a sheet as :mod:`~miurafab.fabrication.sheets` says.
    """
    placed = {
        placement.patch: (sheet.name, placement)
        for sheet in layout.sheets
        for placement in sheet.placements
    }
    patches = {patch.id: patch for patch in layout.patches}
    for patch in layout.patches:
        sheet, placement = placed[patch.id]
        for tab in patch.tabs:
            polygon = placement.from_patch(tab.polygon_mm)
            own = SeamTab(tab.number, tab.label, patch.label, sheet, polygon)
            if tab.mate_patch is None or tab.mate_edge is None:
                yield own
                continue
            mate = patches[tab.mate_patch]
            mate_sheet, there = placed[mate.id]
            ends = pattern.vertices_coords[pattern.edges_vertices[tab.mate_edge]]
            on_sheet = there.from_patch(mate.from_pattern(ends))
            yield SeamTab(
                own.number, own.label, own.patch, sheet, polygon, mate.label, mate_sheet, on_sheet
            )
