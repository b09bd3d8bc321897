"""Beginning a job at a stroke boundary: where it was interrupted, or where a person says.

A job that is resumed leaves no stroke out.

An acknowledged line is planned, not burnt: the controller acknowledges a line when its move is in
the planner. GRBL plans at most 15 moves and holds five segments of the moves before them; where
moves are short, each segment may be the rest of a different move. So, counting lines that move, the
21st line before the last acknowledged line is burnt for certain. A controller that reports in
``$I`` that it plans further ahead is believed. The count is of lines, not of chords: an arc has as
many moves on the controller as its ``$12`` gives it, at least one.

At the other end, the machine may have burnt lines past the last acknowledged line: as many as the
receive buffer holds. If the sender itself died, the journal may be behind, and the machine may have
taken as many more as the wire carries in that time, and no more than it makes then and holds. The
strokes between the two ends may be burnt twice.

The rest of the job keeps the line numbers of the whole. A preamble in place of its first lines
restores the state: a dark move to the start of the stroke, then units, distance mode, plane, feed,
air, beam and motion mode as they were there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from miurafab.errors import GcodeError, InputError, OptionError
from miurafab.findings import Finding
from miurafab.gcode.dialect_words import adapt
from miurafab.gcode.execution import Jog, OffsetsChanged, Probe, Store, execute
from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.job import Job, plain_code
from miurafab.gcode.parser import ModalState, ReaderRules, parse_block
from miurafab.gcode.program import RAPID, Program, Strokes, strokes
from miurafab.gcode.reading import read_program
from miurafab.gcode.words import FLOOD, GO_G28, GO_G30, MIST
from miurafab.geometry.arrays import Ints
from miurafab.machine.journal import JournalRun
from miurafab.profiles import MachineProfile

GRBL_BLOCKS, GRBL_SEGMENTS, OTHER_SEGMENTS = 15, 5, 12
"""The acknowledged moves that GRBL 1.1 holds: planned (``planner.h``: 16 places, one free) and as
segments (``stepper.h``: 6 places, one free). GrblHAL has up to 10 segments,
FluidNC 12 (``segments`` in its ``config.yaml``)."""
JOURNAL_LAG_S = 1.0
"""The largest delay of the journal on the disk when the sender dies: a quarter of a second until
the record, a quarter until the disk, doubled for a slow disk."""

_MOST_OVERRIDE = 2.0
"""GRBL 1.1's largest feed override (``config.h``): a key may have been pressed in that time."""
_REAL_MOVE_MM = 0.05  # a shorter line may round to no step and take no place in the planner
_MOTION_WORDS = {0: "G0", 1: "G1", 2: "G2", 3: "G3"}


@dataclass(frozen=True)
class Resumption:
    """The rest of a job: ``job`` to send, with the line numbers and the ``sha256`` of the whole.

    ``line`` is the first of the whole that is sent again, 1 if all of it is. Of the ``strokes``
    in all, those from ``stroke`` to before ``new_stroke`` (0-based) may be burnt a second time.
    ``chosen``: a person chose the stroke, and those before it are left out.
    """

    job: Job
    sha256: str
    line: int
    stroke: int
    new_stroke: int
    strokes: int
    chosen: bool = False

    @property
    def finding(self) -> Finding:
        """Where the job goes on, and what may be burnt twice or is left out."""
        place = f"{self.job.name}:{self.line}"
        if self.chosen:
            left = f"strokes 1 to {self.stroke} are" if self.stroke > 1 else "stroke 1 is"
            says = f"{self.job.name} begins at stroke {self.stroke + 1} of {self.strokes}"
            return Finding("from-stroke", f"{says} (line {self.line}); {left} left out.", place)
        start = f"{self.job.name} goes on at stroke {self.stroke + 1} of {self.strokes}"
        if self.new_stroke <= self.stroke:
            twice = "no stroke is burnt twice"
        else:
            twice = f"strokes {self.stroke + 1} to {self.new_stroke} may be burnt twice"
        return Finding("resumed", f"{start} (line {self.line}); {twice}.", place)


