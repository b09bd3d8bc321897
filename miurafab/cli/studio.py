"""``miurafab studio``: serve the local web page until Ctrl-C.

What serves it is handed in by :mod:`miurafab.__main__`: the command line does not know the studio.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Annotated, Protocol

import typer

from miurafab.cli.console import Console, JsonOption, QuietOption
from miurafab.workflow.json_text import json_text


class ServeStudio(Protocol):
    """Serves ``thing`` at ``port`` until it is interrupted, and announces the address."""

    def __call__(
        self,
        thing: str | None,
        *,
        port: int,
        open_browser: bool,
        announce: Callable[[str], None],
    ) -> None: ...


def studio(
    context: typer.Context,
    thing: Annotated[
        str | None,
        typer.Argument(
            metavar="FILE|TARGET",
            help="What to begin with: a pattern .fold, a named surface (hypar:height=0.5), a "
            "design .toml or a mesh.",
        ),
    ] = None,
    port: Annotated[
        int,
        typer.Option(
            help="The port on this computer [default: any that is free].", show_default=False
        ),
    ] = 0,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Print the address and open no browser.")
    ] = False,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Serve a page on this computer: from a surface to sheets in the browser.

    The first line printed is its address, which holds a key: only who has it gets in. Ctrl-C ends
    it. Nothing is sent to a machine: the page shows the 'miurafab cut' command to paste.
    """
    console = Console(as_json, quiet)
    serve: ServeStudio = context.obj

    def announce(address: str) -> None:
        sys.stdout.write((json_text({"address": address}) if as_json else address) + "\n")
        sys.stdout.flush()
        console.remark("The studio is open there; Ctrl-C ends it.")

    serve(thing, port=port, open_browser=not no_browser, announce=announce)
