"""A region of the plane inside closed loops: its signed distance, and the cells that meet it.

The region lies on the left of each loop, so the outer loop runs counter-clockwise and holes run
clockwise. The signed distance of a point is the distance to the nearest side, positive inside. Its
gradient has length one and points inwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from miurafab.geometry.arrays import Bools, Floats, Ints

_PAIRS = 2_000_000
"""Points are taken in blocks of so many pairs of point and side, for the memory."""


@dataclass(frozen=True, eq=False)
class Outline:
    """The region inside ``loops``, each (n, 2), the region on the left."""

    loops: tuple[Floats, ...]

    @classmethod
    def of_loops(cls, loops: Sequence[Floats]) -> Outline:
        """The region inside the largest of ``loops`` and outside the others, in any direction."""
        areas = np.array([_area(loop) for loop in loops])
        outer = int(np.abs(areas).argmax())
        return cls(
            tuple(
                loop if (area > 0) == (n == outer) else loop[::-1]
                for n, (loop, area) in enumerate(zip(loops, areas, strict=True))
            )
        )

    @cached_property
    def _polygon(self) -> shapely.Polygon:
        outer, *holes = sorted(self.loops, key=_area, reverse=True)
        polygon = shapely.Polygon(outer, holes)
        shapely.prepare(polygon)
        return polygon

    @property
    def simple(self) -> bool:
        """Whether no loop crosses itself or another."""
        return bool(shapely.is_valid(self._polygon))

    @property
    def area(self) -> float:
        return sum(_area(loop) for loop in self.loops)

    @property
    def box(self) -> tuple[Floats, Floats]:
        """The lowest and the highest corner of the region, (2,) each."""
        points = np.concatenate(self.loops)
        return points.min(axis=0), points.max(axis=0)

    @cached_property
    def sides(self) -> tuple[Floats, Floats]:
        """(S, 2), (S, 2) the starts and the ends of all sides, loop after loop."""
        starts = np.concatenate(self.loops)
        return starts, np.concatenate([np.roll(loop, -1, axis=0) for loop in self.loops])

    def contains(self, points: Floats) -> Bools:
        """(n,) whether each of ``points`` (n, 2) lies in the region."""
        return np.asarray(shapely.contains_xy(self._polygon, points[:, 0], points[:, 1]))

    def nearest(self, points: Floats) -> tuple[Floats, Floats, Ints]:
        """For ``points`` (n, 2) the signed distance (n,), its gradient (n, 2), and the nearest side
        (n,).

        On a side, the gradient is the side's normal to the left.
        """
        starts, ends = self.sides
        side = ends - starts
        squared = np.maximum(np.einsum("sk,sk->s", side, side), 1e-300)
        foot, nearest = np.empty_like(points), np.empty(len(points), dtype=np.int64)
        block = max(_PAIRS // len(side), 1)
        for first in range(0, len(points), block):
            p = points[first : first + block]
            from_start = p[:, None] - starts
            at = np.clip(np.einsum("psk,sk->ps", from_start, side) / squared, 0.0, 1.0)
            gap = from_start - at[..., None] * side
            best = np.einsum("psk,psk->ps", gap, gap).argmin(axis=1)
            row = np.arange(len(p))
            nearest[first : first + block] = best
            foot[first : first + block] = p - gap[row, best]
        offset = points - foot
        distance = np.linalg.norm(offset, axis=1)
        sign = np.where(self.contains(points), 1.0, -1.0)
        normal = np.stack([-side[nearest, 1], side[nearest, 0]], axis=1)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        away = distance > 1e-12 * float(np.sqrt(squared.max()))
        slope = sign[:, None] * offset / np.where(away, distance, 1.0)[:, None]
        return sign * distance, np.where(away[:, None], slope, normal), nearest

    def signed_distance(self, points: Floats) -> Floats:
        """(n,) the signed distance of ``points`` (n, 2), positive inside."""
        return self.nearest(points)[0]

    def shares(self, u: Floats, v: Floats, zigzag: float = 0.0) -> Floats:
        """(rows, columns) the part of each cell between the lines ``u`` (columns + 1,) and ``v``
        (rows + 1,) that lies in the region.

        The corners on even lines u are moved by ``-zigzag / 2`` along v, the others by
        ``+zigzag / 2``.
        """
        shift = ((np.arange(len(u)) % 2) - 0.5) * zigzag
        lattice = np.stack(np.broadcast_arrays(u[None, :], v[:, None] + shift), axis=-1)
        corners = (lattice[:-1, :-1], lattice[:-1, 1:], lattice[1:, 1:], lattice[1:, :-1])
        cells = shapely.polygons(np.stack(corners, axis=2))
        common = shapely.area(shapely.intersection(self._polygon, cells))
        return np.asarray(common / shapely.area(cells))

    def along(self, start: tuple[int, Floats], end: tuple[int, Floats]) -> Floats:
        """(m, 2) the corners of the loop from ``start`` to ``end``, in the loop's direction.

        Each is a side and a point near it. There are no corners between sides of two loops.
        """
        (first, at), (last, to) = start, end
        starts, ends = self.sides
        offset = 0
        for loop in self.loops:
            n = len(loop)
            if offset <= first < offset + n and offset <= last < offset + n:
                direction = ends[first] - starts[first]
                whole_turn = first == last and (to - at) @ direction < 0
                count = n if whole_turn else (last - first) % n
                return np.asarray(loop[(first - offset + 1 + np.arange(count)) % n])
            offset += n
        return np.empty((0, 2))


def _area(loop: Floats) -> float:
    x, y = loop[:, 0] - loop[0, 0], loop[:, 1] - loop[0, 1]
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2)
