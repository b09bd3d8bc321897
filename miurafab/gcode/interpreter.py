"""The interpreter: a G-code job becomes the :class:`~miurafab.gcode.program.Program` it runs."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from miurafab.errors import GcodeError
from miurafab.gcode.block_errors import BlockError
from miurafab.gcode.dialect_words import UntoldEffect, adapt, known_elsewhere, require_told
from miurafab.gcode.execution import (
    Dwell,
    Pause,
    Probe,
    ProgramEnd,
    SpindleSync,
    Store,
    StraightMove,
    Synchronize,
    execute,
)
from miurafab.gcode.job import Job, bare_code
from miurafab.gcode.marlin import grbl_words
from miurafab.gcode.parser import ModalState, ReaderRules, parse_block
from miurafab.gcode.program import (
    BEAM_M3,
    BEAM_M4,
    BEAM_OFF,
    DWELL,
    END,
    FEED,
    PAUSE,
    RAPID,
    SYNC,
    Context,
    Program,
    ProgramBuilder,
)
from miurafab.gcode.regular import LEAST_RUN, TextLines, read_lines, regular_moves

_COMMENT = re.compile(r"\s*\(\s*(sheet|patch|operation)\s+([^()]*?)\s*\)\s*")
_NO_LETTERS = str.maketrans("", "", "0123456789.+-")
_CHUNK = 1 << 18  # characters read at once


def parse_program(
    job: Job,
    *,
    laser: bool = True,
    arc_tolerance_mm: float = 0.002,
    inline: bool = False,
    dialect: str = "grbl-1.1",
) -> Program:
    """Read ``job`` as the controller would run it from power-up, at machine position 0.

    ``laser`` is the controller's laser mode ($32): the beam is off in G0, and S may change in
    motion. Arcs become chords within ``arc_tolerance_mm`` of the arc ($12). With ``inline`` the job
    is for Marlin (:mod:`miurafab.gcode.marlin`); ``dialect`` may know more words
    (:mod:`miurafab.gcode.dialect_words`). Raises :class:`~miurafab.errors.GcodeError`,
    naming file and line, for a line that the controller would refuse and for a ``$`` command.
    """
    return _Interpreter(job, ReaderRules(laser, arc_tolerance_mm), inline, dialect).read()


class _Interpreter:
    def __init__(self, job: Job, rules: ReaderRules, inline: bool, dialect: str) -> None:
        self.job = job
        self.rules = rules
        self.inline = inline
        self.dialect = dialect
        self.state = ModalState()
        self.stored: list[Sequence[float]] = [(0.0, 0.0, 0.0)] * 8
        self.at: Sequence[float] = (0.0, 0.0, 0.0)
        self.context = Context()
        self.tables = ProgramBuilder(job.name)

    def read(self) -> Program:
        number = 1
        for text in _chunks(self.job.text):
            lines = read_lines(text)
            first, count = 0, len(lines.regular)
            for begin, stop in _runs(lines):
                self._words(number, text, lines, first, begin)
                first = begin
                while stop - first >= LEAST_RUN and not self._run(lines, first, stop, number):
                    self._words(number, text, lines, first, first + LEAST_RUN)
                    first += LEAST_RUN
                if stop - first >= LEAST_RUN:
                    first = stop
            self._words(number, text, lines, first, count)
            number += count
        return self.tables.program()

    def _words(self, number: int, text: str, lines: TextLines, first: int, stop: int) -> None:
        """Read lines ``first`` to ``stop`` (exclusive) of a chunk that begins with ``number``."""
        bounds = lines.bounds[first : stop + 1].tolist()
        for index, (begin, end) in enumerate(pairwise(bounds), number + first):
            line = text[begin : end - 1]
            code = bare_code(self.job.name, index, line, begun=bool(len(self.tables.sent)))
            if code:
                code = code.upper()
                words = len(code.translate(_NO_LETTERS))
                self.tables.sent.add(index, len(code) + 1, words, code.count("."))
                self._line(index, code.replace("/", ""))
            elif "(" in line:
                self._comment(line)

    def _run(self, lines: TextLines, first: int, stop: int, number: int) -> bool:
        """Read a run of regular lines; False if the state gives them another meaning."""
        if self.inline and not lines.commanded[first:stop].all():
            return False
        run = regular_moves(lines, first, stop, self.state)
        if run is None:
            return False
        spindle, laser = self.state.spindle, self.rules.laser
        numbers = np.arange(number + first, number + stop)
        self.tables.sent.extend(
            numbers, lines.size[first:stop] + 1, lines.words[first:stop], lines.points[first:stop]
        )
        before = np.concatenate([[self.at], run.target[:-1]])
        goes = (run.target != before).any(axis=1)
        power = np.where(run.rapid, 0.0, run.speed) if laser else run.speed
        before_it = len(self.tables.moves) + np.cumsum(goes) - goes
        # In laser mode a new power goes with the motion; under M3 a line without motion stops to
        # set it. Without laser mode each new power waits for the motion to end.
        stops = ~goes & (spindle == BEAM_M3) if laser else run.changes & (spindle != BEAM_OFF)
        if stops.any():
            nothing = np.zeros(int(stops.sum()))
            self.tables.events.extend(
                before_it[stops], nothing, nothing, power[stops], numbers[stops]
            )
        if goes.any():
            count = int(goes.sum())
            self.tables.moves.extend(
                *run.target[goes].T,
                np.where(run.rapid, RAPID, FEED)[goes],
                np.where(run.rapid, 0.0, run.feed)[goes],
                power[goes] if spindle else np.zeros(count),
                np.full(count, spindle),
                numbers[goes],
                np.full(count, self.tables.number_of(self.context)),
            )
        self.at = tuple(run.target[-1].tolist())
        return True

    def _comment(self, line: str) -> None:
        match = _COMMENT.fullmatch(line)
        if match is not None:
            self.context = replace(self.context, **{match[1]: match[2]})

    def _line(self, number: int, code: str) -> None:
        name = self.job.name
        if code.startswith("$"):
            raise GcodeError(
                f"{name}, line {number}: {code!r} is a command to the controller and no part of "
                "a program; remove it."
            )
        if self.inline:
            try:
                code = grbl_words(code)
            except ValueError as error:
                raise GcodeError(f"{name}, line {number}: {error}.") from None
        line = adapt(code, self.dialect)
        try:
            require_told(line.code, self.dialect)
            block = parse_block(line.code, self.state, self.stored.__getitem__, self.rules)
        except UntoldEffect as error:
            raise GcodeError(f"{name}, line {number}: {error}.") from None
        except BlockError as error:
            others = known_elsewhere(code, self.dialect)
            raise GcodeError(
                f"{name}, line {number}: {error} (error:{error.code}){others}."
            ) from None
        if line.waits:
            self._event(SYNC, number)
        for action in execute(block, self.state, self.rules):
            if isinstance(action, StraightMove):
                self._move(action, number)
            elif isinstance(action, Probe):
                self._event(SYNC, number)
                self._move(action.move, number)
                self._event(SYNC, number)
                self.state.position = list(action.move.target)
            elif isinstance(action, Dwell):
                self._event(DWELL, number, seconds=action.seconds)
            elif isinstance(action, Pause):
                self._event(PAUSE, number)
            elif isinstance(action, ProgramEnd):
                self.state.coord_system = list(self.stored[0])
                self._event(END, number, power=0.0)
            elif isinstance(action, SpindleSync):
                still = action.spindle == BEAM_M4 and self.rules.laser
                dark = still or action.spindle == BEAM_OFF
                self._event(SYNC, number, power=0.0 if dark else action.speed)
            elif not isinstance(action, Synchronize):  # a pause or the end follows
                if isinstance(action, Store):
                    self.stored[action.index] = tuple(action.values)
                self._event(SYNC, number)

    def _move(self, move: StraightMove, number: int) -> None:
        target = tuple(move.target)
        start, self.at = self.at, target
        if target == start:
            if self.rules.laser and move.spindle == BEAM_M3:
                self._event(SYNC, number, power=move.speed)
            return
        feed = move.feed
        if move.rapid:
            feed = 0.0
        elif move.inverse_time:
            feed *= sum((b - a) ** 2 for a, b in zip(start, target, strict=True)) ** 0.5
        self.tables.moves.add(
            *target,
            RAPID if move.rapid else FEED,
            feed,
            move.speed if move.spindle else 0.0,
            move.spindle,
            number,
            self.tables.number_of(self.context),
        )

    def _event(
        self, kind: int, number: int, *, seconds: float = 0.0, power: float = np.nan
    ) -> None:
        self.tables.events.add(len(self.tables.moves), kind, seconds, power, number)


def _chunks(text: str) -> Iterator[str]:
    """``text`` in pieces of whole lines; each line ends in one LF."""
    begin = 0
    while begin < len(text):
        end = text.find("\n", begin + _CHUNK) + 1 or len(text)
        piece = text[begin:end]
        if "\r" in piece:
            piece = piece.replace("\r\n", "\n").replace("\r", "\n")
        yield piece if piece.endswith("\n") else piece + "\n"
        begin = end


def _runs(lines: TextLines) -> list[tuple[int, int]]:
    """The (first, stop) of each run of at least ``LEAST_RUN`` regular lines."""
    edges = np.flatnonzero(np.diff(lines.regular, prepend=False, append=False))
    begins, stops = edges[::2], edges[1::2]
    long = stops - begins >= LEAST_RUN
    return list(zip(begins[long].tolist(), stops[long].tolist(), strict=True))
