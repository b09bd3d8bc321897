"""The HPGL reader: a plotter's file becomes a :class:`~miurafab.gcode.program.Program`.

It reads the instructions that a cutter needs: ``IN``, ``PA``, ``PR``, ``PU``, ``PD``, ``SP``,
``VS`` and ``FS``. A plotter unit is 0.025 mm and ``VS`` is in cm/s (HP-GL reference, "plotter
units" and "velocity select"). As in the files that miurafab writes, the pen's number names the
operation. Other instructions are refused by name, because the picture would lack what they draw.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from miurafab.errors import GcodeError
from miurafab.gcode.job import Job
from miurafab.gcode.program import BEAM_M3, BEAM_OFF, FEED, RAPID, Context, Program, ProgramBuilder
from miurafab.profiles import OPERATIONS
from miurafab.units import DECIMAL

MM_PER_UNIT = 0.025
_MM_MIN_PER_CM_S = 600.0
_SPEED = 40.0  # cm/s, before any VS; common cutters have it
_INSTRUCTION = re.compile(r"\s*([A-Za-z]{2})([-+0-9.,\s]*);?\s*")
_NUMBER = re.compile(rf"[-+]?{DECIMAL}")


def parse_hpgl(job: Job) -> Program:
    """Read ``job`` as the plotter would draw it, from the origin with the pen up.

    With the pen down the power of a move is the force of the last ``FS`` (1 before any), with the
    pen up 0. Raises :class:`~miurafab.errors.GcodeError`, naming the line, for an unknown
    instruction or an odd number of coordinates.
    """
    return _HpglReader(job.name).read(job)


def instructions(name: str, number: int, line: str) -> Iterator[tuple[str, str]]:
    """Yield the instructions of a line of the file ``name``: two letters and their parameters.

    Raises :class:`~miurafab.errors.GcodeError` for text that is no instruction.
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
        self.context = 0
        self.tables = ProgramBuilder(name)

    def read(self, job: Job) -> Program:
        for number, line in enumerate(job.iter_lines(), 1):
            if line.strip():
                self.tables.sent.add(number, len(line) + 1, 0, 0)
                for name, parameters in instructions(self.name, number, line):
                    self._do(number, name, [*map(float, _NUMBER.findall(parameters))])
        return self.tables.program()

    def _do(self, number: int, name: str, values: list[float]) -> None:
        if not all(map(math.isfinite, values)):
            raise GcodeError(f"{self.name}, line {number}: a number of {name} is too large.")
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
            self.context = self.tables.number_of(Context(operation=operation))
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
                tool = (
                    (FEED, self.feed, self.force, BEAM_M3)
                    if self.down
                    else (RAPID, 0.0, 0.0, BEAM_OFF)
                )
                self.tables.moves.add(*target, 0.0, *tool, number, self.context)
            self.at = target
