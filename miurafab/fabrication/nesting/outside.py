"""Engines of others: which there are, and how one is asked.

They work in a process of their own (:mod:`~miurafab.fabrication.nesting.worker`), which is killed
when the time is over: a solver in the middle of a step does not look at the clock. The layouts
that it had reported by then stand.
"""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import IO

from miurafab.errors import LayoutError
from miurafab.fabrication.nesting import worker
from miurafab.fabrication.nesting.problem import Problem, Slot

OUTSIDE = {"packingsolver": (3, 12), "spyrrow": (3, 11), "rectpack": (3, 11)}
"""The engines, the one that needs the least stock first, and the Python that each needs."""

_START = 60.0
"""How long in s a process may take until the engine is loaded, on a busy machine (judged)."""

_GRACE = 1.0
"""What an engine may take in s beyond its time before it is killed."""

_COMMAND = (
    "import sys; sys.path.insert(0, sys.argv[1]); "
    "from miurafab.fabrication.nesting.worker import main; main()"
)


@dataclass
class Proposals:
    """What an engine came up with: its ``version``, ``layouts`` in turn, whether it ended by itself
    (``finished``), and what went wrong, if anything.
    """

    version: str = ""
    layouts: list[list[Slot]] = field(default_factory=list)
    finished: bool = False
    complaint: str = ""


def installed(engine: str) -> bool:
    """Whether an outside engine can be asked."""
    return sys.version_info >= OUTSIDE[engine] and find_spec(engine) is not None


def check_installed(engine: str) -> None:
    """Raise :class:`~miurafab.errors.LayoutError` where an outside engine cannot be asked."""
    needed, here = (".".join(map(str, v[:2])) for v in (OUTSIDE[engine], sys.version_info))
    if sys.version_info < OUTSIDE[engine]:
        raise LayoutError(
            f"The nesting engine '{engine}' needs Python {needed} or newer, and this is Python "
            f"{here}; use the engine raster, or another Python."
        )
    if find_spec(engine) is None:
        raise LayoutError(
            f"The nesting engine '{engine}' is not installed; install it with: "
            "pip install 'miurafab[nesting]'"
        )


def propose(engine: str, problem: Problem) -> Proposals:
    """What an outside engine makes of ``problem`` in its time, unchecked.

    Raises :class:`~miurafab.errors.LayoutError` where the engine is not installed.
    """
    check_installed(engine)
    root = str(Path(__file__).resolve().parents[3])
    found = Proposals()
    begun = threading.Event()
    with subprocess.Popen(
        [sys.executable, "-c", _COMMAND, root],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
        errors="replace",
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stderr is not None
        last: list[str] = []
        readers = [
            threading.Thread(target=_listen, args=(process.stdout, found, begun), daemon=True),
            threading.Thread(target=_keep_last, args=(process.stderr, last), daemon=True),
        ]
        for reader in readers:
            reader.start()
        status = 0
        try:
            process.stdin.write(worker.written(engine, problem) + "\n")
            process.stdin.flush()
            if begun.wait(_START):
                status = process.wait(problem.seconds + _GRACE)
        except BrokenPipeError:
            status = process.wait()
        except subprocess.TimeoutExpired:
            pass
        finally:
            process.kill()
            for reader in readers:
                reader.join()
        if status and not found.complaint:
            found.complaint = f"ended with an error: {last[-1] if last else status}"
    return found


def _listen(lines: IO[str], found: Proposals, begun: threading.Event) -> None:
    """Take in what the worker says until it is gone."""
    for line in lines:
        try:
            said = json.loads(line)
        except json.JSONDecodeError:
            break  # cut off when it was killed
        found.version = said.get("begun", found.version)
        found.complaint = said.get("refused", found.complaint)
        found.finished = said.get("ended", found.finished)
        if "slots" in said:
            found.layouts.append(worker.layout(said["slots"]))
        begun.set()
    begun.set()


def _keep_last(lines: IO[str], last: list[str]) -> None:
    for line in lines:
        if line.strip():
            last[:] = [line.strip()]
