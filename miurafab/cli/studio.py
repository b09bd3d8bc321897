"""``miurafab studio``: serve the local web page until Ctrl-C.

:mod:`miurafab.__main__` hands in what serves it: the command line does not know the studio.
"""

from __future__ import annotations

import getpass
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Protocol

from cyclopts import Group, Parameter

from miurafab.cli.console import Console
from miurafab.cli.declared import Named, argument, option
from miurafab.errors import DONE, InputError
from miurafab.files import read_text
from miurafab.options import File, Flag, Text, Whole

EXAMPLES = (
    "miurafab studio",
    "miurafab studio hypar:height=0.5 --no-browser",
)
HOST = Group("Other computers", sort_key=2)


class ServeStudio(Protocol):
    """Serves ``thing`` at ``port`` until it is interrupted, and announces the address and the
    fingerprint of the certificate. ``host``, ``password`` and the certificate are for other
    computers.
    """

    def __call__(
        self,
        thing: str | None,
        *,
        port: int,
        open_browser: bool,
        host: str | None,
        password: str,
        certificate: Path | None,
        certificate_key: Path | None,
        announce: Callable[[str, str], None],
    ) -> None: ...


def studio(
    thing: Annotated[
        Named | None,
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
    host: Annotated[
        str | None,
        option(
            Text("ADDRESS"),
            "Let other computers in: listen at this address of this computer, over TLS, for who "
            "knows a password. It is asked for.",
            group=HOST,
            default_text="this computer only",
        ),
    ] = None,
    password_file: Annotated[
        Path | None,
        option(
            File(),
            "The file whose first line is the password; yours alone (mode 0600).",
            group=HOST,
            default_text="asked for",
        ),
    ] = None,
    certificate: Annotated[
        Path | None,
        option(File(), "The certificate, in PEM.", group=HOST, default_text="one is made"),
    ] = None,
    certificate_key: Annotated[
        Path | None, option(File(), "The key of the certificate, in PEM.", group=HOST)
    ] = None,
    console: Console = Console(),
) -> int:
    """Serve a page on this computer: from a surface to sheets, and at the machine.

    The first line printed is the address of the page. It holds a key: nobody gets in without it.
    Ctrl-C ends the studio, and a machine that is connected is left dark. A page connects to a
    machine, and burns a sheet, only when a person there asks for it twice.
    """

    def announce(address: str, fingerprint: str) -> None:
        if fingerprint:
            console.announce(address, fingerprint=fingerprint)
            console.note(f"The SHA-256 fingerprint of its certificate is {fingerprint}.")
        else:
            console.announce(address)
        console.note("The studio is open there; Ctrl-C ends it.")

    if host is None and (password_file or certificate or certificate_key):
        raise InputError("A password and a certificate are for `host`; give it, too.")
    serve(
        None if thing is None else str(thing),
        port=port,
        open_browser=not no_browser,
        host=host,
        password="" if host is None else _password(password_file),
        certificate=certificate,
        certificate_key=certificate_key,
        announce=announce,
    )
    return DONE


def _password(file: Path | None) -> str:
    """The password of ``file``, or what a person types twice. It stands on no command line."""
    if file is not None:
        text = read_text(file, InputError, "a password")
        if os.name == "posix" and file.stat().st_mode & 0o077:
            raise InputError(
                f"{file} can be read by others on this computer; make it yours alone by "
                f"'chmod 600 {file}'."
            )
        return text.split("\n", 1)[0].strip()
    if not sys.stdin.isatty():
        raise InputError("There is no terminal to ask for the password; give `password_file`.")
    first = getpass.getpass("Password for the studio: ").strip()
    if getpass.getpass("The same again: ").strip() != first:
        raise InputError("The two passwords differ; start again.")
    return first
