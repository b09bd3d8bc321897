"""A job read back to a :class:`~miurafab.gcode.program.Program`, as the controller would run it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from miurafab.errors import GcodeError
from miurafab.gcode.block_errors import BlockError
from miurafab.gcode.columns import Columns
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
from miurafab.gcode.parser import ModalState, parse_block
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
    Strokes,
    strokes,
)
from miurafab.gcode.regular import LEAST_RUN, TextLines, read_lines, regular_moves

__all__ = ["Context", "Program", "Strokes", "parse_program", "strokes"]

_COMMENT = re.compile(r"\s*\(\s*(sheet|patch|operation)\s+([^()]*?)\s*\)\s*")
_NO_LETTERS = str.maketrans("", "", "0123456789.+-")
_CHUNK = 1 << 18  # characters read at once


@dataclass(frozen=True, slots=True)
class _ReaderRules:
    laser: bool
    arc_tolerance: float
    mist: bool = True
    single_precision: bool = False
    inline: bool = False


def parse_program(
    job: Job, *, laser: bool = True, arc_tolerance_mm: float = 0.002, inline: bool = False
) -> Program:
    """Read ``job`` back as the controller would run it from power-up, at machine position 0.

    ``laser`` is the controller's laser mode ($32), which darkens G0 and lets S change in motion.
    Arcs become chords that stay within ``arc_tolerance_mm`` of the arc ($12). With ``inline`` the
    program is one for Marlin (:mod:`miurafab.gcode.marlin`). Raises
    :class:`~miurafab.errors.GcodeError` naming file and line for what the controller would
    refuse, and for a ``$`` command, which is no part of a program.
    """
    return _Reader(_ReaderRules(laser, arc_tolerance_mm, inline=inline)).read(job)


class _Reader:
    def __init__(self, rules: _ReaderRules) -> None:
        self.rules = rules
        self.state = ModalState()
        self.stored: list[Sequence[float]] = [(0.0, 0.0, 0.0)] * 8
        self.at: Sequence[float] = (0.0, 0.0, 0.0)
        self.contexts: dict[Context, int] = {Context(): 0}
        self.context = Context()
        # x, y, z, motion, feed, power, spindle, line, context
        self.moves = Columns("f8", "f8", "f8", "i1", "f8", "f8", "i1", "i4", "i4")
        # move, kind, seconds, power, line
        self.events = Columns("i8", "i1", "f8", "f8", "i4")
        # number, bytes, words, points
        self.sent = Columns("i4", "i4", "i4", "i4")

    def read(self, job: Job) -> Program:
        number = 1
        for text in _chunks(job.text):
            lines = read_lines(text)
            first, count = 0, len(lines.regular)
            for begin, stop in _runs(lines):
                self._words(job.name, number, text, lines, first, begin)
                first = begin
                while stop - first >= LEAST_RUN and not self._run(lines, first, stop, number):
                    self._words(job.name, number, text, lines, first, first + LEAST_RUN)
                    first += LEAST_RUN
                if stop - first >= LEAST_RUN:
                    first = stop
            self._words(job.name, number, text, lines, first, count)
            number += count
        return self._program(job.name)

    def _words(
        self, name: str, number: int, text: str, lines: TextLines, first: int, stop: int
    ) -> None:
        """Lines ``first`` to before ``stop`` of a chunk that begins with line ``number``."""
        bounds = lines.bounds[first : stop + 1].tolist()
        for index, (begin, end) in enumerate(pairwise(bounds), number + first):
            line = text[begin : end - 1]
            code = bare_code(name, index, line)
            if code:
                code = code.upper()
                words = len(code.translate(_NO_LETTERS))
                self.sent.add(index, len(code) + 1, words, code.count("."))
                self._line(name, index, code.replace("/", ""))
            elif "(" in line:
                self._comment(line)

    def _run(self, lines: TextLines, first: int, stop: int, number: int) -> bool:
        """A run of regular lines at once; False if the state gives them another meaning."""
        if self.rules.inline and not lines.commanded[first:stop].all():
            return False
        run = regular_moves(lines, first, stop, self.state)
        if run is None:
            return False
        spindle, laser = self.state.spindle, self.rules.laser
        numbers = np.arange(number + first, number + stop)
        self.sent.extend(
            numbers, lines.size[first:stop] + 1, lines.words[first:stop], lines.points[first:stop]
        )
        before = np.concatenate([[self.at], run.target[:-1]])
        goes = (run.target != before).any(axis=1)
        power = np.where(run.rapid, 0.0, run.speed) if laser else run.speed
        made = len(self.moves) + np.cumsum(goes) - goes
        # Laser mode takes a new power with the motion, but where there is none to M3; else each
        # new power waits for the motion to end.
        stops = ~goes & (spindle == BEAM_M3) if laser else run.changes & (spindle != BEAM_OFF)
        if stops.any():
            nothing = np.zeros(int(stops.sum()))
            self.events.extend(made[stops], nothing, nothing, power[stops], numbers[stops])
        if goes.any():
            context = self.contexts.setdefault(self.context, len(self.contexts))
            count = int(goes.sum())
            self.moves.extend(
                *run.target[goes].T,
                np.where(run.rapid, RAPID, FEED)[goes],
                np.where(run.rapid, 0.0, run.feed)[goes],
                power[goes] if spindle else np.zeros(count),
                np.full(count, spindle),
                numbers[goes],
                np.full(count, context),
            )
        self.at = tuple(run.target[-1].tolist())
        return True

    def _comment(self, line: str) -> None:
        match = _COMMENT.fullmatch(line)
        if match is not None:
            kept = {"sheet": self.context.sheet, "patch": self.context.patch}
            kept["operation"] = self.context.operation
            self.context = Context(**{**kept, match[1]: match[2]})

    def _line(self, name: str, number: int, code: str) -> None:
        if code.startswith("$"):
            raise GcodeError(
                f"{name}, line {number}: {code!r} is a command to the controller and no part of "
                "a program; remove it."
            )
        if self.rules.inline:
            try:
                code = grbl_words(code)
            except ValueError as error:
                raise GcodeError(f"{name}, line {number}: {error}.") from None
        try:
            block = parse_block(code, self.state, self.stored.__getitem__, self.rules)
        except BlockError as error:
            raise GcodeError(f"{name}, line {number}: {error} (error:{error.code}).") from None
        for action in execute(block, self.state, self.rules):
            if isinstance(action, StraightMove):
                self._move(action, number)
            elif isinstance(action, Probe):
                self._event(SYNC, number)
                self._move(action.line, number)
                self._event(SYNC, number)
                self.state.position = list(action.line.target)
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

    def _move(self, line: StraightMove, number: int) -> None:
        target = tuple(line.target)
        start, self.at = self.at, target
        if target == start:
            if self.rules.laser and line.spindle == BEAM_M3:
                self._event(SYNC, number, power=line.speed)
            return
        feed = line.feed
        if line.rapid:
            feed = 0.0
        elif line.inverse_time:
            feed *= sum((b - a) ** 2 for a, b in zip(start, target, strict=True)) ** 0.5
        context = self.contexts.setdefault(self.context, len(self.contexts))
        self.moves.add(
            *target,
            RAPID if line.rapid else FEED,
            feed,
            line.speed if line.spindle else 0.0,
            line.spindle,
            number,
            context,
        )

    def _event(
        self, kind: int, number: int, *, seconds: float = 0.0, power: float = np.nan
    ) -> None:
        self.events.add(len(self.moves), kind, seconds, power, number)

    def _program(self, name: str) -> Program:
        moves, events, sent = self.moves, self.events, self.sent
        places = np.zeros((len(moves) + 1, 3))
        for axis in range(3):
            places[1:, axis] = moves.take(axis)
        return Program(
            name=name,
            start=places[:-1],
            end=places[1:],
            motion=moves.take(3),
            feed_mm_min=moves.take(4),
            power=moves.take(5),
            spindle=moves.take(6),
            line=moves.take(7),
            context=moves.take(8),
            contexts=tuple(self.contexts),
            event_move=events.take(0),
            event_kind=events.take(1),
            event_seconds=events.take(2),
            event_power=events.take(3),
            event_line=events.take(4),
            line_number=sent.take(0),
            line_bytes=sent.take(1),
            line_words=sent.take(2),
            line_points=sent.take(3),
        )


def _chunks(text: str) -> Iterator[str]:
    """``text`` in pieces of whole lines, each line ended by one LF."""
    begin = 0
    while begin < len(text):
        end = text.find("\n", begin + _CHUNK) + 1 or len(text)
        piece = text[begin:end]
        if "\r" in piece:
            piece = piece.replace("\r\n", "\n").replace("\r", "\n")
        yield piece if piece.endswith("\n") else piece + "\n"
        begin = end


def _runs(lines: TextLines) -> list[tuple[int, int]]:
    """Where runs of regular lines worth an array begin and stop."""
    edges = np.flatnonzero(np.diff(lines.regular, prepend=False, append=False))
    begins, stops = edges[::2], edges[1::2]
    long = stops - begins >= LEAST_RUN
    return list(zip(begins[long].tolist(), stops[long].tolist(), strict=True))
