"""Areas that polygons of one plane share: pairs that overlap, and triples of such pairs.

Polygons that only touch share a sliver as wide as rounding. A common area counts from a least
width: twice the area over the perimeter, which is the width of a long strip.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from miurafab.geometry.arrays import (
    Bools,
    Floats,
    Ints,
    places_among,
    places_in_runs,
    run_starts,
)
from miurafab.geometry.boxes import meeting_pairs

_AT_ONCE = 1_000
"""So many pairs are looked at together to count triples."""


@dataclass(frozen=True, eq=False)
class SharedAreas:
    """The common areas of n pairs of polygons.

    Attributes
    ----------
    pairs : (n, 2) int64
        The two polygons of each pair, the smaller number first, sorted.
    areas : (n,) shapely.Geometry
        What the two have in common.
    corners : (m, 2) float64
        The corners of all areas.
    area_of_corner : (m,) int64
        The pair of each corner, rising.
    """

    pairs: Ints
    areas: NDArray[np.object_]
    corners: Floats
    area_of_corner: Ints

    def place_of(self, one: Ints, other: Ints) -> Ints:
        """(k,) where the pairs of polygons ``one`` (k,) and ``other`` (k,) stand; -1 for none."""
        base = int(self.pairs.max(initial=0)) + 1
        keys = self.pairs[:, 0] * base + self.pairs[:, 1]
        low, high = np.minimum(one, other), np.maximum(one, other)
        wanted = np.where((low >= 0) & (high < base), low * base + high, -1)
        return places_among(keys, wanted)

    def triples(self, polygons: NDArray[np.object_], least_width: float) -> Ints:
        """(t, 3) the triples of polygons with a common area, each in rising order.

        ``polygons`` are those of :func:`polygons_of`.
        """
        pair, third = self.mutual()
        common = wide(shapely.intersection(self.areas[pair], polygons[third]), least_width)
        return np.column_stack([self.pairs[pair], third])[common]

    def mutual(self) -> tuple[Ints, Ints]:
        """(t,), (t,) the triples of which each two share an area: a pair, and the third polygon,
        which has the largest number.
        """
        return self._mutual(0, len(self.pairs))

    def has_more_triples(self, most: int) -> bool:
        """Whether :meth:`mutual` finds more than ``most``, without the memory that all take."""
        found = 0
        for start in range(0, len(self.pairs), _AT_ONCE):
            found += len(self._mutual(start, start + _AT_ONCE)[0])
            if found > most:
                return True
        return False

    def _mutual(self, start: int, end: int) -> tuple[Ints, Ints]:
        """The part of :meth:`mutual` for the pairs from ``start`` up to ``end``."""
        first, second = self.pairs.T
        counts = np.bincount(first, minlength=int(self.pairs.max(initial=-1)) + 1)
        middle = second[start:end]
        each = counts[middle]  # the pairs that begin with the second polygon of a pair
        pair = np.repeat(np.arange(start, start + len(middle)), each)
        third = second[np.repeat(run_starts(counts)[middle], each) + places_in_runs(each)]
        closed = self.place_of(first[pair], third) >= 0
        return pair[closed], third[closed]


def polygons_of(points: Floats, faces: Ints) -> NDArray[np.object_]:
    """(F,) the polygons of ``faces`` (F, k), -1 padded, with their corners at ``points`` (F, k, 2).

    A facet whose sides cross is mended, so that every polygon has an inside.
    """
    first = np.where((faces >= 0)[..., None], points, points[:, :1])
    shapes = np.asarray(shapely.polygons(first))
    crossed = ~shapely.is_valid(shapes)
    shapes[crossed] = shapely.make_valid(shapes[crossed])
    return shapes


def wide(areas: NDArray[np.object_], least_width: float) -> Bools:
    """(n,) whether each of ``areas`` (n,) counts as an area."""
    length = shapely.length(areas)
    return np.asarray(2 * shapely.area(areas) > least_width * np.maximum(length, least_width))


def shared_areas(
    points: Floats, faces: Ints, least_width: float, among: Ints | None = None
) -> SharedAreas:
    """The pairs of ``faces`` (F, k), -1 padded, over ``points`` (F, k, 2) that share an area.

    ``points`` holds the corners face by face, since faces of a folded sheet may meet in corners
    that rounding has moved apart. Only faces with the same number in ``among`` (F,) are compared.
    ``least_width`` is in the unit of the points.
    """
    real = (faces >= 0)[..., None]
    low = np.where(real, points, np.inf).min(axis=1)
    high = np.where(real, points, -np.inf).max(axis=1)
    flat = ((0, 0), (0, 1))
    one, other = meeting_pairs(np.pad(low, flat), np.pad(high, flat))
    if among is not None:
        kept = among[one] == among[other]
        one, other = one[kept], other[kept]
    shapes = polygons_of(points, faces)
    areas = shapely.intersection(shapes[one], shapes[other])
    common = wide(areas, least_width)
    pairs, areas = np.column_stack([one, other])[common], areas[common]
    order = np.lexsort((pairs[:, 1], pairs[:, 0]))
    pairs, areas = pairs[order], areas[order]
    corners, owner = shapely.get_coordinates(areas, return_index=True)
    return SharedAreas(pairs, areas, corners, owner)


def crossing(segments: Floats, polygons: NDArray[np.object_], which: Ints, least: float) -> Bools:
    """(n,) whether each of ``segments`` (n, 2, 2) runs inside ``polygons[which]`` (n,) over more
    than ``least``, and farther than ``least`` from the border.
    """
    shrunk = shapely.buffer(polygons, -least, join_style="mitre")
    inside = shapely.intersection(shapely.linestrings(segments), shrunk[which])
    return np.asarray(shapely.length(inside) > least)
