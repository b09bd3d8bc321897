"""``miurafab machine ACTION``: look at a machine, keep its settings, home, unlock, move it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from miurafab.cli import open_session
from miurafab.cli.console import Console
from miurafab.cli.declared import MachineOption, Named, argument, option, takes
from miurafab.errors import DONE
from miurafab.findings import findings_json
from miurafab.options import Flag, Text, Whole, declared, feed, length, read_options
from miurafab.profiles.machine import Controller

if TYPE_CHECKING:
    from miurafab.machine.actions import LineOptions
    from miurafab.machine.known_controller import MachineState

PORT = "A serial device, a pyserial URL (socket://HOST:PORT), or 'virtual'."

_BAUD, _WAIT, _RESET = (declared(Controller)[name] for name in ("baud", "wait", "reset"))


@Parameter(name="*")
@dataclass(frozen=True)
class Line:
    """The line to a controller: the options that all actions with a port share."""

    port: Annotated[str, option(Text("PORT"), PORT)]
    baud: Annotated[int, option(_BAUD.kind, _BAUD.help)] = _BAUD.default
    wait: Annotated[float, option(_WAIT.kind, _WAIT.help)] = _WAIT.default
    reset: Annotated[bool, option(_RESET.kind, _RESET.help)] = _RESET.default

    def options(self, console: Console) -> LineOptions:
        """The options of a conversation; ``console`` says if the opening of the port reset the
        board, and what that undid.
        """

        def tell() -> None:
            from miurafab.machine.greeting import RESTARTED

            console.note(
                f"The opening of {self.port} {RESTARTED}. A board that every opening restarts "
                "forgets what this command did too; 'miurafab cut --home' homes and cuts in one "
                "conversation."
            )

        return {
            "baud": self.baud,
            "wait": self.wait,
            "reset": self.reset,
            "on_restart": tell,
        }


def list_(*, console: Console = Console()) -> int:
    """List the serial ports of this computer."""
    from miurafab.machine.transport import list_ports

    ports = list_ports()
    console.answer(
        {"ports": [{"device": device, "description": text} for device, text in ports]},
        lambda: console.rows(("port", "what it is"), ports) if ports else console.line("No ports."),
    )
    return DONE


def info(*, line: Line, console: Console = Console()) -> int:
    """Say what the controller is and what state it is in."""
    from miurafab.machine import actions

    console.answer(asdict(actions.machine_info(line.port, **line.options(console))))
    return DONE


def settings(*, line: Line, console: Console = Console()) -> int:
    """Show the controller's settings with their names."""
    from miurafab.grbl.codes import setting_codes
    from miurafab.machine import actions

    texts = actions.read_settings(line.port, **line.options(console)).texts
    codes = setting_codes()
    rows = [
        (f"${number}", text, codes[number].unit, codes[number].name)
        if number in codes
        else (f"${number}", text, "", "")
        for number, text in texts.items()
    ]
    console.answer(
        {"settings": {f"${number}": text for number, text in texts.items()}},
        lambda: console.rows(("setting", "value", "unit", "what it is"), rows),
    )
    return DONE


def backup(
    file: Annotated[Path, argument("FILE", "The file to write.")],
    /,
    *,
    line: Line,
    console: Console = Console(),
) -> int:
    """Save the controller's settings to a file, as '$$' prints them."""
    from miurafab.files import write_text
    from miurafab.machine import actions

    read = actions.read_settings(line.port, **line.options(console))
    write_text(file, read.dump())
    console.answer({"file": str(file), "settings": len(read.texts)})
    return DONE


def restore(
    file: Annotated[Path, argument("FILE", "A file that 'miurafab machine backup' wrote.")],
    /,
    *,
    line: Line,
    console: Console = Console(),
) -> int:
    """Write the settings of a saved file that differ, and read them back."""
    from miurafab.machine import actions

    changed = actions.write_settings(line.port, actions.read_dump(file), **line.options(console))
    console.answer(
        {"changed": {f"${number}": text for number, text in changed.items()}},
        lambda: (
            console.rows(("setting", "now"), [(f"${n}", t) for n, t in changed.items()])
            if changed
            else console.line("The controller has these settings already.")
        ),
    )
    return DONE


def home(*, line: Line, console: Console = Console()) -> int:
    """Run the homing cycle."""
    from miurafab.machine import actions

    return _answer_state(console, actions.home(line.port, **line.options(console)))


def unlock(*, line: Line, console: Console = Console()) -> int:
    """Unlock the controller after an alarm, without homing."""
    from miurafab.machine import actions

    return _answer_state(console, actions.unlock(line.port, **line.options(console)))


