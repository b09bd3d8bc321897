"""Sending one job to one machine, in any dialect: the steps, and every way out.

A subclass for each dialect defines how the machine is greeted, how lines become bytes, and how the
machine is made safe (:meth:`StreamDriver.stop`). The base class defines when. While it waits for
anything, it serves the files, the keys and the user (:meth:`StreamDriver.attend`). On every way out
but success it makes the machine safe first, once; the outcome stands in the sentence that the user
reads and in the journal.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import NoReturn

from miurafab.errors import JobStopped, MachineError, MiurafabError, PersonNeeded
from miurafab.findings import Finding
from miurafab.grbl.streamer import Refusal
from miurafab.machine.journal import Journal
from miurafab.machine.keys import ABORT, HOLD, RESET, Keys, keys_of
from miurafab.machine.known_controller import KnownController
from miurafab.machine.planning import JobPlan
from miurafab.machine.progress import AS_WRITTEN, JobAborted, Overrides, Progress, StreamResult
from miurafab.machine.session import Session
from miurafab.machine.sleeping import SleepWatch, slept_s
from miurafab.machine.transcript import Transcript
from miurafab.machine.transport import FlowTransport

_TELL_S = 0.2  # between two progress reports for a machine that does not report its position


@dataclass(frozen=True)
class JobContext:
    """A ``plan``, the wire to send it over, and everybody who follows it or may step in.

    ``conversation`` and ``known`` are what a GRBL controller has said over that wire before.

    ``check`` is called before every read: it raises the exception that should interrupt the
    conversation, such as Ctrl-C.
    """

    plan: JobPlan
    transport: FlowTransport
    conversation: Session
    known: KnownController
    transcript: Transcript | None
    journal: Journal | None
    on_progress: Callable[[Progress], None] | None
    keys: Keys
    check: Callable[[], None]


class StreamDriver(ABC):
    """The driver of one job. ``at_risk`` while the machine may move or burn because of sent lines.

    ``taken`` is the verb for lines that the machine has. ``held``: the user has paused sending.
    ``orders``: pressed keys that are not carried out yet. ``refusals``: the refused lines of a job
    in check mode.
    """

    taken = "acknowledged"

    def __init__(self, context: JobContext) -> None:
        self.at_risk = False
        self.held = False
        self.orders: list[bytes] = []
        self.refusals: list[Refusal] = []
        self.plan = context.plan
        self.journal = context.journal
        self._context = context
        self._records = [r for r in (context.transcript, context.journal) if r is not None]
        self._overrides = AS_WRITTEN
        self._overridden: set[Overrides] = set()
        self._sleep = SleepWatch(slept_s)

    # Defined by each dialect

    def prepare(self) -> tuple[Finding, ...]:
        """Greet the machine and make all checks that need it; returns the forced refusals."""
        return ()

    @abstractmethod
    def stream(self) -> None:
        """Send the job until the machine has done it; raises the error that ends it."""

    def finish(self) -> tuple[Finding, ...]:
        """Leave the machine dark after a job that is done."""
        return ()

    @abstractmethod
    def stop(self, error: MiurafabError | None) -> str:
        """Make the machine safe, before anything else; returns the outcome as a clause.

        Never raises because of the machine.
        """

    @property
    @abstractmethod
    def acknowledged(self) -> int:
        """The number of lines that the machine has taken."""

    @property
    @abstractmethod
    def line(self) -> int:
        """The line number in the file of the last line taken; 0: none."""

    @property
    def state(self) -> str:
        """The state of the machine in one word, as far as the driver knows it."""
        return "Hold" if self.held else "Run"

    @property
    def stands(self) -> bool:
        """Whether the machine stands until a person lets it go on, as far as the driver knows."""
        return self.held

    def obey(self) -> None:
        """Carry out ``orders``. A machine without feed hold is paused by sending nothing more."""
        for order in self.orders:
            self.held = order == HOLD
        self.orders.clear()

    # The steps

    def run(self) -> StreamResult:
        """Send the whole job; raises the error that ends it early."""
        findings = self.plan.forced + self.prepare()
        self._take_keys()
        self.at_risk = True
        self._begin = self._tell_at = self._context.transport.now()
        self.stream()
        seconds = self._seconds
        findings += self.finish()
        if self._overridden:
            findings += (_were_in_force(self._overridden),)
        self.at_risk = False
        if self.journal is not None:
            self.journal.ended("done", f"{self.acknowledged} lines {self.taken}")
        findings += self._close_records()
        return StreamResult(self.acknowledged, seconds, tuple(self.refusals), findings)

    @property
    def _seconds(self) -> float:
        """Seconds since the first line, on the wire's clock."""
        return self._context.transport.now() - self._begin

    def attend(self) -> None:
        """Serve the files and the keys; called many times a second during every wait.

        Raises :class:`~miurafab.machine.progress.JobAborted` if the user ends the job, and
        :class:`~miurafab.errors.MachineError` for a journal that cannot be written, since the job
        could not be resumed, and where the computer slept: nobody may stand at the machine when it
        wakes. A transcript that cannot be written is told at the end.
        """
        self._watch_for_sleep()
        if self.journal is not None:
            self.journal.taken(self.acknowledged, self.line, self._seconds)
            self.journal.check()
        self._take_keys()
        self.obey()

    def _watch_for_sleep(self) -> None:
        slept = self._sleep.slept()
        if slept and self._context.transport.blocks and not self.stands:
            raise MachineError(
                f"The computer slept for {slept:.0f} s while it sent {self.plan.job.name}, and "
                "nobody may have watched the machine since"
            )

    def _take_keys(self) -> None:
        known = keys_of(self.plan.machine.dialect)
        self.orders += [known[key] for key in self._context.keys.pressed() if key in known]
        at_once = RESET in self.orders
        if at_once or ABORT in self.orders:
            raise JobAborted(f"{self.plan.job.name} was stopped at the keyboard.", at_once=at_once)

    def attend_and_tell(self) -> None:
        """:meth:`attend`, and :meth:`tell` the progress of a machine that does not report it."""
        self.attend()
        now = self._context.transport.now()
        if now >= self._tell_at:
            self._tell_at = now + _TELL_S
            self.tell(self.state)

    def tell(
        self,
        state: str,
        position: tuple[float, ...] | None = None,
        in_flight: int = 0,
        overrides: Overrides = AS_WRITTEN,
    ) -> None:
        """Report the progress; see :class:`~miurafab.machine.progress.Progress`.

        The journal and the end of the job name each of ``overrides`` that was in force.
        """
        if overrides != self._overrides:
            self._overrides = overrides
            self._overridden |= {overrides} - {AS_WRITTEN}
            if self.journal is not None:
                self.journal.overridden(overrides, self.line, self._seconds)
        if self._context.on_progress is not None:
            self._context.on_progress(
                Progress(
                    self.acknowledged,
                    self.plan.lines,
                    self._seconds,
                    state,
                    position,
                    in_flight,
                    self.line,
                    overrides,
                )
            )

    def _close_records(self) -> tuple[Finding, ...]:
        """Close the files. The job is done by then, so a fault is a warning."""
        findings = []
        for record in self._records:
            record.close()
            try:
                record.check()
            except MachineError as error:
                findings.append(Finding("records", error.sentence))
        return tuple(findings)

    # The other ways out

    def end(self, error: MiurafabError) -> NoReturn:
        """Stop the machine if it is at risk; raise ``error`` with the outcome in its sentence."""
        sentence = error.sentence
        if self.at_risk:
            outcome = self.stop(error)
            self.at_risk = False
            sentence = (
                f"{sentence.rstrip('.')}; {self.acknowledged} of {self.plan.lines} lines were "
                f"{self.taken}, and {outcome}."
            )
        elif isinstance(error, JobStopped):
            sentence = f"{sentence.rstrip('.')} before a line of it was sent."
        if self.journal is not None:
            how = "stopped" if isinstance(error, JobStopped) else "failed"
            self.journal.ended(how, sentence)
        kind = JobStopped if isinstance(error, JobAborted) else type(error)
        raise kind(sentence) from None

    def make_safe(self) -> None:
        """Stop the machine if it is still at risk: the last line of defence on every way out."""
        if self.at_risk:
            self.stop(None)


def waiting_at(name: str, line: int) -> str:
    """What is told while the program ``name`` waits at ``line`` for a person at the keys."""
    return f"waiting at {name}, line {line} (M0): r goes on"


def nobody_there(name: str, line: int, way: str) -> PersonNeeded:
    """The error for the program ``name`` that waits at ``line`` for a person who is not there;
    ``way`` is how to go on in a terminal.
    """
    return PersonNeeded(
        f"{name}, line {line} waits for a person (M0), and nobody is at the keys; {way} in a "
        "terminal, or leave the pauses out"
    )


def _were_in_force(overridden: set[Overrides]) -> Finding:
    """The finding for overrides that a key or a knob of the machine set while the job ran."""
    changed = []
    for name in Overrides._fields:
        percents = {getattr(each, name) for each in overridden} | {100}
        if len(percents) > 1:
            changed.append(f"the {name} was between {min(percents)} and {max(percents)} %")
    return Finding(
        "overrides",
        f"While the job ran, {' and '.join(changed)} of what is written in it.",
    )
