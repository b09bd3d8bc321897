"""A picture of each sheet as an SVG: one path a kind of move, sharp at any size.

It is for looking at, and not for cutting: the drawings for laser software are the sheets' own.
Thousands of moves are one ``%`` over a format that is as long as their path, so that no line of
Python runs for each dash.
"""

from __future__ import annotations

import html

import numpy as np
from numpy.typing import NDArray

from miurafab.profiles import MachineProfile
from miurafab.workflow.dry_run import LAYERS, SheetPreview, clock_text, length_text

_MOVES_AT_ONCE = 16_384


def svg_text(sheet: SheetPreview, machine: MachineProfile) -> str:
    """The picture of one sheet: strokes and travels by operation, bed, legend; Y points up."""
    x0, y0, x1, y1 = sheet.view_mm
    width, height = x1 - x0, y1 - y0
    unit = max(width, height) / 100
    bed, margin = machine.bed, machine.bed.margin_mm
    parts = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{_n(-3 * unit)} {_n(-9 * unit)} '
        f'{_n(width + 32 * unit)} {_n(height + 12 * unit)}" '
        'font-family="system-ui, Segoe UI, Helvetica, Arial, sans-serif" fill="#1d2329">',
        f"<title>{html.escape(sheet.name)}</title>",
        f'<rect x="{_n(-3 * unit)}" y="{_n(-9 * unit)}" width="100%" height="100%" fill="#fff"/>',
        _text(0, -5.2 * unit, 2.9 * unit, sheet.program.name),
        _text(
            0,
            -2.2 * unit,
            1.5 * unit,
            f"{machine.title}, {clock_text(sheet.seconds)} estimated, beam on "
            f"{clock_text(sheet.beam_on_seconds)}",
            "#5c6670",
        ),
        f'<g transform="translate({_n(-x0)} {_n(y1)}) scale(1 -1)">',
        _rectangle(0, 0, *sheet.paper_mm, 'fill="#fff" stroke="#dde1e6"', 0.15 * unit),
        _rectangle(0, 0, bed.width_mm, bed.height_mm, 'fill="none" stroke="#6b7682"', 0.15 * unit),
        _rectangle(
            margin,
            margin,
            bed.width_mm - 2 * margin,
            bed.height_mm - 2 * margin,
            f'fill="none" stroke="#c3cad2" stroke-dasharray="{_n(0.6 * unit)}"',
            0.1 * unit,
        ),
        *(_path(sheet, index, unit) for index in range(len(LAYERS))),
        "</g>",
    ]
    top = 1.2 * unit
    for layer, length in zip(LAYERS, sheet.layer_mm, strict=True):
        if length > 0:
            left = width + 2.5 * unit
            parts.append(
                f'<path d="M{_n(left)} {_n(top)}h{_n(4 * unit)}" stroke="{layer.colour}" '
                f'stroke-width="{_n(0.4 * unit)}"{_dashes(layer.name, unit)}/>'
            )
            note = f"{layer.title}  {length_text(length)}"
            parts.append(_text(left + 5 * unit, top + 0.6 * unit, 1.7 * unit, note))
            top += 3 * unit
    return "\n".join([*(part for part in parts if part), "</svg>"]) + "\n"


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
    thin = 0.09 if layer.name == "travel" else 0.18
    return (
        f'<path id="{layer.name}" fill="none" stroke="{layer.colour}" '
        f'stroke-width="{_n(thin * unit)}"{_dashes(layer.name, unit)} d="{data}"/>'
    )


def _data(sheet: SheetPreview, moves: NDArray[np.int64], begins: NDArray[np.bool_]) -> str:
    """Path data of ``moves``; those that ``begins`` marks start by going to their place."""
    start, end = sheet.program.start[moves, :2], sheet.program.end[moves, :2]
    formats = np.where(begins, "M%.7g %.7gL%.7g %.7g", "L%.7g %.7g")
    numbers = np.concatenate([start.round(3), end.round(3)], axis=1)
    wanted = np.repeat(np.stack([begins, np.ones_like(begins)], axis=1), 2, axis=1)
    return "".join(formats.tolist()) % tuple(numbers[wanted].tolist())


def _dashes(layer: str, unit: float) -> str:
    return f' stroke-dasharray="{_n(0.5 * unit)} {_n(0.4 * unit)}"' if layer == "travel" else ""


def _rectangle(x: float, y: float, width: float, height: float, look: str, stroke: float) -> str:
    return (
        f'<rect x="{_n(x)}" y="{_n(y)}" width="{_n(width)}" height="{_n(height)}" {look} '
        f'stroke-width="{_n(stroke)}"/>'
    )


def _text(x: float, y: float, size: float, text: str, fill: str = "#1d2329") -> str:
    return (
        f'<text x="{_n(x)}" y="{_n(y)}" font-size="{_n(size)}" fill="{fill}" '
        f'xml:space="preserve">{html.escape(text)}</text>'
    )


def _n(value: float) -> str:
    """A number with at most three decimals."""
    return f"{value:.3f}".rstrip("0").rstrip(".")
