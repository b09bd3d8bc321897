"""One job on its way to one machine, whatever the machine speaks: the end that every way has.

Each dialect says how the machine is made safe (:meth:`Delivery.stop`). This says when: first of all
on every way out but success, once, and with what became of it in the sentence that the user reads
and in the journal.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NoReturn

from miurafab.errors import JobStopped, MachineError, MiurafabError
from miurafab.machine.journal import Journal
from miurafab.machine.planning import Plan
from miurafab.machine.progress import JobAborted, StreamResult
from miurafab.machine.transcript import Transcript


class Delivery(ABC):
    """``plan`` on its way; ``at_risk`` while the machine may move or burn by what was sent."""

    def __init__(self, plan: Plan, transcript: Transcript | None, journal: Journal | None) -> None:
        self.at_risk = False
        self.plan = plan
        self.journal = journal
        self.records = [record for record in (transcript, journal) if record is not None]

    @abstractmethod
    def run(self) -> StreamResult:
        """The whole way through; raises what ends it."""

    @property
    @abstractmethod
    def acknowledged(self) -> int:
        """How many lines the machine has taken."""

    @abstractmethod
    def stop(self, error: MiurafabError | None) -> str:
        """Make the machine safe, before anything else; what became of that, as a clause.

        Never raises for the machine's sake.
        """

    def close_records(self) -> tuple[str, ...]:
        """Finish the files; a fault now does not undo the job, so it is a remark."""
        remarks = []
        for record in self.records:
            record.close()
            try:
                record.check()
            except MachineError as error:
                remarks.append(str(error))
        return tuple(remarks)

    def end(self, error: MiurafabError) -> NoReturn:
        """Stop the machine if it is at risk, and raise ``error`` with what became of it."""
        sentence = str(error)
        if self.at_risk:
            outcome = self.stop(error)
            self.at_risk = False
            sentence = (
                f"{sentence.rstrip('.')}; {self.acknowledged} of {self.plan.lines} lines were "
                f"acknowledged, and {outcome}."
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
