"""A job: a named text, and its lines as they go down the wire.

The controller acts on some bytes wherever they stand, even in comments: ``!`` holds, ``?`` asks for
a report, ``~`` resumes, 0x18 resets, and each byte from 0x80 up is a command or noise (GRBL 1.1
``serial.c``). It drops what a line has beyond its line buffer. So each line is reduced to its
printable code without comments and blanks. A line that still holds such a byte, or is too long, is
an error that names the line. No line is skipped or changed in meaning.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

from miurafab.errors import GcodeError

_LINES = re.compile(r"([^\r\n]*)(?:\r\n|\n|\r|$)")
# As the controller reads them: "(" up to ")" or the line's end, or ";" to the line's end.
_COMMENTS = re.compile(r"\([^)]*\)?|;.*", re.DOTALL)
_FORBIDDEN = re.compile(r"[^!-~]|[!?~]")
_PROGRAM_NUMBER = re.compile(r"[oO]\d+")
_REALTIME = {"!": "the feed hold", "?": "the status query", "~": "the cycle start"}


@dataclass(frozen=True, slots=True)
class SendLine:
    """A line as it is sent: its 1-based ``number`` in the file and its ``data``, printable ASCII
    without the newline.
    """

    number: int
    data: bytes


@dataclass(frozen=True)
class Job:
    """A program to send: ``name`` stands in messages, ``text`` is the whole file."""

    name: str
    text: str

    @cached_property
    def sha256(self) -> str:
        """The SHA-256 of the text, in hexadecimal."""
        return hashlib.sha256(self.text.encode("utf-8")).hexdigest()

    @property
    def line_count(self) -> int:
        """The number of lines in the file."""
        text = self.text
        ends = text.count("\n") + text.count("\r") - text.count("\r\n")
        return ends + bool(text and not text.endswith(("\n", "\r")))

    def iter_lines(self) -> Iterator[str]:
        """The lines without their ends (LF, CR or CRLF), lazily, so that memory holds one copy."""
        return (match[1] for match in _LINES.finditer(self.text) if match[0])

    def send_lines(self, line_chars: int = 79) -> Iterator[SendLine]:
        """The lines to send, lazily: without comments and blanks; empty lines are dropped.

        ``line_chars`` is the usable size of the controller's line buffer (79 on GRBL 1.1,
        ``protocol.h``). Raises :class:`~miurafab.errors.GcodeError`, naming file and line, for a
        realtime character, a character outside printable ASCII, or a line that is too long.
        """
        begun = False
        for number, line in enumerate(self.iter_lines(), 1):
            code = bare_code(self.name, number, line, begun=begun)
            begun = begun or bool(code)
            if len(code) > line_chars:
                raise GcodeError(
                    f"{self.name}, line {number}: {len(code)} characters without comments and "
                    f"blanks are more than the controller's {line_chars}; split the line."
                )
            if code:
                yield SendLine(number, code.encode("ascii"))


def bare_code(name: str, number: int, line: str, *, begun: bool = True) -> str:
    """``line`` without comments and blanks; raises ``GcodeError`` for a forbidden character.

    ``%`` alone marks the first and the last line of a program, ``O1000`` alone numbers it, before
    any code has ``begun`` (ISO 6983-1). They are no code, and GRBL would refuse them.
    """
    code = line.rstrip("\r\n")
    if "(" in code or ";" in code:
        code = _COMMENTS.sub("", code)
    code = code.replace(" ", "").replace("\t", "")
    bad = _FORBIDDEN.search(code)
    if bad is not None:
        raise GcodeError(f"{name}, line {number}: {_why_forbidden(bad[0])}.")
    frame = code == "%" or (not begun and _PROGRAM_NUMBER.fullmatch(code))
    return "" if frame else code


def plain_code(name: str, number: int, line: str, *, begun: bool = True) -> str:
    """``line`` as the firmware reads it: :func:`bare_code` in capitals, without the ``/`` of block
    delete, which it skips.
    """
    return bare_code(name, number, line, begun=begun).upper().replace("/", "")


def _why_forbidden(character: str) -> str:
    if character in _REALTIME:
        return (
            f"{character!r} is {_REALTIME[character]}, which the controller obeys at once "
            "wherever it stands; remove it"
        )
    if character == "\x18":
        return "the character 0x18 resets the controller wherever it stands; remove it"
    if ord(character) >= 0x80:
        return (
            f"{character!r} is not ASCII, and the controller would take its bytes for "
            "commands; remove it or put it in a comment"
        )
    return f"the control character 0x{ord(character):02X} is not printable; remove it"
