"""The events of a GRBL controller: one frozen value per line that it sends.

The field names follow GRBL 1.1's interface description (``doc/markdown/interface.md`` of the
firmware). Positions are in the controller's reporting unit (millimetres unless ``$13=1``), feeds in
mm/min, spindle speeds in S words.

:mod:`miurafab.grbl.replies` parses a line to an event; the connection adds the sent line that an
:class:`Ok` or :class:`Error` answers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from miurafab.gcode.job import SendLine


@dataclass(frozen=True, slots=True)
class Event:
    """A line from the controller."""


@dataclass(frozen=True, slots=True)
class Banner(Event):
    """``Grbl 1.1h ['$' for help]``: the controller has just started."""

    firmware: str
    version: str


@dataclass(frozen=True, slots=True)
class Ok(Event):
    """``ok``: the controller took the oldest unanswered ``line``, None if there was none."""

    line: SendLine | None = None


@dataclass(frozen=True, slots=True)
class Error(Event):
    """``error:20``: the controller refused the oldest unanswered ``line`` (None if there was none).

    ``text`` is the text after the colon; ``code`` is None if it holds words (GRBL 0.9).
    """

    code: int | None
    text: str
    line: SendLine | None = None


@dataclass(frozen=True, slots=True)
class Alarm(Event):
    """``ALARM:1``: the controller stopped and does nothing until it is reset or unlocked."""

    code: int | None
    text: str


@dataclass(frozen=True, slots=True)
class StatusReport(Event):
    """``<Idle|MPos:0.000,0.000,0.000|FS:0,0>``; a field that is missing in the report is None.

    ``substate`` is the digit of ``Hold:0`` and ``Door:1``; ``planner_free`` and ``rx_free`` are
    the two numbers of ``Bf``; ``overrides`` are feed, rapid and spindle in percent; ``pins`` and
    ``accessories`` are the letters of ``Pn`` and ``A``.
    """

    state: str
    substate: int | None = None
    machine_position: tuple[float, ...] | None = None
    work_position: tuple[float, ...] | None = None
    work_offset: tuple[float, ...] | None = None
    planner_free: int | None = None
    rx_free: int | None = None
    line_number: int | None = None
    feed: float | None = None
    speed: float | None = None
    pins: str | None = None
    overrides: tuple[int, ...] | None = None
    accessories: str | None = None

    def scaled(self, factor: float) -> StatusReport:
        """The same with its positions times ``factor``."""

        def times(position: tuple[float, ...] | None) -> tuple[float, ...] | None:
            return None if position is None else tuple(factor * value for value in position)

        return replace(
            self,
            machine_position=times(self.machine_position),
            work_position=times(self.work_position),
            work_offset=times(self.work_offset),
        )

    @property
    def beam_on(self) -> bool:
        """Whether the report says that the beam is on: S is above 0 or a spindle is on."""
        spindle_on = self.accessories is not None and bool(set("SC") & set(self.accessories))
        return spindle_on or (self.speed is not None and self.speed > 0)

    @property
    def beam_off(self) -> bool:
        """Whether the report says that the beam is off.

        Without S (``F:`` alone: no variable spindle, GRBL 0.9) this and ``beam_on`` are False.
        """
        return self.speed is not None and not self.beam_on


@dataclass(frozen=True, slots=True)
class Setting(Event):
    """``$110=6000.000``, one line of ``$$``; ``text`` is the value as written."""

    number: int
    text: str


@dataclass(frozen=True, slots=True)
class Feedback(Event):
    """``[MSG:Caution: Unlocked]``: a message."""

    text: str


@dataclass(frozen=True, slots=True)
class Version(Event):
    """``[VER:1.1h.20190830:]``: the version and the owner's text (``$I=``)."""

    version: str
    text: str


@dataclass(frozen=True, slots=True)
class Options(Event):
    """``[OPT:V,15,128]``: compiled options, usable planner blocks and receive bytes; a number that
    the firmware does not report is None.
    """

    flags: str
    planner_blocks: int | None
    rx_bytes: int | None


@dataclass(frozen=True, slots=True)
class Modes(Event):
    """``[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]``: the modes in force, as ``words``."""

    words: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Parameter(Event):
    """``[G54:0.000,0.000,0.000]``, one line of ``$#``: a position, in the reporting unit."""

    name: str
    values: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class StartupBlock(Event):
    """``$N0=G20``: what the controller runs after each reset; ``text`` may be empty."""

    number: int
    text: str


@dataclass(frozen=True, slots=True)
class Unknown(Event):
    """Any other line: noise, or a message that the sender does not need."""

    text: str


@dataclass(frozen=True, slots=True)
class Closed(Event):
    """The connection has ended."""
