"""``assembly.pdf``: what the person with the glue needs, on A4.

The first page shows the flat pattern and the folded form with the patches in the same colours, and
what was used to make them; then one page a sheet; then the order of folding and glueing. Everything
is drawn from the layout and the pattern, and the same input gives the same bytes.
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from reportlab.lib.colors import Color, HexColor
from reportlab.lib.units import mm
from reportlab.pdfgen.canvas import Canvas

from miurafab.fabrication.assembly import assembly_order
from miurafab.fabrication.drawing.pdf import draw_strokes
from miurafab.fabrication.sheets import Layout
from miurafab.geometry.angles import facet_normals
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import MachineProfile, Material

Floats = NDArray[np.float64]

_WIDTH, _HEIGHT, _MARGIN = 210.0, 297.0, 18.0
_INK, _QUIET, _RULE = HexColor("#1d2329"), HexColor("#5c6670"), HexColor("#c3cad2")
_VIEW_AZIMUTH, _VIEW_ELEVATION = math.radians(-55), math.radians(28)
_GOLDEN = 0.61803398875
_ROWS_A_PAGE = 34


def assembly_guide(
    layout: Layout,
    pattern: CreasePattern,
    machine: MachineProfile,
    material: Material,
    title: str,
) -> bytes:
    """The guide as PDF. ``layout`` must have its toolpaths."""
    stream = io.BytesIO()
    canvas = Canvas(stream, invariant=1, pagesize=(_WIDTH * mm, _HEIGHT * mm))
    canvas.setTitle(f"{title}: assembly")
    canvas.setCreator("miurafab")
    model = layout.model
    tints = [_tint(patch.id % len(model.patches)) for patch in layout.patches]
    face_patch = np.zeros(len(pattern.faces_vertices), dtype=np.int64)
    for patch in model.patches:
        face_patch[patch.faces] = patch.id
    _overview(canvas, layout, pattern, machine, material, title, tints, face_patch)
    for number in range(len(layout.sheets)):
        _sheet_page(canvas, layout, number, title, tints)
    _glue_pages(canvas, model, pattern, title, tints, layout.copies)
    canvas.save()
    return stream.getvalue()


def _tint(number: int) -> Color:
    """Well-spread light colours: hues a golden section apart."""
    hue = (0.08 + number * _GOLDEN) % 1.0
    sector, part = divmod(hue * 6, 1)
    rise, fall = 0.55 + 0.38 * part, 0.93 - 0.38 * part
    top, low = 0.93, 0.55
    red, green, blue = (
        (top, rise, low), (fall, top, low), (low, top, rise),
        (low, fall, top), (rise, low, top), (top, low, fall),
    )[int(sector)]  # fmt: skip
    return Color(red, green, blue)


def _heading(canvas: Canvas, title: str, subtitle: str) -> float:
    """The head of a page; returns the height in mm at which the page goes on."""
    top = _HEIGHT - _MARGIN
    canvas.setFillColor(_INK)
    canvas.setFont("Helvetica-Bold", 17)
    canvas.drawString(_MARGIN * mm, (top - 5) * mm, title)
    canvas.setFillColor(_QUIET)
    canvas.setFont("Helvetica", 9.5)
    canvas.drawString(_MARGIN * mm, (top - 11) * mm, subtitle)
    canvas.setStrokeColor(_RULE)
    canvas.setLineWidth(0.2 * mm)
    canvas.line(_MARGIN * mm, (top - 14) * mm, (_WIDTH - _MARGIN) * mm, (top - 14) * mm)
    canvas.setFont("Helvetica", 7.5)
    canvas.drawRightString(
        (_WIDTH - _MARGIN) * mm, 10 * mm, f"page {canvas.getPageNumber()}   miurafab"
    )
    return top - 18


def _overview(
    canvas: Canvas,
    layout: Layout,
    pattern: CreasePattern,
    machine: MachineProfile,
    material: Material,
    title: str,
    tints: list[Color],
    face_patch: NDArray[np.int64],
) -> None:
    sheets, patches = len(layout.sheets), len(layout.patches)
    top = _heading(
        canvas,
        title,
        f"{len(pattern.faces_vertices)} facets in {_count(patches, 'patch', 'patches')} "
        f"on {_count(sheets, 'sheet', 'sheets')}",
    )
    width = _WIDTH - 2 * _MARGIN
    tall = 92.0
    if pattern.folded_coords is not None:
        _caption(canvas, "Folded", _MARGIN, top)
        _draw_folded(canvas, pattern, tints, face_patch, (_MARGIN, top - tall, width, tall - 6))
        top -= tall + 4
    _caption(canvas, "Flat, seen from the printed side", _MARGIN, top)
    scale = _draw_flat(
        canvas, pattern, layout, tints, face_patch, (_MARGIN, top - tall, width, tall - 6)
    )
    top -= tall + 6
    _scale_bar(canvas, scale, _MARGIN, top)
    size = np.ptp(pattern.folded_coords, axis=0) if pattern.folded_coords is not None else None
    facts = [
        ("Folded size", "-" if size is None else " x ".join(f"{s:.0f}" for s in size) + " mm"),
        ("Machine", f"{machine.title} ({machine.name})"),
        ("Material", f"{material.title} ({material.name}), {material.thickness_mm:g} mm thick"),
        ("Perforation", f"{material.perforation.cut_mm:g} mm cut, "
                        f"{material.perforation.gap_mm:g} mm left, kerf {material.kerf_mm:g} mm"),
        *(
            (name.capitalize(), f"{op.power:.0%} power, {op.feed_mm_min:g} mm/min, "
                                f"{_count(op.passes, 'pass', 'passes')}")
            for name, op in material.operations.items()
        ),
        ("Tabs", f"{layout.totals.tabs} on {layout.totals.seam_mm / 1000:.2f} m of seams"),
    ]  # fmt: skip
    _table(canvas, facts, top - 10)
    canvas.showPage()


def _count(number: int, one: str, many: str) -> str:
    return f"{number} {one if number == 1 else many}"


def _caption(canvas: Canvas, text: str, x: float, y: float) -> None:
    canvas.setFillColor(_INK)
    canvas.setFont("Helvetica-Bold", 10)
    canvas.drawString(x * mm, (y - 4) * mm, text)


def _table(canvas: Canvas, facts: Sequence[tuple[str, str]], top: float) -> None:
    for row, (name, value) in enumerate(facts):
        y = (top - 5.2 * row) * mm
        canvas.setFont("Helvetica", 9)
        canvas.setFillColor(_QUIET)
        canvas.drawString(_MARGIN * mm, y, name)
        canvas.setFillColor(_INK)
        canvas.drawString((_MARGIN + 34) * mm, y, value)


def _scale_bar(canvas: Canvas, scale: float, x: float, y: float) -> None:
    """A bar of a round length in the drawing's own scale (page mm a pattern mm)."""
    length = next(
        size for size in (500, 200, 100, 50, 20, 10, 5, 2, 1, 0.5) if size * scale <= 45 or size < 1
    )
    canvas.setStrokeColor(_INK)
    canvas.setLineWidth(0.3 * mm)
    canvas.line(x * mm, y * mm, (x + length * scale) * mm, y * mm)
    for end in (x, x + length * scale):
        canvas.line(end * mm, (y - 1) * mm, end * mm, (y + 1) * mm)
    canvas.setFillColor(_QUIET)
    canvas.setFont("Helvetica", 8)
    canvas.drawString((x + length * scale + 2) * mm, (y - 1) * mm, f"{length:g} mm")


