"""The keyboard while a job runs: keys that have been pressed, read without ever waiting.

The terminal hands over each key at once and shows none; Ctrl-C stays a signal. Without a terminal
there are no keys. What a key does is one byte to the controller, or the end of the job.
"""

from __future__ import annotations

import codecs
import math
import re
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, Protocol

HOLD, RESUME, ABORT, RESET = b"!", b"~", b"", b"\x18"
KEYS = {
    " ": HOLD,
    "r": RESUME,
    "q": ABORT,
    "\x18": RESET,
    "+": b"\x91",
    "-": b"\x92",
    "0": b"\x90",
    "]": b"\x9a",
    "[": b"\x9b",
    "p": b"\x99",
}
"""What each key sends (GRBL 1.1 ``config.h``): feed +10 %, -10 %, as written; power likewise.
Ctrl-X is GRBL's own soft reset: it ends a job at once, where ``q`` lets a dark motion come to rest.
"""


POWER = (b"\x99", b"\x9a", b"\x9b", b"\x9c", b"\x9d")
"""What changes the power. At rest GRBL then sets an armed beam anew, and lights that of M3 in laser
mode though the motion mode keeps it dark (gnea/grbl 1.1, ``protocol.c``, ``spindle_control.c``)."""


OVERRIDES_OFF = (b"\x90", b"\x95", b"\x99")
"""What sets feed, rapid rate and power back to what is written: a controller that was not reset may
still override them, and some keep them over a reset (grblHAL, ``$676``)."""


JOG_CANCEL = b"\x85"
"""Ends a jog at once (GRBL 1.1 ``config.h``); nothing else obeys it."""


def obeys_overrides(dialect: str) -> bool:
    """Whether a machine of this dialect has realtime overrides."""
    return dialect not in ("grbl-0.9", "marlin", "hpgl")


def keys_of(dialect: str) -> dict[str, bytes]:
    """The keys that a machine of this dialect obeys."""
    if obeys_overrides(dialect):
        return KEYS
    return {key: order for key, order in KEYS.items() if order in (HOLD, RESUME, ABORT, RESET)}


def session_keys(dialect: str) -> dict[str, bytes]:
    """... and while no job runs: ``c`` ends a jog."""
    return keys_of(dialect) | ({"c": JOG_CANCEL} if obeys_overrides(dialect) else {})


UP, DOWN, RIGHT, LEFT, PAGE_UP, PAGE_DOWN = "\u2191\u2193\u2192\u2190\u21de\u21df"
_SEQUENCES = {
    f"\x1b{form}{letter}": key
    for form in "[O"
    for letter, key in zip("ABCD", (UP, DOWN, RIGHT, LEFT), strict=True)
} | {"\x1b[5~": PAGE_UP, "\x1b[6~": PAGE_DOWN}
"""The sequences of the keys that jog (xterm, "Control Sequences": PC-style function keys)."""
_CODES = dict(zip("HPMKIQ", (UP, DOWN, RIGHT, LEFT, PAGE_UP, PAGE_DOWN), strict=True))
"""Their second codes in a Windows console."""


class Keys(Protocol):
    """A source of keys."""

    def pressed(self) -> str:
        """The keys pressed since the last call; never waits."""


class NoKeys:
    """No keyboard."""

    def pressed(self) -> str:
        """Nothing."""
        return ""


@contextmanager
def terminal_keys(*, arrows: bool = False) -> Iterator[Keys]:
    """The keys of this terminal, or none without one; the terminal is left as it was.

    With ``arrows`` the keys that jog are told, as :data:`UP` and its kin.
    """
    if not sys.stdin.isatty():
        yield NoKeys()
    elif sys.platform == "win32":
        import msvcrt

        yield ConsoleKeys(msvcrt.kbhit, msvcrt.getwch, arrows=arrows)
    else:
        with _posix_keys(arrows) as keys:
            yield keys


def suspend_here() -> None:
    """Stop this process until its terminal's shell lets it go on, the terminal as shells want it.

    In the background, setting the terminal would stop it again. Windows suspends no programs.
    """
    if sys.platform == "win32":
        return
    descriptor = sys.stdin.fileno() if sys.stdin.isatty() else None
    modes: list[Any] = []
    if descriptor is not None:
        modes = termios.tcgetattr(descriptor)
        plain = [*modes]
        plain[3] = modes[3] | termios.ICANON | termios.ECHO
        termios.tcsetattr(descriptor, termios.TCSADRAIN, plain)
    os.kill(os.getpid(), signal.SIGSTOP)
    if descriptor is not None and os.tcgetpgrp(descriptor) == os.getpgrp():
        termios.tcsetattr(descriptor, termios.TCSADRAIN, modes)


