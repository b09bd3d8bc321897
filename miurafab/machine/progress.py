"""What is said of a job on its way to a machine, and at its end."""

from __future__ import annotations

from dataclasses import dataclass

from miurafab.errors import JobStopped
from miurafab.findings import Finding
from miurafab.grbl.streamer import Refusal


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
    run in check mode (a real run ends at the first); ``findings`` the refusals that were forced,
    and what went wrong without harm.
    """

    lines: int
    seconds: float
    errors: tuple[Refusal, ...]
    findings: tuple[Finding, ...]


class JobAborted(JobStopped):
    """The job was ended at the keyboard, with time for the machine to come to rest."""
