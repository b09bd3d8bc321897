"""A fake wire between the sender and the virtual controller: it chops and delays.

What fails on order is the virtual controller's (:mod:`miurafab.simulate.faults`). Time is the
controller's: no test sleeps. What the host wrote is kept with the time, and so can
be held against what the controller's beam log says.
"""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable

from miurafab.errors import PortError
from miurafab.simulate.grbl.controller import VirtualGrbl

BANNER = b"\r\nGrbl 1.1h ['$' for help]\r\n"


class FakeWire:
    """A :class:`~miurafab.machine.transport.Transport` to ``device``.

    ``latency`` is the longest delay of a piece either way, in seconds, drawn from ``seed``;
    pieces are 1 to 24 bytes long and never overtake each other. ``before_call`` is called with
    the number of the call to ``write``, ``write_now`` or ``read``, and may raise.
    """

    name = "the fake wire"
    blocks = False

    def __init__(
        self,
        device: VirtualGrbl,
        *,
        latency: float = 0.0,
        seed: int = 0,
        before_call: Callable[[int], None] = lambda call: None,
    ) -> None:
        self.device = device
        self.written: list[tuple[float, bytes]] = []
        self.calls = 0
        self.before_call = before_call
        self.closed = False
        self.lies: list[tuple[float, bytes]] = []  # what somebody else says to the host, and when
        self._latency = latency
        self._random = random.Random(seed)
        self._to_device: deque[tuple[float, bytes]] = deque()
        self._to_host: deque[tuple[float, bytes]] = deque()

    # The transport

    def now(self) -> float:
        return self.device.now

    def write(self, data: bytes) -> None:
        self._call()
        self.written.append((self.device.now, data))
        self._post(self._to_device, data)
        self._deliver()

    def write_now(self, data: bytes) -> None:
        self.write(data)

    def read(self, timeout: float) -> bytes:
        self._call()
        end = self.device.now + (max(timeout, 1e-6) if timeout > 0 else 0.0)
        while True:
            self._deliver()
            self._collect()
            due = b""
            while self._to_host and self._to_host[0][0] <= self.device.now:
                due += self._to_host.popleft()[1]
            left = end - self.device.now
            if due or left <= 0:
                return due
            waits = [left]
            for queue in (self._to_device, self._to_host, self.lies):
                if queue:
                    waits.append(queue[0][0] - self.device.now)
            if self._latency:  # the host gets every byte on its own
                upcoming = self.device.next_event_in()
                waits += [] if upcoming is None else [upcoming]
                self.device.advance(max(min(waits), 1e-6))
            else:
                self.device.advance_to_line(max(min(waits), 1e-6))

    def close(self) -> None:
        self.closed = True

    # What tests ask

    @property
    def bytes_written(self) -> bytes:
        return b"".join(data for _, data in self.written)

    @property
    def commands(self) -> bytes:
        """All that the host wrote, without the status queries."""
        return self.bytes_written.replace(b"?", b"")

    def settle(self, seconds: float = 30.0) -> None:
        """Let what is under way arrive, and the controller do whatever it still holds."""
        while self._to_device:
            self.device.advance(max(self._to_device[0][0] - self.device.now, 1e-6))
            self._deliver()
        self.device.advance(seconds)

    # The inside

    def _call(self) -> None:
        self.calls += 1
        if not self.device.connected:
            raise PortError("The port of the fake wire went away.")
        self.before_call(self.calls)

    def _post(self, queue: deque[tuple[float, bytes]], data: bytes) -> None:
        while data:
            size = self._random.randint(1, 24) if self._latency else len(data)
            earliest = queue[-1][0] if queue else self.device.now
            at = max(earliest, self.device.now + self._random.uniform(0, self._latency))
            queue.append((at, data[:size]))
            data = data[size:]

    def _deliver(self) -> None:
        while self._to_device and self._to_device[0][0] <= self.device.now:
            self.device.receive(self._to_device.popleft()[1])

    def _collect(self) -> None:
        output = self.device.take_output()
        while self.lies and self.device.now >= self.lies[0][0]:
            output += self.lies.pop(0)[1]
        self._post(self._to_host, output)
