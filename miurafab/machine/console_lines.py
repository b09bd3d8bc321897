"""What a controller says to a person: its lines without the answers to a session's own questions.

A session asks for the status many times a second, and for modes and offsets after each line that
may change them. While a person's line is answered everything is passed on; at other times only what
the controller says by itself, such as an alarm or a message.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

_ASKED = ("<", "ok", "$", "[G", "[TLO", "[PRB", "[VER", "[OPT")
"""The beginnings of the answers to ``?``, ``$I``, ``$$``, ``$#``, ``$G`` and ``$N``."""


class ConsoleLines:
    """Splits what arrives into lines and passes those for a person to ``on_line``."""

    def __init__(self) -> None:
        self.on_line: Callable[[str], None] = lambda text: None
        self._coming = b""
        self._all = False

    def hear(self, data: bytes) -> None:
        """Take bytes as they came."""
        *lines, self._coming = (self._coming + data).split(b"\n")
        for line in lines:
            text = line.decode("ascii", "backslashreplace").strip()
            if text and (self._all or not text.startswith(_ASKED)):
                self.on_line(text)

    @contextmanager
    def everything(self) -> Iterator[None]:
        """Pass everything on: a person has asked."""
        self._all = True
        try:
            yield
        finally:
            self._all = False
