"""``calibration.pdf``: how to read the calibration sheet, on one A4 page."""

from __future__ import annotations

import io

from reportlab.lib.units import mm
from reportlab.pdfgen.canvas import Canvas

from miurafab.fabrication.calibration import CalibrationSheet
from miurafab.fabrication.drawing.page import (
    HEIGHT,
    MARGIN,
    QUIET,
    ROOM,
    RULE,
    WIDTH,
    foot,
    heading,
    text,
)
from miurafab.fabrication.drawing.pdf import draw_strokes
from miurafab.profiles import MachineProfile, Material

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
    canvas = Canvas(stream, invariant=1, pagesize=(WIDTH * mm, HEIGHT * mm))
    canvas.setTitle(f"Calibration of {material.title}")
    canvas.setCreator("miurafab")
    top = heading(canvas, f"Calibration of {material.title}", machine.title) - 1
    scale = min(ROOM / sheet.width_mm, 118.0 / sheet.height_mm, 1.0)
    top -= sheet.height_mm * scale
    canvas.saveState()
    canvas.translate(MARGIN * mm, top * mm)
    canvas.scale(scale, scale)
    canvas.setStrokeColor(RULE)
    canvas.rect(0, 0, sheet.width_mm * mm, sheet.height_mm * mm)
    draw_strokes(canvas, sheet.toolpath, scale=scale)
    canvas.restoreState()
    drawn = f"{sheet.width_mm:.0f} x {sheet.height_mm:.0f} mm, drawn at 1:{1 / scale:.3g}"
    text(canvas, MARGIN, top - 4, drawn, 8, colour=QUIET)
    top -= 14
    for title, *lines in _STEPS:
        text(canvas, MARGIN, top, title, 10, bold=True)
        for line in lines:
            top -= 4.8
            text(canvas, MARGIN, top, line, 9.5)
        top -= 8.5
    text(canvas, MARGIN, top, "5. Keep it", 10, bold=True)
    example = sheet.cells[-1].label, sheet.squares[-1].label
    command = f"miurafab materials add NAME --from {job} --cell {example[0]} --cut {example[1]}"
    canvas.setFont("Courier", 9)
    canvas.drawString(MARGIN * mm, (top - 5.5) * mm, f"{command} --kerf 0.15mm")
    last = "with your own choices writes NAME.toml, a material for every command."
    text(canvas, MARGIN, top - 11, last, 9.5)
    foot(canvas, f"Calibration of {material.title}", 1, 1)
    canvas.showPage()
    canvas.save()
    return stream.getvalue()
