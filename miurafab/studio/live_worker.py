"""The process that answers while a hand drags: it stays, so that nothing is imported for an answer.

It reads a question as a line of JSON, ``{"number": N, ...}`` (:mod:`~miurafab.studio.glance`), and
answers in a line: ``{"number": N, "answer": {...}}`` or ``{"number": N, "error": ...}``. Of several
questions that wait, only the last is answered; one that is overtaken while it is computed is left
at its next step. The process has a lower priority than the rest of the computer, and ends when its
standard input does.
"""

from __future__ import annotations

import json
import os
import sys
import threading
from typing import Any

from miurafab.errors import MiurafabError
from miurafab.studio.glance import Glances
from miurafab.studio.work import failure
from miurafab.studio.worker import answering


class _OvertakenError(Exception):
    """A newer question has come."""


class _Questions:
    """The last question on standard input, which a thread reads."""

    def __init__(self) -> None:
        self._there = threading.Condition()
        self._last: dict[str, Any] | None = None
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        for line in sys.stdin:
            with self._there:
                self._last = json.loads(line)
                self._there.notify()
        os._exit(0)

    def next(self) -> dict[str, Any]:
        """The last question that was not answered, once there is one."""
        with self._there:
            while self._last is None:
                self._there.wait()
            asked, self._last = self._last, None
            return asked

    def check(self, fraction: float, note: str) -> None:
        """Raise :class:`_OvertakenError` if there is a newer question."""
        if self._last is not None:
            raise _OvertakenError


def main() -> None:
    """Answer the questions on standard input."""
    with answering() as tell:
        questions, glances = _Questions(), Glances()
        while True:
            asked = questions.next()
            number = asked["number"]
            try:
                tell({"number": number, "answer": glances.answer(asked, questions.check)})
            except _OvertakenError:
                continue
            except (MiurafabError, OSError, MemoryError) as fault:
                tell({"number": number, "error": failure(fault)})
