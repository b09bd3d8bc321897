"""A picture of each sheet as a PNG: what is burnt, by operation, and how the tool travels.

Strokes are drawn by sampling: every line is cut into points a third of a pixel apart, the points
are set in a mask of three times the size, thickened, and averaged down. So a hundred thousand
dashes cost one pass over arrays, and edges are smooth.
"""

from __future__ import annotations

import textwrap
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from miurafab.geometry.arrays import places_in_runs
from miurafab.profiles import MachineProfile
from miurafab.workflow.dry_run import LAYERS, SheetPreview, clock_text, length_text
from miurafab.workflow.picture_svg import svg_text
from miurafab.workflow.preview import Preview

_FINE = 3
"""Mask pixels for one pixel of the picture, along each axis."""
_PLOT = 1160
"""Pixels of the longer side of what is shown."""
_LEFT, _TOP, _BOTTOM, _SIDE, _EDGE, _AIR = 78, 116, 92, 372, 28, 14
_INK, _QUIET, _RULE, _BED, _MARGIN = "#1d2329", "#5c6670", "#dde1e6", "#6b7682", "#c3cad2"
_PAGE, _DESK, _PAPER, _WARNING = "#ffffff", "#e9ecef", "#ffffff", "#b45309"
_START, _END = "#2b8a3e", "#1d2329"
_DASH = (5.0, 4.0)
"""Pixels drawn and left out along a travel; a travel shorter than a dash would fill the gaps of a
perforation and is left out."""

_LINES_AT_ONCE = 16_384

_Points = NDArray[np.float64]


def write_pictures(preview: Preview, out_dir: Path) -> tuple[Path, ...]:
    """Write ``NAME.png`` and ``NAME.svg`` for every sheet into ``out_dir``; return their paths."""
    out_dir.mkdir(parents=True, exist_ok=True)
    written = []
    for sheet in preview.sheets:
        png, svg = (out_dir / f"{sheet.name}.{ending}" for ending in ("png", "svg"))
        picture(sheet, preview.machine).save(png, optimize=True)
        svg.write_text(svg_text(sheet, preview.machine), encoding="utf-8", newline="\n")
        written += [png, svg]
    return tuple(written)


def picture(sheet: SheetPreview, machine: MachineProfile) -> Image.Image:
    """The picture of one sheet: strokes by operation, travels dashed, bed, scale and figures."""
    x0, y0, x1, y1 = sheet.view_mm
    scale = _PLOT / max(x1 - x0, y1 - y0, 1e-6)
    width, height = (max(round(side * scale), 320) + 2 * _AIR for side in (x1 - x0, y1 - y0))
    plot = _Plot(x0 - _AIR / scale, y1 + _AIR / scale, scale, width, height)
    image = Image.new("RGB", (_LEFT + width + _SIDE, _TOP + height + _BOTTOM), _PAGE)
    image.paste(_strokes(sheet, machine, plot), (_LEFT, _TOP))
    draw = ImageDraw.Draw(image)
    _title(draw, sheet, machine)
    _axes(draw, plot)
    _scale_bar(draw, plot)
    _marks(draw, sheet, plot)
    _side(draw, sheet, _LEFT + width + _EDGE, image.height)
    return image


class _Plot:
    """Millimetres to pixels: ``x0`` is the left edge and ``y1`` the upper, Y points up."""

    def __init__(self, x0: float, y1: float, scale: float, width: int, height: int) -> None:
        self.x0, self.y1, self.scale = x0, y1, scale
        self.width, self.height = width, height

    def pixels(self, points: _Points) -> _Points:
        """(n, 2) pixels from the plot's upper left corner."""
        return (points[:, :2] - (self.x0, self.y1)) * (self.scale, -self.scale)

    def box(self, x0: float, y0: float, x1: float, y1: float) -> list[tuple[float, float]]:
        """Upper left and lower right pixel of a box in mm."""
        corners = self.pixels(np.array([[x0, y1], [x1, y0]]))
        return [(float(x), float(y)) for x, y in corners.round()]


