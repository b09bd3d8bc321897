"""The simulated cable between a sender and a simulator; it can lose, change and delay bytes.

Each direction is a :class:`Channel`: bytes go in at one end and come out at the other, at once
unless they are lost, changed, delayed or joined by noise. :class:`Cable` holds both channels,
counts bytes and time, and says when the next fault is due. A fault of the machine itself is handed
back to the machine.
"""

from __future__ import annotations

import math
import random
from collections import deque
from collections.abc import Callable, Iterable

from miurafab.simulate.faults import Fault

_NEWLINE = 10


class Channel:
    """One direction of the cable; times are in ticks."""

    def __init__(self, seed: int) -> None:
        self.drop = 0.0
        self.corrupt = 0.0
        self.late = 0
        self.held_until = 0
        self._random = random.Random(seed)
        self._under_way: deque[tuple[int, int]] = deque()

    def carry(self, now: int, data: bytes) -> None:
        """Put bytes in."""
        for byte in data:
            if self.drop > 0:
                self.drop -= 1
                continue
            if self.corrupt > 0:
                self.corrupt -= 1
                byte ^= 1 << self._random.randrange(8)
            self._put(max(now, self.held_until) + self.late, byte)

    def noise(self, now: int, count: float) -> None:
        """Put ``count`` random bytes in."""
        for byte in self._random.randbytes(int(count)):
            self._put(now, byte)

    def _put(self, at: int, byte: int) -> None:
        if self._under_way:
            at = max(at, self._under_way[-1][0])  # no byte overtakes another
        self._under_way.append((at, byte))

    def next_after(self, now: int) -> int | None:
        """The time when the next byte after ``now`` comes out."""
        return next((at for at, _ in self._under_way if at > now), None)

    def next_line(self) -> int | None:
        """The time when the first line end comes out."""
        return next((at for at, byte in self._under_way if byte == _NEWLINE), None)

    def take(self, now: int) -> bytes:
        """The bytes that came out by ``now``."""
        out = bytearray()
        while self._under_way and self._under_way[0][0] <= now:
            out.append(self._under_way.popleft()[1])
        return bytes(out)

    def clear(self) -> None:
        """Lose all bytes on the way."""
        self._under_way.clear()


class Cable:
    """Both directions, and the pending ``faults``.

    A second has ``second`` ticks. ``on_fault`` is called with each fault of the machine itself, and
    the time.
    """

    def __init__(
        self, faults: Iterable[Fault], on_fault: Callable[[Fault, int], None], second: int
    ) -> None:
        faults = tuple(faults)
        self.inward, self.outward = Channel(1), Channel(2)
        self.connected = True
        self._on_fault = on_fault
        self._second = second
        self._at_byte = deque(
            sorted((f for f in faults if f.at_byte is not None), key=lambda f: f.at_byte or 0)
        )
        self._at_time = deque(
            sorted((f for f in faults if f.at_s is not None), key=lambda f: f.at_s or 0.0)
        )
        self._sent = 0
        self._first: int | None = None
        self._back_at: int | None = None

    def send(self, now: int, data: bytes) -> None:
        """The sender sends ``data``; the faults at these bytes strike."""
        if data and self._first is None:
            self._first = now
        self._strike_timed(now)
        while data:
            size = len(data)
            if self._at_byte:
                size = min(size, (self._at_byte[0].at_byte or 0) - 1 - self._sent)
            piece, data = data[:size], data[size:]
            self._sent += size
            if self.connected:
                self.inward.carry(now, piece)
            while self._at_byte and self._at_byte[0].at_byte == self._sent + 1 and data:
                self._strike(self._at_byte.popleft(), now)

    def reply(self, dated: Iterable[tuple[int, int]]) -> None:
        """The machine sent bytes, each at its time."""
        if self.connected:
            for at, byte in dated:
                self.outward.carry(at, bytes((byte,)))

    def next_due(self, now: int) -> int | None:
        """The time of the next change: a fault strikes or ends, or a byte comes out."""
        due = (
            self._next_timed(),
            self._back_at,
            self.inward.next_after(-1),
            self.outward.next_after(now),
        )
        return min((at for at in due if at is not None), default=None)

    def happen(self, now: int) -> bytes:
        """Start and end the faults that are due; returns the bytes that reach the machine."""
        if self._back_at is not None and self._back_at <= now:
            self._back_at = None
            self.connected = True
        self._strike_timed(now)
        return self.inward.take(now)

    def _strike_timed(self, now: int) -> None:
        timed = self._next_timed()
        while timed is not None and timed <= now:
            self._strike(self._at_time.popleft(), now)
            timed = self._next_timed()

    def _next_timed(self) -> int | None:
        if self._first is None or not self._at_time:
            return None
        return self._first + round((self._at_time[0].at_s or 0.0) * self._second)

    def _strike(self, fault: Fault, now: int) -> None:
        kind, value = fault.kind, fault.value
        way = self.outward if kind.endswith("-reply") else self.inward
        match kind.removesuffix("-reply"):
            case "drop":
                way.drop += value
            case "corrupt":
                way.corrupt += value
            case "noise":
                way.noise(now, value)
            case "delay":
                way.held_until = now + round(value * self._second)
            case "slow":
                self.inward.late = self.outward.late = round(value * self._second)
            case "disconnect":
                self.connected = False
                self.inward.clear()
                self.outward.clear()
                if value < math.inf:
                    self._back_at = now + round(value * self._second)
            case _:
                self._on_fault(fault, now)
