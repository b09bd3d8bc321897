"""The lines of a drawing: straight, each with a letter and an angle, and what they were before."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from miurafab.errors import PatternError
from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.nearest import tree_of
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.formats.curves import Curve, Polyline, default_tolerance, shared_tolerances

FARTHEST = 1e9
"""A coordinate beyond this is refused, mm."""
_CORNER = 0.2
_MOST = 100_000
"""All curves of a drawing may become so many straight lines together."""


@dataclass(frozen=True, eq=False)
class CreaseLines:
    """n straight lines of a drawing, y upwards.

    ``ends`` (n, 2, 2) float64, mm; ``assignment`` (n,) letters of FOLD; ``fold_angle`` (n,)
    float64, radians, NaN if unknown. ``curve`` (n,) int64 is the number of the curved line that a
    line is a part of, -1 for none, and None where all lines are straight; they lie within
    ``curve_tolerance`` of it, mm. ``left_out`` tells how many elements of which kinds the reader
    passed over, though they may hold lines. The last ``added`` lines are not of the drawing.
    """

    ends: Floats
    assignment: NDArray[np.str_]
    fold_angle: Floats
    curve: Ints | None = None
    curve_tolerance: float = 0.0
    left_out: Mapping[str, int] = field(default_factory=dict)
    added: int = 0

    @property
    def curves(self) -> int:
        """The number of curved lines."""
        return 0 if self.curve is None else int(self.curve.max(initial=-1)) + 1


@dataclass(frozen=True, eq=False)
class DrawnLine:
    """One line of a drawing: its course in mm, y upwards, its letter, and its fold angle, radians,
    NaN if unknown.
    """

    course: Curve
    letter: str
    angle: float


def straightened(
    drawn: Sequence[DrawnLine],
    curve_tolerance: float | None = None,
    left_out: Mapping[str, int] | None = None,
) -> CreaseLines:
    """``drawn`` as straight lines, which lie within ``curve_tolerance`` (mm) of those that curve;
    None is a thousandth of the longer side of the drawing. ``left_out`` is kept.

    Raises :class:`~miurafab.errors.PatternError` for a coordinate beyond :data:`FARTHEST` or that
    is no number, and for curves that would become too many lines.
    """
    if not all((np.abs(line.course.hull()) < FARTHEST).all() for line in drawn):
        raise too_far()
    courses = [line.course for line in drawn]
    near = default_tolerance(courses) if curve_tolerance is None else curve_tolerance
    ends, letters, angles = [np.empty((0, 2, 2))], list[str](), list[float]()
    number, curve = -1, list[int]()
    for line, within in zip(drawn, shared_tolerances(courses, near), strict=True):
        points = line.course.points(within)
        count = len(points) - 1
        curved = not isinstance(line.course, Polyline)
        if curved and len(curve) + count > _MOST:
            raise PatternError(
                f"The curved lines would become more than {_MOST} straight lines; give a larger "
                "`curve_tolerance`."
            )
        number += curved
        ends.append(np.stack([points[:-1], points[1:]], axis=1))
        letters += [line.letter] * count
        angles += [line.angle] * count
        curve += [number if curved else -1] * count
    return CreaseLines(
        np.concatenate(ends),
        np.array(letters, dtype="U1"),
        np.array(angles, dtype=np.float64),
        np.array(curve, dtype=np.int64) if number >= 0 else None,
        near if number >= 0 else 0.0,
        left_out or {},
    )


def too_far() -> PatternError:
    """For a drawing with a coordinate that is not below :data:`FARTHEST`."""
    return PatternError("The drawing holds a coordinate that is not a number or is beyond 1e9.")


def with_flat_lines(lines: CreaseLines, ends: Floats) -> CreaseLines:
    """``lines`` and flat ones (F) with ``ends`` (n, 2, 2)."""
    count = len(ends)
    curve = lines.curve
    return replace(
        lines,
        ends=np.concatenate([lines.ends, ends]),
        assignment=np.concatenate([lines.assignment, np.full(count, "F")]),
        fold_angle=np.concatenate([lines.fold_angle, np.zeros(count)]),
        curve=None if curve is None else np.concatenate([curve, np.full(count, -1)]),
        added=lines.added + count,
    )


def corners_at_ends(lines: CreaseLines) -> CreaseLines:
    """``lines`` with the corners of their curves moved to ends of other lines beside them.

    A corner between two straight lines of a curve moves to an end that is nearer than a fifth of
    the shorter of the two; else a very short line would be left between them.
    """
    if lines.curve is None or len(lines.ends) < 2:
        return lines
    curve, ends = lines.curve, lines.ends.copy()
    after = np.flatnonzero((curve[1:] == curve[:-1]) & (curve[1:] >= 0))  # corner: end of its line
    if not len(after):
        return lines
    open_ = np.ones((len(ends), 2), dtype=bool)
    open_[after, 1] = open_[after + 1, 0] = False
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    near, which = tree_of(ends[open_]).query(ends[after, 1])
    close = np.asarray(near) < _CORNER * np.minimum(length[after], length[after + 1])
    moved = ends[open_][np.asarray(which)[close]]
    ends[after[close], 1] = moved
    ends[after[close] + 1, 0] = moved
    return replace(lines, ends=ends)


def lines_of(pattern: CreasePattern) -> CreaseLines:
    """The edges of the flat ``pattern`` as lines."""
    return CreaseLines(
        pattern.vertices_coords[pattern.edges_vertices],
        pattern.edges_assignment,
        pattern.edges_fold_angle,
    )
