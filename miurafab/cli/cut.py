"""``miurafab cut``: make whatever is missing, and stream it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import miurafab
from miurafab.cli.console import Console, JsonOption, QuietOption
from miurafab.cli.sheets import MachineOption, MaterialOption

if TYPE_CHECKING:
    from miurafab.machine.sender import Progress
    from miurafab.workflow.cut import CutSheet, Prepared


def cut(
    thing: Annotated[
        str,
        typer.Argument(help="A job directory, a .nc file, a pattern .fold, a design, or a target."),
    ],
    port: Annotated[
        str, typer.Option(help="A serial device, a pyserial URL (socket://...), or 'virtual'.")
    ],
    machine: MachineOption = None,
    material: MaterialOption = None,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", help="The job directory to make [default: jobs/NAME]."),
    ] = None,
    sheet: Annotated[
        list[int] | None, typer.Option(help="Cut only this sheet, from 1; may be repeated.")
    ] = None,
    check_mode: Annotated[
        bool, typer.Option("--check-mode", help="Let the controller only read the job ($C).")
    ] = False,
    allow_m3: Annotated[
        bool, typer.Option("--allow-m3", help="Cut with M3, which burns on if the link is lost.")
    ] = False,
    force: Annotated[
        list[str] | None, typer.Option(help="Override the pre-flight check of this name.")
    ] = None,
    pause: Annotated[
        bool | None,
        typer.Option(help="Wait for Enter before each further sheet [default: in a terminal]."),
    ] = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Cut a job, making whatever is missing on the way.

    On a machine at a port, or on the virtual one. Ctrl-C stops with the beam off.
    """
    console = Console(as_json, quiet)
    with console.progress("preparing") as progress:
        prepared = miurafab.prepare(
            thing, machine=machine, material=material, out=out, on_progress=progress
        )
    if prepared.refusal is not None:
        _refuse(console, prepared)
    waits = pause if pause is not None else port != "virtual" and sys.stdin.isatty()
    with console.progress("cutting") as bar:

        def show_progress(number: int, now: Progress) -> None:
            done = now.lines_acknowledged / max(now.lines_total, 1)
            bar(done, f"sheet {number} of {len(prepared.jobs)}, {now.state}")

        def before(number: int, count: int) -> None:
            if waits and number > 1:
                console.remark(f"Sheet {number} of {count}: put in fresh material, press Enter.")
                sys.stdin.readline()

        done = miurafab.cut(
            prepared,
            port=port,
            sheets=sheet,
            force=frozenset(force or ()),
            allow_m3=allow_m3,
            check_mode=check_mode,
            before_sheet=before,
            on_progress=show_progress,
        )
    _report(console, prepared, done, port)


def _refuse(console: Console, prepared: Prepared) -> None:
    console.answer(
        {"status": "refused", "advice": prepared.refusal, "report": prepared.report},
        lambda: console.line(f"{prepared.name} is not cut: {prepared.refusal}"),
    )
    raise typer.Exit(1)


def _report(console: Console, prepared: Prepared, done: tuple[CutSheet, ...], port: str) -> None:
    layout = prepared.directory.layout if prepared.directory else None
    answer: dict[str, Any] = {"status": "done", "port": port, "machine": prepared.machine.name}
    if prepared.directory is not None:
        answer["job"] = str(prepared.directory.path)
        answer["files"] = sum(1 for _ in prepared.directory.path.iterdir())
    for name in ("facets", "max_planarity", "max_developability", "max_isometry"):
        if prepared.report is not None:
            answer[name] = prepared.report[name]
    if layout is not None:
        answer |= {"patches": layout.totals.patches, "tabs": layout.totals.tabs}
    answer["sheets"] = [
        {
            "name": each.name,
            "lines": each.lines,
            "cut_m": each.cut_mm / 1000,
            "travel_m": each.travel_mm / 1000,
            "estimated_s": float(each.estimated_s),
            "seconds": each.result.seconds,
            "refused_lines": len(each.result.errors),
            "remarks": list(each.result.remarks),
        }
        for each in done
    ]

    def show() -> None:
        console.facts({key: value for key, value in answer.items() if key != "sheets"})
        console.rows(
            ("sheet", "lines", "burnt m", "travel m", "estimated", "took"),
            [
                (
                    each.name,
                    each.lines,
                    round(each.cut_mm / 1000, 2),
                    round(each.travel_mm / 1000, 2),
                    clock(each.estimated_s),
                    clock(each.result.seconds),
                )
                for each in done
            ],
        )
        for each in done:
            for remark in each.result.remarks:
                console.line(f"{each.name}: {remark}")

    console.answer(answer, show)
    if any(each.result.errors for each in done):
        raise typer.Exit(1)


def clock(seconds: float) -> str:
    """Minutes and seconds, as on a clock."""
    whole = round(seconds)
    return f"{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}"
