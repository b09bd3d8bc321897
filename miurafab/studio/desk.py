"""The machine side of the studio: one session at most, one page that controls it, one job on it.

A page may die, be loaded anew or be one of several; the session stays. One page controls, by a key
that it got when it connected or took over; the others watch, and any may abort. A start needs two
requests: the first states what will burn and gets a code, the second repeats the code. Whatever is
asked in between disarms, as does a change of who controls.
"""

from __future__ import annotations

import secrets
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from miurafab.errors import InputError
from miurafab.machine.known_controller import MachineState, require_talk
from miurafab.machine.owner import owner_of
from miurafab.machine.sleeping import slept_s
from miurafab.machine.transport import VIRTUAL, require_port
from miurafab.profiles import MachineProfile, load_machine
from miurafab.profiles.own import own_defaults
from miurafab.studio.desk_view import (
    burn_table,
    progress_table,
    settings_table,
    sheet_drawing,
    state_table,
)
from miurafab.studio.guard import same_key
from miurafab.studio.held_session import HeldSession
from miurafab.studio.machine_words import (
    LAPSED,
    NO_CONTROL,
    NO_PORT,
    NO_SESSION,
    NOT_ARMED,
    ONE_SESSION,
    OWN_PORT,
    PRACTICE,
    alarm_of,
    held_words,
    plain,
    port_words,
    spelled,
    state_words,
)
from miurafab.workflow.at_machine import Operator
from miurafab.workflow.cut import Prepared, prepare
from miurafab.workflow.ports import serial_ports

PRACTICE_SPEED = 1.0
"""The practice machine keeps real time."""
_ARMED_S = 60.0
_MOST_LINES = 400


class ArmedSheet(NamedTuple):
    """The first step of a start: its ``code``, ``until`` when it holds (monotonic clock), the
    ``facts`` that a person read, and the number of ``resets`` up to then.
    """

    code: str
    until: float
    facts: list[list[str]]
    resets: int


