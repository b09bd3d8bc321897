"""Sending a job to a machine, from the opening of the port to the last move, safe on every way out.

The steps: open the port; prove that the journal and the transcript can be written; greet, query and
check the machine; send the lines (:mod:`~miurafab.machine.stream_driver`).

Every other way out - a refused line, an alarm, a reset, silence, a full disk, Ctrl-C, SIGTERM, an
exception in a progress callback - makes the machine safe before anything else happens. The outcome
stands in the sentence that the user reads.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext
from pathlib import Path
from typing import Protocol, TypedDict, Unpack

from miurafab.errors import JobStopped
from miurafab.machine.dialects import open_machine
from miurafab.machine.keys import Keys
from miurafab.machine.known_controller import PortSetup
from miurafab.machine.machine_session import MachineSession
from miurafab.machine.planning import JobPlan
from miurafab.machine.progress import Progress, StreamResult
from miurafab.machine.signals import StopSignals
from miurafab.machine.transport import FlowTransport
from miurafab.profiles import MachineProfile


class Files(TypedDict, total=False):
    """The files that record a job while it is sent."""

    journal_path: Path | None
    transcript_path: Path | None


class SheetSession(Protocol):
    """One session with one machine, from the first frame of a job to its last sheet."""

    def frame(self, plan: JobPlan) -> StreamResult:
        """Send a job that only shows where another will burn."""

    def cut(
        self,
        plan: JobPlan,
        *,
        on_progress: Callable[[Progress], None] | None = None,
        **files: Unpack[Files],
    ) -> StreamResult:
        """Send a planned job and wait until it is done; see :func:`stream_plan`."""

    def load(self) -> None:
        """Fresh material is in the machine."""

    def waits(self) -> AbstractContextManager[Callable[[], bool]]:
        """A block in which a person is waited for: the session lives on, and a signal ends it.

        It gets a function that tells whether the session has ended by itself, and raises that.
        """


class _SessionHere:
    """A session in this process."""

    def __init__(self, session: MachineSession, signals: StopSignals) -> None:
        self.frame, self.cut, self._session = session.frame, session.cut, session
        self._signals = signals

    @contextmanager
    def waits(self) -> Iterator[Callable[[], bool]]:
        """See :class:`SheetSession`."""
        with self._signals.raising():
            yield lambda: False

    def load(self) -> None:
        """See :class:`SheetSession`."""
        self._session.load()


@contextmanager
def session_here(
    machine: MachineProfile,
    port: str,
    name: str,
    *,
    keys: Keys | None = None,
    virtual_speed: float | None = None,
    signals: StopSignals | None = None,
) -> Iterator[SheetSession]:
    """A session with ``machine`` at ``port`` in this process, for the job that is called ``name``.

    ``port`` is a device, a pyserial URL, or ``virtual`` for a machine in memory set up as the
    profile says, as fast as the computer allows or at ``virtual_speed`` times real time.
    ``signals`` are those already caught, if any. The end of the block leaves the machine dark.
    Raises :class:`~miurafab.errors.PortError` for a port that cannot be opened, and
    :class:`~miurafab.errors.JobStopped` after a signal.
    """
    with StopSignals() if signals is None else nullcontext(signals) as signals:
        try:
            transport = open_machine(machine, port, virtual_speed)
            session = MachineSession(transport, signals, PortSetup.of(machine), keys)
            with closing(session):
                yield _SessionHere(session, signals)
        except KeyboardInterrupt:
            raise JobStopped(f"{name} was stopped by {signals.reason}.") from None


def stream_plan(
    plan: JobPlan,
    port: str,
    *,
    on_progress: Callable[[Progress], None] | None = None,
    keys: Keys | None = None,
    virtual_speed: float | None = None,
    signals: StopSignals | None = None,
    **files: Unpack[Files],
) -> StreamResult:
    """Send a planned job to its machine at ``port`` and wait until it is done.

    ``on_progress`` is called about five times a second. ``keys`` may hold, resume, abort and
    override while the job runs. The other arguments are those of :func:`session_here` and
    :class:`Files`.

    Raises :class:`~miurafab.errors.InputError` for a file that cannot be written,
    :class:`~miurafab.errors.PortError` and :class:`~miurafab.errors.ControllerError` for what the
    machine did, :class:`~miurafab.errors.JobStopped` after Ctrl-C, SIGTERM or SIGHUP. Whichever
    it is, the machine was made safe if a line of the job had been sent.
    """
    with session_here(
        plan.machine,
        port,
        plan.job.name,
        keys=keys,
        virtual_speed=virtual_speed,
        signals=signals,
    ) as session:
        return session.cut(plan, on_progress=on_progress, **files)


def deliver(
    plan: JobPlan,
    transport: FlowTransport,
    signals: StopSignals,
    *,
    journal_path: Path | None = None,
    transcript_path: Path | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    keys: Keys | None = None,
) -> StreamResult:
    """Send a planned job over an open wire and close it; see :func:`stream_plan`."""
    session = MachineSession(transport, signals, PortSetup.of(plan.machine), keys)
    with closing(session):
        return session.cut(
            plan,
            journal_path=journal_path,
            transcript_path=transcript_path,
            on_progress=on_progress,
        )
