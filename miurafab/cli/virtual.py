"""``miurafab virtual``: the virtual controller behind a port, a practice laser for any sender."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from miurafab.cli.console import Console, JsonOption, QuietOption
from miurafab.errors import InputError
from miurafab.simulate.faults import KINDS, parse_faults
from miurafab.workflow.json_text import json_text


def virtual(
    pty: Annotated[
        bool, typer.Option("--pty", help="Serve over a pseudo-terminal [the default].")
    ] = False,
    tcp: Annotated[
        str | None, typer.Option(help="Serve over TCP at HOST:PORT (port 0: any free one).")
    ] = None,
    settings: Annotated[
        str,
        typer.Option(help="'stock', a machine profile, or a file with what $$ answered."),
    ] = "stock",
    speed: Annotated[float, typer.Option(help="Virtual seconds a real second.")] = 1.0,
    beam_log: Annotated[
        Path | None, typer.Option(help="Write what the beam burns to this CSV file.")
    ] = None,
    keep_running: Annotated[
        bool,
        typer.Option(
            "--keep-running", help="Do not reset when a sender opens the port, as most boards do."
        ),
    ] = False,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            help="Let something go wrong: KIND[=VALUE]@WHEN, WHEN being a byte of the sender's or "
            "a time since its first; may be repeated. KIND is one of " + ", ".join(KINDS) + "."
        ),
    ] = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Run a virtual controller for any sender, until Ctrl-C.

    The first line printed is what a sender opens: a path, or a socket:// address. Faults such as
    --fault drop@1200 (a byte is lost), --fault reset@3s or --fault disconnect=2s@1200 show what
    a sender does when things go wrong; docs/machines.md lists them.
    """
    from miurafab.machine.virtual_server import serve_virtual

    if pty and tcp is not None:
        raise InputError("Serve over --pty or over --tcp, not both.")
    console = Console(as_json, quiet)

    def announce(address: str) -> None:
        line = json_text({"address": address}) if as_json else address
        sys.stdout.write(line + "\n")
        sys.stdout.flush()
        console.remark("A virtual controller listens there; Ctrl-C ends it.")

    served = serve_virtual(
        tcp=tcp,
        settings=settings,
        speed=speed,
        beam_log=beam_log,
        reset_on_open=not keep_running,
        faults=parse_faults(fault or ()),
        announce=announce,
    )
    console.remark(
        f"Ran {served.seconds:.1f} s of its own time, beam on for {served.beam_on_seconds:.1f} s, "
        f"{served.lost_bytes} bytes lost."
    )
