"""One conversation with one controller: greet it, ask it, stop it.

A session joins the wire, the byte accounting of the connection and the transcript, which must
agree, and adds time. Every wait has a limit, and silence is an error with a sentence. Times are
those of the wire's own clock, so a session with a controller in memory takes no real second.

Stopping must always work. :meth:`Session.stop` puts a soft reset on the wire before anything else
and repeats it until a banner, or the same proof, says that the controller heard it (a controller
that writes its EEPROM is deaf for a moment). Then it asks for a status report, since only the
controller can say that the beam is off.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from miurafab.errors import ControllerError, MachineError, PortError
from miurafab.gcode.job import SendLine
from miurafab.grbl.connection import FEED_HOLD, SOFT_RESET, STATUS_QUERY, Connection
from miurafab.grbl.events import Alarm, Banner, Error, Event, Ok, Setting, StatusReport
from miurafab.grbl.lines import is_system
from miurafab.grbl.settings import Settings
from miurafab.grbl.states import State
from miurafab.grbl.streamer import alarm_words, error_words
from miurafab.machine.greeting import ANSWER_S, RESET_S, greet, restarts
from miurafab.machine.progress import AS_WRITTEN, Overrides
from miurafab.machine.transcript import Transcript
from miurafab.machine.transport import Transport
from miurafab.profiles.machine import WAIT_S

HOME = "$H"
"""Homing, after which the controller knows its place again."""
HOMING_S = 180.0
"""The longest time of homing; GRBL answers nothing meanwhile, not even a status query."""
_RESETS = 3
_MODES = "$G"  # answered in every state, behind the startup blocks
_HOLD_S = 1.0  # to come to rest from full speed before the reset that ends a refused job
_HOLD_POLL_S = 0.1  # GRBL asks for 10 queries a second at most (doc/markdown/interface.md)
_ASK_AGAIN_S = 1.0  # a status query that noise swallowed is asked again
_REPORT_INCHES = 13  # GRBL's setting: positions are reported in inches
_MM_PER_INCH = 25.4


class Session:
    """A conversation over ``transport``; mutable, for one thread.

    ``check`` is called before every read: it raises the exception that should interrupt the
    conversation. ``on_data`` is called with the bytes as they arrive. ``restarted``: the opening of
    the port reset the board. ``banner`` is what it greeted with, or what its ``$I`` says.
    ``patience`` is the longest time between two calls of ``check``, in seconds.
    ``starts`` grows with each reset that was sent or greeted; ``restarted_itself`` is set at one
    that nobody sent, until the position is known again. ``overrides`` are as written until
    they are told. ``runs_at_start``: it may run something after each reset, as startup blocks.
    ``ran``: it ran a program, by the last report that told of no hold and no open lid.
    """

    def __init__(
        self,
        transport: Transport,
        connection: Connection,
        check: Callable[[], None] = lambda: None,
    ) -> None:
        self.connection = connection
        self.banner = Banner("", "")
        self.restarted = False
        self.status: StatusReport | None = None
        self.work_offset: tuple[float, ...] | None = None
        self.overrides = AS_WRITTEN
        self.overrides_told = False
        self.mm_per_unit = 1.0
        self.starts = 0
        self.restarted_itself = False
        self.runs_at_start = self.ran = False
        self._resetting = False
        self.on_data: Callable[[bytes], None] = lambda data: None
        self.patience = math.inf
        self._transport = transport
        self.transcript: Transcript | None = None
        self._check = check
        self._asked_at: float | None = None
        self._start = transport.now()

    def now(self) -> float:
        """Seconds on the wire's clock since the session began."""
        return self._transport.now() - self._start

    @property
    def name(self) -> str:
        """The name of the port in messages."""
        return self._transport.name

    @property
    def position(self) -> tuple[float, ...] | None:
        """The work position of the last status report with a position."""
        status = self.status
        if status is None:
            return None
        if status.work_position is not None:
            return status.work_position
        if status.machine_position is None:
            return None
        offset = self.work_offset or (0.0,) * len(status.machine_position)
        return tuple(m - o for m, o in zip(status.machine_position, offset, strict=False))

    @property
    def machine_position(self) -> tuple[float, ...] | None:
        """The same in the machine's own coordinates."""
        status = self.status
        if status is None or status.machine_position is not None:
            return None if status is None else status.machine_position
        if status.work_position is None or self.work_offset is None:
            return None
        return tuple(w + o for w, o in zip(status.work_position, self.work_offset, strict=False))

    def take_restart(self) -> bool:
        """Whether the opening of the port reset the board and nobody was told; told then."""
        restarted, self.restarted = self.restarted, False
        return restarted and self._transport.blocks

    # The wire

    def write(self, data: bytes) -> None:
        """Send bytes that come from the connection."""
        self._transport.write(data)
        if self.transcript is not None:
            self.transcript.sent(self.now(), data)

    def receive(self, timeout: float) -> list[Event]:
        """The events that arrive within ``timeout``, or within the patience, if that is shorter;
        returns as soon as there are bytes.

        Raises :class:`~miurafab.errors.PortError` when the port goes away.
        """
        self._check()
        data = self._transport.read(min(max(0.0, timeout), self.patience))
        if not data:
            return []
        if self.transcript is not None:
            self.transcript.came(self.now(), data)
        self.on_data(data)
        self.connection.receive_data(data)
        events = list(self.connection.events())
        for event in events:
            if isinstance(event, StatusReport):
                self.status = event = event.scaled(self.mm_per_unit)
                self.work_offset = event.work_offset or self.work_offset
                if event.overrides is not None and len(event.overrides) == 3:
                    self.overrides = Overrides(*event.overrides)
                    self.overrides_told = True
                if event.state not in ("Hold", "Door"):
                    self.ran = event.state == "Run"
                self._asked_at = None
            elif isinstance(event, Banner):
                self.banner, self.ran = event, False
                self.starts += 1
                self.restarted_itself = self.restarted_itself or not self._resetting
                self._resetting = False
                self.overrides = AS_WRITTEN
                self.overrides_told = True
                self._asked_at = None
            elif isinstance(event, Setting) and event.number == _REPORT_INCHES:
                inches = Settings.from_events((event,)).values.get(_REPORT_INCHES)
                self._report_in(_MM_PER_INCH if inches else 1.0)
        return events

    def _report_in(self, mm_per_unit: float) -> None:
        """Take positions, those of the past too, as ``mm_per_unit`` long."""
        factor, self.mm_per_unit = mm_per_unit / self.mm_per_unit, mm_per_unit
        if self.status is not None:
            self.status = self.status.scaled(factor)
        if self.work_offset is not None:
            self.work_offset = tuple(factor * value for value in self.work_offset)

    def pause(self, seconds: float) -> None:
        """Let time pass on the wire's clock, and receive meanwhile."""
        end = self.now() + seconds
        while self.now() < end:
            self.receive(end - self.now())

    def ask_status(self) -> bool:
        """Send a status query, unless one is unanswered or the controller is deaf just now."""
        if self.connection.writing_eeprom:
            return False
        if self._asked_at is not None and self.now() < self._asked_at + _ASK_AGAIN_S:
            return False
        self._asked_at = self.now()
        self.write(self.connection.send_realtime(STATUS_QUERY))
        return True

    def forget_query(self) -> None:
        """A status query that is unanswered will not be answered: the controller was reset."""
        self._asked_at = None

    @property
    def awaits_status(self) -> bool:
        """Whether a status query is unanswered."""
        return self._asked_at is not None

    # Questions

    def wait_status(self, timeout: float = ANSWER_S) -> StatusReport:
        """A status report that answers a query sent now.

        Raises :class:`~miurafab.errors.ControllerError` after ``timeout`` seconds of silence.
        """
        report = self.fresh_status(timeout)
        if report is None:
            raise ControllerError(
                f"The controller at {self.name} did not answer a status query within "
                f"{timeout:g} s; check its power and the cable, then try again."
            )
        return report

    def fresh_status(self, timeout: float) -> StatusReport | None:
        """As :meth:`wait_status`, but None for silence."""
        end = self.now() + timeout
        asked = False
        while self.now() < end:
            asked = self.ask_status() or asked
            for event in self.receive(min(end - self.now(), _ASK_AGAIN_S)):
                if isinstance(event, StatusReport) and asked:
                    return event
        return None

    def command(self, text: str, timeout: float = ANSWER_S) -> list[Event]:
        """Send one line, wait for its ``ok``, and return the events before it.

        A controller that resets itself behind its answer, as after ``$RST=``, is waited for until
        it has run its startup blocks.

        Raises :class:`~miurafab.errors.ControllerError` for ``error:``, an alarm, an unexpected
        reset, or ``timeout`` seconds without an answer.
        """
        said, refusal = self._exchange(text, timeout)
        if refusal is not None:
            raise ControllerError(f"The controller refused '{text}': {error_words(refusal)}.")
        if self.connection.state is State.RESETTING:
            self.forget_query()
            if not restarts(self, RESET_S):
                raise ControllerError(f"The controller did not start again after '{text}'.")
            self._exchange(_MODES, timeout)
        if text.upper() == HOME:
            self.restarted_itself = False
        return said

    def ask(self, text: str) -> list[Event]:
        """The events that answer a question; none where the firmware does not know it.

        Raises as :meth:`command` does, but for ``error:``.
        """
        return self._exchange(text, ANSWER_S)[0]

    def _exchange(self, text: str, timeout: float) -> tuple[list[Event], Error | None]:
        self.require_ready(text)
        self.write(self.connection.send_line(SendLine(0, text.encode("ascii"))))
        said: list[Event] = []
        end = self.now() + timeout
        while self.now() < end:
            for event in self.receive(end - self.now()):
                match event:
                    case Ok():
                        return said, None
                    case Error():
                        return said, event
                    case Alarm():
                        raise ControllerError(
                            f"The controller stopped at '{text}': {alarm_words(event)}."
                        )
                    case Banner():
                        raise ControllerError(f"The controller restarted at '{text}'.")
                    case _:
                        said.append(event)
        raise ControllerError(
            f"The controller at {self.name} did not answer '{text}' within {timeout:g} s."
        )

    def home(self, heed: Callable[[], None] = lambda: None) -> None:
        """Run the homing cycle and wait for its end; raises as :meth:`command` does.

        Startup blocks run then.
        ``heed`` is called before every read meanwhile, as ``check`` is, and may raise.
        """
        check = self._check

        def both() -> None:
            check()
            heed()

        self._check = both
        try:
            self.command(HOME, HOMING_S)
        finally:
            self._check = check

    def require_ready(self, text: str) -> None:
        """Raise :class:`~miurafab.errors.ControllerError` where ``text`` cannot be sent now."""
        if self.connection.may_send(SendLine(0, text.encode("ascii"))):
            return
        if self.connection.state is State.LOCKED:
            raise ControllerError(
                f"The controller is locked after an alarm or before homing, so '{text}' was not "
                "sent; look at the machine, then home or unlock it."
            )
        raise ControllerError(
            f"The controller is not ready for '{text}' (it is {self.connection.state.name.lower()}"
            "); reset it first."
        )

    def require_nothing_waits(self) -> None:
        """Raise :class:`~miurafab.errors.ControllerError` where a resume would go on with a
        program.
        """
        if self.ran:
            raise ControllerError(
                "A program was running when the lid was opened, and would go on; resume it or stop "
                "it first."
            )

    # Beginning and end

    def greet(self, patience: float = WAIT_S, *, reset: bool = False) -> None:
        """See :func:`~miurafab.machine.greeting.greet`."""
        greet(self, patience, reset=reset)

    def wait_banner(self, timeout: float) -> Banner | None:
        """The next banner within ``timeout`` seconds, or None."""
        end = self.now() + timeout
        while self.now() < end:
            for event in self.receive(end - self.now()):
                if isinstance(event, Banner):
                    return event
        return None

    def stop(self, *, hold_first: bool = False) -> bool:
        """Reset the controller now; whether it then reported that the beam is off.

        The reset is the first byte on the wire. With ``hold_first`` it follows a feed hold, which a
        controller obeys that misses the reset. Never raises because of the machine: the answer for
        a wire that is gone is False.
        """
        try:
            for _ in range(_RESETS):
                self._reset_now(hold_first)
                if restarts(self, RESET_S):
                    report = self.fresh_status(ANSWER_S)
                    if self.runs_at_start and self.connection.state is not State.LOCKED:
                        break  # a block may move or wait before it lights
                    if report is None or not report.beam_on:  # it rests: it may have missed that
                        return report is not None and report.beam_off
            self.command("M5")  # a startup block, which runs after each reset, arms the beam
            report = self.fresh_status(ANSWER_S)
        except MachineError:
            return False
        return report is not None and report.beam_off

    def hold_and_stop(self) -> bool:
        """Let the motion come to rest before the reset, so that the position is not lost.

        For a job whose controller still obeys; the feed hold is the first thing on the wire, but in
        homing, which hears none.
        """
        if any(is_system(line.data) for line in self.connection.in_flight):
            return self.stop()
        try:
            self._transport.write_now(self.connection.send_realtime(FEED_HOLD))
            if self.transcript is not None:
                self.transcript.sent(self.now(), FEED_HOLD)
            end = self.now() + _HOLD_S
            at_rest = False
            while not at_rest and self.now() < end:
                report = self.fresh_status(end - self.now())
                at_rest = report is not None and _stands(report)
                if not at_rest:
                    self.pause(min(_HOLD_POLL_S, end - self.now()))
        except PortError:
            return False
        return self.stop()

    def _reset_now(self, hold_first: bool) -> None:
        data = self.connection.send_realtime(FEED_HOLD) if hold_first else b""
        data += self.connection.send_realtime(SOFT_RESET)
        self._transport.write_now(data)
        self._resetting = True
        self.starts += 1
        self.forget_query()
        if self.transcript is not None:
            self.transcript.sent(self.now(), data)


def _stands(report: StatusReport) -> bool:
    """Whether the axes stand, or no feed hold brings them to rest, as none does in homing; a hold
    has come to its end in ``Hold:0``.
    """
    if report.state == "Hold":
        return report.substate == 0
    return report.state not in ("Run", "Jog")
