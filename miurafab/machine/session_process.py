"""A machine session in a process of its own, so that no fault of a user interface can hurt it.

The process that holds the port has no terminal, progress bar or dialogue. It takes orders, which
are actions of :class:`~miurafab.machine.machine_session.MachineSession`, and tells the state of the
machine, the progress of a job, and the outcome of each order. The two processes watch each other:

* when the starting program dies or hangs, the process stops the machine
  (:mod:`~miurafab.machine.watchdog`);
* when the process dies (``kill -9``, out of memory), the starting program opens the port itself and
  resets the controller (:meth:`SessionProcess.make_safe`).

Ctrl-C in a terminal reaches both at once; the starting program passes on a signal that it alone
gets. Ctrl-Z suspends the starting program alone, when what burns is held. It sends pickled orders
and single bytes; it receives pickled messages.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import IO, Any

from miurafab.child import python_command
from miurafab.errors import JobStopped, MachineError, MiurafabError, PortError
from miurafab.machine.dialects import make_safe, open_machine
from miurafab.machine.greeting import RESTARTED
from miurafab.machine.keys import RESET, obeys_overrides, suspend_here
from miurafab.machine.known_controller import MachineState, PortSetup
from miurafab.machine.machine_session import MachineSession
from miurafab.machine.owner import Owner, this_owner
from miurafab.machine.progress import JobAborted, Progress
from miurafab.machine.signals import StopSignals, Suspension
from miurafab.machine.watchdog import BEAT, BEAT_S, STOPS, SUSPENDED, ParentWatch, framed
from miurafab.profiles import MachineProfile

_LOOK_S = 0.005  # between two looks at keys and signals
_WATCH_S = 0.02  # between two looks at the orders while the machine is watched
_BURNING = ("cut", "frame")
_NO_KEYS = bytes(set(range(32)) - set(RESET))
_STOP_S = 15.0  # for the process to stop the machine, ask it, and end; stopping takes 10 s at most


@dataclass(frozen=True, slots=True)
class PortOpening:
    """The first order: the machine and the port to open, who is then its owner, and the
    ``arguments`` of the command that the person gave.
    """

    machine: MachineProfile
    port: str
    virtual_speed: float | None
    owner: Owner
    arguments: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class SessionOrder:
    """An action of the session by its name, with its ``options``; ``close`` ends it."""

    action: str
    options: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Begun:
    """The message of the process before it opens the port."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """An order was carried out: what its action returned, or the error that ended it."""

    action: str
    value: object = None
    error: MiurafabError | None = None


@dataclass(frozen=True, slots=True)
class Heard:
    """A line from the controller, or a refused jog: something for a person to read."""

    text: str


Message = Begun | MachineState | Progress | Outcome | Heard


def suspending_signals() -> StopSignals:
    """The signals of a program with sessions in other processes: those are told of Ctrl-Z."""
    signals = StopSignals()
    signals.suspension = Suspension(suspend_here)
    return signals


class SessionProcess:
    """The other process, as the starting program sees it; ``death`` says how it ended.

    ``signals`` are those of the thread that polls. ``begun``: it may have opened the port.
    """

    def __init__(
        self,
        machine: MachineProfile,
        port: str,
        signals: StopSignals,
        virtual_speed: float | None = None,
    ) -> None:
        self.begun = False
        self.over = False
        self.death = ""
        self.state: MachineState | None = None
        self._machine, self._port, self._signals = machine, port, signals
        self._messages: queue.SimpleQueue[Message | None] = queue.SimpleQueue()
        self._complaints = b""
        self._beat_at = 0.0
        self._give_up_at: float | None = None
        self._burns = 0
        wished = signals.suspension
        self._wishes = 0 if wished is None else wished.wishes - wished.pending
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
        self._readers = [
            threading.Thread(target=work, args=(pipe,), name="miurafab session", daemon=True)
            for work, pipe in zip((self._read, self._note), self._pipes, strict=True)
        ]
        for reader in self._readers:
            reader.start()
        self._send(PortOpening(machine, port, virtual_speed, this_owner(), tuple(sys.argv)))
        if wished is not None:
            wished.sessions.add(self)

    def _read(self, pipe: IO[bytes]) -> None:
        with contextlib.suppress(EOFError, pickle.UnpicklingError):
            while True:
                self._messages.put(pickle.load(pipe))
        self._messages.put(None)

    def _note(self, pipe: IO[bytes]) -> None:
        self._complaints = pipe.read()

    def _send(self, order: PortOpening | SessionOrder) -> None:
        self._tell(framed(pickle.dumps(order, protocol=5)))

    def _tell(self, data: bytes) -> None:
        with contextlib.suppress(OSError, ValueError):  # one that has died says so in poll
            self._down.write(data)
            self._down.flush()

    def order(self, action: str, **options: Any) -> None:
        """Have an action of the session carried out, after those that were ordered before."""
        self._burns += action in _BURNING
        self._send(SessionOrder(action, options))

    def press(self, keys: str) -> None:
        """Pass on pressed keys, which act at once."""
        data = keys.encode("ascii", "ignore").translate(None, _NO_KEYS)
        if data:
            self._tell(data)

    def poll(self) -> Message | None:
        """The next message, waiting a moment; None if there is none. Sets ``over`` at the end.

        To be called many times a second: it keeps the other process alive and passes signals on.
        """
        try:
            message = self._messages.get(timeout=_LOOK_S)
            self.over = message is None
        except queue.Empty:
            message = None
        if isinstance(message, Begun):
            self.begun = True
        elif isinstance(message, MachineState):
            self.state = message
        elif isinstance(message, Outcome) and isinstance(message.value, MachineState):
            self.state = message.value
        if isinstance(message, Outcome):
            self._burns -= message.action in _BURNING
        now = time.monotonic()
        if self._signals.caught is not None and self._give_up_at is None:
            self._give_up_at = now + _STOP_S
            self._tell(STOPS[self._signals.caught])
        elif self._give_up_at is not None and now > self._give_up_at:
            self._process.kill()
        wished = self._signals.suspension
        if now >= self._beat_at and not (wished is not None and wished.pending):
            self._tell(BEAT)
            self._beat_at = now + BEAT_S
        if wished is not None and wished.wishes != self._wishes:
            self._wishes = wished.wishes
            self._be_suspended(wished)
        return message

    def _be_suspended(self, wished: Suspension) -> None:
        """Have what burns held, and say that this program will be silent (Ctrl-Z).

        A machine whose beam may stay on in a hold is stopped, and what a person's line burns is
        ended: nobody would look at it.
        """
        if self._burns and obeys_overrides(self._machine.dialect):
            self.press(" ")
        elif self._burns:
            self.stop()
        elif self.state is not None and self.state.beam_on:  # by a person's line
            self.press("q")
        self._tell(SUSPENDED)
        self._beat_at = 0.0
        wished.told(self)

    def stop(self) -> None:
        """Have whatever runs, and the session, ended by a reset now."""
        self._tell(STOPS["SIGTERM"])

    def close(self) -> None:
        """Have the session closed after its last order, and wait for its end, but not for ever."""
        self.order("close")
        give_up_at = time.monotonic() + _STOP_S
        while not self.over and time.monotonic() < give_up_at:
            self.poll()
        self.end()

    def end(self) -> None:
        """Close the pipe, on every way out; that stops the machine if it still runs."""
        if self._signals.suspension is not None:
            self._signals.suspension.left(self)
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

    def make_safe(self) -> str:
        """Reset the controller after the process has died; returns the outcome as a clause."""
        if not self.begun:
            return "it had not opened the port"
        try:
            transport = open_machine(self._machine, self._port)
        except MachineError as error:
            return (
                f"the controller could not be reset ({str(error).rstrip('.')}), so switch the "
                "laser off at the machine"
            )
        with contextlib.closing(transport):
            return make_safe(self._machine, transport)


def _flags() -> int:
    """On Windows the process has no console and a group of its own: when the window closes, the
    system ends the starting program alone, and the end of the pipe stops the machine.
    """
    names = ("CREATE_NO_WINDOW", "CREATE_NEW_PROCESS_GROUP")
    return sum(getattr(subprocess, name, 0) for name in names)


# The process itself


def main() -> None:
    """Open the port, carry out orders until the end, and leave the machine dark."""
    up = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever prints must not get between the messages
    if sys.platform != "win32":
        signal.signal(signal.SIGTSTP, signal.SIG_IGN)  # Ctrl-Z is for the starting program

    def tell(message: Message) -> None:
        if parent.suspended and isinstance(message, MachineState | Progress):
            return  # nobody reads them, and a full pipe would hold this process up
        data = pickle.dumps(message, protocol=5)  # whole, so that a signal cannot tear it
        with contextlib.suppress(OSError):  # nobody listens any more
            up.write(data)
            up.flush()

    with StopSignals() as signals, ParentWatch(sys.stdin.fileno(), signals) as parent:
        signals.at_once = False
        try:
            opening: PortOpening = _next(parent, signals)
            sys.argv[:] = opening.arguments  # by which messages call this command
            tell(Begun())
            with _opened(opening, signals, parent, tell) as session:
                _serve(session, parent, signals, tell)
        except KeyboardInterrupt:
            tell(Outcome("open", error=JobStopped(f"Stopped by {signals.reason}.")))
        except MiurafabError as error:
            tell(Outcome("open", error=error))


def _next(parent: ParentWatch, signals: StopSignals) -> Any:
    """The next order, however long that takes."""
    while True:
        signals.check()
        order = parent.next_order(_WATCH_S)
        if order is not None:
            return pickle.loads(order.data)


@contextlib.contextmanager
def _opened(
    opening: PortOpening, signals: StopSignals, parent: ParentWatch, tell: Callable[[Message], None]
) -> Any:
    transport = open_machine(opening.machine, opening.port, opening.virtual_speed)
    owner = replace(opening.owner, holder=os.getpid())
    session = MachineSession(transport, signals, PortSetup.of(opening.machine), parent, owner)
    session.on_state = tell
    session.lines.on_line = lambda text: tell(Heard(text))
    try:
        yield session
    finally:
        session.close()
        signals.at_once = False


def _serve(
    session: MachineSession,
    parent: ParentWatch,
    signals: StopSignals,
    tell: Callable[[Message], None],
) -> None:
    """Carry out orders and watch the machine between them, until the order to close."""
    while True:
        signals.check()
        given = parent.next_order(0.0 if session.known.opened and session.blocks else _WATCH_S)
        if given is not None:
            order: SessionOrder = pickle.loads(given.data)
            if order.action == "close":
                return
            if parent.resets != given.resets:
                tell(Outcome(order.action, error=JobStopped("Stopped before it was begun.")))
            else:
                _carry_out(order, session, signals, tell)
        elif session.known.opened:
            try:
                session.watch(_WATCH_S)
            except PortError:
                raise
            except MachineError as error:
                tell(Heard(str(error)))


def _carry_out(
    order: SessionOrder,
    session: MachineSession,
    signals: StopSignals,
    tell: Callable[[Message], None],
) -> None:
    more = {"on_progress": tell} if order.action in ("cut", "frame") else {}
    try:
        value = getattr(session, order.action)(**order.options, **more)
    except KeyboardInterrupt:
        session.close()
        tell(Outcome(order.action, error=JobStopped(f"Stopped by {signals.reason}.")))
        raise
    except MiurafabError as error:
        if isinstance(error, JobAborted):  # by a key, in an action that leaves nothing running
            session.abort(at_once=error.at_once)
            error = JobStopped(error.sentence)
        tell(session.state)
        tell(Outcome(order.action, error=error))
        if isinstance(error, PortError):
            raise
        signals.release()
    else:
        if order.action == "open" and session.conversation.take_restart():
            tell(Heard(f"The opening of {session.state.port} {RESTARTED}."))
        tell(session.state)
        tell(Outcome(order.action, value))
