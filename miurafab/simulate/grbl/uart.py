"""The serial port of the simulated controller: bytes take time, and full rings lose bytes.

The receive interrupt (``serial.c``) takes realtime commands out of the stream. It drops other bytes
from 0x80 up, or keeps them in some dialects. It puts the rest into a ring of about 128 bytes; bytes
beyond are lost. While an EEPROM write blocks the interrupts, the hardware holds two bytes and the
byte being received; further bytes are lost.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

from miurafab.motion import cpu
from miurafab.simulate.grbl.dialect import Dialect

_DEAF_BYTES = 3
_NEWLINE = 10


class Uart:
    """``ring`` holds the received, unread bytes; times are in processor cycles.

    ``on_realtime`` is called with the time and each realtime byte. With ``baud`` None bytes take no
    time.
    """

    def __init__(
        self, baud: int | None, dialect: Dialect, on_realtime: Callable[[int, int], None]
    ) -> None:
        self.dialect = dialect
        self.byte = 10.0 * cpu.CLOCK / baud if baud else 0.0
        self.on_realtime = on_realtime
        self.ring: deque[int] = deque()
        self.lost = 0
        self.deaf = False
        self._kept: list[int] = []
        self._coming: deque[tuple[int, int]] = deque()
        self._rx_free = 0.0
        self._going: deque[tuple[int, int]] = deque()
        self._lines: deque[int] = deque()
        self._tx_free = 0.0

    def receive(self, now: int, data: bytes) -> None:
        """Bytes start on the wire to the controller."""
        for byte in data:
            self._rx_free = max(self._rx_free, now) + self.byte
            self._coming.append((math.ceil(self._rx_free), byte))

    def next_arrival(self) -> int | None:
        """The time when the next byte arrives."""
        return self._coming[0][0] if self._coming else None

    def arrive(self) -> None:
        """The next byte arrives at the receive interrupt, or at the hardware if that is blocked."""
        now, byte = self._coming.popleft()
        if not self.deaf:
            self._interrupt(now, byte)
        elif len(self._kept) < _DEAF_BYTES:
            self._kept.append(byte)
        else:
            self._kept[-1] = byte
            self.lost += 1

    def fill(self, end: int) -> None:
        """Bytes that arrive before ``end`` and are for the ring, up to the first that is not."""
        coming, realtime = self._coming, self.dialect.realtime
        while coming and coming[0][0] < end and not self.deaf:
            if coming[0][1] in realtime:
                return
            self._interrupt(*coming.popleft())

    def hear(self, now: int) -> None:
        """Enable interrupts: take the bytes that the hardware kept."""
        self.deaf = False
        kept, self._kept = self._kept, []
        for byte in kept:
            self._interrupt(now, byte)

    def _interrupt(self, now: int, byte: int) -> None:
        if byte in self.dialect.realtime:
            self.on_realtime(now, byte)
        elif byte >= 0x80 and not self.dialect.keeps_high_bytes:
            pass
        elif len(self.ring) < self.dialect.rx_bytes:
            self.ring.append(byte)
        else:
            self.lost += 1

    @property
    def room(self) -> int:
        """The free places in the receive ring."""
        return self.dialect.rx_bytes - len(self.ring)

    def write(self, now: int, data: bytes) -> int:
        """Print ``data``; returns the time when its last byte is in the transmit ring."""
        for byte in data:
            self._tx_free = max(self._tx_free, now) + self.byte
            done = math.ceil(self._tx_free)
            self._going.append((done, byte))
            if byte == _NEWLINE:
                self._lines.append(done)
        return max(now, math.ceil(self._tx_free - self.dialect.tx_bytes * self.byte))

    def cut(self, now: int) -> None:
        """A reset ends a waiting print: bytes that are not in the ring yet are not sent."""
        room = self.dialect.tx_bytes + 1
        sent = sum(done <= now for done, _ in self._going)
        while len(self._going) > sent + room:
            if self._going.pop()[1] == _NEWLINE:
                self._lines.pop()
        self._tx_free = float(self._going[-1][0]) if self._going else float(now)

    def next_departure(self, now: int) -> int | None:
        """The time when the next byte after ``now`` is out."""
        return next((done for done, _ in self._going if done > now), None)

    def next_line(self) -> int | None:
        """The time when the first line that is not taken yet is out."""
        return self._lines[0] if self._lines else None

    def power_cycle(self, now: int) -> None:
        """Switch off and on: all bytes on the way are lost."""
        for pending in (self.ring, self._coming, self._going, self._lines, self._kept):
            pending.clear()
        self.deaf = False
        self._rx_free = self._tx_free = float(now)

    def take(self, now: int) -> bytes:
        """Take the bytes that are out by ``now``."""
        return bytes(byte for _, byte in self.take_dated(now))

    def take_dated(self, now: int) -> list[tuple[int, int]]:
        """As :meth:`take`, each byte with its time."""
        out = []
        while self._going and self._going[0][0] <= now:
            out.append(self._going.popleft())
            if out[-1][1] == _NEWLINE:
                self._lines.popleft()
        return out
