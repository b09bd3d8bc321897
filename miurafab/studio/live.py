"""Answers while a hand drags: one question at a time, the newest alone, by a process that stays.

A question gets a number. Its answer is waited for at most :data:`WAIT_S`, by one request at a time:
a browser has few connections to one server, and Abort must never wait for one. An older question
has no answer any more once a newer one is there.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from miurafab.studio.worker import News, Piped

WAIT_S = 0.5
"""The longest that a request waits for an answer."""
PATIENCE_S = 20.0
"""A process that has been at an older question for so long is ended when a newer one comes."""


class Answering(Protocol):
    """A process that answers questions, one line each."""

    def send(self, value: News) -> None:
        """Ask."""

    def stop(self) -> None:
        """End it now."""


Begin = Callable[[Callable[[News], None], Callable[[str], None]], Answering]


def warm(on_line: Callable[[News], None], on_end: Callable[[str], None]) -> Answering:
    """The process of :mod:`~miurafab.studio.live_worker`."""
    return Piped("miurafab.studio.live_worker", on_line, on_end)


class Live:
    """The newest question and its answer. Every method may be called in any thread.

    ``begin`` starts the process, at the first question and after it has ended.
    """

    def __init__(self, begin: Begin = warm) -> None:
        self._begin = begin
        self._there = threading.Condition()
        self._process: Answering | None = None
        self._lives = 0
        self._number = 0
        self._asked_at = 0.0
        self._said: News | None = None
        self._waiting = False

    def ask(self, question: Mapping[str, Any]) -> int:
        """Ask; the number of the question. What was asked before has no answer any more."""
        with self._there:
            late = time.monotonic() - self._asked_at > PATIENCE_S
            slow = self._process if self._number and self._said is None and late else None
            if slow is not None:
                self._process = None
            self._number += 1
            self._said, self._asked_at = None, time.monotonic()
            if self._process is None:
                self._lives += 1
                life = self._lives
                self._process = self._begin(self._take, lambda why: self._end(life, why))
            number = self._number
            self._process.send({"number": number, **question})
            self._there.notify_all()
        if slow is not None:
            slow.stop()
        return number

    def answer(self, number: int) -> News:
        """``{"answer": ...}`` or ``{"error": ...}``; ``{"wait": true}`` where there is none yet,
        and ``{"gone": true}`` where a newer question was asked.
        """
        with self._there:
            if not self._waiting:
                self._waiting = True
                try:
                    self._there.wait_for(
                        lambda: self._number != number or self._said is not None, WAIT_S
                    )
                finally:
                    self._waiting = False
            if self._number != number:
                return {"gone": True}
            return {"wait": True} if self._said is None else self._said

    def stop(self) -> None:
        """End the process."""
        with self._there:
            process, self._process = self._process, None
        if process is not None:
            process.stop()

    def _take(self, said: News) -> None:
        with self._there:
            if said.pop("number", None) == self._number:
                self._said = said
                self._there.notify_all()

    def _end(self, life: int, why: str) -> None:
        with self._there:
            if life != self._lives or self._process is None:
                return
            self._process = None
            if self._said is None:
                self._said = {"error": why}
                self._there.notify_all()
