"""The driver for controllers that speak GRBL.

The job is done when the controller has acknowledged every line *and* a status report, requested
after the last acknowledgement, says Idle. On every other way out (:meth:`GrblDriver.stop`) the
driver resets the controller first, and then asks whether the beam is off. The one exception is an
abort at the keyboard of a job under M4, whose beam is dark at rest: a feed hold before the reset
lets the machine keep its position. The driver never relies on ``M5``: it would wait in the
controller's queue behind up to seconds of burning.
"""

from __future__ import annotations

import math
from functools import cached_property
from itertools import pairwise

import numpy as np

from miurafab.errors import ControllerError, MiurafabError, PersonNeeded
from miurafab.findings import Finding
from miurafab.gcode.program import BEAM_M3, PAUSE, Program
from miurafab.grbl.events import Error, Event, Ok, StatusReport
from miurafab.grbl.lines import dwell_seconds
from miurafab.grbl.streamer import LineRefused, Streamer
from miurafab.machine.greeting import ANSWER_S, RESTARTED
from miurafab.machine.judge_words import leaves_air_on, names_other_places
from miurafab.machine.keys import HOLD, POWER, RESUME
from miurafab.machine.preflight import (
    check_build,
    check_settings,
    check_status,
    check_travel,
    raise_findings,
)
from miurafab.machine.progress import JobAborted
from miurafab.machine.stream_driver import JobContext, StreamDriver, nobody_there, waiting_at

WAS_RESET = "the controller was reset and reports the beam off"
NOT_CONFIRMED = (
    "the controller did not confirm that the beam is off, so switch the laser off at the machine"
)
"""The outcome of a stop, as a clause."""

_WAS_ARMED = Finding("armed", "The job ended with the laser armed, so the controller was reset.")

_DONE = ("Idle", "Check")
"""The states of a controller that does nothing, in a job that burns and in check mode."""
_STOPPED = ("Hold", "Door", "Tool")
"""The states that last until somebody ends them; grblHAL changes its tool in the last."""
_HELD_S = 600.0
"""The longest stop that nobody at the keys can end."""
_LIT_HOLDS = 2  # in laser mode the beam goes out a moment after a hold is told (protocol.c)
_NEAR_MM = 0.1  # or a step of the motor, if that is longer
_POLL_S = 0.2  # between status queries while lines flow
_END_POLL_S = 0.1  # between status queries while the last moves are made


