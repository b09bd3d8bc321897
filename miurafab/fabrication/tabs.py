"""Glue tabs: a tab is a part of the facet to which it is glued.

The paper continues across a seam. So the tab on seam edge e of patch A, glued to facet g of patch
B, is drawn where g lies in the flat pattern; if the seam joins two borders of the sheet, where g
lies after it is moved to e. The tab is the set of points x of g with

    0 <= d_e(x) <= height,    d_k(x) >= inset  for every other side k of g,
    d_k(x) - d_e(x) >= inset |n_k - n_e|  for every other side k of g that bears a tab too,

where d_k is the inward distance from the line of side k and n_k its inward normal. The last line
splits g on the bisector of its two seam edges. So a tab touches only its own seam edge, both in the
flat pattern and, after folding, inside g. It crosses no crease, because a facet has none. For a
facet that is not convex the region is smaller than possible, but valid.

A largest angle at the base bounds the tab by two lines through the ends of the base at that angle.
It is 90 degrees for a raised tab, which so is nowhere wider than its base. No tab is higher than
``SLENDER`` times its base. A full-facet tab has none of these limits.

The base of a tab is the part of e on which it stands; it is the fold of the tab, and the rest of e
is cut. The fold has the assignment of the crease along the seam.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from miurafab.fabrication.seams import Seams
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.polygons import edge_lengths, signed_areas
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import Material

MIN_BASE_MM = 2.5
"""A tab with a shorter base tears at its root, and a slender one may catch fire (judged)."""

SLENDER = 2.0
"""The height of a tab over its base, at most; a higher one bends or tears at its root (judged)."""

MIN_SIDE_MM = 1.0
"""A tab with a smaller mean height cannot be handled (judged)."""

RAISED = 2.0
"""The height of a raised tab over the standard height, at most; weak tabs are raised (judged)."""

FOLDS = {"M": "mountain", "V": "valley", "U": "unassigned"}
"""The fold of a tab by the assignment of its edge; flat for other assignments."""

NO_LIMIT = -1e12
"""A limit below every p·n in mm; finite, so that differences of depths are finite."""


@dataclass(frozen=True, eq=False)
class Tab:
    """A tab of one patch. ``label`` (:mod:`~miurafab.fabrication.seam_names`) is engraved on both
    sides of the seam; ``number`` counts the tabs of the model. ``edge`` is the pattern edge on
    which the tab stands and ``mate_edge`` the edge that it is joined to: the same edge,
    unless two borders of the pattern are joined. ``mate_patch`` is the id of the patch to which it
    is glued; both are None on an open border. ``polygon_mm`` (n, 2) is its outline in the patch
    frame, counter-clockwise from the base. ``fold`` is one of :data:`FOLDS`, or flat. ``join`` is
    what holds it: ``glue`` on the facet over it, ``slots``, or ``double``, the tab of the other
    side.
    """

    number: int
    label: str
    edge: int
    mate_edge: int | None
    mate_patch: int | None
    polygon_mm: Floats
    fold: str
    join: str


@dataclass(frozen=True, eq=False)
class TabRegions:
    """N tabs in the plane of the pattern, on ``seams`` (N). ``points`` (N, m, 2) in mm are their
    corners, counter-clockwise from the base; the first ``count`` (N,) corners of each are real,
    none if there is no region. ``glued`` (N, m, 2) are the same corners in the facet to which the
    tab is glued; they mean nothing on an open border.
    """

    seams: Seams
    points: Floats
    glued: Floats
    count: Ints

    def __len__(self) -> int:
        return len(self.count)

    @property
    def edge(self) -> Ints:
        """(N,) the pattern edge on which each tab stands."""
        return self.seams.edges[:, 0]

    @property
    def own_face(self) -> Ints:
        """(N,) the facet that bears each tab."""
        return self.seams.faces[:, 0]

    @property
    def mate_face(self) -> Ints:
        """(N,) the facet to which each tab is glued, -1 on an open border."""
        return self.seams.faces[:, 1]

    def polygon(self, index: int | np.integer) -> Floats:
        """(n, 2) corners of one tab."""
        return self.points[index, : self.count[index]]

    def take(self, which: Ints | Bools) -> TabRegions:
        """The tabs that ``which`` picks."""
        points, glued = self.points[which], self.glued[which]
        return TabRegions(self.seams.take(which), points, glued, self.count[which])

    def joined(self, others: TabRegions) -> TabRegions:
        """These tabs and then ``others``."""
        slots = max(self.points.shape[1], others.points.shape[1])

        def wide(points: Floats) -> Floats:
            return np.pad(points, ((0, 0), (0, slots - points.shape[1]), (0, 0)))

        return TabRegions(
            self.seams.joined(others.seams),
            np.concatenate([wide(self.points), wide(others.points)]),
            np.concatenate([wide(self.glued), wide(others.glued)]),
            np.concatenate([self.count, others.count]),
        )

    @property
    def present(self) -> Bools:
        """(N, m) whether each corner is real."""
        return np.arange(self.points.shape[1]) < self.count[:, None]

    @property
    def areas(self) -> Floats:
        """(N,) glue areas in mm²."""
        ahead = np.where(self.present[..., None], self.points, self.points[:, :1])
        return signed_areas(ahead)

    @property
    def usable(self) -> Bools:
        """(N,) whether each tab is long and large enough to hold."""
        base = np.linalg.norm(self.points[:, 1] - self.points[:, 0], axis=1)
        large = (base >= MIN_BASE_MM) & (self.areas >= MIN_SIDE_MM * base)
        return np.asarray(large & (self.count >= 3))

    @property
    def glue(self) -> Floats:
        """(N,) glue areas in mm², 0 for tabs that are not usable."""
        return np.where(self.usable, self.areas, 0.0)


def inset_of(material: Material) -> float:
    """The inset in mm of tabs of ``material``; large enough to keep the cuts on both sides of a
    notch apart.
    """
    return max(material.tabs.inset_mm, material.kerf_mm + 0.05)


def tab_regions(
    pattern: CreasePattern,
    seams: Seams,
    material: Material,
    bearing: Bools | None = None,
    *,
    full_facet: bool = False,
    raised: Bools | None = None,
) -> TabRegions:
    """The tabs on N ``seams``; tabs that are ``raised`` (N,) may be :data:`RAISED` times as high as
    the material's, with angles up to 90 degrees at the base.

    ``bearing`` (F, k) marks the sides of each facet inside which a tab is glued; these tabs share
    the facet. Without it every tab is computed as if it were alone, which only makes it larger.
    """
    mate, count = seams.faces[:, 1], len(seams)
    ends_of = pattern.edges_vertices[seams.edges[:, 1]]
    a, _, frame = edge_axes(pattern, seams.edges[:, 1], mate)

    corners = pattern.faces_vertices[mate]
    real = corners >= 0
    following = np.roll(corners, -1, axis=1)
    last = real & ~np.pad(real, ((0, 0), (0, 1)))[:, 1:]
    following = np.where(last, corners[:, :1], following)
    local = np.einsum("nij,nkj->nki", frame, pattern.vertices_coords[corners] - a[:, None])
    ahead = np.einsum("nij,nkj->nki", frame, pattern.vertices_coords[following] - a[:, None])
    step = ahead - local
    size = np.linalg.norm(step, axis=2)
    step /= np.where(size > 0, size, 1.0)[..., None]
    normal = np.stack([-step[..., 1], step[..., 0]], axis=-1)
    offset = np.einsum("nki,nki->nk", normal, local)

    inset = inset_of(material)
    other = real & (pattern.faces_edges[mate] != seams.edges[:, 1:])
    reach = np.abs(local).max(axis=(1, 2)) + 1.0
    asked = np.full(count, material.tabs.height_mm)
    if raised is not None:
        asked[raised] *= RAISED
    height = reach if full_facet else asked
    zero = np.zeros(count)
    points = np.stack(
        [
            np.column_stack([-reach, zero]),
            np.column_stack([reach, zero]),
            np.column_stack([reach, height]),
            np.column_stack([-reach, height]),
        ],
        axis=1,
    )
    sides = np.full(count, 4)
    for k in range(corners.shape[1]):
        limit = np.where(other[:, k], offset[:, k] + inset, NO_LIMIT)
        points, sides = clip_convex(points, sides, normal[:, k], limit)
        if bearing is None:
            continue
        towards = normal[:, k] - np.array([0.0, 1.0])
        shared = other[:, k] & bearing[mate, k]
        limit = offset[:, k] + inset * np.linalg.norm(towards, axis=1)
        points, sides = clip_convex(points, sides, towards, np.where(shared, limit, NO_LIMIT))
    sides = with_base(points, sides)
    # If the facet is not convex at an end of its side, the line of the side continues inside it;
    # what is found there stands wholly beside the side.
    length = edge_lengths(pattern.vertices_coords, ends_of)
    middle = (points[:, 0, 0] + points[:, 1, 0]) / 2
    sides = np.where((middle > 0) & (middle < length), sides, 0)
    if not full_facet:
        largest = np.full(count, material.tabs.max_angle)
        if raised is not None:
            largest[raised] = math.pi / 2
        points, sides = not_steeper(points, sides, largest)
        points, sides = not_slender(points, sides)
    return in_plane(pattern, seams, points, sides)


def in_plane(pattern: CreasePattern, seams: Seams, points: Floats, count: Ints) -> TabRegions:
    """The tabs whose corners are ``points`` (N, m, 2) in the frame of the side that they are joined
    to: x along it from its first end, y into its facet.
    """
    a, _, frame = edge_axes(pattern, seams.edges[:, 1], seams.faces[:, 1])
    glued = placed = a[:, None] + np.einsum("nij,nki->nkj", frame, points)
    if (seams.edges[:, 0] != seams.edges[:, 1]).any():
        # The side of the facet that bears the tab runs the opposite way.
        _, a, frame = edge_axes(pattern, seams.edges[:, 0], seams.faces[:, 0])
        placed = a[:, None] - np.einsum("nij,nki->nkj", frame, points)
    return TabRegions(seams, placed, glued, count)


def in_mate(pattern: CreasePattern, tabs: TabRegions) -> Floats:
    """(N, m, 2) the corners of ``tabs`` in the frame of :func:`in_plane`."""
    a, _, frame = edge_axes(pattern, tabs.seams.edges[:, 1], tabs.mate_face)
    return np.asarray(np.einsum("nij,nkj->nki", frame, tabs.glued - a[:, None]))


def edge_axes(pattern: CreasePattern, edges: Ints, faces: Ints) -> tuple[Floats, Floats, Floats]:
    """For each of ``edges`` (N,) with its facet in ``faces`` (N,) on the left: its first and last
    ends (N, 2), and the unit vectors along it and into the facet (N, 2, 2).
    """
    row = np.arange(len(edges))
    backwards = (pattern.edges_faces[edges, 0] != faces).astype(np.int64)
    ends = pattern.vertices_coords[pattern.edges_vertices[edges]]
    start, end = ends[row, backwards], ends[row, 1 - backwards]
    along = end - start
    length = np.linalg.norm(along, axis=1)
    along /= np.where(length > 0, length, 1.0)[:, None]
    return start, end, np.stack([along, np.column_stack([-along[:, 1], along[:, 0]])], axis=1)


def not_steeper(points: Floats, count: Ints, angle: Floats) -> tuple[Floats, Ints]:
    """The polygons, on the base y = 0, with inner angles at the base cut to at most ``angle`` (N,)
    radians.
    """
    c, s = np.cos(angle), np.sin(angle)
    row = np.arange(len(points))
    for end, normal in ((0, np.column_stack([s, -c])), (1, np.column_stack([-s, -c]))):
        beyond = points[row, 2 if end else count - 1]
        limit = np.einsum("nk,nk->n", points[:, end], normal)
        # Only sides that are too steep are cut: elsewhere the clip would double the corner.
        steep = (count >= 3) & (np.einsum("nk,nk->n", beyond, normal) < limit - 1e-9)
        points, count = clip_convex(points, count, normal, np.where(steep, limit + 1e-9, NO_LIMIT))
        count = with_base(points, count)
    return points, count


def not_slender(points: Floats, count: Ints) -> tuple[Floats, Ints]:
    """The polygons, on the base y = 0, cut to :data:`SLENDER` times their base."""
    limit = SLENDER * (points[:, 1, 0] - points[:, 0, 0])
    down = np.broadcast_to(np.array([0.0, -1.0]), (len(points), 2))
    return clip_convex(points, count, down, -limit)


def clip_convex(points: Floats, count: Ints, normal: Floats, limit: Floats) -> tuple[Floats, Ints]:
    """The parts p·n >= limit of N convex polygons ``points`` (N, m, 2) of ``count`` corners.

    Each corner hands on itself if it is inside, and the crossing on the side that follows it if
    there is one (Sutherland and Hodgman 1974), for all polygons at once.
    """
    rows, slots = points.shape[:2]
    slot = np.arange(slots)
    real = slot < count[:, None]
    following = np.where(slot + 1 < count[:, None], slot + 1, 0)
    depth = np.einsum("nki,ni->nk", points, normal) - limit[:, None]
    inside = depth >= 0
    ahead = np.take_along_axis(points, following[..., None], axis=1)
    ahead_depth = np.take_along_axis(depth, following, axis=1)
    crossed = real & (inside != np.take_along_axis(inside, following, axis=1))
    part = np.divide(depth, depth - ahead_depth, out=np.zeros_like(depth), where=crossed)
    crossing = points + part[..., None] * (ahead - points)

    handed = np.stack([points, crossing], axis=2).reshape(rows, 2 * slots, 2)
    kept = np.stack([real & inside, crossed], axis=2).reshape(rows, 2 * slots)
    order = np.argsort(~kept, axis=1, kind="stable")
    total = kept.sum(axis=1)
    width = max(int(total.max(initial=0)), 3)
    order = order[:, :width]
    return np.take_along_axis(handed, order[..., None], axis=1), total


def with_base(points: Floats, count: Ints) -> Ints:
    """The ``count`` of corners of the polygons that still have their base, the first two corners on
    y = 0; 0 for the others. A clip cuts the base at its ends, or takes all of it.
    """
    based = (count >= 3) & (points[:, :2, 1] == 0.0).all(axis=1)
    return np.where(based, count, 0)