def jog(
    *,
    x: Annotated[float | None, option(length(-1e6), "Distance along X, as 10mm or -0.5in.")] = None,
    y: Annotated[float | None, option(length(-1e6), "Distance along Y.")] = None,
    speed: Annotated[float, option(feed(), "The feed of the move, mm/min.", "--feed")] = 1000.0,
    to: Annotated[
        bool, option(Flag(), "Absolute move: X and Y are coordinates, not distances.")
    ] = False,
    line: Line,
    console: Console = Console(),
) -> int:
    """Move the machine with the beam off."""
    from miurafab.machine import actions

    state = actions.jog(
        line.port, x=x, y=y, feed_mm_min=speed, absolute=to, **line.options(console)
    )
    return _answer_state(console, state)


def _frame_options() -> type:
    from miurafab.workflow.cut_options import CutOptions

    return CutOptions


_NO_FRAME = ("check_mode", "resume", "frame", "from_stroke", "allow_m3", "force")


@takes(_frame_options, without=_NO_FRAME)
def frame(
    thing: Annotated[Named, argument("THING", "A job directory or a G-code file.")],
    /,
    *,
    port: Annotated[
        list[str],
        option(Text("PORT"), f"{PORT} May be repeated: the machines trace the frame in turn."),
    ],
    sheet: Annotated[int, option(Whole(1), "The sheet of a job directory, from 1.")] = 1,
    machine: MachineOption = None,
    console: Console = Console(),
    **given: str,
) -> int:
    """Trace the box around what a sheet burns, with the beam off or as a pointer."""
    from miurafab.workflow import cut_sheets
    from miurafab.workflow.alignment import align
    from miurafab.workflow.cut import prepare
    from miurafab.workflow.cut_options import CutOptions

    options = read_options(CutOptions, given)
    prepared = align(prepare(thing, machine=machine), [sheet], options.align)
    options = replace(options, align=())  # it lies there now
    found = () if prepared.aligned is None else (prepared.aligned.finding,)
    for finding in found:
        console.note(finding.sentence)
    for each in port:
        if len(port) > 1:
            console.note(f"Tracing the frame at {each}.")
        cut_sheets.frame(prepared, sheet, port=each, options=options)
    console.answer(
        {
            "sheet": prepared.dry_runs[sheet - 1].name,
            "bounds_mm": prepared.dry_runs[sheet - 1].bounds_mm,
            "pointer_percent": 100 * options.pointer,
            "ports": port,
        }
        | ({"findings": findings_json(found)} if found else {})
    )
    return DONE


def talk(*, line: Line, console: Console = Console()) -> int:
    """Talk to the controller line by line, until the end of the input (Ctrl-D).

    A line with ?, ! or ~ alone is sent at once; 'reset' resets the controller. At the end the
    controller is reset unless it is idle with the beam off.
    """
    from miurafab.machine import actions

    said: list[str] = []
    tell = said.append if console.wants_json else console.line
    actions.talk(line.port, sys.stdin, tell, **line.options(console))
    if console.wants_json:
        console.answer({"said": said})
    return DONE


HELP = "Look at a machine, keep its settings, home, unlock or move it."
ACTIONS: dict[str, tuple[Callable[..., int], tuple[str, ...]]] = {
    "open": (open_session.open_, open_session.EXAMPLES),
    "list": (list_, ("miurafab machine list",)),
    "info": (info, ("miurafab machine info --port virtual",)),
    "settings": (settings, ("miurafab machine settings --port virtual",)),
    "backup": (backup, ("miurafab machine backup saved.txt --port virtual",)),
    "restore": (restore, ("miurafab machine restore saved.txt --port virtual",)),
    "home": (home, ("miurafab machine home --port /dev/ttyUSB0",)),
    "unlock": (unlock, ("miurafab machine unlock --port virtual",)),
    "jog": (jog, ("miurafab machine jog --x 10mm --y -5mm --port virtual",)),
    "frame": (frame, ("miurafab machine frame jobs/hypar --port virtual",)),
    "console": (talk, ("miurafab machine console --port virtual",)),
}
"""Each action with its examples."""


def _answer_state(console: Console, state: MachineState) -> int:
    answer: dict[str, Any] = {
        "state": state.state,
        "machine_position": state.machine_position,
        "work_position": state.position,
        "beam_off": state.beam_off,
    }
    console.answer({name: value for name, value in answer.items() if value is not None})
    return DONE
