"""``miurafab calibrate``: a sheet that tries settings out on one machine and material."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import miurafab
from miurafab.cli.console import Console
from miurafab.cli.declared import MachineOption, MaterialOption, option
from miurafab.errors import DONE
from miurafab.options import File

EXAMPLES = ("miurafab calibrate --machine grbl-laser-400 --material card-250 -o trial",)


def calibrate(
    *,
    out: Annotated[Path, option(File("FOLDER"), "The job directory to write.", "-o", "--out")],
    machine: MachineOption = None,
    material: MaterialOption = None,
    console: Console = Console(),
) -> int:
    """Make a test sheet: dashes against power and feed, kerf gauge, fold coupon.

    Preview and cut it like any job, then keep the best settings with 'miurafab materials add'.
    """
    with console.progress("drawing the sheet") as progress:
        made = miurafab.calibrate(out, machine, material)
        progress(1.0, "done")
    layout, sheet = made.job.layout, made.sheet
    answer: dict[str, Any] = {
        "job": str(out),
        "machine": layout.machine,
        "material": layout.material,
        "width_mm": sheet.width_mm,
        "height_mm": sheet.height_mm,
        "seconds": layout.totals.seconds,
        "cells": [
            {
                "label": cell.label,
                "cut_mm": cell.perforation.cut_mm,
                "gap_mm": cell.perforation.gap_mm,
                "power": cell.operation.power,
                "feed_mm_min": cell.operation.feed_mm_min,
            }
            for cell in sheet.cells
        ],
        "squares": [
            {
                "label": square.label,
                "power": square.operation.power,
                "feed_mm_min": square.operation.feed_mm_min,
            }
            for square in sheet.squares
        ],
    }

    def show() -> None:
        facts = {key: value for key, value in answer.items() if key not in ("cells", "squares")}
        facts["flaps"] = f"{sheet.cells[0].label} to {sheet.cells[-1].label}"
        facts["squares"] = f"{sheet.squares[0].label} to {sheet.squares[-1].label}"
        console.facts(facts)
        console.line(f"How to read it: {out / 'calibration.pdf'}")
        console.line(f"Look at it first: miurafab preview {out}")

    console.answer(answer, show)
    return DONE
