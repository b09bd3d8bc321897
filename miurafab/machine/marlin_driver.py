"""The driver for controllers that speak Marlin.

One line is in flight at a time, with a number and a checksum. The driver sends it again if it was
damaged or its answer is missing. The job is done when the controller has answered ``M400``, which
waits for all motion to end.

On every other way out the driver sends ``M112`` first: it halts the controller with motors and
laser off until a reset, and it is the one command that Marlin obeys ahead of the others. ``M410``
stops the motion too, but leaves the laser on until a later ``M5``, so the driver does not rely on
it. A board without ``EMERGENCY_PARSER`` reads even M112 only between two commands; a finding says
so.

M112 shuts the beam and the motors; an air assist stays on (Marlin 2.1: ``minkill`` ends the cutter,
and only ``M9`` or a reset shuts the pin of ``AIR_ASSIST``), so the last words say that.

Marlin has no feed hold: the driver pauses by sending nothing more, and the machine still makes the
moves that it has planned. So it does at ``M0`` and ``M1``, once all motion has ended. The
controller gets neither: it would wait for its own button or ``M108`` without end, and a board
without display and ``EMERGENCY_PARSER`` does not know them (Marlin 2.1: ``M0_M1.cpp``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from miurafab.errors import ControllerError, MiurafabError, PortError
from miurafab.findings import Finding
from miurafab.gcode.job import SendLine
from miurafab.machine.greeting import ANSWER_S
from miurafab.machine.judge_job import longest_line
from miurafab.machine.judge_words import (
    air_after,
    leaves_air_on,
    line_of_plain_beam,
    waits_for_person,
)
from miurafab.machine.keys import HOLD
from miurafab.machine.progress import JobAborted
from miurafab.machine.session import HOMING_S
from miurafab.machine.stream_driver import JobContext, StreamDriver, nobody_there, waiting_at
from miurafab.machine.transcript import Transcript
from miurafab.machine.transport import Transport
from miurafab.marlin.connection import EMERGENCY, MarlinConnection
from miurafab.marlin.replies import Killed, MarlinError, MarlinOk, Reply, Started
from miurafab.profiles.machine import WAIT_S

WAS_HALTED = "the controller was halted (M112) with the laser off; reset it before it is used again"
NOT_CONFIRMED = (
    "the controller did not confirm that it halted, so switch the laser off at the machine"
)
DARK = (b"M5I", b"M5")
"""What ends a beam of before, by its panel or another program, and its inline mode."""
SET = (b"G21", b"G90", b"M220S100")
"""mm, absolute moves and feeds as written, as after power-up: a board that was not reset keeps its
last modes, and what the knob of its panel made of the feed."""
AIR_IS_ON = ", and the air stays on: shut it at the machine"
_LOOK_S = 0.05  # between two reads of the keys
_SILENCES = 3  # the line is sent again after each silence but the last
_KILL_S = 0.8  # from M112 to its answer
_KILLS = 3
_NO_PARSER = Finding(
    "no-emergency-parser",
    "The controller was built without EMERGENCY_PARSER: it obeys a stop only between two commands, "
    "so keep a switch for the laser in reach.",
)


class MarlinDriver(StreamDriver):
    """The driver of one job."""

    def __init__(self, context: JobContext) -> None:
        super().__init__(context)
        self._wire = MarlinWire(context.transport, context.transcript, context.check)
        self._taken = 0
        self._last = 0
        self._air = False
        self._waits = ""

    @property
    def acknowledged(self) -> int:
        """See :class:`~miurafab.machine.stream_driver.StreamDriver`."""
        return self._taken

    @property
    def line(self) -> int:
        """See :class:`~miurafab.machine.stream_driver.StreamDriver`."""
        return self._last

    def stream(self) -> None:
        """See :class:`~miurafab.machine.stream_driver.StreamDriver`."""
        wire = self._wire
        for line in self._lines():
            self._rest_while_held()
            if waits_for_person(line.data):
                self._pause(line)
            else:
                self._air = air_after(line.data, self._air)
                wire.send(line, self.attend_and_tell, self._where)
            self._taken, self._last = self._taken + 1, line.number
            self.attend_and_tell()
        air = (b"M9",) if leaves_air_on(self.plan.job) else ()
        for code in (b"M400", b"M5", *air):
            wire.send(SendLine(0, code), self.attend_and_tell, self._where)

    def obey(self) -> None:
        """See :class:`~miurafab.machine.stream_driver.StreamDriver`. A job whose beam would stay
        on is stopped in place of a hold.
        """
        laser = self.plan.machine.tool.kind == "laser"
        if laser and HOLD in self.orders and line_of_plain_beam(self.plan.job) is not None:
            raise JobAborted(
                f"{self.plan.job.name} was stopped at the keyboard, not held: after M3 or M4 "
                "without I the controller leaves the beam on at rest.",
                at_once=True,
            )
        super().obey()

    def _rest_while_held(self) -> None:
        while self.held:
            self.attend_and_tell()
            self._wire.listen(_LOOK_S, self._where)

    def _pause(self, line: SendLine) -> None:
        """Do what the plan says where the program waits for a person, in place of the controller.

        Raises :class:`~miurafab.errors.PersonNeeded` if nobody is there.
        """
        self._wire.send(SendLine(0, b"M400"), self.attend_and_tell, self._where)
        if self.plan.at_pause == "stop":
            raise nobody_there(self.plan.job.name, line.number, "cut the sheet anew")
        if self.plan.at_pause == "wait":
            self.held, self._waits = True, waiting_at(self.plan.job.name, line.number)
            self._rest_while_held()
            self._waits = ""

    @property
    def state(self) -> str:
        """See :class:`~miurafab.machine.stream_driver.StreamDriver`."""
        return self._waits or super().state

    def _lines(self) -> Iterator[SendLine]:
        job = self.plan.job
        return job.send_lines(longest_line(self.plan.machine))

    def prepare(self) -> tuple[Finding, ...]:
        """See :class:`~miurafab.machine.stream_driver.StreamDriver`."""
        plan, wire = self.plan, self._wire
        known = self._context.known
        wire.greet(0.0 if known.greeted else plan.wait)
        known.greeted = True
        said = wire.send(SendLine(0, b"M115"))
        for code in DARK if plan.machine.tool.kind == "laser" else ():
            wire.send(SendLine(0, code))
        if plan.options.home:
            self.at_risk = True
            wire.send(SendLine(0, b"G28XY"), patience=HOMING_S)
            self.at_risk = False
        for code in SET:
            wire.send(SendLine(0, code))
        if plan.at is not None:
            wire.send(SendLine(0, b"G92X%.3fY%.3f" % plan.at))
        parser = any("EMERGENCY_PARSER:1" in reply.text for reply in said)
        return () if parser or plan.machine.tool.kind != "laser" else (_NO_PARSER,)

    @property
    def _where(self) -> str:
        name = self.plan.job.name
        if not self._last:
            return f"before it took a line of {name}"
        return f"after it took line {self._last} of {name}"

    def stop(self, error: MiurafabError | None) -> str:
        """See :class:`~miurafab.machine.stream_driver.StreamDriver`."""
        outcome = WAS_HALTED if self._wire.kill() else NOT_CONFIRMED
        return outcome + AIR_IS_ON * self._air


class MarlinWire:
    """One conversation with one Marlin controller: the wire, the count, and the time."""

    def __init__(
        self,
        transport: Transport,
        transcript: Transcript | None = None,
        check: Callable[[], None] = lambda: None,
    ) -> None:
        self._transport = transport
        self._transcript = transcript
        self._check = check
        self._connection = MarlinConnection()
        self._start = transport.now()

    def now(self) -> float:
        """Seconds on the wire's clock since the conversation began."""
        return self._transport.now() - self._start

    def receive(self, timeout: float) -> list[Reply]:
        """The replies within ``timeout``; returns as soon as there are bytes."""
        self._check()
        data = self._transport.read(max(0.0, timeout))
        if not data:
            return []
        if self._transcript is not None:
            self._transcript.came(self.now(), data)
        self._connection.receive_data(data)
        return list(self._connection.replies())

    def listen(self, timeout: float, where: str) -> None:
        """Hear for ``timeout`` seconds what the controller says while it has nothing to do.

        Raises :class:`~miurafab.errors.ControllerError` for a halt or a restart.
        """
        for reply in self.receive(timeout):
            self._look(reply, None, where)

    def _write(self, data: bytes) -> None:
        self._transport.write(data)
        if self._transcript is not None:
            self._transcript.sent(self.now(), data)

    def greet(self, patience: float = WAIT_S) -> None:
        """Wait until the controller has started, if the opening of the port resets it, and set the
        count.

        It may take ``patience`` seconds to start; none if an earlier job has greeted it. Raises
        :class:`~miurafab.errors.PortError` if nothing that speaks Marlin answers.
        """
        end = self.now() + patience
        started = False
        while not started:
            left = max(0.0, end - self.now())
            started = any(isinstance(reply, Started) for reply in self.receive(left)) or not left
        try:
            self._exchange(self._connection.restart_count(), ANSWER_S, lambda: None, "")
        except ControllerError as error:
            raise PortError(
                f"Nothing that speaks Marlin answers at {self._transport.name} ({error}); check "
                "the port, the baud rate of the machine profile and the machine's power."
            ) from None
        # It then says every second that it is alive, so that silence means something.
        self.send(SendLine(0, b"M113S1"))

    def send(
        self,
        line: SendLine,
        meanwhile: Callable[[], None] = lambda: None,
        where: str = "",
        *,
        patience: float = ANSWER_S,
    ) -> list[Reply]:
        """Send ``line``, wait for its ``ok``, and return the replies before it.

        ``meanwhile`` is called twenty times a second, ``where`` is the tail of a sentence.
        Raises :class:`~miurafab.errors.ControllerError` for a line that is refused, a halt, a
        restart, or ``patience`` seconds of silence, three times.
        """
        return self._exchange(self._connection.send_line(line), patience, meanwhile, where)

    def _exchange(
        self, data: bytes, patience: float, meanwhile: Callable[[], None], where: str
    ) -> list[Reply]:
        connection = self._connection
        where = where or "before the job"
        line = connection.in_flight
        self._write(data)
        said: list[Reply] = []
        heard, silences = self.now(), 0
        while True:
            replies = self.receive(_LOOK_S)
            for reply in replies:
                heard = self.now()
                if isinstance(reply, MarlinOk) and reply.line is line:
                    return said
                self._look(reply, line, where)
                said.append(reply)
            silent = self.now() - heard > patience
            if connection.wants_again or silent:
                silences += silent
                if silences == _SILENCES:
                    raise ControllerError(
                        f"The controller has said nothing for {silences * patience:g} s {where}."
                    )
                heard = self.now()
                again = connection.send_again()
                if not again:
                    raise ControllerError(
                        f"The controller never got line {line.number if line else 0} undamaged "
                        f"{where}; look at the cable and the baud rate."
                    )
                self._write(again)
            meanwhile()

    def _look(self, reply: Reply, line: SendLine | None, where: str) -> None:
        text = reply.text.strip()
        if isinstance(reply, Killed):
            raise ControllerError(f"The controller halted {where} ('{text}').")
        if isinstance(reply, Started):
            raise ControllerError(
                f"The controller restarted by itself {where}; what it held is lost, so look at its "
                "power supply and its reset button."
            )
        if isinstance(reply, MarlinError):
            code = line.data.decode("ascii") if line is not None else ""
            number = f"line {line.number} ('{code}')" if line and line.number else f"'{code}'"
            raise ControllerError(f"The controller refused {number}: '{text}'.")

    def kill(self) -> bool:
        """Halt the controller; whether it confirmed. Never raises because of the wire."""
        try:
            for _ in range(_KILLS):
                self._transport.write_now(EMERGENCY)
                if self._transcript is not None:
                    self._transcript.sent(self.now(), EMERGENCY)
                end = self.now() + _KILL_S
                while self.now() < end:
                    if any(isinstance(reply, Killed) for reply in self.receive(end - self.now())):
                        return True
        except PortError:
            pass
        return False
