"""Sending one job over an open wire: its files, its driver, and every way out.

The files are proved first: a journal that cannot be written would leave the job without a way to go
on. Every way out but the last line - a refused line, an alarm, a reset, silence, a full disk,
Ctrl-C, SIGTERM, an exception in a progress callback - makes the machine safe before anything else
happens. The outcome stands in the sentence that the user reads.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from miurafab.errors import JobStopped, MiurafabError
from miurafab.machine.dialects import driver_of
from miurafab.machine.journal import Journal
from miurafab.machine.keys import Keys
from miurafab.machine.known_controller import Burnt, KnownController
from miurafab.machine.planning import JobPlan
from miurafab.machine.progress import Progress, StreamResult
from miurafab.machine.session import Session
from miurafab.machine.signals import StopSignals
from miurafab.machine.stream_driver import JobContext
from miurafab.machine.transcript import Transcript
from miurafab.machine.transport import FlowTransport


@dataclass(frozen=True)
class OpenWire:
    """An open wire, what was said over it, and who may step in."""

    transport: FlowTransport
    conversation: Session
    known: KnownController
    keys: Keys
    signals: StopSignals


def send_job(
    plan: JobPlan,
    wire: OpenWire,
    *,
    journal_path: Path | None = None,
    transcript_path: Path | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    burns: bool = False,
) -> StreamResult:
    """Send a planned job and wait until it is done; see
    :func:`~miurafab.machine.sender.stream_plan`.

    With ``burns`` the sheet in the machine is that of this job from its first line on.
    """
    job, name, signals = plan.job, wire.transport.name, wire.signals
    with ExitStack() as at_end:
        transcript = journal = None
        if transcript_path is not None:
            transcript = Transcript(transcript_path, f"{job.name} to {name}")
            at_end.callback(transcript.close)
        if journal_path is not None and not plan.options.check_mode:
            rest = plan.resumption
            journal = Journal(
                journal_path,
                job,
                plan.machine.name,
                name,
                plan.lines,
                from_line=rest.line if rest else 1,
                chosen=rest is not None and rest.chosen,
                sha256=plan.sha256,
            )
            at_end.callback(journal.close)
        wire.conversation.transcript = transcript
        at_end.callback(setattr, wire.conversation, "transcript", None)
        driver = driver_of(
            JobContext(
                plan,
                wire.transport,
                wire.conversation,
                wire.known,
                transcript,
                journal,
                on_progress,
                wire.keys,
                signals.check,
            )
        )
        # A signal between an exception and its handling would skip the handling, not this.
        at_end.callback(driver.make_safe)
        try:
            return driver.run()
        except KeyboardInterrupt:
            signals.hold()
            driver.end(JobStopped(f"{job.name} was stopped by {signals.reason}."))
        except MiurafabError as error:
            signals.hold()
            driver.end(error)
        except BaseException:  # a defect or an exit: no signal may tear the making safe at its end
            signals.hold()
            raise
        finally:
            if burns and driver.acknowledged and not plan.options.check_mode:
                wire.known.loaded = Burnt(job.name, plan.sha256)
