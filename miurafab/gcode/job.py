"""A job is a named text, and what of it may go down the wire is decided here, line by line.

The controller reads some bytes wherever they stand, comments included: ``!`` holds, ``?`` asks,
``~`` resumes, 0x18 resets, and everything from 0x80 up is a command or noise (GRBL 1.1
``serial.c``). It also loses what a line has beyond its line buffer. So a line is reduced to
its printable code, comments and blanks gone, and a line that still holds such a byte, or is too
long, is an error that names it: no line is ever skipped or changed in meaning.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

from miurafab.errors import GcodeError

_LINE_ENDS = re.compile(r"\r\n|\n|\r")
_LINES = re.compile(r"([^\r\n]*)(?:\r\n|\n|\r|$)")
# As the controller sees them: "(" up to ")" or the line's end, or ";" to the line's end.
_COMMENTS = re.compile(r"\([^)]*\)?|;.*", re.DOTALL)
_FORBIDDEN = re.compile(r"[^!-~]|[!?~]")
_REALTIME = {"!": "the feed hold", "?": "the status query", "~": "the cycle start"}


@dataclass(frozen=True)
class Job:
    """A program to send: ``name`` is how messages call it, ``text`` the whole file."""

    name: str
    text: str

    @cached_property
    def lines(self) -> tuple[str, ...]:
        """The file's lines without their ends (LF, CR or CRLF)."""
        lines = _LINE_ENDS.split(self.text)
        return tuple(lines[:-1] if lines[-1] == "" else lines)

    @property
    def line_count(self) -> int:
        """How many lines the file has."""
        text = self.text
        ends = text.count("\n") + text.count("\r") - text.count("\r\n")
        return ends + bool(text and not text.endswith(("\n", "\r")))

    def iter_lines(self) -> Iterator[str]:
        """The same lines one at a time, so that a long file is not held twice."""
        return (match[1] for match in _LINES.finditer(self.text) if match[0])


@dataclass(frozen=True, slots=True)
class SendLine:
    """One line as it goes down the wire.

    ``number`` is its 1-based line in the file, ``data`` its printable ASCII without the newline.
    """

    number: int
    data: bytes


def prepare(job: Job, line_chars: int = 79) -> tuple[SendLine, ...]:
    """All lines of ``job`` as they are sent; see :func:`prepare_lines`."""
    return tuple(prepare_lines(job.name, job.iter_lines(), line_chars))


def prepare_lines(name: str, lines: Iterable[str], line_chars: int = 79) -> Iterator[SendLine]:
    """The lines as they are sent, one at a time: comments and blanks gone, empty lines dropped.

    ``lines`` may be an open text file. ``line_chars`` is the controller's usable line buffer
    (79 on GRBL 1.1, ``protocol.h``). Raises :class:`~miurafab.errors.GcodeError`, naming file
    and line, at a realtime character, a character outside printable ASCII, or a line too long.
    """
    for number, line in enumerate(lines, 1):
        code = bare_code(name, number, line)
        if len(code) > line_chars:
            raise GcodeError(
                f"{name}, line {number}: {len(code)} characters without comments and blanks are "
                f"more than the controller's {line_chars}; split the line."
            )
        if code:
            yield SendLine(number, code.encode("ascii"))


def bare_code(name: str, number: int, line: str) -> str:
    """``line`` without comments and blanks; raises ``GcodeError`` at a character not to be sent."""
    code = line.rstrip("\r\n")
    if "(" in code or ";" in code:
        code = _COMMENTS.sub("", code)
    code = code.replace(" ", "").replace("\t", "")
    bad = _FORBIDDEN.search(code)
    if bad is not None:
        raise GcodeError(f"{name}, line {number}: {_complaint(bad[0])}.")
    return code


def _complaint(character: str) -> str:
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
