"""A machine in memory with faults: on its cable, or in the machine itself.

The virtual GRBL has its own cable, in step with its processor's clock. This one stands around any
other machine that runs only by ``advance``, such as the virtual Marlin and the virtual cutter.
"""

from __future__ import annotations

from collections.abc import Iterable

from miurafab.machine.transport import Device
from miurafab.simulate.beam import BeamSegment
from miurafab.simulate.cable import Cable
from miurafab.simulate.faults import Fault

_SECOND = 1_000_000  # ticks of the cable's clock


class FaultyDevice:
    """``device``, as :class:`~miurafab.machine.transport.Device`; ``faults`` strike once each."""

    def __init__(self, device: Device, faults: Iterable[Fault]) -> None:
        self._device = device
        self._cable = Cable(faults, self._suffer, _SECOND)

    @property
    def now(self) -> float:
        """See :class:`~miurafab.machine.transport.Device`, as all below."""
        return self._device.now

    @property
    def connected(self) -> bool:
        """Whether the cable is in."""
        return self._cable.connected

    @property
    def resets_on_open(self) -> bool:
        """As the machine itself."""
        return self._device.resets_on_open

    @property
    def beam_log(self) -> list[BeamSegment]:
        """What it burnt or drew."""
        return self._device.beam_log

    @property
    def lost_bytes(self) -> int:
        """Bytes that it had no room for; those lost on the cable are not counted."""
        return self._device.lost_bytes

    @property
    def waiting(self) -> int:
        """Bytes that are still on the wire."""
        return int(getattr(self._device, "waiting", 0))

    def power_cycle(self) -> None:
        """Switch off and on."""
        self._device.power_cycle()

    def freeze(self, seconds: float) -> None:
        """Its program hangs."""
        self._device.freeze(seconds)

    def next_event_in(self) -> float | None:
        """Seconds until something changes by itself; None if nothing will."""
        own, due = self._device.next_event_in(), self._cable.next_due(self._ticks)
        waits = [] if own is None else [own]
        waits += [] if due is None else [max(0.0, due / _SECOND - self.now)]
        return min(waits, default=None)

    def advance(self, seconds: float) -> None:
        """Let time pass."""
        self._run(self.now + max(seconds, 0.0), stop_at_line=False)

    def advance_to_line(self, seconds: float) -> None:
        """Let time pass until a line has come out of the cable, ``seconds`` at the most."""
        self._run(self.now + max(seconds, 0.0), stop_at_line=True)

    def _run(self, target: float, *, stop_at_line: bool) -> None:
        """Advance from event to event, so that every byte enters the cable at its time."""
        while True:
            self._exchange()
            line = self._cable.outward.next_line() if stop_at_line else None
            if line is not None:
                target = min(target, max(line / _SECOND, self.now))
            if self.now >= target:
                return
            wait = self.next_event_in()
            left = target - self.now
            # At least a tick, since the cable's clock cannot tell what is closer.
            self._device.advance(left if wait is None else min(left, max(wait, 1 / _SECOND)))

    def receive(self, data: bytes) -> None:
        """Bytes go into the cable."""
        self._exchange()
        self._cable.send(self._ticks, data)
        self._exchange()

    def take_output(self) -> bytes:
        """What has come out of the cable since the last call."""
        self._exchange()
        return self._cable.outward.take(self._ticks)

    @property
    def _ticks(self) -> int:
        return round(self.now * _SECOND)

    def _exchange(self) -> None:
        """Move the bytes that are due between the machine and the cable."""
        now = self._ticks
        self._cable.reply((now, byte) for byte in self._device.take_output())
        self._device.receive(self._cable.happen(now))

    def _suffer(self, fault: Fault, now: int) -> None:
        """A fault of the machine itself, not of its cable."""
        if fault.kind in ("reset", "power"):
            self._device.power_cycle()
        else:
            self._device.freeze(fault.value)
