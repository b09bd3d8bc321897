"""The strokes of a sheet in the order of making: on the bed, in micrometres, passes repeated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from miurafab.errors import LayoutError
from miurafab.fabrication.toolpath import Toolpath
from miurafab.geometry.arrays import Bools, Ints, places_in_runs, run_starts
from miurafab.profiles import OPERATIONS, MachineProfile


@dataclass(frozen=True, eq=False)
class Runs:
    """Strokes in the order of making, in runs of one operation, patch and pass.

    ``order`` (T,) stroke indices, passes expanded; ``first`` (R,) where each run starts in it;
    ``operation``, ``patch``, ``number`` (1-based) and ``passes`` (R,).
    """

    order: Ints
    first: Ints
    operation: Ints
    patch: Ints
    number: Ints
    passes: Ints


def runs_of(toolpath: Toolpath, passes_of_operation: Sequence[int]) -> Runs:
    """The runs of ``toolpath``, each as often as its operation has passes."""
    count = len(toolpath)
    change = np.ones(count, dtype=bool)
    change[1:] = (np.diff(toolpath.operation) != 0) | (np.diff(toolpath.patch) != 0)
    first = np.flatnonzero(change)
    size = np.diff(np.append(first, count))
    passes = np.asarray(passes_of_operation, dtype=np.int64)[toolpath.operation[first]]
    # Run r stands passes[r] times in a row; a stroke's index is its run's first plus its place.
    source = np.repeat(np.arange(len(first)), passes)
    number = places_in_runs(passes) + 1
    made = run_starts(size[source])
    total = int(size[source].sum())
    order = np.arange(total) + np.repeat(first[source] - made, size[source])
    return Runs(
        order=order,
        first=made,
        operation=toolpath.operation[first][source],
        patch=toolpath.patch[first][source],
        number=number,
        passes=passes[source],
    )


def repeated(toolpath: Toolpath, runs: Runs) -> Toolpath:
    """``toolpath`` with its strokes in the order of ``runs``, passes repeated."""
    size = np.diff(toolpath.offsets)[runs.order]
    begin = run_starts(size)
    source = np.arange(int(size.sum()))
    source += np.repeat(toolpath.offsets[:-1][runs.order] - begin, size)
    return replace(
        toolpath,
        points=toolpath.points[source],
        offsets=np.concatenate([[0], np.cumsum(size)]).astype(np.int64),
        operation=toolpath.operation[runs.order],
        patch=toolpath.patch[runs.order],
        edge=toolpath.edge[runs.order],
    )


def without_lifts(toolpath: Toolpath) -> Toolpath:
    """``toolpath`` with each stroke that begins where the one before ends, to the micrometre,
    joined to it, if both are of one operation and one patch: a pen need not leave the sheet there.
    """
    if not len(toolpath):
        return toolpath
    begin, end = (np.rint(each * 1000.0) for each in (toolpath.starts[1:], toolpath.ends[:-1]))
    meets = (begin == end).all(axis=1)
    meets &= (np.diff(toolpath.operation) == 0) & (np.diff(toolpath.patch) == 0)
    first = np.append(True, ~meets)
    points = np.ones(len(toolpath.points), dtype=bool)
    points[toolpath.offsets[1:-1][meets]] = False
    count = np.add.reduceat(np.add.reduceat(points, toolpath.offsets[:-1]), np.flatnonzero(first))
    return replace(
        toolpath,
        points=toolpath.points[points],
        offsets=np.concatenate([[0], np.cumsum(count)]).astype(np.int64),
        operation=toolpath.operation[first],
        patch=toolpath.patch[first],
        edge=toolpath.edge[first],
    )


@dataclass(frozen=True, eq=False)
class Points:
    """The points of the strokes, in the order of making.

    ``xy`` (N, 2) int64 micrometres; ``first`` (T,) the index of each stroke's first point;
    ``starts`` (N,) bool, whether a point is one; ``operation`` (T,) that of each stroke.
    """

    xy: Ints
    first: Ints
    starts: Bools
    operation: Ints

    @property
    def last(self) -> Ints:
        """(T,) the index of each stroke's last point."""
        return np.append(self.first[1:], len(self.xy))[: len(self.first)] - 1


def points_of(toolpath: Toolpath, machine: MachineProfile) -> Points:
    """The points of ``toolpath``, without those that equal the one before in their stroke.

    Raises :class:`~miurafab.errors.LayoutError`, naming the stroke, for one that leaves the bed or
    has no length.
    """
    xy = _microns(toolpath, machine)
    stroke = np.repeat(np.arange(len(toolpath)), np.diff(toolpath.offsets))
    starts = np.ones(len(xy), dtype=bool)
    starts[1:] = np.diff(stroke) != 0
    moves = np.ones(len(xy), dtype=bool)
    moves[1:] = (xy[1:] != xy[:-1]).any(axis=1)
    keep = starts | moves
    kept = np.bincount(stroke[keep], minlength=len(toolpath))
    if kept.min(initial=2) < 2:
        raise LayoutError(
            f"{_named(toolpath, int(np.argmax(kept < 2)))} is shorter than 0.001 mm "
            "and cannot be made; remove it from the layout."
        )
    return Points(xy[keep], run_starts(kept), starts[keep], toolpath.operation)


def _microns(toolpath: Toolpath, machine: MachineProfile) -> Ints:
    """(N, 2) the points in whole micrometres, all of them on the bed."""
    bed = np.array([machine.bed.width_mm, machine.bed.height_mm])
    micron = np.rint(np.where(np.isfinite(toolpath.points), toolpath.points, -1.0) * 1000.0)
    outside = ((micron < 0) | (micron > np.rint(bed * 1000.0))).any(axis=1)
    if outside.any():
        point = int(np.argmax(outside))
        stroke = int(np.searchsorted(toolpath.offsets, point, side="right")) - 1
        x, y = toolpath.points[point]
        raise LayoutError(
            f"{_named(toolpath, stroke)} reaches X {x:.3f} Y {y:.3f}, which is not on the "
            f"{bed[0]:g} x {bed[1]:g} mm bed of {machine.name}; lay the pattern out for this bed."
        )
    return micron.astype(np.int64)


def _named(toolpath: Toolpath, stroke: int) -> str:
    patch = int(toolpath.patch[stroke])
    where = "" if patch < 0 else f", patch {patch}"
    operation = OPERATIONS[int(toolpath.operation[stroke])]
    return f"Stroke {stroke + 1} of {toolpath.sheet} ({operation}{where})"
