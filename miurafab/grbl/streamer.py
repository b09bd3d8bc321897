"""The streamer: it decides when each line of a job is sent, and what the answers mean for the job.

There are two streaming modes. *Character counting* fills the controller's receive buffer with as
many whole lines as the byte accounting of the :class:`~miurafab.grbl.connection.Connection` allows,
so the planner never waits for the wire. *Send-response* sends one line and waits for its answer; it
is slow on a link with latency, and safe for firmware with an unreliable buffer.

A job continues only while every answer is ``ok`` and the controller accepts motion. Any other reply
ends the job with one sentence. The session then decides what to send (hold, reset), because this
module has no I/O and no clock.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from miurafab.errors import ControllerError, GcodeError
from miurafab.gcode.job import SendLine
from miurafab.grbl.codes import Code, alarm_codes, error_codes
from miurafab.grbl.connection import Connection
from miurafab.grbl.events import Alarm, Banner, Error, Event, Ok, StatusReport
from miurafab.grbl.lines import dwell_seconds
from miurafab.grbl.states import State


@dataclass(frozen=True, slots=True)
class Refusal:
    """A line that the controller answered with ``error:``, and the ``reason`` in words."""

    line: SendLine
    reason: str

    def __str__(self) -> str:
        return f"line {self.line.number} ('{self.line.data.decode('ascii')}'): {self.reason}"


class LineRefused(ControllerError):
    """The controller refused a line of a running job; the lines behind it must not run."""


class Streamer:
    """Sends the lines of one job through ``connection``.

    ``name`` stands for the job in messages. With ``collect_refusals`` (check mode, where nothing
    moves) refused lines are collected in ``refusals`` and do not end the job.
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
        """Seconds of G4 in the unanswered lines: the controller may be silent for this time."""
        return sum(dwell_seconds(line.data) for line in self._connection.in_flight)

    def pull(self) -> bytes:
        """The bytes that may be sent now; they are then in flight. Empty while answers are due.

        Raises :class:`~miurafab.errors.GcodeError` for a line longer than the receive buffer.
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
        """Apply ``event`` to the job.

        Raises :class:`~miurafab.errors.ControllerError` if it ends the job: :class:`LineRefused`
        for an ``error:``; else for an alarm, an unexpected reset or sleep, or an answer without a
        line in flight.
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
        """The position in the job, as the end of a sentence."""
        if self.last is None:
            return f"before it took a line of {self._name}"
        return f"after it took line {self.last.number} of {self._name}"


def error_words(event: Error) -> str:
    """``error:22, a feed move comes before ...``, or the text of the firmware."""
    return _words("error:", event.code, event.text, error_codes())


def alarm_words(event: Alarm) -> str:
    """``ALARM:1, a limit switch was hit; ...``, or the text of the firmware."""
    return _words("ALARM:", event.code, event.text, alarm_codes())


def _words(prefix: str, code: int | None, text: str, meanings: Mapping[int, Code]) -> str:
    if code is None:
        return text
    if code not in meanings:
        return f"{prefix}{code}, a code that GRBL 1.1 does not have"
    return f"{prefix}{code}, {meanings[code].text}"
