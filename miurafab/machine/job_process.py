"""Sending one job from a process of its own: a session there with one action.

:func:`stream_apart` does the work of :func:`~miurafab.machine.sender.stream_plan` in another
process (:mod:`~miurafab.machine.session_process`), so that no fault of the user interface can hurt
it. The starting program shows progress and asks the user.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Unpack

from miurafab.errors import JobStopped, MachineError
from miurafab.machine.keys import Keys, NoKeys
from miurafab.machine.planning import JobPlan
from miurafab.machine.sender import Files, Progress, StreamResult
from miurafab.machine.session_process import Outcome, SessionProcess
from miurafab.machine.signals import StopSignals


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
    with contextlib.ExitStack() as at_end:
        if signals is None:
            signals = at_end.enter_context(StopSignals())
            signals.at_once = False
        sender = SessionProcess(plan.machine, port, signals, virtual_speed)
        at_end.callback(sender.end)
        sender.order("cut", plan=plan, **files)
        sender.order("close")
        outcome = _attend(sender, keys or NoKeys(), on_progress)
    if outcome is not None and isinstance(outcome.value, StreamResult):
        return outcome.value
    if outcome is not None and outcome.error is not None:
        raise outcome.error
    if signals.caught is not None and not sender.begun:
        raise JobStopped(
            f"{plan.job.name} was stopped by {signals.reason} before a line of it was sent."
        )
    raise MachineError(
        f"The process that sent {plan.job.name} {sender.death}; {sender.make_safe()}."
    )


def _attend(
    sender: SessionProcess, keys: Keys, on_progress: Callable[[Progress], None] | None
) -> Outcome | None:
    """Pass on keys, show progress, until the outcome; None if the process died."""
    while not sender.over:
        message = sender.poll()
        if isinstance(message, Outcome):
            return message
        if isinstance(message, Progress) and on_progress is not None:
            on_progress(message)
        sender.press(keys.pressed())
    return None
