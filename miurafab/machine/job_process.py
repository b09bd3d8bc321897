"""A session in a process of its own, from the first frame of a job to its last sheet.

:func:`session_apart` does the work of :func:`~miurafab.machine.sender.session_here` in another
process (:mod:`~miurafab.machine.session_process`), so that no fault of the user interface can hurt
it. The starting program shows progress and asks the user. While it waits for the user, a thread of
it tells the other process that it lives, and ends the waiting when the session has ended.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from typing import Any, Unpack

from miurafab.errors import JobStopped, MachineError, MiurafabError
from miurafab.machine.keys import Keys, NoKeys
from miurafab.machine.planning import JobPlan
from miurafab.machine.progress import Progress, StreamResult
from miurafab.machine.sender import Files, SheetSession
from miurafab.machine.session_process import Outcome, SessionProcess, suspending_signals
from miurafab.machine.signals import StopSignals
from miurafab.profiles import MachineProfile

_LOOK_S = 0.05  # between two looks at the other process while a person is waited for


@contextmanager
def session_apart(
    machine: MachineProfile,
    port: str,
    name: str,
    *,
    keys: Keys | None = None,
    virtual_speed: float | None = None,
    signals: StopSignals | None = None,
) -> Iterator[SheetSession]:
    """A session with ``machine`` at ``port`` in a process that begins with the first job.

    The arguments are those of :func:`~miurafab.machine.sender.session_here`; ``signals`` are those
    of a main thread that waits for this one, without it this thread's own. An exception in the
    block stops the machine.
    """
    own = signals is None
    with suspending_signals() if signals is None else nullcontext(signals) as signals:
        signals.at_once = False
        session = _SessionApart(machine, port, keys or NoKeys(), virtual_speed, signals, own)
        try:
            yield session
            session.close()
        except KeyboardInterrupt:
            raise JobStopped(f"{name} was stopped by {signals.reason}.") from None
        finally:
            session.end()


def stream_apart(
    plan: JobPlan,
    port: str,
    *,
    on_progress: Callable[[Progress], None] | None = None,
    keys: Keys | None = None,
    virtual_speed: float | None = None,
    signals: StopSignals | None = None,
    **files: Unpack[Files],
) -> StreamResult:
    """Send a planned job from a process of its own.

    The options are those of :func:`session_apart` and
    :func:`~miurafab.machine.sender.stream_plan`. Raises what ``stream_plan`` raises, and
    :class:`~miurafab.errors.MachineError` if the process dies, after the controller was reset.
    """
    with session_apart(
        plan.machine,
        port,
        plan.job.name,
        keys=keys,
        virtual_speed=virtual_speed,
        signals=signals,
    ) as session:
        return session.cut(plan, on_progress=on_progress, **files)


class _Lost(Exception):
    """The session ended while a person was waited for."""


class _SessionApart:
    """The session, as the starting program sees it; mutable."""

    def __init__(
        self,
        machine: MachineProfile,
        port: str,
        keys: Keys,
        virtual_speed: float | None,
        signals: StopSignals,
        own: bool,
    ) -> None:
        self._start: Callable[[], SessionProcess] = partial(
            SessionProcess, machine, port, signals, virtual_speed
        )
        self._keys, self._signals, self._own = keys, signals, own
        self._process: SessionProcess | None = None
        self._failed: Outcome | None = None
        self._last = ""

    def frame(self, plan: JobPlan) -> StreamResult:
        """See :class:`~miurafab.machine.sender.SheetSession`."""
        return self._send("frame", plan, None)

    def cut(
        self,
        plan: JobPlan,
        *,
        on_progress: Callable[[Progress], None] | None = None,
        **files: Unpack[Files],
    ) -> StreamResult:
        """See :class:`~miurafab.machine.sender.SheetSession`."""
        return self._send("cut", plan, on_progress, **files)

    def load(self) -> None:
        """See :class:`~miurafab.machine.sender.SheetSession`."""
        if self._process is not None:
            self._process.order("load")

    @contextmanager
    def waits(self) -> Iterator[Callable[[], bool]]:
        """See :class:`~miurafab.machine.sender.SheetSession`."""
        answered = threading.Event()
        keeper = threading.Thread(target=self._keep_alive, args=(answered,), name="miurafab waits")
        keeper.start()
        try:
            with self._signals.raising() if self._own else nullcontext():
                yield self._is_lost
        except _Lost:
            pass
        finally:
            answered.set()
            keeper.join()
        if self._is_lost() and self._signals.caught is None:
            raise self._loss()

    def _keep_alive(self, answered: threading.Event) -> None:
        process = self._process
        while process is not None and not self._is_lost() and not answered.wait(_LOOK_S):
            while not process.over and (message := process.poll()) is not None:
                self._note(message)
        if self._is_lost() and self._own and self._signals.caught is None and not answered.is_set():
            self._signals.interrupt(_Lost())

    def _is_lost(self) -> bool:
        """Whether the session has ended, or what was ordered has failed."""
        return self._failed is not None or (self._process is not None and self._process.over)

    def _loss(self) -> MiurafabError:
        """How the session ended."""
        process = self._process
        if self._failed is not None and self._failed.error is not None:
            return self._failed.error
        assert process is not None
        process.end()
        if self._signals.caught is not None and not process.begun:
            return JobStopped(
                f"{self._last} was stopped by {self._signals.reason} before a line of it was sent."
            )
        return MachineError(
            f"The process that sent {self._last} {process.death}; {process.make_safe()}."
        )

    def _note(self, message: object) -> None:
        if self._failed is None and isinstance(message, Outcome) and message.error is not None:
            self._failed = message

    def close(self) -> None:
        """End the session after what was ordered."""
        if self._process is not None:
            self._process.close()

    def end(self) -> None:
        """End the session now, on every way out."""
        if self._process is not None:
            self._process.end()

    def _send(
        self,
        action: str,
        plan: JobPlan,
        on_progress: Callable[[Progress], None] | None,
        **files: Any,
    ) -> StreamResult:
        if self._process is None:
            self._process = self._start()
        process = self._process
        self._last = plan.job.name
        process.order(action, plan=plan, **files)
        result = self._attend(process, on_progress)
        if result is None:
            raise self._loss()
        return result

    def _attend(
        self,
        process: SessionProcess,
        on_progress: Callable[[Progress], None] | None,
    ) -> StreamResult | None:
        """Pass on keys, show progress, until the result; None if it failed or the process died."""
        while self._failed is None and not process.over:
            message = process.poll()
            self._note(message)
            if isinstance(message, Outcome) and isinstance(message.value, StreamResult):
                return message.value
            if isinstance(message, Progress) and on_progress is not None:
                on_progress(message)
            process.press(self._keys.pressed())
        return None
