"""``miurafab sheets``: patches, tabs, perforation, nesting, order; drawings and G-code."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

import miurafab
from miurafab.cli.console import Console, JsonOption, QuietOption

MachineOption = Annotated[
    str | None, typer.Option("--machine", help="A machine profile: a shipped name or a TOML file.")
]
MaterialOption = Annotated[
    str | None, typer.Option("--material", help="A material: a shipped name or a TOML file.")
]


def sheets(
    file: Annotated[Path, typer.Argument(help="The FOLD file of the pattern.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="The job directory to make.")],
    machine: MachineOption = None,
    material: MaterialOption = None,
    formats: Annotated[
        list[str] | None,
        typer.Option("--format", help="Also draw each sheet as dxf, pdf or hpgl; may be repeated."),
    ] = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Lay a pattern out on sheets, with drawings and G-code.

    Patches, tabs, perforation, nesting and order, for one machine and one material.
    """
    console = Console(as_json, quiet)
    with console.progress("laying out") as progress:
        job = miurafab.write_job(
            file,
            out,
            machine or miurafab.DEFAULT_MACHINE,
            material or miurafab.DEFAULT_MATERIAL,
            progress,
            formats=formats or (),
        )
    totals = job.layout.totals
    answer: dict[str, Any] = {
        "job": str(out),
        "machine": job.layout.machine,
        "material": job.layout.material,
        "totals": {
            "patches": totals.patches,
            "sheets": totals.sheets,
            "seam_mm": totals.seam_mm,
            "tabs": totals.tabs,
            "density": totals.density,
            "cut_mm": totals.cut_mm,
            "perforated_mm": totals.perforated_mm,
            "travel_mm": totals.travel_mm,
            "seconds": totals.seconds,
        },
        "untabbed": list(job.layout.untabbed),
        "unlettered": job.layout.unlettered,
    }

    def show() -> None:
        console.facts({"job": str(out), "machine": job.layout.machine})
        console.facts(answer["totals"])
        if job.layout.untabbed:
            console.line(f"No tab could stand on {len(job.layout.untabbed)} seam edges.")
        console.line(f"Look at it first: miurafab preview {out}")

    console.answer(answer, show)
