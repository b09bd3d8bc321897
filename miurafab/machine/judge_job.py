"""The judgement of a job: everything that speaks against starting it, without any machine.

``preview``, the dry run and the pre-flight of ``cut`` and the page of a job all show what
:func:`judge_job` finds, so that the verdict and the words are the same everywhere. Nothing here
reads a file or opens a port.

A rule about moves reads the :class:`~miurafab.gcode.program.Program`; a rule about words that leave
no trace in it (``M3`` without a move, a comment) reads the text.
Facts: gnea/grbl 1.1, doc/markdown/laser_mode.md, serial.c.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np

from miurafab.errors import GcodeError
from miurafab.findings import Finding
from miurafab.gcode.job import Job, bare_code
from miurafab.gcode.program import BEAM_M3, DWELL, PAUSE, Program
from miurafab.gcode.reading import has_laser_mode, read_program
from miurafab.geometry.arrays import Bools
from miurafab.machine.loose_parts import burnt_on_loose_pieces, open_outlines, says_operations
from miurafab.machine.room import TOLERANCE_MM, first_outside, z_extent
from miurafab.marlin.connection import FRAME
from miurafab.profiles import MachineProfile

_FEED_TOLERANCE = 0.5  # mm/min, for the rounding of a feed that is a whole number
_POWER_TOLERANCE = 0.5  # S words, for the rounding of max_power times full power

# Between the letter and the digits of a word may stand blanks, a sign, zeros and comments.
_GAP = r"(?:[ \t/+0]|\([^)\r\n]*\))*"
_M3_ANYWHERE = re.compile(rf"[mM]{_GAP}3")
_SPINDLE_ANYWHERE = re.compile(rf"[mM]{_GAP}[2345]")
# The words in a line without comments and blanks.
_M3 = re.compile(r"M\+?0*3(?:\.\d*)?(?![\d.])")
_SPINDLE = re.compile(r"M\+?0*(30?|2|4|5)(?:\.\d*)?(?![\d.])")
_POWER = re.compile(r"S(\d+\.?\d*|\.\d+)")
_DWELL = re.compile(r"G0*4(?![\d.])")
_MIST_ANYWHERE = re.compile(rf"[mM]{_GAP}7")
_MIST = re.compile(r"M\+?0*7(?:\.0*)?(?![\d.])")
_AIR_ANYWHERE = re.compile(rf"[mM]{_GAP}[23789]")
_AIR = re.compile(r"M\+?0*(30|2|7|8|9)(?:\.0*)?(?![\d.])")
_NO_DWELL = re.compile(r"G0*4[PS][+-]?0*\.?0*$")
_RELATIVE_ANYWHERE = re.compile(rf"[gG]{_GAP}91")
_RELATIVE = re.compile(r"G\+?0*91(?![\d.])")
_PASSED_ON = re.compile(r"[!?~\x18]|[^\x00-\x7f]")


@dataclass(frozen=True, eq=False)
class JudgedJob:
    """A job that was read: its number of ``lines``, its ``program`` (None if the controller would
    refuse it) and its ``findings``.
    """

    lines: int
    program: Program | None
    findings: tuple[Finding, ...]


def judge_job(job: Job, machine: MachineProfile, *, most_power: float = 1.0) -> JudgedJob:
    """Read ``job`` and judge it; a program that the controller would refuse is a finding.

    ``most_power`` is the most that the material takes, as a fraction of full power.
    """
    try:
        program = read_program(job, machine)
    except GcodeError as fault:
        return _unreadable(job, machine, fault)
    findings = tuple(judge_program(job, program, machine, most_power=most_power))
    return JudgedJob(len(program.line_number), program, findings)


def _unreadable(job: Job, machine: MachineProfile, fault: GcodeError) -> JudgedJob:
    findings = [*_constant_beam(job, machine), Finding("program", fault.sentence, job.name)]
    count = 0
    try:
        for _ in job.send_lines(longest_line(machine)):
            count += 1
    except GcodeError as unsendable:
        findings.insert(0, Finding("lines", unsendable.sentence, job.name))
    return JudgedJob(count, None, tuple(findings))


def judge_program(
    job: Job, program: Program, machine: MachineProfile, *, most_power: float = 1.0
) -> Iterator[Finding]:
    """All findings on ``program``, which is ``job`` as ``machine`` would run it."""
    laser, full = machine.tool.kind == "laser", machine.tool.s_max
    yield from _long_lines(program, machine)
    yield from _constant_beam(job, machine)
    yield from _off_the_bed(program, machine)
    if laser:
        yield from _loose_parts(program)
        yield from _dwells(job, program, machine)
        if most_power < 1.0:
            limit = most_power * full
            words = f"S{limit:.0f} that the material takes (its max_power)"
            yield from _power("material", program, limit + _POWER_TOLERANCE, words)
    yield from _power("power", program, full, f"{full} that is full power on {machine.name}")
    if laser:
        yield from _no_laser_mode(machine)
        yield from _armed_at_the_end(job)
    if machine.dialect != "hpgl" and leaves_air_on(job):
        yield Finding("air", f"{job.name} ends with the air on; M9 is sent after it.", job.name)
    yield from _rates(program, machine)
    yield from _characters(job)
    if not program.beam_on.any():
        yield Finding("nothing-burnt", f"{job.name} burns nothing.", job.name)
    yield from _relative_moves(job)
    pauses = program.event_line[program.event_kind == PAUSE]
    if len(pauses):
        yield _in_line(
            "pauses",
            program.name,
            int(pauses[0]),
            "waits for a person (M0); the key r goes on.",
            len(pauses),
        )


def longest_line(machine: MachineProfile) -> int:
    """How many characters of code a line may have, besides the frame that the dialect adds."""
    return machine.controller.line_chars - (FRAME if machine.dialect == "marlin" else 0)


def in_line(name: str, line: int, count: int = 1) -> str:
    """``edge.nc, line 5``; of several such lines or moves, the first."""
    return f"{name}, line {line}" + (f" (the first of {count:,})" if count > 1 else "")


def _in_line(code: str, name: str, line: int, says: str, count: int = 1) -> Finding:
    return Finding(code, f"{in_line(name, line, count)} {says}", f"{name}:{line}")


def _in_moves(code: str, program: Program, mask: Bools, says: str) -> Finding:
    line = int(program.line[np.argmax(mask)])
    return _in_line(code, program.name, line, says, int(mask.sum()))


def coordinate(value: float) -> str:
    """A coordinate with as many decimals as it takes to tell it from a limit, four at most."""
    text = f"{value:.4f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


# Rules about moves


def _long_lines(program: Program, machine: MachineProfile) -> Iterator[Finding]:
    if machine.dialect == "hpgl":
        return
    limit = longest_line(machine)
    long = np.flatnonzero(program.line_bytes - 1 > limit)
    if len(long):
        line = int(program.line_number[long[0]])
        yield _in_line(
            "lines",
            program.name,
            line,
            f"has {program.line_bytes[long[0]] - 1} characters without comments and blanks, more "
            f"than the controller's {limit}; split the line.",
            len(long),
        )


def _off_the_bed(program: Program, machine: MachineProfile) -> Iterator[Finding]:
    size = np.array([machine.bed.width_mm, machine.bed.height_mm])
    ends = program.end[:, :2]
    outside = first_outside(ends, np.zeros(2), size)
    if outside is not None:
        index, count = outside
        x, y = map(coordinate, ends[index])
        yield _in_line(
            "bounds",
            program.name,
            int(program.line[index]),
            f"moves to X{x} Y{y}, off the bed of {machine.name} ({size[0]:g} x {size[1]:g} mm).",
            count,
        )
    if machine.z is not None and len(program):
        extent, travel = z_extent(program), machine.z.travel_mm
        if extent > travel + TOLERANCE_MM:
            at = int(np.argmax(np.abs(program.end[:, 2] - program.start[0, 2])))
            yield _in_line(
                "bounds",
                program.name,
                int(program.line[at]),
                f"is the farthest of moves over {coordinate(extent)} mm in Z, more than the travel "
                f"of {machine.name} ({travel:g} mm).",
            )


def _power(code: str, program: Program, most: float, words: str) -> Iterator[Finding]:
    """No move has more power than ``most``, which ``words`` name."""
    too_strong = program.power > most
    if too_strong.any():
        asks = f"asks for S{program.power[np.argmax(too_strong)]:g}, more than the {words}."
        yield _in_moves(code, program, too_strong, asks)


def _loose_parts(program: Program) -> Iterator[Finding]:
    """Strokes on pieces that are cut loose, and outlines that do not close: the first of each."""
    for fault in islice(burnt_on_loose_pieces(program), 1):
        code, says = (
            "loose",
            f"closed stroke of line {fault.outline_line}; if that stroke cuts through, the piece "
            "lies loose by then.",
        )
        if says_operations(program):
            code, says = (
                "islands",
                f"outline that is cut through from line {fault.outline_line} on: that piece lies "
                "loose by then and may catch fire; cut outlines last.",
            )
        yield _in_line(code, program.name, fault.line, f"burns inside the {says}")
    for fault in islice(open_outlines(program), 1):
        yield _in_line(
            "outlines",
            program.name,
            fault.line,
            f"ends the outline begun in line {fault.outline_line}, {fault.gap_mm:.2f} mm from "
            "where that began: the piece would hang on by a thread; close it.",
        )


def _dwells(job: Job, program: Program, machine: MachineProfile) -> Iterator[Finding]:
    burning = _burning_dwells(program)
    if machine.dialect == "marlin":
        burning = sorted((dict(_dwells_under_m3(job)) | dict(burning)).items())
    if burning:
        line, power = burning[0]
        yield _in_line(
            "dwell",
            program.name,
            line,
            f"waits with the beam on at S{power:g}, which burns a hole or starts a fire; switch it "
            "off (M5) before the G4.",
            len(burning),
        )


def _burning_dwells(program: Program) -> list[tuple[int, float]]:
    """The lines and powers of dwells that burn in place: with the power of the last event, or of
    the last move under M3 if that came later.
    """
    at, power = 0, 0.0
    burning = []
    for move, kind, seconds, new, line in zip(
        program.event_move.tolist(),
        program.event_kind.tolist(),
        program.event_seconds.tolist(),
        program.event_power.tolist(),
        program.event_line.tolist(),
        strict=True,
    ):
        if move > at:
            at = move
            still = program.spindle[move - 1] == BEAM_M3
            power = float(program.power[move - 1]) if still else 0.0
        if new == new:  # NaN: as before
            power = new
        if kind == DWELL and power > 0 and seconds > 0:
            burning.append((line, power))
    return burning


def _dwells_under_m3(job: Job) -> list[tuple[int, float]]:
    """The dwells while M3 and a power are in force, by the words alone: Marlin without inline
    mode (``M3`` without ``I``) burns with them at once, whatever the motion mode is.
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


