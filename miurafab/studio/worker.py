"""Processes that work for the studio, seen from both ends; they can be ended at any time.

A process reads lines of JSON on its standard input, and writes lines of JSON on its standard
output. It has a lower priority than the studio and the session with a machine, and it ends at once
when its standard input is closed, which happens when the studio ends.

:class:`Process` carries out one order: it writes progress, parts of the answer, and at the end
``done`` or ``error``.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from typing import IO, Any, Protocol

from miurafab.child import python_command
from miurafab.errors import MiurafabError
from miurafab.studio.work import Order, carry_out, failure, order_from
from miurafab.workflow.json_text import json_text

News = dict[str, Any]

_LOWER = 10
"""How much nicer (POSIX ``nice``) a process is than the studio."""
_LOWER_HERE = getattr(subprocess, "BELOW_NORMAL_PRIORITY_CLASS", 0)
"""The same for Windows."""


class Running(Protocol):
    """An order that is being carried out."""

    def news(self) -> list[News]:
        """The events since the last call."""

    def stop(self) -> None:
        """End it now, if it has not ended already."""


class Piped:
    """A process that runs ``main`` of ``module``. ``on_line`` gets each line that it writes, and
    ``on_end`` why it ended, in a sentence; both in a thread of their own.
    """

    def __init__(
        self, module: str, on_line: Callable[[News], None], on_end: Callable[[str], None]
    ) -> None:
        self._on_line, self._on_end = on_line, on_end
        self._last = ""
        self._process = subprocess.Popen(
            python_command(module),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            errors="replace",
            creationflags=_LOWER_HERE,
        )
        out, err = self._process.stdout, self._process.stderr
        assert out is not None
        assert err is not None
        self._complaints = threading.Thread(target=self._keep_last, args=(err,), daemon=True)
        self._answers = threading.Thread(target=self._listen, args=(out,), daemon=True)
        self._complaints.start()
        self._answers.start()

    def send(self, value: News) -> None:
        """Write one line; a process that has died is told by ``on_end``."""
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.write(json_text(value, one_line=True) + "\n")
            self._process.stdin.flush()

    def stop(self) -> None:
        """Kill the process and wait until it is gone."""
        self._process.kill()
        self._answers.join()
        self._complaints.join()
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            assert pipe is not None
            with contextlib.suppress(BrokenPipeError):
                pipe.close()

    def _listen(self, lines: IO[str]) -> None:
        for line in lines:
            try:
                said = json.loads(line)
            except json.JSONDecodeError:
                break  # the process was killed in mid-line
            self._on_line(said)
        status = self._process.wait()
        self._complaints.join()
        self._on_end(_unexpected(status, self._last))

    def _keep_last(self, lines: IO[str]) -> None:
        for line in lines:
            self._last = line.strip() or self._last


class Process:
    """An order that a process of its own carries out."""

    def __init__(self, order: Order) -> None:
        self._news: queue.SimpleQueue[News] = queue.SimpleQueue()
        self._ended = False
        self._piped = Piped(__name__, self._take, self._end)
        self._piped.send(order.as_dict())

    def _take(self, said: News) -> None:
        self._ended = "done" in said or "error" in said
        self._news.put(said)

    def _end(self, why: str) -> None:
        if not self._ended:
            self._news.put({"error": why})

    def news(self) -> list[News]:
        """The events since the last call."""
        found = []
        with contextlib.suppress(queue.Empty):
            while True:
                found.append(self._news.get_nowait())
        return found

    def stop(self) -> None:
        """Kill the process and wait until it is gone."""
        self._piped.stop()


def _unexpected(status: int, last: str) -> str:
    if status == -9:
        return "The system ended the computation, probably because memory ran out."
    return f"The computation ended unexpectedly ({last.rstrip('.') or f'status {status}'})."


@contextlib.contextmanager
def answering() -> Iterator[Callable[[News], None]]:
    """A function that writes a line of the answer, for the ``main`` of such a process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the studio handles Ctrl-C and ends this process
    if hasattr(os, "nice"):
        os.nice(_LOWER)
    # What libraries print must not mix with the answers.
    with os.fdopen(os.dup(1), "w", encoding="ascii") as answers:
        os.dup2(2, 1)

        def tell(news: News) -> None:
            answers.write(json_text(news, one_line=True) + "\n")
            answers.flush()

        yield tell


def main() -> None:
    """Carry out the order on standard input."""
    with answering() as tell:
        order = order_from(json.loads(sys.stdin.readline()))
        threading.Thread(target=_end_with_studio, daemon=True).start()
        try:
            carry_out(order, tell)
        except (MiurafabError, OSError, MemoryError) as fault:
            tell({"error": failure(fault)})
        else:
            tell({"done": True})


def _end_with_studio() -> None:
    while os.read(0, 4096):
        pass
    os._exit(1)
