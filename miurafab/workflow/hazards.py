"""What a person should know about a G-code program before it runs, each as one sentence.

A program that the controller would refuse is an error and never gets here. These are the things
that it would do without a word: leave the bed, burn in place, stay armed at the end.
Facts: gnea/grbl 1.1, doc/markdown/laser_mode.md, serial.c.
"""

from __future__ import annotations

import re
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from miurafab.gcode.job import Job, bare_code
from miurafab.gcode.program import Program
from miurafab.gcode.reading import has_laser_mode
from miurafab.machine.loose_parts import burnt_on_loose_pieces, says_operations
from miurafab.profiles import MachineProfile

_HALF_MICRON = 5e-4
_REALTIME = re.compile(r"[!?~\x18]|[^\x00-\x7f]")
# The words that arm, disarm, set the power or wait, in a line without comments and blanks.
_BEAM_WORD = re.compile(
    r"M0*(?P<spindle>[345])(?:\.0*)?(?![\d.])|(?P<end>M0*(?:2|30))(?:\.0*)?(?![\d.])"
    r"|S(?P<power>\d+\.?\d*|\.\d+)|(?P<dwell>G0*4)(?:\.0*)?(?![\d.])"
)
_RELATIVE = re.compile(r"[gG][ \t]*91(?![ \t]*[\d.])")
_ARMS_OR_WAITS = re.compile(r"M|G[0 \t]*4")


def hazards(job: Job, program: Program, machine: MachineProfile) -> tuple[str, ...]:
    """The warnings about ``program``, which is ``job`` read back, on ``machine``."""
    found = [
        *_off_the_bed(program, machine),
        *_rates_and_powers(program, machine),
        *_line_lengths(program, machine),
        *_characters(job),
        *_relative(job),
    ]
    if machine.tool.kind == "laser":
        found += _laser_mode(machine)
        found += _beam(job)
        found += _loose(program)
    if not program.beam_on.any():
        found.append("The job burns nothing.")
    return tuple(found)


def _off_the_bed(program: Program, machine: MachineProfile) -> list[str]:
    bed = machine.bed
    corner = np.array([bed.width_mm, bed.height_mm])
    to = program.end[:, :2]
    out = np.asarray(((to < -_HALF_MICRON) | (to > corner + _HALF_MICRON)).any(axis=1))
    if not out.any():
        return []
    x, y = to[np.argmax(out)]
    return [
        f"{_count(out, 'move')} outside the {bed.width_mm:g} x {bed.height_mm:g} mm bed, the first "
        f"in line {_first_line(program, out)} to X {x:.3f} Y {y:.3f}."
    ]


def _rates_and_powers(program: Program, machine: MachineProfile) -> list[str]:
    found = []
    burning = program.beam_on
    too_strong = burning & (program.power > machine.tool.s_max)
    if too_strong.any():
        found.append(
            f"S{program.power[too_strong].max():g} (line {_first_line(program, too_strong)}) is "
            f"above the machine's full power S{machine.tool.s_max}."
        )
    step = np.abs(program.end - program.start)[:, :2]
    length = np.linalg.norm(step, axis=1)
    per_axis = program.feed_mm_min[:, None] * step / np.where(length > 0, length, 1.0)[:, None]
    too_fast = burning & (per_axis > np.array(machine.motion.max_rate_mm_min) + 0.5).any(axis=1)
    if too_fast.any():
        found.append(
            f"F{program.feed_mm_min[too_fast].max():g} (line {_first_line(program, too_fast)}) is "
            "faster than the machine's largest rate, which it will not exceed."
        )
    return found


def _line_lengths(program: Program, machine: MachineProfile) -> list[str]:
    characters = program.line_bytes - 1
    long = characters > machine.controller.line_chars
    if not long.any():
        return []
    return [
        f"Line {program.line_number[np.argmax(long)]} has {characters[np.argmax(long)]} characters "
        f"without comments and blanks, more than the controller's {machine.controller.line_chars}."
    ]


def _characters(job: Job) -> list[str]:
    """Bytes in comments that a sender which strips no comments would hand to the controller."""
    if not _REALTIME.search(job.text):
        return []
    for number, line in enumerate(job.iter_lines(), 1):
        bad = _REALTIME.search(line)
        if bad is not None:
            return [
                f"Line {number} holds {bad[0]!r} in a comment: other senders pass it on, and the "
                "controller would obey it."
            ]
    return []


def _relative(job: Job) -> list[str]:
    """Where moves are relative; a jump over the text, since most jobs have no G91 at all."""
    for match in _RELATIVE.finditer(job.text):
        begin = max(job.text.rfind("\n", 0, match.start()), job.text.rfind("\r", 0, match.start()))
        before = job.text[begin + 1 : match.end()]
        if before.rfind("(") <= before.rfind(")") and ";" not in before:
            number = Job("", job.text[: match.end()]).line_count
            return [
                f"Moves are relative from line {number} on (G91), as they are posted where the "
                "wire is too slow for absolute ones."
            ]
    return []


def _laser_mode(machine: MachineProfile) -> list[str]:
    if has_laser_mode(machine) or machine.dialect == "grbl-0.9":
        return []
    return ["Laser mode is off ($32=0): the beam would burn along every travel."]


def _beam(job: Job) -> list[str]:
    """M3, beams that stand, and a beam left armed, from the words in their order."""
    found = []
    armed, power = "5", 0.0
    constant = dwells = 0
    first_constant = first_dwell = 0
    power_line = ""  # the last that only set a power, looked at where it matters
    for number, line in enumerate(job.iter_lines(), 1):
        code = line.upper()
        if _ARMS_OR_WAITS.search(code) is None:
            if "S" in code:
                power_line = code
            continue
        code = bare_code(job.name, number, power_line) + bare_code(job.name, number, code)
        power_line = ""
        waits = False
        for word in _BEAM_WORD.finditer(code):
            if word["spindle"]:
                armed = word["spindle"]
                if armed == "3":
                    constant += 1
                    first_constant = first_constant or number
            elif word["end"]:
                armed = "5"
            elif word["power"]:
                power = float(word["power"])
            else:
                waits = True
        if waits and armed == "3" and power > 0:
            dwells += 1
            first_dwell = first_dwell or number
    if constant:
        found.append(
            f"M3 (line {first_constant}) keeps the beam burning wherever the job stops; M4 would "
            "go dark."
        )
    if dwells:
        found.append(
            f"The beam burns in place during {dwells} dwell{'s' if dwells > 1 else ''}, the first "
            f"in line {first_dwell}."
        )
    if armed != "5":
        found.append(f"The job ends with M{armed} in force; end it with M5.")
    return found


def _loose(program: Program) -> list[str]:
    """Where no operation is said, a closed stroke may be an outline that cuts its piece loose."""
    if says_operations(program):
        return []  # the check 'islands' knows
    return [
        f"Line {fault.line} burns inside the closed stroke of line {fault.outline_line}; if that "
        "one cuts through, the piece lies loose by then."
        for fault in islice(burnt_on_loose_pieces(program), 1)
    ]


def _count(mask: NDArray[np.bool_], noun: str) -> str:
    count = int(mask.sum())
    return f"{count:,} {noun}{' goes' if count == 1 else 's go'}"


def _first_line(program: Program, mask: NDArray[np.bool_]) -> int:
    return int(program.line[np.argmax(mask)])
