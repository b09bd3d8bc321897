"""The judgement of a job: everything that speaks against starting it, without any machine.

``preview``, the dry run and the pre-flight of ``cut`` and the page of a job all show what
:func:`judge_job` finds, so that the verdict and the words are the same everywhere. Nothing here
reads a file or opens a port.

A rule about moves reads the :class:`~miurafab.gcode.program.Program`; the rules about words that
leave no trace in it are in :mod:`~miurafab.machine.judge_words`.
Facts: gnea/grbl 1.1, doc/markdown/laser_mode.md, serial.c.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np

from miurafab.errors import GcodeError
from miurafab.findings import Finding
from miurafab.gcode.job import Job
from miurafab.gcode.program import BEAM_M3, BEAM_M4, BEAM_OFF, PAUSE, RAPID, Program
from miurafab.gcode.reading import has_laser_mode, read_program
from miurafab.geometry.arrays import Bools
from miurafab.machine.judge_words import (
    armed_at_the_end,
    at_line,
    characters,
    constant_beam,
    dwells_under_m3,
    leaves_air_on,
    line_of_plain_beam,
    outputs,
    relative_moves,
)
from miurafab.machine.loose_parts import burnt_on_loose_pieces, open_outlines, says_operations
from miurafab.machine.room import TOLERANCE_MM, first_outside, z_extent
from miurafab.marlin.connection import FRAME
from miurafab.profiles import MachineProfile

_FEED_TOLERANCE = 0.5  # mm/min, for the rounding of a feed that is a whole number
_POWER_TOLERANCE = 0.5  # S words, for the rounding of max_power times full power


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
    findings = [*constant_beam(job, machine), Finding("program", fault.sentence, job.name)]
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
    yield from constant_beam(job, machine)
    yield from _off_the_bed(program, machine)
    if laser:
        yield from _loose_parts(program)
        yield from _dwells(job, program, machine)
        if most_power < 1.0:
            least = machine.tool.s_min
            limit = least + most_power * (full - least)
            words = f"S{limit:.0f} that the material takes (its max_power)"
            yield from _power("material", program, limit + _POWER_TOLERANCE, words)
    yield from _power("power", program, full, f"{full} that is full power on {machine.name}")
    if laser:
        yield from _no_laser_mode(machine)
        yield from _burnt_travels(job, program, machine)
        yield from armed_at_the_end(job)
    if leaves_air_on(job):
        yield Finding("air", f"{job.name} ends with the air on; M9 is sent after it.", job.name)
    yield from _rates(program, machine)
    yield from characters(job)
    if not program.beam_on.any():
        yield Finding("nothing-burnt", f"{job.name} burns nothing.", job.name)
    yield from relative_moves(job)
    yield from outputs(job)
    pauses = program.event_line[program.event_kind == PAUSE]
    if len(pauses):
        yield at_line(
            "pauses",
            program.name,
            int(pauses[0]),
            "waits for a person (M0); the key r goes on.",
            len(pauses),
        )


def longest_line(machine: MachineProfile) -> int:
    """How many characters of code a line may have, besides the frame that the dialect adds."""
    return machine.controller.line_chars - (FRAME if machine.dialect == "marlin" else 0)


def _in_moves(code: str, program: Program, mask: Bools, says: str) -> Finding:
    line = int(program.line[np.argmax(mask)])
    return at_line(code, program.name, line, says, int(mask.sum()))


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
        yield at_line(
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
        yield at_line(
            "bounds",
            program.name,
            int(program.line[index]),
            f"moves to X{x} Y{y}, off the bed of {machine.name} ({size[0]:g} x {size[1]:g} mm).",
            count,
        )
    if machine.z is not None and len(program):
        extent, travel = z_extent(program), machine.z.travel_mm
        if extent > travel + TOLERANCE_MM:
            at = int(np.argmax(np.abs(program.end[:, 2])))  # it begins at 0
            yield at_line(
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
        yield at_line(code, program.name, fault.line, f"burns inside the {says}")
    for fault in islice(open_outlines(program), 1):
        yield at_line(
            "outlines",
            program.name,
            fault.line,
            f"ends the outline begun in line {fault.outline_line}, {fault.gap_mm:.2f} mm from "
            "where that began: the piece would hang on by a thread; close it.",
        )


def _dwells(job: Job, program: Program, machine: MachineProfile) -> Iterator[Finding]:
    marlin, laser_mode = machine.dialect == "marlin", has_laser_mode(machine)
    stays = (BEAM_M3,) if laser_mode else (BEAM_M3, BEAM_M4)
    burning = _burning_dwells(program, stays, pauses=marlin or not laser_mode)
    if marlin:
        burning = sorted((dict(dwells_under_m3(job)) | dict(burning)).items())
    if burning:
        line, power = burning[0]
        yield at_line(
            "dwell",
            program.name,
            line,
            f"waits with the beam on at S{power:g}, which burns a hole or starts a fire; switch it "
            "off (M5) first.",
            len(burning),
        )


def _burning_dwells(
    program: Program, stays: tuple[int, ...], *, pauses: bool
) -> list[tuple[int, float]]:
    """The lines and powers of dwells that burn in place: with the power of the last event, or of
    the last move if that came later, where its spindle is one that ``stays`` on at rest. GRBL holds
    in ``pauses``, which puts the beam out in laser mode alone.
    """
    at, power = 0, 0.0
    burning = []
    columns = (
        program.event_move,
        program.event_seconds,
        program.event_power,
        program.event_line,
        program.event_kind,
    )
    for move, seconds, new, line, kind in zip(*(each.tolist() for each in columns), strict=True):
        if move > at:
            at = move
            still = program.spindle[move - 1] in stays
            power = float(program.power[move - 1]) if still else 0.0
        if new == new:  # NaN: as before
            power = new
        if power > 0 and (seconds > 0 or (pauses and kind == PAUSE)):  # no other event lasts
            burning.append((line, power))
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


def _burnt_travels(job: Job, program: Program, machine: MachineProfile) -> Iterator[Finding]:
    plain = line_of_plain_beam(job) if machine.dialect == "marlin" else None
    if plain is None:
        return
    burnt = (program.motion == RAPID) & (program.spindle != BEAM_OFF) & (program.line > plain)
    if burnt.any():
        says = "travels with the beam on: to Marlin it is on in G0 after M3 or M4 without I."
        yield _in_moves("laser-mode", program, burnt, says)


# A rule about the profile


def _no_laser_mode(machine: MachineProfile) -> Iterator[Finding]:
    if not has_laser_mode(machine) and machine.dialect != "grbl-0.9":
        yield Finding(
            "laser-mode",
            f"Laser mode is off on {machine.name} ($32=0): the beam would burn along every travel; "
            "set $32=1.",
            machine.name,
        )
