"""The picture of a sheet as SVG, one path per kind of move, and as PNG, rendered from the SVG.

It shows the strokes by operation, the travels, the bed, a scale, and the warnings. It is not for
cutting: the drawings for laser software are separate files. Moves are formatted thousands at a
time, with a single ``%``, so that no line of Python runs for each dash. The PNG uses the font that
matplotlib ships and no font of the system, so the same job gives the same bytes everywhere.
"""

from __future__ import annotations

import html
import math
import textwrap
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import resvg_py

from miurafab.errors import shown
from miurafab.files import write_bytes, write_text
from miurafab.geometry.arrays import Bools, Ints
from miurafab.origami.picture import INK
from miurafab.profiles import MachineProfile
from miurafab.workflow.dry_run import LAYERS, SheetPreview, at_work, clock_text, length_text
from miurafab.workflow.preview import Preview

LEFT, TOP, RIGHT, BOTTOM, AIR = 7.0, 10.0, 32.0, 8.0, 1.2
"""Margins around the view and the air within it, in hundredths of the longer side of the view."""
PIXELS = 1160
"""Pixels of the longer side of the view in a PNG."""
_QUIET, _RULE, _BED, _MARGIN, _DESK = "#5c6670", "#dde1e6", "#6b7682", "#c3cad2", "#e9ecef"
_WARNING, _START = "#b45309", "#2b8a3e"
_WRAP = 40
"""Characters of a line of a warning."""
_MOVES_AT_ONCE, _MOST_MOVES = 16_384, 30_000


def write_pictures(preview: Preview, out_dir: Path) -> tuple[Path, ...]:
    """Write ``NAME.png`` and ``NAME.svg`` for every sheet into the folder ``out_dir``."""
    written = []
    for sheet in preview.sheets:
        png, svg = (out_dir / f"{sheet.name}.{ending}" for ending in ("png", "svg"))
        write_bytes(png, png_bytes(sheet, preview.machine))
        write_text(svg, svg_text(sheet, preview.machine))
        written += [png, svg]
    return tuple(written)


def png_bytes(sheet: SheetPreview, machine: MachineProfile) -> bytes:
    """The picture of one sheet as a PNG."""
    matplotlib = find_spec("matplotlib")  # importing it would take longer than the picture
    assert matplotlib is not None
    assert matplotlib.origin is not None
    font = Path(matplotlib.origin).parent / "mpl-data/fonts/ttf/DejaVuSans.ttf"
    width, _ = _size(sheet)
    return resvg_py.svg_to_bytes(
        svg_string=svg_text(sheet, machine),
        width=round(width * PIXELS / (100 * _unit(sheet))),
        skip_system_fonts=True,
        font_files=[str(font)],
        sans_serif_family="DejaVu Sans",
    )


def first_sheet(sheets: tuple[SheetPreview, ...], machine: MachineProfile) -> str:
    """The picture of the first sheet for a notebook; empty where it would be megabytes of text."""
    if not sheets or len(sheets[0].layer) > _MOST_MOVES:
        return ""
    return svg_text(sheets[0], machine)


def svg_text(sheet: SheetPreview, machine: MachineProfile) -> str:
    """The picture of one sheet as an SVG; Y points up."""
    x0, y0, x1, y1 = sheet.view_mm
    unit, (width, height) = _unit(sheet), _size(sheet)
    bed, margin = machine.bed, machine.bed.margin_mm
    air = AIR * unit
    view = (x0 - air, y0 - air, x1 - x0 + 2 * air, y1 - y0 + 2 * air)
    left, top = -LEFT * unit, -TOP * unit
    subtitle = (
        f"{machine.title}, {clock_text(sheet.seconds)} estimated, {at_work(machine)} "
        f"{clock_text(sheet.beam_on_seconds)}, {length_text(sheet.cut_mm)} drawn, "
        f"{length_text(sheet.travel_mm)} travel"
    )
    parts = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{_n(left)} {_n(top)} '
        f'{_n(width)} {_n(height)}" '
        f'font-family="system-ui, Segoe UI, Helvetica, Arial, sans-serif" fill="{INK}">',
        f"<title>{html.escape(shown(sheet.name))}</title>",
        f'<rect x="{_n(left)}" y="{_n(top)}" width="100%" height="100%" fill="#fff"/>',
        _text(0, -5.4 * unit, 2.9 * unit, sheet.program.name),
        _text(0, -2.6 * unit, 1.5 * unit, subtitle, _QUIET),
        f'<g transform="translate({_n(-x0)} {_n(y1)}) scale(1 -1)">',
        _rectangle(*view, f'fill="{_DESK}" stroke="{_RULE}"', 0.1 * unit),
        _rectangle(0, 0, *sheet.paper_mm, f'fill="#fff" stroke="{_RULE}"', 0.15 * unit),
        _rectangle(0, 0, bed.width_mm, bed.height_mm, f'fill="none" stroke="{_BED}"', 0.15 * unit),
        _rectangle(
            margin,
            margin,
            bed.width_mm - 2 * margin,
            bed.height_mm - 2 * margin,
            f'fill="none" stroke="{_MARGIN}" stroke-dasharray="{_n(0.6 * unit)}"',
            0.1 * unit,
        ),
        *(_path(sheet, index, unit) for index in range(len(LAYERS))),
        *_marks(sheet, unit),
        "</g>",
        *_ticks(sheet, unit),
        *_legend(sheet, unit)[0],
    ]
    return "\n".join([*(part for part in parts if part), "</svg>"]) + "\n"


