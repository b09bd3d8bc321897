"""Marlin's lines translated to GRBL's words.

Marlin reads exactly one command per line: a bare ``X10`` moves nothing. After ``M3 I`` or ``M4 I``
the laser power goes with the moves, as in GRBL's laser mode. ``G4`` waits P milliseconds or S
seconds. (MarlinFirmware/Marlin ``gcode/parser.cpp``, ``control/M3-M5.cpp``, ``motion/G4.cpp``.)
"""

from __future__ import annotations

import re

COMMANDS = frozenset(
    [f"G{number}" for number in (0, 1, 2, 3, 4, 20, 21, 28, 90, 91, 92)]
    + [f"M{number}" for number in (0, 1, 3, 4, 5, 8, 9)],
)
"""The commands that a job for Marlin may hold."""
_COMMAND = re.compile(r"([GM])0*(\d+(?:\.\d*[1-9])?)\.?0*")
_INLINE = re.compile(r"I0*(?![\d.])")
_DWELL = re.compile(r"([PS])([\d.]+)")


def grbl_words(code: str) -> str:
    """``code`` (no blanks, upper case) in GRBL's words.

    Raises :class:`ValueError` with a clause that says why Marlin would not run the line.
    """
    match = _COMMAND.match(code)
    if match is None:
        raise ValueError(f"{code!r} begins with no command, and Marlin repeats none by itself")
    name, rest = match[1] + match[2], code[match.end() :]
    if name not in COMMANDS:
        known = ", ".join(sorted(COMMANDS, key=lambda word: (word[0], int(word[1:]))))
        raise ValueError(
            f"{name} is not a command that a job for Marlin may hold; those are {known}"
        )
    if "G" in rest or "M" in rest:
        raise ValueError(f"{code!r} holds two commands, and Marlin reads one a line")
    if name in ("M3", "M4", "M5"):
        return match[0] + _INLINE.sub("", rest)
    if name == "G4":
        seconds = sum(
            float(value) * (0.001 if letter == "P" else 1.0)
            for letter, value in _DWELL.findall(rest)
        )
        return f"G4P{seconds:.4f}"
    return code