def _fitted(points: Floats, box: tuple[float, float, float, float]) -> tuple[Floats, float]:
    """``points`` (n, 2) scaled and centred into ``box`` (x, y, width, height), and the scale."""
    low, span = points.min(axis=0), np.ptp(points, axis=0)
    x, y, width, height = box
    scale = float(min(width / max(span[0], 1e-9), height / max(span[1], 1e-9)))
    shift = np.array([x + (width - scale * span[0]) / 2, y + (height - scale * span[1]) / 2])
    return (points - low) * scale + shift, scale


def _draw_folded(
    canvas: Canvas,
    pattern: CreasePattern,
    tints: list[Color],
    face_patch: NDArray[np.int64],
    box: tuple[float, float, float, float],
) -> None:
    """An orthographic view, far facets first, lit from the upper left."""
    assert pattern.folded_coords is not None
    points = pattern.folded_coords - pattern.folded_coords.mean(axis=0)
    ca, sa = math.cos(_VIEW_AZIMUTH), math.sin(_VIEW_AZIMUTH)
    ce, se = math.cos(_VIEW_ELEVATION), math.sin(_VIEW_ELEVATION)
    towards = np.array([ce * ca, ce * sa, se])
    right = np.array([-sa, ca, 0.0])
    up = np.cross(towards, right)
    flat, _ = _fitted(np.stack([points @ right, points @ up], axis=1), box)
    faces = pattern.faces_vertices
    corners = np.where(faces >= 0, faces, faces[:, :1])
    depth = (points @ towards)[corners].mean(axis=1)
    quads = corners[:, [0, 1, 2, min(3, corners.shape[1] - 1)]]
    normals = np.nan_to_num(facet_normals(points, quads))
    light = np.array([0.35 * ca - 0.5 * sa, 0.35 * sa + 0.5 * ca, 0.8])
    facing = np.where(normals @ towards < 0, -1.0, 1.0)
    shade = 0.62 + 0.38 * np.clip(
        (normals * facing[:, None]) @ (light / np.linalg.norm(light)), 0, 1
    )
    canvas.setLineWidth(0.1 * mm)
    canvas.setLineJoin(1)
    for face in np.argsort(depth, kind="stable").tolist():
        tint = tints[face_patch[face]]
        level = float(shade[face])
        fill = Color(tint.red * level, tint.green * level, tint.blue * level)
        canvas.setFillColor(fill)
        canvas.setStrokeColor(Color(fill.red * 0.72, fill.green * 0.72, fill.blue * 0.72))
        _polygon(canvas, flat[[v for v in faces[face].tolist() if v >= 0]])