def _strokes(sheet: SheetPreview, machine: MachineProfile, plot: _Plot) -> Image.Image:
    """The plot itself: desk, paper, bed, then travels, then operations in their order."""
    image = Image.new("RGB", (plot.width, plot.height), _DESK)
    draw = ImageDraw.Draw(image)
    bed = machine.bed
    draw.rectangle(plot.box(0, 0, *sheet.paper_mm), fill=_PAPER)
    draw.rectangle(plot.box(0, 0, bed.width_mm, bed.height_mm), outline=_BED)
    margin = bed.margin_mm
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * (
        bed.width_mm - 2 * margin,
        bed.height_mm - 2 * margin,
    )
    loop = corners + margin
    image.paste(_MARGIN, mask=_ink(loop, np.roll(loop, -1, axis=0), plot, 1, _DASH))
    start, end = sheet.program.start, sheet.program.end
    for index, layer in enumerate(LAYERS):
        moves = sheet.layer == index
        if moves.any():
            travel = layer.name == "travel"
            mask = _ink(
                start[moves], end[moves], plot, 1 if travel else 2, _DASH if travel else None
            )
            image.paste(layer.colour, mask=mask)
    return image


def _ink(
    start: _Points, end: _Points, plot: _Plot, radius: int, dash: tuple[float, float] | None
) -> Image.Image:
    """How much of each pixel the lines (in mm) cover, 0 to 255; ``radius`` is in mask pixels."""
    high, wide = plot.height * _FINE + 2 * radius, plot.width * _FINE + 2 * radius
    mask = np.zeros((high, wide), dtype=bool)
    for first in range(0, len(start), _LINES_AT_ONCE):
        block = slice(first, first + _LINES_AT_ONCE)
        points = _along(plot.pixels(start[block]), plot.pixels(end[block]), radius, dash)
        column, row = np.floor(points * _FINE).astype(np.int64).T + radius
        inside = (column >= 0) & (column < wide) & (row >= 0) & (row < high)
        mask[row[inside], column[inside]] = True
    thick = np.zeros((plot.height * _FINE, plot.width * _FINE), dtype=bool)
    for down in range(2 * radius + 1):
        for right in range(2 * radius + 1):
            if (down - radius) ** 2 + (right - radius) ** 2 <= radius**2 + 1:
                thick |= mask[down : down + thick.shape[0], right : right + thick.shape[1]]
    return Image.fromarray(thick.astype(np.uint8) * 255).reduce(_FINE)


def _along(start: _Points, end: _Points, radius: int, dash: tuple[float, float] | None) -> _Points:
    """Points along lines in pixels, a third of a pixel apart, those in the gaps left out."""
    length = np.linalg.norm(end - start, axis=1)
    if dash is not None:
        long = length >= dash[0]
        start, end, length = start[long], end[long], length[long]
    # Thickening lengthens both ends by the radius.
    cap = np.minimum(0.5, 0.5 * radius / _FINE / np.maximum(length, 1e-9))[:, None]
    start, end = start + (end - start) * cap, end + (start - end) * cap
    count = np.ceil(length * _FINE).astype(np.int64) + 1
    line = np.repeat(np.arange(len(start)), count)
    place = places_in_runs(count)
    part = place / np.maximum(count - 1, 1)[line]
    if dash is not None:
        drawn = np.mod(part * length[line], sum(dash)) < dash[0]
        line, part = line[drawn], part[drawn]
    points: _Points = start[line] + (end - start)[line] * part[:, None]
    return points


def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size)


def _title(draw: ImageDraw.ImageDraw, sheet: SheetPreview, machine: MachineProfile) -> None:
    draw.text((_LEFT, 22), sheet.program.name, fill=_INK, font=_font(34))
    subtitle = (
        f"{machine.title}   |   {clock_text(sheet.seconds)} estimated, beam on "
        f"{clock_text(sheet.beam_on_seconds)}   |   {length_text(sheet.cut_mm)} drawn, "
        f"{length_text(sheet.travel_mm)} travel"
    )
    draw.text((_LEFT, 70), subtitle, fill=_QUIET, font=_font(18))


def _axes(draw: ImageDraw.ImageDraw, plot: _Plot) -> None:
    """Ticks at round millimetres along the left and the lower edge."""
    step = _round_length(70 / plot.scale)
    font = _font(15)
    bottom = _TOP + plot.height
    draw.rectangle((_LEFT - 1, _TOP - 1, _LEFT + plot.width, bottom), outline=_RULE)
    for axis, low, pixels in (
        (0, plot.x0, plot.width),
        (1, plot.y1 - plot.height / plot.scale, plot.height),
    ):
        first, last = (
            np.ceil(low / step - 1e-9),
            np.floor((low + pixels / plot.scale) / step + 1e-9),
        )
        for tick in np.arange(first, last + 1) * step:
            along = round((float(tick) - low) * plot.scale)
            text = f"{tick + 0.0:g}"
            if axis == 0:
                draw.line((_LEFT + along, bottom, _LEFT + along, bottom + 6), fill=_QUIET)
                draw.text((_LEFT + along, bottom + 9), text, fill=_QUIET, font=font, anchor="ma")
            else:
                draw.line((_LEFT - 7, bottom - along, _LEFT - 1, bottom - along), fill=_QUIET)
                draw.text((_LEFT - 11, bottom - along), text, fill=_QUIET, font=font, anchor="rm")


