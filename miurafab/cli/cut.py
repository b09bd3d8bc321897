"""``miurafab cut``: make whatever is missing, and stream it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import miurafab
from miurafab.cli.console import Console, JsonOption, QuietOption
from miurafab.cli.sheets import MachineOption, MaterialOption
from miurafab.errors import InputError, MachineError
from miurafab.findings import findings_json, refusals
from miurafab.units import parse_length

if TYPE_CHECKING:
    from miurafab.workflow.cut import Prepared
    from miurafab.workflow.cut_sheets import CutOptions, CutSheet, SheetProgress


def cut(
    thing: Annotated[
        str,
        typer.Argument(help="A job directory, a .nc file, a pattern .fold, a design, or a target."),
    ],
    port: Annotated[
        list[str] | None,
        typer.Option(
            help="A serial device, a pyserial URL (socket://...), or 'virtual'; given more than "
            "once, the machines share the sheets of a job directory."
        ),
    ] = None,
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
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say what would be done; opens no port.")
    ] = False,
    resume: Annotated[
        bool,
        typer.Option(
            "--resume", help="Go on with what was interrupted; needs --home or --at, once stopped."
        ),
    ] = False,
    home: Annotated[bool, typer.Option("--home", help="Home the machine first.")] = False,
    at: Annotated[
        str | None,
        typer.Option(help="Where the head stands, in the job's coordinates: 0,0 is its origin."),
    ] = None,
    frame: Annotated[
        bool, typer.Option("--frame", help="Trace the box around each sheet before it, then wait.")
    ] = False,
    pointer: Annotated[
        float, typer.Option(help="Power of the frame in percent, 5 at most; 0 keeps it dark.")
    ] = 0.0,
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

    On a machine at a port, or on the virtual one. Ctrl-C stops with the beam off. In a terminal,
    space holds, r resumes, q aborts, + - 0 change the feed and ] [ p the power.
    """
    from miurafab.machine.keys import terminal_keys
    from miurafab.workflow.cut_sheets import CutOptions

    console = Console(as_json, quiet)
    options = CutOptions(
        force=frozenset(force or ()),
        allow_m3=allow_m3,
        check_mode=check_mode,
        home=home,
        at=None if at is None else parse_point(at),
        resume=resume,
        frame=frame,
        pointer=pointer / 100,
    )
    if not port and not dry_run:
        raise InputError(
            "Name the machine's --port ('virtual' needs no machine), or ask for --dry-run."
        )
    with console.progress("preparing") as progress:
        prepared = miurafab.prepare(
            thing, machine=machine, material=material, out=out, on_progress=progress
        )
        progress(1.0, "")
    if prepared.refusal is not None:
        _refuse(console, prepared)
    if dry_run:
        _report_dry_run(console, prepared, options)
        return
    assert port is not None
    if len(port) > 1:
        _share(console, prepared, port, sheet, options)
        return
    waits = pause if pause is not None else port[0] != "virtual" and sys.stdin.isatty()
    with _way_on(console, prepared), console.progress("cutting") as bar:

        def show_progress(now: SheetProgress) -> None:
            bar(
                now.stroke / max(now.strokes, 1),
                f"sheet {now.number} of {len(prepared.jobs)}, stroke {now.stroke} of "
                f"{now.strokes}, {clock(now.seconds_left)} left, {now.stream.state}",
            )

        def before(number: int, count: int) -> None:
            if waits and number > 1 and not resume:
                console.remark(
                    f"Sheet {number} of {count}: {_put_in(prepared, number)}, press Enter."
                )
                sys.stdin.readline()

        def after_frame(number: int) -> None:
            if waits:
                console.remark(f"That is the frame of sheet {number}; Enter cuts, Ctrl-C does not.")
                sys.stdin.readline()

        with terminal_keys() as keys:
            done = miurafab.cut(
                prepared,
                port=port[0],
                sheets=sheet,
                options=options,
                keys=keys,
                before_sheet=before,
                after_frame=after_frame,
                on_resume=lambda finding: console.remark(finding.sentence),
                on_progress=show_progress,
            )
    _report(console, prepared, done, port[0])


