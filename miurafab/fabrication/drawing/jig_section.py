"""The section on the jig: where its ribs stand under the shell, and how it is put together."""

from __future__ import annotations

from functools import partial

import numpy as np
from reportlab.lib.units import mm

from miurafab.fabrication.drawing.page import INK, PALE, RULE, Box, fitted, polygon
from miurafab.fabrication.drawing.sections import Figure, Figures, Numbered, Section
from miurafab.fabrication.drawing.svg_canvas import Pen
from miurafab.fabrication.drawing.views import named
from miurafab.fabrication.kit.jig import Jig, Rib
from miurafab.origami.crease_pattern import CreasePattern

_STEPS = (
    "Cut jig.svg from board of {thickness:g} mm. Its lines are red, its names blue.",
    "Stand the U ribs up with their slots on top. Push the V ribs down on them with their slots "
    "below, in the order of the picture from above.",
    "Lay the folded shell on it, front up. Its lowest pleats rest on the ribs, and no rib reaches "
    "into it. So it keeps its shape while the glue sets.",
)


def jig_section(jig: Jig, pattern: CreasePattern) -> Section:
    """How to use the ``jig`` of ``pattern``."""
    above = partial(_from_above, jig=jig, pattern=pattern)
    wide, deep = np.ptp(jig.shell[:, :2], axis=0).tolist()
    ribs = [
        Figure(f"Rib {rib.name}", partial(_rib, rib=rib), float(_aspect(rib))) for rib in jig.ribs
    ]
    figures = (Figure("From above", above, deep / max(wide, 1e-9)), *ribs)
    steps = tuple(step.format(thickness=jig.thickness_mm) for step in _STEPS)
    return Section(
        "jig",
        f"Ribs of {jig.thickness_mm:g} mm board that carry the shell",
        (Numbered(steps), Figures(4, figures, 40.0)),
    )


def _aspect(rib: Rib) -> float:
    wide, tall = np.ptp(rib.outline, axis=0).tolist()
    return float(tall / wide)


def _rib(canvas: Pen, box: Box, rib: Rib) -> None:
    placed, _ = fitted(rib.outline, box)
    canvas.setFillColor(PALE)
    canvas.setStrokeColor(INK)
    canvas.setLineWidth(0.2 * mm)
    polygon(canvas, placed, stroke=True)


def _from_above(canvas: Pen, box: Box, jig: Jig, pattern: CreasePattern) -> None:
    """The facets of the shell in the plane of the table, and the ribs under them."""
    x, y, width, height = box
    room = 4.0
    placed, scale = fitted(
        jig.shell[:, :2], (x + room, y + room, width - 2 * room, height - 2 * room)
    )
    shift = placed[0] - scale * jig.shell[0, :2]
    canvas.setFillColor(PALE)
    canvas.setStrokeColor(RULE)
    canvas.setLineWidth(0.08 * mm)
    for corners in pattern.faces_vertices:
        polygon(canvas, placed[corners[corners >= 0]], stroke=True)
    for rib in jig.ribs:
        canvas.setStrokeColor(INK)
        canvas.setLineWidth(0.5 * mm)
        along = np.array([rib.outline[:, 0].min(), rib.outline[:, 0].max()])
        across = np.full(2, rib.place_mm)
        ends = np.stack([along, across] if rib.name[0] == "U" else [across, along], axis=1)
        (x0, y0), (x1, y1) = (ends * scale + shift).tolist()
        canvas.line(x0 * mm, y0 * mm, x1 * mm, y1 * mm)
        named(canvas, rib.name, x1, y1, 7.0)