def resume(job: Job, machine: MachineProfile, runs: Sequence[JournalRun]) -> Resumption:
    """The rest of ``job`` after the last of the ``runs`` in its journal.

    Raises :class:`~miurafab.errors.InputError` when there is nothing to resume: the last run was
    of another text, or was done; and for a job that cannot be taken up in its middle.
    """
    _require_resumable(job, machine, runs[-1])
    program = parse_program(job, dialect=machine.dialect)
    burnt = strokes(program)
    certain, possible = _reach(program, machine, runs)
    first = program.line[burnt.first_move]
    last = program.line[burnt.last_move]
    stroke = int(np.searchsorted(last, certain))
    if stroke == len(burnt):
        raise InputError(
            f"Every stroke of {job.name} was burnt before it was interrupted; nothing is left."
        )
    # Where one operation follows another without a travel, the beam is on at the boundary.
    while program.beam_on[burnt.first_move[stroke] - 1] and stroke > _left_out(runs, last):
        stroke -= 1
    rest, line = _rest(job, _line_of(program, burnt, stroke), machine.dialect)
    if line == 1:
        stroke = 0
    new_stroke = int(np.searchsorted(first, possible, side="right"))
    return Resumption(rest, job.sha256, line, stroke, max(stroke, new_stroke), len(burnt))


def from_stroke(job: Job, machine: MachineProfile, number: int) -> Resumption | None:
    """``job`` from its stroke ``number`` (from 1) on; None for the first, which is all of it.

    Raises :class:`~miurafab.errors.InputError` for a number that it does not have, and for a job or
    a machine that cannot begin there.
    """
    why = _no_modes(machine)
    if why is not None:
        raise InputError(
            f"{machine.name} {why}, so {job.name} cannot begin in its middle; leave `from_stroke` "
            "out."
        )
    program = read_program(job, machine)
    burnt = strokes(program)
    if number > len(burnt):
        raise OptionError("from_stroke", f"is {number}; {job.name} has {len(burnt)} strokes")
    if number == 1:
        return None
    begins = _line_of(program, burnt, number - 1)
    rest, line = _rest(job, begins, machine.dialect)
    if line == 1:
        raise OptionError(
            "from_stroke",
            f"is {number}; stroke {number} of {job.name} begins in line {begins}, before which "
            "there is no room for the lines that prepare it; take a later stroke, or put blank "
            "lines at the top of the file",
        )
    stroke = number - 1
    return Resumption(rest, job.sha256, line, stroke, stroke, len(burnt), chosen=True)


def _left_out(runs: Sequence[JournalRun], last: NDArray[np.int32]) -> int:
    """How many strokes, which end in the lines ``last``, the last cut of the ``runs`` left out."""
    begun = [run.from_line for run in runs if run.chosen or run.from_line <= 1]
    return int(np.searchsorted(last, begun[-1])) if begun else 0


def _line_of(program: Program, burnt: Strokes, stroke: int) -> int:
    """The first line to send for ``stroke``: that after the move before it."""
    move = int(burnt.first_move[stroke])
    return int(program.line[move - 1]) + 1 if move else 1


def _no_modes(machine: MachineProfile) -> str | None:
    """Why the modes in the middle of a job cannot be restored on ``machine``, if so."""
    if machine.dialect in ("marlin", "hpgl"):
        return f"speaks {machine.dialect}"
    if machine.tool.kind != "laser" or machine.dialect == "grbl-0.9":
        return "has no laser mode"
    return None


def _require_resumable(job: Job, machine: MachineProfile, run: JournalRun) -> None:
    if run.sha256 != job.sha256:
        raise InputError(
            f"The journal tells of another text of {run.job} than the one that is there now, so it "
            "cannot be resumed; cut it from the beginning on fresh material."
        )
    if run.ended == "done":
        raise InputError(f"{job.name} was cut to its end; nothing is left to resume.")
    why = {
        "marlin": "loses its place when it is halted",
        "hpgl": "does not tell what it has cut",
    }.get(machine.dialect, _no_modes(machine))
    if why is not None:
        raise InputError(
            f"{machine.name} {why}, so {job.name} cannot be taken up in its middle "
            f"({_how_far(job, machine, run)}); cut it from the beginning on fresh material."
        )


def _how_far(job: Job, machine: MachineProfile, run: JournalRun) -> str:
    """The sentence on the lines that the machine had when ``run`` ended."""
    program = read_program(job, machine)
    all_strokes = strokes(program)
    given = int(np.count_nonzero(program.line[all_strokes.last_move] <= run.line))
    return f"it was given {given} of its {len(all_strokes)} strokes, up to line {run.line}"


def moves_back(machine: MachineProfile, run: JournalRun) -> int:
    """The number of moves to go back from the last acknowledged move: all held, plus one."""
    blocks = max(GRBL_BLOCKS, machine.controller.planner_blocks, run.blocks or 0)
    segments = GRBL_SEGMENTS if machine.dialect == "grbl-1.1" else OTHER_SEGMENTS
    return blocks + segments + 1


