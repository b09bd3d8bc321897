"""The GRBL connection without I/O: bytes in, events out, and the accounting of bytes in flight.

:class:`Connection` takes the bytes that arrive and says which bytes may be sent. It does no I/O and
has no clock, so it serves a serial port, a socket, a simulator, and a test that splits the stream
into single bytes.

Byte accounting: a sent line counts its bytes and its newline until the controller answers it. The
sum never exceeds the controller's receive buffer, which is the smaller of the profile's value and
the value in the controller's ``[OPT:...]``. Realtime bytes never count, because the receive
interrupt takes them out of the stream. A line that writes the EEPROM is sent alone, because the
firmware loses bytes that arrive during the write (``eeprom.c`` blocks the interrupts).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import replace

from miurafab.gcode.job import SendLine
from miurafab.grbl.events import (
    Alarm,
    Banner,
    Closed,
    Error,
    Event,
    Feedback,
    Ok,
    Options,
    StatusReport,
)
from miurafab.grbl.lines import is_system, writes_eeprom
from miurafab.grbl.replies import parse_reply
from miurafab.grbl.states import KEEPS_ACCOUNT, TRANSITIONS, Input, State
from miurafab.wire.line_reader import LineReader

SOFT_RESET = b"\x18"
STATUS_QUERY = b"?"
PROBE = b"$I\n"
FEED_HOLD = b"!"


class ProtocolMisuse(RuntimeError):
    """The program sent something that the state of the connection forbids: a defect of miurafab."""


class Connection:
    """The state of one connection. ``rx_bytes`` is the receive buffer of the machine profile."""

    def __init__(self, rx_bytes: int = 128) -> None:
        self.rx_bytes = rx_bytes
        self.state = State.OPENING
        self.in_flight: deque[SendLine] = deque()
        self.in_flight_bytes = 0
        self._lines = LineReader()
        self._events: deque[Event] = deque()

    # Sending

    def may_send(self, line: SendLine) -> bool:
        """Whether the state, the free bytes and the EEPROM rule allow ``line`` to be sent now."""
        return (
            _kind(line.data) in TRANSITIONS[self.state]
            and self.in_flight_bytes + len(line.data) + 1 <= self.rx_bytes
            and not (self.in_flight and (self.writing_eeprom or writes_eeprom(line.data)))
        )

    @property
    def writing_eeprom(self) -> bool:
        """Whether a line in flight writes the EEPROM; send nothing but a reset meanwhile."""
        return len(self.in_flight) == 1 and writes_eeprom(self.in_flight[0].data)

    def send_line(self, line: SendLine) -> bytes:
        """The bytes of ``line`` for the wire, entered in the books.

        Raises :class:`ProtocolMisuse` if :meth:`may_send` forbids it.
        """
        if not self.may_send(line):
            raise ProtocolMisuse(
                f"cannot send {line.data!r} in {self.state.name} with "
                f"{self.in_flight_bytes} of {self.rx_bytes} bytes in flight"
            )
        self._enter(_kind(line.data))
        self.in_flight.append(line)
        self.in_flight_bytes += len(line.data) + 1
        return line.data + b"\n"

    def send_realtime(self, byte: bytes) -> bytes:
        """One realtime byte for the wire; a soft reset voids the books.

        Raises :class:`ProtocolMisuse` when the wire is closed.
        """
        if self.state is State.CLOSED:
            raise ProtocolMisuse(f"cannot send {byte!r}: the wire is closed")
        self._enter(Input.RESET if byte == SOFT_RESET else Input.REALTIME)
        return byte

    @property
    def awaits_proof(self) -> bool:
        """Whether a banner, or what stands for it, is missing."""
        return Input.PROBE in TRANSITIONS[self.state]

    def probe(self) -> bytes:
        """The question that stands for a banner, for the wire; it is not entered in the books.

        Its answer is a :class:`~miurafab.grbl.events.Version` and then the first ``ok`` of all.
        Raises :class:`ProtocolMisuse` in a state that needs no proof, or a reset.
        """
        if not self.awaits_proof:
            raise ProtocolMisuse(f"cannot send {PROBE!r} in {self.state.name}")
        self._enter(Input.PROBE)
        return PROBE

    def prove(self) -> None:
        """The answer to :meth:`probe` has come: the controller holds no line."""
        self._enter(Input.PROVEN)

    # Receiving

    def receive_data(self, data: bytes) -> None:
        """Take bytes as they came, in any chunks; ``b""`` says that the wire has ended.

        The events are then had from :meth:`events`.
        """
        if self.state is State.CLOSED:
            return
        if not data:
            self._take(Closed())
            return
        for text in self._lines.take(data):
            self._take(parse_reply(text))

    def events(self) -> Iterator[Event]:
        """The events that have become complete since the last call, in order."""
        while self._events:
            yield self._events.popleft()

    def _take(self, event: Event) -> None:
        if isinstance(event, Ok | Error):
            if self.in_flight:
                line = self.in_flight.popleft()
                self.in_flight_bytes -= len(line.data) + 1
                event = replace(event, line=line)
                self._enter(Input.ANSWER)
            else:
                self._enter(Input.STRAY)
        else:
            if isinstance(event, Options) and event.rx_bytes is not None:
                self.rx_bytes = min(self.rx_bytes, event.rx_bytes)
            self._enter(_input(event))
        self._events.append(event)

    def _enter(self, item: Input) -> None:
        self.state = TRANSITIONS[self.state][item]
        if self.state not in KEEPS_ACCOUNT:
            self.in_flight.clear()
            self.in_flight_bytes = 0


def _kind(data: bytes) -> Input:
    """Whether a line is motion or a system command; a jog is motion."""
    return Input.SYSTEM if is_system(data) else Input.MOTION


_MESSAGES = {
    "'$H'|'$X' to unlock": Input.LOCK,
    "Caution: Unlocked": Input.UNLOCK,
    "Sleeping": Input.SLEEP,
    "Disabled": Input.RESTART,
    "Restoring defaults": Input.RESTART,
}
_STATUS = {"Alarm": Input.LOCK, "Idle": Input.UNLOCK, "Sleep": Input.SLEEP}


def _input(event: Event) -> Input:
    match event:
        case Banner():
            return Input.BANNER
        case Alarm():
            return Input.ALARM
        case Feedback(text):
            return _MESSAGES.get(text, Input.TALK)
        case StatusReport(state):
            return _STATUS.get(state, Input.TALK)
        case Closed():
            return Input.END
        case _:
            return Input.TALK
