"""The virtual controller's serial port: bytes that take time, and rings that run full.

Received bytes go through the interrupt (``serial.c``): realtime commands are taken out wherever
they stand, other bytes from 0x80 up are dropped (or kept: that is the dialect's), the rest goes
into a ring of 128 or so, and what finds it full is lost. While an EEPROM write keeps interrupts
off, the hardware holds two bytes and the one being shifted in; the others are lost too.
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
    """``ring`` holds received bytes not yet read; times are in processor cycles.

    ``on_realtime`` is called with each realtime byte and the time. ``baud`` None: bytes take no
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
        self._tx_free = 0.0

    def receive(self, now: int, data: bytes) -> None:
        """Bytes start down the wire to the controller."""
        for byte in data:
            self._rx_free = max(self._rx_free, now) + self.byte
            self._coming.append((math.ceil(self._rx_free), byte))

    def next_arrival(self) -> int | None:
        """When the next byte will have arrived."""
        return self._coming[0][0] if self._coming else None

    def arrive(self) -> None:
        """The next byte has arrived: the receive interrupt, or the hardware if it is off."""
        now, byte = self._coming.popleft()
        if not self.deaf:
            self._interrupt(now, byte)
        elif len(self._kept) < _DEAF_BYTES:
            self._kept.append(byte)
        else:
            self._kept[-1] = byte
            self.lost += 1

    def hear(self, now: int) -> None:
        """Interrupts are on again: take what the hardware kept."""
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
        """Free places in the receive ring."""
        return self.dialect.rx_bytes - len(self.ring)

    def write(self, now: int, data: bytes) -> int:
        """Print ``data``: when the last byte of it is in the transmit ring."""
        for byte in data:
            self._tx_free = max(self._tx_free, now) + self.byte
            self._going.append((math.ceil(self._tx_free), byte))
        return max(now, math.ceil(self._tx_free - self.dialect.tx_bytes * self.byte))

    def cut(self, now: int) -> None:
        """A reset ends a print that waits for room: what is not in the ring yet is not sent."""
        room = self.dialect.tx_bytes + 1
        sent = sum(done <= now for done, _ in self._going)
        while len(self._going) > sent + room:
            self._going.pop()
        self._tx_free = float(self._going[-1][0]) if self._going else float(now)

    def next_departure(self, now: int) -> int | None:
        """When the next byte that is not out by ``now`` will be out."""
        return next((done for done, _ in self._going if done > now), None)

    def next_line(self) -> int | None:
        """When the first line that is not taken yet will be out, or was."""
        return next((done for done, byte in self._going if byte == _NEWLINE), None)

    def power_cycle(self, now: int) -> None:
        """Switched off and on: all bytes on their way are lost."""
        for pending in (self.ring, self._coming, self._going, self._kept):
            pending.clear()
        self.deaf = False
        self._rx_free = self._tx_free = float(now)

    def take(self, now: int) -> bytes:
        """The bytes that are out by ``now``."""
        return bytes(byte for _, byte in self.take_dated(now))

    def take_dated(self, now: int) -> list[tuple[int, int]]:
        """The same, each with the time when it was out."""
        out = []
        while self._going and self._going[0][0] <= now:
            out.append(self._going.popleft())
        return out
