"""Where the tip of a drag knife goes while its axis follows a program: the knife's rule undone.

The tip T trails at distance d behind the axis C and moves only along the blade. While the axis goes
straight on by s in direction b, the direction a of the blade follows a' = sin(b - a) / d, so that

    tan((b - a) / 2) falls by the factor exp(-s / d)        (the tractrix),

and T = C - d (cos a, sin a). Nothing of :mod:`miurafab.fabrication.knife`, which leads the axis, is
used here. Between two strokes the blade is up and keeps its direction. It is along +X at the start;
the cut that aligns it makes up for any other direction.
"""

from __future__ import annotations

import math

import numpy as np

from miurafab.geometry.arrays import Bools, Floats, Ints


def tip_moves(start: Floats, end: Floats, offset_mm: float) -> tuple[Floats, Ints]:
    """The moves (n, 4) of the tip while the axis moves from ``start`` to ``end`` (n, 2) with the
    blade down, and the stroke (n,) that each is of.
    """
    stroke = np.cumsum(np.r_[False, (start[1:] != end[:-1]).any(axis=1)][: len(start)])
    if offset_mm == 0.0:
        return np.concatenate([start, end], axis=1), stroke
    steps = end - start
    towards = np.arctan2(steps[:, 1], steps[:, 0])
    fall = np.exp(-np.linalg.norm(steps, axis=1) / offset_mm)
    blade = np.empty((len(start), 2))
    angle = 0.0
    for move, (to, less) in enumerate(zip(towards.tolist(), fall.tolist(), strict=True)):
        blade[move, 0] = angle
        angle = to - 2 * math.atan(math.tan((to - angle) / 2) * less)
        blade[move, 1] = angle
    back = offset_mm * np.stack([np.cos(blade), np.sin(blade)], axis=2)
    return np.concatenate([start - back[:, 0], end - back[:, 1]], axis=1), stroke


def overcuts(moves: Floats, stroke: Ints, overcut_mm: float, near: float) -> tuple[Bools, Ints]:
    """Which of the ``moves`` (n, 4) only go on past the start of a closed stroke, and the closed
    strokes that do not go on by ``overcut_mm``, all within ``near`` mm.
    """
    beyond = np.zeros(len(moves), dtype=bool)
    short = []
    lengths = np.linalg.norm(moves[:, 2:] - moves[:, :2], axis=1)
    first = np.flatnonzero(np.diff(stroke, prepend=-1))
    end = np.flatnonzero(np.diff(stroke, append=-1)) + 1
    for begin, last in zip(first.tolist(), end.tolist(), strict=True):
        home = np.linalg.norm(moves[begin:last, 2:] - moves[begin, :2], axis=1) <= near
        along = np.cumsum(lengths[begin:last])
        # Home again, and not still there: the stroke has been somewhere else.
        back = np.flatnonzero(home & (along > 4 * near + overcut_mm))
        if not len(back):
            continue
        closed = int(back[-1])
        rest = float(along[-1] - along[closed])
        if rest > overcut_mm + near:
            continue  # it only touches its start on its way, as the stroke of a 6 does
        if abs(rest - overcut_mm) > near or not _repeats(moves[begin:last], closed, near):
            short.append(int(stroke[begin]))
        else:
            beyond[begin + closed + 1 : last] = True
    return beyond, np.array(short, dtype=np.int64)


def _repeats(moves: Floats, closed: int, near: float) -> bool:
    """Whether the moves after the one of number ``closed`` lie on the first moves."""
    ends, starts, heads = moves[closed + 1 :, 2:], moves[:closed, :2], moves[:closed, 2:]
    along = heads - starts
    square = np.maximum((along**2).sum(axis=1), 1e-12)
    part = np.einsum("enk,nk->en", ends[:, None] - starts, along) / square
    foot = starts + part.clip(0, 1)[..., None] * along
    return bool((np.linalg.norm(ends[:, None] - foot, axis=2).min(axis=1) <= near).all())
