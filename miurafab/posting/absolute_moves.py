"""Strokes as ``G0`` travels and ``G1`` cuts in absolute coordinates: the usual form of a job."""

from __future__ import annotations

import numpy as np

from miurafab.geometry.arrays import Ints
from miurafab.posting.dialects import Words
from miurafab.posting.strokes import Points
from miurafab.posting.text import ByteRows, absolute_number, table


def hops(points: Points, words: Words) -> tuple[ByteRows, Ints]:
    """The lines as rows of bytes, and (T,) the row at which each stroke starts.

    Every stroke starts with a ``G0``; S and F stand where they change, or in every stroke where
    the controller needs that.
    """
    xy, first = points.xy, points.first
    suffix = np.zeros(len(xy), dtype=np.int64)
    modal, modal_of_stroke = _modal_words(words, points.operation)
    suffix[first + 1] = modal_of_stroke
    down = np.zeros(len(xy), dtype=np.int64)
    down[first] = points.operation + 1
    last = np.zeros(len(xy), dtype=np.int64)
    last[points.last] = 1
    rows = np.concatenate(
        [
            table(["G1 X", "G0 X"])[points.starts.astype(np.int64)],
            absolute_number(xy[:, 0]),
            table([" Y"])[np.zeros(len(xy), dtype=np.int64)],
            absolute_number(xy[:, 1]),
            table(modal)[suffix],
            table(["", *(words.travel + text for text in words.down)])[down],
            table(["", words.up])[last],
            np.full((len(xy), 1), ord("\n"), dtype=np.uint8),
        ],
        axis=1,
    )
    return rows, first


def _modal_words(words: Words, operation: Ints) -> tuple[list[str], Ints]:
    """The S and F words for each pair (operation before, operation now), and each stroke's index
    among them. Row 0 of the pairs is "nothing before".
    """
    count = len(words.feed)
    texts = []
    for before in range(-1, count):
        for now in range(count):
            fresh = before < 0 or words.restated
            text = ""
            if words.s is not None and (fresh or words.s[before] != words.s[now]):
                text += f" S{words.s[now]}"
            if fresh or words.feed[before] != words.feed[now]:
                text += f" F{words.feed[now]}"
            texts.append(text)
    # Index 0 stands for "no words", so the pairs start at 1.
    before_each = np.concatenate([[-1], operation[:-1]]) if len(operation) else operation
    return ["", *texts], 1 + (before_each + 1) * count + operation