class GrblDriver(StreamDriver):
    """The driver of one job over one session."""

    def __init__(self, context: JobContext) -> None:
        super().__init__(context)
        plan, controller = context.plan, context.plan.machine.controller
        self._session = context.conversation
        self._known = context.known
        self._streamer = Streamer(
            self._session.connection,
            plan.job.name,
            plan.job.send_lines(controller.line_chars),
            send_response=controller.streaming == "send-response",
            collect_refusals=plan.options.check_mode,
        )
        self.refusals = self._streamer.refusals
        self._doubtful_reports = 0  # that may tell whether a resume was heard
        self._listened = 0.0  # seconds; what shows the progress may take longer than a patience
        self._heard_at = 0.0  # of these, when it last answered or was busy
        self._answered_at = 0.0  # ... when it last answered
        self._stopped_at: float | None = None  # ... and when it stopped in mid-job
        self._lit_holds = 0  # reports in a row of a hold with the beam on

    @property
    def acknowledged(self) -> int:
        """See :class:`StreamDriver`."""
        return self._streamer.acknowledged

    @property
    def line(self) -> int:
        """See :class:`StreamDriver`."""
        return self._streamer.last.number if self._streamer.last else 0

    @property
    def stands(self) -> bool:
        """See :class:`StreamDriver`: held, at a pause of the program, or stopped at the machine."""
        report = self._session.status
        return self.held or (report is not None and report.state in _STOPPED)

    # The steps

    def prepare(self) -> tuple[Finding, ...]:
        """See :class:`StreamDriver`."""
        plan, session, known = self.plan, self._session, self._known
        known.open(plan.wait, reset=plan.reset)
        restarted, untold = session.restarted, session.take_restart()
        known.clear_overrides()
        if plan.options.home:
            self.at_risk = True
            known.home(self._take_keys)
            self.at_risk = False
        status = session.wait_status()
        self.at_risk = status.beam_on
        lost = session.restarted_itself and plan.at is None
        forced = raise_findings(
            check_status(status, restarted=restarted, lost=lost),
            plan.options.force,
            ControllerError,
        )
        known.refresh()
        findings: list[Finding] = []
        options = known.options
        if options is not None:
            if self.journal is not None and options.planner_blocks is not None:
                self.journal.plans_ahead(options.planner_blocks)
            if not plan.options.check_mode:
                findings += check_build(plan.job, plan.machine, options.flags)
        findings += check_settings(plan.machine, known.settings)
        forced += raise_findings(findings, plan.options.force, ControllerError)
        modes = known.set_modes()
        if plan.at is not None:
            known.set_position(*plan.at)
        if plan.program is not None:
            travel = check_travel(
                plan.program, known.settings, known.job_offset(), homed=plan.homed
            )
            forced += raise_findings(travel, plan.options.force, ControllerError)
        if plan.options.check_mode:
            self.at_risk = True
            session.command("$C")
        if untold and not plan.options.home and plan.at is None:
            modes += (Finding("restarted", f"The opening of {session.name} {RESTARTED}."),)
        return forced + modes

    def stream(self) -> None:
        """See :class:`StreamDriver`."""
        session, streamer = self._session, self._streamer
        poll_at = session.now()
        silent = 0.0
        asked_last = False  # whether a status was asked for after the last acknowledgement
        while True:
            data = streamer.pull()
            if data:
                session.write(data)
            if streamer.finished and not asked_last:
                asked_last = session.ask_status()
                poll_at = session.now() + _END_POLL_S
            elif session.now() >= poll_at:
                session.ask_status()
                poll_at = session.now() + (_END_POLL_S if streamer.finished else _POLL_S)
            begin = session.now()
            events = session.receive(poll_at - begin)
            waited = session.now() - begin
            self._listened += waited
            silent = 0.0 if events else silent + waited
            self._watch_for_loss(events)
            for event in events:
                streamer.take(event)
                if isinstance(event, StatusReport):
                    self._resume_a_late_hold(event)
                    waits = self._attend_pause(event)
                    self._watch_a_stop(event, waits is not None)
                    self.tell(
                        waits or event.state,
                        session.position,
                        session.connection.in_flight_bytes,
                        session.overrides,
                    )
                    if asked_last and event.state in _DONE:
                        return
            if silent > ANSWER_S:
                raise ControllerError(
                    f"The controller has said nothing for {ANSWER_S:g} s, not even to status "
                    f"queries, {streamer.where}."
                )
            self.attend()

    def _attend_pause(self, report: StatusReport) -> str | None:
        """Do what the plan says where the program waits for a person; what to tell meanwhile.

        Raises :class:`~miurafab.errors.PersonNeeded` if nobody is there.
        """
        program, owed = self.plan.program, self._session.connection.in_flight
        if program is None or not owed or not _rests(report) or self.held:
            return None
        line = owed[0].number  # GRBL answers M0 when its hold is over, and all before it earlier
        if self._is_at_pause(program, line) is False:
            return None
        if self.plan.at_pause == "stop":
            raise nobody_there(self.plan.job.name, line, "`resume` the job")
        if self.plan.at_pause == "go on":
            self.orders.append(RESUME)
        return waiting_at(self.plan.job.name, line)

    def _is_at_pause(self, program: Program, line: int) -> bool | None:
        """Whether the head stands where the pause of ``line`` comes: a hold of somebody at the
        machine stops it before. None where nothing tells that: an axis that each line leaves where
        the job began (an arc may leave it on the way), a job that names places otherwise than in
        its own coordinates.
        """
        pauses = np.flatnonzero((program.event_line == line) & (program.event_kind == PAUSE))
        if not len(pauses):
            return False
        position, moves = self._session.position, program.event_move[pauses[0]]
        ends = program.end[:moves][np.diff(program.line[:moves], append=0) != 0]
        axes = [axis for axis, _ in enumerate((position or ())[:3]) if ends[:, axis].any()]
        if position is None or not axes or self._names_other_places:
            return None
        return all(abs(ends[-1, axis] - position[axis]) < self._near_mm(axis) for axis in axes)

    def _near_mm(self, axis: int) -> float:
        """How near to a place the controller comes that is told to go there."""
        return max(_NEAR_MM, 1.0 / (self._known.settings.values.get(100 + axis) or math.inf))

    def _watch_a_stop(self, report: StatusReport, pauses: bool) -> None:
        """Raise where a stop in mid-job would never end: the program ``pauses`` at a line before
        which answers are owed, or nobody is there to end it.
        """
        self._lit_holds = self._lit_holds + 1 if self._burns_now(report, pauses) else 0
        if self._lit_holds > (0 if self._burns_in_hold else _LIT_HOLDS):
            raise ControllerError(
                f"{self.plan.job.name} was held {self._streamer.where}, and the controller leaves "
                f"the beam on in a hold; {self._dark_way}"
            )
        if report.state not in _STOPPED or pauses or self.held:
            self._stopped_at = None
            return
        if self._stopped_at is None:
            self._stopped_at = self._listened
        stopped, name = self._listened - self._stopped_at, self.plan.job.name
        late = self._late_pause(self._stopped_at) if _rests(report) and stopped > ANSWER_S else None
        if late is not None:
            first = self._session.connection.in_flight[0].number
            raise ControllerError(
                f"The controller waits at line {late} of {name} (M0) but has not answered line "
                f"{first} before it for {ANSWER_S:g} s: bytes were lost on the way, so look at the "
                "cable and the baud rate."
            )
        if stopped > _HELD_S and self.plan.at_pause != "wait":
            raise PersonNeeded(
                f"{name} was stopped at the machine ({report.state}) for {_HELD_S / 60:g} minutes "
                f"{self._streamer.where}, and nobody is at the keys; `resume` the job in a terminal"
            )

    def _burns_now(self, report: StatusReport, pauses: bool) -> bool:
        """Whether the beam is on in a hold, by the ``report``, or by the program where that does
        not tell (GRBL 0.9).
        """
        if self.plan.machine.tool.kind != "laser" or not _rests(report):
            return False
        return report.beam_on or (self._burns_in_hold and not report.beam_off and not pauses)

    def _late_pause(self, begun: float) -> int | None:
        """The line behind the first that is owed at whose pause the head stands, if there is one;
        GRBL has answered all lines before it, then. A hold in a dwell stands there, too, but that
        does not begin with an answer, as the pause behind a dwell does.
        """
        program = self.plan.program
        if program is None:
            return None
        for before, line in pairwise(self._session.connection.in_flight):
            if dwell_seconds(before.data) and begun > self._answered_at + 2 * _POLL_S:
                return None
            if self._is_at_pause(program, line.number):
                return line.number
        return None

    @property
    def _moves(self) -> bool:
        """Whether a change of the power reaches the moves: at rest GRBL sets the beam by it. A
        dwell may have begun since the last report.
        """
        report = self._session.status
        rests = report is None or report.state == "Idle" or self._streamer.dwell_in_flight > 0
        return not rests

    @cached_property
    def _names_other_places(self) -> bool:
        return names_other_places(self.plan.job)

    def obey(self) -> None:
        """Send ``orders``, unless the controller is deaf while it writes its EEPROM; those that
        would light a resting beam (M3) when it moves again. Where a hold leaves the beam on, the
        job is stopped in place of it.
        """
        session = self._session
        if not session.connection.writing_eeprom:
            orders, self.orders = self.orders, []
            for order in orders:
                if order in POWER and self._burns_at_rest and not self._moves:
                    self.orders.append(order)
                    continue
                if order == HOLD and self._burns_in_hold:
                    raise JobAborted(
                        f"{self.plan.job.name} was stopped at the keyboard, not held: the "
                        f"controller leaves the beam on in a hold; {self._dark_way}.",
                        at_once=True,
                    )
                session.write(session.connection.send_realtime(order))
                # GRBL forgets a resume that comes before the hold has come to rest (protocol.c).
                if order in (HOLD, RESUME):
                    early = order == RESUME and self.held and not _rests(session.status)
                    self._doubtful_reports = early * (1 + session.awaits_status)
                self.held = order == HOLD or (self.held and order != RESUME)

    def _resume_a_late_hold(self, report: StatusReport) -> None:
        """Send the resume again that came while the hold still braked."""
        if self._doubtful_reports and _rests(report):
            self._doubtful_reports = 0
            self.orders.append(RESUME)
        elif self._doubtful_reports and report.state != "Hold":
            self._doubtful_reports -= 1  # it was heard, or the report is of before

    def finish(self) -> tuple[Finding, ...]:
        """See :class:`StreamDriver`."""
        session = self._session
        if self.plan.options.check_mode:
            session.stop()
            return ()
        if leaves_air_on(self.plan.job):
            session.command("M9")
        if self.plan.machine.tool.kind == "laser" and session.wait_status().beam_on:
            session.stop()
            return (_WAS_ARMED,)
        return ()

    def _watch_for_loss(self, events: list[Event]) -> None:
        """Raise if the controller idles while an answer is missing: the line was damaged. What is
        owed is so after all of the ``events``, among which the answer may follow the report.
        """
        owed = self._session.connection.in_flight
        reports = [event for event in events if isinstance(event, StatusReport)]
        busy = any(report.state not in _DONE for report in reports)
        answers = any(isinstance(event, Ok | Error) for event in events)
        if answers:
            self._answered_at = self._listened
        if busy or answers:
            self._heard_at = self._listened
        patience = ANSWER_S + self._streamer.dwell_in_flight
        if owed and reports and self._listened - self._heard_at > patience:
            raise ControllerError(
                f"The controller is idle but has not answered line {owed[0].number} of "
                f"{self.plan.job.name} for {patience:g} s: bytes were lost on the way, so look at "
                "the cable and the baud rate."
            )

    # The other ways out

    def stop(self, error: MiurafabError | None) -> str:
        """See :class:`StreamDriver`."""
        session = self._session
        lit = self._burns_at_rest or self._burns_in_hold
        if isinstance(error, JobAborted) and not (error.at_once or lit):
            off = session.hold_and_stop()
        else:
            off = session.stop(hold_first=isinstance(error, LineRefused))
        return WAS_RESET if off else NOT_CONFIRMED

    @property
    def _burns_in_hold(self) -> bool:
        """Whether GRBL leaves the beam on while the axes are held: without laser mode."""
        program, machine = self.plan.program, self.plan.machine
        off = machine.dialect == "grbl-0.9" or self._known.settings.values.get(32) == 0.0
        burns = program is None or bool(program.beam_on.any())
        return machine.tool.kind == "laser" and off and burns

    @property
    def _dark_way(self) -> str:
        """What to do where the controller leaves the beam on in a hold, as a clause."""
        if self.plan.machine.dialect != "grbl-0.9" and self._burns_in_hold:
            return "with $32=1 (laser mode) it holds dark"
        return "stop a job there by q or a reset, never by a hold"

    @property
    def _burns_at_rest(self) -> bool:
        """Whether a feed hold may leave the beam on: under M3, or in an unreadable program."""
        program = self.plan.program
        laser = self.plan.machine.tool.kind == "laser"
        return laser and (program is None or bool((program.spindle == BEAM_M3).any()))


def _rests(report: StatusReport | None) -> bool:
    """Whether a hold has come to its end, as far as the controller tells (GRBL 0.9 does not)."""
    return report is not None and report.state == "Hold" and not report.substate
