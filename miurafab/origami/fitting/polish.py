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
from miurafab.geometry.sparse import SymmetricSolver
from miurafab.origami.fitting.candidate import Candidate, candidate, turned_follow
from miurafab.origami.fitting.fair import PENALTY, fairest
from miurafab.origami.fitting.inequalities import Bounds, limits
from miurafab.origami.fitting.objective import FairObjective, Weights
from miurafab.origami.fitting.request import FitRequest
from miurafab.origami.fitting.result import Attempt
from miurafab.origami.fitting.solver import Projection, project
from miurafab.origami.fitting.starts import Start

STEP_CAP = 0.25
"""The largest move of a vertex in one step of the projection, in mean edge lengths."""
EASING = ((1e3, 8),)
"""The penalties before the full one, with their steps."""
LEGS = ((PENALTY, 8), (PENALTY, 14))
"""Steps with the full penalty, in legs; after each the sheet is projected and judged."""
FEW = 2000
"""A sheet of fewer unknowns takes ``MORE`` steps in its last leg, which cost little."""
MORE = 40
SCALINGS = 4
"""The most rounds within limits, each at the scale that the last round left."""
SHAPE_FAULTS = ("min-edge", "max-distance", "facet-shape", "flat-foldable")
"""The faults of a sheet that misses a limit on edges, corners, Kawasaki's condition, or reach."""
BOUND_MARGIN = 2e-3
"""The limits are tightened by this part, since the scale of the sheet still changes."""
GAIN = 0.75
"""A round that leaves more than this part of what a sheet lies too far is the last."""
REACH_MARGIN = 0.03
"""The limit on the distance is tightened by this part: it is a hinge and no inequality."""


def plain(request: FitRequest, start: Start) -> Candidate | Attempt:
    """The projection of the seed, or the record of the attempt without an exact sheet."""
    solution = _projected(request, start, start.x, None)
    if not solution.converged:
        return _failed(start, solution)
    return candidate(request, start, solution.x, solution.iterations, polished=False)


def polished(
    request: FitRequest, start: Start, on_step: Callable[[int, float], None] | None = None
) -> Iterator[Candidate | Attempt]:
    """The fair sheets of ``start``, each better than the one before unless it crosses itself.

    The first round leaves all limits but that on the distance out. Where it misses one of them, the
    next rounds go on from there within the limits, at the scale that the last round left.
    ``on_step`` gets the number and the objective of each step, and may end the search by an
    exception.
    """
    unknowns = start.unknowns
    unlimited = replace(
        request,
        min_edge_mm=None,
        min_angle=None,
        max_angle=None,
        max_aspect=None,
        flat_foldable=0.0 if request.exactly_flat_foldable else None,
    )
    solver = SymmetricSolver()
    x, iterations, scale = start.x, 0, _scale_of(request, start)
    excess = np.inf
    aim = (1 - REACH_MARGIN) * (request.max_distance_mm or np.inf)
    for number in range(1 + SCALINGS):
        asked = request if number else unlimited
        bounds = limits(asked, unknowns, scale, BOUND_MARGIN)
        objective = _objective(asked, start, x, bounds, aim / scale)
        last: Candidate | None = None
        feet = objective.feet
        for penalty, steps in LEGS[:1] if number else (*EASING, *LEGS):
            if (penalty, steps) == LEGS[-1] and len(x) < FEW:
                steps = MORE
            sheet = fairest(
                objective,
                unknowns,
                x,
                feet,
                flat_foldable=request.exactly_flat_foldable,
                steps=steps,
                penalty=penalty,
                solver=solver,
                on_step=on_step,
            )
            x, feet = sheet.x, sheet.feet
            iterations += sheet.steps
            if penalty < PENALTY:
                continue
            solution = _projected(request, start, x, bounds if bounds.any else None)
            if not solution.converged:
                yield _failed(start, solution)
                continue
            last = candidate(request, start, solution.x, iterations + solution.iterations, True)
            if bounds.any:
                last = replace(last, active_bounds=bounds.count(solution.active))
            yield last
            if sheet.steps < steps or _too_far(last):
                break
        limited = limits(request, unknowns, scale).any or request.max_distance_mm is not None
        if last is None or not limited or (number and not last.faults):
            return
        if number == 0 and not any(fault.code in SHAPE_FAULTS for fault in last.faults):
            return
        scale = last.pattern.scale
        if _too_far(last):
            # a hinge gives way a little, so the next round aims shorter by as much
            far = last.closeness.factors["max_distance"]
            aim *= (1 - REACH_MARGIN / 2) / far
            if number > 1 and far - 1 > GAIN * excess:
                return
            excess = far - 1


def _too_far(sheet: Candidate) -> bool:
    return any(fault.code == "max-distance" for fault in sheet.faults)


def _scale_of(request: FitRequest, start: Start) -> float:
    """The scale that brings the seed to the size asked for."""
    size = float(np.ptp(start.unknowns.whole(start.x)[1], axis=0).max())
    return 1.0 if request.side_mm is None else request.side_mm / size


def _objective(
    request: FitRequest, start: Start, x: Floats, bounds: Bounds, reach: float
) -> FairObjective:
    """The fair objective with the limits ``bounds`` as hinges, and ``reach`` on the distance."""
    weights = Weights.of(start.pieces, start.all_round)
    weights = replace(weights, fairness=request.fairness * weights.fairness)
    if bounds.min_edge is not None:
        shortest = max(weights.shortest_edge, bounds.min_edge / start.unknowns.length)
        weights = replace(weights, shortest_edge=shortest)
    if bounds.angles is not None:
        low, high = bounds.angles
        weights = replace(
            weights,
            least_sector=max(weights.least_sector, low),
            greatest_sector=min(weights.greatest_sector, high),
        )
    return FairObjective.of(
        start.surface,
        start.unknowns.charts,
        start.cells,
        start.unknowns.vertices(x),
        follow=turned_follow(request.follow, start.rows_along),
        rim=start.rim,
        weights=weights,
        aspect=bounds.aspect,
        kawasaki=bounds.kawasaki,
        reach=reach if np.isfinite(reach) else None,
    )


def _projected(request: FitRequest, start: Start, x: Floats, bounds: Bounds | None) -> Projection:
    unknowns = start.unknowns
    return project(
        unknowns.constraints(request.exactly_flat_foldable),
        x,
        inequalities=None if bounds is None else unknowns.of_unknowns(bounds),
        cap=STEP_CAP * unknowns.length,
        dimension=3,
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
