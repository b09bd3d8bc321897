"""Fitting: from a target to a tessellation that lies on it and folds from one flat sheet.

A fit tries strategies in a fixed order, each a start and a projection. The first sheet that meets
everything asked is the answer. The order:

1. on a surface of revolution, one period is solved and turned about the axis;
2. the seed is projected as it is, with several stretches along and across the rows, and with the
   rows in both directions; the direction along which the normal turns less comes first;
3. the sheet is bent step by step from flat to the full target;
4. the sheet is refined step by step from a coarse grid;
5. the seeds are shaken at random, by the request's ``seed``.

On a mesh, seeds and bends are then tried with the scan smoothed more, with the grid turned, and
last on a smaller part of the rectangle. The advice says where the sheet lies.

Exact flat-foldability starts from the developable solution. The sheet is then polished where a
limit is not met or flat-foldability is asked for: brought as close to the target as constraints and
limits allow. The result says what was tried and, without a sheet, what to change.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable

from miurafab.findings import Finding
from miurafab.origami.fitting.request import INTERRUPTED, Attempt, FitRequest, FitResult
from miurafab.origami.fitting.search import coarsest
from miurafab.origami.fitting.strategies import Candidate, strategies_for

LAST_RESORTS = ("bent", "refined", "shaken")
"""The strategies for targets on which the seed alone finds no sheet."""

__all__ = ["Attempt", "FitRequest", "FitResult", "fit"]


def fit(
    request: FitRequest,
    on_progress: Callable[[float, str], None] | None = None,
) -> FitResult:
    """Fit a sheet to the target of ``request``.

    ``on_progress`` gets the fraction done and a description of the strategy. A fit without a sheet
    is a result with advice. Ctrl-C ends the attempts: the result is then the best exact sheet so
    far, with status ``interrupted``; ``KeyboardInterrupt`` is raised only if there is none.
    """
    if request.search:
        return coarsest(request, lambda size, attempts: _fit(size, None, attempts), on_progress)
    return _fit(request, on_progress)


def _fit(
    request: FitRequest,
    on_progress: Callable[[float, str], None] | None,
    attempts: int | None = None,
) -> FitResult:
    """The fit at one number of facets, in at most ``attempts`` attempts."""
    started = time.perf_counter()
    made: list[Attempt] = []
    best: Candidate | None = None
    interrupted = False
    try:
        for number, strategy in enumerate(itertools.islice(strategies_for(request), attempts)):
            if best is not None and best.settles and strategy.way in LAST_RESORTS:
                break
            if on_progress is not None:
                # the number of attempts is not known beforehand; most sheets need one or two
                on_progress(1 - 0.9**number, strategy.describe())
            outcome = strategy.run(request)
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
        stalled = _no_sheet(made)
        return FitResult(
            "stalled",
            stalled.sentence,
            None,
            None,
            tuple(made),
            iterations,
            seconds,
            findings=(stalled,),
        )
    status = "interrupted" if interrupted else "infeasible" if best.faults else "converged"
    findings = [INTERRUPTED, *best.faults] if interrupted else list(best.faults)
    if place := best.attempt.place:
        sentence = f"On the whole rectangle no sheet was found; this one has {place}."
        findings.append(Finding("smaller-part", sentence))
    if best.rank[1]:
        sentence = "The mid-surface lies far from the target; ask for more `facets`."
        findings.append(Finding("far-from-target", sentence))
    return FitResult(
        status,
        " ".join(finding.sentence for finding in findings),
        best.pattern,
        best.measurements,
        tuple(made),
        iterations,
        seconds,
        best.deviation_mm,
        best.polished,
        best.active_bounds,
        findings=tuple(findings),
    )


def _no_sheet(attempts: list[Attempt]) -> Finding:
    residual = min(a.residual for a in attempts)
    return Finding(
        "no-sheet",
        f"No exact sheet was found in {len(attempts)} attempts (best residual {residual:.1e}): "
        "the target bends too much for one sheet of this pattern. Ask for more `facets`, raise "
        "`zigzag` and `amplitude`, drop `flat_foldable`, or take a smaller part of the target.",
    )
