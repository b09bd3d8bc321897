"""Sending a job from a process of its own, so that no fault of the user interface can hurt it.

:func:`stream_apart` does the work of :func:`~miurafab.machine.sender.stream_plan` in another
process. The two processes watch each other:

* the sending process has no terminal, progress bar or dialogue. When the starting program dies or
  hangs, it stops the machine (:mod:`~miurafab.machine.watchdog`);
* the starting program shows progress and asks the user. When the sending process dies (``kill -9``,
  out of memory), it opens the port itself and resets the controller.

Ctrl-C in a terminal reaches both at once; the starting program passes on a signal that it alone
gets. It sends the pickled plan and then single bytes; it receives pickled progress and the outcome.
"""

from __future__ import annotations

import contextlib
import math
import os
import pickle
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import IO, Unpack

from miurafab.child import python_command
from miurafab.errors import JobStopped, MachineError, MiurafabError
from miurafab.machine.dialects import make_safe, open_machine
from miurafab.machine.keys import Keys, NoKeys
from miurafab.machine.planning import JobPlan
from miurafab.machine.sender import Files, Progress, StreamResult, stream_plan
from miurafab.machine.signals import StopSignals
from miurafab.machine.watchdog import BEAT, BEAT_S, STOPS, ParentWatch

_LOOK_S = 0.005  # between two looks at keys and signals
_STOP_S = 15.0  # for the process to stop the machine, ask it, and end; stopping takes 6 s at most


@dataclass(frozen=True, slots=True)
class _Order:
    """The order that the sending process gets at its start."""

    plan: JobPlan
    port: str
    virtual_speed: float | None
    files: Files


@dataclass(frozen=True, slots=True)
class _Begun:
    """The message of the sending process before it opens the port."""


class _Nothing:
    """No message yet."""


