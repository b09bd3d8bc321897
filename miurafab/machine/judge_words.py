"""The judgement of a job's words: what leaves no trace in its program, as ``M3`` without a move.

A first search goes over the whole text, and only the lines that it finds are split into words,
which are read as the firmware reads them: a job may have a million lines.
Facts: gnea/grbl 1.1, doc/markdown/laser_mode.md, serial.c.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from miurafab.errors import GcodeError
from miurafab.findings import Finding
from miurafab.gcode.job import Job, plain_code
from miurafab.gcode.reading import has_laser_mode
from miurafab.gcode.words import whole_and_hundredths
from miurafab.profiles import MachineProfile
from miurafab.units import DECIMAL

# Between the letter and the digits of a word, and behind them, may stand blanks and comments.
_BLANK = r"(?:[ \t/]|\([^)\r\n]*\))*+"
# The words in a line without comments and blanks.
_WORD = re.compile(rf"([A-Z])([-+]?{DECIMAL})(?![\d.])")
_FIRST_WORD = re.compile(rf"(?:N\d+)?{_WORD.pattern}")
_POWER = re.compile(rf"S\+?({DECIMAL})")
_NO_DWELL = re.compile(r"G0*4[PS][+-]?0*\.?0*$")
_LINE_END = re.compile(r"[\r\n]")
_PASSED_ON = re.compile(r"[!?~\x18]|[^\x00-\x7f]")


class _Words:
    """The words of ``letter`` with one of ``numbers``; ``decimals``: with any decimals, too."""

    def __init__(self, letter: str, *numbers: int, decimals: bool = False) -> None:
        self._letter, self._numbers, self._below = letter, numbers, 100 if decimals else 1
        others = "|".join(str(number) for number in range(100) if number not in numbers)
        plain = rf"{_BLANK}0*(?:{others})(?:\.0*)?{_BLANK}(?:[A-Za-z\r\n;]|\Z)"
        # Finds each word of the letter in a text that is not plainly another one.
        self.anywhere = re.compile(rf"[{letter}{letter.lower()}](?!{plain})(?={_BLANK}[-+.\d])")

    def among(self, code: str) -> list[int]:
        """The numbers of those in ``code``, a line without comments and blanks."""
        return [number for word in _WORD.finditer(code) for number in self._read(word)]

    def begin(self, code: str) -> bool:
        """Whether ``code`` begins with one, behind the number of the line."""
        first = _FIRST_WORD.match(code)
        return first is not None and bool(self._read(first))

    def _read(self, word: re.Match[str]) -> tuple[int, ...]:
        if word[1] != self._letter:
            return ()
        whole, hundredths = whole_and_hundredths(word[2])
        return (whole,) if whole in self._numbers and hundredths < self._below else ()


_M3 = _Words("M", 3, decimals=True)
_M4 = _Words("M", 4, decimals=True)
_ARMS = _Words("M", 3, 4, decimals=True)
_SPINDLE = _Words("M", 2, 3, 4, 5, 30, decimals=True)
_PAUSE = _Words("M", 0, 1)
_DWELL = _Words("G", 4)
_MIST = _Words("M", 7)
_AIR = _Words("M", 2, 7, 8, 9, 30)
_RELATIVE = _Words("G", 91)
_OUTPUT = _Words("M", 62, 63, 64, 65)
_OTHER_PLACES = _Words("G", 10, 28, 30, 38, 43, *range(53, 60), 91, 92, decimals=True)


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
        _M3,
        "arms the laser with M3, which keeps the beam on, standing still, if the link to the "
        "machine is lost; use M4, or allow M3 explicitly and stay beside the machine.",
    )
    if not has_laser_mode(machine):
        yield from of_word(
            "m3",
            job,
            _M4,
            "arms the laser with M4, which is as M3 without laser mode: it keeps the beam on, "
            "standing still, if the link to the machine is lost; allow M3 explicitly and stay "
            "beside the machine.",
        )
    elif machine.dialect == "marlin" and _first_line(job, _M3) is None:
        line = line_of_plain_beam(job)
        if line is not None:
            yield at_line(
                "m3",
                job.name,
                line,
                "arms the laser with M4 without I, which is as M3 to Marlin: it puts the beam on "
                "at once, standing still; write M4 I, or allow M3 explicitly and stay beside the "
                "machine.",
            )


def line_of_plain_beam(job: Job) -> int | None:
    """The first line that arms the laser of a Marlin without its inline mode (``M4 I``), if there
    is one: the beam is on from there to ``M5``, whatever moves.
    """
    for match in _ARMS.anywhere.finditer(job.text):
        if _is_plain(_code(_line_at(job.text, match.start()))):
            return _number_at(job.text, match.start())
    return None


def _is_plain(code: str) -> bool:
    return bool(_ARMS.among(code)) and "I" not in code


def armed_at_the_end(job: Job) -> Iterator[Finding]:
    """The last word that arms or disarms decides; M2 and M30 end the program and disarm."""
    word = _last_word(job, _SPINDLE)
    if word in (3, 4):
        sentence = f"{job.name} ends with M{word} in force; end it with M5."
        yield Finding("armed", sentence, job.name)


def leaves_air_on(job: Job) -> bool:
    """Whether the last word that opens or shuts the air opens it; M2 and M30 shut it."""
    return _last_word(job, _AIR) in (7, 8)


def air_after(line: bytes, air: bool) -> bool:
    """Whether the air is open after ``line``, a line as it is sent, if it was ``air`` before."""
    words = _AIR.among(_code(line.decode("ascii")))
    return words[-1] in (7, 8) if words else air


def waits_for_person(line: bytes) -> bool:
    """Whether ``line``, a line as it is sent, is a pause (``M0``, ``M1``) to Marlin."""
    return _PAUSE.begin(_code(line.decode("ascii")))


def characters(job: Job) -> Iterator[Finding]:
    """Bytes in comments that a sender which strips no comments would hand to the controller."""
    match = _PASSED_ON.search(job.text)
    if match is not None:
        yield at_line(
            "characters",
            job.name,
            _number_at(job.text, match.start()),
            f"holds {match[0]!r} in a comment: other senders pass it on, and the controller would "
            "obey it.",
        )


def relative_moves(job: Job) -> Iterator[Finding]:
    """The finding ``relative``."""
    yield from of_word(
        "relative",
        job,
        _RELATIVE,
        "begins relative moves (G91); they are posted where the wire is too slow for absolute "
        "moves.",
    )


def outputs(job: Job) -> Iterator[Finding]:
    """The finding ``outputs``."""
    yield from of_word(
        "outputs",
        job,
        _OUTPUT,
        "switches an output (M62 to M65): if the beam hangs on it, no check here sees that beam.",
    )


def line_of_mist(job: Job) -> int | None:
    """The first line with M7, if there is one."""
    return _first_line(job, _MIST)


def names_other_places(job: Job) -> bool:
    """Whether a word names steps, the machine's own or stored places, or another origin than that
    of the job.
    """
    return _first_line(job, _OTHER_PLACES) is not None


def of_word(code: str, job: Job, words: _Words, says: str) -> Iterator[Finding]:
    number = _first_line(job, words)
    if number is not None:
        yield at_line(code, job.name, number, says)


def _first_line(job: Job, words: _Words) -> int | None:
    """The first line whose code holds one of ``words``."""
    for match in words.anywhere.finditer(job.text):
        if words.among(_code(_line_at(job.text, match.start()))):
            return _number_at(job.text, match.start())
    return None


def _last_word(job: Job, words: _Words) -> int | None:
    """The number of the last of ``words``, if there is one."""
    for match in reversed(list(words.anywhere.finditer(job.text))):
        found = words.among(_code(_line_at(job.text, match.start())))
        if found:
            return found[-1]
    return None


def _line_at(text: str, place: int) -> str:
    """The line of ``text`` that holds the character at ``place``."""
    end = _LINE_END.search(text, place)
    return text[_begin(text, place) : end.start() if end else len(text)]


def _number_at(text: str, place: int) -> int:
    """The number of that line."""
    return Job("", text[: _begin(text, place)]).line_count + 1


def _begin(text: str, place: int) -> int:
    begin = text.rfind("\n", 0, place) + 1
    return max(begin, text.rfind("\r", begin, place) + 1)


def _code(line: str) -> str:
    try:
        return plain_code("", 0, line)
    except GcodeError:  # the finding 'lines' or 'program' says so
        return ""


def dwells_under_m3(job: Job) -> list[tuple[int, float]]:
    """The dwells and pauses while M3, or M4 without ``I``, and a power are in force, by the words
    alone: Marlin without inline mode burns with them at once, whatever the motion mode is.
    """
    if _first_line(job, _M3) is None and line_of_plain_beam(job) is None:
        return []
    armed, power = False, 0.0
    burning = []
    for number, line in enumerate(job.iter_lines(), 1):
        code = _code(line)
        spindle, strength = _SPINDLE.among(code), _POWER.search(code)
        dwells = _DWELL.begin(code) or _PAUSE.begin(code)
        armed = spindle[-1] == 3 or _is_plain(code) if spindle else armed
        power = power if strength is None or dwells else float(strength[1])
        if armed and power > 0 and dwells and not _NO_DWELL.match(code):
            burning.append((number, power))
    return burning
