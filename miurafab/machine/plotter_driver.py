"""The driver for cutters that speak HPGL, which answer nothing.

The driver sends no greeting and no question. It sends instructions as fast as the flow control of
the cutter allows; at the end the pen is up. The journal records what was handed over, which is not
what was cut. On every other way out the driver sends the pen up. The cutter first draws what it
holds, unless it knows ``ESC.K`` (:mod:`miurafab.plotter.stream`).
"""

from __future__ import annotations

from miurafab.errors import MiurafabError, PortError
from miurafab.findings import Finding
from miurafab.machine.stream_driver import JobContext, StreamDriver
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
"""The most bytes in the operating system's buffer: few, so that a stop soon reaches the cutter."""
_LOOK_S = 0.02
_STOP_S = 3.0  # how long an XOFF may hold up the last bytes


class PlotterDriver(StreamDriver):
    """The driver of one job."""

    taken = "handed over"

    def __init__(self, context: JobContext) -> None:
        super().__init__(context)
        self._transport = context.transport
        self._transcript = context.transcript
        self._check = context.check
        self._stream = PlotterStream(context.plan.job)

    @property
    def acknowledged(self) -> int:
        """See :class:`~miurafab.machine.stream_driver.StreamDriver`."""
        return self._stream.lines

    @property
    def line(self) -> int:
        """See :class:`~miurafab.machine.stream_driver.StreamDriver`."""
        return self._stream.line

    @property
    def state(self) -> str:
        """See :class:`~miurafab.machine.stream_driver.StreamDriver`."""
        return "Hold" if self.held or self._stream.waits else "Run"

    def stream(self) -> None:
        """See :class:`~miurafab.machine.stream_driver.StreamDriver`."""
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

    def finish(self) -> tuple[Finding, ...]:
        """See :class:`~miurafab.machine.stream_driver.StreamDriver`."""
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
        """See :class:`~miurafab.machine.stream_driver.StreamDriver`."""
        return PEN_SENT_UP if send_up(self._transport, self._stream.abort()) else NOT_TOLD


def send_up(transport: FlowTransport, data: bytes) -> bool:
    """Send ``data``, which lifts the tool; whether it left in time. Never raises."""
    try:
        end = transport.now() + _STOP_S
        while (data or transport.waiting) and transport.now() < end:
            data = data[transport.offer(data) :] if data else data
            transport.read(_LOOK_S)
        return not data and not transport.waiting
    except PortError:
        return False
