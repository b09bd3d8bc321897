"""The journal: the acknowledged lines of a running job on the disk, so that it can be resumed.

The journal is a file of JSON objects, one a line; each run of a job appends its own. First a
header: ``schema``, ``job``, ``sha256`` of the whole program's text, ``machine``, ``port``,
``lines``, and ``from_line``, where the run began (1 unless it resumed another, or, with
``chosen``, a person left out what comes before). Then, when the
controller has said so, ``{"blocks": n}``: it plans n moves ahead. Then, four times a second of
the wire's clock at most, ``{"taken": n, "line": k, "seconds": t}``: n lines were acknowledged (or
handed over, to a cutter that answers nothing), the last of them line k of the file. When a key
changes them, ``{"overrides": [feed, rapid, power], "line": k, "seconds": t}`` in percent. At the
end ``{"ended": how, "why": sentence}``, how being ``done``, ``stopped`` or ``failed``.

What it says was taken, was taken; a little more may have been when a run ends without a last
word (power loss). *Taken* is not *burnt*: the planner and the receive buffer still held lines.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from miurafab.errors import InputError
from miurafab.files import Reading, parse_json, read_bytes
from miurafab.gcode.job import Job
from miurafab.machine.append_log import DurableFile
from miurafab.machine.progress import AS_WRITTEN, Overrides

SCHEMA = "miurafab-journal/1"
_PERIOD = 0.25  # s between two records


class Journal:
    """The journal of one run, open for writing.

    A run that resumes another begins at ``from_line`` and has the ``sha256`` of the whole. Raises
    :class:`~miurafab.errors.InputError` if ``path`` cannot be written.
    """

    def __init__(
        self,
        path: Path,
        job: Job,
        machine: str,
        port: str,
        lines: int,
        *,
        from_line: int = 1,
        chosen: bool = False,
        sha256: str | None = None,
    ) -> None:
        header: dict[str, Any] = {
            "schema": SCHEMA,
            "job": job.name,
            "sha256": sha256 or job.sha256,
            "machine": machine,
            "port": port,
            "lines": lines,
            "from_line": from_line,
        }
        if chosen:
            header["chosen"] = True
        # The blank line parts this run from what a power loss may have torn.
        self._file = DurableFile(path, "journal", b"\n" + _record(header), append=True)
        self._count = 0
        self._due = 0.0
        self._pending: dict[str, Any] | None = None

    def plans_ahead(self, blocks: int) -> None:
        """Record that the controller plans ``blocks`` moves ahead."""
        self._file.append(_record({"blocks": blocks}))

    def taken(self, count: int, line: int, seconds: float) -> None:
        """Record that ``count`` lines were acknowledged, the last of them ``line`` of the file."""
        if count == self._count:
            return
        self._count = count
        self._pending = {"taken": count, "line": line, "seconds": round(seconds, 3)}
        if seconds >= self._due:
            self._due = seconds + _PERIOD
            self._flush()

    def _flush(self) -> None:
        if self._pending is not None:
            self._file.append(_record(self._pending))
            self._pending = None

    def overridden(self, overrides: Overrides, line: int, seconds: float) -> None:
        """Record that ``overrides`` are in force from about ``line`` of the file on."""
        self._flush()
        self._file.append(
            _record({"overrides": overrides, "line": line, "seconds": round(seconds, 3)})
        )

    def ended(self, how: str, why: str) -> None:
        """Record how the run ended."""
        self._flush()
        self._file.append(_record({"ended": how, "why": why}))

    def check(self) -> None:
        """Raise :class:`~miurafab.errors.MachineError` if something could not be written."""
        self._file.check()

    def close(self) -> None:
        """Finish the file."""
        self._file.close()


@dataclass(frozen=True)
class JournalRun:
    """One run in the journal.

    ``taken`` lines were acknowledged for certain, the last being ``line`` of the file (0: none);
    ``ended`` is None when the run broke off without a last word.
    """

    job: str
    sha256: str
    machine: str
    port: str
    lines: int
    from_line: int = 1
    chosen: bool = False
    blocks: int | None = None
    taken: int = 0
    line: int = 0
    seconds: float = 0.0
    overrides: Sequence[int] = AS_WRITTEN
    ended: str | None = None
    why: str | None = None


def read_journal(path: Path) -> list[JournalRun]:
    """All runs in the journal, in order; a torn line ends the record of its run.

    Raises :class:`~miurafab.errors.InputError` if the file cannot be read or holds no run.
    """
    text = read_bytes(path, InputError).decode("utf-8", errors="replace")
    runs: list[dict[str, Any]] = []
    for line in text.splitlines():
        record = _parse(line)
        if record.get("schema") == SCHEMA:
            del record["schema"]
            runs.append(record)
        elif runs:
            runs[-1].update(record)
    with Reading(path, "a journal of this version", InputError):
        found = [_run(run) for run in runs]
    if not found:
        raise InputError(f"{path} is not a journal: it holds no run with schema {SCHEMA!r}.")
    return found


def _run(record: dict[str, Any]) -> JournalRun:
    """The run of a ``record``. Raises ``TypeError``, ``ValueError`` for values of other kinds."""
    run = JournalRun(**record)
    if not isinstance(run.overrides, list | tuple) or len(run.overrides) != len(AS_WRITTEN):
        raise ValueError("it holds other overrides than those of feed, rapids and power")
    texts = (run.job, run.sha256, run.machine, run.port, run.ended or "", run.why or "")
    numbers = (run.lines, run.from_line, run.blocks or 0, run.taken, run.line, *run.overrides)
    if not all(isinstance(text, str) for text in texts):
        raise ValueError("it holds something else in place of a text")
    if not all(type(number) is int and number >= 0 for number in numbers):
        raise ValueError("it holds something else in place of a whole number")
    if not isinstance(run.seconds, int | float) or not math.isfinite(run.seconds):
        raise ValueError("it holds something else in place of a time")
    return run


def _record(values: dict[str, Any]) -> bytes:
    return json.dumps(values, ensure_ascii=False).encode("utf-8") + b"\n"


def _parse(line: str) -> dict[str, Any]:
    try:
        record = parse_json(line)
    except (ValueError, RecursionError):
        return {}
    return record if isinstance(record, dict) else {}
