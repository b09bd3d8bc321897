"""The session that owns a port: opened once, asked once, and every action in one conversation.

A board forgets an unlocking, an origin and an unhomed position when it is reset, and the opening of
a port resets most boards. So whoever works at a machine holds one session with it: unlock, home,
jog, set the origin, frame, cut. A command such as ``machine jog`` is a session with one action.

Whatever may leave the machine moving or burning sets it at risk, and a status report that says idle
and dark ends that. A session that is closed at risk resets the controller first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from miurafab.errors import ControllerError, JobStopped, MachineError, PersonNeeded
from miurafab.gcode.job import Job
from miurafab.grbl.connection import Connection
from miurafab.grbl.events import StatusReport
from miurafab.machine.console_lines import ConsoleLines
from miurafab.machine.job_sending import OpenWire, send_job
from miurafab.machine.jog_pad import JogPad, require_way
from miurafab.machine.keys import ABORT, POWER, RESET, RESUME, Keys, NoKeys, session_keys
from miurafab.machine.known_controller import (
    STOCK,
    KnownController,
    MachineState,
    PortSetup,
    require_talk,
)
from miurafab.machine.owner import Owner, claim, this_owner
from miurafab.machine.planning import JobPlan, feeds_itself, put_in
from miurafab.machine.progress import JobAborted, Progress, StreamResult
from miurafab.machine.resting_beam import RestingBeam
from miurafab.machine.session import HOMING_S, Session
from miurafab.machine.signals import StopSignals
from miurafab.machine.transport import FlowTransport

_POLL_S = 0.1
_KEY_S = 0.01  # between two looks at the keyboard, if there is one
_GO_MM_MIN = 3000.0
_REALTIME = ("?", "!", "~")
_RESTING = ("Idle", "Alarm", "Sleep", "Check")


class MachineSession:
    """One conversation with one machine over ``transport``; mutable, for one thread.

    ``signals`` stop it; ``keys`` act at once in every wait. :meth:`open` greets the machine, as the
    first action does. ``owner`` is who holds the port (this process). ``on_state`` is called with
    each new state; ``lines`` are what the controller says to a person.
    """

    def __init__(
        self,
        transport: FlowTransport,
        signals: StopSignals,
        setup: PortSetup = STOCK,
        keys: Keys | None = None,
        owner: Owner | None = None,
    ) -> None:
        most = setup.most_in_flight(transport.name)
        self.conversation = Session(transport, Connection(most), check=self._check)
        self.known = KnownController(self.conversation, setup.dialect)
        self._resting_beam = RestingBeam(self.known, self.open)
        self._keys = keys or NoKeys()
        if not isinstance(self._keys, NoKeys):
            self.conversation.patience = _KEY_S
        self._wire = OpenWire(transport, self.conversation, self.known, self._keys, signals)
        self._transport, self._signals, self._setup = transport, signals, setup
        signals.at_once = transport.blocks
        self._orders = session_keys(setup.dialect)
        self._pad = JogPad()
        self._at_risk = self._in_job = self._stops = False
        self._poll_at = 0.0
        self._told: StatusReport | None = None  # the report of the last state that was told
        self.on_state: Callable[[MachineState], None] = lambda state: None
        self.lines = ConsoleLines()
        self.conversation.on_data = self.lines.hear
        self._release = claim(transport.name, owner or this_owner())

    # Beginning and end

    def open(self, wait: float | None = None, *, reset: bool = False) -> MachineState:
        """Greet the controller and ask it everything, once; ``wait`` seconds for a slow board,
        which is ``reset`` even if it is at rest.

        Raises what :meth:`~miurafab.machine.session.Session.greet` raises, and
        :class:`~miurafab.errors.InputError` for a machine that only takes jobs.
        """
        require_talk(self._setup.dialect)
        self._resting_beam.forget()
        greets = not self.known.opened
        self.known.open(self._setup.wait if wait is None else wait, reset=reset)
        if greets:
            self._note(self.conversation.status)
        return self.state

    @property
    def blocks(self) -> bool:
        """Whether its waits take real time."""
        return self._transport.blocks

    @property
    def state(self) -> MachineState:
        """The state by the last status report and the last answers."""
        return self.known.state

    def close(self) -> bool:
        """Reset the machine unless it is idle and dark, then release the port; whether it is dark.

        Never raises because of the machine.
        """
        self._signals.hold()
        at_risk, self._at_risk, self._stops = self._at_risk, False, True
        dark = not at_risk or self.conversation.stop()
        self._transport.close()
        self._release()
        return dark

    def look(self) -> MachineState:
        """The state by a status report that is asked for now, and what was unknown asked again."""
        self._note(self.conversation.wait_status())
        if not self.conversation.connection.in_flight:
            self.known.refresh()
            self._at_risk |= self.state.beam_on  # what runs behind a line may have lit it since
        return self.state

    def watch(self, seconds: float) -> MachineState:
        """Let ``seconds`` pass, keep the state true and the held jog going."""
        session = self.conversation
        end = session.now() + seconds
        while True:
            try:
                if session.now() >= self._poll_at and session.ask_status():
                    self._poll_at = session.now() + (_POLL_S / 2 if self._pad.busy else _POLL_S)
                for event in session.receive(min(_POLL_S / 5, max(0.0, end - session.now()))):
                    if isinstance(event, StatusReport):
                        self._note(event)
                        if not (session.connection.in_flight or self._pad.busy):
                            self.known.refresh()
                self._tend_pad()
            except JobAborted as wish:
                self.abort(at_once=wish.at_once)
            if session.now() >= end:
                return self.state

    def _note(self, report: StatusReport | None) -> None:
        rests = report is not None and report.state in _RESTING and not report.beam_on
        self._at_risk = not rests or self._resting_beam.full

    # The keys

    def _check(self) -> None:
        """Called before every read: a signal stops, a key acts."""
        self._signals.check()
        if self.conversation.status is not self._told:
            self._told = self.conversation.status
            self.on_state(self.state)
        if self._in_job or self._stops or self.conversation.connection.writing_eeprom:
            return
        for key in self._keys.pressed():
            order = self._orders.get(key)
            if order in (ABORT, RESET):
                raise JobAborted("The machine was stopped at a key.", at_once=order == RESET)
            if order is not None:
                self.realtime(order)

    def realtime(self, order: bytes) -> None:
        """Send one realtime byte, such as a feed hold, but none that lights a resting beam."""
        if order in POWER and self.state.idle and "M5" not in self.state.modes:
            self.lines.on_line("At rest a change of the power would light the armed beam.")
            return
        self._at_risk = True
        self.conversation.write(self.conversation.connection.send_realtime(order))

    # The actions

    def unlock(self) -> MachineState:
        """Unlock the controller after an alarm (``$X``); its position must still be right."""
        self.open()
        self.conversation.require_ready("$X")  # else nothing was sent that is to be stopped
        self._or_stop(self.known.unlock)
        return self.look()

    def home(self) -> MachineState:
        """Run the homing cycle (``$H``) and wait for its end."""
        self.open()
        self._at_risk = True
        self._or_stop(self.known.home)
        return self.look()

    def jog(
        self,
        *,
        x: float | None = None,
        y: float | None = None,
        feed_mm_min: float = 1000.0,
        absolute: bool = False,
    ) -> MachineState:
        """Move by ``x`` and ``y`` mm (``absolute``: to these work coordinates), beam off, and wait.

        Raises :class:`~miurafab.errors.InputError` if neither is given,
        :class:`~miurafab.errors.ControllerError` if the controller refuses, as for a target outside
        its soft limits.
        """
        line = f"$J=G21{'G90' if absolute else 'G91'}{require_way(x, y)}F{feed_mm_min:g}"
        self.open()
        if absolute:
            self.known.set_modes()
        self._at_risk = True
        self._or_stop(lambda: self._run_jog(line))
        return self.look()

    def _run_jog(self, line: str) -> None:
        session = self.conversation
        self.known.disarm()
        session.command(line)
        while (state := session.wait_status().state) != "Idle":
            if state != "Jog":
                raise ControllerError(f"The jog ended in state {state}.")
            session.pause(_POLL_S)

    def nudge(self, dx: float, dy: float) -> None:
        """One press of a jog key: a step, unless :meth:`watch` has some still to make."""
        self.open()
        self._pad.press(dx, dy, self.conversation.now())
        self._tend_pad()

    def _tend_pad(self) -> None:
        if not self._pad.busy:
            return
        session = self.conversation
        order = self._pad.next_order(
            session.now(), session.machine_position, self.state.idle, self.known.settings.values
        )
        if order is None:
            return
        self._at_risk = True
        if len(order) == 1:
            self.realtime(order)
            return
        try:
            self.known.disarm()
            session.command(order.decode("ascii"))
        except MachineError:
            self._pad.forget()
            raise

    def set_origin(self) -> MachineState:
        """Make the head's place the origin of jobs (``G92 X0 Y0``), in known modes."""
        self.open()
        self.known.set_modes()
        self.known.set_position(0.0, 0.0)
        return self.look()

    def go_to_origin(self) -> MachineState:
        """Move the head to the origin of jobs, beam off, and wait."""
        feed = self.known.rapid_mm_min or _GO_MM_MIN
        return self.jog(x=0.0, y=0.0, feed_mm_min=feed, absolute=True)

    def command(self, text: str) -> MachineState:
        """Send a person's line and wait for its answer; see :meth:`Session.command`."""
        self.open()
        self._at_risk = True
        with self.lines.everything():
            try:
                self._or_stop(lambda: self.conversation.command(text, HOMING_S))
            finally:
                self.known.may_differ(text)
        return self.look()

    def say(self, text: str) -> None:
        """Send a person's line: ``?``, ``!`` and ``~`` alone, and ``reset``, are realtime bytes.

        Raises :class:`~miurafab.errors.GcodeError` for a line that cannot be sent or would burn at
        rest (:mod:`~miurafab.machine.resting_beam`), and what :meth:`command` raises.
        """
        if (text := text.strip()) == "reset":
            self.abort()
        elif text in _REALTIME:
            with self.lines.everything():
                self.realtime(text.encode("ascii"))
                self.conversation.pause(_POLL_S)
        elif text:
            bare = next(Job("The console", text).send_lines(), None)
            if bare is not None:
                self.command(self._resting_beam.sure_of(bare.data.decode("ascii")))

    def settle(self) -> MachineState:
        """Wait while the axes move with the beam off."""
        while (state := self.look()).state in ("Run", "Jog") and not state.beam_on:
            self.conversation.pause(_POLL_S)
        return state

    def load(self) -> MachineState:
        """Somebody has changed the material or turned it over; a lid opened for that is shut."""
        self._resting_beam.forget()
        if shut := self.state.state == "Door:0":
            self.conversation.require_nothing_waits()
            self.realtime(RESUME)  # the controller leaves the state Door
        self.known.loaded = None
        return self.look() if shut else self.state

    def abort(self, *, at_once: bool = False) -> bool:
        """Stop whatever runs by a reset, after a dark motion has come to rest, unless ``at_once``;
        whether the controller then reports that the beam is off. Keys do not end it half done.
        """
        self._pad.forget()
        self._resting_beam.forget()
        session, self._at_risk, self._stops = self.conversation, True, True
        jogs = self.state.state == "Jog" and not self.state.beam_on and not at_once
        try:
            dark = session.hold_and_stop() if jogs else session.stop()
        finally:
            self._stops = False
        self._at_risk = not dark
        self._keys.pressed()  # what was pressed meanwhile is done
        return dark

    def _or_stop(self, action: Callable[[], object]) -> None:
        """Do ``action``; whatever ends it but its own end leaves the machine stopped.

        What the controller refused did not begin, and takes no reset, which would lose the origin.
        """
        try:
            action()
        except ControllerError:
            if not self._rests():
                self.abort()
            raise
        except BaseException as error:
            self._signals.hold()
            self.abort(at_once=isinstance(error, JobAborted) and error.at_once)
            if isinstance(error, JobAborted):
                raise JobStopped(error.sentence) from None
            raise

    def _rests(self) -> bool:
        if self.conversation.connection.in_flight:
            return False
        with suppress(ControllerError):  # one that is silent may move on
            self._note(self.conversation.wait_status())
        return not self._at_risk

    # Jobs

    def cut(
        self,
        plan: JobPlan,
        *,
        journal_path: Path | None = None,
        transcript_path: Path | None = None,
        on_progress: Callable[[Progress], None] | None = None,
    ) -> StreamResult:
        """Send a planned job and wait until it is done, safe on every way out.

        Raises what :func:`~miurafab.machine.sender.stream_plan` raises, and
        :class:`~miurafab.errors.PersonNeeded` where a sheet lies in the machine on which another
        job has burnt.
        """
        loaded = self.known.loaded
        stays = plan.resumption is not None or not self._transport.blocks
        if not (stays or loaded is None or feeds_itself(plan.machine, plan.back)):
            raise PersonNeeded(
                f"{loaded} has burnt on the sheet in the machine; "
                f"{put_in(loaded.sha256, plan.back)} and say so, then start {plan.job.name}"
            )
        with self._job():
            return send_job(
                plan,
                self._wire,
                journal_path=journal_path,
                transcript_path=transcript_path,
                on_progress=on_progress,
                burns=True,
            )

    def frame(
        self, plan: JobPlan, *, on_progress: Callable[[Progress], None] | None = None
    ) -> StreamResult:
        """Send a job that only shows where another will burn; as :meth:`cut` but for the sheet."""
        with self._job():
            return send_job(plan, self._wire, on_progress=on_progress)

    @contextmanager
    def _job(self) -> Iterator[None]:
        """A job leaves the machine safe, and may leave any mode and offset."""
        risky, self._at_risk, self._in_job = self._at_risk, False, True
        try:
            yield
        except BaseException:
            if risky or self.known.opened:
                self._note(self.conversation.status)  # it may not have begun
            raise
        finally:
            self._in_job = False
            self._resting_beam.forget()
            self.known.may_differ()
