"""The fast path of the interpreter: lines with only ``G0`` and ``G1`` moves, read as arrays.

Nearly every line of a long job is *regular*: words of G (0 or 1), X, Y, S and F, each at most once,
with X or Y. Regular lines are read as one array of bytes without a Python loop. Letters separate
the words. The digits of a word form an integer v with k decimals, and the value is v / 10^k. Both
are exact below 2^53, so the quotient is the double nearest to the decimal, equal to ``float``.
Missing words take the value of the line before.

The word parser is the reference and reads all other lines (comments, arcs, errors). A line counts
as regular only if both readers agree.

Legend: L lines of a chunk, W words in it, r lines of a run.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from miurafab.gcode.parser import ModalState
from miurafab.gcode.words import LINEAR, SEEK
from miurafab.geometry.arrays import Bools, Floats, Ints

LEAST_RUN = 48
"""The shortest run of regular lines read as an array; shorter runs go to the word parser."""

_OTHER, _BLANK, _DIGIT, _POINT, _SIGN, _LETTER, _END = range(7)
_KIND = np.zeros(256, dtype=np.uint8)
for _characters, _kind in (
    (b" \t", _BLANK),
    (b"0123456789", _DIGIT),
    (b".", _POINT),
    (b"+-", _SIGN),
    (b"GXYSF", _LETTER),
    (b"\n", _END),
):
    _KIND[np.frombuffer(_characters, dtype=np.uint8)] = _kind
_LETTERS = b"GXYSF"
_G, _X, _Y, _S, _F = range(5)
_MOST_DIGITS = 15
_TENS = 10.0 ** np.arange(_MOST_DIGITS + 1)
_WHOLE_TENS = 10 ** np.arange(_MOST_DIGITS + 1, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class TextLines:
    """The lines of a chunk of text.

    ``bounds`` (L + 1,) int64: line i is ``text[bounds[i]:bounds[i + 1] - 1]``. ``values`` (5, L)
    float64: its G, X, Y, S and F, or NaN. ``regular`` (L,) bool. For regular lines only, (L,)
    int64: ``size``, the characters without blanks, ``words``, and ``points``, the decimal points.
    """

    bounds: Ints
    values: Floats
    regular: Bools
    size: Ints
    words: Ints
    points: Ints

    @property
    def commanded(self) -> Bools:
        """(L,) whether a line holds G0 or G1."""
        return np.asarray(~np.isnan(self.values[_G]))


def read_lines(text: str) -> TextLines:
    """Split ``text``, whole lines that each end in a newline; read the regular lines."""
    raw = np.frombuffer(text.encode("ascii", "replace"), dtype=np.uint8)
    kind = _KIND[raw]
    bounds = np.concatenate([[0], np.flatnonzero(kind == _END) + 1])
    code = kind != _BLANK
    raw, kind = raw[code], kind[code]
    ends = np.flatnonzero(kind == _END)
    starts = np.concatenate([[0], ends[:-1] + 1])
    count = len(ends)
    line = np.cumsum(kind == _END)  # of each character but the newlines

    bad = np.zeros(count, dtype=bool)
    bad[line[kind == _OTHER]] = True
    bad |= kind[starts] != _LETTER

    letters = np.flatnonzero(kind == _LETTER)
    after = np.flatnonzero((kind == _LETTER) | (kind == _END))
    stops = after[np.searchsorted(after, letters) + 1] if len(letters) else letters
    of_line = line[letters]
    value, sound = _numbers(raw, kind, letters, stops)
    bad[of_line[~sound]] = True
    values = np.full((len(_LETTERS), count), np.nan)
    for row, letter in enumerate(_LETTERS):
        chosen = raw[letters] == letter
        lines = of_line[chosen]
        values[row, lines] = value[chosen]
        bad[lines[1:][lines[1:] == lines[:-1]]] = True
    with np.errstate(invalid="ignore"):
        bad |= ~np.isnan(values[_G]) & (values[_G] != SEEK) & (values[_G] != LINEAR)
        bad |= (values[_S] < 0.0) | (values[_F] < 0.0)
    moves = ~np.isnan(values[_X]) | ~np.isnan(values[_Y])
    dots = np.concatenate([[0], np.cumsum(kind == _POINT)])
    return TextLines(
        bounds=bounds,
        values=values,
        regular=moves & ~bad,
        size=ends - starts,
        words=np.bincount(of_line, minlength=count),
        points=dots[ends] - dots[starts],
    )


def _numbers(
    raw: NDArray[np.uint8],
    kind: NDArray[np.uint8],
    letters: Ints,
    stops: Ints,
) -> tuple[Floats, Bools]:
    """(W,) the number between each letter and its stop, and whether it is well formed."""
    digits = np.concatenate([[0], np.cumsum(kind == _DIGIT)])
    points = np.concatenate([[0], np.cumsum(kind == _POINT)])
    signs = np.concatenate([[0], np.cumsum(kind == _SIGN)])
    count = digits[stops] - digits[letters]
    dotted = points[stops] - points[letters]
    signed = signs[stops] - signs[letters]
    sound = (count > 0) & (count <= _MOST_DIGITS) & (dotted <= 1) & (signed <= 1)
    leading = kind[np.minimum(letters + 1, len(kind) - 1)] == _SIGN
    sound &= (signed == 0) | leading

    # The place of a digit is how many follow it in its word.
    at = np.flatnonzero(kind == _DIGIT)
    word = np.searchsorted(letters, at) - 1
    inside = word >= 0
    at, word = at[inside], word[inside]
    place = np.clip(digits[stops[word]] - digits[at] - 1, 0, _MOST_DIGITS)
    whole = np.zeros(len(letters), dtype=np.int64)
    if len(at):
        sums = np.concatenate([[0], np.cumsum((raw[at] - ord("0")) * _WHOLE_TENS[place])])
        # A digit outside a word makes its line irregular, so its sum here does not matter.
        first = np.searchsorted(at, letters)
        whole = sums[np.searchsorted(at, stops)] - sums[first]
    decimals = np.zeros(len(letters), dtype=np.int64)
    dot = np.flatnonzero(kind == _POINT)
    owner = np.searchsorted(letters, dot) - 1
    dot, owner = dot[owner >= 0], owner[owner >= 0]
    decimals[owner] = digits[stops[owner]] - digits[dot]
    value = whole / _TENS[np.clip(decimals, 0, _MOST_DIGITS)]
    negative = leading & (raw[np.minimum(letters + 1, len(raw) - 1)] == ord("-"))
    return np.where(negative, -value, value), sound


@dataclass(frozen=True, eq=False)
class RegularMoves:
    """The moves of r regular lines: ``target`` (r, 3) float64 mm, ``rapid`` (r,) bool, ``feed`` in
    mm/min and ``speed`` in S words (r,) float64; ``changes`` (r,) bool marks each new speed.
    """

    target: Floats
    rapid: Bools
    feed: Floats
    speed: Floats
    changes: Bools


def regular_moves(
    lines: TextLines, first: int, stop: int, state: ModalState
) -> RegularMoves | None:
    """The moves of the regular lines ``first`` to ``stop`` (exclusive); updates ``state``.

    Returns None and leaves ``state`` alone if the state gives such lines another meaning, or if a
    line is an error in it.
    """
    if state.inches or state.distance or state.inverse_time:
        return None
    words = lines.values[:, first:stop]
    motion = _filled(words[_G], float(state.motion))
    feed = _filled(words[_F], state.feed)
    speed = _filled(words[_S], state.speed)
    rapid = motion == SEEK
    if not (rapid | (motion == LINEAR)).all() or not (rapid | (feed != 0.0)).all():
        return None
    target = np.empty((stop - first, 3))
    for axis, row in enumerate((_X, _Y)):
        places = words[row] + state.coord_system[axis] + state.coord_offset[axis]
        target[:, axis] = _filled(places, state.position[axis])
    target[:, 2] = state.position[2]
    changes = np.diff(speed, prepend=state.speed) != 0.0
    state.motion = int(motion[-1])
    state.feed, state.speed = float(feed[-1]), float(speed[-1])
    state.position = target[-1].tolist()
    return RegularMoves(target, rapid, feed, speed, changes)


def _filled(values: Floats, before: float) -> Floats:
    """Replace each NaN of ``values`` by the last number before it, at the start by ``before``."""
    index = np.where(np.isnan(values), -1, np.arange(len(values)))
    index = np.maximum.accumulate(index)
    return np.where(index < 0, before, values[index])
