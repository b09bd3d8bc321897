"""The modes that a controller is in before a job: asked for, compared, and set.

A program means what it says only in known modes: ``X10`` is 254 mm in inches, and lies elsewhere
with another work offset. A controller need not begin in the modes that GRBL has after power-up. It
runs its startup blocks (``$N0``, ``$N1``) after each reset, and a person may have typed something.
So the sender asks for the modes (``$G``), the offsets (``$#``) and the startup blocks (``$N``), and
sets every mode that a program may leave unsaid (:data:`SET`). A controller that was not reset also
keeps motion mode, feed and power from its last program; those go back to what they are at power-up
(``G0``, ``F0``, ``S0``), so that no line burns that the dry run saw dark.

Sources: gnea/grbl 1.1, ``report.c`` (the answers), ``gcode.c`` (the modal groups); NIST RS274/NGC,
table 4.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from miurafab.findings import Finding

SET = "G21G90G17G94G54"
"""What is sent before anything that needs it: mm, absolute, XY plane, feed per minute, offset 1."""

TOOL_LENGTH = "G43.1"
_MEANS = {
    "G20": "inches",
    "G91": "relative moves",
    "G18": "the XZ plane",
    "G19": "the YZ plane",
    "G93": "inverse time feed",
    "G95": "feed per turn",
    "G51": "scaled coordinates",
    TOOL_LENGTH: "a tool length offset",
    "M3": "the spindle or beam armed",
    "M4": "the spindle or beam armed",
    "M7": "mist on",
    "M8": "air or coolant on",
} | {f"G{n}": f"the work offset G{n}" for n in (55, 56, 57, 58, 59, "59.1", "59.2", "59.3")}
"""The modes that a job does not begin in."""
_BACK = {"G51": "G50", TOOL_LENGTH: "G49", "M3": "M5", "M4": "M5", "M7": "M9", "M8": "M9"}
"""What ends those that :data:`SET` does not end."""
_MOTION = re.compile(r"G(?:[1-3]|5(?:\.\d)?|33|38\.\d|73|8\d(?:\.\d)?)")
_VALUE = re.compile(r"[FS](?!0*\.?0*$).*")


@dataclass(frozen=True)
class ControllerModes:
    """What the controller answered: the words of its ``modes``, none if it did not say, and its
    ``startup`` blocks by number.
    """

    modes: tuple[str, ...]
    startup: Mapping[int, str]

    def findings(self) -> Iterator[Finding]:
        """The finding ``modes``: what a job would have met, and what was set instead."""
        met = ", ".join(f"{word} ({_MEANS[word]})" for word in self.modes if word in _MEANS)
        blocks = " and ".join(f"$N{n}={text}" for n, text in self.startup.items() if text)
        if met and blocks:
            what = f"was in {met} and runs {blocks} after each reset"
        elif met:
            what = f"was in {met}"
        elif blocks:
            what = f"runs {blocks} after each reset"
        else:
            return
        yield Finding(
            "modes",
            f"The controller {what}; {SET}{self.way_out} was sent, so that the job begins in mm, "
            "absolute, with the work offset G54.",
        )

    @property
    def way_out(self) -> str:
        """What ends the modes that :data:`SET` does not end: each that burns or blows, if it did
        not say.
        """
        if not self.modes:
            return "G0M5M9F0S0"
        return "".join(dict.fromkeys(filter(None, map(_back, self.modes))))


def _back(word: str) -> str:
    """What ends the mode or clears the value of ``word``, nothing if that is as at power-up."""
    if _MOTION.fullmatch(word):
        return "G0"
    if _VALUE.fullmatch(word):
        return f"{word[0]}0"
    return _BACK.get(word, "")