def _unit(sheet: SheetPreview) -> float:
    """A hundredth of the longer side of the view, in mm."""
    x0, y0, x1, y1 = sheet.view_mm
    return max(x1 - x0, y1 - y0) / 100


def _size(sheet: SheetPreview) -> tuple[float, float]:
    """Width and height of the picture in mm; it is high enough for the legend."""
    x0, y0, x1, y1 = sheet.view_mm
    unit = _unit(sheet)
    high = max(y1 - y0, _legend(sheet, unit)[1])
    return x1 - x0 + (LEFT + RIGHT) * unit, high + (TOP + BOTTOM) * unit


def _ticks(sheet: SheetPreview, unit: float) -> list[str]:
    """Round millimetres along the left and the lower edge, and a scale bar."""
    x0, y0, x1, y1 = sheet.view_mm
    step = _round_length(6 * unit)
    low, edge, parts = y1 - y0 + AIR * unit, -AIR * unit, []
    for tick in _multiples(step, x0, x1):
        at = _n(tick - x0)
        parts.append(f'<path d="M{at} {_n(low)}v{_n(0.5 * unit)}" {_line(_QUIET, 0.1 * unit)}/>')
        parts.append(_text(tick - x0, low + 1.8 * unit, 1.3 * unit, f"{tick:g}", _QUIET, "middle"))
    for tick in _multiples(step, y0, y1):
        at = _n(y1 - tick)
        parts.append(f'<path d="M{_n(edge)} {at}h{_n(-0.5 * unit)}" {_line(_QUIET, 0.1 * unit)}/>')
        middle = y1 - tick + 0.45 * unit
        parts.append(_text(edge - 0.9 * unit, middle, 1.3 * unit, f"{tick:g}", _QUIET, "end"))
    bar, top = _round_length(12 * unit), low + 3.6 * unit
    ends = f"M0 {_n(top)}v{_n(0.8 * unit)}h{_n(bar)}v{_n(-0.8 * unit)}"
    parts.append(f'<path d="{ends}" {_line(INK, 0.2 * unit)}/>')
    parts.append(_text(bar + unit, top + 1.2 * unit, 1.5 * unit, f"{bar:g} mm"))
    return parts


def _multiples(step: float, low: float, high: float) -> list[float]:
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [number * step for number in range(first, last + 1)]


def _round_length(at_least: float) -> float:
    """The smallest of 1, 2, 5, 10, 20, ... mm that is not below ``at_least``."""
    ten = 10.0 ** math.floor(math.log10(at_least))
    return next(step * ten for step in (1, 2, 5, 10) if step * ten >= at_least)


def _marks(sheet: SheetPreview, unit: float) -> list[str]:
    """A disc where the beam first goes on, a square where it last goes off."""
    burning = np.flatnonzero(sheet.program.beam_on)
    if not len(burning):
        return []
    (x0, y0), (x1, y1) = (
        place[:2].tolist()
        for place in (sheet.program.start[burning[0]], sheet.program.end[burning[-1]])
    )
    return [_disc(x0, y0, unit), _square(x1, y1, unit)]


def _disc(x: float, y: float, unit: float) -> str:
    return (
        f'<circle cx="{_n(x)}" cy="{_n(y)}" r="{_n(0.6 * unit)}" fill="{_START}" stroke="#fff" '
        f'stroke-width="{_n(0.17 * unit)}"/>'
    )


def _square(x: float, y: float, unit: float) -> str:
    half, look = 0.55 * unit, f'fill="{INK}" stroke="#fff"'
    return _rectangle(x - half, y - half, 2 * half, 2 * half, look, 0.17 * unit)