class Typed:
    """Characters typed at a terminal, without the sequences that stand for other keys.

    An arrow, a function key, Alt with a key, a mouse or an answer of the terminal arrives as an
    escape sequence of printable characters (ECMA-48, 5.4; xterm, "Control Sequences"). A sequence
    is dropped whole, over any number of reads, but for those of the keys that jog, with ``arrows``.
    An escape that nothing follows for ``wait`` seconds is the key itself, so that it swallows no
    later key.
    """

    def __init__(
        self,
        now: Callable[[], float] = time.monotonic,
        wait: float = 0.05,
        *,
        arrows: bool = False,
    ) -> None:
        self._known = _SEQUENCES if arrows else {}
        self._decode = codecs.getincrementaldecoder("utf-8")("surrogateescape").decode
        self._now, self._wait = now, wait
        self._sequence = ""
        self._heard = -math.inf

    def keys(self, data: bytes) -> str:
        """The keys that ``data``, the bytes typed since the last call, hold."""
        now = self._now()
        if data:
            self._heard = now
        elif now - self._heard > self._wait:
            self._sequence = ""
        return "".join(map(self._key, self._decode(data)))

    def _key(self, character: str) -> str:
        if character in _BEGINS and not _STRING.match(self._sequence):
            self._sequence = _BEGINS[character]
        elif self._sequence:
            self._sequence += character
            if _ENDED.fullmatch(self._sequence):
                ended, self._sequence = self._sequence, ""
                return self._known.get(ended, "")
        else:
            return character
        return ""


_BEGINS = {"\x1b": "\x1b"} | {
    control: f"\x1b{chr(code - 0x40)}"
    for code in (0x8F, 0x90, 0x98, 0x9B, 0x9D, 0x9E, 0x9F)
    for control in (chr(code), bytes((code,)).decode("utf-8", "surrogateescape"))
}
"""How a sequence begins, also by one 8-bit control; that is no UTF-8 by itself."""
_ENDED = re.compile(
    r"\x1b(?:"
    r"\[(?:\[.|M.{3}|[0-?]*[ -/]*(?:[@-LN-Z\\-~]|(?<!\[)M))"  # control sequences; Linux's F1, mice
    r"|O[0-9]*[@-~]"  # function keys and the keypad
    r"|[PX\]^_].*(?:\x07|\x1b.|\x9c)"  # strings: answers of the terminal
    r"|[ -NQ-WYZ\\`-~]"  # Alt with a key
    r")",
    re.DOTALL,
)
_STRING = re.compile(r"\x1b[PX\]^_]")


class ConsoleKeys:
    """The keys of a Windows console: ``waiting`` and ``read`` are ``kbhit`` and ``getwch``.

    A key without a character is two: NUL or 0xE0, and a code, which may look like a letter
    (Microsoft C runtime, ``_getch``). Both are dropped, but for the keys that jog, with ``arrows``.
    """

    def __init__(
        self, waiting: Callable[[], bool], read: Callable[[], str], *, arrows: bool = False
    ) -> None:
        self._waiting, self._read = waiting, read
        self._known = _CODES if arrows else {}

    def pressed(self) -> str:
        """The keys pressed since the last call; never waits."""
        keys = ""
        while self._waiting():
            key = self._read()
            if key in "\0\xe0":
                keys += self._known.get(self._read(), "")
            else:
                keys += key
        return keys


if sys.platform != "win32":
    import os
    import select
    import signal
    import termios

    class _PosixKeys:
        def __init__(self, descriptor: int, arrows: bool) -> None:
            self._descriptor = descriptor
            self._typed = Typed(arrows=arrows)

        def pressed(self) -> str:
            return self._typed.keys(self._read())

        def _read(self) -> bytes:
            try:
                # In the background, reading from the terminal would stop the whole process.
                if os.tcgetpgrp(self._descriptor) != os.getpgrp():
                    return b""
                data = b""
                while select.select([self._descriptor], [], [], 0)[0]:
                    more = os.read(self._descriptor, 1024)
                    if not more:  # the terminal was closed
                        break
                    data += more
                return data
            except OSError:  # the terminal was closed
                return b""

    @contextmanager
    def _posix_keys(arrows: bool) -> Iterator[Keys]:
        descriptor = sys.stdin.fileno()
        before = termios.tcgetattr(descriptor)
        raw = termios.tcgetattr(descriptor)
        raw[3] &= ~(termios.ICANON | termios.ECHO)
        termios.tcsetattr(descriptor, termios.TCSAFLUSH, raw)  # what was typed before is not meant
        try:
            yield _PosixKeys(descriptor, arrows)
        finally:
            with suppress(termios.error):  # it was closed
                termios.tcsetattr(descriptor, termios.TCSADRAIN, before)