def _polygon(canvas: Canvas, points: Floats, stroke: int = 1) -> None:
    path = canvas.beginPath()
    path.moveTo(points[0, 0] * mm, points[0, 1] * mm)
    for x, y in points[1:].tolist():
        path.lineTo(x * mm, y * mm)
    path.close()
    canvas.drawPath(path, stroke=stroke, fill=1)


def _draw_flat(
    canvas: Canvas,
    pattern: CreasePattern,
    layout: Layout,
    tints: list[Color],
    face_patch: NDArray[np.int64],
    box: tuple[float, float, float, float],
) -> float:
    points, scale = _fitted(pattern.vertices_coords, box)
    for face, corners in enumerate(pattern.faces_vertices.tolist()):
        canvas.setFillColor(tints[face_patch[face]])
        _polygon(canvas, points[[v for v in corners if v >= 0]], stroke=0)
    ends = (points[pattern.edges_vertices] * mm).reshape(-1, 4)
    for letter, colour in (("M", "#b3261e"), ("V", "#1f4fa3"), ("B", "#1d2329")):
        canvas.setStrokeColor(HexColor(colour))
        canvas.setLineWidth((0.25 if letter == "B" else 0.12) * mm)
        canvas.lines(ends[pattern.edges_assignment == letter].tolist())
    canvas.setFillColor(_INK)
    canvas.setFont("Helvetica-Bold", 11)
    for patch in layout.model.patches:
        corners = pattern.faces_vertices[patch.faces]
        x, y = points[corners[corners >= 0]].mean(axis=0) * mm
        canvas.drawCentredString(x, y - 4, patch.label)
    return scale


