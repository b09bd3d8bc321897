"""The process that does the work, seen from both ends; it can be ended at any time.

The process reads an order as one line of JSON. It writes a line of JSON for each event: progress,
parts of the answer, and at the end ``done`` or ``error``. It ends at once when its standard input
is closed, which happens when the studio ends.
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
from typing import IO, Any, Protocol

from miurafab.child import python_command
from miurafab.errors import MiurafabError
from miurafab.studio.work import Order, carry_out, failure, order_from
from miurafab.workflow.json_text import json_text

News = dict[str, Any]


class Running(Protocol):
    """An order that is being carried out."""

    def news(self) -> list[News]:
        """The events since the last call."""

    def stop(self) -> None:
        """End it now, if it has not ended already."""


class Process:
    """An order that a process of its own carries out."""

    def __init__(self, order: Order) -> None:
        self._news: queue.SimpleQueue[News] = queue.SimpleQueue()
        self._last = ""
        self._process = subprocess.Popen(
            python_command(__name__),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            errors="replace",
        )
        out, err = self._process.stdout, self._process.stderr
        assert out is not None
        assert err is not None
        self._complaints = threading.Thread(target=self._keep_last, args=(err,), daemon=True)
        self._answers = threading.Thread(target=self._listen, args=(out,), daemon=True)
        self._complaints.start()
        self._answers.start()
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # _listen reports a process that has died
            self._process.stdin.write(json_text(order.as_dict(), one_line=True) + "\n")
            self._process.stdin.flush()

    def news(self) -> list[News]:
        """The events since the last call."""
        found = []
        with contextlib.suppress(queue.Empty):
            while True:
                found.append(self._news.get_nowait())
        return found

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
        ended = False
        for line in lines:
            try:
                said = json.loads(line)
            except json.JSONDecodeError:
                break  # the process was killed in mid-line
            ended = "done" in said or "error" in said
            self._news.put(said)
        status = self._process.wait()
        if not ended:
            self._complaints.join()
            self._news.put({"error": _unexpected(status, self._last)})

    def _keep_last(self, lines: IO[str]) -> None:
        for line in lines:
            self._last = line.strip() or self._last


def _unexpected(status: int, last: str) -> str:
    if status == -9:
        return "The system ended the computation, probably because memory ran out."
    return f"The computation ended unexpectedly ({last.rstrip('.') or f'status {status}'})."


def main() -> None:
    """Carry out the order on standard input."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the studio handles Ctrl-C and ends this process
    # What libraries print must not mix with the answers.
    answers = os.fdopen(os.dup(1), "w", encoding="ascii")
    os.dup2(2, 1)

    def tell(news: News) -> None:
        answers.write(json_text(news, one_line=True) + "\n")
        answers.flush()

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