def _legend(sheet: SheetPreview, unit: float) -> tuple[list[str], float]:
    """Operations, marks, bounds and warnings to the right of the view, and their lower end."""
    x0, _, x1, _ = sheet.view_mm
    left, top = x1 - x0 + 2.5 * unit, 1.2 * unit
    column = left + 5 * unit
    parts = []
    for layer, length, count in zip(LAYERS, sheet.layer_mm, sheet.layer_strokes, strict=True):
        if length <= 0:
            continue
        parts.append(
            f'<path d="M{_n(left)} {_n(top)}h{_n(4 * unit)}" stroke="{layer.colour}" '
            f'stroke-width="{_n(0.4 * unit)}"{_dashes(layer.name, unit)}/>'
        )
        note = f"{layer.title}  {length_text(length)}"
        parts.append(_text(column, top + 0.6 * unit, 1.7 * unit, note))
        if count:
            strokes = f"{count:,} {'stroke' if count == 1 else 'strokes'}"
            parts.append(_text(column, top + 2.5 * unit, 1.3 * unit, strokes, _QUIET))
        top += (4.8 if count else 3.2) * unit
    if sheet.bounds_mm is not None:
        for mark, text in ((_disc, "first stroke"), (_square, "last stroke")):
            parts.append(mark(left + 2 * unit, top, unit))
            parts.append(_text(column, top + 0.5 * unit, 1.5 * unit, text))
            top += 2.6 * unit
        low_x, low_y, high_x, high_y = sheet.bounds_mm
        for text in (f"X {low_x:.1f} to {high_x:.1f} mm", f"Y {low_y:.1f} to {high_y:.1f} mm"):
            parts.append(_text(column, top + 0.5 * unit, 1.4 * unit, text, _QUIET))
            top += 2 * unit
    top += unit
    for warning in sheet.warnings:
        lines = textwrap.wrap(warning, _WRAP)
        bar = f'<path d="M{_n(left)} {_n(top - unit)}v{_n((1.8 * len(lines) - 0.3) * unit)}"'
        parts.append(f"{bar} {_line(_WARNING, 0.35 * unit)}/>")
        for line in lines:
            parts.append(_text(left + 1.2 * unit, top + 0.3 * unit, 1.3 * unit, line, _WARNING))
            top += 1.8 * unit
        top += 1.2 * unit
    return parts, top


def _path(sheet: SheetPreview, index: int, unit: float) -> str:
    """All moves of one layer as one path; a move that goes on where the last ended is an ``L``."""
    moves = np.flatnonzero(sheet.layer == index)
    if not len(moves):
        return ""
    layer = LAYERS[index]
    begins = np.concatenate([[True], np.diff(moves) != 1])
    data = "".join(
        _data(sheet, moves[first : first + _MOVES_AT_ONCE], begins[first : first + _MOVES_AT_ONCE])
        for first in range(0, len(moves), _MOVES_AT_ONCE)
    )
    thin = 0.09 if layer.name == "travel" else 0.2
    return (
        f'<path id="{layer.name}" fill="none" stroke="{layer.colour}" '
        f'stroke-width="{_n(thin * unit)}"{_dashes(layer.name, unit)} d="{data}"/>'
    )


def _data(sheet: SheetPreview, moves: Ints, begins: Bools) -> str:
    """Path data of ``moves``; those that ``begins`` marks start by going to their place."""
    start, end = sheet.program.start[moves, :2], sheet.program.end[moves, :2]
    formats = np.where(begins, "M%.7g %.7gL%.7g %.7g", "L%.7g %.7g")
    numbers = np.concatenate([start.round(3), end.round(3)], axis=1)
    wanted = np.repeat(np.stack([begins, np.ones_like(begins)], axis=1), 2, axis=1)
    return "".join(formats.tolist()) % tuple(numbers[wanted].tolist())


def _dashes(layer: str, unit: float) -> str:
    """Travels are dashed and begin with a gap, so that short travels leave perforations open."""
    if layer != "travel":
        return ""
    return f' stroke-dasharray="{_n(0.5 * unit)}" stroke-dashoffset="{_n(0.5 * unit)}"'


def _line(colour: str, width: float) -> str:
    return f'fill="none" stroke="{colour}" stroke-width="{_n(width)}"'


def _rectangle(x: float, y: float, width: float, height: float, look: str, stroke: float) -> str:
    return (
        f'<rect x="{_n(x)}" y="{_n(y)}" width="{_n(width)}" height="{_n(height)}" {look} '
        f'stroke-width="{_n(stroke)}"/>'
    )


def _text(
    x: float, y: float, size: float, text: str, fill: str = INK, anchor: str = "start"
) -> str:
    return (
        f'<text x="{_n(x)}" y="{_n(y)}" font-size="{_n(size)}" fill="{fill}" '
        f'text-anchor="{anchor}" xml:space="preserve">{html.escape(shown(text))}</text>'
    )


def _n(value: float) -> str:
    """A number with at most three decimals."""
    return f"{value:.3f}".rstrip("0").rstrip(".")
