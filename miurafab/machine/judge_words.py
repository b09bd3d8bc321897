"""The judgement of a job's words: what leaves no trace in its program, as ``M3`` without a move.

A first search goes over the whole text, and only the lines that it finds are split into words:
a job may have a million lines.
Facts: gnea/grbl 1.1, doc/markdown/laser_mode.md, serial.c.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from miurafab.errors import GcodeError
from miurafab.findings import Finding
from miurafab.gcode.dialect_words import OUTPUT
from miurafab.gcode.job import Job, plain_code
from miurafab.gcode.reading import has_laser_mode
from miurafab.profiles import MachineProfile
from miurafab.units import DECIMAL

# Between the letter and the digits of a word may stand blanks, a sign, zeros and comments.
_GAP = r"(?:[ \t/+0]|\([^)\r\n]*\))*"
_M3_ANYWHERE = re.compile(rf"[mM]{_GAP}3")
_M4_ANYWHERE = re.compile(rf"[mM]{_GAP}4")
_SPINDLE_ANYWHERE = re.compile(rf"[mM]{_GAP}[2345]")
# The words in a line without comments and blanks.
_M3 = re.compile(r"M\+?0*3(?:\.\d*)?(?![\d.])")
_M4 = re.compile(r"M\+?0*4(?:\.\d*)?(?![\d.])")
_SPINDLE = re.compile(r"M\+?0*(30?|2|4|5)(?:\.\d*)?(?![\d.])")
_POWER = re.compile(rf"S({DECIMAL})")
_PAUSE = re.compile(r"(?:N\d+)?M\+?0*[01](?:\.0*)?(?![\d.])")
_DWELL = re.compile(rf"G\+?0*4(?:\.0*)?(?![\d.])|{_PAUSE.pattern}")
_MIST_ANYWHERE = re.compile(rf"[mM]{_GAP}7")
_MIST = re.compile(r"M\+?0*7(?:\.0*)?(?![\d.])")
_AIR_ANYWHERE = re.compile(rf"[mM]{_GAP}[23789]")
_AIR = re.compile(r"M\+?0*(30|2|7|8|9)(?:\.0*)?(?![\d.])")
_NO_DWELL = re.compile(r"G0*4[PS][+-]?0*\.?0*$")
_RELATIVE_ANYWHERE = re.compile(rf"[gG]{_GAP}91")
_OUTPUT_ANYWHERE = re.compile(rf"[mM]{_GAP}6")
_RELATIVE = re.compile(r"G\+?0*91(?![\d.])")
_PASSED_ON = re.compile(r"[!?~\x18]|[^\x00-\x7f]")


def in_line(name: str, line: int, count: int = 1) -> str:
    """``edge.nc, line 5``; of several such lines or moves, the first."""
    return f"{name}, line {line}" + (f" (the first of {count:,})" if count > 1 else "")


def at_line(code: str, name: str, line: int, says: str, count: int = 1) -> Finding:
    return Finding(code, f"{in_line(name, line, count)} {says}", f"{name}:{line}")


def constant_beam(job: Job, machine: MachineProfile) -> Iterator[Finding]:
    """The finding ``m3``."""
    if machine.tool.kind != "laser":
        return
    yield from of_word(
        "m3",
        job,
        (_M3_ANYWHERE, _M3),
        "arms the laser with M3, which keeps the beam on, standing still, if the link to the "
        "machine is lost; use M4, or allow M3 explicitly and stay beside the machine.",
    )
    if not has_laser_mode(machine):
        yield from of_word(
            "m3",
            job,
            (_M4_ANYWHERE, _M4),
            "arms the laser with M4, which is as M3 without laser mode: it keeps the beam on, "
            "standing still, if the link to the machine is lost; allow M3 explicitly and stay "
            "beside the machine.",
        )


def armed_at_the_end(job: Job) -> Iterator[Finding]:
    """The last word that arms or disarms decides; M2 and M30 end the program and disarm."""
    word = _last_word(job, _SPINDLE_ANYWHERE, _SPINDLE)
    if word in ("3", "4"):
        sentence = f"{job.name} ends with M{word} in force; end it with M5."
        yield Finding("armed", sentence, job.name)


def leaves_air_on(job: Job) -> bool:
    """Whether the last word that opens or shuts the air opens it; M2 and M30 shut it."""
    return _last_word(job, _AIR_ANYWHERE, _AIR) in ("7", "8")


def air_after(line: bytes, air: bool) -> bool:
    """Whether the air is open after ``line``, a line as it is sent, if it was ``air`` before."""
    words = _AIR.findall(line.decode("ascii"))
    return words[-1] in ("7", "8") if words else air


def waits_for_person(line: bytes) -> bool:
    """Whether ``line``, a line as it is sent, is a pause (``M0``, ``M1``) to Marlin."""
    return _PAUSE.match(_code(line.decode("ascii"))) is not None


def characters(job: Job) -> Iterator[Finding]:
    """Bytes in comments that a sender which strips no comments would hand to the controller."""
    match = _PASSED_ON.search(job.text)
    if match is not None:
        number, _ = _line_at(job.text, match.start())
        yield at_line(
            "characters",
            job.name,
            number,
            f"holds {match[0]!r} in a comment: other senders pass it on, and the controller would "
            "obey it.",
        )


def relative_moves(job: Job) -> Iterator[Finding]:
    """The finding ``relative``."""
    yield from of_word(
        "relative",
        job,
        (_RELATIVE_ANYWHERE, _RELATIVE),
        "begins relative moves (G91); they are posted where the wire is too slow for absolute "
        "moves.",
    )


def outputs(job: Job) -> Iterator[Finding]:
    """The finding ``outputs``."""
    yield from of_word(
        "outputs",
        job,
        (_OUTPUT_ANYWHERE, OUTPUT),
        "switches an output (M62 to M65): if the beam hangs on it, no check here sees that beam.",
    )


def line_of_mist(job: Job) -> int | None:
    """The first line with M7, if there is one."""
    return _first_line(job, _MIST_ANYWHERE, _MIST)


def of_word(
    code: str, job: Job, word: tuple[re.Pattern[str], re.Pattern[str]], says: str
) -> Iterator[Finding]:
    number = _first_line(job, *word)
    if number is not None:
        yield at_line(code, job.name, number, says)


def _first_line(job: Job, anywhere: re.Pattern[str], word: re.Pattern[str]) -> int | None:
    """The first line whose code holds ``word``; matches of ``anywhere`` are where to look."""
    for match in anywhere.finditer(job.text):
        number, line = _line_at(job.text, match.start())
        if word.search(_code(line)):
            return number
    return None


def _last_word(job: Job, anywhere: re.Pattern[str], word: re.Pattern[str]) -> str:
    """What the last ``word`` holds, empty if there is none; see :func:`_first_line`."""
    for match in reversed(list(anywhere.finditer(job.text))):
        words = word.findall(_code(_line_at(job.text, match.start())[1]))
        if words:
            return str(words[-1])
    return ""


def _line_at(text: str, place: int) -> tuple[int, str]:
    """The line of ``text`` that holds the character at ``place``, and its number."""
    begin = max(text.rfind("\n", 0, place), text.rfind("\r", 0, place)) + 1
    ends = [end for end in (text.find("\n", place), text.find("\r", place)) if end >= 0]
    return Job("", text[:begin]).line_count + 1, text[begin : min(ends, default=len(text))]


def _code(line: str) -> str:
    try:
        return plain_code("", 0, line)
    except GcodeError:  # the finding 'lines' or 'program' says so
        return ""


def dwells_under_m3(job: Job) -> list[tuple[int, float]]:
    """The dwells and pauses while M3 and a power are in force, by the words alone: Marlin without
    inline mode (``M3`` without ``I``) burns with them at once, whatever the motion mode is.
    """
    if _M3_ANYWHERE.search(job.text) is None:
        return []
    armed, power = False, 0.0
    burning = []
    for number, line in enumerate(job.iter_lines(), 1):
        code = _code(line)
        spindle, strength = _SPINDLE.search(code), _POWER.search(code)
        armed = armed if spindle is None else spindle[1] == "3"
        power = power if strength is None or _DWELL.match(code) else float(strength[1])
        if armed and power > 0 and _DWELL.match(code) and not _NO_DWELL.match(code):
            burning.append((number, power))
    return burning
