"""Fitting: from a target to a tessellation that lies on it and folds from one flat sheet.

A fit is a short list of attempts in a fixed order, each a seed and a projection; the first that
meets everything asked is the answer. The order:

1. on a surface of revolution, one period solved and turned about the axis;
2. straight from the seed, with several stretches along and across the rows, each in both directions
   of the rows, the one along which the normal turns less first;
3. the same bent step by step from flat to the full target, carrying the solution along;
4. the same from a coarse sheet to twice as fine ones;
5. the seeds shaken a little at random, by the request's ``seed``.

On a mesh the sheet may then lie elsewhere: the scan smoothed more, the grid turned, and as the last
resort a smaller part of the rectangle, each with the seeds and some of the bends. The advice says
where it lies.

Exact flat-foldability is appended to a developable solution. Where a limit is not met, and wherever
flat-foldability is asked for, the sheet is then polished: brought as close to the target as its
constraints and limits allow. Whatever happens, the result says what was tried and, if nothing
served, what to change.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable

from miurafab.origami.fitting.request import INTERRUPTED, Attempt, FitRequest, FitResult
from miurafab.origami.fitting.search import coarsest
from miurafab.origami.fitting.strategies import Candidate, plans

LAST_RESORTS = ("bent", "refined", "shaken")
"""The ways to a sheet where the seed alone finds none."""

__all__ = ["Attempt", "FitRequest", "FitResult", "fit"]


def fit(
    request: FitRequest,
    on_progress: Callable[[float, str], None] | None = None,
) -> FitResult:
    """The tessellation asked for; ``on_progress`` gets a fraction and a word on what is tried.

    Non-convergence is a result with advice. Ctrl-C ends the attempts: the result is then the best
    exact sheet so far, with status ``interrupted``, and ``KeyboardInterrupt`` is raised only where
    there is none. Raises :class:`~miurafab.errors.InputError` only for a
    request that makes no sense.
    """
    if request.search:
        return coarsest(request, lambda one, attempts: _fit(one, None, attempts), on_progress)
    return _fit(request, on_progress)


def _fit(
    request: FitRequest,
    on_progress: Callable[[float, str], None] | None,
    attempts: int | None = None,
) -> FitResult:
    """One size, in at most ``attempts`` attempts."""
    started = time.perf_counter()
    made: list[Attempt] = []
    best: Candidate | None = None
    interrupted = False
    try:
        for number, plan in enumerate(itertools.islice(plans(request), attempts)):
            if best is not None and best.settles and plan.way in LAST_RESORTS:
                break
            if on_progress is not None:
                # how many attempts it takes is not known; most sheets need one or two
                on_progress(1 - 0.9**number, plan.describe())
            outcome = plan.run(request)
            if isinstance(outcome, Attempt):
                made.append(outcome)
                continue
            made.append(outcome.attempt)
            if best is None or outcome.rank < best.rank:
                best = outcome
            if outcome.rank == (0, False):
                break
    except KeyboardInterrupt:
        if best is None:
            raise
        interrupted = True
    if on_progress is not None:
        on_progress(1.0, "done")
    iterations = sum(a.iterations for a in made)
    seconds = time.perf_counter() - started
    if best is None:
        advice = _advice_when_stalled(made)
        return FitResult("stalled", advice, None, None, tuple(made), iterations, seconds)
    status = "interrupted" if interrupted else "infeasible" if best.faults else "converged"
    place = best.attempt.place
    stopped = [INTERRUPTED] if interrupted else []
    remarks = [f"On the whole rectangle no sheet was found; this one has {place}."] if place else []
    if best.rank[1]:
        remarks.append("The mid-surface lies far from the target; ask for more --facets.")
    return FitResult(
        status,
        " ".join((*stopped, *best.faults, *remarks)),
        best.pattern,
        best.measurements,
        tuple(made),
        iterations,
        seconds,
        best.deviation_mm,
        best.polished,
        best.active_bounds,
    )


def _advice_when_stalled(attempts: list[Attempt]) -> str:
    residual = min(a.residual for a in attempts)
    return (
        f"No exact sheet was found in {len(attempts)} attempts (best residual {residual:.1e}): "
        "the target bends too much for one sheet of this pattern. Ask for more --facets, raise "
        "--zigzag and --amplitude, drop --flat-foldable, or take a smaller part of the target."
    )
