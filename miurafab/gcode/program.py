"""A job read back to a :class:`~miurafab.gcode.moves.Program`, as the controller would run it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from miurafab.errors import GcodeError
from miurafab.gcode.execution import (
    Dwell,
    Line,
    Pause,
    Probe,
    ProgramEnd,
    SpindleSync,
    Store,
    Synchronize,
    execute,
)
from miurafab.gcode.faults import BlockFault
from miurafab.gcode.job import Job, bare_code
from miurafab.gcode.moves import (
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
from miurafab.gcode.parser import ModalState, parse_block

__all__ = ["Context", "Program", "Strokes", "parse_program", "strokes"]

_COMMENT = re.compile(r"\s*\(\s*(sheet|patch|operation)\s+([^()]*?)\s*\)\s*")
_INLINE = re.compile(r"(M0*[345])I0*(?![\d.])")
_NO_LETTERS = str.maketrans("", "", "0123456789.+-")


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
    program is one for Marlin, whose ``M3 I``, ``M4 I`` and ``M5 I`` do what laser mode does. Raises
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
        self.moves: list[tuple[float, ...]] = []
        self.events: list[tuple[float, ...]] = []
        self.sent: list[tuple[int, ...]] = []

    def read(self, job: Job) -> Program:
        for number, line in enumerate(job.iter_lines(), 1):
            code = bare_code(job.name, number, line)
            if code:
                code = code.upper()
                words = len(code.translate(_NO_LETTERS))
                self.sent.append((number, len(code) + 1, words, code.count(".")))
                self._line(job.name, number, code.replace("/", ""))
            elif "(" in line:
                self._comment(line)
        return self._program(job.name)

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
            code = _INLINE.sub(r"\1", code)
        try:
            block = parse_block(code, self.state, self.stored.__getitem__, self.rules)
        except BlockFault as fault:
            raise GcodeError(f"{name}, line {number}: {fault} (error:{fault.code}).") from None
        for action in execute(block, self.state, self.rules):
            if isinstance(action, Line):
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

    def _move(self, line: Line, number: int) -> None:
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
        self.moves.append(
            (
                *start,
                *target,
                RAPID if line.rapid else FEED,
                feed,
                line.speed if line.spindle else 0.0,
                line.spindle,
                number,
                context,
            )
        )

    def _event(
        self, kind: int, number: int, *, seconds: float = 0.0, power: float = np.nan
    ) -> None:
        self.events.append((len(self.moves), kind, seconds, power, number))

    def _program(self, name: str) -> Program:
        moves = np.array(self.moves, dtype=np.float64).reshape(-1, 12)
        events = np.array(self.events, dtype=np.float64).reshape(-1, 5)
        sent = np.array(self.sent, dtype=np.int64).reshape(-1, 4)
        return Program(
            name=name,
            start=moves[:, 0:3].copy(),
            end=moves[:, 3:6].copy(),
            motion=moves[:, 6].astype(np.int8),
            feed_mm_min=moves[:, 7].copy(),
            power=moves[:, 8].copy(),
            spindle=moves[:, 9].astype(np.int8),
            line=moves[:, 10].astype(np.int64),
            context=moves[:, 11].astype(np.int64),
            contexts=tuple(self.contexts),
            event_move=events[:, 0].astype(np.int64),
            event_kind=events[:, 1].astype(np.int8),
            event_seconds=events[:, 2].copy(),
            event_power=events[:, 3].copy(),
            event_line=events[:, 4].astype(np.int64),
            line_number=sent[:, 0].copy(),
            line_bytes=sent[:, 1].copy(),
            line_words=sent[:, 2].copy(),
            line_points=sent[:, 3].copy(),
        )
