"""What a Marlin controller can say, one frozen value a line.

Every command is answered by ``ok``, after whatever it has to say; ``Resend: N`` asks for a line
again and is followed by the ``ok`` that frees the wire for it; ``echo:busy: processing`` says every
two seconds that a command takes long. Sources of the facts: MarlinFirmware/Marlin,
``src/gcode/queue.cpp``, ``src/core/language.h``, ``src/gcode/gcode.cpp`` (host keepalive), and
marlinfw.org, "Serial protocol".
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from miurafab.gcode.job import SendLine


@dataclass(frozen=True, slots=True)
class Reply:
    """Something the controller said; ``text`` is the line."""

    text: str


@dataclass(frozen=True, slots=True)
class MarlinOk(Reply):
    """``ok``: the line in flight was taken; ``line`` is that line, None for one of our own."""

    line: SendLine | None = None


@dataclass(frozen=True, slots=True)
class Resend(Reply):
    """``Resend: 12``: it wants line ``number`` (our count, not the file's)."""

    number: int


@dataclass(frozen=True, slots=True)
class Busy(Reply):
    """``echo:busy: processing``: it is alive and at work."""


@dataclass(frozen=True, slots=True)
class Started(Reply):
    """``start``: it has just started, whatever was before."""


@dataclass(frozen=True, slots=True)
class Killed(Reply):
    """``Error:Printer halted. kill() called!``: motors and laser are off until it is reset."""


@dataclass(frozen=True, slots=True)
class MarlinError(Reply):
    """It did not do what the line in flight says, or has stopped."""


_RESEND = re.compile(r"(?:Resend|rs)\s*:?\s*N?(\d+)", re.IGNORECASE)
_OK = re.compile(r"ok(?![A-Za-z0-9])", re.IGNORECASE)
_BUSY = re.compile(r"(?:echo:\s*)?busy\b", re.IGNORECASE)
_KILLED = re.compile(r"(?:Error:.*(?:kill\(\)|halted))|!!.*(?:KILL|HALT)", re.IGNORECASE)
_WANTS_AGAIN = re.compile(r"Last Line", re.IGNORECASE)
_FAULT = re.compile(
    r"Error:|!!|(?:echo:\s*)?Unknown command|.*stopped due to errors", re.IGNORECASE
)


def parse_reply(text: str) -> Reply:
    """The meaning of one line, without its end. What it does not know is a plain :class:`Reply`."""
    if _OK.match(text):
        return MarlinOk(text)
    resend = _RESEND.match(text)
    if resend is not None:
        return Resend(text, int(resend[1]))
    if _BUSY.match(text):
        return Busy(text)
    if text == "start":
        return Started(text)
    if _KILLED.match(text):
        return Killed(text)
    # A line that came damaged is asked for again in the next words.
    if _FAULT.match(text) and not _WANTS_AGAIN.search(text):
        return MarlinError(text)
    return Reply(text)
