"""``miurafab studio``: serve the local web page until Ctrl-C.

:mod:`miurafab.__main__` hands in what serves it: the command line does not know the studio.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Protocol

from cyclopts import Parameter

from miurafab.cli.console import Console
from miurafab.cli.declared import argument, option
from miurafab.errors import DONE
from miurafab.options import Flag, Whole

EXAMPLES = ("miurafab studio", "miurafab studio hypar:height=0.5 --no-browser")


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
    thing: Annotated[
        str | None,
        argument(
            "FILE|TARGET",
            "What to begin with: a pattern .fold, a named surface (hypar:height=0.5), a design "
            ".toml, a mesh, or a job to cut: a job directory or a G-code file.",
        ),
    ] = None,
    /,
    *,
    serve: Annotated[ServeStudio, Parameter(parse=False)],
    port: Annotated[
        int,
        option(Whole(0, 65535), "The network port on this computer.", default_text="any free port"),
    ] = 0,
    no_browser: Annotated[bool, option(Flag(), "Print the address and open no browser.")] = False,
    console: Console = Console(),
) -> int:
    """Serve a page on this computer: from a surface to sheets, and at the machine.

    The first line printed is the address of the page. It holds a key: nobody gets in without it.
    Ctrl-C ends the studio, and a machine that is connected is left dark. A page connects to a
    machine, and burns a sheet, only when a person there asks for it twice.
    """

    def announce(address: str) -> None:
        console.announce(address)
        console.note("The studio is open there; Ctrl-C ends it.")

    serve(thing, port=port, open_browser=not no_browser, announce=announce)
    return DONE
