"""A plotter's HPGL file read back to a :class:`~miurafab.gcode.program.Program`.

Read is what a cutter needs of HP-GL: ``IN``, ``PA``, ``PR``, ``PU``, ``PD``, ``SP``, ``VS`` and
``FS``. A plotter unit is 0.025 mm, ``VS`` is in cm/s, and the pen's number says which operation a
stroke belongs to, as in the files written here (HP-GL reference, "plotter units" and "velocity
select"). Anything else is refused by name, since what it draws would be left out of the picture.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from miurafab.errors import GcodeError
from miurafab.gcode.columns import Columns
from miurafab.gcode.job import Job
from miurafab.gcode.program import BEAM_M3, FEED, RAPID, Context, Program
from miurafab.profiles import OPERATIONS

MM_PER_UNIT = 0.025
_MM_MIN_PER_CM_S = 600.0
_SPEED = 40.0  # cm/s, before any VS; that of common cutters
_INSTRUCTION = re.compile(r"\s*([A-Za-z]{2})([-+0-9.,\s]*);?\s*")
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)")


def parse_hpgl(job: Job) -> Program:
    """Read ``job`` back as the plotter would draw it, from the origin, the pen up.

    The power of a move is the force last set by ``FS`` (1 if none was) with the pen down, 0 with
    it up. Raises :class:`~miurafab.errors.GcodeError` naming the line for an instruction that is
    not read, or coordinates that do not come in pairs.
    """
    return _HpglReader(job.name).read(job)


def instructions(name: str, number: int, line: str) -> Iterator[tuple[str, str]]:
    """The instructions of one line of the file ``name``: two letters, and what follows them.

    Raises :class:`~miurafab.errors.GcodeError` for what is none.
    """
    place = 0
    while place < len(line):
        match = _INSTRUCTION.match(line, place)
        if match is None:
            raise GcodeError(
                f"{name}, line {number}: {line[place : place + 12]!r} is not HPGL; preview and cut "
                "HPGL files with an HPGL machine, G-code with another."
            )
        yield match[1].upper(), match[2].strip()
        place = match.end()


class _HpglReader:
    def __init__(self, name: str) -> None:
        self.name = name
        self.at = (0.0, 0.0)
        self.down = self.relative = False
        self.force = 1.0
        self.feed = _SPEED * _MM_MIN_PER_CM_S
        self.contexts: dict[Context, int] = {Context(): 0}
        self.context = 0
        self.moves = Columns("f8", "f8", "i1", "f8", "f8", "i4", "i4")
        self.sent = Columns("i4", "i4")

    def read(self, job: Job) -> Program:
        for number, line in enumerate(job.iter_lines(), 1):
            if line.strip():
                self.sent.add(number, len(line) + 1)
                for name, parameters in instructions(self.name, number, line):
                    self._do(number, name, [*map(float, _NUMBER.findall(parameters))])
        return self._program()

    def _do(self, number: int, name: str, values: list[float]) -> None:
        if name == "IN":
            self.down = self.relative = False
        elif name in ("PA", "PR"):
            self.relative = name == "PR"
            self._go(number, name, values)
        elif name in ("PU", "PD"):
            self.down = name == "PD"
            self._go(number, name, values)
        elif name == "SP":
            pen = int(values[0]) if values else 0
            operation = OPERATIONS[pen - 1] if 1 <= pen <= len(OPERATIONS) else ""
            context = Context(operation=operation)
            self.context = self.contexts.setdefault(context, len(self.contexts))
        elif name == "VS":
            self.feed = (values[0] if values else _SPEED) * _MM_MIN_PER_CM_S
        elif name == "FS":
            self.force = max(1.0, values[0]) if values else 1.0
        else:
            raise GcodeError(
                f"{self.name}, line {number}: {name} is an HPGL instruction that is not read here; "
                "draw with PU and PD alone."
            )

    def _go(self, number: int, name: str, values: list[float]) -> None:
        if len(values) % 2:
            raise GcodeError(
                f"{self.name}, line {number}: {name} has {len(values)} coordinates, which are not "
                "pairs of X and Y."
            )
        for x, y in zip(values[::2], values[1::2], strict=True):
            begin = self.at if self.relative else (0.0, 0.0)
            target = (begin[0] + x * MM_PER_UNIT, begin[1] + y * MM_PER_UNIT)
            if target != self.at:
                motion, feed, power = (
                    (FEED, self.feed, self.force) if self.down else (RAPID, 0.0, 0.0)
                )
                self.moves.add(*target, motion, feed, power, number, self.context)
            self.at = target

    def _program(self) -> Program:
        moves, sent = self.moves, self.sent
        places = np.zeros((len(moves) + 1, 3))
        for axis in range(2):
            places[1:, axis] = moves.take(axis)
        power = moves.take(4)
        number = sent.take(0)
        none = np.zeros(0)
        return Program(
            name=self.name,
            start=places[:-1],
            end=places[1:],
            motion=moves.take(2),
            feed_mm_min=moves.take(3),
            power=power,
            spindle=np.where(power > 0, BEAM_M3, 0).astype(np.int8),
            line=moves.take(5),
            context=moves.take(6),
            contexts=tuple(self.contexts),
            event_move=none.astype(np.int64),
            event_kind=none.astype(np.int8),
            event_seconds=none,
            event_power=none,
            event_line=none.astype(np.int32),
            line_number=number,
            line_bytes=sent.take(1),
            line_words=np.zeros(len(number), dtype=np.int32),
            line_points=np.zeros(len(number), dtype=np.int32),
        )
