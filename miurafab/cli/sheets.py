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
    design: Annotated[
        Path | None,
        typer.Option(help="A design file whose [layout] holds options; those given here win."),
    ] = None,
    gap: Annotated[str | None, typer.Option(help="Kept between patches [default: 2mm].")] = None,
    offcuts: Annotated[
        str | None, typer.Option(help="Left-over sheets to use up first: 300x200,180x90.")
    ] = None,
    max_patch: Annotated[
        str | None, typer.Option(help="The largest patch, as 300mmx200mm [default: the bed].")
    ] = None,
    seam_rows: Annotated[
        str | None, typer.Option(help="Rows of facets after which to cut in any case: 10,20.")
    ] = None,
    seam_columns: Annotated[
        str | None, typer.Option(help="Columns of facets after which to cut in any case.")
    ] = None,
    tab_height: Annotated[
        str | None, typer.Option(help="Height of the tabs [default: the material's].")
    ] = None,
    tab_inset: Annotated[
        str | None, typer.Option(help="Inset of the tabs [default: the material's].")
    ] = None,
    tab_angle: Annotated[
        str | None,
        typer.Option(help="Largest inner angle at a tab's base [default: the material's, 75deg]."),
    ] = None,
    tab_side: Annotated[
        str | None,
        typer.Option(help="The patch that bears the tabs: lower, upper, alternate [lower]."),
    ] = None,
    full_facet: Annotated[
        bool | None, typer.Option("--full-facet", help="Tabs as large as the facets under them.")
    ] = None,
    two_sided: Annotated[
        bool | None, typer.Option("--two-sided", help="Score the valleys from the back.")
    ] = None,
    bridges: Annotated[
        int | None, typer.Option(help="Holding bridges on each outline, 2 or more [default: 0].")
    ] = None,
    bridge: Annotated[
        str | None, typer.Option(help="Length of a holding bridge [default: 0.5mm].")
    ] = None,
    spread_heat: Annotated[
        bool | None,
        typer.Option("--spread-heat", help="Cut patches beside each other far apart in time."),
    ] = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Lay a pattern out on sheets, with drawings and G-code.

    Patches, tabs, perforation, nesting and order, for one machine and one material.
    """
    console = Console(as_json, quiet)
    given = {
        "gap": gap,
        "offcuts": offcuts,
        "max_patch": max_patch,
        "seam_rows": seam_rows,
        "seam_columns": seam_columns,
        "tab_height": tab_height,
        "tab_inset": tab_inset,
        "tab_angle": tab_angle,
        "tab_side": tab_side,
        "full_facet": full_facet,
        "two_sided": two_sided,
        "bridges": bridges,
        "bridge": bridge,
        "spread_heat": spread_heat,
    }
    options = miurafab.layout_options(
        {key: value for key, value in given.items() if value is not None}, design
    )
    with console.progress("laying out") as progress:
        job = miurafab.write_job(
            file,
            out,
            machine or miurafab.DEFAULT_MACHINE,
            material or miurafab.DEFAULT_MATERIAL,
            progress,
            formats=formats or (),
            options=options,
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
        "remarks": list(job.layout.remarks),
    }

    def show() -> None:
        console.facts({"job": str(out), "machine": job.layout.machine})
        console.facts(answer["totals"])
        if job.layout.untabbed:
            console.line(f"No tab could stand on {len(job.layout.untabbed)} seam edges.")
        for remark in job.layout.remarks:
            console.line(remark)
        console.line(f"Look at it first: miurafab preview {out}")

    console.answer(answer, show)
