"""A sheet with the barrier that is asked for: its fairness and Kawasaki residuals are tuned.

Sheets are fitted with the usual weight of fairness and with larger ones, which fold more softly at
the same distance, and within limits on the residual (eps_ff), whose residuals are rougher, so that
they have a high barrier closer to the target. The residuals of a fitted sheet are all multiplied by
one factor f, and the rest of the sheet moves as little as possible
(:mod:`~miurafab.origami.fitting.scaling`). The barrier is measured along the folding path of each
such sheet. It goes from 0 at f = 0 up, at first with f^2, so sqrt(asked / measured) is the step,
and regula falsi on logarithms closes in on the answer. Of the sheets with the barrier, the closest
to the target is taken. Where the sheets end before they have it (they cannot be found, cross
themselves, or break a limit), the answer says how far they go.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from miurafab.errors import OptionError, PatternError
from miurafab.findings import Finding
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.curve import energy_curve
from miurafab.origami.fitting.closeness import Closeness
from miurafab.origami.fitting.request import FitRequest
from miurafab.origami.fitting.result import INTERRUPTED, TIME_RAN_OUT, FitResult
from miurafab.origami.fitting.scaling import scaled_residuals, worst_residual
from miurafab.origami.invariants import DEGENERATE, EXACT
from miurafab.origami.nearness import means_to_target
from miurafab.origami.verify import Measurements, measure, with_distances, with_nearness

CLOSE = 0.01
"""A barrier is what was asked within this part."""
STEPS = 24
"""Steps of the folding path."""
FAIRNESS = (10.0, 100.0)
"""The weights of fairness that are tried beside the usual one, over it."""
LIMITS = (0.2, 0.05)
"""The limits on Kawasaki's residual (eps_ff) that are tried, over the worst residual of the fit."""
TRIALS = 30
SHRINKS = 5
WIDEST = (0.25, 2.0)
"""The least and the greatest factor from one sheet to the next."""


class Tried(NamedTuple):
    """A sheet whose residuals are those of the fit times ``factor``, with its ``barrier``."""

    factor: float
    pattern: CreasePattern
    measurements: Measurements
    barrier: float


def tuned(
    request: FitRequest,
    result: FitResult,
    fit: Callable[[FitRequest], FitResult],
    on_progress: Callable[[float, str], None] | None = None,
    ends_at: float = math.inf,
) -> FitResult:
    """``result`` brought to the barrier of ``request``, in k_f L; or ``infeasible``, with the
    nearest sheet and how far the barrier goes. ``fit`` makes the sheet of another request, whose
    distances are not asked for. Ctrl-C ends the search: the result is the nearest sheet up to then,
    ``interrupted``. So does the clock (``time.perf_counter``) at ``ends_at``: that sheet is
    ``infeasible`` unless it has the barrier.

    Raises :class:`~miurafab.errors.OptionError` for a sheet that is not one full grid.
    """
    asked, pattern = request.barrier, result.pattern
    assert asked is not None
    if pattern is None or not result.is_valid:
        return result
    if pattern.grid is None or pattern.pieces_count > 1:
        raise OptionError(
            "barrier",
            "is for a sheet that is one whole grid, and this one is not; ask for one of `pieces`, "
            "and on a mesh for a rectangle as the `edge`",
        )
    worst = worst_residual(pattern)
    if worst <= EXACT:
        return _missed(result, "The sheet folds rigidly, so it has no barrier to change.")
    found: list[Tried] = []

    def left() -> float:
        seconds = ends_at - time.perf_counter()
        if seconds <= 0:
            raise TimeoutError
        return seconds

    def at(family: str, fitted: CreasePattern, factor: float) -> Tried | None:
        left()
        sheet = _tried(request, fitted, factor)
        if sheet is not None:
            found.append(sheet)
        if on_progress is not None:
            said = "no sheet" if sheet is None else f"barrier {sheet.barrier:.3g}"
            on_progress(1 - 0.9 ** len(found), f"{family}, residuals times {factor:.3g}: {said}")
        return sheet

    ended: Finding | None = None
    try:
        _search(asked, partial(at, "the fit", pattern))
        for family, other in _families(request, worst):
            seconds = left()
            fitted = fit(replace(other, timeout=seconds) if math.isfinite(seconds) else other)
            if fitted.status == "interrupted":
                raise KeyboardInterrupt
            sheet = fitted.pattern if fitted.is_valid else None
            if sheet is not None and sheet.grid is not None and worst_residual(sheet) > EXACT:
                _search(asked, partial(at, family, sheet))
    except KeyboardInterrupt:
        ended = INTERRUPTED
        if not found:
            raise
    except TimeoutError:
        ended = TIME_RAN_OUT
    if not found and ended is not None:
        return _ended(result, ended, "infeasible")
    if not found:
        return _missed(result, "The way to flat of the fitted sheet was lost.")
    held = [sheet for sheet in found if _miss(sheet, asked) <= CLOSE]
    best = min(found, key=lambda sheet: _miss(sheet, asked))
    if held:
        best = min(held, key=lambda sheet: means_to_target(sheet.pattern, request.surface))
    measured = with_distances(best.measurements, best.pattern, request.surface)
    answer = replace(
        result,
        pattern=best.pattern,
        measurements=measured,
        deviation_mm=measured.hausdorff_midsurface_mm,
        score=None,
        barrier=best.barrier,
    )
    if _miss(best, asked) <= CLOSE:
        return answer
    if ended is not None:
        return _ended(answer, ended, "interrupted" if ended is INTERRUPTED else "infeasible")
    low = min(found, key=lambda sheet: sheet.barrier)
    high = max(found, key=lambda sheet: sheet.barrier)
    return _missed(
        answer,
        f"No sheet with a barrier of {asked:.3g} k_f L was found: with fairness times 1, "
        f"{_listed(FAIRNESS)}, with residuals within {_listed(LIMITS)} of the usual ones, and with "
        f"all residuals scaled, it has barriers from "
        f"{low.barrier:.3g} (residual {worst_residual(low.pattern):.2g} rad) to "
        f"{high.barrier:.3g} (residual {worst_residual(high.pattern):.2g} rad), and beyond them no "
        "sheet without faults. Ask for other `facets`.",
    )


