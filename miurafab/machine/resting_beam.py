"""A person's line that would leave the beam on while the head rests: it has to be sent twice.

Without laser mode (``$32=0``) GRBL sets the beam at ``M3`` and ``M4`` whether anything moves or
not. With it, ``M3`` keeps the beam on at rest in ``G1``, ``G2`` and ``G3``, and ``M4`` never
(gnea/grbl 1.1, ``gcode.c``, ``spindle_control.c``). So after each such line the beam burns one spot
until somebody ends that. Some want it, to focus; nobody wants it by mistake.

Lines that are no program light it too (``system.c``, ``stepper.c``):

* A startup block (``$N0=``) runs when it is stored, after each reset and after ``$H``, in the order
  of the blocks, which then add up. After a reset they begin in the modes of power-up, after ``$H``
  in those that are in force.
* ``$32=0`` lights nothing at once, but the blocks of the next reset.
* ``$RST=`` ends in a reset, and so does the ``$C`` that ends the check mode. ``$RST=$`` and
  ``$RST=*`` bring back the firmware's own ``$32``, which is 0 in GRBL; ``*`` clears the blocks.
* With ``$31`` not below ``$30`` each S is full power, S0 too, and an armed beam is on in any mode.
  The setting of either puts the beam out (``settings.c``), until the blocks of the next reset.
* A jog moves with the beam that is armed, and leaves it on behind it, unless that is ``M4`` in
  laser mode.

GRBL reads the number of a block or a setting as any other: ``$N00=`` and ``$32.0=`` are the same.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial

from miurafab.errors import GcodeError
from miurafab.gcode.block_errors import BlockError
from miurafab.gcode.job import plain_code
from miurafab.gcode.numbers import read_single, whole_byte
from miurafab.gcode.words import split_words
from miurafab.machine.known_controller import KnownController
from miurafab.units import DECIMAL

_MOST, _LEAST, _LASER_MODE = 30, 31, 32
_BURNING = (1.0, 2.0, 3.0)
_NUMBER = rf"([-+]?{DECIMAL})"
_STARTUP = re.compile(rf"\$N{_NUMBER}=(.*)")
_SETTING = re.compile(rf"\${_NUMBER}={_NUMBER}")
_JOG = "G1"  # as far as the beam goes that a jog leaves on

Words = list[tuple[str, float]]


def resting_power(
    words: Iterable[tuple[str, float]], *, laser_mode: bool, only: float | None = None
) -> float:
    """The S with which the beam is on at rest after ``words``, letters with numbers, the modes in
    force first; 0 where it is off. ``only`` is the S that each S is, if there is no other.

    >>> resting_power([("M", 3), ("S", 1000)], laser_mode=False)
    1000.0
    >>> resting_power([("M", 3), ("S", 1000)], laser_mode=True)
    0.0
    """
    spindle, motion, speed = 5.0, 0.0, 0.0
    for letter, number in words:
        if letter == "M" and number in (2, 3, 4, 5, 30):
            spindle = number
        elif letter == "S":
            speed = float(number)
        elif letter == "G" and (number in (0, *_BURNING, 80) or 38 <= number < 39):
            motion = number
    armed = spindle in (3, 4)
    if armed and only is not None:
        return only
    if laser_mode:
        armed = spindle == 3 and motion in _BURNING
    return speed if armed else 0.0


@dataclass(frozen=True)
class _Lit:
    """The S with which the beam is on at rest ``now`` and after the next reset, ``later``."""

    now: float
    later: float
    laser_mode: bool


class RestingBeam:
    """Knows which line was held back last, for the controller that is ``known``, and which were
    sent since that told its modes; mutable. ``ask`` has it tell what is unknown.
    """

    def __init__(self, known: KnownController, ask: Callable[[], object]) -> None:
        self._known, self._ask = known, ask
        self._held = ""
        self._since: list[str] = []

    def forget(self) -> None:
        """Something else was done: the line that was held back is a new one when it comes again."""
        self._held = ""

    @property
    def full(self) -> bool:
        """Whether the armed beam is on at full power whatever S is: few reports tell that one."""
        values = self._known.settings.values
        return _only(values) is not None and _power(self._before(), values) > 0.0

    def _before(self) -> Words:
        modes = (*self._known.modes.modes, *self._since)
        return [word for mode in modes for word in _words(mode)]

    def sure_of(self, line: str) -> str:
        """``line`` as it is to be sent. Raises :class:`~miurafab.errors.GcodeError` for one that
        would put the resting beam on, or its power up, unless it is the same as the last.
        """
        held, self._held = self._held, ""
        self._ask()
        read = plain_code("", 0, line)
        if line != held:
            self._refuse(line, read)
        block = _STARTUP.fullmatch(read)
        if block is not None or not read.startswith("$"):
            self._since.append(read if block is None else block[2])  # it ran before its answer
        return line

    def _refuse(self, line: str, read: str) -> None:
        """Hold ``line``, read as ``read``, back if it would light the resting beam, now or at each
        start.
        """
        state, known = self._known.state, self._known
        if state.modes:
            self._since.clear()  # else the controller does not tell them while it moves
        values = known.settings.values
        before = self._before()
        burns = 0.0 if state.beam_off else _power(before, values)
        lit = _lit(read, before, known.modes.startup, values, checks=state.state == "Check")
        if lit.now <= burns and lit.later == 0.0:
            return
        self._held = line
        then, power = ("", lit.now) if lit.now > burns else (" and the next reset", lit.later)
        end = "M5, and again after each reset" if lit.later else "M5 or a reset"
        raise GcodeError(
            f"After {line}{then} the beam would be on, with S{power:g}, while the head rests "
            f"(${_LASER_MODE}={lit.laser_mode:d}): it burns one spot until {end}. Send the same "
            "line again if you want that."
        )


def _lit(
    read: str,
    before: Words,
    startup: Mapping[int, str],
    values: Mapping[int, float],
    *,
    checks: bool,
) -> _Lit:
    """What is lit by a line, behind the words ``before`` and with the blocks ``startup`` and the
    settings ``values``; ``checks``: the controller is in check mode.
    """
    laser_mode = bool(values.get(_LASER_MODE))
    power = partial(_power, values=values)

    def start(blocks: Mapping[int, str]) -> Words:
        return [word for number in sorted(blocks) for word in _words(blocks[number])]

    block, setting = _STARTUP.fullmatch(read), _SETTING.fullmatch(read)
    if block is not None:
        blocks = {**startup, whole_byte(read_single(block[1])): block[2]}
        return _Lit(power([*before, *_words(block[2])]), power(start(blocks)), laser_mode)
    if setting is not None:
        number, value = whole_byte(read_single(setting[1])), read_single(setting[2])
        after = {**values, number: value if number != _LASER_MODE else whole_byte(value) != 0}
        was, later = (_power(start(startup), each) for each in (values, after))
        return _Lit(0.0, later if later > was else 0.0, bool(after.get(_LASER_MODE)))
    if read.startswith("$RST=") or (read == "$C" and checks):
        stays = laser_mode and read not in ("$RST=$", "$RST=*")
        at_start = start({} if read == "$RST=*" else startup)
        lit = _power(at_start, {**values, _LASER_MODE: stays})
        return _Lit(lit, lit, stays)
    if read == "$H":
        return _Lit(power([*before, *start(startup)]), 0.0, laser_mode)
    if read.startswith("$J="):
        return _Lit(power([*before, *_words(_JOG)]), 0.0, laser_mode)
    return _Lit(0.0 if read.startswith("$") else power([*before, *_words(read)]), 0.0, laser_mode)


def _power(words: Iterable[tuple[str, float]], values: Mapping[int, float]) -> float:
    """:func:`resting_power` with the settings ``values``."""
    laser_mode = bool(values.get(_LASER_MODE))
    return resting_power(words, laser_mode=laser_mode, only=_only(values))


def _only(values: Mapping[int, float]) -> float | None:
    """The S that each S is with the settings ``values``, if there is no other."""
    least, most = values.get(_LEAST, 0.0), values.get(_MOST)
    return None if most is None or least < most else max(most, 1.0)


def _words(text: str) -> Words:
    found = []
    with contextlib.suppress(BlockError):  # the controller refuses the whole line
        for letter, number in split_words(text):
            found.append((letter, float(number)))
    return found
