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
        typer.Option(
            "--format",
            "--formats",
            help="Draw more than SVG: dxf, dxf-r2010, pdf, hpgl, tiled-a4, tiled-a3, tiled-letter, "
            "tiled-legal (pages to join), picture (of the pattern); several parted by commas.",
        ),
    ] = None,
    design: Annotated[
        Path | None,
        typer.Option(
            help="A design file whose [layout] holds options, machine and material; those given "
            "here win."
        ),
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
    open_row: Annotated[
        int | None,
        typer.Option(help="Open a closed ring after this row of facets, and count rows from it."),
    ] = None,
    open_column: Annotated[
        int | None, typer.Option(help="The same along columns of facets.")
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
    quantity: Annotated[
        int | None, typer.Option(help="How many of the whole model to make [default: 1].")
    ] = None,
    stock: Annotated[
        Path | None,
        typer.Option(help="A TOML file with the sheets to use: sizes, quantities, defects."),
    ] = None,
    margin: Annotated[
        str | None, typer.Option(help="Kept free along the sheet's edges [default: the machine's].")
    ] = None,
    grain: Annotated[
        str | None,
        typer.Option(help="How the sheets' fibres run: x, y, none [default: the material's]."),
    ] = None,
    along_grain: Annotated[
        str | None, typer.Option(help="The pattern's axis to lay along the fibres: x or y [x].")
    ] = None,
    rotations: Annotated[
        str | None,
        typer.Option(help="Degrees by which patches may be turned [default: 0,90,180,270]."),
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
        "open_row": open_row,
        "open_column": open_column,
        "tab_height": tab_height,
        "tab_inset": tab_inset,
        "tab_angle": tab_angle,
        "tab_side": tab_side,
        "full_facet": full_facet,
        "two_sided": two_sided,
        "bridges": bridges,
        "bridge": bridge,
        "spread_heat": spread_heat,
        "quantity": quantity,
        "stock": None if stock is None else str(stock),
        "margin": margin,
        "grain": grain,
        "along_grain": along_grain,
        "rotations": rotations,
    }
    options = miurafab.layout_options(
        {key: value for key, value in given.items() if value is not None}, design
    )
    named = (None, None) if design is None else miurafab.design_profiles(design)
    # An empty name, as of a variable that is not set, is a mistake and not the usual machine.
    machine = named[0] if machine is None else machine
    material = named[1] if material is None else material
    with console.progress("laying out") as progress:
        job = miurafab.write_job(
            file,
            out,
            miurafab.DEFAULT_MACHINE if machine is None else machine,
            miurafab.DEFAULT_MATERIAL if material is None else material,
            progress,
            formats=formats or (),
            options=options,
        )
    totals = job.layout.totals
    seconds = {each.name: each.seconds for each in job.dry_runs}
    answer: dict[str, Any] = {
        "job": str(out),
        "machine": job.layout.machine,
        "material": job.layout.material,
        "sheets": [
            {
                "name": sheet.name,
                "stock": sheet.stock,
                "patches": len(sheet.placements),
                "seconds": round(sum(seconds[name] for name in sheet.passes), 1),
            }
            for sheet in job.layout.sheets
        ],
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

    console.answer(answer, lambda: _show(console, answer))


def _show(console: Console, answer: dict[str, Any]) -> None:
    from miurafab.workflow.dry_run import clock_text, length_text
    from miurafab.workflow.job_directory import GUIDE

    totals, sheets = answer["totals"], answer["sheets"]
    facts = {key: answer[key] for key in ("job", "machine", "material")}
    facts["patches"] = totals["patches"]
    if totals["tabs"]:
        facts["tabs"] = f"{totals['tabs']:,} on {length_text(totals['seam_mm'])} of seams"
    facts["sheets"] = f"{totals['sheets']:,}, {totals['density']:.0%} of their room used"
    for key in ("cut", "perforated", "travel"):
        facts[key] = length_text(totals[f"{key}_mm"])
    facts["machine time"] = clock_text(totals["seconds"])
    console.facts(facts)
    rows = [(sheet["name"], sheet["patches"], clock_text(sheet["seconds"])) for sheet in sheets]
    if any(sheet["stock"] for sheet in sheets):
        cut_from = [(sheet["stock"] or "a whole sheet",) for sheet in sheets]
        console.rows(
            ("sheet", "patches", "machine time", "cut from"),
            [row + end for row, end in zip(rows, cut_from, strict=True)],
        )
    elif len(sheets) > 1:
        console.rows(("sheet", "patches", "machine time"), rows)
    if answer["untabbed"]:
        edges = len(answer["untabbed"])
        console.line(f"No tab could stand on {edges} seam edge{'s' if edges > 1 else ''}.")
    if answer["unlettered"]:
        texts = answer["unlettered"]
        names = "names and numbers" if texts > 1 else "name or number"
        console.line(f"{texts} {names} found no room on the sheets; go by {GUIDE}.")
    for remark in answer["remarks"]:
        console.line(remark)
    console.line(f"Look at it first: miurafab preview {answer['job']}")
