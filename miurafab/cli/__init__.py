"""The command line: one module a command, each of which parses, calls one library function, prints.

Exit codes: 0 done, 1 the answer is no, 2 bad input or usage, 3 the machine or port failed. An
error is one sentence on standard error, and with ``--json`` an object ``{"error": ...}`` as well.
"""

from __future__ import annotations

import os
import sys
from typing import Annotated, NoReturn

import typer

from miurafab.cli import (
    calibrate,
    check,
    convert,
    cut,
    doctor,
    energy,
    fit,
    fold,
    machine,
    preview,
    profiles,
    sheets,
    studio,
    surfaces,
    tradeoff,
    virtual,
)
from miurafab.errors import MiurafabError, spell_options
from miurafab.version import __version__
from miurafab.workflow.json_text import json_text

app = typer.Typer(
    name="miurafab",
    help="From a curved surface to a folded origami shell, cut on a real machine.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.command("surfaces")(surfaces.surfaces)
app.command("fit")(fit.fit)
app.command("check")(check.check)
app.command("fold")(fold.fold)
app.command("convert")(convert.convert)
app.command("energy")(energy.energy)
app.command("tradeoff")(tradeoff.tradeoff)
app.command("sheets")(sheets.sheets)
app.command("preview")(preview.preview)
app.command("cut")(cut.cut)
app.add_typer(machine.app, name="machine")
app.command("virtual")(virtual.virtual)
app.command("profiles")(profiles.profiles)
app.add_typer(profiles.materials, name="materials")
app.command("studio")(studio.studio)
app.command("calibrate")(calibrate.calibrate)
app.command("doctor")(doctor.doctor)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"miurafab {__version__}")
        raise typer.Exit


@app.callback()
def _program(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_show_version, is_eager=True, help="Show the version and exit."
        ),
    ] = False,
) -> None:
    pass


def main(serve_studio: studio.ServeStudio) -> NoReturn:
    """Run the command line on ``sys.argv`` and exit; ``serve_studio`` serves the web page."""
    try:
        app(obj=serve_studio)
    except MiurafabError as error:
        _fail(_spelt(error), type(error).__name__, error.exit_code)
    except OSError as error:
        told = error.__context__
        while told is not None and not isinstance(told, MiurafabError):
            told = told.__context__
        if told is not None:  # the terminal went away while this was being shown
            _fail(_spelt(told), type(told).__name__, told.exit_code)
        where = f"{error.filename}: " if error.filename else ""
        _fail(f"{where}{error.strerror or error}.", type(error).__name__, 2)
    sys.exit(0)


def _spelt(error: MiurafabError) -> str:
    return spell_options(error.sentence, lambda name: "--" + name.replace("_", "-"))


def _fail(sentence: str, kind: str, exit_code: int) -> NoReturn:
    try:
        if "--json" in sys.argv:
            sys.stdout.write(json_text({"error": sentence, "kind": kind}) + "\n")
            sys.stdout.flush()
        sys.stderr.write(f"miurafab: {sentence}\n")
    except OSError:  # nobody is there to read it; the exit code still says it
        os._exit(exit_code)
    sys.exit(exit_code)