def _families(request: FitRequest, worst: float) -> list[tuple[str, FitRequest]]:
    """The requests of the other sheets; ``worst`` is the residual of the fit."""
    plain = replace(request, barrier=None)
    fairer = [(f"fairness times {f:g}", replace(plain, fairness=f)) for f in FAIRNESS]
    limits = [share * worst for share in LIMITS]
    within = [(f"eps_ff {eps:.2g}", replace(plain, flat_foldable=eps)) for eps in limits]
    return fairer + within


def _listed(numbers: tuple[float, ...]) -> str:
    return ", ".join(f"{each:g}" for each in numbers)


def _search(asked: float, at: Callable[[float], Tried | None]) -> None:
    """Try sheets until one has the barrier ``asked``, or until they end."""
    here, shrinks = at(1.0), 0
    if here is None:
        return
    step = _step(here, asked)
    for _ in range(TRIALS):
        if _miss(here, asked) <= CLOSE:
            return
        there = at(here.factor * step)
        if there is None:
            shrinks, step = shrinks + 1, math.sqrt(step)
            if shrinks > SHRINKS:
                return
            continue
        if (there.barrier < asked) != (here.barrier < asked):
            _close_in(here, there, asked, at)
            return
        here, step = there, _step(there, asked) if not shrinks else step


def _step(sheet: Tried, asked: float) -> float:
    low, high = WIDEST
    if sheet.barrier <= 0:
        return high
    # a little farther than the square law says, so that the answer is soon between two sheets
    return min(max(math.pow(asked / sheet.barrier, 0.55), low), high)


def _close_in(a: Tried, b: Tried, asked: float, at: Callable[[float], Tried | None]) -> None:
    """Regula falsi (Illinois) on the logarithms of factor and barrier, between two sheets."""
    left, right = _logs(a, asked), _logs(b, asked)
    for _ in range(TRIALS):
        middle = (left[0] * right[1] - right[0] * left[1]) / (right[1] - left[1])
        sheet = at(math.exp(middle))
        if sheet is None or _miss(sheet, asked) <= CLOSE:
            return
        new = _logs(sheet, asked)
        left = (left[0], left[1] / 2) if (new[1] < 0) == (right[1] < 0) else right
        right = new


def _logs(sheet: Tried, asked: float) -> tuple[float, float]:
    return math.log(sheet.factor), math.log(max(sheet.barrier, 1e-6 * asked) / asked)


def _miss(sheet: Tried, asked: float) -> float:
    return abs(sheet.barrier / asked - 1)


def _tried(request: FitRequest, fitted: CreasePattern, factor: float) -> Tried | None:
    """The sheet at ``factor``, None where there is none without faults and within the limits."""
    pattern = fitted if factor == 1.0 else scaled_residuals(fitted, factor)
    if pattern is None:
        return None
    assert pattern.folded_coords is not None
    if request.side_mm is not None:
        extent = float(np.ptp(pattern.folded_coords, axis=0).max())
        pattern = pattern.scaled(request.side_mm / extent)
    measured = measure(pattern)
    if measured.self_intersections or measured.overlaps:
        return None
    if request.max_deviation_mm is not None or request.max_distance_mm is not None:
        measured = with_nearness(measured, pattern, request.surface)
    mean = float(edge_lengths(pattern.vertices_coords, pattern.edges_vertices).mean())
    near = Closeness.of(request, measured, measured.hausdorff_midsurface_mm)
    short = measured.min_edge_mm < (request.min_edge_mm or DEGENERATE * mean)
    if short or near.factor > 1:
        return None
    try:
        curve = energy_curve(pattern, STEPS)
    except PatternError:  # no balance is found at its folded form
        return None
    return Tried(factor, pattern, measured, curve.barrier) if curve.converged else None


def _ended(result: FitResult, why: Finding, status: str) -> FitResult:
    findings = (*(each for each in result.findings if each != why), why)
    return replace(result, status=status, advice=why.sentence, findings=findings)


def _missed(result: FitResult, sentence: str) -> FitResult:
    finding = Finding("barrier", sentence)
    advice = " ".join(filter(None, (result.advice, sentence)))
    return replace(result, status="infeasible", advice=advice, findings=(*result.findings, finding))
