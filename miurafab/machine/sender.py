"""Sending a job to a machine, from the opening of the port to the last move, safe on every way out.

The steps: open the port; prove that the journal and the transcript can be written; greet, query and
check the machine; send the lines (:mod:`~miurafab.machine.stream_driver`).

Every other way out - a refused line, an alarm, a reset, silence, a full disk, Ctrl-C, SIGTERM, an
exception in a progress callback - makes the machine safe before anything else happens. The outcome
stands in the sentence that the user reads.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing, nullcontext
from pathlib import Path
from typing import TypedDict, Unpack

from miurafab.errors import JobStopped
from miurafab.machine.dialects import open_machine
from miurafab.machine.keys import Keys
from miurafab.machine.known_controller import PortSetup
from miurafab.machine.machine_session import MachineSession
from miurafab.machine.planning import JobPlan
from miurafab.machine.progress import Progress, StreamResult
from miurafab.machine.signals import StopSignals
from miurafab.machine.transport import FlowTransport

__all__ = ["Files", "Progress", "StreamOptions", "StreamResult", "deliver", "stream_plan"]


class Files(TypedDict, total=False):
    """The files that record a job while it is sent."""

    journal_path: Path | None
    transcript_path: Path | None


class StreamOptions(Files, total=False):
    """... and ``on_progress``, called about five times a second. ``keys`` may hold, resume, abort
    and override while the job runs.
    """

    on_progress: Callable[[Progress], None] | None
    keys: Keys | None


def stream_plan(
    plan: JobPlan,
    port: str,
    *,
    virtual_speed: float | None = None,
    signals: StopSignals | None = None,
    **options: Unpack[StreamOptions],
) -> StreamResult:
    """Send a planned job to its machine at ``port`` and wait until it is done.

    ``port`` is a device, a pyserial URL, or ``virtual`` for a machine in memory set up as the
    profile says, as fast as the computer allows or at ``virtual_speed`` times real time.
    ``signals`` are those already caught, if any.

    Raises :class:`~miurafab.errors.InputError` for a file that cannot be written,
    :class:`~miurafab.errors.PortError` and :class:`~miurafab.errors.ControllerError` for what the
    machine did, :class:`~miurafab.errors.JobStopped` after Ctrl-C, SIGTERM or SIGHUP. Whichever
    it is, the machine was made safe if a line of the job had been sent.
    """
    with StopSignals() if signals is None else nullcontext(signals) as signals:
        try:
            transport = open_machine(plan.machine, port, virtual_speed)
            signals.at_once = transport.blocks
            return deliver(plan, transport, signals, **options)
        except KeyboardInterrupt:
            raise JobStopped(f"{plan.job.name} was stopped by {signals.reason}.") from None


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
