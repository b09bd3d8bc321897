"""``calibration.pdf``: how the calibration sheet is read, on one A4 page."""

from __future__ import annotations

import io

from reportlab.lib.colors import Color, HexColor
from reportlab.lib.units import mm
from reportlab.pdfgen.canvas import Canvas

from miurafab.fabrication.calibration import CalibrationSheet
from miurafab.fabrication.drawing.pdf import draw_strokes
from miurafab.profiles import MachineProfile, Material

_WIDTH, _HEIGHT, _MARGIN = 210.0, 297.0, 18.0
_INK, _QUIET, _RULE = HexColor("#1d2329"), HexColor("#5c6670"), HexColor("#c3cad2")

_STEPS = (
    (
        "1. Squares, row X",
        "Lift the sheet. Take the leftmost square that falls out by itself: its number, say X3, is",
        "the cut. What stands below it is its power and feed; energy grows from left to right.",
    ),
    (
        "2. Kerf",
        "Push all strips of the gauge to the left until they touch. The right end of the last one",
        "points at the kerf in mm on the scale above; its long lines are tenths of a millimetre.",
    ),
    (
        "3. Flaps",
        "Fold each flap both ways. Rows differ in dash and gap (left, in mm), columns in power and",
        "feed (above). Take the one that folds sharply and holds when it is pulled: say B4.",
    ),
    (
        "4. Coupon",
        "The small Miura-ori is made with the material as it is now: what the change is for.",
    ),
)


def calibration_guide(
    sheet: CalibrationSheet, machine: MachineProfile, material: Material, job: str
) -> bytes:
    """The page as PDF for the job directory called ``job``. The same input gives the same bytes."""
    stream = io.BytesIO()
    canvas = Canvas(stream, invariant=1, pagesize=(_WIDTH * mm, _HEIGHT * mm))
    canvas.setTitle(f"Calibration of {material.title}")
    canvas.setCreator("miurafab")
    top = _HEIGHT - _MARGIN
    _text(canvas, 17, top - 5, f"Calibration of {material.title}", bold=True)
    _text(canvas, 9.5, top - 11, machine.title, colour=_QUIET)
    canvas.setStrokeColor(_RULE)
    canvas.setLineWidth(0.2 * mm)
    canvas.line(_MARGIN * mm, (top - 14) * mm, (_WIDTH - _MARGIN) * mm, (top - 14) * mm)
    top -= 20
    scale = min((_WIDTH - 2 * _MARGIN) / sheet.width_mm, 118.0 / sheet.height_mm, 1.0)
    top -= sheet.height_mm * scale
    canvas.saveState()
    canvas.translate(_MARGIN * mm, top * mm)
    canvas.scale(scale, scale)
    canvas.setStrokeColor(_RULE)
    canvas.rect(0, 0, sheet.width_mm * mm, sheet.height_mm * mm)
    draw_strokes(canvas, sheet.toolpath, line_mm=0.15 / scale)
    canvas.restoreState()
    drawn = f"{sheet.width_mm:.0f} x {sheet.height_mm:.0f} mm, drawn at 1:{1 / scale:.3g}"
    _text(canvas, 8, top - 4, drawn, colour=_QUIET)
    top -= 14
    for title, *lines in _STEPS:
        _text(canvas, 10, top, title, bold=True)
        for line in lines:
            top -= 4.8
            _text(canvas, 9.5, top, line)
        top -= 8.5
    _text(canvas, 10, top, "5. Keep it", bold=True)
    example = sheet.cells[-1].label, sheet.squares[-1].label
    command = f"miurafab materials add NAME --from {job} --cell {example[0]} --cut {example[1]}"
    canvas.setFont("Courier", 9)
    canvas.drawString(_MARGIN * mm, (top - 5.5) * mm, f"{command} --kerf 0.15mm")
    last = "with your own choices writes NAME.toml, a material for every command."
    _text(canvas, 9.5, top - 11, last)
    canvas.showPage()
    canvas.save()
    return stream.getvalue()


def _text(
    canvas: Canvas, size: float, y: float, text: str, *, bold: bool = False, colour: Color = _INK
) -> None:
    canvas.setFillColor(colour)
    canvas.setFont("Helvetica-Bold" if bold else "Helvetica", size)
    canvas.drawString(_MARGIN * mm, y * mm, text)
