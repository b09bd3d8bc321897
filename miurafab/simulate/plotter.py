"""A simulated HPGL cutter: bytes in, XON and XOFF out, and time only by ``advance``.

Its receive buffer overflows if the sender ignores XOFF. It executes one instruction after another,
each line at its speed (``VS``, in cm/s, with the pen down), and knows ``ESC.K``. It logs what the
tool draws.
"""

from __future__ import annotations

import math
import re
from collections import deque
from dataclasses import dataclass

from miurafab.gcode.hpgl_reader import MM_PER_UNIT
from miurafab.plotter.stream import DROP_ALL, XOFF, XON
from miurafab.simulate.beam import BeamSegment

_FULL, _ROOM = 0.8, 0.4
"""The buffer levels at which it sends XOFF and XON, as fractions."""
_SPEED = 400.0  # mm/s, before any VS and with the pen up
_TOKEN = re.compile(rb"\s*(?:([A-Za-z]{2})|([-+]?\d+(?:\.\d+)?)(?=[^\d.])|[^A-Za-z\d.+-])")
"""A word, a number (complete once another character follows it), or a separator."""


@dataclass(frozen=True, slots=True)
class DrawnSegment(BeamSegment):
    """A line drawn with the pen down and the ``force`` of ``FS``."""

    force: float


class VirtualPlotter:
    """The device side. ``rx_bytes`` is its buffer; with ``baud`` None bytes take no time."""

    resets_on_open = False

    def __init__(self, *, baud: int | None = None, rx_bytes: int = 1024) -> None:
        self.now = 0.0
        self.beam_log: list[BeamSegment] = []
        self.lost_bytes = 0
        self.connected = True
        self.knows_abort = True
        self._byte = 10.0 / baud if baud else 0.0
        self._rx_bytes = rx_bytes
        self._coming: deque[tuple[float, int]] = deque()
        self._in_free = 0.0
        self._way: deque[tuple[float, float]] = deque()
        self.power_cycle()

    def power_cycle(self) -> None:
        """Switch off and on: the buffer is lost, the tool is up and at its origin."""
        self._coming.clear()
        self._way.clear()
        self.position = (0.0, 0.0)
        self.pen_down = self._relative = self._told_off = False
        self.pen = 0
        self._buffer = bytearray()
        self._out = bytearray()
        self._force, self._speed = 1.0, _SPEED
        self._busy_until = self._thaws_at = 0.0
        self._starved = True
        self._name = b""
        self._x: float | None = None

    def freeze(self, seconds: float = math.inf) -> None:
        """Its program hangs; it completes the present line."""
        self._thaws_at = self.now + seconds

    @property
    def waiting(self) -> int:
        """The bytes still on the wire."""
        return len(self._coming)

    def advance(self, seconds: float) -> None:
        """Let ``seconds`` of virtual time pass."""
        self._run(self.now + max(0.0, seconds), stop=False)

    def advance_to_line(self, seconds: float) -> None:
        """Let time pass until it says something, at most ``seconds``."""
        self._run(self.now + max(0.0, seconds), stop=True)

    def next_event_in(self) -> float | None:
        """Seconds until the next change without input; None if there is none."""
        event = min(self._events())
        return None if math.isinf(event) else max(0.0, event - self.now)

    def _events(self) -> tuple[float, float]:
        """The times of the next received byte and of the next step."""
        able = self._way or not self._starved
        return (
            self._coming[0][0] if self._coming else math.inf,
            max(self._busy_until, self._thaws_at, self.now) if able else math.inf,
        )

    def _run(self, target: float, *, stop: bool) -> None:
        while not (stop and self._out):
            arrival, work = self._events()
            event = min(arrival, work)
            if event > target:
                self.now = target
                return
            self.now = max(self.now, event)
            if arrival <= self.now:
                self._arrive(self._coming.popleft()[1])
            elif self._way:
                self._go(*self._way.popleft())
            else:
                self._take()

    def receive(self, data: bytes) -> None:
        """Bytes start down the wire to the cutter."""
        for byte in data:
            self._in_free = max(self._in_free, self.now) + self._byte
            self._coming.append((self._in_free, byte))

    def take_output(self) -> bytes:
        """The bytes that it said since the last call."""
        out, self._out = bytes(self._out), bytearray()
        return out

    def _arrive(self, byte: int) -> None:
        if len(self._buffer) >= self._rx_bytes:
            self.lost_bytes += 1
            return
        self._buffer.append(byte)
        self._starved = False
        if self._buffer.endswith(DROP_ALL):
            del self._buffer[-len(DROP_ALL) :]
            if self.knows_abort:  # it completes the present line
                self._buffer.clear()
                self._way.clear()
        if len(self._buffer) >= _FULL * self._rx_bytes and not self._told_off:
            self._told_off = True
            self._out.append(XOFF)

    def _take(self) -> None:
        """Take the next word or number from the buffer; ``_starved`` if it is incomplete."""
        match = _TOKEN.match(self._buffer)
        if match is None:
            self._starved = True
            return
        word, number = match.groups()
        del self._buffer[: match.end()]
        if self._told_off and len(self._buffer) <= _ROOM * self._rx_bytes:
            self._told_off = False
            self._out.append(XON)
        if word:
            self._begin(bytes(word).upper())
        elif number:
            self._number(float(number))

    def _begin(self, name: bytes) -> None:
        self._name = name
        self._x = None
        if name == b"IN":
            self.pen_down = self._relative = False
        elif name in (b"PU", b"PD"):
            self.pen_down = name == b"PD"
        elif name in (b"PA", b"PR"):
            self._relative = name == b"PR"
        elif name == b"SP":
            self.pen = 0
        elif name == b"VS":
            self._speed = _SPEED
        elif name == b"FS":
            self._force = 1.0

    def _number(self, value: float) -> None:
        if self._name == b"SP":
            self.pen = int(value)
        elif self._name == b"VS":
            self._speed = 10.0 * value
        elif self._name == b"FS":
            self._force = value
        elif self._name in (b"PU", b"PD", b"PA", b"PR"):
            if self._x is None:
                self._x = value
            else:
                self._way.append((self._x, value))
                self._x = None

    def _go(self, x: float, y: float) -> None:
        base = self.position if self._relative else (0.0, 0.0)
        to = (base[0] + x * MM_PER_UNIT, base[1] + y * MM_PER_UNIT)
        seconds = math.dist(self.position, to) / (self._speed if self.pen_down else _SPEED)
        self._busy_until = self.now + seconds
        if self.pen_down and to != self.position:
            times = self.now, self._busy_until
            self.beam_log.append(DrawnSegment(*times, *self.position, *to, 1.0, self._force))
        self.position = to
