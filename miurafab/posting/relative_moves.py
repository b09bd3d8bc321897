"""Strokes in chains of relative moves, where the wire is too slow for absolute moves.

Consecutive strokes with short gaps form a chain: one ``G0`` to its beginning, then ``G91`` and
moves of a few bytes each. A gap is a ``G1`` with the power at 0. In laser mode the power changes
with the move, without a stop. A chain is so short that the rounding errors of the firmware's
single-precision sums (2^-24 of the position each) stay below a micrometre in total. Each chain
begins at an absolute position, so that errors do not accumulate over a sheet.
"""

from __future__ import annotations

import numpy as np

from miurafab.geometry.arrays import Bools, Ints
from miurafab.posting.dialects import Words
from miurafab.posting.strokes import Points
from miurafab.posting.text import ByteRows, absolute_number, relative_number, table

LONGEST_GAP = 5000
"""The longest gap in a chain, in micrometres; over a longer gap a ``G0`` is faster."""
LONGEST_CHAIN = 64
"""The most strokes in one chain."""


def chains(points: Points, words: Words, run_first: Ints) -> tuple[ByteRows, Ints]:
    """The lines as rows of bytes, and (T,) the row at which each stroke starts.

    ``run_first`` are the strokes after comments; each of them begins a chain.
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
    """(T, 2) micrometres from the end of the previous stroke to the start of each stroke."""
    gap = np.zeros((len(points.first), 2), dtype=np.int64)
    gap[1:] = points.xy[points.first[1:]] - points.xy[points.last[:-1]]
    return gap


def apart(points: Points, run_first: Ints) -> Bools:
    """(T,) whether a stroke begins a chain: after a long gap, or after comments."""
    begins: Bools = np.linalg.norm(gaps(points), axis=1) > LONGEST_GAP
    begins[run_first] = True
    return begins


def _axis(
    letter: str, place: Ints, step: Ints, anchor: Bools
) -> tuple[ByteRows, ByteRows, ByteRows]:
    """The axis words: a position at an anchor, a step elsewhere, nothing for a step of 0."""
    said = anchor | (step != 0)
    absolute, relative = absolute_number(place), relative_number(step)
    absolute[~anchor] = 0
    relative[anchor | ~said] = 0
    return table(["", letter])[said.astype(np.int64)], absolute, relative