_Message = _Begun | Progress | StreamResult | MiurafabError | None


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

    The options are those of :func:`~miurafab.machine.sender.stream_plan`; ``signals`` are those of
    a main thread that waits for this one, without it this thread's own. Raises what
    ``stream_plan`` raises, and :class:`~miurafab.errors.MachineError` if the process dies, after
    the controller was reset.
    """
    order = _Order(plan, port, virtual_speed, files)
    with contextlib.ExitStack() as at_end:
        if signals is None:
            signals = at_end.enter_context(StopSignals())
            signals.at_once = False
        sender = _Sender(order)
        at_end.callback(sender.end)
        outcome = sender.attend(signals, keys or NoKeys(), on_progress)
    if isinstance(outcome, StreamResult):
        return outcome
    if isinstance(outcome, MiurafabError):
        raise outcome
    if signals.caught is not None and not sender.begun:
        raise JobStopped(
            f"{plan.job.name} was stopped by {signals.reason} before a line of it was sent."
        )
    raise MachineError(
        f"The process that sent {plan.job.name} {sender.death}; {_make_safe(order, sender.begun)}."
    )


class _Sender:
    """The other process, as the starting program sees it."""

    def __init__(self, order: _Order) -> None:
        self.begun = False
        self.death = ""
        self._messages: queue.SimpleQueue[_Message] = queue.SimpleQueue()
        self._complaints = b""
        self._process = subprocess.Popen(
            python_command(__name__),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            creationflags=_flags(),
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        assert self._process.stderr is not None
        self._down = self._process.stdin
        self._pipes = (self._process.stdout, self._process.stderr)
        with contextlib.suppress(OSError):  # one that has died says so below
            pickle.dump(order, self._down, protocol=5)
            self._down.flush()
        self._readers = [
            threading.Thread(target=work, args=(pipe,), name="miurafab sender", daemon=True)
            for work, pipe in zip((self._read, self._note), self._pipes, strict=True)
        ]
        for reader in self._readers:
            reader.start()

    def _read(self, pipe: IO[bytes]) -> None:
        with contextlib.suppress(EOFError, pickle.UnpicklingError):
            while True:
                self._messages.put(pickle.load(pipe))
        self._messages.put(None)

    def _note(self, pipe: IO[bytes]) -> None:
        self._complaints = pipe.read()

    def attend(
        self,
        signals: StopSignals,
        keys: Keys,
        on_progress: Callable[[Progress], None] | None,
    ) -> StreamResult | MiurafabError | None:
        """Pass on keys and signals, show progress, until the outcome; None if the process died."""
        # Nothing is written before it has read its order to the end.
        beat_at, give_up_at = math.inf, None
        while True:
            message = self._next()
            if isinstance(message, _Begun):
                self.begun, beat_at = True, 0.0
            elif isinstance(message, Progress):
                if on_progress is not None:
                    on_progress(message)
            elif not isinstance(message, _Nothing):
                self._process.wait()
                return message
            now = time.monotonic()
            if signals.caught is not None and give_up_at is None and self.begun:
                give_up_at = now + _STOP_S
                self._tell(STOPS[signals.caught])
            elif give_up_at is not None and now > give_up_at:
                self._process.kill()
            pressed = keys.pressed().encode("ascii", "ignore").translate(None, bytes(range(32)))
            if now >= beat_at or (pressed and self.begun):
                self._tell(BEAT + pressed)
                beat_at = now + BEAT_S

    def _next(self) -> _Message | _Nothing:
        try:
            return self._messages.get(timeout=_LOOK_S)
        except queue.Empty:
            return _Nothing()

    def _tell(self, data: bytes) -> None:
        with contextlib.suppress(OSError):
            self._down.write(data)
            self._down.flush()

    def end(self) -> None:
        """Close the pipe, on every way out; that stops the machine if it still runs."""
        with contextlib.suppress(OSError):
            self._down.close()
        try:
            self._process.wait(_STOP_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        for reader, pipe in zip(self._readers, self._pipes, strict=True):
            reader.join()
            pipe.close()
        code = self._process.returncode
        self.death = f"was killed by signal {-code}" if code < 0 else f"ended with code {code}"
        last = self._complaints.decode("utf-8", "replace").strip().rpartition("\n")[2]
        if last:
            self.death += f" ({last.rstrip('.')})"


def _flags() -> int:
    """On Windows the sending process has no console and a group of its own: when the window closes,
    the system ends the starting program alone, and the end of the pipe stops the machine.
    """
    names = ("CREATE_NO_WINDOW", "CREATE_NEW_PROCESS_GROUP")
    return sum(getattr(subprocess, name, 0) for name in names)


def _make_safe(order: _Order, begun: bool) -> str:
    """Reset the controller after its process died; returns the outcome as a clause."""
    if not begun:
        return "it had not opened the port"
    try:
        transport = open_machine(order.plan.machine, order.port)
    except MachineError as error:
        return (
            f"the controller could not be reset ({str(error).rstrip('.')}), so switch the laser "
            "off at the machine"
        )
    with contextlib.closing(transport):
        return make_safe(order.plan.machine, transport)


def main() -> None:
    """The sending process: take the order, send the job, tell the outcome."""
    up = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever prints must not get between the messages
    order: _Order = pickle.load(sys.stdin.buffer)

    def tell(message: object) -> None:
        with contextlib.suppress(OSError):  # nobody listens any more
            pickle.dump(message, up, protocol=5)
            up.flush()

    with StopSignals() as signals, ParentWatch(sys.stdin.fileno(), signals) as parent:
        signals.at_once = False
        tell(_Begun())
        try:
            outcome: StreamResult | MiurafabError = stream_plan(
                order.plan,
                order.port,
                virtual_speed=order.virtual_speed,
                signals=signals,
                on_progress=tell,
                keys=parent,
                **order.files,
            )
        except MiurafabError as error:
            outcome = error
        signals.at_once = False
        tell(outcome)
