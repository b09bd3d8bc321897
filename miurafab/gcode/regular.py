"""Lines that are nothing but ``G0`` and ``G1`` moves, read by the ten thousand.

Nearly every line of a long job is *regular*: words of G (0 or 1), X, Y, S and F, each once at most,
with a place to go to. Such lines are read as one array of bytes, without a loop over them: letters
part the words, the digits of a word add up to an integer v with k decimals, and the value is
v / 10^k. Both are exact below 2^53, so the quotient is the double nearest to the decimal, the
same that ``float`` reads. What a mode was before is filled forward.

Any other line (a comment, an arc, a fault) is left to the word parser, which is the reference: a
line counts as regular only where both give the same.

Legend: L lines of a chunk, W words in it, r lines of a run.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from miurafab.gcode.parser import ModalState
from miurafab.gcode.words import LINEAR, SEEK

LEAST_RUN = 48
"""Regular lines in a row that are worth an array; fewer go to the word parser."""

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
    float64: its G, X, Y, S and F, NaN where it has none; ``regular`` (L,) bool, and ``empty`` (L,)
    bool, blanks only. ``size``, ``words`` and ``points`` (L,) int64: its characters without
    blanks, its words, its decimal points; they hold for regular lines.
    """

    bounds: NDArray[np.int64]
    values: NDArray[np.float64]
    regular: NDArray[np.bool_]
    empty: NDArray[np.bool_]
    size: NDArray[np.int64]
    words: NDArray[np.int64]
    points: NDArray[np.int64]

    @property
    def commanded(self) -> NDArray[np.bool_]:
        """(L,) whether a line says G0 or G1 itself."""
        return np.asarray(~np.isnan(self.values[_G]))


def read_lines(text: str) -> TextLines:
    """``text``, whole lines that each end in a newline, split into words where regular."""
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
    begins = kind[starts]
    empty = begins == _END
    bad |= ~empty & (begins != _LETTER)

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
        empty=empty,
        size=ends - starts,
        words=np.bincount(of_line, minlength=count),
        points=dots[ends] - dots[starts],
    )


def _numbers(
    raw: NDArray[np.uint8],
    kind: NDArray[np.uint8],
    letters: NDArray[np.int64],
    stops: NDArray[np.int64],
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """(W,) the number between each letter and its stop, and whether it is one."""
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
        # Where a digit stands outside of a word its line is not regular, whatever this makes of it.
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
    """What r regular lines ask for: ``target`` (r, 3) float64 mm, ``rapid`` (r,) bool, ``feed``
    in mm/min and ``speed`` in S words (r,) float64; ``changes`` (r,) bool, whether that is a new
    speed.
    """

    target: NDArray[np.float64]
    rapid: NDArray[np.bool_]
    feed: NDArray[np.float64]
    speed: NDArray[np.float64]
    changes: NDArray[np.bool_]


def regular_moves(
    lines: TextLines, first: int, stop: int, state: ModalState
) -> RegularMoves | None:
    """The regular lines from ``first`` to before ``stop``, taken up in ``state``; updates it.

    None, and ``state`` as it was, if that state gives such lines another meaning, or one of
    them is at fault in it.
    """
    if state.inches or state.distance or state.inverse_time:
        return None
    given = lines.values[:, first:stop]
    motion = _filled(given[_G], float(state.motion))
    feed = _filled(given[_F], state.feed)
    speed = _filled(given[_S], state.speed)
    rapid = motion == SEEK
    if not (rapid | (motion == LINEAR)).all() or not (rapid | (feed != 0.0)).all():
        return None
    target = np.empty((stop - first, 3))
    for axis, row in enumerate((_X, _Y)):
        places = given[row] + state.coord_system[axis] + state.coord_offset[axis]
        target[:, axis] = _filled(places, state.position[axis])
    target[:, 2] = state.position[2]
    changes = np.diff(speed, prepend=state.speed) != 0.0
    state.motion = int(motion[-1])
    state.feed, state.speed = float(feed[-1]), float(speed[-1])
    state.position = target[-1].tolist()
    return RegularMoves(target, rapid, feed, speed, changes)


def _filled(values: NDArray[np.float64], before: float) -> NDArray[np.float64]:
    """``values`` with each NaN replaced by the last number before it, ``before`` at the start."""
    index = np.where(np.isnan(values), -1, np.arange(len(values)))
    index = np.maximum.accumulate(index)
    return np.where(index < 0, before, values[index])
