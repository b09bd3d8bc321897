"""The session of the studio: a process that holds the port, and a thread that attends it.

The process is that of ``machine open`` (:class:`~miurafab.machine.session_process.SessionProcess`),
and the rules of the bench are those of its :class:`~miurafab.workflow.at_machine.Operator`. Only
the thread touches the operator: it must be polled many times a second, and is not made for two.
Requests hand their work to the thread and wait for it.

:meth:`HeldSession.abort` alone waits for nobody: it writes the reset into the process's pipe from
whatever thread it is called in. What was asked for before it and is not begun is void, on both
sides of the pipe, so that no start can follow the reset that was meant to prevent it.
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from miurafab.errors import JobStopped, MachineError, MiurafabError
from miurafab.machine.keys import RESET
from miurafab.machine.session_process import Message, SessionProcess
from miurafab.machine.signals import StopSignals
from miurafab.machine.sleeping import slept_s
from miurafab.profiles import MachineProfile
from miurafab.studio.machine_words import ENDED, FAILED, NO_ANSWER, OVER, VOID
from miurafab.workflow.at_machine import Operator
from miurafab.workflow.cut_options import DEFAULT_OPTIONS

T = TypeVar("T")

_ANSWER_S = 20.0  # for the thread; the plan of a sheet of a million lines takes 3 s
_LOOK_S = 0.05  # between two looks at a state that no message has changed
_RESET_KEY = RESET.decode("ascii")


class DeskProcess(SessionProcess):
    """The process, with a reset that any thread may ask for.

    ``resets`` counts them, and what else makes void that which was asked for before. ``asked`` is
    that number when the order under way was asked for. ``heard`` is when a message came last, on
    the monotonic clock.
    """

    def __init__(self, machine: MachineProfile, port: str, speed: float | None) -> None:
        self.resets = self.asked = 0
        self.heard = time.monotonic()
        self._gate = threading.Lock()
        super().__init__(machine, port, StopSignals(), speed)

    def order(self, action: str, **options: Any) -> None:
        """As the base; raises ``JobStopped`` for what was asked for before a reset."""
        with self._gate:
            if self.asked != self.resets and action != "close":
                raise JobStopped(VOID)
            super().order(action, **options)

    def reset(self) -> None:
        """Have the controller reset now, before anything else."""
        with self._gate:
            self.resets += 1
            self.press(_RESET_KEY)

    def void(self) -> None:
        """Begin nothing more of what was asked for up to now."""
        with self._gate:
            self.resets += 1

    def poll(self) -> Message | None:
        """As the base."""
        message = super().poll()
        if message is not None:
            self.heard = time.monotonic()
        return message


class HeldSession:
    """A session at ``port`` and the thread that attends it; every method may be called in any
    thread.

    ``on_look`` is called by that thread with the operator after each message, and a few times a
    second; ``on_end`` with how the session ended, in a sentence, empty where it was asked to.
    ``asleep`` tells how long the computer has slept. ``trouble`` is what ended the last action, if
    it failed.
    """

    def __init__(
        self,
        machine: MachineProfile,
        port: str,
        *,
        on_look: Callable[[Operator], None],
        on_end: Callable[[str], None],
        speed: float | None = None,
        asleep: Callable[[], float] = slept_s,
    ) -> None:
        self.machine, self.port = machine, port
        self.process = DeskProcess(machine, port, speed)
        self.trouble = ""
        self._failure: MiurafabError | None = None
        self._on_look, self._on_end, self._asleep = on_look, on_end, asleep
        self._asked: queue.SimpleQueue[tuple[int, Callable[[Operator], Any], Future[Any]]] = (
            queue.SimpleQueue()
        )
        self._leaves = threading.Event()
        self._thread = threading.Thread(target=self._attend, name="miurafab desk", daemon=True)
        self._thread.start()

    def ask(self, work: Callable[[Operator], T], resets: int | None = None) -> T:
        """Have ``work`` done by the thread and return what it returns, or raise what it raises.

        ``resets`` is the number of them at which it was wanted; any since then makes it void.
        Raises :class:`~miurafab.errors.MachineError` if the session has ended, and for no answer:
        then it is not done later, when nobody expects it.
        """
        future: Future[T] = Future()
        self._asked.put((self.process.resets if resets is None else resets, work, future))
        if not self._thread.is_alive():
            self._refuse_rest()
        try:
            return future.result(_ANSWER_S)
        except TimeoutError:
            self.process.void()
            raise MachineError(NO_ANSWER) from None

    def abort(self) -> None:
        """Reset the controller now, whatever else is being done."""
        self.process.reset()
        self._asked.put((self.process.resets, _disarm, Future()))

    def leave(self) -> None:
        """End the session, dark, and wait for its end; does nothing the second time."""
        self._leaves.set()
        self._thread.join()

    def _attend(self) -> None:
        how = why = FAILED
        operator: Operator | None = None
        try:
            operator = Operator(self.process, None, DEFAULT_OPTIONS, self._asleep)
            self._follow(operator)
            why = self._why_over(operator)
        finally:
            try:
                if operator is None:
                    self.process.end()
                else:
                    how = operator.close() or why
            finally:
                self._leaves.set()
                self._refuse_rest()
                self._on_end(how)

    def _follow(self, operator: Operator) -> None:
        look_at = 0.0
        while not operator.over and not self._leaves.is_set():
            came = operator.take()
            came = self._carry_out(operator) or came
            while operator.failures:
                self._failure = operator.failures.popleft()
                self.trouble = self._failure.sentence
                operator.said.append(self.trouble)
            if self._failure is not None and not self._is_open(operator):
                return
            now = time.monotonic()
            if came or now >= look_at:
                look_at = now + _LOOK_S
                self._on_look(operator)

    def _is_open(self, operator: Operator) -> bool:
        return operator.state is not None and bool(operator.state.firmware)

    def _carry_out(self, operator: Operator) -> bool:
        """Do what was asked for; whether there was anything."""
        done = False
        while not self._asked.empty():
            asked, work, future = self._asked.get()
            done = True
            self.process.asked = asked
            self.trouble = ""
            try:
                if asked != self.process.resets:
                    operator.armed = False
                    raise JobStopped(VOID)
                future.set_result(work(operator))
            except MiurafabError as error:
                future.set_exception(error)
            except BaseException as defect:  # the session ends, dark
                future.set_exception(defect)
                raise
        self.process.asked = self.process.resets
        return done

    def _refuse_rest(self) -> None:
        while True:
            try:
                _, _, future = self._asked.get_nowait()
            except queue.Empty:
                return
            future.set_exception(MachineError(OVER))

    def _why_over(self, operator: Operator) -> str:
        """Why it ended without being asked to; empty if it was asked."""
        if self._failure is not None and (operator.over or not self._is_open(operator)):
            return self._failure.sentence
        return ENDED if operator.over else ""


def _disarm(operator: Operator) -> None:
    operator.armed = False
