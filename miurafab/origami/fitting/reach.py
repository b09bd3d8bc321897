"""How far the vertices of a sheet lie from the whole target, for a limit on the distance.

The Hausdorff distance has two sides. No vertex x may lie farther from the target than the limit:

    |x - q|,   q the nearest point of the target and its continuation,

which holds for the facets between them too. And no point of the target may lie farther from the
sheet. Inside its border the sheet covers the target, so that is a matter of the border, whose
zig-zag leaves parts of the target uncovered. There, with p the place of a border vertex x on the
border of the target, and t the direction of the border,

    |(x - p) - t (t . (x - p))|,

which bounds both how far a vertex sticks out and how far it has retreated; at a corner without t.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.quads import QuadCharts
from miurafab.origami.fitting.blocks import Block
from miurafab.origami.fitting.nominal import Rim, feet_of
from miurafab.surfaces.surface import TargetSurface, tangents, unit

STEPS = 4
"""Steps to the nearest points, from the places of the vertices."""


@dataclass(frozen=True, eq=False)
class Reach:
    """The ``limit`` in the unit of ``surface``, the parameters ``feet`` (V, 2) near which the
    nearest points lie, and the vertices ``border`` (m,) with their ``places`` (m, 3) and the unit
    directions ``along`` (m, 3) of the border, zero at a corner.
    """

    surface: TargetSurface
    limit: float
    feet: Floats
    border: Ints
    places: Floats
    along: Floats

    @classmethod
    def of(
        cls,
        surface: TargetSurface,
        charts: QuadCharts,
        cells: tuple[int, int],
        rim: Rim,
        limit: float,
    ) -> Reach:
        """Of the sheet over ``charts``, cells of a lattice of ``cells`` columns and rows, with the
        sides of ``rim`` for its border.
        """
        lattice = charts.lattice
        feet = surface.domain.at(lattice, cells)
        border = np.unique(rim.sides)
        by_u = lattice[rim.sides[:, 0], 1] == lattice[rim.sides[:, 1], 1]
        on_u, on_v = (np.isin(border, rim.sides[chosen]) for chosen in (by_u, ~by_u))
        du, dv = (unit(t) for t in tangents(surface, feet[border]))
        along = np.where(on_u[:, None], du, dv) * (on_u ^ on_v)[:, None]
        return cls(surface, limit, feet, border, surface.point(feet[border]), along)

    def over(self, points: Floats) -> Iterator[Block]:
        """How far ``points`` (V, 3) are beyond the limit."""
        feet = feet_of(self.surface, points, self.feet, STEPS)
        gap = points - self.surface.point(feet)
        yield self._over(gap, np.arange(len(points)))
        gap = points[self.border] - self.places
        across = gap - np.einsum("nk,nk->n", self.along, gap)[:, None] * self.along
        yield self._over(across, self.border)

    def _over(self, gap: Floats, vertices: Ints) -> Block:
        distance = np.linalg.norm(gap, axis=1)
        gradient = gap / np.maximum(distance, 1e-300)[:, None]
        return distance - self.limit, vertices[:, None], gradient[:, None]
