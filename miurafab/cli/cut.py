"""``miurafab cut``: make whatever is missing, and stream it."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from miurafab.cli.console import Console
from miurafab.cli.declared import MachineOption, MaterialOption, argument, option, split, takes
from miurafab.cli.fit import RigidOption, bed_options, fit_options
from miurafab.cli.machine import PORT
from miurafab.errors import (
    DONE,
    MACHINE_FAILED,
    NO,
    WAITING,
    InputError,
    MachineError,
    OptionError,
    PersonNeeded,
)
from miurafab.findings import findings_json
from miurafab.options import File, Flag, Text, Whole, read_options
from miurafab.profiles.own import own_defaults

if TYPE_CHECKING:
    from miurafab.machine.keys import Keys
    from miurafab.workflow.cut import Prepared
    from miurafab.workflow.cut_options import CutOptions
    from miurafab.workflow.cut_sheets import CutSheet
    from miurafab.workflow.timeline import SheetProgress

_LOOK_S = 0.05  # between two looks at the keyboard
EXAMPLES = (
    "miurafab cut jobs/hypar --port /dev/ttyUSB0 --frame",
    "miurafab cut hypar:height=0.5 --facets 8x8 --size 150mm --port virtual",
    "miurafab cut jobs/hypar --dry-run",
)


PortsOption = Annotated[
    list[str] | None,
    option(Text("PORT"), f"{PORT} May be repeated: the machines share the sheets of a job."),
]
PauseOption = Annotated[
    bool | None,
    option(
        Flag(),
        "Wait for a person to put in fresh material before each further sheet, and to look at each "
        "frame; without a terminal the command ends there with exit code 5.",
        "--pause",
        default_text="yes, but for the virtual machine and a machine with roll_fed",
        negative="--no-pause",
    ),
]


def cut_options() -> type[CutOptions]:
    """The class that declares how sheets are sent."""
    from miurafab.workflow.cut_options import CutOptions

    return CutOptions


@takes(cut_options, fit_options, bed_options)
def cut(
    thing: Annotated[
        str | Path,
        argument("THING", "A job directory, a .nc file, a pattern .fold, a design, or a target."),
    ],
    /,
    *,
    port: PortsOption = None,
    machine: MachineOption = None,
    material: MaterialOption = None,
    out: Annotated[
        Path | None,
        option(
            File("FOLDER"), "The job directory to make.", "-o", "--out", default_text="jobs/NAME"
        ),
    ] = None,
    sheet: Annotated[
        list[int] | None, option(Whole(1), "Cut only this sheet, from 1. May be repeated.")
    ] = None,
    dry_run: Annotated[
        bool, option(Flag(), "Say what would be done, without opening a port.")
    ] = False,
    pause: PauseOption = None,
    rigid: RigidOption = False,
    console: Console = Console(),
    **given: str,
) -> int:
    """Cut a job, making whatever is missing on the way.

    Cuts on a machine at a port, or on the virtual machine. Ctrl-C stops with the beam off. In a
    terminal, space holds, r resumes, q aborts, + - 0 change the feed and ] [ p the power. The
    options of a fit are for a target or a design.
    """
    options, fitting = _read(given, rigid)
    if not port and not dry_run and (own := own_defaults().port):
        port = [own]
    if not port and not dry_run:
        raise InputError(
            "Name the machine's `port` ('virtual' needs no machine; 'miurafab use' names it once), "
            "or ask for `dry_run`."
        )
    from miurafab.machine.transport import require_port
    from miurafab.workflow.cut import prepare

    if port:
        require_port(*port)
    with console.progress("preparing") as progress:
        prepared = prepare(
            thing,
            machine=machine,
            material=material,
            out=out,
            options=fitting,
            unread=options.unread,
            on_progress=progress,
        )
        progress(1.0, "")
    if prepared.refused:
        return _refuse(console, prepared)
    if not port or dry_run:
        return _report_dry_run(console, prepared, sheet, options)
    if len(port) > 1:
        return _share(console, prepared, port, sheet, options, pause)
    done = _stream(console, prepared, port[0], sheet, options, pause)
    return _report(console, prepared, done, port[0])


def _read(given: dict[str, str], rigid: bool) -> tuple[CutOptions, dict[str, str]]:
    """How sheets are sent, and the options of a fit."""
    own, fitting = split(given, cut_options())
    options: CutOptions = read_options(cut_options(), own)
    if options.pointer and not options.frame:
        raise OptionError(
            "pointer", "is the beam power while a frame is traced; ask for the `frame` as well"
        )
    return options, fitting | ({"flat_foldable": "exact"} if rigid else {})


def _stream(
    console: Console,
    prepared: Prepared,
    port: str,
    sheet: list[int] | None,
    options: CutOptions,
    pause: bool | None,
) -> tuple[CutSheet, ...]:
    """Cut on one machine, with a progress bar and the keys of the terminal."""
    from miurafab.machine.keys import terminal_keys
    from miurafab.workflow.cut_sheets import cut_prepared
    from miurafab.workflow.dry_run import clock_text
    from miurafab.workflow.material_change import wanted

    burnt: int | None = None

    def before(number: int, count: int) -> None:
        request = f"Sheet {number} of {count}: {wanted(prepared, number, burnt)}, press Enter."
        _wait(console, keys, request)

    def after_frame(number: int) -> None:
        request = f"That is the frame of sheet {number}; Enter cuts, Ctrl-C does not."
        _wait(console, keys, request)

    attended = sys.stdin.isatty()
    asks = pause if pause is not None else port != "virtual" and attended

    with _hint_at_resume(console, prepared), console.progress("cutting") as bar:

        def show_progress(now: SheetProgress) -> None:
            nonlocal burnt
            burnt = now.number
            bar(
                now.share,
                f"sheet {now.number} of {len(prepared.jobs)}, stroke {now.stroke} of "
                f"{now.strokes}, {clock_text(now.seconds_left)} left, {now.stream.state}"
                + (f", {words}" if (words := now.stream.overrides.words) else ""),
            )

        with terminal_keys() as keys:
            return cut_prepared(
                prepared,
                port=port,
                sheets=sheet,
                options=options,
                keys=keys,
                pause=pause,
                before_sheet=before if attended or pause else None,
                after_frame=after_frame if asks else None,
                on_start=lambda finding: console.note(finding.sentence),
                on_progress=show_progress,
            )


def _share(
    console: Console,
    prepared: Prepared,
    ports: list[str],
    sheet: list[int] | None,
    options: CutOptions,
    pause: bool | None,
) -> int:
    """Cut on several machines at once, and say which sheet went where."""
    from miurafab.machine.keys import NoKeys, terminal_keys
    from miurafab.workflow.material_change import WAITS, wanted
    from miurafab.workflow.multi_machine import share_sheets

    with console.progress("cutting") as bar, terminal_keys() as keys:

        def before(number: int, port: str, over: Callable[[], bool]) -> bool:
            keys.pressed()  # what was typed before is no answer
            console.note(
                f"Sheet {number} of {len(prepared.jobs)} at {port}: {wanted(prepared, number)} "
                "there, press Enter."
            )
            while not {"\n", "\r"} & set(keys.pressed()):
                if over():
                    return False
                time.sleep(_LOOK_S)
            return True

        outcome = share_sheets(
            prepared,
            ports,
            sheet,
            options,
            pause=pause,
            before_sheet=None if isinstance(keys, NoKeys) else before,
            on_start=lambda port, finding: console.note(f"{port}: {finding.sentence}"),
            on_progress=bar,
        )
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
    if whole:
        return DONE
    return WAITING if all(each.done or each.why == WAITS for each in outcome) else MACHINE_FAILED


def _report_dry_run(
    console: Console, prepared: Prepared, sheet: list[int] | None, options: CutOptions
) -> int:
    """Say what would be cut, and what the pre-flight checks find; no if they refuse it."""
    from miurafab.machine.preflight import require_known
    from miurafab.workflow.alignment import draw
    from miurafab.workflow.dry_run import clock_text
    from miurafab.workflow.sheet_plans import rehearsed

    require_known(options.send.force)
    prepared, status, notes = rehearsed(prepared, sheet, options)
    page = draw(prepared)
    of_sheets = (finding for sheet in prepared.dry_runs for finding in sheet.findings)
    findings = [*notes, *prepared.findings, *of_sheets]
    answer = {
        "status": status,
        "job": prepared.name,
        "machine": prepared.machine.name,
        "seconds": round(sum(sheet.seconds for sheet in prepared.dry_runs), 3),
        "sheets": [sheet.figures() for sheet in prepared.dry_runs],
        "findings": findings_json(findings),
    } | ({} if page is None else {"page": str(page)})

    def show() -> None:
        console.rows(
            ("sheet", "lines", "burnt m", "travel m", "estimated"),
            [
                (
                    each.name,
                    each.lines,
                    round(each.cut_mm / 1000, 2),
                    round(each.travel_mm / 1000, 2),
                    clock_text(each.seconds),
                )
                for each in prepared.dry_runs
            ],
            title=f"{prepared.name} on {prepared.machine.title}; no port was opened",
        )
        console.findings(findings)
        if page is not None:
            console.line(f"Open {page} in a browser: the sheet where it would be cut.")

    console.answer(answer, show)
    return NO if status == "refused" else DONE


@contextmanager
def _hint_at_resume(console: Console, prepared: Prepared) -> Iterator[None]:
    """Say, when a machine has failed in mid-job, how the job is taken up again."""
    from miurafab.workflow.sheet_plans import can_go_on

    try:
        yield
    except MachineError:
        if can_go_on(prepared):
            console.note(
                "When the machine is ready again, continue with --resume and --home, or with --at "
                "X,Y, the position of the head then."
            )
        raise


def _wait(console: Console, keys: Keys, request: str) -> None:
    """Ask for Enter; what was typed before is no answer, and the end of the input is nobody's."""
    from miurafab.machine.keys import NoKeys

    keys.pressed()
    console.note(request)
    if not isinstance(keys, NoKeys):
        while not {"\n", "\r"} & set(keys.pressed()):
            time.sleep(_LOOK_S)
    elif not sys.stdin.readline():
        raise PersonNeeded("Nobody pressed Enter, and the input has ended; nothing more was cut.")


def _refuse(console: Console, prepared: Prepared) -> int:
    advice = " ".join(finding.sentence for finding in prepared.refused)
    console.answer(
        {
            "status": "refused",
            "advice": advice,
            "findings": findings_json(prepared.refused),
            "report": prepared.report,
        },
        lambda: console.line(f"{prepared.name} is not cut: {advice}"),
    )
    return NO


def _report(console: Console, prepared: Prepared, done: tuple[CutSheet, ...], port: str) -> int:
    from miurafab.workflow.dry_run import clock_text

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
            "refusals": [
                {"line": refused.line.number, "text": str(refused)}
                for refused in each.result.errors
            ],
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
                    clock_text(each.estimated_s),
                    clock_text(each.result.seconds),
                )
                for each in done
            ],
        )
        for each in done:
            for refused in each.result.errors:
                console.line(f"{each.name}, {refused}")
            console.findings(each.findings)

    console.answer(answer, show)
    return NO if any(each.result.errors for each in done) else DONE
