"""Seams: the pairs of facet sides that are glued together.

Some seams lie within a piece of the pattern: an edge between two facets of different patches, one
of which bears a tab. Others join two edges of the border: two pieces, or a folded form that closes
upon itself (a ring, a tube). A pattern names these pairs (``CreasePattern.seams``). If it names
none, as in the files of other programs, they are the borders that meet in the folded form
(:mod:`~miurafab.origami.meeting_borders`).

The crease of such a seam has the angle between its two facets. It is a valley if they close on the
printed side, the side from which the flat pattern is seen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.connected import components
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.meeting_borders import (
    border_angles,
    meeting_borders,
    with_facet_on_the_left,
)
from miurafab.origami.unfold import FLAT_ANGLE


@dataclass(frozen=True, eq=False)
class Seams:
    """S seams. ``edges`` (S, 2) int64 are the pattern edges that are joined (the same edge twice
    within the pattern), and ``faces`` (S, 2) their facets: column 0 bears the tab, column 1 is the
    facet to which it is glued. ``fold`` (S,) is the assignment of the crease.
    """

    edges: Ints
    faces: Ints
    fold: NDArray[np.str_]

    def __len__(self) -> int:
        return len(self.edges)

    def swapped(self, which: Bools) -> Seams:
        """The seams, with the tab on the other side for those of ``which`` (S,)."""
        turn = which[:, None]
        return Seams(
            np.where(turn, self.edges[:, ::-1], self.edges),
            np.where(turn, self.faces[:, ::-1], self.faces),
            self.fold,
        )

    def take(self, which: Ints | Bools) -> Seams:
        """The seams chosen by ``which``."""
        return Seams(self.edges[which], self.faces[which], self.fold[which])

    def joined(self, others: Seams) -> Seams:
        """These seams and then ``others``."""
        return Seams(
            np.concatenate([self.edges, others.edges]),
            np.concatenate([self.faces, others.faces]),
            np.concatenate([self.fold, others.fold]),
        )


def inner_seams(pattern: CreasePattern, edges: Ints, sides: Ints) -> Seams:
    """The seams on ``edges`` (S,) between two facets; ``edges_faces[edge, side]`` is the facet to
    which the tab is glued.
    """
    mate = pattern.edges_faces[edges, sides]
    own = pattern.edges_faces[edges, 1 - sides]
    return Seams(
        np.column_stack([edges, edges]),
        np.column_stack([own, mate]),
        pattern.edges_assignment[edges],
    )


def all_seams(pattern: CreasePattern, face_patch: Ints) -> Seams:
    """The seams of ``face_patch`` (F,): first within pieces, then between borders."""
    faces = pattern.edges_faces
    patch = np.where(faces >= 0, face_patch[faces], -1)
    seam = (faces >= 0).all(axis=1) & (patch[:, 0] != patch[:, 1])
    edges = np.flatnonzero(seam & (pattern.edges_assignment != "C"))
    return inner_seams(pattern, edges, np.ones_like(edges)).joined(border_seams(pattern))


def border_seams(pattern: CreasePattern) -> Seams:
    """The pairs of border edges that are glued, in the order of the lower edge."""
    pairs = meeting_borders(pattern) if pattern.seams is None else np.sort(pattern.seams, axis=1)
    pairs = pairs[np.argsort(pairs[:, 0])]
    faces = pattern.edges_faces[pairs].max(axis=2)
    if pattern.folded_coords is None:
        return Seams(pairs, faces, np.full(len(pairs), "U"))
    angle = border_angles(pattern, pairs)
    fold = np.select([angle > FLAT_ANGLE, angle < -FLAT_ANGLE], ["V", "M"], "F")
    return Seams(pairs, faces, fold)


def seam_angles(pattern: CreasePattern, seams: Seams) -> Floats:
    """(S,) the fold angles along ``seams`` in radians, without their signs; 0 where the pattern
    does not say them.
    """
    first = seams.edges[:, 0]
    angle = np.nan_to_num(np.abs(pattern.edges_fold_angle[first]))
    joined = np.flatnonzero((seams.edges[:, 1] >= 0) & (first != seams.edges[:, 1]))
    if len(joined) and pattern.folded_coords is not None:
        angle[joined] = np.abs(border_angles(pattern, np.sort(seams.edges[joined], axis=1)))
    return angle


def with_seams(pattern: CreasePattern) -> CreasePattern:
    """``pattern`` with its seams named, found in the folded form if need be."""
    if pattern.seams is not None:
        return pattern
    return replace(pattern, seams=border_seams(pattern).edges)


def shell_points(pattern: CreasePattern, seams: Seams) -> Ints:
    """(V,) the number of the point of the shell at each vertex: those of ``seams`` come together.

    Facets run along their seam in opposite directions.
    """
    ends = [with_facet_on_the_left(pattern, seams.edges[:, side]) for side in (0, 1)]
    one, other = ends[0].ravel(), ends[1][:, ::-1].ravel()
    return components(len(pattern.vertices_coords), one, other)
