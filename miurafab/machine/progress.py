"""The progress of a job that is being sent, and its result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from miurafab.errors import JobStopped
from miurafab.findings import Finding
from miurafab.grbl.streamer import Refusal


class Overrides(NamedTuple):
    """What the controller makes of the programmed feed, rapid rate and power, in percent."""

    feed: int = 100
    rapid: int = 100
    power: int = 100

    @property
    def words(self) -> str:
        """Those that are not as written, as ``feed 110 %, power 70 %``; empty if all are."""
        return ", ".join(
            f"{name} {percent} %"
            for name, percent in zip(self._fields, self, strict=True)
            if percent != 100
        )


AS_WRITTEN = Overrides()
"""Nothing is overridden."""


@dataclass(frozen=True, slots=True)
class Progress:
    """The progress of a running job; ``position`` in work coordinates, ``in_flight`` in bytes.

    ``line`` is the last acknowledged line of the file (0: none).
    """

    lines_acknowledged: int
    lines_total: int
    seconds_elapsed: float
    state: str
    position: tuple[float, ...] | None
    in_flight: int
    line: int
    overrides: Overrides


@dataclass(frozen=True)
class StreamResult:
    """A job that is done: every line acknowledged, the machine idle.

    ``seconds`` on the wire's clock from the first line to Idle; ``errors`` the refused lines of a
    run in check mode (a real run ends at the first refused line); ``findings`` the refusals that
    were forced, and faults that did no harm.
    """

    lines: int
    seconds: float
    errors: tuple[Refusal, ...]
    findings: tuple[Finding, ...]


class JobAborted(JobStopped):
    """The user ended the job at the keyboard; the machine has time to come to rest, but for one
    that is wanted ``at_once``.
    """

    def __init__(self, sentence: str, *, at_once: bool = False) -> None:
        super().__init__(sentence)
        self.at_once = at_once
