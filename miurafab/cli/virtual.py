"""``miurafab virtual``: the virtual controller behind a port, a practice laser for any sender."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from miurafab.cli.console import Console
from miurafab.cli.declared import option
from miurafab.errors import DONE, InputError
from miurafab.options import Choice, File, Flag, Text, number
from miurafab.simulate.faults import KINDS, parse_faults

EXAMPLES = (
    "miurafab virtual --pty",
    "miurafab virtual --tcp localhost:2323 --settings grbl-laser-400 --speed 20",
)


def virtual(
    *,
    pty: Annotated[bool, option(Flag(), "Serve over a pseudo-terminal, as without --tcp.")] = False,
    tcp: Annotated[
        str | None,
        option(Text("HOST:PORT"), "Serve over TCP at this address (port 0: any free port)."),
    ] = None,
    settings: Annotated[
        str,
        option(
            Text("SETTINGS"),
            "The firmware's settings: 'stock' (its own defaults), a machine profile, or a file "
            "with what '$$' printed.",
        ),
    ] = "stock",
    speed: Annotated[float, option(number(0, above=True), "Virtual seconds a real second.")] = 1.0,
    beam_log: Annotated[
        Path | None, option(File(), "Write what the beam burns to this CSV file.")
    ] = None,
    reset_on_open: Annotated[
        str,
        option(
            Choice(("edge", "always", "never")),
            "When the opening of the port resets the controller: at an edge of the line DTR, as on "
            "most boards (a sender that leaves the line up makes none), always, or never.",
        ),
    ] = "edge",
    silent_greeting: Annotated[
        bool, option(Flag(), "Say no banner at a start, as some boards do.")
    ] = False,
    fault: Annotated[
        list[str] | None,
        option(
            Text("KIND[=VALUE]@WHEN"),
            "Let something go wrong. WHEN is a byte of the sender's, or a time since its first "
            f"byte. KIND is one of {', '.join(KINDS)}. May be repeated.",
        ),
    ] = None,
    console: Console = Console(),
) -> int:
    """Run a virtual controller for any sender, until Ctrl-C.

    The first line printed is what a sender opens: a path, or a socket:// address. Faults show what
    a sender does when things go wrong: --fault drop@1200 loses a byte, --fault reset@3s resets.
    """
    from miurafab.machine.virtual_server import serve_virtual

    if pty and tcp is not None:
        raise InputError("Serve over --pty or over --tcp, not both.")

    def announce(address: str) -> None:
        console.announce(address)
        console.note("A virtual controller listens there; Ctrl-C ends it.")

    served = serve_virtual(
        tcp=tcp,
        settings=settings,
        speed=speed,
        beam_log=beam_log,
        reset_on_open=reset_on_open,
        greets=not silent_greeting,
        faults=parse_faults(fault or ()),
        announce=announce,
    )
    console.note(
        f"Ran {served.seconds:.1f} s of its own time, beam on for {served.beam_on_seconds:.1f} s, "
        f"{served.lost_bytes} bytes lost."
    )
    return DONE
