"""The replies of a Marlin controller: one frozen value per line that it sends.

Each command is answered by ``ok``, after its other output. ``Resend: N`` asks for a line again; the
``ok`` after it says that the controller is ready for the line. ``echo:busy: processing`` comes
every two seconds during a long command. Sources: MarlinFirmware/Marlin, ``src/gcode/queue.cpp``,
``src/core/language.h``, ``src/gcode/gcode.cpp`` (host keepalive), and marlinfw.org, "Serial
protocol".
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from miurafab.gcode.job import SendLine


@dataclass(frozen=True, slots=True)
class Reply:
    """A line from the controller, as ``text``."""

    text: str


@dataclass(frozen=True, slots=True)
class MarlinOk(Reply):
    """``ok``: the controller took the ``line`` in flight, None if there was none."""

    line: SendLine | None = None


@dataclass(frozen=True, slots=True)
class Resend(Reply):
    """``Resend: 12``: the controller asks for the line ``number`` (not the number in the file)."""

    number: int


@dataclass(frozen=True, slots=True)
class Started(Reply):
    """``start``: the controller has just started."""


@dataclass(frozen=True, slots=True)
class Killed(Reply):
    """``Error:Printer halted. kill() called!``: motors and laser are off until a reset."""


@dataclass(frozen=True, slots=True)
class MarlinError(Reply):
    """The controller did not execute the line in flight, or has stopped."""


_RESEND = re.compile(r"(?:Resend|rs)\s*:?\s*N?(\d{1,9})", re.IGNORECASE)
_OK = re.compile(r"ok(?![A-Za-z0-9])", re.IGNORECASE)
_KILLED = re.compile(r"(?:Error:.*(?:kill\(\)|halted))|!!.*(?:KILL|HALT)", re.IGNORECASE)
_WANTS_AGAIN = re.compile(r"Last Line", re.IGNORECASE)
_FAULT = re.compile(
    r"Error:|!!|(?:echo:\s*)?Unknown command|.*stopped due to errors", re.IGNORECASE
)


def parse_reply(text: str) -> Reply:
    """The reply of a line, which has no line end; an unknown line is a plain :class:`Reply`."""
    if _OK.match(text):
        return MarlinOk(text)
    resend = _RESEND.match(text)
    if resend is not None:
        return Resend(text, int(resend[1]))
    if text == "start":
        return Started(text)
    if _KILLED.match(text):
        return Killed(text)
    # A damaged line is not an error yet: the controller asks for it again in its next line.
    if _FAULT.match(text) and not _WANTS_AGAIN.search(text):
        return MarlinError(text)
    return Reply(text)
