"""The watchdog: the process that holds a port stops the machine when its starting program is gone.

The starting program writes bytes to the standard input of this process: a :data:`BEAT` every
second, each key that the user presses, the number of a stop, or an order (:data:`ORDER`, four bytes
of its length, and that many). The key that resets at once makes what was ordered before it and
is not begun void, by its number (:attr:`ParentWatch.resets`). When the pipe closes (that program
has died) or is silent for :data:`SILENCE_S` (it hangs), this process stops as by SIGTERM: it resets
the controller, the beam is off, and the journal gets its last record. So the user interface can die
without harm.
"""

from __future__ import annotations

import os
import queue
import signal
import threading
import time
from types import TracebackType
from typing import NamedTuple

from miurafab.machine.keys import RESET
from miurafab.machine.signals import StopSignals

BEAT = b"\0"
BEAT_S = 1.0
"""The longest time between two bytes of a working program."""
SILENCE_S = 5.0
"""The silence after which the starting program counts as hung."""
STOPS = {"SIGINT": b"\1", "SIGTERM": b"\2", "SIGHUP": b"\3", "SIGBREAK": b"\4"}
"""The bytes that stop this process as the signal of that name does."""
ORDER = b"\5"
SUSPENDED = b"\6"
"""The starting program is suspended by a person (Ctrl-Z): its silence is meant until it beats."""


def framed(order: bytes) -> bytes:
    """An order as the starting program writes it."""
    return ORDER + len(order).to_bytes(4, "big") + order


class GivenOrder(NamedTuple):
    """An order as it came, and the number of keys that reset at once before it."""

    data: bytes
    resets: int


_SIGNALS = {code[0]: name for name, code in STOPS.items()}


class ParentWatch:
    """``with ParentWatch(...)``: watch the starting program until the end of the block.

    ``resets`` is the number of keys that reset at once, up to now. ``suspended``: a person has
    suspended the starting program, which reads nothing meanwhile.
    ``descriptor`` is the pipe's end to read; ``signals`` are told why, when it is gone. It is also
    the job's keyboard (:class:`~miurafab.machine.keys.Keys`): printable bytes are keys.
    """

    def __init__(self, descriptor: int, signals: StopSignals, silence: float = SILENCE_S) -> None:
        self._descriptor = descriptor
        self._signals = signals
        self._silence = silence
        self._heard = time.monotonic()
        self.suspended = False
        self._over = threading.Event()
        self.resets = 0
        self._keys: list[str] = []
        self._orders: queue.SimpleQueue[GivenOrder] = queue.SimpleQueue()

    def next_order(self, timeout: float) -> GivenOrder | None:
        """The next order, waiting up to ``timeout`` seconds; None if there is none."""
        try:
            return self._orders.get(timeout=timeout)
        except queue.Empty:
            return None

    def pressed(self) -> str:
        """The keys pressed since the last call; never waits."""
        keys = "".join(self._keys)
        del self._keys[: len(keys)]
        return keys

    def __enter__(self) -> ParentWatch:
        # Two threads: one reads, since no system's pipes can all be waited for, one keeps the time.
        for work in (self._read, self._guard):
            threading.Thread(target=work, name="miurafab watchdog", daemon=True).start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._over.set()

    def _read(self) -> None:
        coming = bytearray()
        while data := os.read(self._descriptor, 65_536):
            self._heard = time.monotonic()
            coming += data
            while size := self._take(coming):
                del coming[:size]
        self._lost("the end of the program that started it")

    def _take(self, coming: bytearray) -> int:
        """Take the first message; returns its bytes, 0 while it is not whole."""
        if not coming:
            return 0
        if coming[:1] == ORDER:
            end = 5 + int.from_bytes(coming[1:5], "big")
            if len(coming) < max(5, end):
                return 0
            self._orders.put(GivenOrder(bytes(coming[5:end]), self.resets))
            return end
        name = _SIGNALS.get(coming[0])
        if name is not None:
            self._stop(name)
        elif coming[:1] in (BEAT, SUSPENDED):
            self.suspended = coming[:1] == SUSPENDED
        else:
            self.resets += coming[:1] == RESET
            self._keys.append(chr(coming[0]))
        return 1

    def _guard(self) -> None:
        while not self._over.wait(self._silence / 20):
            if not self.suspended and time.monotonic() - self._heard > self._silence:
                self._lost("the silence of the program that started it")
                return

    def _lost(self, why: str) -> None:
        if not self._over.is_set():
            self._signals.cause = why
            self._stop("SIGTERM")

    def _stop(self, name: str) -> None:
        if self._over.is_set():
            return
        number = getattr(signal, name, signal.SIGTERM)
        main = threading.main_thread().ident
        if hasattr(signal, "pthread_kill") and main is not None:
            # To the main thread itself, so that whatever it waits for ends at once.
            signal.pthread_kill(main, number)
        else:
            signal.raise_signal(number)
