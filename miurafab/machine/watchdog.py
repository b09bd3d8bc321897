"""A job in a process of its own, which ends it safely when the program that started it is gone.

The starting program holds the other end of this process's standard input and writes a byte there
every second, whatever byte. When the pipe closes (that program has died, however it died) or is
silent for :data:`SILENCE_S` (it hangs), this process is stopped as by SIGTERM: the reset goes onto
the wire, the beam is off, the journal has its last word. The user interface can die without harm.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

BEAT_S = 1.0
"""How often the starting program writes."""
SILENCE_S = 5.0
"""How long it may be silent."""


@contextmanager
def watched_by_parent(silence: float = SILENCE_S) -> Iterator[None]:
    """Until the block ends, stop this process as SIGTERM does when its parent falls silent."""
    watch = _Watch(sys.stdin.fileno(), silence)
    watch.start()
    try:
        yield
    finally:
        watch.over.set()


class _Watch:
    """Two threads: one reads, since no system's pipes can all be waited for, one keeps the time."""

    def __init__(self, descriptor: int, silence: float) -> None:
        self.over = threading.Event()
        self._descriptor = descriptor
        self._silence = silence
        self._heard = time.monotonic()

    def start(self) -> None:
        for work in (self._read, self._guard):
            threading.Thread(target=work, name="miurafab watchdog", daemon=True).start()

    def _read(self) -> None:
        while os.read(self._descriptor, 256):
            self._heard = time.monotonic()
        self._heard = -self._silence

    def _guard(self) -> None:
        while not self.over.wait(self._silence / 20):
            if time.monotonic() - self._heard > self._silence:
                signal.raise_signal(signal.SIGTERM)
                return
