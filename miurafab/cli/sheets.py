"""``miurafab sheets``: patches, tabs, perforation, nesting, order; drawings and G-code."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import miurafab
from miurafab.cli.console import Console
from miurafab.cli.declared import MachineOption, MaterialOption, argument, option, takes
from miurafab.errors import DONE
from miurafab.findings import findings_json
from miurafab.options import File, Text

if TYPE_CHECKING:
    from miurafab.workflow.job_directory import JobDirectory
    from miurafab.workflow.sheet_job import SheetJob

EXAMPLES = (
    "miurafab sheets hypar.fold -o jobs/hypar",
    "miurafab sheets hypar.fold -o jobs/pdf --material paper-100 --format pdf",
)


def _layout_options() -> type:
    from miurafab.fabrication.options import LayoutOptions

    return LayoutOptions


def scale_options() -> type:
    """The class that declares the size of a pattern."""
    from miurafab.workflow.scaling import ScaleOptions

    return ScaleOptions


@takes(_layout_options, scale_options)
def sheets(
    file: Annotated[Path, argument("FILE", "The pattern, a FOLD file.")],
    /,
    *,
    out: Annotated[Path, option(File("FOLDER"), "The job directory to make.", "-o", "--out")],
    machine: MachineOption = None,
    material: MaterialOption = None,
    formats: Annotated[
        list[str] | None,
        option(
            Text("FORMAT,..."),
            "Draw more than SVG: dxf, dxf-r2010, pdf, hpgl, picture (of the pattern), and tiled- "
            "with a page (to join): a0 to a6, letter, legal, tabloid or a measure such as "
            "200x300mm; comma-separated.",
            "--format",
            "--formats",
        ),
    ] = None,
    design: Annotated[
        Path | None,
        option(
            File(),
            "A design file whose [layout] gives options, machine and material; options given here "
            "replace them.",
        ),
    ] = None,
    console: Console = Console(),
    **given: str,
) -> int:
    """Lay a pattern out on sheets, with drawings and G-code.

    Makes patches, tabs, perforation, nesting and order, for one machine and one material.
    """
    with console.progress("laying out") as progress:
        made = miurafab.sheets(
            file,
            machine,
            material,
            design=design,
            on_progress=lambda fraction, note: progress(0.7 * fraction, note),
            **given,
        )
        job = made.write(
            out,
            formats=formats or (),
            on_progress=lambda fraction, note: progress(0.7 + 0.3 * fraction, note),
        )
    answer = {**_answer(job, out), **_times(made), "advice": _advice(made)}
    console.answer(answer, lambda: _show(console, answer, job))
    return DONE


def _answer(job: JobDirectory, out: Path) -> dict[str, Any]:
    totals = job.layout.totals
    seconds = {each.name: each.seconds for each in job.dry_runs}
    return {
        "job": str(out),
        "machine": job.layout.machine,
        "material": job.layout.material,
        "sheets": [
            {
                "name": sheet.name,
                "stock": sheet.stock,
                "card_mm": sheet.card_mm,
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
            "border_tabs": totals.border_tabs,
            "density": totals.density,
            "sheets_bound": totals.sheets_bound,
            "cut_mm": totals.cut_mm,
            "perforated_mm": totals.perforated_mm,
            "travel_mm": totals.travel_mm,
            "seconds": totals.seconds,
        },
        "alternatives": [vars(each) for each in job.layout.alternatives],
        "borders": [
            {"number": each.number, "length_mm": each.length_mm, "across_mm": each.across_mm}
            for each in job.layout.borders
        ],
        "findings": findings_json(job.findings),
    }


def _times(made: SheetJob) -> dict[str, Any]:
    """The time of each operation, and what would be quicker."""
    return {
        "operation_seconds": {
            name or "other": round(seconds, 1) for name, seconds in made.operation_seconds.items()
        },
        "quicker": [{"change": way.change, "seconds": way.seconds} for way in made.quicker()],
    }


def _show(console: Console, answer: dict[str, Any], job: JobDirectory) -> None:
    from miurafab.workflow.dry_run import clock_text, length_text

    totals, sheets = answer["totals"], answer["sheets"]
    facts = {key: answer[key] for key in ("job", "machine", "material")}
    facts["patches"] = totals["patches"]
    on_borders = totals["border_tabs"]
    on_seams = totals["tabs"] - on_borders
    tabs = [f"{on_seams:,} on {length_text(totals['seam_mm'])} of seams"] if on_seams else []
    tabs += [f"{on_borders:,} on open borders"] if on_borders else []
    if tabs:
        facts["tabs"] = ", ".join(tabs)
    if job.layout.borders:
        sizes = (f"{each.number}: {each.size}" for each in job.layout.borders)
        facts["open borders"] = "; ".join(sizes)
    facts["sheets"] = f"{totals['sheets']:,}, {totals['density']:.0%} of their room used" + (
        f"; at least {totals['sheets_bound']:,} for these patches"
        if totals["sheets"] > totals["sheets_bound"]
        else ""
    )
    if advice := answer["advice"]:
        size = f"{advice['size_mm']:.4g} mm ({advice['scale'] - 1:+.1%})"
        takes = (
            "nothing to glue"
            if not advice["seam_mm"]
            else (f"{length_text(advice['seam_mm'])} of seams")
        )
        number = "one sheet" if advice["sheets"] == 1 else f"{advice['sheets']} sheets"
        facts["other size"] = (
            f"up to {size} on the same sheet"
            if advice["scale"] > 1
            else (f"{size} takes {number}, {takes}")
        )
    if len(sheets) == 1:
        facts["needs card of"] = _card(sheets[0])
    for key in ("cut", "perforated", "travel"):
        facts[key] = length_text(totals[f"{key}_mm"])
    facts["machine time"] = clock_text(totals["seconds"])
    parts = {name: each for name, each in answer["operation_seconds"].items() if each >= 1}
    if len(parts) > 1:
        facts["of it"] = ", ".join(f"{name} {clock_text(each)}" for name, each in parts.items())
    ways = (f"{way['change']}: {clock_text(way['seconds'])}" for way in answer["quicker"])
    if answer["quicker"]:
        facts["quicker"] = "; ".join(ways)
    console.facts(facts)
    compared = answer["alternatives"]
    if len(compared) > 1:
        console.rows(
            ("", "sheets", "patches", "seams", "smallest patch"),
            [
                (
                    "chosen" if each["chosen"] else "compared",
                    each["sheets"],
                    each["patches"],
                    length_text(each["seam_mm"]),
                    f"{each['smallest']:.0%} of the mean",
                )
                for each in compared
            ],
        )
    rows = [
        (sheet["name"], sheet["patches"], _card(sheet), clock_text(sheet["seconds"]))
        for sheet in sheets
    ]
    if any(sheet["stock"] for sheet in sheets):
        cut_from = [(sheet["stock"] or "a whole sheet",) for sheet in sheets]
        console.rows(
            ("sheet", "patches", "needs card of", "machine time", "cut from"),
            [row + end for row, end in zip(rows, cut_from, strict=True)],
        )
    elif len(sheets) > 1:
        console.rows(("sheet", "patches", "needs card of", "machine time"), rows)
    console.findings(job.findings)
    console.line(f"Look at it first: miurafab preview {answer['job']}")


def _card(sheet: dict[str, Any]) -> str:
    width, height = sheet["card_mm"]
    return f"{width:g} x {height:g} mm"


def _advice(made: SheetJob) -> dict[str, Any] | None:
    """The size that pays."""
    from miurafab.workflow.scaling import size_of

    found = made.advised_size()
    if found is None:
        return None
    size = math.floor(10 * found.scale * size_of(made.pattern)) / 10
    return {"size_mm": size, **vars(found)}
