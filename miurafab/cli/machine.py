"""``miurafab machine ACTION``: look at a machine, keep its settings, home, unlock, move it."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from miurafab.cli.console import Console, JsonOption, QuietOption
from miurafab.cli.sheets import MachineOption
from miurafab.units import parse_feed, parse_length

if TYPE_CHECKING:
    from miurafab.grbl.events import StatusReport

app = typer.Typer(
    no_args_is_help=True, help="Look at a machine, keep its settings, home, unlock or move it."
)

PortOption = Annotated[
    str, typer.Option("--port", help="A serial device, a pyserial URL (socket://...), 'virtual'.")
]
BaudOption = Annotated[int, typer.Option("--baud", help="The speed of a serial line.")]


@app.command("list")
def list_(as_json: JsonOption = False, quiet: QuietOption = False) -> None:
    """List the serial ports of this computer."""
    from miurafab.machine.transport import list_ports

    console = Console(as_json, quiet)
    ports = list_ports()
    console.answer(
        {"ports": [{"device": device, "description": text} for device, text in ports]},
        lambda: console.rows(("port", "what it is"), ports) if ports else console.line("No ports."),
    )


@app.command()
def info(
    port: PortOption,
    baud: BaudOption = 115_200,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Say what the controller is and how it stands."""
    from miurafab.machine import actions

    Console(as_json, quiet).answer(asdict(actions.machine_info(port, baud=baud)))


@app.command()
def settings(
    port: PortOption,
    baud: BaudOption = 115_200,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Show the controller's settings with their names."""
    from miurafab.grbl.codes import setting_codes
    from miurafab.machine import actions

    console = Console(as_json, quiet)
    found = actions.read_settings(port, baud=baud)
    codes = setting_codes()
    rows = [
        (f"${number}", text, codes[number].unit, codes[number].name)
        if number in codes
        else (f"${number}", text, "", "")
        for number, text in found.texts.items()
    ]
    console.answer(
        {"settings": {f"${number}": text for number, text in found.texts.items()}},
        lambda: console.rows(("setting", "value", "unit", "what it is"), rows),
    )


@app.command()
def backup(
    file: Annotated[Path, typer.Argument(help="The file to write.")],
    port: PortOption,
    baud: BaudOption = 115_200,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Save the controller's settings to a file, as $$ prints them."""
    from miurafab.machine import actions

    found = actions.read_settings(port, baud=baud)
    file.write_text(found.dump(), encoding="ascii", newline="\n")
    Console(as_json, quiet).answer({"file": str(file), "settings": len(found.texts)})


@app.command()
def restore(
    file: Annotated[Path, typer.Argument(help="A file that 'backup' wrote.")],
    port: PortOption,
    baud: BaudOption = 115_200,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Write the settings of a saved file that differ, and read them back."""
    from miurafab.machine import actions

    console = Console(as_json, quiet)
    changed = actions.write_settings(port, actions.read_dump(file), baud=baud)
    console.answer(
        {"changed": {f"${number}": text for number, text in changed.items()}},
        lambda: (
            console.rows(("setting", "now"), [(f"${n}", t) for n, t in changed.items()])
            if changed
            else console.line("The controller has these settings already.")
        ),
    )


@app.command()
def home(
    port: PortOption,
    baud: BaudOption = 115_200,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Run the homing cycle."""
    from miurafab.machine import actions

    _stands(Console(as_json, quiet), actions.home(port, baud=baud))


@app.command()
def unlock(
    port: PortOption,
    baud: BaudOption = 115_200,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Open the lock that an alarm left, without homing."""
    from miurafab.machine import actions

    _stands(Console(as_json, quiet), actions.unlock(port, baud=baud))


@app.command()
def jog(
    port: PortOption,
    x: Annotated[str | None, typer.Option(help="How far along X, such as 10mm or -0.5in.")] = None,
    y: Annotated[str | None, typer.Option(help="How far along Y.")] = None,
    feed: Annotated[str, typer.Option(help="How fast.")] = "1000mm/min",
    to: Annotated[bool, typer.Option("--to", help="Move to X and Y, not by them.")] = False,
    baud: BaudOption = 115_200,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Move the machine with the beam off."""
    from miurafab.machine import actions

    report = actions.jog(
        port,
        x=None if x is None else parse_length(x),
        y=None if y is None else parse_length(y),
        feed_mm_min=parse_feed(feed),
        absolute=to,
        baud=baud,
    )
    _stands(Console(as_json, quiet), report)


@app.command()
def frame(
    thing: Annotated[str, typer.Argument(help="A job directory or a G-code file.")],
    port: Annotated[
        list[str],
        typer.Option(
            help="A serial device, a pyserial URL (socket://...), 'virtual'; given more than once, "
            "the machines trace it in turn."
        ),
    ],
    sheet: Annotated[int, typer.Option(help="The sheet of a job directory, from 1.")] = 1,
    pointer: Annotated[
        float, typer.Option(help="Power in percent, 5 at most; 0 keeps the beam off.")
    ] = 0.0,
    machine: MachineOption = None,
    home: Annotated[bool, typer.Option("--home", help="Home the machine first.")] = False,
    at: Annotated[
        str | None, typer.Option(help="Where the head stands, in the job's coordinates.")
    ] = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Trace the box around what a sheet burns, with the beam off or as a pointer."""
    import miurafab
    from miurafab.cli.cut import parse_point
    from miurafab.workflow import cut_sheets

    prepared = miurafab.prepare(thing, machine=machine)
    options = cut_sheets.CutOptions(
        home=home, at=None if at is None else parse_point(at), pointer=pointer / 100
    )
    console = Console(as_json, quiet)
    for each in port:
        if len(port) > 1:
            console.remark(f"Tracing the frame at {each}.")
        cut_sheets.frame(prepared, sheet, port=each, options=options)
    console.answer(
        {
            "sheet": prepared.dry_runs[sheet - 1].name,
            "bounds_mm": prepared.dry_runs[sheet - 1].bounds_mm,
            "pointer_percent": pointer,
            "ports": port,
        }
    )


@app.command()
def console(
    port: PortOption,
    baud: BaudOption = 115_200,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Talk to the controller line by line, until the end of the input (Ctrl-D).

    ?, ! and ~ alone on a line are sent at once, 'reset' resets. The controller is reset at the
    end unless it stands idle with the beam off.
    """
    from miurafab.machine import actions

    out = Console(as_json, quiet)
    said: list[str] = []
    actions.talk(port, sys.stdin, said.append if as_json else out.line, baud=baud)
    if as_json:
        out.answer({"said": said})


def _stands(console: Console, report: StatusReport) -> None:
    answer: dict[str, Any] = {
        "state": report.state,
        "machine_position": report.machine_position,
        "work_position": report.work_position,
        "beam_off": report.beam_off,
    }
    console.answer({name: value for name, value in answer.items() if value is not None})
