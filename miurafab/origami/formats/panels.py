"""Files of thick panels: drawings of what is cut, parts for sheets, and solids."""

from __future__ import annotations

import numpy as np

from miurafab.files import AnyPath, new_file, write_bytes, write_text
from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.polygons import facet_areas, facet_means
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.kinematics import fold_angles_at, place, states_between
from miurafab.origami.folding.made_panels import MadePanels
from miurafab.origami.folding.plates import ThickPlates
from miurafab.origami.folding.thick_panels import ThickPanels
from miurafab.origami.formats.fold import fold_text
from miurafab.origami.formats.mesh import glb_bytes, stl_bytes
from miurafab.origami.formats.panel_drawing import (
    PanelDrawing,
    PanelLabel,
    PanelLine,
    panels_dxf,
    panels_svg,
)
from miurafab.origami.formats.panel_parts import panel_parts, parts_pattern
from miurafab.origami.piece import shelved

PANEL_ENDINGS = (".dxf", ".svg", ".fold", ".stl", ".glb")
"""What panels can be written as."""

_FRAMES = 24  # of the motion in a .glb file


def write_panels(panels: MadePanels, path: AnyPath, title: str) -> None:
    """Write panels as outlines to cut (DXF, SVG), as a pattern whose pieces are the parts (FOLD),
    or as solids: flat in an STL file, moving in a GLB file.

    Raises :class:`~miurafab.errors.InputError` for another ending, for a folder that does not
    exist, and for facets that are too small.
    """
    file = new_file(path, "The drawing of the panels", PANEL_ENDINGS)
    panels.refuse_too_small()
    ending = file.suffix.lower()
    if ending in (".stl", ".glb"):
        frames, triangles = _solids(panels, 1 if ending == ".stl" else _FRAMES)
        if ending == ".stl":
            write_bytes(file, stl_bytes(frames[0], triangles))
        else:
            write_bytes(file, glb_bytes(frames[0], triangles, frames))
        return
    name = title or panels.pattern.name
    if ending == ".fold":
        write_text(file, fold_text(parts_pattern(panel_parts(panels), panels.thickness_mm), name))
        return
    drawing = _plate_drawing(panels) if isinstance(panels, ThickPlates) else _ply_drawing(panels)
    write_text(file, panels_dxf(drawing) if ending == ".dxf" else panels_svg(drawing, name))


def _solids(panels: MadePanels, count: int) -> tuple[Floats, Ints]:
    """The solids in ``count`` frames (T, n, 3) from flat on, and their triangles (m, 3)."""
    if isinstance(panels, ThickPanels):
        points, triangles, facet = panels.solids()
        states = states_between(panels.pattern, max(count - 1, 1), 1.0)[:count]
        placement = place(panels.pattern, fold_angles_at(panels.pattern, states))
        moved = np.einsum("tnij,nj->tni", placement.turn[:, facet], points)
        return moved + placement.shift[:, facet], triangles
    assert isinstance(panels, ThickPlates)
    frames, made, first = [], [], 0
    for patch in panels.patches:
        solids = patch.solids()
        last = patch.clear_state or 1.0
        states = states_between(patch.pattern, max(count - 1, 1), last)[:count]
        frames.append(patch.placed(solids, states))
        made.append(solids.triangles + first)
        first += len(solids.corners)
    return np.concatenate(frames, axis=1), np.concatenate(made)


def _ply_drawing(panels: MadePanels) -> PanelDrawing:
    """The plies of tapered panels beside each other, both seen from the top."""
    assert isinstance(panels, ThickPanels)
    pattern = panels.pattern
    size = np.ptp(pattern.vertices_coords, axis=0)
    lines, labels = [], []
    parts = panel_parts(panels)
    for number, name in enumerate(("TopPly", "BottomPly")):
        own = parts[number * len(pattern.faces_vertices) :][: len(pattern.faces_vertices)]
        move = np.array([number * 1.1 * size[0], 0.0])
        lines += [PanelLine(name, "cut", part.outline + move) for part in own]
        lines += _hinges(pattern, np.flatnonzero(panels.closing_side != ""), move)
        labels += _labels(pattern, [part.name for part in own], move)
    return PanelDrawing(tuple(lines), tuple(labels))


def _plate_drawing(plates: ThickPlates) -> PanelDrawing:
    """Notched plates with their hinges and tapes, and below them the brackets, lying flat."""
    lines: list[PanelLine] = []
    labels: list[PanelLabel] = []
    parts = panel_parts(plates)
    lines += [PanelLine("Plate", "cut", part.outline) for part in parts if part.edge is None]
    for patch in plates.patches:
        pattern = patch.pattern
        lines += _hinges(pattern, patch.edges_inner, np.zeros(2))
        lines += [PanelLine("HingeTape", "mark", outline) for _, outline in patch.tapes]
        names = [
            f"f{facet} {z:+.2f}" for facet, z in zip(patch.facets, patch.bottom_mm, strict=True)
        ]
        labels += _labels(pattern, names, np.zeros(2))
        for each in patch.brackets:
            rises = each.low >= float(patch.bottom_mm[each.facet])
            name = f"e{patch.edges[each.edge]} {'up' if rises else 'down'}"
            height = min(0.5 * plates.thickness_mm, each.length_mm / (0.7 * len(name)))
            inward = (each.foot[3] - each.foot[0]) / plates.thickness_mm
            # beside the notch: the half of the text that points to it stays clear of it
            reach = height * (0.35 * len(name) * abs(inward[0]) + abs(inward[1]))
            x, y = (each.foot.mean(axis=0) + (plates.thickness_mm / 2 + reach) * inward).tolist()
            labels.append(PanelLabel(name, x, y, height))
    brackets = [part for part in parts if part.edge is not None]
    if brackets:
        sizes = np.array([np.ptp(part.outline, axis=0) for part in brackets])
        gap = plates.thickness_mm
        places = shelved(sizes, gap)
        start = plates.pattern.vertices_coords.min(axis=0)
        start[1] -= 2 * gap + float((places + sizes)[:, 1].max())
        for part, size, place_at in zip(brackets, sizes, places + start, strict=True):
            lines.append(PanelLine("Bracket", "cut", part.outline + place_at))
            x, y = (place_at + size / 2).tolist()
            height = min(float(size[1]), float(size[0]) / (0.7 * len(part.name)))
            labels.append(PanelLabel(part.name, x, y, 0.8 * height))
    return PanelDrawing(tuple(lines), tuple(labels))


def _hinges(pattern: CreasePattern, edges: Ints, move: Floats) -> list[PanelLine]:
    ends = pattern.vertices_coords[pattern.edges_vertices[edges]] + move
    return [PanelLine("Hinge", "hinge", points, closed=False) for points in ends]


def _labels(pattern: CreasePattern, names: list[str], move: Floats) -> list[PanelLabel]:
    flat = np.pad(pattern.vertices_coords, ((0, 0), (0, 1)))
    heights = 0.12 * np.sqrt(facet_areas(flat, pattern.faces_vertices))
    middles = facet_means(pattern.vertices_coords, pattern.faces_vertices) + move
    return [
        PanelLabel(name, x, y, height)
        for name, (x, y), height in zip(names, middles.tolist(), heights.tolist(), strict=True)
    ]
