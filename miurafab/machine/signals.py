"""Ctrl-C, a kill and a closed terminal, each turned into one exception, once.

While a job runs, the first of SIGINT, SIGTERM, SIGHUP (SIGBREAK on Windows) raises
``KeyboardInterrupt`` wherever the program is, so that the reset is on the wire within
milliseconds. Those that follow are ignored: the stopping itself, which takes a second, must not
be stopped.

Ctrl-Z (SIGTSTP) suspends a program that has a session in another process only when that process
was told (:class:`Suspension`): it would stand still with the machine in mid-job.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Any

_WORDS = {
    "SIGINT": "Ctrl-C",
    "SIGTERM": "a request to terminate (SIGTERM)",
    "SIGHUP": "the closing of the terminal (SIGHUP)",
    "SIGBREAK": "Ctrl-Break",
}


class Suspension:
    """A wish to suspend this program, which ``here`` fulfils when all ``sessions`` were told.

    ``wishes`` counts them; each session compares it with what it has told. ``pending``: not all
    have told it yet, and those that have must keep silent.
    """

    def __init__(self, here: Callable[[], None]) -> None:
        self.wishes = 0
        self.pending = False
        self.sessions: set[object] = set()
        self._here = here
        self._told: set[object] = set()

    def wish(self) -> None:
        """The person at the terminal wants it."""
        self.wishes += 1
        self.pending = True
        self._told.clear()
        self._suspend_if_told()

    def told(self, session: object) -> None:
        """The other process of ``session`` knows it."""
        self._told.add(session)
        self._suspend_if_told()

    def left(self, session: object) -> None:
        """``session`` has ended: nobody waits for it any more."""
        self.sessions.discard(session)
        self._suspend_if_told()

    def _suspend_if_told(self) -> None:
        if self.pending and self._told >= self.sessions:
            self._here()
            self.pending = False


class StopSignals:
    """``with StopSignals() as signals``; in another thread than the main one it does nothing.

    With ``at_once`` false the handler raises nothing, and only :meth:`check` does: for a wire
    whose reads must not be torn (the controller in memory). ``caught`` is the name of the first
    signal, None until one has come; ``cause`` says in words why it was sent, if somebody knows.
    """

    def __init__(self) -> None:
        self.suspension: Suspension | None = None
        self._waiting = False
        self._news: BaseException | None = None
        self.at_once = True
        self.cause: str | None = None
        self.caught: str | None = None
        self._held = False
        self._old: dict[int, Any] = {}

    @property
    def reason(self) -> str:
        """The name of the signal that stopped the job."""
        return self.cause or _WORDS.get(self.caught or "SIGINT", "a signal")

    def check(self) -> None:
        """Raise ``KeyboardInterrupt`` for a signal that has come, until :meth:`hold`.

        So one whose exception Python dropped (it came during a finaliser) is not lost.
        """
        if self.caught is not None and not self._held:
            raise KeyboardInterrupt

    def hold(self) -> None:
        """From now on ignore every signal: the job is being stopped."""
        self._held = True

    def release(self) -> None:
        """Heed signals again: what was being stopped has been stopped."""
        self._held = False

    @contextmanager
    def raising(self) -> Iterator[None]:
        """A block in which a signal raises at once, whatever is waited for, and news, too."""
        before, self.at_once = self.at_once, True
        self._waiting = True
        try:
            self.check()
            yield
        finally:
            self._waiting = False
            self.at_once = before

    def interrupt(self, news: BaseException) -> None:
        """From another thread: raise ``news`` in the main one's block of :meth:`raising`.

        Where no signal reaches a thread (Windows), it is raised when what is waited for returns.
        """
        main = threading.main_thread().ident
        if not self._old or main is None:
            return
        self._news = news
        if hasattr(signal, "pthread_kill"):
            signal.pthread_kill(main, signal.SIGINT)
        else:
            signal.raise_signal(signal.SIGINT)

    def __enter__(self) -> StopSignals:
        if threading.current_thread() is threading.main_thread():
            for name in _WORDS:
                number = getattr(signal, name, None)
                if number is None:
                    continue
                # A program started with nohup ignores SIGHUP on purpose. (That a shell starts a
                # background job with SIGINT ignored is no wish: who interrupts a laser means it.)
                if name != "SIGHUP" or signal.getsignal(number) is not signal.SIG_IGN:
                    self._old[number] = signal.signal(number, self._handle)
            number = getattr(signal, "SIGTSTP", None)
            if self.suspension is not None and number is not None:
                self._old[number] = signal.signal(number, self._suspend)
        return self

    def _suspend(self, number: int, frame: FrameType | None) -> None:
        assert self.suspension is not None
        self.suspension.wish()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        for number, handler in self._old.items():
            signal.signal(number, handler)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        news, self._news = self._news, None
        if news is not None and number == signal.SIGINT:
            if self._waiting:
                raise news
            return
        if self.caught is None:
            self.caught = signal.Signals(number).name
            if self.at_once:
                self.check()
