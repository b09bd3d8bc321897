"""``miurafab calibrate``: a sheet that tries settings out on one machine and material."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import miurafab
from miurafab.cli.console import Console
from miurafab.cli.declared import MachineOption, MaterialOption, option
from miurafab.errors import DONE
from miurafab.options import File, declared
from miurafab.profiles.beam import Operation

_OPERATION = declared(Operation)

EXAMPLES = (
    "miurafab calibrate --machine grbl-laser-400 --material card-250 -o trial",
    "miurafab calibrate --machine grbl-co2-k40 --power 4W --feed 1800 -o trial",
)


def calibrate(
    *,
    out: Annotated[Path, option(File("FOLDER"), "The job directory to write.", "-o", "--out")],
    machine: MachineOption = None,
    material: MaterialOption = None,
    power: Annotated[
        float | None,
        option(
            _OPERATION["power"].kind,
            "Power of a cut to begin with, in watts, where the material has no settings for the "
            "machine's beam.",
        ),
    ] = None,
    feed: Annotated[float | None, option(_OPERATION["feed"].kind, "Feed of that cut.")] = None,
    console: Console = Console(),
) -> int:
    """Make a test sheet: dashes against power or force, scores, kerf, a coupon.

    Preview and cut it like any job, then keep the best settings with 'miurafab materials add'.
    """
    with console.progress("drawing the sheet") as progress:
        made = miurafab.calibrate(out, machine, material, power=power, feed=feed)
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
                "along": cell.along,
                "cut_mm": cell.perforation.cut_mm,
                "gap_mm": cell.perforation.gap_mm,
                **_setting(cell.operation),
            }
            for cell in sheet.cells
        ],
        "scores": [
            {"label": score.label, "along": score.along, **_setting(score.operation)}
            for score in sheet.scores
        ],
        "squares": [
            {"label": square.label, **_setting(square.operation)} for square in sheet.squares
        ],
    }

    def show() -> None:
        facts = {key: value for key, value in answer.items() if not isinstance(value, list)}
        facts["flaps"] = f"{sheet.cells[0].label} to {sheet.cells[-1].label}"
        if sheet.scores:
            facts["scores"] = f"{sheet.scores[0].label} to {sheet.scores[-1].label}"
        facts["squares"] = f"{sheet.squares[0].label} to {sheet.squares[-1].label}"
        console.facts(facts)
        console.line(f"How to read it: {out / 'calibration.pdf'}")
        console.line(f"Look at it first: miurafab preview {out}")

    console.answer(answer, show)
    return DONE


def _setting(operation: Operation) -> dict[str, float]:
    strength = {"power": operation.power, "force": operation.force}
    told = {key: value for key, value in strength.items() if value is not None}
    return {**told, "feed_mm_min": operation.feed_mm_min}