def _scale_bar(draw: ImageDraw.ImageDraw, plot: _Plot) -> None:
    mm = _round_length(140 / plot.scale)
    left, top = _LEFT + _AIR, _TOP + plot.height + 50
    right = left + round(mm * plot.scale)
    draw.line((left, top, left, top + 10, right, top + 10, right, top), fill=_INK, width=2)
    draw.text((right + 12, top + 10), f"{mm:g} mm", fill=_INK, font=_font(17), anchor="lm")


def _round_length(at_least: float) -> float:
    """The smallest of 1, 2, 5, 10, 20, ... mm that is not below ``at_least``."""
    ten = 10.0 ** np.floor(np.log10(at_least))
    return float(next(step * ten for step in (1, 2, 5, 10) if step * ten >= at_least))


def _marks(draw: ImageDraw.ImageDraw, sheet: SheetPreview, plot: _Plot) -> None:
    """A disc where the beam first goes on, a square where it last goes off."""
    burning = np.flatnonzero(sheet.program.beam_on)
    if not len(burning):
        return
    ends = np.array([sheet.program.start[burning[0]], sheet.program.end[burning[-1]]])
    for (x, y), mark in zip(plot.pixels(ends).tolist(), (_disc, _square), strict=True):
        mark(draw, _LEFT + x, _TOP + y)


def _disc(draw: ImageDraw.ImageDraw, x: float, y: float) -> None:
    draw.ellipse((x - 8, y - 8, x + 8, y + 8), fill=_START, outline=_PAGE, width=2)


def _square(draw: ImageDraw.ImageDraw, x: float, y: float) -> None:
    draw.rectangle((x - 7, y - 7, x + 7, y + 7), fill=_END, outline=_PAGE, width=2)


def _side(draw: ImageDraw.ImageDraw, sheet: SheetPreview, left: int, bottom: int) -> None:
    """The legend by operation, the marks, and the warnings."""
    top = _TOP
    for layer, length, strokes in zip(LAYERS, sheet.layer_mm, sheet.layer_strokes, strict=True):
        if length <= 0:
            continue
        middle = top + 11
        if layer.name == "travel":
            for dash in range(left, left + 40, 9):
                draw.line((dash, middle, dash + 4, middle), fill=layer.colour)
        else:
            draw.rectangle((left, middle - 2, left + 40, middle + 2), fill=layer.colour)
        draw.text((left + 56, middle), layer.title, fill=_INK, font=_font(20), anchor="lm")
        draw.text((left + 316, middle), length_text(length), fill=_INK, font=_font(20), anchor="rm")
        if strokes:
            noun = "stroke" if strokes == 1 else "strokes"
            draw.text((left + 56, top + 27), f"{strokes:,} {noun}", fill=_QUIET, font=_font(15))
        top += 56 if strokes else 40
    if sheet.bounds_mm is not None:
        for mark, text in ((_disc, "first stroke"), (_square, "last stroke")):
            mark(draw, left + 20, top + 11)
            draw.text((left + 56, top + 11), text, fill=_INK, font=_font(18), anchor="lm")
            top += 32
        x0, y0, x1, y1 = sheet.bounds_mm
        for text in (f"X {x0:.1f} to {x1:.1f} mm", f"Y {y0:.1f} to {y1:.1f} mm"):
            draw.text((left + 56, top + 11), text, fill=_QUIET, font=_font(16), anchor="lm")
            top += 24
    top += 14
    for warning in sheet.warnings:
        lines = textwrap.wrap(warning, 40)
        if top + 21 * len(lines) > bottom - _EDGE:
            break
        draw.rectangle((left, top, left + 4, top + 21 * len(lines) - 4), fill=_WARNING)
        draw.multiline_text(
            (left + 14, top - 2), "\n".join(lines), fill=_WARNING, font=_font(16), spacing=4
        )
        top += 21 * len(lines) + 10
