"""The connections of a server: how many there may be, and how long each may take.

A connection costs a thread. One that sends its request letter by letter, or never reads the answer
(slow loris), is shut at its time, however busy it looks. Until its first request was let in, a
connection has less time, and one address has few of them.
"""

from __future__ import annotations

import contextlib
import http.client
import io
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

STRANGER_S = 10.0
"""For the handshake and the head of the first request."""
IDLE_S = 60.0
"""For the head of each further request, and the pause before it."""
ANSWER_S = 300.0
"""For a body and the answer: 64 MB at 2 Mbit/s."""
HEAD_LIMIT = 2**15
"""The most bytes of the headers of one request; a browser sends 1 kB."""
MOST, MOST_OF_ONE = 256, 32
"""The most connections from other computers, and the most from one of them."""


@dataclass
class _OpenWire:
    wire: socket.socket
    address: str
    due: float
    stranger: bool = True


class Connections:
    """The open connections, of all threads; mutable. ``bounded`` says that their number is."""

    def __init__(self, *, bounded: bool, clock: Callable[[], float] = time.monotonic) -> None:
        self._bounded, self._clock = bounded, clock
        self._lock = threading.Lock()
        self._open: dict[int, _OpenWire] = {}

    def has_room(self, address: str) -> bool:
        """Whether one more from ``address`` is taken.

        Where there are too many, the one that has waited longest to be let in is shut for it: no
        silent ones may keep Abort out.
        """
        with self._lock:
            every = list(self._open.values())
            full = [each for each in every if each.address == address]
            if len(full) < MOST_OF_ONE:
                full = every if len(every) >= MOST else []
            if not (self._bounded and full):
                return True
            oldest = next((each for each in full if each.stranger), None)
            if oldest is None:
                return False
            del self._open[id(oldest.wire)]
            _shut(oldest.wire)
            return True

    def add(self, wire: socket.socket, address: str) -> None:
        """``wire`` is open, and has to have sent the head of a request soon."""
        with self._lock:
            due = self._clock() + STRANGER_S
            self._open[id(wire)] = _OpenWire(wire, address, due)

    def more_time(self, wire: socket.socket, seconds: float) -> None:
        """``wire``, which was let in, has ``seconds`` for what comes next."""
        with self._lock:
            if id(wire) in self._open:
                known = self._open[id(wire)]
                known.due, known.stranger = self._clock() + seconds, False

    def remove(self, wire: socket.socket) -> None:
        """``wire`` is shut."""
        with self._lock:
            self._open.pop(id(wire), None)

    def shut_late(self) -> None:
        """Shut those whose time is over; their threads find that out."""
        with self._lock:
            now = self._clock()
            for each in self._open.values():
                if now > each.due:
                    each.due = now + IDLE_S
                    _shut(each.wire)


def _shut(wire: socket.socket) -> None:
    with contextlib.suppress(OSError):  # not SSLSocket's, which waits for the peer
        socket.socket.shutdown(wire, socket.SHUT_RDWR)


class LimitedHead(io.BufferedIOBase):
    """What comes of a connection; the lines of one request's head have a limit together."""

    def __init__(self, file: io.BufferedIOBase) -> None:
        self._file = file
        self._left = HEAD_LIMIT

    def begin(self) -> None:
        """The next request begins."""
        self._left = HEAD_LIMIT

    def readline(self, size: int | None = -1, /) -> bytes:
        """As of a file. Raises :class:`http.client.LineTooLong` beyond the limit."""
        if self._left <= 0:
            raise http.client.LineTooLong("head")
        line = self._file.readline(self._left + 1 if size is None or size < 0 else size)
        self._left -= len(line)
        return line

    def read(self, size: int | None = -1, /) -> bytes:
        """As of a file."""
        return self._file.read(size)

    def close(self) -> None:
        """As of a file."""
        self._file.close()
        super().close()
