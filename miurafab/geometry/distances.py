"""Distances from points to triangle meshes, exactly, for many points at once.

A triangle is no nearer than the distance to its centre minus its radius. The triangles with the
nearest few centres give an upper bound, and triangles that cannot beat the bound are left out.
Where the few cannot prove the bound, more centres are looked up: the result is exact. Triangles are
sorted into classes by radius, each with its own tree, so that a few large triangles do not weaken
the bound for all others.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.nearest import tree_of

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

_CHUNK = 50_000
_FEW = 8
"""How many centres are looked up at first."""


def closest_on_triangle(points: Floats, triangles: Floats) -> Floats:
    """(n, 3) the point of each triangle (n, 3, 3) nearest to each of ``points`` (n, 3).

    The foot in the triangle's plane where it lies inside, else the nearest foot on a side.
    """
    # Coordinates in rows: sums over them are then sums of whole rows, twice as fast.
    points, triangles = np.ascontiguousarray(points.T), triangles.transpose(1, 2, 0).copy()
    a, b, c = triangles
    ab, ac, ap = b - a, c - a, points - a
    d11, d12, d22 = _dot(ab, ab), _dot(ab, ac), _dot(ac, ac)
    p1, p2 = _dot(ap, ab), _dot(ap, ac)
    det = d11 * d22 - d12 * d12
    with np.errstate(invalid="ignore", divide="ignore"):
        s, t = (d22 * p1 - d12 * p2) / det, (d11 * p2 - d12 * p1) / det
        inside = (det > 0) & (s >= 0) & (t >= 0) & (s + t <= 1)
    best = a + np.where(inside, s, 0.0) * ab + np.where(inside, t, 0.0) * ac
    gap = best - points
    least = np.where(inside, _dot(gap, gap), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        side = end - start
        length = _dot(side, side)
        with np.errstate(invalid="ignore", divide="ignore"):
            at = np.where(length > 0, np.clip(_dot(points - start, side) / length, 0, 1), 0.0)
        foot = start + at * side
        gap = foot - points
        far = _dot(gap, gap)
        nearer = ~inside & (far < least)
        best = np.where(nearer, foot, best)
        least = np.where(nearer, far, least)
    return np.ascontiguousarray(best.T)


@dataclass(frozen=True, eq=False)
class MeshTrees:
    """The triangles (m, 3, 3) of a mesh, ready for the search of those nearest to points."""

    triangles: Floats
    classes: tuple[_SizeClass, ...]

    @classmethod
    def of(cls, triangles: Floats) -> MeshTrees:
        """The trees of ``triangles`` (m, 3, 3), of which there is one at least."""
        centres = (triangles.min(axis=1) + triangles.max(axis=1)) / 2
        radii = np.linalg.norm(triangles - centres[:, None], axis=2).max(axis=1)
        largest = radii.max() or 1.0
        halvings = np.floor(np.log2(largest / np.maximum(radii, 1e-6 * largest)))
        members = [np.flatnonzero(halvings == size) for size in np.unique(halvings)]
        return cls(triangles, tuple(_SizeClass(m, tree_of(centres[m]), radii[m]) for m in members))

    def near(self, points: Floats) -> Floats:
        """Points (n, 3) of the mesh near to ``points`` (n, 3), and the nearest of them to most:
        they are looked for on the triangles with the nearest centres alone. That takes a fifth of
        the time of :meth:`closest`, and less where many triangles are about as near.
        """
        found = _Nearest(points.copy(), np.full(len(points), np.inf), np.zeros(len(points), int))
        for size in self.classes:
            nearest = size.members[np.asarray(size.tree.query(points)[1])]
            _keep_nearest(points, self.triangles, np.arange(len(points)), nearest, found)
        return found.feet

    def closest(self, points: Floats) -> tuple[Floats, Ints]:
        """The points (n, 3) of the mesh nearest to ``points`` (n, 3), and the triangle (n,) that
        each lies on.
        """
        found = _Nearest(points.copy(), np.full(len(points), np.inf), np.zeros(len(points), int))
        for size in self.classes:
            _nearer_in_class(points, self.triangles, size, found)
        return found.feet, found.triangle


@dataclass(frozen=True, eq=False)
class _SizeClass:
    """Triangles of about one size: their numbers (k,) in the mesh, the tree of their centres and
    their ``radii`` (k,).
    """

    members: Ints
    tree: cKDTree
    radii: Floats


@dataclass(frozen=True, eq=False)
class _Nearest:
    """The nearest so far of n points: their ``feet`` (n, 3), the distances to these (n,), and the
    ``triangle`` (n,) of each. The search writes into the arrays.
    """

    feet: Floats
    distance: Floats
    triangle: Ints


def _nearer_in_class(points: Floats, triangles: Floats, size: _SizeClass, found: _Nearest) -> None:
    """Enter in ``found`` what is nearer among the members of this class."""
    members, radii = size.members, size.radii
    largest = float(radii.max())
    active = np.arange(len(points))
    few = _FEW
    while len(active):
        few = min(few, len(members))
        # All few again, not the new ones alone: the tree may list equal distances in another order.
        nearest = size.tree.query(points[active], k=np.arange(1, few + 1))
        gaps, near = np.asarray(nearest[0]), np.asarray(nearest[1])
        # The nearest centre first: it leaves few of the others worth a look.
        for columns in (slice(1), slice(1, None)):
            some = near[:, columns]
            promising = gaps[:, columns] - radii[some] < found.distance[active][:, None]
            row, column = np.nonzero(promising)
            _keep_nearest(points, triangles, active[row], members[some[row, column]], found)
        if few == len(members):
            return
        active = active[gaps[:, -1] - largest < found.distance[active]]
        few = 4 * few


def _keep_nearest(
    points: Floats, triangles: Floats, rows: Ints, columns: Ints, found: _Nearest
) -> None:
    """Enter what is nearer of the pairs (point row, triangle column), sorted by row."""
    for start in range(0, len(rows), _CHUNK):
        row, column = rows[start : start + _CHUNK], columns[start : start + _CHUNK]
        foot = closest_on_triangle(points[row], triangles[column])
        gap = np.linalg.norm(foot - points[row], axis=1)
        first = np.flatnonzero(np.diff(row, prepend=-1))
        least = np.minimum.reduceat(gap, first)
        won = np.flatnonzero(gap == np.repeat(least, np.diff(first, append=len(row))))
        won = won[gap[won] < found.distance[row[won]]]
        found.feet[row[won]] = foot[won]
        found.distance[row[won]] = gap[won]
        found.triangle[row[won]] = column[won]


def _dot(a: Floats, b: Floats) -> Floats:
    """(n,) the products of the columns of ``a`` and ``b`` (3, n)."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