def _reach(
    program: Program, machine: MachineProfile, runs: Sequence[JournalRun]
) -> tuple[int, int]:
    """Up to before which line all is done for certain, and the last line that may have been begun.

    Only the last cut from the beginning and what resumed it count: before that was other material.
    """
    moving = np.flatnonzero(np.bincount(program.line, program.lengths) > _REAL_MOVE_MM)
    certain, possible = 1, 0
    for run in runs:
        if run.chosen or run.from_line <= 1:
            certain, possible = run.from_line, 0
        held = moves_back(machine, run)
        behind = int(np.searchsorted(moving, run.line, side="right")) - held
        if behind >= 0:
            certain = max(certain, int(moving[behind]))
        taken = max(run.line, run.from_line - 1)
        at = int(np.searchsorted(program.line_number, taken, side="right"))
        if run.ended is None:
            at = min(_carried(program, machine, at), _begun(program, machine, moving, held, at))
        received = np.cumsum(program.line_bytes[at:]) <= machine.controller.rx_bytes
        at += int(np.count_nonzero(received))
        possible = max(possible, taken, *program.line_number[at - 1 : at].tolist())
    return certain, possible


def _carried(program: Program, machine: MachineProfile, at: int) -> int:
    """Up to before which line sent (by its place) the wire can have carried what the journal does
    not tell, if it tells of the lines before ``at``.
    """
    unseen = JOURNAL_LAG_S * machine.controller.baud / 10
    return at + int(np.count_nonzero(np.cumsum(program.line_bytes[at:]) <= unseen))


def _begun(program: Program, machine: MachineProfile, moving: Ints, held: int, at: int) -> int:
    """... up to before which line the machine can have taken lines in that time: those that it has
    made, each as fast as its feed under the largest override or the axes' rates allow, and as many
    of the ``moving`` lines as it has ``held``.
    """
    step = np.abs(program.end - program.start)
    feed = np.linalg.norm(step, axis=1) / np.maximum(_MOST_OVERRIDE * program.feed_mm_min, 1e-9)
    rapid = (step[:, :2] / np.array(machine.motion.max_rate_mm_min)).max(axis=1)
    seconds = 60 * np.where(program.motion == RAPID, rapid, feed)
    of_line = np.bincount(program.line, seconds, minlength=int(program.line_number[-1]) + 1)
    made = np.cumsum(of_line[program.line_number[at:]]) <= JOURNAL_LAG_S
    at += int(np.count_nonzero(made))
    ahead = np.flatnonzero(np.isin(program.line_number[at:], moving))
    return at + int(ahead[held]) if len(ahead) > held else len(program.line_number)


def _rest(job: Job, line: int, dialect: str) -> tuple[Job, int]:
    """``job`` from ``line`` on behind its preamble, and that line: 1 if it is too early."""
    if line == 1:
        return job, 1
    modes = list(_modes(_state_before(job, line, dialect)))
    if len(modes) >= line:
        return job, 1
    blank = [""] * (line - 1 - len(modes))
    return Job(
        job.name, "\n".join([*modes, *blank, *islice(job.iter_lines(), line - 1, None), ""])
    ), line


def _state_before(job: Job, line: int, dialect: str) -> ModalState:
    """The modes before ``line``; raises ``InputError`` if no preamble can restore them."""
    state, rules = ModalState(), ReaderRules()
    begun = False
    for number, text in zip(range(1, line), job.iter_lines(), strict=False):
        code = plain_code(job.name, number, text, begun=begun)
        if not code:
            continue
        begun, adapted = True, adapt(code, dialect)
        block = parse_block(adapted.code, state, lambda index: (0.0, 0.0, 0.0), rules)
        lost = block.action in (GO_G28, GO_G30) or block.offset or block.inverse_time
        lost = lost or adapted.switches
        for action in execute(block, state, rules):
            lost = lost or isinstance(action, Store | OffsetsChanged | Probe | Jog)
        if lost:
            raise GcodeError(
                f"{job.name}, line {number} ({code}) counts positions anew, measures, switches an "
                "output, or uses inverse time, so the job cannot be taken up in its middle; cut it "
                "from the beginning on fresh material."
            )
    return state


def _modes(state: ModalState) -> Iterator[str]:
    x, y, z = state.position
    yield "G21G90G17G94M5"
    yield f"G0X{x:.4f}Y{y:.4f}"
    if z:
        yield f"G0Z{z:.4f}"
    if state.coolant & FLOOD:
        yield "M8"
    if state.coolant & MIST:
        yield "M7"
    # The motion mode is G0 here, in which laser mode keeps the beam dark whatever S is.
    yield f"M{state.spindle or 5}S{state.speed:g}" + (f"F{state.feed:.4f}" if state.feed else "")
    yield f"G{20 if state.inches else 21}G{91 if state.distance else 90}G{17 + state.plane}"
    yield _MOTION_WORDS[state.motion]  # that of a move, as the line behind a move comes next
