"""``miurafab calibrate``: a sheet that tries settings out on one machine and material."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

import miurafab
from miurafab.cli.console import Console, JsonOption, QuietOption


def calibrate(
    out: Annotated[Path, typer.Option("-o", "--out", help="The job directory to write.")],
    machine: Annotated[
        str | None, typer.Option(help="A machine profile: a shipped name or a TOML file.")
    ] = None,
    material: Annotated[
        str | None, typer.Option(help="The material to begin with: a name or a TOML file.")
    ] = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Make a test sheet: dashes against power and feed, kerf gauge, fold coupon.

    Preview and cut it like any job, then keep what is best with 'miurafab materials add'.
    """
    console = Console(as_json, quiet)
    with console.progress("drawing the sheet") as progress:
        made = miurafab.calibrate(
            miurafab.DEFAULT_MACHINE if machine is None else machine,
            miurafab.DEFAULT_MATERIAL if material is None else material,
            out,
        )
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
        console.facts({key: value for key, value in answer.items() if key not in _LISTS})
        console.facts(
            {
                "flaps": f"{sheet.cells[0].label} to {sheet.cells[-1].label}",
                "squares": f"{sheet.squares[0].label} to {sheet.squares[-1].label}",
            }
        )
        console.line(f"How to read it: {out / 'calibration.pdf'}")
        console.line(f"Look at it first: miurafab preview {out}")

    console.answer(answer, show)


_LISTS = ("cells", "squares")