class Desk:
    """The session and who controls it. Every method may be called in any thread.

    ``speed`` is that of the practice machine; ``asleep`` tells how long the computer has slept.
    """

    def __init__(
        self, *, speed: float = PRACTICE_SPEED, asleep: Callable[[], float] = slept_s
    ) -> None:
        self._speed, self._asleep = speed, asleep
        self._lock = threading.Lock()
        self._session: HeldSession | None = None
        self._control: str | None = None
        self._taken = 0
        self._armed: ArmedSheet | None = None
        self._lines: deque[tuple[int, str]] = deque(maxlen=_MOST_LINES)
        self._count = 0
        self._alarm: int | None = None
        self._ended = ""
        self._seen: dict[str, Any] = {}
        self._settings: tuple[object, dict[str, Any]] = (None, {})
        self._prepared: Prepared | None = None
        self._reading: dict[str, Any] | None = None
        self._jobs = 0  # put on up to now: a page draws a new one anew

    # Beginning and end

    @staticmethod
    def ports() -> list[dict[str, str]]:
        """The ports to choose from: those of this computer, the person's own, and the practice
        machine; who holds one, and why it cannot be used.
        """
        found = {
            each.device: each.trouble or port_words(each.description) for each in serial_ports()
        }
        own = own_defaults().port
        if own is not None and own != VIRTUAL:
            found.setdefault(own, OWN_PORT)
        listed = [
            {"name": name, "text": text, "held": _holder(name)} for name, text in found.items()
        ]
        return [*listed, {"name": VIRTUAL, "text": PRACTICE, "held": ""}]

    def connect(self, port: str, machine: str) -> str:
        """Open a session with ``machine`` at ``port``; the key that controls it.

        Raises :class:`~miurafab.errors.InputError` for a port that is not listed, for a machine
        that only takes jobs, and while there is a session; ``PortError`` for a port that is gone.
        """
        if port not in [each["name"] for each in self.ports()]:
            raise InputError(NO_PORT)
        require_port(port)
        profile = load_machine(machine)
        require_talk(profile.dialect)
        with self._lock:
            if self._session is not None:
                raise InputError(ONE_SESSION)
            self._lines.clear()
            self._seen, self._prepared, self._alarm, self._ended = {}, None, None, ""
            self._session = HeldSession(
                profile,
                port,
                on_look=self._look,
                on_end=self._end,
                speed=self._speed if port == VIRTUAL else None,
                asleep=self._asleep,
            )
            return self._take()

    def leave(self) -> None:
        """End the session, dark, and wait for its end."""
        session = self._session
        if session is not None:
            session.leave()

    def _end(self, how: str) -> None:
        with self._lock:
            self._session, self._control, self._armed = None, None, None
            self._ended = plain(how)
            self._say(self._ended)

    # Who controls

    def take_over(self) -> str:
        """Control from now on; the key for it."""
        with self._lock:
            self._require_session()
            return self._take()

    def _take(self) -> str:
        self._control = secrets.token_urlsafe(12)
        self._taken += 1
        self._armed = None
        return self._control

    def require_control(self, key: str) -> None:
        """Raise :class:`~miurafab.errors.InputError` for a page that only watches."""
        self._require_session()
        if self._control is None or not same_key(key, self._control):
            raise InputError(NO_CONTROL)

    def _require_not_taken(self, taken: int) -> None:
        """Raise ``InputError`` if control was taken since it had been so often."""
        if taken != self._taken:
            raise InputError(NO_CONTROL)

    def _require_session(self) -> HeldSession:
        if self._session is None:
            raise InputError(NO_SESSION)
        return self._session

    # What is asked

    def abort(self) -> None:
        """Reset the controller now; anybody may."""
        self._armed = None
        session = self._session
        if session is not None:
            session.abort()

    def do(self, work: Callable[[Operator], None]) -> None:
        """Have an action carried out; it disarms. Raises what the operator raises."""
        self._armed = None
        self._require_session().ask(work)

    def put_on(self, job: Path, name: str) -> None:
        """Take the job of a directory or of a G-code file, to frame and to cut.

        Raises :class:`~miurafab.errors.InputError` for one that cannot be read or cut, and where
        somebody else has taken over meanwhile.
        """
        taken, session = self._taken, self._require_session()
        self._armed = None
        try:
            prepared = self._read(job, session.machine)
        finally:
            self._reading = None
        prepared = replace(prepared, name=name)

        def work(operator: Operator) -> None:
            with self._lock:
                self._require_not_taken(taken)
                operator.put_on(prepared)
                self._prepared = prepared
                self._jobs += 1

        session.ask(work)  # not another, which was opened while a large job was read

    def _read(self, job: Path, machine: MachineProfile) -> Prepared:
        """The job for ``machine``; how far it has come is told by :meth:`state`."""

        def tell(share: float, note: str) -> None:
            self._reading = {"share": round(share, 3), "words": note}

        tell(0.0, f"reading {job.name}")
        if not job.is_dir():  # it is timed once
            return prepare(job, machine=machine, on_progress=tell)
        prepared = prepare(job, on_progress=tell)
        if prepared.machine != machine:
            tell(1.0, f"timing it on {machine.title}")
            prepared = prepare(job, machine=machine)
        return prepared

    def arm(self) -> None:
        """The first step of a start; raises :class:`~miurafab.errors.InputError` where somebody
        else has taken over meanwhile.
        """
        self._armed = None

        def work(operator: Operator) -> list[list[str]]:
            operator.arm()
            return burn_table(operator)

        taken, session = self._taken, self._require_session()
        resets = session.process.resets
        facts = session.ask(work, resets)
        with self._lock:
            self._require_not_taken(taken)
            until = time.monotonic() + _ARMED_S
            self._armed = ArmedSheet(secrets.token_urlsafe(12), until, facts, resets)

    def start(self, code: str) -> None:
        """The second step, with the code of the first."""
        armed, self._armed = self._armed, None
        if armed is None or not same_key(code, armed.code):
            raise InputError(NOT_ARMED)
        if time.monotonic() > armed.until:
            raise InputError(LAPSED)
        self._require_session().ask(lambda operator: operator.start(), armed.resets)

    # What is seen

    def drawing(self, number: int) -> dict[str, Any]:
        """The strokes of sheet ``number``, for the page to draw."""
        prepared = self._prepared
        if prepared is None or not 1 <= number <= len(prepared.dry_runs):
            raise InputError("There is no such sheet.")
        return sheet_drawing(prepared.dry_runs[number - 1])

    def state(self, after: int = 0) -> dict[str, Any]:
        """All that the page shows, with the lines after the ``after``-th."""
        with self._lock:
            session, armed = self._session, self._armed
            lines = [text for number, text in self._lines if number > after]
            shown: dict[str, Any] = {
                "open": session is not None,
                "ended": self._ended,
                "taken": self._taken,
                "said": lines,
                "count": self._count,
                "armed": None,
            }
            seen = self._seen
        if session is None:
            return shown | {"ports": self.ports()}
        if armed is not None and time.monotonic() <= armed.until:
            shown["armed"] = {"code": armed.code, "facts": armed.facts}
        silent = time.monotonic() - session.process.heard
        busy = seen.get("busy", "open")
        words = state_words(
            seen.get("state", ""),
            silent_s=silent,
            alarm=self._alarm,
            homes=seen.get("homes", False),
            waits=seen.get("waits", ""),
            homing=busy == "home",
            material_wanted="" if busy else seen.get("material_wanted", ""),
        )
        job = self._prepared
        return (
            shown
            | seen
            | {
                "port": session.port,
                "machine": session.machine.title,
                "practice": session.port == VIRTUAL,
                "words": {"title": words.title, "advice": words.advice, "look": words.look},
                "silent_s": round(silent, 1),
                "trouble": plain(session.trouble),
                "busy": busy,
                "reading": self._reading,
                "job": None
                if job is None
                else {"name": job.name, "folder": str(job.folder), "number": self._jobs},
            }
        )

    def _look(self, operator: Operator) -> None:
        """Called by the session's thread: note what there is to see."""
        state, session = operator.state, self._session
        with self._lock:
            while operator.said:
                text = operator.said.popleft()
                self._alarm = alarm_of(text) or self._alarm
                self._say(spelled(text))
            if state is not None and state.state and state.state != "Alarm" and not operator.busy:
                self._alarm = None
            if not operator.armed:
                self._armed = None
            seen = progress_table(operator)
            if state is not None and session is not None:
                seen |= state_table(state) | {"settings": self._differences(session, state)}
            self._seen = seen

    def _differences(self, session: HeldSession, state: MachineState) -> dict[str, Any]:
        told = session.machine, state.settings  # each state brings a copy
        if self._settings[0] != told:
            self._settings = told, settings_table(*told)
        return self._settings[1]

    def _say(self, text: str) -> None:
        if text:
            self._count += 1
            self._lines.append((self._count, text))


def _holder(port: str) -> str:
    owner = owner_of(port)
    return "" if owner is None else held_words(owner)
