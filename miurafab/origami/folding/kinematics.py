"""Rigid folding: every facet stays plane and only the creases move.

At a flat-foldable vertex of degree four the tangents of the half fold angles keep their ratios
(Huffman 1976; Tachi, "Generalization of rigid foldable quadrilateral mesh origami", IASS 2009,
eqs 1-3). One number s therefore moves a whole sheet:

    rho_e(s) = 2 atan(s tan(rho_e* / 2)),    s = 0 flat, 1 the folded form, infinity flat-folded

Facets are placed breadth-first from the middle of each piece, each turned about the crease to its
parent. The other creases are not used: the distance between their two facets, the loop mismatch,
certifies that the sheet folds rigidly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from miurafab.display import Shown
from miurafab.errors import PatternError
from miurafab.geometry.arrays import Floats, Ints, nearest_to_means
from miurafab.geometry.connected import shortest_ways
from miurafab.geometry.polygons import edge_lengths, facet_means, sides_and_diagonals
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.laying import laid_on_each_other
from miurafab.origami.folding.multipliers import fold_angle_multipliers

RIGID = 1e-6
"""The loop mismatch, in mean edges, up to which a sheet folds rigidly."""

FOLDED_FLAT = np.pi - 1e-6
"""Larger fold angles in a file count as 180 degrees."""

CLOSED_FORM = "closed form"
FROM_FOLDED = "from the folded form"
FROM_FLAT = "from flat"

_POINT = 1e-6  # of the mean edge; a shorter crease has no direction


@dataclass(frozen=True, eq=False, repr=False)
class FoldingMotion(Shown):
    """A folding motion of ``pattern`` in T frames.

    Attributes
    ----------
    pattern : CreasePattern
        The pattern that folds, with V vertices and E edges.
    states : (T,) float64
        The state s of each frame: 0 is flat, 1 the folded form, infinity folded flat. Of a motion
        from flat, the part of the fold angles that the creases strive for.
    frames : (T, V, 3) float64
        The vertices in each frame, mm.
    fold_angles : (T, E) float64
        Radians from flat, positive for a valley.
    mismatch : (T,) float64 or None
        The loop mismatch of each frame in mean edges; None where facets bend, so that loops close
        by construction.
    method : str
        How it was found: :data:`CLOSED_FORM`, :data:`FROM_FOLDED` by bending the facets of the
        folded form, or :data:`FROM_FLAT` by turning all creases together.
    """

    pattern: CreasePattern
    states: Floats
    frames: Floats
    fold_angles: Floats
    mismatch: Floats | None
    method: str = CLOSED_FORM

    def _summary(self) -> str:
        kind = "bending" if self.mismatch is None else "rigid" if self.is_rigid else "not rigid"
        return f"{kind}, {len(self.frames)} frames of {len(self.pattern.faces_vertices)} facets"

    @property
    def is_rigid(self) -> bool:
        """Whether every facet stays plane and every loop closes, to :data:`RIGID`."""
        return self.mismatch is not None and bool(self.mismatch.max(initial=0.0) <= RIGID)


@dataclass(frozen=True, eq=False)
class FacetPlacement:
    """The places of the facets in T frames: a flat point p of facet f goes to turn p + shift.

    ``turn`` (T, F, 3, 3) and ``shift`` (T, F, 3) float64; the facet in the middle of each piece
    keeps its place. ``depth`` (F,) int64 is the number of creases between a facet and that facet.
    """

    turn: Floats
    shift: Floats
    depth: Ints

    def points(self, flat: Floats, facets: Ints) -> Floats:
        """(T, n, 3) the places of the points ``flat`` (n, 2) of ``facets`` (n,)."""
        moved = np.einsum("tnij,nj->tni", self.turn[:, facets, :, :2], flat)
        return np.asarray(moved + self.shift[:, facets])


def rigid_motion(pattern: CreasePattern, states: ArrayLike) -> FoldingMotion:
    """The rigid motion of ``pattern`` through ``states`` (T,) of s, each in [0, infinity].

    :mod:`miurafab.origami.folding.laying` says where the frames lie.

    Raises :class:`~miurafab.errors.PatternError` if the facets of a piece are not all joined by
    creases.
    """
    s = np.atleast_1d(np.asarray(states, dtype=np.float64))
    if not (s >= 0).all():
        raise PatternError("A state of folding is a number from 0, flat, to infinity, flat-folded.")
    angles = fold_angles_at(pattern, s)
    placement = place(pattern, angles)
    frames = placement.points(pattern.vertices_coords, first_facets(pattern, placement.depth))
    laid = laid_on_each_other(pattern, s, frames)
    return FoldingMotion(pattern, s, laid, angles, loop_mismatch(pattern, placement, angles))


def fold_angles_at(pattern: CreasePattern, states: Floats) -> Floats:
    """(T, E) the fold angles at ``states`` (T,) of s, by the closed form, radians."""
    half = half_tangents(pattern)
    moving = half != 0.0
    angles = np.zeros((len(states), len(half)))
    angles[:, moving] = 2 * np.arctan(states[:, None] * half[moving])
    return angles


def half_tangents(pattern: CreasePattern) -> Floats:
    """(E,) tan(rho / 2) of each crease at s = 1.

    In formats that tell only mountains from valleys all fold angles are 180 degrees. For such a
    pattern the median crease has 90 degrees at s = 1, and the others follow from the sector angles
    (:mod:`miurafab.origami.folding.multipliers`).
    """
    target = pattern.edges_fold_angle
    folding = np.abs(target[target != 0.0])
    if len(folding) and (folding > FOLDED_FLAT).all():
        return fold_angle_multipliers(pattern)
    # tan() changes sign beyond a half turn, so fold angles stay just below it
    return np.asarray(np.tan(np.clip(target, -np.pi + 1e-15, np.pi - 1e-15) / 2))


def _nothing_folds(pattern: CreasePattern) -> PatternError:
    free = int((pattern.edges_creased & (pattern.edges_assignment == "U")).sum())
    if not free:
        return PatternError("No crease of the pattern has a fold angle, so nothing folds.")
    return PatternError(
        f"All {free} creases of the pattern are unassigned (U), so it is not known to which side "
        "they fold: give mountains the letter M and valleys V. 'miurafab layers' looks for the "
        "ways to fold it flat."
    )


def states_between(pattern: CreasePattern, steps: int, last: float = np.inf) -> Floats:
    """(steps + 1,) states from flat through 1 to ``last``, in even steps of the median fold angle.

    s = tan(phi / 2) / tan(phi* / 2) with phi* the median fold angle of the creases that fold. The
    state 1 is one of them if ``last`` is 1 or more and there are at least two steps.
    """
    half = np.abs(half_tangents(pattern))
    if not (half > 0).any():
        raise _nothing_folds(pattern)
    speed = float(np.median(half[half > 0]))
    middling, end = 2 * np.arctan(speed), 2 * np.arctan(last * speed)
    if last <= 1.0 or steps < 2:
        phi = np.linspace(0.0, end, steps + 1)
    else:
        before = int(np.clip(round(steps * middling / end), 1, steps - 1))
        phi = np.concatenate(
            [
                np.linspace(0.0, middling, before + 1),
                np.linspace(middling, end, steps - before + 1)[1:],
            ]
        )
    states = np.tan(phi / 2) / speed
    states[phi == middling] = 1.0
    states[-1] = last
    return np.asarray(states, dtype=np.float64)


def place(
    pattern: CreasePattern, fold_angles: Floats, axes: Floats | None = None
) -> FacetPlacement:
    """The placement of all facets in T frames with the creases at ``fold_angles`` (T, E), radians.

    The facets turn about their creases, or about axes at the heights ``axes`` (E,) over them, mm.

    Raises :class:`~miurafab.errors.PatternError` if the facets of a piece are not all joined by
    creases.
    """
    frames, facets = len(fold_angles), len(pattern.faces_vertices)
    before, crease, depth = facet_tree(pattern)
    turn = np.empty((frames, facets, 3, 3))
    shift = np.empty((frames, facets, 3))
    root = depth == 0
    turn[:, root], shift[:, root] = np.eye(3), 0.0
    tail = pattern.vertices_coords[pattern.edges_vertices[:, 0]]
    along = pattern.vertices_coords[pattern.edges_vertices[:, 1]] - tail
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    for level in range(1, int(depth.max()) + 1):
        here = np.flatnonzero(depth == level)
        parent, edge = before[here], crease[here]
        # about the edge, a valley turns the right facet's normal backwards and the left's forwards
        sign = np.where(pattern.edges_faces[edge, 0] == parent, -1.0, 1.0)
        rotation = _rotations(along[edge], sign * fold_angles[:, edge])
        hinge = np.pad(tail[edge], ((0, 0), (0, 1)))
        if axes is not None:
            hinge[:, 2] = axes[edge]
        slip = hinge - np.einsum("tnij,nj->tni", rotation, hinge)
        turn[:, here] = turn[:, parent] @ rotation
        shift[:, here] = shift[:, parent] + np.einsum("tnij,tnj->tni", turn[:, parent], slip)
    return FacetPlacement(turn, shift, depth)


def loop_mismatch(pattern: CreasePattern, placement: FacetPlacement, fold_angles: Floats) -> Floats:
    """(T,) by how far facets at ``fold_angles`` (T, E) miss each other across a crease, mean edges.

    That is the largest distance of two facets at the ends of their crease, or beside it: of a point
    as far from the crease as that is long, placed by one facet, and by the other turned by the fold
    angle. Where creases in one line turn alone, all ends meet, and the others do not fold.
    """
    joined = _joined(pattern)
    ends = pattern.vertices_coords[pattern.edges_vertices[joined]]
    left, right = pattern.edges_faces[joined].T
    gaps = [placement.points(at, left) - placement.points(at, right) for at in ends.swapaxes(0, 1)]
    along = ends[:, 1] - ends[:, 0]
    beside = np.stack([-along[:, 1], along[:, 0]], axis=1)
    angle = fold_angles[:, joined]
    turned = np.empty((*angle.shape, 3))
    turned[..., :2] = np.cos(angle)[..., None] * beside
    turned[..., 2] = -np.sin(angle) * np.linalg.norm(along, axis=1)
    turns = placement.turn
    gaps.append(
        np.einsum("tnij,tnj->tni", turns[:, left], turned)
        - np.einsum("tnij,nj->tni", turns[:, right, :, :2], beside)
    )
    mean = float(edge_lengths(pattern.vertices_coords, pattern.edges_vertices).mean())
    return np.asarray(np.linalg.norm(gaps, axis=3).max(axis=(0, 2), initial=0.0) / mean)


def facet_strain(pattern: CreasePattern, frames: Floats) -> Floats:
    """(T, F) the largest relative change of each facet's sides and diagonals, from flat.

    ``frames`` (T, V, 3). Bending counts as well as stretching, since a bent quadrilateral has a
    shorter diagonal. Changes of short lengths are relative to a hundredth of the mean edge.
    """
    faces = pattern.faces_vertices
    least = 0.01 * float(edge_lengths(pattern.vertices_coords, pattern.edges_vertices).mean())
    worst = np.zeros((len(frames), len(faces)))
    for facets, ends in sides_and_diagonals(faces):
        flat = edge_lengths(pattern.vertices_coords, ends)
        length = np.linalg.norm(frames[:, ends[:, 1]] - frames[:, ends[:, 0]], axis=2)
        change = np.abs(length - flat) / np.maximum(flat, least)
        worst[:, facets] = np.maximum(worst[:, facets], change)
    return worst


def _rotations(axis: Floats, angle: Floats) -> Floats:
    """(T, n, 3, 3) turns by ``angle`` (T, n) about the unit ``axis`` (n, 2) in the plane z = 0."""
    x, y = axis[:, 0], axis[:, 1]
    c, s = np.cos(angle), np.sin(angle)
    k = 2 * np.sin(angle / 2) ** 2
    rows = (c + k * x * x, k * x * y, s * y, k * x * y, c + k * y * y, -s * x, -s * y, s * x, c)
    return np.stack(rows, axis=-1).reshape(*angle.shape, 3, 3)


def _joined(pattern: CreasePattern) -> Ints:
    """The edges that join two facets and are not cut."""
    inner = (pattern.edges_faces >= 0).all(axis=1)
    return np.flatnonzero(inner & ~np.isin(pattern.edges_assignment, ("B", "C")))


def facet_tree(pattern: CreasePattern) -> tuple[Ints, Ints, Ints]:
    """Breadth-first over the facets from the middle of each piece: (F,) the parent of each facet,
    the crease between them, and the number of creases from the middle.
    """
    facets = len(pattern.faces_vertices)
    joined = _joined(pattern)
    lengths = edge_lengths(pattern.vertices_coords, pattern.edges_vertices)
    joined = joined[lengths[joined] > _POINT * lengths.mean()]
    left, right = pattern.edges_faces[joined].T
    distance, previous, link = shortest_ways(
        facets, left, right, np.ones(len(joined)), _middles(pattern)
    )
    if np.isinf(distance).any():
        loose = int(np.isinf(distance).sum())
        raise PatternError(
            f"{loose} of {facets} facets are joined to the rest by no crease, so the pattern "
            "cannot be folded as one sheet."
        )
    crease = np.zeros(facets, dtype=np.int64)  # the first facets hang on none
    crease[link >= 0] = joined[link[link >= 0]]
    return previous, crease, distance.astype(np.int64)


def _middles(pattern: CreasePattern) -> Ints:
    """The facet of each piece nearest to the middle of the piece when flat."""
    means = facet_means(pattern.vertices_coords, pattern.faces_vertices)
    number = np.zeros(len(means), dtype=np.int64) if pattern.pieces is None else pattern.pieces
    return nearest_to_means(means, number)


def first_facets(pattern: CreasePattern, depth: Ints) -> Ints:
    """(V,) the facet of each vertex nearest to the middle; refuses vertices of no facet."""
    faces = pattern.faces_vertices
    facet, corner = np.nonzero(faces >= 0)
    outward = np.argsort(-depth[facet], kind="stable")
    first = np.full(len(pattern.vertices_coords), -1, dtype=np.int64)
    first[faces[facet[outward], corner[outward]]] = facet[outward]
    loose = np.flatnonzero(first < 0)
    if len(loose):
        raise PatternError(f"Vertex {loose[0]} of the pattern belongs to no facet.")
    return first
