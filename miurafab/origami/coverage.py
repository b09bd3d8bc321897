"""How much of the target a sheet covers, and how much of the sheet reaches beyond the target.

The sheet is *pressed* onto the target: each vertex p with nearest point q on the target goes to q.
Where q lies on the border of the target, p may lie beyond it; then p loses its height alone,

    p - ((p - q) . n) n,    n the normal of the target at q.

So the height of the corrugation does not count. Pieces are glued where their vertices meet. The
border of a pressed sheet zig-zags about its mean course, so it is straightened: a border vertex x
between its neighbours a and b moves to (a + 2 x + b) / 4, which cancels a zig-zag exactly.

A point of one surface is *beyond* another if the nearest point of that lies on its border. Then

    coverage = share of the target's area that is not beyond the pressed sheet,
    overhang = share of the pressed sheet's area that is beyond the target.

A point of the target that is farther from the pressed sheet than the part there is long is not
covered either: a sheet on one turn of a spiral does not cover the next.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from miurafab.geometry.arrays import Bools, Floats, Ints, vector_product
from miurafab.geometry.distances import MeshTrees
from miurafab.geometry.hausdorff import in_four
from miurafab.geometry.nearest import tree_of
from miurafab.geometry.polygons import facet_means, next_corners
from miurafab.origami.crease_pattern import CreasePattern

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

SAMPLES = 4_000
"""The least number of parts that an area is divided into to be judged."""

MOST_SAMPLES = 40_000
BORDER_POINTS = 1_000
FINER_RIM = 16
"""Parts at the border are smaller by this factor: whether they are beyond is decided there."""

WELD = 1e-6
"""Border vertices closer than this part of the mean edge are glued."""

_ON_SIDE = 1e-6
_CLEAR = 10 * _ON_SIDE


@dataclass(frozen=True)
class Coverage:
    """Shares between 0 and 1, and the area of the pressed sheet in the unit of the target."""

    covered: float
    overhang: float
    area: float


def coverage(pattern: CreasePattern, tiles: Floats) -> Coverage:
    """How the folded ``pattern`` covers the target of these ``tiles`` (n, 3, 3), in its frame."""
    assert pattern.folded_coords is not None
    target = Shell.of_triangles(tiles)
    sheet, facet, normals = pressed(pattern, target)
    return Coverage(
        1 - _share(target, _missed, sheet, float(sheet.longest.min())),
        _share(sheet, _beyond, target, math.inf),
        _area_of_pieces(pattern, sheet.triangles, facet, normals),
    )


def uncovered(pattern: CreasePattern, tiles: Floats, points: Floats) -> Bools:
    """(n,) whether the folded ``pattern`` leaves ``points`` (n, 3) of the target of these ``tiles``
    uncovered, all in the frame of the target.
    """
    return _missed(pressed(pattern, Shell.of_triangles(tiles))[0], points)


def _missed(sheet: Shell, points: Floats) -> Bools:
    """(n,) which of ``points`` (n, 3) of the target the pressed ``sheet`` does not cover."""
    feet, triangle = sheet.trees.closest(points)
    gap = np.linalg.norm(feet - points, axis=1)
    return np.asarray(sheet.on_border(feet, triangle) | (gap > sheet.longest[triangle]))


def _beyond(target: Shell, points: Floats) -> Bools:
    """(n,) which of ``points`` (n, 3) of the pressed sheet lie beyond the ``target``."""
    return target.on_border(*target.trees.closest(points))


@dataclass(frozen=True, eq=False)
class Shell:
    """Triangles (n, 3, 3) in space and their border: ``sides`` (n, 3) says which of the sides from
    each corner to the next lie on it, ``corners`` (n, 3) which of the corners.
    """

    triangles: Floats
    sides: Bools
    corners: Bools

    @classmethod
    def of_triangles(cls, triangles: Floats) -> Shell:
        """Triangles that meet side to side; those without an area are left out."""
        size = float(np.linalg.norm(np.ptp(triangles.reshape(-1, 3), axis=0)))
        lengths = np.linalg.norm(_sides(triangles), axis=2)
        doubled = 2 * np.linalg.norm(_area_vectors(triangles), axis=1)
        triangles = triangles[doubled > 1e-12 * size * lengths.max(axis=1)]
        index = _welded(triangles.reshape(-1, 3), 1e-9 * size).reshape(-1, 3)
        return cls.of_indices(triangles, index, index, np.roll(index, -1, axis=1))

    @classmethod
    def of_indices(cls, triangles: Floats, index: Ints, tails: Ints, heads: Ints) -> Shell:
        """Triangles with corners ``index`` (n, 3); a side (tail, head) that comes once is border;
        a tail of -1 is no side that counts.
        """
        real = tails >= 0
        count = int(index.max()) + 1
        key = np.where(real, np.minimum(tails, heads) * count + np.maximum(tails, heads), -1)
        _, place, uses = np.unique(key, return_inverse=True, return_counts=True)
        sides = real & (uses[place.reshape(key.shape)] == 1)
        at_border = np.zeros(count, dtype=bool)
        at_border[tails[sides]] = at_border[heads[sides]] = True
        return cls(triangles, sides, (index >= 0) & at_border[index])

    @cached_property
    def longest(self) -> Floats:
        """(n,) the longest side of each triangle."""
        return np.asarray(np.linalg.norm(_sides(self.triangles), axis=2).max(axis=1))

    @cached_property
    def trees(self) -> MeshTrees:
        """The search of nearest triangles."""
        return MeshTrees.of(self.triangles)

    @cached_property
    def along_border(self) -> tuple[cKDTree, float]:
        """The tree of points along the border, ends of sides among them, and the largest distance
        between neighbours. Let d be the distance of a point p to the nearest of them, and h that
        between neighbours; then p is not nearer to the border than (d^2 - h^2 / 4)^(1/2).
        """
        triangle, corner = np.nonzero(self.sides)
        tails, heads = (self.triangles[triangle, (corner + k) % 3] for k in (0, 1))
        lengths = np.linalg.norm(heads - tails, axis=1)
        count = np.ceil(lengths / (lengths.sum() / BORDER_POINTS)).astype(int)
        side = np.repeat(np.arange(len(count)), count)
        at = (np.arange(len(side)) - np.repeat(np.cumsum(count) - count, count)) / count[side]
        points = tails[side] + at[:, None] * (heads - tails)[side]
        return tree_of(np.concatenate([points, heads])), float((lengths / count).max())

    def surely_covers(self, parts: Floats, reach: float) -> Bools:
        """(k,) which of the triangles ``parts`` (k, 3, 3) have no point that is beyond this shell,
        or farther from it than ``reach``.

        Let q be a point of the shell near to the centre of a part. For each point b of the
        border, |p - b|^2 - |p - q|^2 is linear in p. So the least of them over all b is concave,
        and over a part it is least at a corner. Where it is positive at the three corners, each
        point of the part has q nearer than the border.
        """
        feet = np.repeat(self.trees.near(parts.mean(axis=1)), 3, axis=0)
        corners = parts.reshape(-1, 3)
        squared = ((corners - feet) ** 2).sum(axis=1)
        covered = squared < reach**2
        if self.sides.any():
            tree, apart = self.along_border
            beyond = tree.query(corners)[0]
            margin = (apart / 2) ** 2 + _CLEAR * self.longest.max() * beyond
            covered &= beyond**2 - squared > margin
        return np.asarray(covered.reshape(-1, 3).all(axis=1))

    def on_border(self, feet: Floats, triangle: Ints) -> Bools:
        """(n,) whether ``feet`` (n, 3), each on its ``triangle`` (n,), lie on the border."""
        a, b, c = self.triangles[triangle].transpose(1, 0, 2)
        normal = vector_product(b - a, c - a)
        whole = np.einsum("nk,nk->n", normal, normal)
        with np.errstate(invalid="ignore", divide="ignore"):
            weights = np.stack(
                [
                    np.einsum("nk,nk->n", vector_product(q - p, feet - p), normal) / whole
                    for p, q in ((b, c), (c, a), (a, b))
                ],
                axis=1,
            )
        # the side from corner k to the next lies opposite to the corner before
        on_side = np.roll(weights, 1, axis=1) <= _ON_SIDE
        at_corner = weights >= 1 - _ON_SIDE
        on_border = (on_side & self.sides[triangle]) | (at_corner & self.corners[triangle])
        return np.asarray(on_border.any(axis=1))


def pressed(pattern: CreasePattern, target: Shell) -> tuple[Shell, Ints, Floats]:
    """The folded ``pattern`` pressed onto ``target``: a fan of triangles for each facet, the facet
    (n,) of each triangle, and the normal (n, 3) of the target under that facet.
    """
    assert pattern.folded_coords is not None
    faces, points = pattern.faces_vertices, pattern.folded_coords / pattern.scale
    same = _glued(pattern, points)
    flat, _ = _pressed(points, target)
    facet, corner = np.nonzero(faces >= 0)
    tails = same[faces[facet, corner]]
    heads = same[faces[facet, next_corners(faces)[facet, corner]]]
    quads = (faces >= 0).sum(axis=1) == 4
    flat = _straightened(flat, tails, heads, quads[facet])
    means, normals = _pressed(facet_means(points, faces), target)
    triangles = np.stack([flat[tails], flat[heads], means[facet]], axis=1)
    # the sides to the mean are inside the facet
    none = np.full(len(facet), -1)
    index, sides = np.stack([tails, heads, none], axis=1), np.stack([tails, none, none], axis=1)
    others = np.stack([heads, none, none], axis=1)
    return Shell.of_indices(triangles, index, sides, others), facet, normals[facet]


def _pressed(points: Floats, target: Shell) -> tuple[Floats, Floats]:
    """``points`` (n, 3) pressed onto ``target``, and the normals (n, 3) there."""
    feet, triangle = target.trees.closest(points)
    normal = _area_vectors(target.triangles)[triangle]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    height = np.einsum("nk,nk->n", points - feet, normal)[:, None]
    beyond = target.on_border(feet, triangle)[:, None]
    return np.where(beyond, points - height * normal, feet), normal


def _straightened(points: Floats, tails: Ints, heads: Ints, quads: Bools) -> Floats:
    """``points`` with a border that does not zig-zag; ``quads`` says which sides are of quads.

    A vertex x of two facets between a and b moves by (a - 2 x + b) / 4. A vertex of one facet is a
    corner: each of its two sides x, a, b along the border moves it by -(x - 2 a + b) / 4, where the
    facets are quads and a has two. Both cancel an offset that alternates, and leave a line a line.
    """
    count = len(points)
    key = np.minimum(tails, heads) * count + np.maximum(tails, heads)
    _, place, uses = np.unique(key, return_inverse=True, return_counts=True)
    border = uses[place] == 1
    ends = np.concatenate([tails[border], heads[border]])
    others = np.concatenate([heads[border], tails[border]])
    order = np.argsort(ends, kind="stable")
    ends, others = ends[order], others[order]
    simple = np.bincount(ends, minlength=count) == 2
    beside = np.full((count, 2), -1)
    beside[simple] = others[simple[ends]].reshape(-1, 2)
    facets = np.bincount(tails, minlength=count)
    whole = np.bincount(tails[~quads], minlength=count) == 0
    middle = np.flatnonzero(simple & (facets == 2))
    moved = points.copy()
    moved[middle] += (points[beside[middle]].sum(axis=1) - 2 * points[middle]) / 4
    for side in (0, 1):
        x = np.flatnonzero(simple & whole & (facets == 1))
        a = beside[x, side]
        kept = simple[a] & whole[a] & (facets[a] == 2)
        x, a = x[kept], a[kept]
        b = np.where(beside[a, 0] == x, beside[a, 1], beside[a, 0])
        moved[x] -= (points[x] - 2 * points[a] + points[b]) / 4
    return moved


def _glued(pattern: CreasePattern, points: Floats) -> Ints:
    """(V,) one number for all border vertices at one place, that of the first of them."""
    same = np.arange(len(points))
    border = np.unique(pattern.edges_vertices[(pattern.edges_faces < 0).any(axis=1)])
    ends = points[pattern.edges_vertices]
    mean = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean())
    same[border] = border[_welded(points[border], WELD * mean)]
    return same


def _welded(points: Floats, tolerance: float) -> Ints:
    """(n,) for each point the first point in the same place."""
    places, first, place = np.unique(points, axis=0, return_index=True, return_inverse=True)
    pairs = tree_of(places).query_pairs(tolerance, output_type="ndarray")
    least = first.copy()
    np.minimum.at(least, pairs[:, 0], first[pairs[:, 1]])
    np.minimum.at(least, pairs[:, 1], first[pairs[:, 0]])
    return np.asarray(least[place.ravel()])


def _area_of_pieces(
    pattern: CreasePattern, triangles: Floats, facet: Ints, normals: Floats
) -> float:
    """The area of all pieces. A facet that lies turned over counts against its neighbours, on which
    it lies, so that the area is that inside the border.
    """
    vectors = _area_vectors(triangles)
    side = np.sign(np.einsum("nk,nk->n", vectors, normals))
    areas = side * np.linalg.norm(vectors, axis=1)
    piece = facet * 0 if pattern.pieces is None else pattern.pieces[facet]
    return float(np.abs(np.bincount(piece, areas)).sum())


def _share(
    shell: Shell, judged: Callable[[Shell, Floats], Bools], other: Shell, reach: float
) -> float:
    """The share of the area of ``shell`` whose points are ``judged`` true of ``other``.

    The shell is divided into parts of about equal size, smaller at the border, each judged by its
    centre. What ``other`` surely covers within ``reach`` is not judged.
    """
    triangles = shell.triangles
    rim: Bools = np.asarray(shell.corners.any(axis=1))
    areas: Floats = np.asarray(np.linalg.norm(_area_vectors(triangles), axis=1))
    limit = 2 * areas.sum() / SAMPLES
    covered: Bools = np.zeros(len(triangles), dtype=bool)
    while True:
        large: Bools = np.asarray(areas > np.where(rim, limit / FINER_RIM, limit))
        if not large.any():
            break
        asked = np.flatnonzero(large & ~covered)
        covered[asked] = other.surely_covers(triangles[asked], reach)
        triangles = np.concatenate([triangles[~large], in_four(triangles[large])])
        areas = np.concatenate([areas[~large], np.tile(areas[large] / 4, 4)])
        rim = np.concatenate([rim[~large], np.tile(rim[large], 4)])
        covered = np.concatenate([covered[~large], np.tile(covered[large], 4)])
    step = -(-len(triangles) // MOST_SAMPLES)
    triangles, areas = triangles[::step], areas[::step]
    asked = np.flatnonzero(~covered[::step])
    judged_true = asked[judged(other, triangles[asked].mean(axis=1))]
    return float(areas[judged_true].sum() / areas.sum())


def _sides(triangles: Floats) -> Floats:
    return np.roll(triangles, -1, axis=1) - triangles


def _area_vectors(triangles: Floats) -> Floats:
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    return np.asarray(vector_product(b - a, c - a) / 2)
