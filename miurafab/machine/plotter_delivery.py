"""A file on its way to a cutter that speaks HPGL and answers nothing.

The cutter is greeted with nothing and asked nothing; it is given instructions as fast as its flow
control lets the wire take them, and at the end the pen is up. The journal tells what was handed
over, which is not what was cut. On every other way out the pen is sent up, behind what the cutter
holds unless it knows ``ESC.K`` (:mod:`miurafab.plotter.stream`).
"""

from __future__ import annotations

from miurafab.errors import MiurafabError, PortError
from miurafab.findings import Finding
from miurafab.machine.delivery import Delivery, Errand
from miurafab.machine.transport import FlowTransport
from miurafab.plotter.stream import PlotterStream

PEN_SENT_UP = "the cutter was told to lift its tool, after what it still holds"
NOT_TOLD = "the cutter could not be told to lift its tool, so lift it at the machine"
_GONE_ON = Finding(
    "no-answer",
    "The cutter has been given everything; it answers nothing, so wait until it has cut what it "
    "holds.",
)
_PIECE = 64
_MOST_WAITING = 128
"""Bytes that the driver may hold: so few that an end comes soon behind them."""
_LOOK_S = 0.02
_STOP_S = 3.0  # how long an XOFF may hold up the last bytes


class PlotterDelivery(Delivery):
    """See the module."""

    taken = "handed over"

    def __init__(self, errand: Errand) -> None:
        super().__init__(errand)
        self._transport = errand.transport
        self._transcript = errand.transcript
        self._check = errand.check
        self._stream = PlotterStream(errand.plan.job)

    @property
    def acknowledged(self) -> int:
        """See :class:`~miurafab.machine.delivery.Delivery`."""
        return self._stream.lines

    @property
    def line(self) -> int:
        """See :class:`~miurafab.machine.delivery.Delivery`."""
        return self._stream.line

    @property
    def state(self) -> str:
        """See :class:`~miurafab.machine.delivery.Delivery`."""
        return "Hold" if self.held or self._stream.waits else "Run"

    def stream(self) -> None:
        """See :class:`~miurafab.machine.delivery.Delivery`."""
        stream, transport = self._stream, self._transport
        while not stream.finished:
            self._check()
            gone = 0
            if not self.held:
                gone = self._hand_over(stream.next_bytes(_PIECE))
                stream.took(gone)
            self._listen(0.0 if gone else _LOOK_S)
            self.attend_and_tell()
        while transport.waiting:
            self._check()
            self._listen(_LOOK_S)
            self.attend_and_tell()

    def part(self) -> tuple[Finding, ...]:
        """See :class:`~miurafab.machine.delivery.Delivery`."""
        return (_GONE_ON,)

    def _hand_over(self, data: bytes) -> int:
        if not data or self._transport.waiting >= _MOST_WAITING:
            return 0
        count = self._transport.offer(data)
        if count and self._transcript is not None:
            self._transcript.sent(self._seconds, data[:count])
        return count

    def _listen(self, timeout: float) -> None:
        data = self._transport.read(timeout)
        if data and self._transcript is not None:
            self._transcript.came(self._seconds, data)
        self._stream.hear(data)

    def stop(self, error: MiurafabError | None) -> str:
        """See :class:`~miurafab.machine.delivery.Delivery`."""
        return PEN_SENT_UP if send_up(self._transport, self._stream.abort()) else NOT_TOLD


def send_up(transport: FlowTransport, data: bytes) -> bool:
    """Hand over ``data``, which lifts the tool; whether it has left in time. Never raises."""
    try:
        end = transport.now() + _STOP_S
        while (data or transport.waiting) and transport.now() < end:
            data = data[transport.offer(data) :] if data else data
            transport.read(_LOOK_S)
        return not data and not transport.waiting
    except PortError:
        return False
