"""The path of the axis of a drag knife, so that the tip of its blade follows the strokes.

A drag knife is a caster: its tip T trails at distance d behind the axis C and moves only along the
blade, towards C. For the tip to move in direction u, the axis must be at C = T + d u. So

* on a straight segment the axis runs parallel to it, d ahead;
* at a corner from u to v the tip must stand still while the blade turns: the axis follows a circle
  of radius d about the corner, from T + d u to T + d v. A chord of this circle over an angle s
  pushes the tip back along the blade by at most d (1 - cos s/2) and then lets it return;
* at a very small turn, as on a curve, the arc is a single chord;
* a stroke starts with the blade in the direction of the last stroke: the axis comes down d ahead of
  the first point in the *old* direction and swivels there into the new direction.

The direction of the blade before the first stroke is unknown. A straight cut in the margin of the
sheet aligns it: tan(a/2), a the angle between blade and cut, falls by the factor exp(-1) every d
(the tractrix), so a cut of 20 d aligns any angle.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from miurafab.errors import LayoutError
from miurafab.fabrication.toolpath import Toolpath
from miurafab.geometry.arrays import Floats, Ints, places_in_runs
from miurafab.profiles import OPERATIONS, Knife

ALIGNING_OFFSETS = 20
"""The length of the cut that aligns the blade, in offsets."""
_MM = 1e-3  # what is shorter cannot be told apart in the file
_PUSH = 1e-3  # mm, how far the tip may be pushed back in a swivel
_STRAIGHT = 1e-9  # rad, below which there is no turn


def tip_way(toolpath: Toolpath, knife: Knife, margin_mm: float) -> Toolpath:
    """The path of the tip of ``knife`` for ``toolpath``, its strokes in the same order.

    The first cut, in the margin of ``margin_mm`` at the lower edge of the sheet, aligns the blade
    along +X, unless the offset of the blade is 0. Closed strokes are extended past their start by
    the overcut. Raises :class:`~miurafab.errors.LayoutError` if the margin has no room for the
    first cut, and for a stroke without length.
    """
    tip = _overcut(_distinct(toolpath), knife.overcut_mm)
    if knife.offset_mm == 0 or not len(tip):
        return tip
    return with_aligning_cut(tip, knife.offset_mm, margin_mm)


def _distinct(toolpath: Toolpath) -> Toolpath:
    """``toolpath`` without points that repeat the previous point of their stroke."""
    keep = np.ones(len(toolpath.points), dtype=bool)
    keep[1:] = np.linalg.norm(np.diff(toolpath.points, axis=0), axis=1) >= _MM
    keep[toolpath.offsets[:-1][np.diff(toolpath.offsets) > 0]] = True
    stroke = np.repeat(np.arange(len(toolpath)), np.diff(toolpath.offsets))
    kept = np.bincount(stroke[keep], minlength=len(toolpath))
    if kept.min(initial=2) < 2:
        raise LayoutError(
            f"Stroke {int(np.argmax(kept < 2)) + 1} of {toolpath.sheet} is shorter than 0.001 mm "
            "and cannot be cut; remove it from the layout."
        )
    return replace(toolpath, points=toolpath.points[keep], offsets=_offsets(kept))


def _overcut(toolpath: Toolpath, overcut: float) -> Toolpath:
    """Each closed stroke extended past its start by ``overcut``."""
    if overcut <= 0 or not len(toolpath):
        return toolpath
    closed = np.linalg.norm(toolpath.ends - toolpath.starts, axis=1) < _MM
    closed &= np.diff(toolpath.offsets) > 3
    lines = np.split(toolpath.points, toolpath.offsets[1:-1])
    for stroke in np.flatnonzero(closed).tolist():
        lines[stroke] = _led_on(lines[stroke], overcut)
    return replace(
        toolpath, points=np.concatenate(lines), offsets=_offsets(np.array([*map(len, lines)]))
    )


def _led_on(points: Floats, overcut: float) -> Floats:
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    end = min(overcut, float(along[-1]))
    inner = points[1:][along[1:] < end - _MM]
    last = [np.interp(end, along, points[:, 0]), np.interp(end, along, points[:, 1])]
    return np.concatenate([points, inner, [last]])


def with_aligning_cut(toolpath: Toolpath, d: float, margin_mm: float) -> Toolpath:
    """``toolpath`` after the cut that aligns the blade, in the middle of the margin."""
    y = margin_mm / 2
    length = ALIGNING_OFFSETS * d
    if y < 2 * d or 2 * y + length + 2 * d > toolpath.width_mm:
        raise LayoutError(
            f"The margin of {margin_mm:g} mm of {toolpath.sheet} has no room for the cut that "
            f"turns a blade with an offset of {d:g} mm; write a margin of at least {4 * d:g} mm "
            "under [bed]."
        )
    return replace(
        toolpath,
        points=np.concatenate([[[y, y], [y + length, y]], toolpath.points]),
        offsets=np.concatenate([[0], toolpath.offsets + 2]),
        operation=np.concatenate([[OPERATIONS.index("cut")], toolpath.operation]),
        patch=np.concatenate([[-1], toolpath.patch]),
        edge=np.concatenate([[-1], toolpath.edge]),
    )


def axis_way(toolpath: Toolpath, knife: Knife) -> Toolpath:
    """The path of the axis of ``knife`` for the path ``toolpath`` of its tip, stroke by stroke.

    The blade is along +X at the start; every stroke has a length.
    """
    d, points = knife.offset_mm, toolpath.points
    if d == 0 or not len(toolpath):
        return toolpath
    last = toolpath.offsets[1:] - 1
    begins = np.ones(len(points), dtype=bool)
    begins[last] = False
    corners = np.flatnonzero(begins)  # where a segment starts
    steps = points[corners + 1] - points[corners]
    along = steps / np.linalg.norm(steps, axis=1, keepdims=True)
    before = np.vstack([[1.0, 0.0], along[:-1]])
    turn = np.arctan2(
        before[:, 0] * along[:, 1] - before[:, 1] * along[:, 0], (before * along).sum(axis=1)
    )
    # At each corner, ``count`` chords about the tip from ``before`` to ``along``.
    chord = 2.0 * np.arccos(max(0.5, 1.0 - _PUSH / d))
    first = np.isin(corners, toolpath.offsets[:-1])
    swivels = first | (np.abs(turn) > knife.corner_angle)
    count = np.where(swivels, np.ceil(np.abs(turn) / chord), 1.0)
    count[np.abs(turn) < _STRAIGHT] = 0.0
    size = count.astype(np.int64) + 1
    corner = np.repeat(np.arange(len(corners)), size)
    step = places_in_runs(size)
    angle = np.arctan2(before[corner, 1], before[corner, 0])
    angle += turn[corner] * step / np.maximum(count[corner], 1.0)
    fan = points[corners[corner]] + d * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    stroke = np.searchsorted(toolpath.offsets, corners[corner], side="right") - 1
    lengths = np.bincount(stroke, minlength=len(toolpath)) + 1
    offsets = _offsets(lengths)
    way = np.empty((int(offsets[-1]), 2))
    way[np.arange(len(fan)) + stroke] = fan
    way[offsets[1:] - 1] = points[last] + d * along[np.searchsorted(corners, last) - 1]
    return replace(toolpath, points=way, offsets=offsets)


def _offsets(lengths: Ints) -> Ints:
    return np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