def _rates(program: Program, machine: MachineProfile) -> Iterator[Finding]:
    step = np.abs(program.end - program.start)[:, :2]
    length = np.linalg.norm(step, axis=1)
    per_axis = program.feed_mm_min[:, None] * step / np.where(length > 0, length, 1.0)[:, None]
    limit = np.array(machine.motion.max_rate_mm_min) + _FEED_TOLERANCE
    too_fast = program.beam_on & (per_axis > limit).any(axis=1)
    if too_fast.any():
        feed = program.feed_mm_min[np.argmax(too_fast)]
        says = f"asks for F{feed:g}, above the largest rate of {machine.name}, which will hold."
        yield _in_moves("rate", program, too_fast, says)


# Rules about the profile and the text


def _no_laser_mode(machine: MachineProfile) -> Iterator[Finding]:
    if not has_laser_mode(machine) and machine.dialect != "grbl-0.9":
        yield Finding(
            "laser-mode",
            f"Laser mode is off on {machine.name} ($32=0): the beam would burn along every travel; "
            "set $32=1.",
            machine.name,
        )


def _constant_beam(job: Job, machine: MachineProfile) -> Iterator[Finding]:
    if machine.tool.kind != "laser":
        return
    number = _first_line(job, _M3_ANYWHERE, _M3)
    if number is not None:
        yield _in_line(
            "m3",
            job.name,
            number,
            "arms the laser with M3, which keeps the beam on, standing still, if the link to the "
            "machine is lost; use M4, or allow M3 explicitly and stay beside the machine.",
        )


