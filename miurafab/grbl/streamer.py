"""Which line of a job goes when, and what the controller's answers mean for the job.

Two ways to stream. *Character counting* fills the controller's receive buffer with whole lines,
as many as the books of the :class:`~miurafab.grbl.connection.Connection` allow, so that the
planner never waits for the wire. *Send-response* sends one line and waits for its answer: slow
on a link with latency, and right for firmware whose buffer is not to be trusted.

A job lives only while every answer is an ``ok`` and the controller is in a state to take motion.
Anything else ends it with the one sentence that says what happened; what to send then (hold,
reset) is the session's business, for this module knows neither wire nor clock.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from miurafab.errors import ControllerError, GcodeError
from miurafab.gcode.job import SendLine
from miurafab.grbl.codes import Code, alarm_codes, error_codes
from miurafab.grbl.connection import Connection, dwell_seconds
from miurafab.grbl.events import Alarm, Banner, Error, Event, Ok, StatusReport
from miurafab.grbl.states import State


@dataclass(frozen=True, slots=True)
class Refusal:
    """A line that the controller answered with ``error:``; ``reason`` says what that means."""

    line: SendLine
    reason: str

    def __str__(self) -> str:
        return f"line {self.line.number} ('{self.line.data.decode('ascii')}'): {self.reason}"


class LineRefused(ControllerError):
    """The controller refused a line of a running job; what it holds behind it must not run."""


class Streamer:
    """The lines of one job on their way through ``connection``.

    ``name`` is how messages call the job. With ``collect_refusals`` (check mode, where nothing
    moves) refused lines are gathered in ``refusals`` and do not end the job.
    """

    def __init__(
        self,
        connection: Connection,
        name: str,
        lines: Iterable[SendLine],
        *,
        send_response: bool = False,
        collect_refusals: bool = False,
    ) -> None:
        self.acknowledged = 0
        self.last: SendLine | None = None
        self.refusals: list[Refusal] = []
        self._connection = connection
        self._name = name
        self._lines = iter(lines)
        self._next = next(self._lines, None)
        self._send_response = send_response
        self._collect_refusals = collect_refusals

    @property
    def finished(self) -> bool:
        """Whether every line was sent and answered."""
        return self._next is None and not self._connection.in_flight

    @property
    def dwell_in_flight(self) -> float:
        """Seconds of G4 in the unanswered lines: so long may the controller idle unanswered."""
        return sum(dwell_seconds(line.data) for line in self._connection.in_flight)

    def pull(self) -> bytes:
        """All that may be sent now, entered in the books; empty if answers must come first.

        Raises :class:`~miurafab.errors.GcodeError` for a line that no buffer can ever hold.
        """
        data = bytearray()
        connection = self._connection
        while self._next is not None and connection.may_send(self._next):
            if self._send_response and connection.in_flight:
                break
            data += connection.send_line(self._next)
            self._next = next(self._lines, None)
        if self._next is not None and len(self._next.data) >= connection.rx_bytes:
            raise GcodeError(
                f"{self._name}, line {self._next.number} with its newline has "
                f"{len(self._next.data) + 1} bytes, more than the {connection.rx_bytes} bytes of "
                "the controller's receive buffer; split the line."
            )
        return bytes(data)

    def take(self, event: Event) -> None:
        """Note what ``event`` means for the job.

        Raises :class:`~miurafab.errors.ControllerError` when it ends the job:
        :class:`LineRefused` for an ``error:``, else an alarm, a reset or a sleep that nobody
        asked for, or an answer to nothing.
        """
        if isinstance(event, Ok | Error) and event.line is not None:
            self.acknowledged += 1
            self.last = event.line
            if isinstance(event, Error):
                self._refused(Refusal(event.line, error_words(event)))
        elif isinstance(event, Alarm):
            raise ControllerError(f"The controller stopped {self.where}: {alarm_words(event)}.")
        elif isinstance(event, Banner):
            raise ControllerError(
                f"The controller restarted by itself {self.where}; what it held is lost, so look "
                "at its power supply and its reset button."
            )
        elif isinstance(event, Ok | Error):
            raise ControllerError(
                f"The controller answered a line that was never sent {self.where}; another "
                "program may be using the port."
            )
        elif self._connection.state not in (State.GREETED, State.READY):
            state = event.state if isinstance(event, StatusReport) else "a lock"
            raise ControllerError(f"The controller went into {state} {self.where}.")

    def _refused(self, refusal: Refusal) -> None:
        self.refusals.append(refusal)
        if not self._collect_refusals:
            raise LineRefused(f"The controller refused {self._name}, {refusal}.")

    @property
    def where(self) -> str:
        """Where the job is, as the tail of a sentence."""
        if self.last is None:
            return f"before it took a line of {self._name}"
        return f"after it took line {self.last.number} of {self._name}"


def error_words(event: Error) -> str:
    """``error:22, a feed move comes before ...``, or the firmware's own words."""
    return _words("error:", event.code, event.text, error_codes())


def alarm_words(event: Alarm) -> str:
    """``ALARM:1, a limit switch was hit; ...``, or the firmware's own words."""
    return _words("ALARM:", event.code, event.text, alarm_codes())


def _words(prefix: str, code: int | None, text: str, meanings: Mapping[int, Code]) -> str:
    if code is None:
        return text
    if code not in meanings:
        return f"{prefix}{code}, a code that GRBL 1.1 does not have"
    return f"{prefix}{code}, {meanings[code].text}"
