"""The Marlin connection without I/O: bytes in, replies out, one line in flight.

Each line is sent as ``N<number> <code>*<checksum>``; the checksum is the exclusive or of all bytes
before the ``*``. So the controller notices a line that is damaged, repeated or lost, and asks for
it by its number. A line without an answer may be resent safely: if the controller had taken it, it
asks for the next number.

:data:`EMERGENCY` has no line number: the controller acts on it as soon as it reads it, between two
commands, or at once if it was built with ``EMERGENCY_PARSER``.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

from miurafab.gcode.job import SendLine
from miurafab.marlin.replies import MarlinError, MarlinOk, Reply, Resend, Started, parse_reply
from miurafab.wire.line_reader import LineReader

EMERGENCY = b"\nM112\n"
"""Halt: motors and laser off until a reset. The newline ends a line that was begun."""

FRAME = len("N99999999*255")
"""The most characters that line number and checksum add to a line."""
MOST_TRIES = 5
"""The most times that a line is sent before the job fails."""


class MarlinConnection:
    """The state of one connection: the line in flight and its number."""

    def __init__(self) -> None:
        self.in_flight: SendLine | None = None
        self._sent = b""
        self._number = 0
        self._tries = 0
        self._again = False
        self._taken = False
        self._lines = LineReader(b"\r\0 ")
        self._replies: deque[Reply] = deque()

    @property
    def idle(self) -> bool:
        """Whether a line may be sent."""
        return self.in_flight is None

    def restart_count(self) -> bytes:
        """The line that restarts the line numbers on both sides."""
        self._number = -1
        return self.send_line(SendLine(0, b"M110N0"))

    def send_line(self, line: SendLine) -> bytes:
        """The bytes of ``line``; it is then in flight. No other line may be in flight."""
        assert self.in_flight is None
        self._number += 1
        self.in_flight = line
        self._sent = framed(self._number, line.data)
        self._tries, self._again, self._taken = 1, False, False
        return self._sent

    def send_again(self) -> bytes:
        """The line in flight again, after a newline that ends a damaged rest of it.

        Empty if no line is in flight or it was sent :data:`MOST_TRIES` times.
        """
        if self.in_flight is None or self._tries >= MOST_TRIES:
            return b""
        self._tries += 1
        self._again = False
        return b"\n" + self._sent

    @property
    def wants_again(self) -> bool:
        """Whether the controller asked for the line in flight again and is ready for it."""
        return self._again and self._taken

    def receive_data(self, data: bytes) -> None:
        """Take received bytes, in any chunks; :meth:`replies` then returns the replies."""
        for text in self._lines.take(data):
            self._take(parse_reply(text))

    def replies(self) -> Iterator[Reply]:
        """Yield the replies completed since the last call, in order."""
        while self._replies:
            yield self._replies.popleft()

    def _take(self, reply: Reply) -> None:
        if isinstance(reply, MarlinOk):
            if self._again:
                self._taken = True  # the controller is ready for the line again
                return
            line, self.in_flight = self.in_flight, None
            reply = MarlinOk(reply.text, line)
        elif isinstance(reply, Resend):
            if self.in_flight is None or reply.number not in (self._number, self._number + 1):
                reply = MarlinError(f"{reply.text}, a line that was not in flight")
            elif reply.number == self._number:
                self._again, self._taken = True, False
        elif isinstance(reply, Started):
            self.in_flight = None
        self._replies.append(reply)


def framed(number: int, code: bytes) -> bytes:
    """``code`` with its line number and checksum, as sent."""
    body = b"N%d " % number + code
    return body + b"*%d\n" % checksum(body)


def checksum(body: bytes) -> int:
    """The exclusive or of all bytes."""
    value = 0
    for byte in body:
        value ^= byte
    return value
