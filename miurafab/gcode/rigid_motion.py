"""A program that was turned and shifted as a whole: a sheet that lies elsewhere is cut there.

A rigid motion takes p to R p + d, with R = [[c, -s], [s, c]]. Straight moves stay straight, arcs
stay arcs of the same radius and sense, and lengths, feeds and times stay. So each line keeps its
place, its S, its F and its comments; only X, Y, I and J are written anew, to 0.0001 mm, and an arc
given by its radius gets its centre. A relative move is the step from what was written before it,
so that rounding does not add up.

What comes after the last burnt line belongs to the machine and not to the sheet (the way back to
X0 Y0): it stays as it is written.

What has no place on the sheet is refused: inches, other planes, machine coordinates, and commands
that move the origin or measure.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from miurafab.errors import GcodeError
from miurafab.gcode.dialect_words import adapt
from miurafab.gcode.execution import execute
from miurafab.gcode.job import Job, plain_code
from miurafab.gcode.marlin import grbl_words
from miurafab.gcode.parser import Block, ModalState, ReaderRules, parse_block
from miurafab.gcode.program import Program
from miurafab.gcode.words import (
    CLOCKWISE,
    COUNTERCLOCKWISE,
    DWELL,
    PROBES,
    Claim,
    split_words,
)
from miurafab.geometry.arrays import Floats

DECIMALS = 4
"""Of the coordinates written: a tenth of the usual 0.001 mm, so that rounding is not seen."""
_SAME = 1e-9  # mm; a coordinate that stays keeps its text
_COMMENTS = re.compile(r"\([^)]*\)?|;.*")
_LINES = re.compile(r"[^\r\n]*(?:\r\n|\n|\r|$)")
_ARCS = (CLOCKWISE, COUNTERCLOCKWISE)
_CENTRE = ("I", "J")
_PLACES = "GXYZIJ"

Point = tuple[float, float]


@dataclass(frozen=True)
class RigidMotion:
    """The turn by the angle with ``cosine`` and ``sine``, then the shift by ``dx``, ``dy`` mm."""

    cosine: float
    sine: float
    dx: float
    dy: float

    @classmethod
    def between(cls, places: tuple[Point, Point], found: tuple[Point, Point]) -> RigidMotion:
        """The motion that turns the line between two ``places`` into that between the places
        ``found``, and takes the middle of one to the middle of the other.
        """
        (ax, ay), (bx, by) = places
        (px, py), (qx, qy) = found
        ux, uy, vx, vy = bx - ax, by - ay, qx - px, qy - py
        dot, cross = ux * vx + uy * vy, ux * vy - uy * vx
        size = math.hypot(dot, cross)
        turn = cls(dot / size, cross / size, 0.0, 0.0)
        x, y = turn((ax + bx) / 2, (ay + by) / 2)
        return cls(turn.cosine, turn.sine, (px + qx) / 2 - x, (py + qy) / 2 - y)

    @property
    def angle(self) -> float:
        """The angle of the turn in radians."""
        return math.atan2(self.sine, self.cosine)

    def __call__(self, x: float, y: float) -> Point:
        """Where the point ``x``, ``y`` comes to lie."""
        across, along = self.turned(x, y)
        return across + self.dx, along + self.dy

    def turned(self, x: float, y: float) -> Point:
        """The vector ``x``, ``y`` after the turn."""
        return x * self.cosine - y * self.sine, x * self.sine + y * self.cosine

    def of(self, points: Floats) -> Floats:
        """(n, 2) where ``points`` (n, 2) come to lie."""
        matrix = np.array([[self.cosine, self.sine], [-self.sine, self.cosine]])
        return np.asarray(points @ matrix + [self.dx, self.dy])


def moved(job: Job, program: Program, motion: RigidMotion, dialect: str = "grbl-1.1") -> Job:
    """``job``, whose moves are ``program``, after ``motion``: line by line, under its own name.

    ``dialect`` is that of its machine. Raises :class:`~miurafab.errors.GcodeError`, naming the
    line, for what cannot be moved.
    """
    burnt = program.line[program.beam_on]
    if not len(burnt):
        return job
    writer = _Writer(job.name, motion, int(burnt[0]), int(burnt[-1]), dialect)
    return Job(job.name, "".join(writer.lines(job.text)))


class _Writer:
    """The state of the program as it was; ``at`` is where the machine stands after the lines
    written so far.
    """

    def __init__(
        self, name: str, motion: RigidMotion, first_burnt: int, last_burnt: int, dialect: str
    ) -> None:
        self._name = name
        self._motion = motion
        self._first_burnt = first_burnt
        self._last_burnt = last_burnt
        self._dialect = dialect
        self._begun = False
        self._state = ModalState()
        self._rules = ReaderRules()
        self._at = [0.0, 0.0]
        self._placed = motion(0.0, 0.0) == (0.0, 0.0)

    def lines(self, text: str) -> Iterator[str]:
        for number, match in enumerate(_LINES.finditer(text), 1):
            yield match[0] if number > self._last_burnt else self._line(number, match[0])

    def _line(self, number: int, line: str) -> str:
        code = plain_code(self._name, number, line, begun=self._begun)
        if not code:
            return line
        self._begun = True
        start = list(self._state.position)
        inline = self._dialect == "marlin"
        plain = grbl_words(code) if inline else adapt(code, self._dialect).code
        block = parse_block(plain, self._state, lambda index: (0.0, 0.0, 0.0), self._rules)
        self._require_movable(block, number, code)
        for _ in execute(block, self._state, self._rules):
            pass
        arc = block.motion in _ARCS
        if block.claim is not Claim.MOTION or not (arc or {0, 1} & set(block.axes)):
            return line
        if not self._placed and (arc or number >= self._first_burnt):
            raise GcodeError(
                f"{self._name}, line {number} ({code}) begins where the head stands and not at a "
                "place of the sheet; write a G0 to its beginning before it."
            )
        self._placed = True
        return _rewritten(line, code, self._words(block, start), compact=bool(block.distance))

    def _require_movable(self, block: Block, number: int, code: str) -> None:
        if block.inches and block.claim is Claim.MOTION and block.axes:
            why = "moves in inches (G20)"
        elif block.plane and block.motion in _ARCS and block.claim is Claim.MOTION:
            why = "is an arc outside the XY plane"
        elif block.offset or block.action not in (0, DWELL):
            why = "moves the origin, or does not count from it"
        elif block.motion in PROBES and block.claim is Claim.MOTION:
            why = "measures"
        else:
            return
        raise GcodeError(
            f"{self._name}, line {number} ({code}) {why}, so the job cannot be turned and shifted; "
            "cut it without `align`."
        )

    def _words(self, block: Block, start: list[float]) -> dict[str, float]:
        """The X, Y, I and J that are written anew, with their values."""
        target = self._motion(block.target[0], block.target[1])
        words: dict[str, float] = {}
        for axis, letter in enumerate("XY"):
            begin = (start[axis], self._at[axis]) if block.distance else (0.0, 0.0)
            before, after = block.target[axis] - begin[0], target[axis] - begin[1]
            given = axis in block.axes
            if given and abs(after - before) <= _SAME:
                self._at[axis] = target[axis]
            elif given or round(target[axis] - self._at[axis], DECIMALS):
                words[letter] = round(after, DECIMALS)
                self._at[axis] = begin[1] + words[letter]
        if block.motion in _ARCS:
            old = (block.centre[0], block.centre[1])
            new = self._motion.turned(*old)
            if math.dist(old, new) > _SAME:
                words |= dict(zip(_CENTRE, new, strict=True))
        return words


def _rewritten(line: str, code: str, words: dict[str, float], *, compact: bool) -> str:
    """``line``, whose bare code is ``code``, with ``words`` in place of its own."""
    if not words:
        return line
    said = list(split_words(code))
    dropped = "R" if words.keys() & set(_CENTRE) else ""
    last = max((n for n, (letter, _) in enumerate(said) if letter in _PLACES), default=-1)
    written = {letter: letter + _number(value, compact) for letter, value in words.items()}
    out: list[str] = []
    for number, (letter, text) in enumerate(said):
        if letter not in dropped:
            out.append(written.pop(letter, letter + text))
        if number == last:
            new = [each for each in written if each not in dict(said)]
            out += [written.pop(each) for each in new]
    out += written.values()
    body = line.rstrip("\r\n")
    gap = "" if compact or " " not in _COMMENTS.sub("", body).strip() else " "
    comments = "".join(f" {comment}" for comment in _COMMENTS.findall(body))
    return gap.join(out) + comments + line[len(body) :]


def _number(value: float, compact: bool) -> str:
    text = f"{value:.{DECIMALS}f}".rstrip("0").rstrip(".")
    text = "0" if text in ("-0", "") else text
    return text.replace("0.", ".", 1) if compact and text.lstrip("-").startswith("0.") else text
