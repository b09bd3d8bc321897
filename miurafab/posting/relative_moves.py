"""Strokes in chains of relative moves, for a wire too slow for the dashes.

Strokes that follow one another over a short gap form a chain: one ``G0`` to its beginning, then
``G91`` and moves of a few bytes each, the gap a ``G1`` with the power at 0. In laser mode the power
changes with the move, without a stop. A chain is short enough for the firmware's
single-precision sums (2^-24 of the position each) to stay below a micrometre, and each begins
at an absolute place, so that nothing adds up over a sheet.
"""

from __future__ import annotations

import numpy as np

from miurafab.geometry.arrays import Bools, Ints
from miurafab.posting.dialects import Words
from miurafab.posting.strokes import Points
from miurafab.posting.text import ByteRows, absolute_number, relative_number, table

LONGEST_GAP = 5000
"""The longest gap made at the feed of the cut, in micrometres; further, a ``G0`` is faster."""
LONGEST_CHAIN = 64
"""Strokes in one chain at most."""


def chains(points: Points, words: Words, run_first: Ints) -> tuple[ByteRows, Ints]:
    """The lines as rows of bytes, and (T,) the row at which each stroke starts.

    ``run_first`` are the strokes before which comments stand: a chain begins at each.
    """
    assert words.s is not None
    xy, first = points.xy, points.first
    count = len(first)
    gap = gaps(points)
    begins = apart(points, run_first)
    since = np.arange(count) - np.maximum.accumulate(np.where(begins, np.arange(count), 0))
    begins |= since % LONGEST_CHAIN == 0
    meets = ~begins & ~gap.any(axis=1)

    step = np.zeros_like(xy)
    step[1:] = xy[1:] - xy[:-1]
    anchor = np.zeros(len(xy), dtype=bool)
    anchor[first[begins]] = True
    opens = np.zeros(len(xy), dtype=bool)  # the first cut of a chain, which says everything
    opens[first[begins] + 1] = True
    dark = points.starts & ~anchor
    lights = np.zeros(len(xy), dtype=bool)  # the first cut after a gap
    lights[first[~begins & ~meets] + 1] = True

    operation = np.repeat(points.operation, np.diff(np.append(first, len(xy))))
    power = [f"S{value}" for value in words.s]
    full = [f"S{value}F{feed}" for value, feed in zip(words.s, words.feed, strict=True)]
    tail = np.where(dark, 1, 0)
    tail = np.where(lights, 2 + operation, tail)
    tail = np.where(opens, 2 + len(power) + operation, tail)
    lead = np.where(anchor, 1, np.where(opens, 2, 0))
    rows = np.concatenate(
        [
            table(["", "G90G0", "G91G1"])[lead],
            *_axis("X", xy[:, 0], step[:, 0], anchor),
            *_axis("Y", xy[:, 1], step[:, 1], anchor),
            table(["", "S0", *power, *full])[tail],
            np.full((len(xy), 1), ord("\n"), dtype=np.uint8),
        ],
        axis=1,
    )
    # Where two strokes meet there is no gap to say.
    rows[first[meets]] = 0
    return rows, first


def gaps(points: Points) -> Ints:
    """(T, 2) micrometres from the end of the stroke before to the start of each."""
    gap = np.zeros((len(points.first), 2), dtype=np.int64)
    gap[1:] = points.xy[points.first[1:]] - points.xy[points.last[:-1]]
    return gap


def apart(points: Points, run_first: Ints) -> Bools:
    """(T,) whether a stroke is too far from the one before, or parted by comments, for a chain."""
    begins: Bools = np.linalg.norm(gaps(points), axis=1) > LONGEST_GAP
    begins[run_first] = True
    return begins


def _axis(
    letter: str, place: Ints, step: Ints, anchor: Bools
) -> tuple[ByteRows, ByteRows, ByteRows]:
    """A letter with its number: the place at an anchor, the step elsewhere, nothing for no step."""
    said = anchor | (step != 0)
    absolute, relative = absolute_number(place), relative_number(step)
    absolute[~anchor] = 0
    relative[anchor | ~said] = 0
    return table(["", letter])[said.astype(np.int64)], absolute, relative