def _sheet_page(
    canvas: Canvas, layout: Layout, number: int, title: str, tints: list[Color]
) -> None:
    sheet, toolpath = layout.sheets[number], layout.toolpaths[number]
    labels = ", ".join(layout.patches[p.patch].label for p in sheet.placements)
    cut_from = f" from '{sheet.stock}'" if sheet.stock else ""
    top = _heading(canvas, f"{title}: {sheet.name}", f"Patches {labels}{cut_from}")
    room = (_WIDTH - 2 * _MARGIN, top - 40)
    scale = min(room[0] / sheet.width_mm, room[1] / sheet.height_mm)
    canvas.saveState()
    canvas.translate(_MARGIN * mm, (top - sheet.height_mm * scale) * mm)
    canvas.scale(scale, scale)
    for placement in sheet.placements:
        patch = layout.patches[placement.patch]
        canvas.setFillColor(tints[patch.id])
        _polygon(canvas, placement.from_patch(patch.outline_mm), stroke=0)
    canvas.setFillColor(_RULE)
    for ring in sheet.defects_mm:
        _polygon(canvas, np.array(ring), stroke=0)
    draw_strokes(canvas, toolpath, line_mm=0.12 / scale)
    canvas.setStrokeColor(_RULE)
    canvas.setLineWidth(0.3 / scale * mm)
    canvas.rect(0, 0, sheet.width_mm * mm, sheet.height_mm * mm)
    canvas.restoreState()
    _scale_bar(canvas, scale, _MARGIN, top - sheet.height_mm * scale - 6)
    canvas.setFont("Helvetica", 9)
    canvas.setFillColor(_QUIET)
    canvas.drawRightString(
        (_WIDTH - _MARGIN) * mm,
        (top - sheet.height_mm * scale - 7) * mm,
        f"{sheet.width_mm:g} x {sheet.height_mm:g} mm, drawn at 1:{1 / scale:.3g}; "
        f"{toolpath.length_of('cut') / 1000:.2f} m cut, "
        f"{toolpath.length_of('perforate') / 1000:.2f} m perforated",
    )
    canvas.showPage()


def _glue_pages(
    canvas: Canvas,
    layout: Layout,
    pattern: CreasePattern,
    title: str,
    tints: list[Color],
    copies: int,
) -> None:
    steps = assembly_order(layout, pattern)
    each = "In this order" if copies == 1 else f"In this order, for each of the {copies} copies"
    labels = [patch.label for patch in layout.patches]
    for start in range(0, len(steps), _ROWS_A_PAGE):
        top = _heading(canvas, f"{title}: folding and glueing", each)
        if start == 0:
            top = _instructions(canvas, top)
        for row, step in enumerate(steps[start : start + _ROWS_A_PAGE]):
            y = top - 6 * row
            canvas.setFillColor(tints[step.patch])
            canvas.rect(_MARGIN * mm, (y - 3.6) * mm, 4 * mm, 4 * mm, stroke=0, fill=1)
            canvas.setFillColor(_INK)
            canvas.setFont("Helvetica", 9.5)
            place = f"{start + row + 1}.  {labels[step.patch]}"
            if step.closes:
                place += f" to {labels[step.onto[0]]}, closing the ring: {_tab_text(step.tabs)}"
            elif step.onto:
                onto = ", ".join(labels[p] for p in step.onto)
                place += f" onto {onto}: {_tab_text(step.tabs)}"
            else:
                place += ": begin here"
            canvas.drawString((_MARGIN + 7) * mm, (y - 3) * mm, place)
        canvas.showPage()


def _tab_text(numbers: tuple[int, ...]) -> str:
    """``tabs 1-4, 7``: runs of consecutive numbers drawn together."""
    if not numbers:
        return "no tabs; use tape on the seam"
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    text = ", ".join(f"{r[0]}-{r[-1]}" if len(r) > 1 else str(r[0]) for r in runs)
    return f"{'tab' if len(numbers) == 1 else 'tabs'} {text}"


def _instructions(canvas: Canvas, top: float) -> float:
    lines = (
        "Red creases are mountains (fold away from you), blue ones valleys (fold towards you), as",
        "seen from the printed side. Crease every line both ways first, one row after another,",
        "then fold all rows together a little at a time: the sheet moves as one. Fold each patch",
        "before it is glued, and flatten it again half way: tabs are glued best when the seam is",
        "nearly flat. Each tab carries the number of the edge it goes under.",
    )
    canvas.setFont("Helvetica", 9.5)
    canvas.setFillColor(_INK)
    for row, line in enumerate(lines):
        canvas.drawString(_MARGIN * mm, (top - 4 - 5 * row) * mm, line)
    return top - 10 - 5 * len(lines)
