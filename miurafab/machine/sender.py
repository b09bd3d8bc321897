"""A job sent to a machine, from the opening of the port to the last move, safe on every way out.

The way through: the job is checked by itself; the port is opened and the controller greeted,
asked and checked; the journal and the transcript are proved to be writable; the lines are
streamed; the job is done when every line was acknowledged *and* a status report that was asked
for after the last acknowledgement says Idle.

Every other way out - a refused line, an alarm, a reset, silence, a full disk, Ctrl-C, SIGTERM, an
exception in somebody's progress callback - resets the controller before anything else happens,
asks it whether the beam is off, and puts the answer into the sentence that the user reads. The
one exception is an abort at the keyboard of a job that goes dark at rest (M4): a feed hold before
the reset lets the machine keep its position. An ``M5`` is never relied on: it would wait in the
controller's queue behind up to seconds of burning.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import ExitStack, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from miurafab.errors import (
    ControllerError,
    JobStopped,
    MachineError,
    MiurafabError,
)
from miurafab.gcode.job import Job, prepare_lines
from miurafab.gcode.moves import BEAM_M3
from miurafab.grbl.connection import Connection
from miurafab.grbl.events import Error, Event, Ok, Options, StatusReport
from miurafab.grbl.settings import Settings, virtual_settings
from miurafab.grbl.streamer import LineRefused, Refusal, Streamer
from miurafab.machine.journal import Journal
from miurafab.machine.keys import ABORT, KEYS, Keys, NoKeys
from miurafab.machine.planning import Plan, plan_job
from miurafab.machine.preflight import (
    check_settings,
    check_status,
    check_travel,
    raise_findings,
)
from miurafab.machine.resume import Resumption
from miurafab.machine.session import ANSWER_S, Session
from miurafab.machine.signals import StopSignals
from miurafab.machine.transcript import Transcript
from miurafab.machine.transport import Transport, open_port
from miurafab.profiles import MachineProfile

_POLL_S = 0.2  # between status queries while lines flow
_END_POLL_S = 0.1  # and when only the last moves are awaited
_KEY_S = 0.01  # between two looks at the keyboard, if there is one


@dataclass(frozen=True, slots=True)
class Progress:
    """Where a running job is; ``position`` in work coordinates, ``in_flight`` in bytes.

    ``line`` is the last acknowledged one of the file (0: none); ``feed_override`` in percent.
    """

    lines_acknowledged: int
    lines_total: int
    seconds_elapsed: float
    state: str
    position: tuple[float, ...] | None
    in_flight: int
    line: int
    feed_override: int


@dataclass(frozen=True)
class StreamResult:
    """A job that is done: every line acknowledged, the machine idle.

    ``seconds`` on the wire's clock from the first line to Idle; ``errors`` the refused lines of a
    run in check mode (a real run ends at the first); ``remarks`` what was forced, and what went
    wrong without harm.
    """

    lines: int
    seconds: float
    errors: tuple[Refusal, ...]
    remarks: tuple[str, ...]


def stream_job(
    job: Job,
    machine: MachineProfile,
    port: str,
    *,
    journal_path: Path | None = None,
    transcript_path: Path | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    force: frozenset[str] = frozenset(),
    allow_m3: bool = False,
    check_mode: bool = False,
    home: bool = False,
    at: tuple[float, float] | None = None,
    resumption: Resumption | None = None,
    most_power: float = 1.0,
    keys: Keys | None = None,
    virtual_speed: float | None = None,
) -> StreamResult:
    """Send ``job`` to ``machine`` at ``port`` and wait until it is done.

    ``port`` is a device, a pyserial URL, or ``virtual`` for a controller in memory set up as the
    profile says, as fast as the computer allows or at ``virtual_speed`` times real time.
    ``on_progress`` is called about five times a second. ``force`` names checks to override
    (:data:`~miurafab.machine.preflight.CHECKS`). With ``check_mode`` the controller only reads
    the job (``$C``): nothing moves, and refused lines are gathered in the result. With ``home``
    the machine is homed first, in the same conversation: most boards forget where they are when
    the port is opened. ``at`` states where the head stands (X, Y in mm, in the job's
    coordinates), for a machine without homing switches. With ``resumption`` the rest of ``job``
    is sent; it needs one of the two. ``most_power`` is the most that the material takes, as a
    fraction of full power; ``keys`` may hold, resume, abort and override while the job runs.

    Raises :class:`~miurafab.errors.InputError` for a job or option at fault,
    :class:`~miurafab.errors.PortError` and :class:`~miurafab.errors.ControllerError` for what the
    machine did, :class:`~miurafab.errors.JobStopped` after Ctrl-C, SIGTERM or SIGHUP. Whichever
    it is, the controller was reset if a line of the job had been sent.
    """
    plan = plan_job(
        job,
        machine,
        force=force,
        allow_m3=allow_m3,
        check_mode=check_mode,
        home=home,
        at=at,
        resumption=resumption,
        most_power=most_power,
    )
    return stream_plan(
        plan,
        port,
        journal_path=journal_path,
        transcript_path=transcript_path,
        on_progress=on_progress,
        keys=keys,
        virtual_speed=virtual_speed,
    )


def stream_plan(
    plan: Plan,
    port: str,
    *,
    journal_path: Path | None = None,
    transcript_path: Path | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    keys: Keys | None = None,
    virtual_speed: float | None = None,
    signals: StopSignals | None = None,
) -> StreamResult:
    """Send a planned job; see :func:`stream_job`. ``signals`` are those already caught, if any."""
    with StopSignals() if signals is None else nullcontext(signals) as signals:
        try:
            transport = open_port(
                port,
                plan.machine.controller.baud,
                virtual_settings(plan.machine),
                virtual_speed,
            )
            signals.at_once = transport.blocks
            return deliver(
                plan,
                transport,
                signals,
                journal_path=journal_path,
                transcript_path=transcript_path,
                on_progress=on_progress,
                keys=keys,
            )
        except KeyboardInterrupt:
            raise JobStopped(f"{plan.job.name} was stopped by {signals.reason}.") from None


def deliver(
    plan: Plan,
    transport: Transport,
    signals: StopSignals,
    *,
    journal_path: Path | None = None,
    transcript_path: Path | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    keys: Keys | None = None,
) -> StreamResult:
    """Send a planned job over an open wire and close it; see :func:`stream_job`."""
    job, machine = plan.job, plan.machine
    with ExitStack() as at_end:
        at_end.callback(transport.close)
        transcript = journal = None
        if transcript_path is not None:
            transcript = Transcript(transcript_path, f"{job.name} to {transport.name}")
            at_end.callback(transcript.close)
        if journal_path is not None and not plan.check_mode:
            rest = plan.resumption
            journal = Journal(
                journal_path,
                job,
                machine.name,
                transport.name,
                plan.lines,
                from_line=rest.line if rest else 1,
                sha256=rest.sha256 if rest else None,
            )
            at_end.callback(journal.close)
        connection = Connection(machine.controller.rx_bytes)
        session = Session(transport, connection, transcript, signals.check)
        delivery = _Delivery(plan, session, transcript, journal, on_progress, keys or NoKeys())
        # A signal between an exception and its handling would skip the handling, not this.
        at_end.callback(delivery.make_safe)
        try:
            return delivery.run()
        except KeyboardInterrupt:
            signals.hold()
            delivery.end(JobStopped(f"{job.name} was stopped by {signals.reason}."))
        except MiurafabError as error:
            signals.hold()
            delivery.end(error)
        except BaseException:
            signals.hold()
            raise


class JobAborted(JobStopped):
    """The job was ended at the keyboard, with time for the machine to come to rest."""


class _Delivery:
    """One job on its way over one session."""

    def __init__(
        self,
        plan: Plan,
        session: Session,
        transcript: Transcript | None,
        journal: Journal | None,
        on_progress: Callable[[Progress], None] | None,
        keys: Keys,
    ) -> None:
        self._keys = keys
        self._patience = math.inf if isinstance(keys, NoKeys) else _KEY_S
        self._orders: list[bytes] = []
        self._plan = plan
        self._session = session
        self._records = [record for record in (transcript, journal) if record is not None]
        self._journal = journal
        self._on_progress = on_progress
        self._at_risk = False  # whether the machine may move or burn by what we sent
        self._begin = 0.0
        self._streamer = Streamer(
            session.connection,
            plan.job.name,
            prepare_lines(plan.job.name, plan.job.iter_lines(), plan.machine.controller.line_chars),
            send_response=plan.machine.controller.streaming == "send-response",
            collect_refusals=plan.check_mode,
        )

    # The way through

    def run(self) -> StreamResult:
        remarks = self._plan.remarks + self._meet()
        session, streamer = self._session, self._streamer
        self._at_risk = True
        if self._plan.check_mode:
            session.command("$C")
        self._begin = session.now()
        self._stream()
        seconds = session.now() - self._begin
        if self._plan.check_mode:
            session.stop()
        elif self._plan.machine.tool.kind == "laser" and session.wait_status().beam_on:
            session.stop()
            remarks += ("The job ended with the laser armed, so the controller was reset.",)
        self._at_risk = False
        if self._journal is not None:
            self._journal.ended("done", f"{streamer.acknowledged} lines acknowledged, then idle")
        remarks += self._close_records()
        return StreamResult(streamer.acknowledged, seconds, tuple(streamer.refusals), remarks)

    def _close_records(self) -> tuple[str, ...]:
        """Finish the files; a fault now does not undo the job, so it is a remark."""
        remarks = []
        for record in self._records:
            record.close()
            try:
                record.check()
            except MachineError as error:
                remarks.append(str(error))
        return tuple(remarks)

    def _meet(self) -> tuple[str, ...]:
        """Greet the controller and make all checks that need it; the sentences forced."""
        plan, session = self._plan, self._session
        session.greet()
        if plan.home:
            self._at_risk = True
            session.home()
            self._at_risk = False
        if plan.at is not None:
            session.command("G92X{:.3f}Y{:.3f}".format(*plan.at))
        remarks = raise_findings(check_status(session.wait_status()), plan.force)
        options = (event for event in session.command("$I") if isinstance(event, Options))
        for option in options:
            if self._journal is not None and option.planner_blocks is not None:
                self._journal.plans_ahead(option.planner_blocks)
        settings = Settings.from_events(session.command("$$"))
        findings = list(check_settings(plan.machine, settings))
        if plan.program is not None:
            findings.extend(check_travel(plan.program, settings, session.work_offset))
        return remarks + raise_findings(findings, plan.force)

    def _stream(self) -> None:
        session, streamer = self._session, self._streamer
        poll_at = answered = session.now()
        asked_last = False  # whether a status was asked for after the last acknowledgement
        while True:
            if not session.connection.in_flight:
                answered = session.now()
            data = streamer.pull()
            if data:
                session.write(data)
            if streamer.finished and not asked_last and not session.awaits_status:
                asked_last = session.ask_status()
                poll_at = session.now() + _END_POLL_S
            elif session.now() >= poll_at:
                session.ask_status()
                poll_at = session.now() + (_END_POLL_S if streamer.finished else _POLL_S)
            events = session.receive(min(poll_at - session.now(), self._patience))
            for event in events:
                streamer.take(event)
                if isinstance(event, Ok | Error):
                    answered = session.now()
                elif isinstance(event, StatusReport):
                    self._report(event)
                    if asked_last and event.state in ("Idle", "Check"):
                        return
                    if event.state in ("Hold", "Door"):
                        answered = session.now()
                    self._watch_for_loss(event, answered)
            self._after(events)
            self._obey()

    def _obey(self) -> None:
        """Do what was asked for at the keyboard."""
        self._orders += [KEYS[key] for key in self._keys.pressed() if key in KEYS]
        if ABORT in self._orders:
            raise JobAborted(f"{self._plan.job.name} was stopped at the keyboard.")
        if not self._session.connection.writing_eeprom:
            for order in self._orders:
                self._session.write(self._session.connection.send_realtime(order))
            self._orders.clear()

    def _after(self, events: list[Event]) -> None:
        session, streamer = self._session, self._streamer
        if not events and session.now() - session.heard > ANSWER_S:
            raise ControllerError(
                f"The controller has said nothing for {ANSWER_S:g} s, not even to status queries, "
                f"{streamer.where}."
            )
        if self._journal is not None and streamer.last is not None and events:
            seconds = session.now() - self._begin
            self._journal.taken(streamer.acknowledged, streamer.last.number, seconds)
        for record in self._records:
            record.check()

    def _watch_for_loss(self, report: StatusReport, answered: float) -> None:
        """A controller that idles while it owes an answer never got the line whole."""
        owed = self._session.connection.in_flight
        patience = ANSWER_S + self._streamer.dwell_in_flight
        if owed and report.state == "Idle" and self._session.now() - answered > patience:
            raise ControllerError(
                f"The controller is idle but has not answered line {owed[0].number} of "
                f"{self._plan.job.name} for {patience:g} s: bytes were lost on the way, so look at "
                "the cable and the baud rate."
            )

    def _report(self, status: StatusReport) -> None:
        if self._on_progress is not None:
            session, streamer = self._session, self._streamer
            self._on_progress(
                Progress(
                    streamer.acknowledged,
                    self._plan.lines,
                    session.now() - self._begin,
                    status.state,
                    session.position,
                    session.connection.in_flight_bytes,
                    streamer.last.number if streamer.last else 0,
                    session.feed_override,
                )
            )

    # The other ways out

    def end(self, error: MiurafabError) -> NoReturn:
        """Stop the machine if it is at risk, and raise ``error`` with what became of it."""
        sentence = str(error)
        if self._at_risk:
            gently = isinstance(error, JobAborted) and not self._burns_at_rest
            refused = isinstance(error, LineRefused)
            off = (
                self._session.hold_and_stop() if gently else self._session.stop(hold_first=refused)
            )
            self._at_risk = False
            count = self._streamer.acknowledged
            outcome = (
                "the controller was reset and reports the beam off"
                if off
                else "the controller did not confirm that the beam is off, so switch the laser off "
                "at the machine"
            )
            sentence = (
                f"{sentence.rstrip('.')}; {count} of {self._plan.lines} lines were acknowledged, "
                f"and {outcome}."
            )
        elif isinstance(error, JobStopped):
            sentence = f"{sentence.rstrip('.')} before a line of it was sent."
        if self._journal is not None:
            how = "stopped" if isinstance(error, JobStopped) else "failed"
            self._journal.ended(how, sentence)
        kind = JobStopped if isinstance(error, JobAborted) else type(error)
        raise kind(sentence) from None

    @property
    def _burns_at_rest(self) -> bool:
        """Whether a feed hold leaves the beam on for a moment: M3, or nobody knows what it is."""
        program = self._plan.program
        laser = self._plan.machine.tool.kind == "laser"
        return laser and (program is None or bool((program.spindle == BEAM_M3).any()))

    def make_safe(self) -> None:
        """Stop the machine if nothing else has: the last line of defence, on every way out."""
        if self._at_risk:
            self._at_risk = False
            self._session.stop()
