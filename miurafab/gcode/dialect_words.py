"""The words that grblHAL and FluidNC know beyond GRBL 1.1, and what can be told of their effect.

A word whose effect on path, beam and time is known is read: the switching of an output, the return
level of drilling cycles, the optional stop. Any other word of the dialect, a parameter, an
expression or a flow word is refused by name. To read it as if it were nothing would make a wrong
verdict: a beam can hang on an analog output, and ``X#1`` can be anywhere.

Sources: grblHAL/core ``gcode.c`` and ``ngc_flowctrl.c`` (August 2026), bdring/FluidNC
``GCode.cpp`` (August 2026). What a build leaves out, its firmware refuses itself.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

GRBLHAL, FLUIDNC = "grblhal", "fluidnc"
_NAMES = {GRBLHAL: "grblHAL", FLUIDNC: "FluidNC"}
_BOTH = (GRBLHAL, FLUIDNC)

_OUT, _MOVES, _LINES = "leave it out", "write its moves as G0 and G1", "write its lines out"
_EFFECTS: dict[tuple[str, ...], tuple[str, tuple[str, ...], str]] = {
    ("M66",): ("waits for an input", _BOTH, _OUT),
    ("M67", "M68"): (
        "sets an analog output, and a beam may hang on it",
        _BOTH,
        "set the power by S, and outputs by M62 to M65",
    ),
    ("M6", "M61"): ("changes the tool", _BOTH, _OUT),
    ("M56",): ("changes what a hold does", _BOTH, _OUT),
    ("M48", "M49", "M50", "M51", "M53"): ("changes what the overrides do", (GRBLHAL,), _OUT),
    ("M60",): ("waits for a change of the work", (GRBLHAL,), "wait by M0"),
    ("M70", "M71", "M72", "M73"): ("stores or restores the modes", (GRBLHAL,), "set them by words"),
    ("M98", "M99"): ("calls a program or returns from it", (GRBLHAL,), _LINES),
    ("M7.1", "M8.1"): ("switches a coolant off", (FLUIDNC,), "switch it off by M9"),
    ("G5", "G5.1"): ("draws a spline", (GRBLHAL,), "draw the curve by G1, G2 or G3"),
    ("G33", "G33.1", "G76", "G95", "G96"): (
        "moves by the turns of a spindle",
        (GRBLHAL,),
        "move by G1 in G94",
    ),
    ("G73", "G81", "G82", "G83", "G84", "G85", "G86", "G89"): (
        "makes the moves of a drilling cycle",
        (GRBLHAL,),
        _MOVES,
    ),
    ("G43", "G43.2"): ("takes the length of a tool from a table", (GRBLHAL,), _OUT),
    ("G50", "G51"): ("scales the coordinates", (GRBLHAL,), "write them scaled"),
    ("G59.1", "G59.2", "G59.3"): (
        "chooses a work offset that is kept in the controller",
        _BOTH,
        "choose one by G54 to G59",
    ),
    ("G64",): ("rounds the corners of the path", (GRBLHAL,), _OUT),
    ("G65", "G66", "G66.1", "G67"): ("calls a macro", (GRBLHAL,), _LINES),
    ("G92.2", "G92.3"): ("drops or restores the shift of G92", (GRBLHAL,), "set it by G92"),
}
_OF_WORD = {word: effect for words, effect in _EFFECTS.items() for word in words}
_EVALUATED = ("is evaluated by the controller alone", _BOTH)
_TOKEN = re.compile(
    r"([GM])\+?0*(\d+)(?:\.(\d*?)0*)?(?![\d.])|#(?:<[^>]*>|\d*)|\[|O(?:\d+|<[^>]*>)"
)

OUTPUT = re.compile(r"M\+?0*6([2-5])(?:\.0*)?(?![\d.])")
"""A word that switches a digital output: M62 and M63 in step with the motion, M64, M65 at once."""
_PORT = re.compile(r"P\+?\d+(?:\.0*)?(?![\d.])")
_CLAIMS_P = re.compile(r"G\+?0*(?:4|10)(?![\d.])")
_RETURN_LEVEL = re.compile(r"G\+?9[89](?:\.0*)?(?![\d.])")
_OPTIONAL_STOP = re.compile(r"M\+?0*1(?:\.0*)?(?![\d.])")


class UntoldEffect(Exception):
    """The dialect knows a word, but its effect on path, beam and time cannot be told."""


@dataclass(frozen=True, slots=True)
class AdaptedLine:
    """A line in the words of GRBL 1.1: its ``code``, whether it ``switches`` an output, and whether
    the motion ``waits`` for that.
    """

    code: str
    switches: bool = False
    waits: bool = False


def adapt(code: str, dialect: str) -> AdaptedLine:
    """``code``, bare upper-case words of ``dialect``, in the words of GRBL 1.1."""
    if dialect not in _NAMES:
        return AdaptedLine(code)
    if dialect == GRBLHAL:
        code = _OPTIONAL_STOP.sub("M0", _RETURN_LEVEL.sub("", code))
    outputs = OUTPUT.findall(code)
    if len(outputs) != 1 or len(_PORT.findall(code)) != 1 or _CLAIMS_P.search(code):
        return AdaptedLine(code)
    # FluidNC waits for the motion to end; grblHAL switches beside the motion.
    waits = dialect == FLUIDNC and outputs[0] in "23"
    return AdaptedLine(_PORT.sub("", OUTPUT.sub("", code)), switches=True, waits=waits)


def require_told(code: str, dialect: str) -> None:
    """Raise :class:`UntoldEffect` if a word of ``code``, already adapted, is one of the dialect's
    whose effect cannot be told.
    """
    if dialect not in _NAMES:
        return
    for word, what, dialects, instead in _special(code):
        if dialect in dialects:
            raise UntoldEffect(
                f"on {_NAMES[dialect]} {word} {what}; the effect on path, beam and time cannot be "
                f"told here, so {instead}, or let the controller itself read it (`check_mode`)"
            )
    if OUTPUT.search(code):
        raise UntoldEffect("M62 to M65 take one P word and stand beside no other P, G4 or G10")


def known_elsewhere(code: str, dialect: str) -> str:
    """The dialects that know a word of ``code``, none of whose words is one of ``dialect`` that
    :func:`require_told` refuses, and what to write for this one, as a clause.
    """
    special = _special(code)
    if special:
        word, _, dialects, instead = special[0]
        others = [_NAMES[each] for each in dialects]
        return f"; {' and '.join(others)} know{'s' * (len(others) == 1)} {word}; here, {instead}"
    output = OUTPUT.search(code)
    if dialect not in _NAMES and output:
        return f"; grblHAL and FluidNC know {output[0]}; here, {_OUT}"
    return ""


def _special(code: str) -> list[tuple[str, str, tuple[str, ...], str]]:
    """The words of ``code`` that only some dialects know: the word, what it does, who knows it, and
    what does the same in words that can be judged.
    """
    found: list[tuple[str, str, tuple[str, ...], str]] = []
    for match in _TOKEN.finditer(code):
        if match[1] is None:
            instead = _LINES if match[0].startswith("O") else "write the number itself"
            found.append((f"'{match[0]}'", *_EVALUATED, instead))
        else:
            word = f"{match[1]}{match[2]}" + (f".{match[3]}" if match[3] else "")
            if word in _OF_WORD:
                found.append((word, *_OF_WORD[word]))
    return found
