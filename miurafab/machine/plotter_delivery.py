"""A file on its way to a cutter that speaks HPGL and answers nothing.

The cutter is greeted with nothing and asked nothing; it is given instructions as fast as its flow
control lets the wire take them, and at the end the pen is up. No journal is kept: what was handed
over is not what was cut. On every other way out the pen is sent up, behind what the cutter holds
unless it knows ``ESC.K`` (:mod:`miurafab.plotter.stream`).
"""

from __future__ import annotations

from collections.abc import Callable

from miurafab.errors import MiurafabError, PortError
from miurafab.machine.delivery import Delivery
from miurafab.machine.keys import ABORT, HOLD, KEYS, RESUME, Keys
from miurafab.machine.planning import Plan
from miurafab.machine.progress import JobAborted, Progress, StreamResult
from miurafab.machine.transcript import Transcript
from miurafab.machine.transport import FlowTransport
from miurafab.plotter.stream import PlotterStream

PEN_SENT_UP = "the cutter was told to lift its tool, after what it still holds"
NOT_TOLD = "the cutter could not be told to lift its tool, so lift it at the machine"
_GONE_ON = (
    "The cutter has been given everything; it answers nothing, so wait until it has cut what it "
    "holds."
)
_PIECE = 64
_MOST_WAITING = 128
"""Bytes that the driver may hold: so few that an end comes soon behind them."""
_LOOK_S = 0.02
_TELL_S = 0.2
_STOP_S = 3.0  # how long an XOFF may hold up the last bytes


class PlotterDelivery(Delivery):
    """See the module. ``check`` raises what should interrupt it."""

    def __init__(
        self,
        plan: Plan,
        transport: FlowTransport,
        transcript: Transcript | None,
        on_progress: Callable[[Progress], None] | None,
        keys: Keys,
        check: Callable[[], None],
    ) -> None:
        super().__init__(plan, transcript, None)
        self._transport = transport
        self._transcript = transcript
        self._on_progress = on_progress
        self._keys = keys
        self._check = check
        self._stream = PlotterStream(plan.job)
        self._held = False
        self._begin = transport.now()
        self._tell_at = self._begin

    @property
    def acknowledged(self) -> int:
        """The lines handed over, since nothing is acknowledged."""
        return self._stream.line

    def run(self) -> StreamResult:
        """See :class:`~miurafab.machine.delivery.Delivery`."""
        stream, transport = self._stream, self._transport
        self._begin = self._tell_at = transport.now()
        self.at_risk = True
        while not stream.finished:
            self._check()
            gone = 0
            if not self._held:
                gone = self._hand_over(stream.next_bytes(_PIECE))
                stream.took(gone)
            self._listen(0.0 if gone else _LOOK_S)
            self._look()
        while transport.waiting and self._check() is None:
            self._listen(_LOOK_S)
            self._look()
        self.at_risk = False
        remarks = (*self.plan.remarks, _GONE_ON, *self.close_records())
        return StreamResult(self.plan.lines, transport.now() - self._begin, (), remarks)

    def _hand_over(self, data: bytes) -> int:
        if not data or self._transport.waiting >= _MOST_WAITING:
            return 0
        count = self._transport.offer(data)
        if count and self._transcript is not None:
            self._transcript.sent(self._transport.now() - self._begin, data[:count])
        return count

    def _listen(self, timeout: float) -> None:
        data = self._transport.read(timeout)
        if data and self._transcript is not None:
            self._transcript.came(self._transport.now() - self._begin, data)
        self._stream.hear(data)

    def _look(self) -> None:
        for key in self._keys.pressed():
            order = KEYS.get(key)
            if order == ABORT:
                raise JobAborted(f"{self.plan.job.name} was stopped at the keyboard.")
            if order in (HOLD, RESUME):
                self._held = order == HOLD
        for record in self.records:
            record.check()
        now = self._transport.now()
        if self._on_progress is not None and now >= self._tell_at:
            self._tell_at = now + _TELL_S
            state = "Hold" if self._held or self._stream.waits else "Run"
            line = self._stream.line
            seconds = now - self._begin
            self._on_progress(Progress(line, self.plan.lines, seconds, state, None, 0, line, 100))

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
