"""The exact sheet nearest to a target: closeness alone, with or without a limit on residuals.

From the projection x0 of the seed, with u = x - x0, this minimises over exact sheets

    sum over facets (n_f . (m_f - q_f))^2 + w sum over edges |u_a - u_b|^2   (lengths over L)

with m_f the middle of a facet, q_f the nearest point of the target and n_f its normal there. A
limit on Kawasaki's residual is a hinge of this objective and an inequality of the projection at its
end. Sheets with and without a limit are brought to rest in the same way. The fit's own objective
(miurafab.origami.fitting.objective) also wants even facets, and so finds other sheets.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from miurafab.geometry.arrays import Floats
from miurafab.geometry.sparse import SymmetricSolver
from miurafab.origami.energy.curve import energy_curve
from miurafab.origami.fitting.blocks import Block, kawasaki, stacked
from miurafab.origami.fitting.candidate import Candidate, candidate
from miurafab.origami.fitting.fair import fairest
from miurafab.origami.fitting.inequalities import limits
from miurafab.origami.fitting.nominal import Nominal, feet_of
from miurafab.origami.fitting.request import FitRequest
from miurafab.origami.fitting.solver import project
from miurafab.origami.fitting.starts import Start, starts_for

WEIGHT = 1e-4
"""w: it keeps single vertices from wandering off, and hardly holds the sheet back."""
HINGE = 5.0
"""The weight of a residual over its limit. A stiffer hinge takes far longer to come to rest."""
STEPS, LEG, AT_REST = 400, 40, 1e-3
"""The most steps, and the steps that lower the objective by less than this part at rest."""
MARGIN = 1e-3
"""The limit is tightened by this part, so that rounding does not break it."""


@dataclass(frozen=True, eq=False)
class Closeness:
    """The objective of the sheet ``first`` (V, 3) of ``start``."""

    start: Start
    first: Floats
    weight: float
    limit: float | None

    def __call__(self, points: Floats, feet: Floats) -> tuple[Floats, sparse.csr_array, Floats]:
        """The residuals, their Jacobian and the new feet, as FairObjective gives them."""
        surface, charts = self.start.surface, self.start.unknowns.charts
        middle = points[charts.faces_vertices].mean(axis=1)
        feet = feet_of(surface, middle, feet)
        return (*stacked(list(self._blocks(points, middle, feet)), points.size), feet)

    def _blocks(self, points: Floats, middle: Floats, feet: Floats) -> Iterator[Block]:
        surface, charts = self.start.surface, self.start.unknowns.charts
        scale = 1 / self.start.unknowns.length
        faces, edges = charts.faces_vertices, charts.edges_vertices
        normal = surface.normal(feet)
        off = np.einsum("fk,fk->f", normal, middle - surface.point(feet))
        rows = np.broadcast_to(scale * normal[:, None] / 4, (*faces.shape, 3))
        yield scale * off, faces, rows
        moved = points - self.first
        apart = moved[edges[:, 0]] - moved[edges[:, 1]]
        scale *= math.sqrt(self.weight)
        for axis in np.eye(3):
            ends = scale * np.array([1.0, -1.0])[:, None] * axis
            yield scale * (apart @ axis), edges, np.broadcast_to(ends, (len(edges), 2, 3))
        if self.limit is not None:
            residual, spokes, rows = kawasaki(points, charts)
            for sign in (1.0, -1.0):
                over = sign * residual - self.limit
                on = over > 0
                yield HINGE * over[on], spokes[on], HINGE * sign * rows[on]


@dataclass(frozen=True, eq=False)
class Closest:
    """A sheet at rest, the part by which its last steps lowered the objective, and its barrier."""

    sheet: Candidate
    last_gain: float

    @property
    def worst(self) -> float:
        """The largest Kawasaki residual, radians."""
        return self.sheet.measurements.max_flat_foldability or 0.0

    @cached_property
    def barrier(self) -> float:
        """In k_f L."""
        return energy_curve(self.sheet.pattern, 24).barrier


def closest(request: FitRequest, weight: float = WEIGHT) -> Closest:
    """The sheet nearest to the target of ``request``, within its limit on residuals."""
    start = starts_for(request, 1)[0]
    unknowns, limit = start.unknowns, request.flat_foldable
    constraints, cap = unknowns.constraints(False), 0.25 * unknowns.length
    x = project(constraints, start.x, cap=cap, dimension=3).x
    limit = None if limit is None else (1 - MARGIN) * limit
    objective = Closeness(start, unknowns.vertices(x), weight, limit)
    feet = Nominal.of(start.surface, unknowns.charts, *start.cells).parameters
    solver, value, gain, steps = SymmetricSolver(), math.inf, 1.0, 0
    while gain > AT_REST and steps < STEPS:
        leg = fairest(objective, unknowns, x, feet, steps=LEG, solver=solver)
        x, feet, gain, value = leg.x, leg.feet, 1 - leg.value / value, leg.value
        steps += LEG
    bounds = limits(replace(request, flat_foldable=limit), unknowns, 1.0)
    within = unknowns.of_unknowns(bounds) if bounds.any else None
    solution = project(constraints, x, inequalities=within, cap=cap, dimension=3)
    assert solution.converged, solution.reason
    found = candidate(request, start, solution.x, steps, polished=True)
    assert not found.faults, found.faults
    return Closest(found, gain)
