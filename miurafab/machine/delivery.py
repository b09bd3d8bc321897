"""One job on its way to one machine, whatever the machine speaks: the way through, and its end.

Each dialect says how the machine is met, how lines become bytes, and how it is made safe
(:meth:`Delivery.stop`). This says when. Meanwhile, whatever is awaited, the files, the keys and the
user are looked after (:meth:`Delivery.attend`). On every way out but success the machine is made
safe first of all, once, and what became of it stands in the sentence that the user reads and in the
journal.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import NoReturn

from miurafab.errors import JobStopped, MachineError, MiurafabError
from miurafab.findings import Finding
from miurafab.grbl.streamer import Refusal
from miurafab.machine.journal import Journal
from miurafab.machine.keys import ABORT, HOLD, Keys, keys_of
from miurafab.machine.planning import JobPlan
from miurafab.machine.progress import JobAborted, Progress, StreamResult
from miurafab.machine.transcript import Transcript
from miurafab.machine.transport import FlowTransport

_TELL_S = 0.2  # between two words to the user, of a machine that does not tell where it is


@dataclass(frozen=True)
class Errand:
    """A ``plan``, the wire that it goes over, and who is told of it and may step in.

    ``check`` is called before every read: it raises what should interrupt the conversation.
    """

    plan: JobPlan
    transport: FlowTransport
    transcript: Transcript | None
    journal: Journal | None
    on_progress: Callable[[Progress], None] | None
    keys: Keys
    check: Callable[[], None]


class Delivery(ABC):
    """An errand under way; ``at_risk`` while the machine may move or burn by what was sent.

    ``taken`` is the word for a line that the machine has. ``held`` says whether the user wants
    nothing to be sent, ``orders`` are those of the keyboard that were not carried out yet,
    ``refusals`` the refused lines of a job in check mode.
    """

    taken = "acknowledged"

    def __init__(self, errand: Errand) -> None:
        self.at_risk = False
        self.held = False
        self.orders: list[bytes] = []
        self.refusals: list[Refusal] = []
        self.plan = errand.plan
        self.journal = errand.journal
        self._errand = errand
        self._records = [r for r in (errand.transcript, errand.journal) if r is not None]
        self._begin = self._tell_at = 0.0

    # What each dialect says

    def meet(self) -> tuple[Finding, ...]:
        """Greet the machine and make all checks that need it; returns what did not stop the job."""
        return ()

    @abstractmethod
    def stream(self) -> None:
        """Send the job until the machine has done it, and attend meanwhile; raises what ends it."""

    def part(self) -> tuple[Finding, ...]:
        """Leave the machine dark after a job that is done."""
        return ()

    @abstractmethod
    def stop(self, error: MiurafabError | None) -> str:
        """Make the machine safe, before anything else; what became of that, as a clause.

        Never raises for the machine's sake.
        """

    @property
    @abstractmethod
    def acknowledged(self) -> int:
        """How many lines the machine has taken."""

    @property
    @abstractmethod
    def line(self) -> int:
        """The number of the last of them in the file; 0: none."""

    @property
    def state(self) -> str:
        """What the machine is doing, in one word, as far as it is known here."""
        return "Hold" if self.held else "Run"

    def obey(self) -> None:
        """Carry out ``orders``: without a feed hold, holding is to send nothing more."""
        for order in self.orders:
            self.held = order == HOLD
        self.orders.clear()

    # The way through

    def run(self) -> StreamResult:
        """The whole way through; raises what ends it."""
        findings = self.plan.forced + self.meet()
        self.at_risk = True
        self._begin = self._tell_at = self._errand.transport.now()
        self.stream()
        seconds = self._seconds
        findings += self.part()
        self.at_risk = False
        if self.journal is not None:
            self.journal.ended("done", f"{self.acknowledged} lines {self.taken}")
        findings += self._close_records()
        return StreamResult(self.acknowledged, seconds, tuple(self.refusals), findings)

    @property
    def _seconds(self) -> float:
        """Since the first line, on the wire's clock."""
        return self._errand.transport.now() - self._begin

    def attend(self) -> None:
        """Look after the files and the keys: many times a second, whatever is awaited.

        Raises :class:`~miurafab.machine.progress.JobAborted` if the user ends the job, and
        :class:`~miurafab.errors.MachineError` for a file that cannot be written.
        """
        if self.journal is not None:
            self.journal.taken(self.acknowledged, self.line, self._seconds)
        for record in self._records:
            record.check()
        known = keys_of(self.plan.machine.dialect)
        self.orders += [known[key] for key in self._errand.keys.pressed() if key in known]
        if ABORT in self.orders:
            raise JobAborted(f"{self.plan.job.name} was stopped at the keyboard.")
        self.obey()

    def attend_and_tell(self) -> None:
        """:meth:`attend`, and :meth:`tell` the user of a machine that does not tell of itself."""
        self.attend()
        now = self._errand.transport.now()
        if now >= self._tell_at:
            self._tell_at = now + _TELL_S
            self.tell(self.state)

    def tell(
        self,
        state: str,
        position: tuple[float, ...] | None = None,
        in_flight: int = 0,
        feed_override: int = 100,
    ) -> None:
        """Tell the user how far the job is; see :class:`~miurafab.machine.progress.Progress`."""
        if self._errand.on_progress is not None:
            self._errand.on_progress(
                Progress(
                    self.acknowledged,
                    self.plan.lines,
                    self._seconds,
                    state,
                    position,
                    in_flight,
                    self.line,
                    feed_override,
                )
            )

    def _close_records(self) -> tuple[Finding, ...]:
        """Finish the files; a fault now does not undo the job, so it is a warning."""
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
        """Stop the machine if it is at risk, and raise ``error`` with what became of it."""
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
        """Stop the machine if nothing else has: the last line of defence, on every way out."""
        if self.at_risk:
            self.at_risk = False
            self.stop(None)