def parse_point(text: str) -> tuple[float, float]:
    """``X,Y`` in mm or with units, such as ``0,0`` or ``10mm,1in``."""
    parts = text.split(",")
    if len(parts) != 2:
        raise InputError(f"'{text}' is not a point; write X,Y such as 0,0 or 10mm,5mm.")
    x, y = (float(p) if p.strip() in ("0", "0.0") else parse_length(p) for p in parts)
    return x, y


def _share(
    console: Console,
    prepared: Prepared,
    ports: list[str],
    sheet: list[int] | None,
    options: CutOptions,
) -> None:
    """Cut on several machines at once, and say which sheet went where."""
    from miurafab.workflow.multi_machine import share_sheets

    with console.progress("cutting") as bar:
        outcome = share_sheets(prepared, ports, sheet, options, on_progress=bar)
    rows = [(each.sheet, each.port, "done" if each.done else each.why) for each in outcome]
    whole = all(each.done for each in outcome)
    console.answer(
        {
            "status": "done" if whole else "failed",
            "job": prepared.name,
            "sheets": [
                {"sheet": each.sheet, "port": each.port, "done": each.done, "why": each.why}
                for each in outcome
            ],
        },
        lambda: console.rows(("sheet", "port", "what came of it"), rows),
    )
    if not whole:
        raise typer.Exit(3)


def _report_dry_run(console: Console, prepared: Prepared, options: CutOptions) -> None:
    """What would be cut, and what the pre-flight checks say; exit code 1 if they refuse it."""
    from miurafab.machine.preflight import require_known

    require_known(options.force)
    found = [finding for sheet in prepared.dry_runs for finding in sheet.findings]
    passed = options.force | ({"m3"} if options.allow_m3 else set())
    refused = any(finding.code not in passed for finding in refusals(found))
    answer = {
        "status": "refused" if refused else "ready",
        "job": prepared.name,
        "machine": prepared.machine.name,
        "seconds": round(sum(sheet.seconds for sheet in prepared.dry_runs), 3),
        "sheets": [sheet.figures() for sheet in prepared.dry_runs],
        "findings": findings_json(found),
    }

    def show() -> None:
        console.rows(
            ("sheet", "lines", "burnt m", "travel m", "estimated"),
            [
                (
                    each.name,
                    each.lines,
                    round(each.cut_mm / 1000, 2),
                    round(each.travel_mm / 1000, 2),
                    clock(each.seconds),
                )
                for each in prepared.dry_runs
            ],
            title=f"{prepared.name} on {prepared.machine.title}; no port was opened",
        )
        console.findings(found)

    console.answer(answer, show)
    if refused:
        raise typer.Exit(1)


@contextmanager
def _way_on(console: Console, prepared: Prepared) -> Iterator[None]:
    """Say, when a machine has failed in mid-job, how the job is taken up again."""
    from miurafab.workflow.cut_sheets import can_go_on

    try:
        yield
    except MachineError:
        if can_go_on(prepared):
            console.remark(
                "When the machine is ready again, go on with --resume and --home, or --at X,Y for "
                "where the head stands then."
            )
        raise


def _put_in(prepared: Prepared, number: int) -> str:
    """What to do before sheet ``number``, which is not the first."""
    if prepared.jobs[number - 2].name == f"{prepared.jobs[number - 1].name}-back":
        return "turn the sheet over, left to right, and lay it by its three holes"
    return "put in fresh material"


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
            "findings": findings_json(each.findings),
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
            console.findings(each.findings)

    console.answer(answer, show)
    if any(each.result.errors for each in done):
        raise typer.Exit(1)


def clock(seconds: float) -> str:
    """Minutes and seconds, as on a clock."""
    whole = round(seconds)
    return f"{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}"
