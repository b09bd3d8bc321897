"""A person's line that would leave the beam on while the head rests: it has to be sent twice.

Without laser mode (``$32=0``) GRBL sets the beam at ``M3`` and ``M4`` whether anything moves or
not. With it, ``M3`` keeps the beam on at rest in ``G1``, ``G2`` and ``G3``, and ``M4`` never
(gnea/grbl 1.1, ``gcode.c``, ``spindle_control.c``). So after each such line the beam burns one spot
until somebody ends that. Some want it, to focus; nobody wants it by mistake.

A startup block (``$N0=``) runs when it is stored, and after each reset, in the order of the blocks
(``system.c``), which then add up. GRBL reads its number as any other: ``$N00=`` is the same.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterable

from miurafab.errors import GcodeError
from miurafab.gcode.block_errors import BlockError
from miurafab.gcode.job import plain_code
from miurafab.gcode.words import split_words
from miurafab.machine.known_controller import KnownController

_LASER_MODE = 32
_BURNING = (1.0, 2.0, 3.0)
_STARTUP = re.compile(r"\$N[-+]?(\d*)\.?\d*=(.*)")


def resting_power(words: Iterable[tuple[str, float]], *, laser_mode: bool) -> float:
    """The S with which the beam is on at rest after ``words``, letters with numbers, the modes in
    force first; 0 where it is off.

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
    if laser_mode:
        armed = spindle == 3 and motion in _BURNING
    return speed if armed else 0.0


class RestingBeam:
    """Knows which line was held back last, for the controller that is ``known``, and which were
    sent since that told its modes; mutable.
    """

    def __init__(self, known: KnownController) -> None:
        self._known = known
        self._held = ""
        self._since: list[str] = []

    def sure_of(self, line: str) -> str:
        """``line`` as it is to be sent. Raises :class:`~miurafab.errors.GcodeError` for one that
        would put the resting beam on, or its power up, unless it is the same as the last.
        """
        held, self._held = self._held, ""
        read = plain_code("", 0, line)
        block = _STARTUP.fullmatch(read)
        if block is None and read.startswith("$"):
            return line
        if line != held:
            number, text = (None, read) if block is None else block.groups()
            self._refuse(line, text, number)
        self._since.append(read)  # a startup block was run before it is answered
        return line

    def _refuse(self, line: str, text: str, number: str | None) -> None:
        """Hold ``line`` back if its ``text`` would light the resting beam, or, as the startup block
        of ``number`` among the others, each start would.
        """
        state = self._known.state
        if state.modes:
            self._since.clear()  # else the controller does not tell them while it moves
        laser_mode = bool(self._known.settings.values.get(_LASER_MODE))
        before = [
            word for mode in (*self._known.modes.modes, *self._since) for word in _words(mode)
        ]
        now = 0.0 if state.beam_off else resting_power(before, laser_mode=laser_mode)
        power = resting_power([*before, *_words(text)], laser_mode=laser_mode)
        later = 0.0
        if number is not None:
            blocks = {**self._known.modes.startup, int(number or 0): text}
            start = [word for block in blocks.values() for word in _words(block)]
            later = resting_power(start, laser_mode=laser_mode)
        if power <= now and later == 0.0:
            return
        self._held = line
        then, power = ("", power) if power > now else (" and the next reset", later)
        end = "M5, and again after each reset" if later else "M5 or a reset"
        raise GcodeError(
            f"After {line}{then} the beam would be on, with S{power:g}, while the head rests "
            f"(${_LASER_MODE}={laser_mode:d}): it burns one spot until {end}. Send the same line "
            "again if you want that."
        )


def _words(text: str) -> list[tuple[str, float]]:
    found = []
    with contextlib.suppress(BlockError):  # the controller refuses the whole line
        for letter, number in split_words(text):
            found.append((letter, float(number)))
    return found
