"""Drawings as SVG: sheets for the machine, and a picture of a layout for people.

A sheet is drawn true to scale: width, height and viewBox in mm, so that importers do not guess a
resolution. The y axis of SVG points down and that of the sheet up, so y is mirrored. The layers are
those of :mod:`~miurafab.fabrication.drawing.layers`, as far as there is anything on them.

Only this module imports svgwrite. Its validation is off: it takes longer than the drawing.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from types import MappingProxyType

import numpy as np
import svgwrite

from miurafab.fabrication.drawing.colours import hex_of, patch_colour
from miurafab.fabrication.drawing.layers import LAYERS, NO_LETTERS, Letters, layers_of
from miurafab.fabrication.seams import with_seams
from miurafab.fabrication.sheets import Layout
from miurafab.fabrication.toolpath import Toolpath
from miurafab.geometry.arrays import Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.seam_lines import SEAM_WORDS, SeamLine, seam_lines
from miurafab.profiles import OPERATIONS

_INKSCAPE = "http://www.inkscape.org/namespaces/inkscape"
_CREASES = {
    "M": ("mountain", "#c8372d"),
    "V": ("valley", "#2a5fb0"),
    "F": ("flat", "#b5b5b5"),
    "U": ("unassigned", "#8a6d3b"),
    "J": ("join", "#b5b5b5"),
    "C": ("cut", "#222222"),
    "B": ("border", "#222222"),
}
_WEIGHTS = {letter: 1.8 if letter in "BC" else 1.0 for letter in _CREASES}
"""The weights of lines over that of a crease."""
_DASHES = {"V": (5.0, 3.0), "U": (1.5, 3.0)}
"""Dashes and gaps of folds over the weight of their line: valleys are dashed, mountains solid."""


def sheet_svg(toolpath: Toolpath, letters: Letters = NO_LETTERS) -> str:
    """The strokes of one sheet in their order on each layer, true to scale.

    The strokes of a crease are subpaths of one path, and so are the texts of a patch. ``letters``
    (E,) is the assignment of each pattern edge.
    """
    width, height = toolpath.width_mm, toolpath.height_mm
    drawing = _drawing(width, height, (f"{_short(width)}mm", f"{_short(height)}mm"))
    drawing.attribs["xmlns:inkscape"] = _INKSCAPE
    drawing.set_desc(title=toolpath.sheet)
    paths = _path_data(toolpath, height)
    same = (np.diff(toolpath.edge) == 0) & (np.diff(toolpath.patch) == 0)
    same &= toolpath.operation[1:] != OPERATIONS.index("cut")
    together = np.concatenate([[0], np.cumsum(~same)])
    layer_of = layers_of(toolpath, letters)
    for number in np.unique(layer_of).tolist():
        kind = LAYERS[number]
        style = {"fill": "none", "stroke": kind.colour, "stroke_width": kind.line_mm}
        layer = drawing.g(id=kind.name, **style)
        layer.attribs["inkscape:groupmode"] = "layer"
        layer.attribs["inkscape:label"] = kind.name
        strokes = np.flatnonzero(layer_of == number)
        for run in np.split(strokes, np.flatnonzero(np.diff(together[strokes])) + 1):
            layer.add(drawing.path(d="".join(paths[s] for s in run.tolist())))
        drawing.add(layer)
    return _text(drawing)


def layout_svg(pattern: CreasePattern, layout: Layout) -> str:
    """A picture of the flat pattern with the patches of ``layout`` tinted and named.

    Mountains are red and solid, valleys blue and dashed, the border black. Each seam line has a
    colour and a number of its own on both of its sides. A legend says so.
    """
    lines = seam_lines(with_seams(pattern))
    points = pattern.vertices_coords * np.array([1.0, -1.0])
    low, high = points.min(axis=0), points.max(axis=0)
    span = float(np.max(high - low))
    margin = 0.02 * span
    line = span / 600
    points = points - low + margin
    width, height = high - low + 2 * margin
    size = span / 45
    entries = _legend_entries(pattern, lines)
    height += 2 * size * len(entries) + size
    drawing = _drawing(width, height, (f"{_short(width)}mm", f"{_short(height)}mm"))
    drawing.add(drawing.rect((0, 0), (_short(width), _short(height)), fill="#ffffff"))
    _add_facets(drawing, pattern, points, layout)
    for letter, (name, colour) in _CREASES.items():
        edges = np.flatnonzero(pattern.edges_assignment == letter)
        edges = np.setdiff1d(edges, [edge for seam in lines for edge in seam.edges.ravel()])
        if len(edges):
            weight = line * _WEIGHTS[letter]
            style = _dashes(letter, weight)
            _add_lines(drawing, pattern, points, edges, name, colour, weight, style)
    for seam in lines:
        name, weight = f"seam-{seam.number}", line * 3.0
        _add_lines(drawing, pattern, points, seam.edges.ravel(), name, seam.colour, weight)
    _add_names(drawing, pattern, points, layout)
    for seam in lines:
        for x, y in (seam.places * [1.0, -1.0] - low + margin).tolist():
            _add_number(drawing, seam, x, y, size)
    for place, (words, letter, colour) in enumerate(entries):
        y = height - 2 * size * (len(entries) - place)
        ends = (_short(margin), _short(y)), (_short(margin + 3 * size), _short(y))
        style = {"stroke": colour, "stroke_width": _short(3 * line), **_dashes(letter, 2 * line)}
        drawing.add(drawing.line(*ends, **style))
        drawing.add(
            drawing.text(
                words,
                insert=(_short(margin + 4 * size), _short(y + 0.35 * size)),
                font_family="sans-serif",
                font_size=_short(size),
                fill="#222222",
            )
        )
    return _text(drawing)


def _legend_entries(
    pattern: CreasePattern, lines: tuple[SeamLine, ...]
) -> list[tuple[str, str, str]]:
    """The words, the letter and the colour of each kind of line that is drawn."""
    seams = {edge for seam in lines for edge in seam.edges.ravel().tolist()}
    letters = {
        letter for edge, letter in enumerate(pattern.edges_assignment.tolist()) if edge not in seams
    }
    entries = [
        (name, letter, colour) for letter, (name, colour) in _CREASES.items() if letter in letters
    ]
    if lines:
        entries.append((SEAM_WORDS, "", lines[0].colour))
    return entries


def _dashes(letter: str, weight: float) -> dict[str, str]:
    """The style of the folds with a ``letter``."""
    if letter not in _DASHES:
        return {}
    dashes = " ".join(_short(weight * part) for part in _DASHES[letter])
    return {"stroke_linecap": "butt", "stroke_dasharray": dashes}


def _add_lines(
    drawing: svgwrite.Drawing,
    pattern: CreasePattern,
    points: Floats,
    edges: Ints,
    name: str,
    colour: str,
    weight: float,
    style: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """Some ``edges`` (n,) of the pattern as one path."""
    data = [
        f"M{_short(x0)} {_short(y0)}L{_short(x1)} {_short(y1)}"
        for (x0, y0), (x1, y1) in points[pattern.edges_vertices[edges]].tolist()
    ]
    style = {"fill": "none", "stroke": colour, "stroke_linecap": "round", **style}
    drawing.add(drawing.path(d="".join(data), id=name, stroke_width=_short(weight), **style))


def _add_number(drawing: svgwrite.Drawing, seam: SeamLine, x: float, y: float, size: float) -> None:
    """The number of a seam line in a disk of its colour."""
    wide = 0.75 if seam.number < 10 else 0.95
    at = (_short(x), _short(y))
    drawing.add(
        drawing.circle(
            at,
            _short(wide * size),
            fill=seam.colour,
            stroke="#ffffff",
            stroke_width=_short(0.15 * size),
        )
    )
    drawing.add(
        drawing.text(
            str(seam.number),
            insert=(_short(x), _short(y + 0.35 * size)),
            font_family="sans-serif",
            font_size=_short(size),
            font_weight="bold",
            text_anchor="middle",
            fill="#ffffff",
        )
    )


def _add_facets(
    drawing: svgwrite.Drawing, pattern: CreasePattern, points: Floats, layout: Layout
) -> None:
    for number, patch in enumerate(layout.model.patches):
        tint = hex_of(patch_colour(number, 0.6))
        data = []
        for corners in pattern.faces_vertices[patch.faces].tolist():
            ring = [points[v] for v in corners if v >= 0]
            data.append("M" + "L".join(f"{_short(x)} {_short(y)}" for x, y in ring) + "Z")
        hair = {"stroke": tint, "stroke_width": _short(np.ptp(points) / 3000)}
        drawing.add(drawing.path(d="".join(data), fill=tint, **hair))


def _add_names(
    drawing: svgwrite.Drawing, pattern: CreasePattern, points: Floats, layout: Layout
) -> None:
    size = np.ptp(points, axis=0).max() / 30
    group = drawing.g(
        font_family="sans-serif", font_size=_short(size), font_weight="bold", text_anchor="middle",
    )  # fmt: skip
    # A white rim under the letters keeps creases away; many programs do not know
    # paint-order, so it is a text of its own.
    rim = {"stroke": "#ffffff", "stroke_width": _short(0.16 * size), "stroke_linejoin": "round"}
    for patch in layout.model.patches:
        corners = pattern.faces_vertices[patch.faces]
        x, y = points[corners[corners >= 0]].mean(axis=0)
        name, at = patch.label.partition("-")[0], (_short(x), _short(y + 0.35 * size))
        group.add(drawing.text(name, insert=at, fill="#ffffff", **rim))
        group.add(drawing.text(name, insert=at, fill="#222222"))
    drawing.add(group)


def _drawing(width: float, height: float, size: tuple[str, str]) -> svgwrite.Drawing:
    return svgwrite.Drawing(
        size=size, viewBox=f"0 0 {_short(width)} {_short(height)}", debug=False, profile="full"
    )


def _path_data(toolpath: Toolpath, height: float) -> list[str]:
    """The path data of every stroke; a closed one ends in Z."""
    words = [f"{_short(x)} {_short(height - y)}" for x, y in toolpath.points.tolist()]
    found = []
    offsets = toolpath.offsets.tolist()
    for begin, end in pairwise(offsets):
        closed = end - begin > 3 and words[begin] == words[end - 1]
        body = "L".join(words[begin : end - 1] if closed else words[begin:end])
        found.append(f"M{body}Z" if closed else f"M{body}")
    return found


def _short(value: float) -> str:
    """A number with at most four decimals: a tenth of a micrometre."""
    text = f"{value:.4f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _text(drawing: svgwrite.Drawing) -> str:
    return '<?xml version="1.0" encoding="utf-8"?>\n' + str(drawing.tostring()) + "\n"
