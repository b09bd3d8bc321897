"""The sending side of a Marlin wire, without the wire: bytes in, replies out, one line in flight.

Each line goes out as ``N<count><code>*<checksum>``, the checksum being the exclusive or of all
bytes before the ``*``. So a line that came damaged, twice, or not at all is noticed by the
controller, which asks for it by its number; and a line may be sent again without harm whenever its
answer is missing: if the controller had taken it, it says so by asking for the next one.

Only the bytes of :data:`EMERGENCY` go past the count: the controller acts on them as soon as it
reads them, between two commands, or at once if it was built with ``EMERGENCY_PARSER``.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

from miurafab.gcode.job import SendLine
from miurafab.marlin.replies import MarlinError, MarlinOk, Reply, Resend, Started, parse_reply
from miurafab.wire.line_reader import LineReader

EMERGENCY = b"\nM112\n"
"""Halt: motors and laser off until a reset. The newline ends what may have been begun."""

FRAME = len("N99999999*255")
"""Characters that the count and the checksum add to a line at most."""
MOST_TRIES = 5
"""How often a line is sent before the wire is given up."""


class MarlinConnection:
    """The state of one wire: what is in flight, and how far the count is."""

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
        """The line that sets the controller's count to ours, which begins anew."""
        self._number = -1
        return self.send_line(SendLine(0, b"M110N0"))

    def send_line(self, line: SendLine) -> bytes:
        """The bytes of ``line``; it is then in flight. There must be none."""
        assert self.in_flight is None
        self._number += 1
        self.in_flight = line
        self._sent = framed(self._number, line.data)
        self._tries, self._again, self._taken = 1, False, False
        return self._sent

    def send_again(self) -> bytes:
        """The line in flight once more, after a newline that ends whatever is left of it.

        Empty if nothing is in flight or it was tried :data:`MOST_TRIES` times.
        """
        if self.in_flight is None or self._tries >= MOST_TRIES:
            return b""
        self._tries += 1
        self._again = False
        return b"\n" + self._sent

    @property
    def wants_again(self) -> bool:
        """Whether the controller asked for the line in flight and waits for it."""
        return self._again and self._taken

    def receive_data(self, data: bytes) -> None:
        """Take bytes as they came, in any chunks; the replies are then had from :meth:`replies`."""
        for text in self._lines.take(data):
            self._take(parse_reply(text))

    def replies(self) -> Iterator[Reply]:
        """The replies that have become complete since the last call, in order."""
        while self._replies:
            yield self._replies.popleft()

    def _take(self, reply: Reply) -> None:
        if isinstance(reply, MarlinOk):
            if self._again:
                self._taken = True  # the wire is free for the line that it wants
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
    """``code`` with its count and checksum, as it goes down the wire."""
    body = b"N%d " % number + code
    return body + b"*%d\n" % checksum(body)


def checksum(body: bytes) -> int:
    """The exclusive or of all bytes."""
    value = 0
    for byte in body:
        value ^= byte
    return value