def _armed_at_the_end(job: Job) -> Iterator[Finding]:
    """The last word that arms or disarms decides; M2 and M30 end the program and disarm."""
    for match in reversed(list(_SPINDLE_ANYWHERE.finditer(job.text))):
        words = _SPINDLE.findall(_code(_line_at(job.text, match.start())[1]))
        if words:
            if words[-1] in ("3", "4"):
                sentence = f"{job.name} ends with M{words[-1]} in force; end it with M5."
                yield Finding("armed", sentence, job.name)
            return


def leaves_air_on(job: Job) -> bool:
    """Whether the last word that opens or shuts the air opens it; M2 and M30 shut it."""
    for match in reversed(list(_AIR_ANYWHERE.finditer(job.text))):
        words = _AIR.findall(_code(_line_at(job.text, match.start())[1]))
        if words:
            return words[-1] in ("7", "8")
    return False


def _characters(job: Job) -> Iterator[Finding]:
    """Bytes in comments that a sender which strips no comments would hand to the controller."""
    match = _PASSED_ON.search(job.text)
    if match is not None:
        number, _ = _line_at(job.text, match.start())
        yield _in_line(
            "characters",
            job.name,
            number,
            f"holds {match[0]!r} in a comment: other senders pass it on, and the controller would "
            "obey it.",
        )


def _relative_moves(job: Job) -> Iterator[Finding]:
    number = _first_line(job, _RELATIVE_ANYWHERE, _RELATIVE)
    if number is not None:
        yield _in_line(
            "relative",
            job.name,
            number,
            "begins relative moves (G91); they are posted where the wire is too slow for absolute "
            "moves.",
        )


def line_of_mist(job: Job) -> int | None:
    """The first line with M7, if there is one."""
    return _first_line(job, _MIST_ANYWHERE, _MIST)


def _first_line(job: Job, anywhere: re.Pattern[str], word: re.Pattern[str]) -> int | None:
    """The first line whose code holds ``word``; matches of ``anywhere`` are where to look."""
    for match in anywhere.finditer(job.text):
        number, line = _line_at(job.text, match.start())
        if word.search(_code(line)):
            return number
    return None


def _line_at(text: str, place: int) -> tuple[int, str]:
    """The line of ``text`` that holds the character at ``place``, and its number."""
    begin = max(text.rfind("\n", 0, place), text.rfind("\r", 0, place)) + 1
    ends = [end for end in (text.find("\n", place), text.find("\r", place)) if end >= 0]
    return Job("", text[:begin]).line_count + 1, text[begin : min(ends, default=len(text))]


def _code(line: str) -> str:
    try:
        return bare_code("", 0, line).upper().replace("/", "")
    except GcodeError:  # the finding 'lines' or 'program' says so
        return ""
