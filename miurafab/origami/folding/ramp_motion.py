"""The motion of any crease pattern from flat, piece by piece, and what it says of the pattern.

Each piece goes its own way along the same ramp (:mod:`miurafab.origami.folding.from_flat`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from miurafab.errors import PatternError
from miurafab.geometry.arrays import Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.bar_hinge import SOFTNESS, has_folds
from miurafab.origami.energy.hinges import hinge_angles
from miurafab.origami.energy.pieces import part_of
from miurafab.origami.energy.ruled import is_ruled
from miurafab.origami.folding.first_order import waiting_folds
from miurafab.origami.folding.from_flat import RampPath, fold_from_flat, ramp_parts
from miurafab.origami.folding.kinematics import FROM_FLAT, FoldingMotion
from miurafab.origami.folding.laying import laid_on_each_other
from miurafab.origami.piece import Piece, pieces_of

MOST_WRONG = 0.02
"""A pattern with more creases of the wrong sign does not fold in one motion."""
HELD_BACK = np.radians(30.0)
"""A mean distance from the fold angles asked for that is worth a remark."""


@dataclass(frozen=True, eq=False)
class RampVerdict:
    """What the motion from flat says of a pattern.

    ``wrong_edges`` end folded to the other side than their letter tells, the part ``wrong_signs``
    of all ``folds``; the part ``seed_signs`` of them follow their letter as they leave flat. The
    ``waiting_edges`` cannot begin with flat facets while the others do
    (:mod:`miurafab.origami.folding.first_order`).
    ``unstable`` (T,) is the number of directions in which each frame is no minimum of the energy,
    ``strain`` (T,) the largest relative change of a side or of a diagonal about which a facet may
    bend (:meth:`~miurafab.origami.energy.bar_hinge.BarHingeModel.stretched`), ``angle_error`` the
    mean distance from the fold angles asked for in the last frame, radians, and ``snaps`` the
    number of jumps. If ``complete`` is False the way was lost before its end. ``touching`` tells
    whether springs kept facets from passing through each other. A sheet too large to be followed
    again in finer steps, with softer paper or with contact is followed again in so few steps as
    ``followed_again``.
    """

    wrong_edges: Ints
    waiting_edges: Ints
    folds: int
    wrong_signs: float
    seed_signs: float
    unstable: Ints
    strain: Floats
    angle_error: float
    snaps: int
    complete: bool
    touching: bool
    followed_again: int | None = None

    @property
    def is_held_back(self) -> bool:
        """Whether creases end far from what is asked of them, or the way ends early."""
        wrong = self.wrong_signs > MOST_WRONG
        return wrong or not self.complete or self.angle_error > HELD_BACK

    def is_better_than(self, other: RampVerdict) -> bool:
        """Whether the way comes nearer to what is asked of it than the ``other`` way."""
        if self.complete and self.wrong_signs <= MOST_WRONG:
            astray = not other.complete or other.wrong_signs > MOST_WRONG
            return astray or self.angle_error < other.angle_error
        return False


class AstrayError(PatternError):
    """Folds that do not go with the others; ``told`` has the names of some ``edges`` in braces."""

    def __init__(self, told: str, **edges: int) -> None:
        super().__init__(told.format(**edges))
        self.told, self.edges = told, edges

    def among(self, edges: Ints) -> PatternError:
        """The error for a pattern of which this one has the ``edges``."""
        return PatternError(self.told.format(**{k: edges[e] for k, e in self.edges.items()}))


def followed_once(verdict: RampVerdict) -> str:
    """The sentence on a sheet that was followed once; empty for another."""
    if verdict.followed_again is None:
        return ""
    fewer = f": ask for at most {verdict.followed_again} `steps`" if verdict.followed_again else ""
    return (
        " So large a sheet is followed but once, and not again in finer steps, with softer paper "
        f"or with contact{fewer}."
    )


def ramp_motion(
    pattern: CreasePattern,
    steps: int = 20,
    *,
    touching: bool = False,
    softness: float = SOFTNESS,
    finer: int = 1,
    waiting: Ints | None = None,
    on_progress: Callable[[float, str], None] | None = None,
) -> tuple[FoldingMotion, RampVerdict]:
    """The motion of ``pattern`` from flat, all creases together, and its verdict.

    With ``touching`` springs keep facets from passing through each other. ``softness`` is the
    compliance of a side over its length, in facets' stiffness k_f, and ``finer`` the number of
    steps to a frame. ``waiting`` are the :func:`waiting_folds` of the pattern, if they are known.

    ``states`` are the parts of the fold angles of the pattern that creases strive for. Creases of
    half a turn go to nine tenths of it. If the solver loses the path, the motion ends there. Raises
    :class:`~miurafab.errors.PatternError` for a pattern in which nothing folds, for one whose
    facets are too thin to bend, and for one that the solver cannot bring out of the plane.
    """
    pieces = pieces_of(pattern)
    folding = [piece for piece in pieces if has_folds(piece.pattern)]
    if not folding:
        raise PatternError(
            "The pattern has no mountain or valley between two facets, so nothing folds; give its "
            "creases the letters M and V."
        )
    if waiting is None:
        waiting = waiting_folds(pattern)
    parts = ramp_parts(pattern, steps)
    paths = []
    for number, piece in enumerate(folding):
        progress = part_of(on_progress, number, len(folding))
        path = fold_from_flat(
            piece.pattern,
            parts,
            touching=touching,
            softness=softness,
            finer=finer,
            on_progress=progress,
        )
        paths.append(path)
    count = min(len(path.frames) for path in paths)
    if not count:
        if is_ruled(pattern):
            raise _unfollowed(pattern, float(parts[1]))
        raise _stuck(paths, waiting, float(parts[1]))
    flat = np.pad(pattern.vertices_coords, ((0, 0), (0, 1)))
    frames = np.repeat(flat[None], count + 1, axis=0)
    angles = np.zeros((count + 1, len(pattern.edges_vertices)))
    for piece, path in zip(folding, paths, strict=True):
        _enter(frames, angles, piece, path)
    states = parts[: count + 1]
    frames = laid_on_each_other(pattern, states, frames)
    motion = FoldingMotion(pattern, states, frames, angles, mismatch=None, method=FROM_FLAT)
    return motion, _verdict(folding, paths, count, touching, waiting)


def _enter(frames: Floats, angles: Floats, piece: Piece, path: RampPath) -> None:
    """Put the frames of a ``path`` in their places in ``frames`` and ``angles``."""
    model = path.model
    edges = piece.edges[model.creases_edges]
    for number, frame in enumerate(path.frames[: len(frames) - 1], 1):
        frames[number, piece.vertices] = frame.points * model.unit_mm
        turned = hinge_angles(frame.points, model.creases)
        before = angles[number - 1, edges]
        angles[number, edges] = turned + 2 * np.pi * np.round((before - turned) / (2 * np.pi))


def _verdict(
    folding: list[Piece], paths: list[RampPath], count: int, touching: bool, waiting: Ints
) -> RampVerdict:
    wrong = [_wrong_edges(*pair) for pair in zip(folding, paths, strict=True)]
    folds = sum(len(path.sprung) for path in paths)
    errors = [path.angle_error * len(path.sprung) for path in paths]
    unstable = np.zeros(count + 1, dtype=np.int64)
    strain = np.zeros(count + 1)
    for path in paths:
        for number, frame in enumerate(path.frames[:count], 1):
            unstable[number] += frame.unstable
            stretched = path.model.stretched(frame.points)
            strain[number] = max(strain[number], float(np.abs(stretched).max()))
    return RampVerdict(
        wrong_edges=np.concatenate(wrong),
        waiting_edges=waiting,
        folds=folds,
        wrong_signs=sum(len(edges) for edges in wrong) / folds,
        seed_signs=sum(int(path.follow.sum()) for path in paths) / folds,
        unstable=unstable,
        strain=strain,
        angle_error=sum(errors) / folds,
        snaps=sum(path.snaps for path in paths),
        touching=touching,
        complete=all(path.converged for path in paths),
    )


def _wrong_edges(piece: Piece, path: RampPath) -> Ints:
    """The edges of the whole pattern that end with the wrong sign."""
    inner = np.flatnonzero((piece.pattern.edges_faces >= 0).all(axis=1))
    sprung = inner[np.isin(piece.pattern.edges_assignment[inner], ("M", "V"))]
    sprung = sprung[piece.pattern.edges_fold_angle[sprung] != 0]
    return np.asarray(piece.edges[sprung[path.wrong]])


def _unfollowed(pattern: CreasePattern, part: float) -> PatternError:
    """The error for a pattern with rulings that does not come to its first frame."""
    angle = part * math.degrees(float(np.abs(pattern.edges_fold_angle).max()))
    return PatternError(
        f"The sheet could not be followed to its first position, where its creases fold by up to "
        f"{angle:.0f} degrees: facets have to bend where two folds meet that are not in line, as "
        "along a curved crease, and no balance was found in which they do. Ask for more `steps`, "
        "so that it is nearer to flat, or give the creases smaller fold angles."
    )


def _stuck(paths: list[RampPath], waiting: Ints, part: float) -> PatternError:
    """The error for a pattern that is not followed to its first frame, at the ``part`` of its fold
    angles.
    """
    where = (
        f"The pattern could not be followed to its first position, at {part:.0%} of its fold angles"
    )
    if not len(waiting):
        return PatternError(
            f"{where}, though with flat facets every fold can start to the side that its letter "
            "tells: its facets have to bend or to stretch there, as in some twists, or they are "
            "very thin. Ask for more `steps`, so that it is nearer to flat, or convert the file "
            "with a larger `tolerance`, which joins lines that nearly meet."
        )
    return AstrayError(
        f"{where}: with flat facets {len(waiting)} of "
        f"its {sum(len(path.sprung) for path in paths)} folds cannot begin from flat if none shall "
        "turn to its wrong side, the first being edge {waiting}. Either letters are wrong, or its "
        "facets have to bend from the start, as in some twists, or it folds in a sequence, crease "
        "after crease, which one motion of all creases cannot show.",
        waiting=int(waiting[0]),
    )
