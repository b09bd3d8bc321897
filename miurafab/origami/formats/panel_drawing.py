"""Drawings of panels to cut, as DXF and SVG: closed outlines, hinge lines and labels by layers.

DXF is R12 (AC1009) in millimetres with POLYLINE, LINE and TEXT. SVG is in millimetres, with one
group for each layer and y downwards.
"""

from __future__ import annotations

from dataclasses import dataclass
from html import escape

import numpy as np

from miurafab.geometry.arrays import Floats

COLOURS = {"cut": (1, "#f00"), "hinge": (5, "#00f"), "mark": (3, "#0a0"), "label": (8, "#666")}
"""What the layers mean: a DXF colour and an SVG stroke each."""


@dataclass(frozen=True, eq=False)
class PanelLine:
    """A line of ``layer`` through ``points`` (n, 2), mm, which returns to its start if closed."""

    layer: str
    kind: str
    points: Floats
    closed: bool = True


@dataclass(frozen=True)
class PanelLabel:
    """A ``text`` of ``height`` mm with its middle at (x, y) mm."""

    text: str
    x: float
    y: float
    height: float


@dataclass(frozen=True, eq=False)
class PanelDrawing:
    """What is drawn of panels; ``kind`` of a line is a key of :data:`COLOURS`."""

    lines: tuple[PanelLine, ...]
    labels: tuple[PanelLabel, ...]

    @property
    def layers(self) -> dict[str, str]:
        """The kind of each layer, in the order in which they come."""
        found = {line.layer: line.kind for line in self.lines}
        return found | ({"Label": "label"} if self.labels else {})


def panels_dxf(drawing: PanelDrawing) -> str:
    """The text of a DXF file of ``drawing``."""
    layers = drawing.layers
    parts = ["0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1009\n0\nENDSEC\n"]
    parts.append(f"0\nSECTION\n2\nTABLES\n0\nTABLE\n2\nLAYER\n70\n{len(layers)}\n")
    for layer, kind in layers.items():
        parts.append(f"0\nLAYER\n2\n{layer}\n70\n0\n62\n{COLOURS[kind][0]}\n6\nCONTINUOUS\n")
    parts.append("0\nENDTAB\n0\nENDSEC\n0\nSECTION\n2\nENTITIES\n")
    for line in drawing.lines:
        places = [f"10\n{x:.6f}\n20\n{y:.6f}\n30\n0.0\n" for x, y in line.points.tolist()]
        parts.append(f"0\nPOLYLINE\n8\n{line.layer}\n66\n1\n70\n{int(line.closed)}\n")
        parts += [f"0\nVERTEX\n8\n{line.layer}\n{place}" for place in places]
        parts.append(f"0\nSEQEND\n8\n{line.layer}\n")
    for label in drawing.labels:
        where = f"10\n{label.x:.6f}\n20\n{label.y:.6f}\n30\n0.0\n"
        middle = f"11\n{label.x:.6f}\n21\n{label.y:.6f}\n31\n0.0\n"
        parts.append(
            f"0\nTEXT\n8\nLabel\n{where}40\n{label.height:.6f}\n1\n{label.text}\n72\n1\n{middle}73\n2\n"
        )
    parts.append("0\nENDSEC\n0\nEOF\n")
    return "".join(parts)


def panels_svg(drawing: PanelDrawing, title: str = "") -> str:
    """The text of an SVG file of ``drawing``."""
    points = np.concatenate([line.points for line in drawing.lines])
    margin = 5.0
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    width, height = (high - low).tolist()
    parts = [
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.3f}mm" height="{height:.3f}mm" '
        f'viewBox="0 0 {width:.3f} {height:.3f}">\n<title>{escape(title, quote=False)}</title>\n'
    ]
    for layer, kind in drawing.layers.items():
        colour = COLOURS[kind][1]
        parts.append(f'<g id="{layer}" fill="none" stroke="{colour}" stroke-width="0.1">\n')
        for line in drawing.lines:
            if line.layer == layer:
                places = (line.points - [low[0], high[1]]) * [1.0, -1.0]
                path = "L".join(f"{x:.3f} {y:.3f}" for x, y in places.tolist())
                parts.append(f'<path d="M{path}{"Z" if line.closed else ""}"/>\n')
        if layer == "Label":
            for label in drawing.labels:
                parts.append(
                    f'<text x="{label.x - low[0]:.3f}" y="{high[1] - label.y:.3f}" '
                    f'font-size="{label.height:.3f}" font-family="sans-serif" fill="{colour}" '
                    'stroke="none" text-anchor="middle" dominant-baseline="central">'
                    f"{escape(label.text, quote=False)}</text>\n"
                )
        parts.append("</g>\n")
    parts.append("</svg>\n")
    return "".join(parts)
