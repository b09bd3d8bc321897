"""From a start to exact sheets: by the projection alone, or by the fair objective.

The plain way projects the seed onto the constraints: fast, and the first exact sheet. The fair way
minimises the objective from the seed, first with a small penalty on the constraints, so that the
sheet may pass through inexact states on its way, then with the full penalty, and is projected at
the end. It finds exact sheets where the projection of the seed ends in crumpled ones.

Exact flat-foldability joins the constraints. Limits of the user's are hinges of the objective and
inequalities of the projection. Limits in mm depend on the scale of the sheet, and the scale on the
sheet, so the fair way is repeated until the limits hold.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from miurafab.geometry.arrays import Floats
from miurafab.origami.fitting.candidate import Candidate, candidate, turned_follow
from miurafab.origami.fitting.fair import fairest
from miurafab.origami.fitting.inequalities import Bounds, limits
from miurafab.origami.fitting.objective import FairObjective, Weights
from miurafab.origami.fitting.request import FitRequest
from miurafab.origami.fitting.result import Attempt
from miurafab.origami.fitting.solver import Projection, project
from miurafab.origami.fitting.starts import Start

STEP_CAP = 0.25
"""The largest move of a coordinate in one step of the projection, in mean edge lengths."""
EASING = (1e3,)
"""The penalties before the full one."""
EASING_STEPS = 8
LEGS = (8, 14)
"""Steps with the full penalty, in legs; after each the sheet is projected and judged."""
SCALINGS = 4
"""The most rounds, each at the scale that the last round left."""
BOUND_MARGIN = 2e-3
"""The limits are tightened by this part, since the scale of the sheet still changes."""


def plain(request: FitRequest, start: Start) -> Candidate | Attempt:
    """The projection of the seed, or the record of the attempt without an exact sheet."""
    solution = _projected(request, start, start.x, None)
    if not solution.converged:
        return _failed(start, solution)
    return candidate(request, start, solution.x, solution.iterations, polished=False)


def polished(
    request: FitRequest, start: Start, on_step: Callable[[], None] | None = None
) -> Iterator[Candidate | Attempt]:
    """The fair sheets of ``start``, each better than the one before unless it crosses itself.

    ``on_step`` is called before each step, and may end the search by an exception.
    """
    scale = 1.0
    if request.size_mm is not None:
        extent = np.ptp(start.unknowns.whole(start.x)[1], axis=0).max()
        scale = request.size_mm / float(extent)
    x, eased = start.x, False
    iterations = 0
    for _ in range(SCALINGS):
        bounds = limits(request, start.unknowns, scale, BOUND_MARGIN)
        objective = _objective(request, start, x, bounds)
        constraints = start.unknowns.constraints(request.exactly_flat_foldable)
        tick = _ticking(on_step)
        if not eased:
            for penalty in EASING:
                sheet = fairest(
                    objective,
                    start.unknowns,
                    constraints,
                    x,
                    steps=EASING_STEPS,
                    penalty=penalty,
                    on_step=tick,
                )
                x, objective = sheet.x, replace(objective, feet=sheet.feet)
                iterations += sheet.steps
            eased = True
        best: Candidate | None = None
        for steps in LEGS:
            sheet = fairest(objective, start.unknowns, constraints, x, steps=steps, on_step=tick)
            x, objective = sheet.x, replace(objective, feet=sheet.feet)
            iterations += sheet.steps
            solution = _projected(request, start, x, bounds if bounds.any else None)
            if not solution.converged:
                yield _failed(start, solution)
                continue
            best = candidate(request, start, solution.x, iterations + solution.iterations, True)
            if bounds.any:
                best = replace(best, active_bounds=bounds.count(solution.active))
            yield best
            if sheet.steps < steps:
                break
        if best is None or not bounds.any or not best.faults:
            return
        scale = best.pattern.scale


def _ticking(on_step: Callable[[], None] | None) -> Callable[[int, float], None] | None:
    return None if on_step is None else lambda _number, _value: on_step()


def _objective(request: FitRequest, start: Start, x: Floats, bounds: Bounds) -> FairObjective:
    """The fair objective with the limits ``bounds`` as hinges."""
    weights = Weights()
    if bounds.min_edge is not None:
        shortest = max(weights.shortest_edge, 1.02 * bounds.min_edge / start.unknowns.length)
        weights = replace(weights, shortest_edge=shortest)
    if bounds.angles is not None:
        low, high = bounds.angles
        weights = replace(
            weights,
            least_sector=max(weights.least_sector, low + 0.01),
            greatest_sector=min(weights.greatest_sector, high - 0.01),
        )
    return FairObjective.of(
        start.surface,
        start.unknowns.charts,
        start.cells,
        start.unknowns.vertices(x),
        follow=turned_follow(request.follow, start.rows_along),
        rim=start.rim,
        weights=weights,
        aspect=None if bounds.aspect is None else 0.98 * bounds.aspect,
        kawasaki=None if bounds.kawasaki is None else 0.95 * bounds.kawasaki,
    )


def _projected(request: FitRequest, start: Start, x: Floats, bounds: Bounds | None) -> Projection:
    unknowns = start.unknowns
    return project(
        unknowns.constraints(request.exactly_flat_foldable),
        x,
        unknowns.places,
        inequalities=None if bounds is None else unknowns.of_unknowns(bounds),
        cap=STEP_CAP * unknowns.length,
    )


def _failed(start: Start, solution: Projection) -> Attempt:
    return Attempt(
        start.way,
        start.rows_along,
        start.corrugation,
        solution.residual,
        solution.iterations,
        solution.reason,
        start.place,
        start.pieces,
        start.steepest,
    )
