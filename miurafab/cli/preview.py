"""``miurafab preview``: dry-run a job, and show it in figures, pictures and a page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import miurafab
from miurafab.cli.console import Console, JsonOption, QuietOption
from miurafab.cli.sheets import MachineOption

if TYPE_CHECKING:
    from miurafab.workflow.dry_run import SheetPreview


def preview(
    job: Annotated[Path, typer.Argument(help="A job directory or a G-code file.")],
    machine: MachineOption = None,
    settings: Annotated[
        Path | None,
        typer.Option(help="A file with what '$$' printed; it wins over the machine's profile."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", help="Where the pictures go [default: JOB/preview]."),
    ] = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Show what a job would do; opens no port.

    Pictures, times, lengths, and what is wrong with it.
    """
    console = Console(as_json, quiet)
    profile = None if machine is None else miurafab.load_machine(machine)
    with console.progress("dry run") as progress:
        seen = miurafab.preview(job, machine=profile, settings_dump=settings, on_progress=progress)
        progress(0.9, "pictures")
        folder = out or (job / "preview" if job.is_dir() else job.with_name(f"{job.stem}-preview"))
        files = list(miurafab.write_pictures(seen, folder))
        page = folder / "preview.html"
        miurafab.write_page(page, title=seen.name, preview=seen, pattern=seen.pattern)
        progress(1.0, "done")
    answer: dict[str, Any] = {**seen.as_dict(), "files": [str(file) for file in (*files, page)]}

    def show() -> None:
        console.rows(
            ("sheet", "lines", "time", "beam on", "drawn", "travel", "bounds mm"),
            [_row(sheet) for sheet in seen.sheets],
            title=f"{seen.name} on {seen.machine.title}",
        )
        console.findings(seen.findings)
        for sheet in seen.sheets:
            console.findings(sheet.findings)
        console.line(f"Open {page} in a browser; pictures are beside it.")

    console.answer(answer, show)


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
