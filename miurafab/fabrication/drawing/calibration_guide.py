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

Step = tuple[str, ...]


def _steps(machine: MachineProfile) -> list[Step]:
    """Title and lines of each step."""
    laser, pen = machine.tool.laser is not None, machine.tool.kind == "pen"
    strength, grows = ("power", "Energy") if laser else ("force (S)", "Force")
    best = "whose line is whole and even" if pen else "that falls out by itself"
    found: list[Step] = [
        (
            "Squares, row X",
            f"Lift the sheet. Take the leftmost square {best}: its number, say",
            f"X3, is the cut. Its {strength} and feed stand below it. {grows} grows to the right.",
        )
    ]
    if laser:
        found.append(
            (
                "Kerf, along X and along Y",
                "Push all strips of a gauge towards its name until they touch. The far end of the "
                "last one",
                "points at the kerf in mm on the scale; long lines are tenths. Take the mean of "
                "both gauges.",
            )
        )
    found += [
        (
            "Flaps, rows A to D",
            f"Fold each both ways. Rows differ in dash and gap (left), columns in {strength} and "
            "feed",
            "(above). Take the one that folds sharply and holds when it is pulled: say B4.",
        ),
        (
            "Score flaps, row S",
            "Fold each away from its score. Take the one that folds sharply and does not part: "
            "say S2.",
        ),
        (
            "Grain, columns Y",
            "The last column is hinged the other way, with the settings of the material as it is. "
            "If it folds",
            "more easily or cracks, the sheet has a grain: write it into the material, and lay "
            "sheets by it.",
        ),
        (
            "Coupon",
            "The small Miura-ori is made with the material as it is now: what the change is for.",
        ),
    ]
    return found


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
    steps = _steps(machine)
    for number, (title, *lines) in enumerate(steps, start=1):
        text(canvas, MARGIN, top, f"{number}. {title}", 10, bold=True)
        for line in lines:
            top -= 4.8
            text(canvas, MARGIN, top, line, 9.5)
        top -= 7.5
    text(canvas, MARGIN, top, f"{len(steps) + 1}. Keep it", 10, bold=True)
    chosen = f"--cell {sheet.cells[0].label} --cut {sheet.squares[-1].label}"
    scored = f" --score {sheet.scores[0].label}" if sheet.scores else ""
    kerf = " --kerf 0.15mm" if machine.tool.laser is not None else ""
    canvas.setFont("Courier", 8)
    command = f"miurafab materials add NAME --from {job} {chosen}{scored}{kerf}"
    canvas.drawString(MARGIN * mm, (top - 5.5) * mm, command)
    last = "with your own choices writes NAME.toml, a material for every command."
    text(canvas, MARGIN, top - 11, last, 9.5)
    foot(canvas, f"Calibration of {material.title}", 1, 1)
    canvas.showPage()
    canvas.save()
    return stream.getvalue()
