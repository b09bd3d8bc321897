"""The greeting: learn that a controller is there, at rest, and holds no line of anybody else.

A banner says all of it: the controller has just started. Where none comes (the opening of the port
did not reset the board, or the board never greets) two answers say it: a status report of Idle or
Alarm, and ``$I`` answered before anything else. Lines are answered in their order, so a line of
another program in the buffer would be answered first; half a line there makes an error of ``$I``.

So a controller at rest is not reset, since a reset undoes an unlocking and an origin. Only one that
cannot prove its rest is. The same proof stands for the banner after a reset.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from miurafab.errors import ControllerError, PortError
from miurafab.grbl.connection import SOFT_RESET
from miurafab.grbl.events import Alarm, Banner, Error, Event, Ok, StatusReport, Version
from miurafab.grbl.states import State

if TYPE_CHECKING:
    from miurafab.machine.session import Session

RESTARTED = (
    "restarted the board: an unlocking, an origin set with G92 and a position that was not homed "
    "are forgotten"
)
"""What the opening of a port did, and what that undid."""
ANSWER_S = 3.0
"""The longest time until a working controller answers a question."""
RESET_S = 0.8
"""The longest time from a soft reset to the banner."""
_ASK_AGAIN_S = 1.0  # a boot loader takes no status query
_PROOF_S = 0.5  # for ? and $I where a banner is missing; they take milliseconds
_PROBES = 2
_BUSY = ("Run", "Jog", "Home", "Hold", "Door", "Tool")  # Tool: grblHAL changes its tool
_AT_REST = ("Idle", "Alarm")
_RELEASE = re.compile(r"\d+\.\d+[a-z]?")


def greet(session: Session, patience: float, *, reset: bool = False) -> None:
    """Learn the controller's state; reset it only if that needs it or ``reset`` asks for it.

    A board may take ``patience`` seconds to start if the opening of its port resets it. One that is
    at work raises :class:`~miurafab.errors.ControllerError` unless ``reset`` is given, and nothing
    is disturbed. Raises :class:`~miurafab.errors.PortError` if nothing that speaks GRBL answers.
    """
    word: Event | None = _first_word(session, patience)
    session.restarted = isinstance(word, Banner)
    if isinstance(word, StatusReport) and not reset:
        if word.state in _BUSY:
            raise ControllerError(
                f"The controller at {session.name} is at work ({word.state}) on something it was "
                "sent before; wait until it is done, or `reset` it."
            )
        if word.state in _AT_REST:
            word = _prove_rest(session, ANSWER_S)
            session.restarted = isinstance(word, Banner)
    if not isinstance(word, Banner | Ok):
        session.write(session.connection.send_realtime(SOFT_RESET))
        session.forget_query()
        if not restarts(session, patience):
            raise PortError(
                f"Nothing that speaks GRBL answers at {session.name}; check the port, the baud "
                "rate of the machine profile and the machine's power, and give a slow board more "
                f"time (`wait` is {patience:g} s)."
            )
    session.wait_status()


def restarts(session: Session, patience: float) -> bool:
    """Whether a soft reset was heard: by a banner within ``patience`` seconds, or by proof."""
    end = session.now() + patience
    while True:
        # What comes until then may have been said before the reset.
        if session.wait_banner(min(RESET_S, patience)) is not None:
            return True
        report = session.fresh_status(_PROOF_S)
        if session.connection.state is not State.RESETTING:
            return True  # a late banner
        rests = report is not None and report.state in _AT_REST
        if rests and isinstance(_prove_rest(session, _PROOF_S), Banner | Ok):
            return True
        if session.now() >= end:
            return False


def _first_word(session: Session, patience: float) -> Banner | StatusReport | None:
    end = session.now() + patience
    while session.now() < end:
        session.ask_status()
        for event in session.receive(min(end - session.now(), _ASK_AGAIN_S)):
            boots = isinstance(event, StatusReport) and event.state == "Starting"  # FluidNC
            if isinstance(event, Banner | StatusReport) and not boots:
                return event
    return None


def _prove_rest(session: Session, timeout: float) -> Event | None:
    """The ``ok`` that proves it, or the banner of a restart; None where nothing is proved.

    An error may be the answer to half a line that lay there, so the question is asked again.
    """
    connection = session.connection
    answer: Event | None = None
    for _ in range(_PROBES):
        if connection.awaits_proof:
            session.write(connection.probe())
            answer = _answer_to_probe(session, timeout)
        if not isinstance(answer, Error):
            break
    if connection.state in (State.GREETED, State.LOCKED):
        return session.banner
    if isinstance(answer, Ok) and connection.awaits_proof:
        connection.prove()
    return answer if connection.state is State.READY else None


def _answer_to_probe(session: Session, timeout: float) -> Event | None:
    """An ``ok`` after a version, an error, or a banner; None for silence and all else."""
    version: Version | None = None
    end = session.now() + timeout
    while session.now() < end:
        for event in session.receive(end - session.now()):
            match event:
                case Version():
                    version = event
                case Ok() if version is not None:
                    release = _RELEASE.match(version.version)
                    session.banner = Banner("Grbl", release[0] if release else version.version)
                    return event
                case Ok() | Alarm():
                    return None
                case Banner() | Error():
                    return event
    return None
