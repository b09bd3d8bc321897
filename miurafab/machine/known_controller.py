"""What is known of a controller: asked once, and asked again only where it may have changed.

After the greeting a controller is asked for its build (``$I``), settings (``$$``), offsets
(``$#``), modes (``$G``) and startup blocks (``$N``). Each answer holds until something is sent that
may change it: a reset ends the modes and the G92 offset, a line of a person or a job may change
either, a written setting changes the settings. What status reports tell (state, position,
overrides) is the conversation's. Both together are the :class:`MachineState`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from miurafab.errors import InputError
from miurafab.findings import Finding
from miurafab.gcode.dialect_words import FLUIDNC
from miurafab.gcode.job import SendLine
from miurafab.grbl.events import Event, Modes, Options, Parameter, StartupBlock, Version
from miurafab.grbl.lines import writes_setting
from miurafab.grbl.settings import Settings
from miurafab.grbl.states import State
from miurafab.machine.keys import OVERRIDES_OFF, obeys_overrides
from miurafab.machine.modes import SET, TOOL_LENGTH, ControllerModes
from miurafab.machine.progress import AS_WRITTEN, Overrides
from miurafab.machine.session import HOMING_S, Session
from miurafab.profiles import MachineProfile
from miurafab.profiles.machine import WAIT_S

BUILD, SETTINGS, OFFSETS, MODES, STARTUP = "$I", "$$", "$#", "$G", "$N"
_QUESTIONS = (BUILD, SETTINGS, OFFSETS, MODES, STARTUP)
_ANSWERS_IN = ("Idle", "Alarm")
"""The states in which GRBL answers its questions; ``error:8`` in the others (``system.c``)."""
_REPORTS = 20
"""Of as many reports at rest one tells the overrides and the work offset (``config.h``: 10)."""
_MOST_ON_A_NETWORK = 256
"""Bytes: two lines of a raster at least; a reset behind 1,023 bytes was unheeded for 2.2 s by
grblHAL's own simulator."""
_ONLY_JOBS = ("marlin", "hpgl")


@dataclass(frozen=True)
class Burnt:
    """The job that has burnt on a sheet: its ``name`` and the ``sha256`` of its file."""

    name: str
    sha256: str

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class MachineState:
    """A controller at one moment; what it has not told is None or empty.

    ``state`` is the word of its status report with the substate, as ``Hold:0``. Positions are in
    mm: ``position`` in work coordinates, ``machine_position`` in the machine's own, ``work_offset``
    between them, ``shift`` the part of that which G92 set. ``beam_on`` and ``beam_off`` are both
    False for a controller that does not report its beam (GRBL 0.9). ``loaded`` is what has burnt on
    the sheet in the machine, None if the sheet is fresh.
    """

    port: str
    firmware: str
    state: str
    position: tuple[float, ...] | None
    machine_position: tuple[float, ...] | None
    work_offset: tuple[float, ...] | None
    shift: tuple[float, ...]
    modes: tuple[str, ...]
    overrides: Overrides = AS_WRITTEN
    beam_on: bool = False
    beam_off: bool = False
    pins: str = ""
    loaded: Burnt | None = None
    settings: Settings = field(default=Settings({}), repr=False)

    @property
    def idle(self) -> bool:
        """Whether the machine can take an order: at rest, not locked."""
        return self.state == "Idle"

    @property
    def moves(self) -> bool:
        """Whether the axes may move by themselves."""
        return self.state.partition(":")[0] in ("Run", "Jog", "Home")


@dataclass(frozen=True)
class PortSetup:
    """What is known of the other end of a port before it is opened."""

    dialect: str = "grbl-1.1"
    rx_bytes: int = 128
    wait: float = WAIT_S

    @classmethod
    def of(cls, machine: MachineProfile) -> PortSetup:
        """That of ``machine``."""
        controller = machine.controller
        return cls(machine.dialect, controller.rx_bytes, controller.wait)

    def most_in_flight(self, port: str) -> int:
        """The most bytes that may be under way to ``port`` at a time."""
        return min(self.rx_bytes, _MOST_ON_A_NETWORK) if "://" in port else self.rx_bytes


STOCK = PortSetup()
"""Of a controller of which nothing is known."""


