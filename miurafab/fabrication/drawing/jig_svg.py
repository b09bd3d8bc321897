"""``jig.svg``: the ribs of the jig one below the other, in mm, to be cut from board."""

from __future__ import annotations

import html

import numpy as np

from miurafab.errors import shown
from miurafab.fabrication.kit.jig import Jig
from miurafab.fabrication.lettering import text_strokes, text_width
from miurafab.geometry.arrays import Floats

_GAP_MM = 5.0
_NAME_MM = 6.0
_CUT, _ENGRAVE = "#ff0000", "#0000ff"
"""Red is cut and blue engraved, as most laser software takes it."""


def jig_svg(jig: Jig, title: str) -> str:
    """The drawing of a ``jig``; y points down."""
    cuts, names = [], []
    top, widest = _GAP_MM, 0.0
    for rib in jig.ribs:
        low, size = rib.outline.min(axis=0), np.ptp(rib.outline, axis=0)
        top += float(size[1])
        shift = np.array([_GAP_MM - low[0], top])
        cuts.append(_path(rib.outline * [1.0, -1.0] + shift, closed=True))
        middle = np.array([_GAP_MM + 3.0 + _NAME_MM * text_width(rib.name) / 2, top - 7.0])
        names += [
            _path(stroke * [_NAME_MM, -_NAME_MM] + middle) for stroke in text_strokes(rib.name)
        ]
        top += _GAP_MM
        widest = max(widest, float(size[0]))
    width, height = widest + 2 * _GAP_MM, top
    says = html.escape(f"{shown(title)}: jig for board of {jig.thickness_mm:g} mm")
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.2f}mm" height="{height:.2f}mm" '
        f'viewBox="0 0 {width:.2f} {height:.2f}"><title>{says}</title>'
        f'<g id="engrave" fill="none" stroke="{_ENGRAVE}" stroke-width="0.1">{"".join(names)}</g>'
        f'<g id="cut" fill="none" stroke="{_CUT}" stroke-width="0.1">{"".join(cuts)}</g></svg>\n'
    )


def _path(points: Floats, *, closed: bool = False) -> str:
    data = "L".join(f"{x:.3f} {y:.3f}" for x, y in points.tolist())
    return f'<path d="M{data}{"Z" if closed else ""}"/>'
