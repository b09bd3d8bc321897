"""``miurafab preview``: dry-run a job, and show it in figures, pictures and a page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import miurafab
from miurafab.cli.console import Console
from miurafab.cli.declared import MachineOption, argument, option, takes
from miurafab.errors import DONE, NO
from miurafab.options import File, Whole

if TYPE_CHECKING:
    from miurafab.workflow.dry_run import SheetPreview

EXAMPLES = (
    "miurafab preview jobs/hypar",
    "miurafab preview jobs/hypar/sheet-01.nc --machine grbl-laser-400",
    "miurafab preview jobs/hypar --sheet 1 --align 5,5=6,5 --align 220,5=221,5",
)


def _cut_options() -> type:
    from miurafab.workflow.cut_options import CutOptions

    return CutOptions


@takes(_cut_options, only=("align",))
def preview(
    job: Annotated[Path, argument("JOB", "A job directory or a G-code file.")],
    /,
    *,
    machine: MachineOption = None,
    settings: Annotated[
        Path | None,
        option(
            File(),
            "A file with what '$$' printed on the machine; its settings replace the profile's.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        option(
            File("FOLDER"),
            "The folder for the pictures.",
            "-o",
            "--out",
            default_text="JOB/preview",
        ),
    ] = None,
    sheet: Annotated[int | None, option(Whole(1), "Only this sheet, from 1.")] = None,
    console: Console = Console(),
    **given: str,
) -> int:
    """Show what a job would do, without opening a port.

    Prints times, lengths and warnings, and writes pictures and a page. The exit code is 1 if a cut
    would be refused.
    """
    with console.progress("dry run") as progress:
        seen = miurafab.preview(
            job, machine=machine, settings=settings, sheet=sheet, on_progress=progress, **given
        )
        progress(0.9, "pictures")
        folder = out or (job / "preview" if job.is_dir() else job.with_name(f"{job.stem}-preview"))
        files = seen.write(folder)
        progress(1.0, "done")
    answer: dict[str, Any] = {**seen.as_dict(), "files": [str(file) for file in files]}

    def show() -> None:
        from miurafab.workflow.dry_run import at_work

        console.rows(
            ("sheet", "lines", "time", at_work(seen.machine), "drawn", "travel", "bounds mm"),
            [_row(sheet) for sheet in seen.sheets],
            title=f"{seen.name} on {seen.machine.title}",
        )
        console.findings(seen.findings)
        for sheet in seen.sheets:
            console.findings(sheet.findings)
        console.line(f"Open {files[-1]} in a browser; pictures are beside it.")

    console.answer(answer, show)
    return NO if answer["status"] == "refused" else DONE


def _row(sheet: SheetPreview) -> tuple[str | int, ...]:
    from miurafab.workflow.dry_run import clock_text, length_text

    bounds = "-"
    if sheet.bounds_mm is not None:
        x0, y0, x1, y1 = sheet.bounds_mm
        bounds = f"{x0:.0f},{y0:.0f} to {x1:.0f},{y1:.0f}"
    return (
        sheet.name,
        sheet.lines,
        clock_text(sheet.seconds),
        clock_text(sheet.beam_on_seconds),
        length_text(sheet.cut_mm),
        length_text(sheet.travel_mm),
        bounds,
    )