class KnownController:
    """What is known of the controller at the other end of ``session``; mutable, for one thread.

    ``greeted``: one that is asked for jobs alone has answered an earlier job.
    """

    def __init__(self, session: Session, dialect: str) -> None:
        self.version: Version | None = None
        self.options: Options | None = None
        self.settings = Settings({})
        self.modes = ControllerModes((), {})
        self.loaded: Burnt | None = None
        self.greeted = False
        self._session = session
        self._dialect = dialect
        session.runs_at_start = runs_unseen(dialect)
        self._offsets: Mapping[str, tuple[float, ...]] = {}
        self._unknown = set(_QUESTIONS)
        self._opened = self._set = self._told = self._astray = False
        self._starts = 0

    def open(self, patience: float, *, reset: bool = False) -> None:
        """Greet the controller and ask it everything, the first time."""
        if not self._opened:
            self._session.greet(patience, reset=reset)
            self._starts = self._session.starts
            self._session.restarted_itself = False
            self._opened = True
            self._learn_overrides()
            self.refresh()
        else:
            self.refresh()

    def _learn_overrides(self) -> None:
        """Ask until a report tells the overrides: a board that was not reset may have some."""
        if obeys_overrides(self._dialect):
            for _ in range(_REPORTS):
                if self._session.overrides_told:
                    return
                self._session.wait_status()

    @property
    def opened(self) -> bool:
        """Whether it was greeted."""
        return self._opened

    @property
    def rapid_mm_min(self) -> float | None:
        """The rate that both axes reach (``$110``, ``$111``), if it was told."""
        values = self.settings.values
        return min(values[110], values[111]) if {110, 111} <= values.keys() else None

    def refresh(self, *questions: str) -> None:
        """Ask what is not known (of ``questions``, else of everything), if it answers now.

        A controller that restarted by itself may hold half a line; only a reset settles that.
        """
        session = self._session
        self.note_restart()
        if self._astray and session.connection.state is State.UNSYNCED:
            session.stop()
            self.note_restart()
        self._astray = False
        wanted = [each for each in questions or _QUESTIONS if each in self._unknown]
        status = session.status
        if not wanted or status is None or status.state not in _ANSWERS_IN:
            return
        for question in wanted:
            if not session.connection.may_send(SendLine(0, question.encode("ascii"))):
                return
            self._learn(question, session.ask(question))
            self._unknown.discard(question)  # not where the answer was lost
        if session.work_offset is None:  # a board that was not reset tells it late
            session.work_offset = self._offset_in_force()
        if session.runs_at_start:
            session.wait_status()  # a block or a macro may have lit the beam since

    def _offset_in_force(self) -> tuple[float, ...] | None:
        """What it adds to work coordinates now, by the last answers; None: it does not say."""
        own = next((self._offsets[w] for w in self.modes.modes if w in self._offsets), None)
        if own is None:
            return None
        shift = self._offsets.get("G92", (0.0,) * 9)
        tool = (0.0, 0.0, *self._offsets.get("TLO", (0.0,)))
        return tuple(a + b + c for a, b, c in zip(own, shift, tool, strict=False))

    def _learn(self, question: str, said: list[Event]) -> None:
        if question == BUILD:
            self.version = next((each for each in said if isinstance(each, Version)), None)
            self.options = next((each for each in said if isinstance(each, Options)), None)
        elif question == SETTINGS:
            self.settings = Settings.from_events(said)
        elif question == OFFSETS:
            scale = self._session.mm_per_unit
            self._offsets = {
                each.name: tuple(scale * value for value in each.values)
                for each in said
                if isinstance(each, Parameter)
            }
        elif question == MODES:
            words = next((each.words for each in said if isinstance(each, Modes)), ())
            if any(self._offsets.get("TLO", ())) and TOOL_LENGTH not in words:
                words = (*words, TOOL_LENGTH)  # GRBL 1.1 tells it by its length alone
            self.modes = ControllerModes(words, self.modes.startup)
        else:
            blocks = {each.number: each.text for each in said if isinstance(each, StartupBlock)}
            self.modes = ControllerModes(self.modes.modes, blocks)
            self._session.runs_at_start = runs_unseen(self._dialect) or any(blocks.values())

    # What may have changed

    def note_restart(self) -> None:
        """Take note of a reset since the last look: it ends the modes and the G92 offset."""
        if self._starts != self._session.starts:
            self._starts = self._session.starts
            self._set = self._told = False
            self._astray = True
            self._unknown |= {OFFSETS, MODES}

    def may_differ(self, text: str = "") -> None:
        """Something was sent that may change modes and offsets: a job, or a person's ``text``."""
        self._set = False
        self._unknown |= {OFFSETS, MODES}
        if writes_setting(text.encode("ascii")):
            self._unknown |= {SETTINGS, STARTUP, BUILD}

    def unlock(self) -> None:
        """Unlock it, and wait for the end of what it may run behind that, which may change modes
        and offsets; a beam that this lights goes out at once.
        """
        self._session.command("$X")
        if runs_unseen(self._dialect):
            self.may_differ()
            self._put_out()
            self.refresh()

    def home(self, heed: Callable[[], None] = lambda: None) -> None:
        """See :meth:`Session.home`. The startup blocks and macros that run behind it may change
        modes and offsets; a beam that they light goes out at once.
        """
        try:
            self._session.home(heed)
            self._put_out()
        finally:
            self.may_differ()

    def _put_out(self) -> None:
        if runs_unseen(self._dialect):
            self._session.command(MODES, HOMING_S)  # answered when that is over
        if not self._session.wait_status().beam_off:
            self._session.command("M5")

    # What a job needs

    def clear_overrides(self) -> None:
        """Set feed, rapid rate and power back to what is written, with no beam armed: at rest a
        change of the power would light it.
        """
        if obeys_overrides(self._dialect):
            if self._session.overrides.power != AS_WRITTEN.power and self.state.idle:
                self.disarm()
            for order in OVERRIDES_OFF:
                self._session.write(self._session.connection.send_realtime(order))

    def set_modes(self) -> tuple[Finding, ...]:
        """Set the modes in which a job begins, unless they are set; the finding ``modes`` on what
        the opening or a reset had left.
        """
        self.refresh(OFFSETS, MODES, STARTUP)
        if self._set:
            return ()
        told = MODES not in self._unknown  # not while it moves
        self._session.command(SET + self.modes.way_out * told)
        self._set = told
        self._unknown |= {MODES, OFFSETS} if TOOL_LENGTH in self.modes.modes else {MODES}
        findings = () if self._told else tuple(self.modes.findings())
        self._told = True
        return findings

    def disarm(self) -> None:
        """Disarm the beam, unless the controller says that it is: a jog burns with an armed one as
        a cut does (gnea/grbl 1.1, ``gcode.c``).
        """
        self.refresh(MODES)
        if MODES in self._unknown or "M5" not in self.modes.modes:
            self._session.command("M5")
            self._unknown.add(MODES)

    def set_position(self, x: float, y: float) -> None:
        """State where the head stands in work coordinates (G92), in known modes."""
        self._session.command(f"G92X{x:.3f}Y{y:.3f}")
        self._session.restarted_itself = False
        self._unknown.add(OFFSETS)

    def job_offset(self) -> tuple[float, ...] | None:
        """What it adds to the coordinates of a job in G54, in mm; None: it does not say."""
        self.refresh(OFFSETS)
        if "G54" not in self._offsets:
            return self._session.work_offset
        shift = self._offsets.get("G92", (0.0,) * 9)
        return tuple(own + more for own, more in zip(self._offsets["G54"], shift, strict=False))

    # All together

    @property
    def state(self) -> MachineState:
        """The state as far as it is known now."""
        self.note_restart()
        session, status = self._session, self._session.status
        word = "" if status is None else status.state
        if status is not None and status.substate is not None:
            word += f":{status.substate}"
        if session.connection.state is State.ALARMED and word != "Sleep":
            word = "Alarm"  # after a hard limit it answers no status query until a reset
        return MachineState(
            port=session.name,
            firmware=f"{session.banner.firmware} {session.banner.version}".strip(),
            state=word,
            position=session.position,
            machine_position=session.machine_position,
            work_offset=session.work_offset,
            shift=() if OFFSETS in self._unknown else self._offsets.get("G92", ()),
            modes=() if MODES in self._unknown else self.modes.modes,
            overrides=session.overrides,
            beam_on=status is not None and status.beam_on,
            beam_off=status is not None and status.beam_off,
            pins=(status.pins or "") if status is not None else "",
            loaded=self.loaded,
            settings=self.settings,
        )


def runs_unseen(dialect: str) -> bool:
    """Whether a controller of ``dialect`` may run what ``$N`` does not tell: FluidNC has macros
    ``after_reset``, ``after_homing`` and ``after_unlock``, which run behind the answer and before
    any further line (``Protocol.cpp``, ``Homing.cpp``, ``ProcessSettings.cpp``).
    """
    return dialect == FLUIDNC


def require_talk(dialect: str) -> None:
    """Raise ``InputError`` for a ``dialect`` whose machines only take jobs."""
    if dialect in _ONLY_JOBS:
        raise InputError(
            f"A machine that speaks {dialect} only takes whole jobs; home it and move it at its "
            "panel, and send the job with 'miurafab cut'."
        )
