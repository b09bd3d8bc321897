"""The parts that thick panels are cut from board as, and the parts as a pattern to lay out.

Each part is a piece of the pattern, with one facet and no creases, so that sheets are laid out, cut
and checked as those of any pattern are. Part number n, counted from 1, is the patch Pn there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from miurafab.geometry.arrays import Floats
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.made_panels import MadePanels
from miurafab.origami.folding.plates import ThickPlates
from miurafab.origami.folding.thick_panels import ThickPanels
from miurafab.origami.piece import shelved


@dataclass(frozen=True, eq=False)
class PanelPart:
    """A part with an ``outline`` (k, 2), mm, counter-clockwise, seen from the top.

    ``facet`` is the facet that it belongs to, ``edge`` the crease whose axis it holds, None unless
    it is a bracket. A plate or ply is where it lies in the flat pattern, a bracket at the origin.
    """

    name: str
    facet: int
    edge: int | None
    outline: Floats


def panel_parts(panels: MadePanels) -> tuple[PanelPart, ...]:
    """The plates by their facets and then the brackets, or the top plies and then the bottom ones.

    A bracket lies on its side. Its length is along the crease, and its height is from the far face
    of its plate to the axis.
    """
    if isinstance(panels, ThickPanels):
        real = panels.pattern.faces_vertices >= 0
        return tuple(
            PanelPart(f"{side}{facet}", facet, None, ply[facet, real[facet]])
            for side, ply in zip("tb", panels.plies, strict=True)
            for facet in range(len(real))
        )
    assert isinstance(panels, ThickPlates)
    plates, brackets = [], []
    for patch in panels.patches:
        for facet, outline in zip(patch.facets.tolist(), patch.notched, strict=True):
            plates.append(PanelPart(f"f{facet}", facet, None, outline))
        for each in patch.brackets:
            wide, high = each.length_mm, each.high - each.low + panels.thickness_mm
            edge, facet = int(patch.edges[each.edge]), int(patch.facets[each.facet])
            corners = np.array([[0.0, 0.0], [wide, 0.0], [wide, high], [0.0, high]])
            brackets.append(PanelPart(f"e{edge} f{facet}", facet, edge, corners))
    return (*sorted(plates, key=lambda part: part.facet), *brackets)


def parts_pattern(parts: tuple[PanelPart, ...], gap_mm: float) -> CreasePattern:
    """``parts`` as the pieces of a pattern, in their order, laid ``gap_mm`` apart."""
    boxes = np.array([np.ptp(part.outline, axis=0) for part in parts])
    counts = np.array([len(part.outline) for part in parts])
    first = np.cumsum(counts) - counts
    faces = np.full((len(parts), int(counts.max())), -1, dtype=np.int64)
    points, edges = [], []
    for number, (part, at) in enumerate(zip(parts, shelved(boxes, gap_mm), strict=True)):
        own = first[number] + np.arange(counts[number])
        faces[number, : counts[number]] = own
        points.append(part.outline - part.outline.min(axis=0) + at)
        edges.append(np.column_stack([own, np.roll(own, -1)]))
    borders = int(counts.sum())
    return CreasePattern(
        vertices_coords=np.concatenate(points),
        edges_vertices=np.concatenate(edges),
        edges_assignment=np.full(borders, "B"),
        edges_fold_angle=np.zeros(borders),
        faces_vertices=faces,
        pieces=np.arange(len(parts)),
    )
