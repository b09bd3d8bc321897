"""The keyboard while a job runs: keys that have been pressed, read without ever waiting.

The terminal hands over each key at once and shows none; Ctrl-C stays a signal. Without a terminal
there are no keys. What a key does is one byte to the controller, or the end of the job.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Protocol

HOLD, RESUME, ABORT = b"!", b"~", b""
KEYS = {
    " ": HOLD,
    "r": RESUME,
    "q": ABORT,
    "+": b"\x91",
    "-": b"\x92",
    "0": b"\x90",
    "]": b"\x9a",
    "[": b"\x9b",
    "p": b"\x99",
}
"""What each key sends (GRBL 1.1 ``config.h``): feed +10 %, -10 %, as written; power likewise."""


def keys_of(dialect: str) -> dict[str, bytes]:
    """The keys that a machine of this dialect obeys: few dialects have realtime overrides."""
    if dialect in ("grbl-0.9", "marlin", "hpgl"):
        return {key: order for key, order in KEYS.items() if order in (HOLD, RESUME, ABORT)}
    return KEYS


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
def terminal_keys() -> Iterator[Keys]:
    """The keys of this terminal, or none without one; the terminal is left as it was."""
    if not sys.stdin.isatty():
        yield NoKeys()
    elif sys.platform == "win32":
        yield _WindowsKeys()
    else:
        with _posix_keys() as keys:
            yield keys


if sys.platform == "win32":
    import msvcrt

    class _WindowsKeys:
        def pressed(self) -> str:
            keys = ""
            while msvcrt.kbhit():
                keys += msvcrt.getwch()
            return keys

else:
    import os
    import select
    import termios

    class _PosixKeys:
        def __init__(self, descriptor: int) -> None:
            self._descriptor = descriptor

        def pressed(self) -> str:
            try:
                # In the background, reading from the terminal would stop the whole process.
                if os.tcgetpgrp(self._descriptor) != os.getpgrp():
                    return ""
                if not select.select([self._descriptor], [], [], 0)[0]:
                    return ""
                return os.read(self._descriptor, 64).decode("ascii", "ignore")
            except OSError:  # the terminal was closed
                return ""

    @contextmanager
    def _posix_keys() -> Iterator[Keys]:
        descriptor = sys.stdin.fileno()
        before = termios.tcgetattr(descriptor)
        raw = termios.tcgetattr(descriptor)
        raw[3] &= ~(termios.ICANON | termios.ECHO)
        termios.tcsetattr(descriptor, termios.TCSAFLUSH, raw)  # what was typed before is not meant
        try:
            yield _PosixKeys(descriptor)
        finally:
            with suppress(termios.error):  # it was closed
                termios.tcsetattr(descriptor, termios.TCSADRAIN, before)
