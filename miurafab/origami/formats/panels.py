"""Files of thick panels: drawings of what is cut, and solids."""

from __future__ import annotations

import numpy as np

from miurafab.files import AnyPath, new_file, write_bytes, write_text
from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.polygons import facet_areas, facet_means
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.kinematics import fold_angles_at, place, states_between
from miurafab.origami.folding.plates import ThickPlates
from miurafab.origami.folding.thick_panels import ThickPanels
from miurafab.origami.formats.mesh import glb_bytes, stl_bytes
from miurafab.origami.formats.panel_drawing import (
    PanelDrawing,
    PanelLabel,
    PanelLine,
    panels_dxf,
    panels_svg,
)
from miurafab.origami.piece import shelved

PANEL_ENDINGS = (".dxf", ".svg", ".stl", ".glb")
"""What panels can be written as."""

_FRAMES = 24  # of the motion in a .glb file


def write_panels(panels: ThickPanels | ThickPlates, path: AnyPath, title: str) -> None:
    """Write panels as outlines to cut (DXF, SVG), or as solids: flat in an STL file, moving in a
    GLB file.

    Raises :class:`~miurafab.errors.InputError` for another ending, for a folder that does not
    exist, and for facets that are too small.
    """
    file = new_file(path, "The drawing of the panels", PANEL_ENDINGS)
    ending = file.suffix.lower()
    if ending in (".stl", ".glb"):
        frames, triangles = _solids(panels, 1 if ending == ".stl" else _FRAMES)
        if ending == ".stl":
            write_bytes(file, stl_bytes(frames[0], triangles))
        else:
            write_bytes(file, glb_bytes(frames[0], triangles, frames))
        return
    drawing = _plate_drawing(panels) if isinstance(panels, ThickPlates) else _ply_drawing(panels)
    if ending == ".dxf":
        write_text(file, panels_dxf(drawing))
    else:
        write_text(file, panels_svg(drawing, title or panels.pattern.name))


def _solids(panels: ThickPanels | ThickPlates, count: int) -> tuple[Floats, Ints]:
    """The solids in ``count`` frames (T, n, 3) from flat on, and their triangles (m, 3)."""
    if isinstance(panels, ThickPanels):
        points, triangles, facet = panels.solids()
        states = states_between(panels.pattern, max(count - 1, 1), 1.0)[:count]
        placement = place(panels.pattern, fold_angles_at(panels.pattern, states))
        moved = np.einsum("tnij,nj->tni", placement.turn[:, facet], points)
        return moved + placement.shift[:, facet], triangles
    frames, made, first = [], [], 0
    for patch in panels.patches:
        solids = patch.solids()
        last = patch.clear_state or 1.0
        states = states_between(patch.pattern, max(count - 1, 1), last)[:count]
        frames.append(patch.placed(solids, states))
        made.append(solids.triangles + first)
        first += len(solids.corners)
    return np.concatenate(frames, axis=1), np.concatenate(made)


def _ply_drawing(panels: ThickPanels) -> PanelDrawing:
    """The plies of tapered panels beside each other, both seen from the top."""
    panels.solids()  # refuses facets that have no outline
    pattern = panels.pattern
    size = np.ptp(pattern.vertices_coords, axis=0)
    lines, labels = [], []
    for number, (name, ply) in enumerate(zip(("TopPly", "BottomPly"), panels.plies, strict=True)):
        move = np.array([number * 1.1 * size[0], 0.0])
        lines += _outlines(pattern, ply + move, name)
        lines += _hinges(pattern, np.flatnonzero(panels.closing_side != ""), move)
        labels += _labels(pattern, [str(facet) for facet in range(len(ply))], move)
    return PanelDrawing(tuple(lines), tuple(labels))


def _plate_drawing(plates: ThickPlates) -> PanelDrawing:
    """Plates with the feet of their brackets, and below them the brackets, lying on their sides."""
    lines: list[PanelLine] = []
    labels: list[PanelLabel] = []
    parts: list[tuple[str, float, float]] = []
    for patch in plates.patches:
        pattern = patch.pattern
        lines += _outlines(pattern, patch.outlines, "Plate")
        lines += _hinges(pattern, patch.edges_inner, np.zeros(2))
        names = [
            f"f{facet} {z:+.2f}" for facet, z in zip(patch.facets, patch.bottom_mm, strict=True)
        ]
        labels += _labels(pattern, names, np.zeros(2))
        for each in patch.brackets:
            lines.append(PanelLine("BracketFoot", "mark", each.foot))
            wide = float(np.linalg.norm(each.foot[1] - each.foot[0]))
            name = f"e{patch.edges[each.edge]} f{patch.facets[each.facet]}"
            parts.append((name, wide, each.high - each.low))
    if parts:
        sizes = np.array([part[1:] for part in parts])
        gap = plates.thickness_mm
        places = shelved(sizes, gap)
        start = plates.pattern.vertices_coords.min(axis=0)
        start[1] -= 2 * gap + float((places + sizes)[:, 1].max())
        for (name, wide, high), (x, y) in zip(parts, (places + start).tolist(), strict=True):
            corners = [[x, y], [x + wide, y], [x + wide, y + high], [x, y + high]]
            lines.append(PanelLine("Bracket", "cut", np.array(corners)))
            height = min(high, wide / (0.7 * len(name)))
            labels.append(PanelLabel(name, x + wide / 2, y + high / 2, 0.8 * height))
    return PanelDrawing(tuple(lines), tuple(labels))


def _outlines(pattern: CreasePattern, corners: Floats, layer: str) -> list[PanelLine]:
    real = pattern.faces_vertices >= 0
    return [PanelLine(layer, "cut", points[own]) for points, own in zip(corners, real, strict=True)]


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
