"""The coarsest sheet within a largest distance and a shortest edge.

More facets bring the sheet closer to the target and make its edges shorter, so the limits bound the
number n of facets along the longer side from both sides. The distance is that of the middle
(`max_deviation`), or that of the whole sheet both ways (`max_distance`), or each within its own
limit.

The laws of a fine sheet predict where to look: the height of the corrugation, and so the distance
of the whole sheet, falls as 1/n, that of the middle as 1/n^2, and edges as 1/n. A sheet that misses
a limit on a distance by the factor f is therefore followed by one of f n or sqrt(f) n, and one that
meets all limits by a coarser one, until a size holds and the next coarser one fails. A size holds
where its sheet meets all limits and can be folded well (a score of at most ``ENOUGH``, distances
apart); only if there is none, the coarsest of those that meet the limits is the answer.

The search ends early where the prediction lies far beyond the size at which the mean edge is too
short. If no size meets all limits, the answer says which limit fails, and by how much, on the
nearest sheet.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import replace

from miurafab.findings import Finding
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.fitting.closeness import Closeness
from miurafab.origami.fitting.request import FitRequest
from miurafab.origami.fitting.result import INTERRUPTED, TIME_RAN_OUT, FitResult
from miurafab.origami.fitting.score import ENOUGH

COARSEST = 4
"""Facets along the longer side of the coarsest sheet tried."""
FINEST = 160
"""Facets along the longer side of the finest sheet tried."""
FIRST = 8
"""Facets along the longer side of the coarse seed that predicts the first size."""
FIRST_AT_MOST = 24
"""The finest sheet to begin with: from it a request that no sheet meets is known as such in
seconds."""
FAIRER = 0.5
"""The first size over that which a seed predicts: with the limit on the distance in its objective a
sheet of half the size does, measured on hypar, saddle and vase."""
COARSER = 0.7
LEAST_STEP, FINER = 1.2, 2.5
"""The next size over the last, at least and at most, where the last one failed."""
NO_TIME = 1e-6
"""The time in s for a first size where none is left."""
BEYOND = 1.5
"""A prediction so many times the largest size with edges long enough ends the search. A hypar's
prediction at 8 facets was 1.2 times what it took."""
AT_LIMIT = 1.05
"""An edge is at its limit where it is at most this many times as long."""
NO_CLOSER = 0.97


def coarsest(
    request: FitRequest,
    fit: Callable[[FitRequest], FitResult],
    on_progress: Callable[[float, str], None] | None = None,
) -> FitResult:
    """The sheet with the fewest facets that meets every limit of ``request``, or the nearest sheet.

    ``fit`` fits one size. ``request.columns`` and ``rows``
    give only the proportion of the sheet.
    """
    started = time.perf_counter()
    tried: dict[int, FitResult] = {}

    def trial(longer: int) -> FitResult:
        columns, rows = _shape(request, longer)
        if on_progress is not None:
            on_progress(1 - 0.8 ** len(tried), f"{columns}x{rows} facets")
        limit = request.timeout
        left = None if limit is None else limit - (time.perf_counter() - started)
        if left is not None and left <= 0:
            if tried:
                raise TimeoutError
            left = NO_TIME  # the first fit says what came of that
        # more pieces would hide that a size is too coarse
        pieces = request.pieces or 1
        size = replace(request, facets=(columns, rows), timeout=left, pieces=pieces)
        tried[longer] = fit(size)
        if tried[longer].status == "interrupted":
            raise KeyboardInterrupt
        if TIME_RAN_OUT in tried[longer].findings:
            raise TimeoutError  # what it might have become is not known
        return tried[longer]

    try:
        first = _predicted(request, fit, request.timeout)
        best = _search(request, trial, tried, first)
    except KeyboardInterrupt:
        found = _best_so_far(request, tried, INTERRUPTED)
        if found is None:
            raise
        best = replace(found, status="interrupted")
    except TimeoutError:
        found = _best_so_far(request, tried, TIME_RAN_OUT)
        best = found or next(iter(tried.values()))  # which says that there is none
    if on_progress is not None:
        on_progress(1.0, "done")
    return replace(
        best,
        attempts=tuple(itertools.chain.from_iterable(r.attempts for r in tried.values())),
        iterations=sum(r.iterations for r in tried.values()),
        seconds=time.perf_counter() - started,
    )


def _search(
    request: FitRequest,
    trial: Callable[[int], FitResult],
    tried: Mapping[int, FitResult],
    first: int,
) -> FitResult:
    """Close in on the size that meets the limits while the next coarser one fails, from ``first``
    on; ``trial`` fills ``tried``.
    """
    coarse, fine, held, following = COARSEST - 2, FINEST + 2, False, first
    while fine - coarse > 2:
        result = trial(following)
        if _holds(result):
            fine, held = following, True
        elif _too_fine(request, result):
            fine = following
            if not held and _longest(request, result, following) <= coarse:
                break
        else:
            coarse = following
            if not held and _hopeless(request, tried, following):
                break
        following = _next(request, tried, coarse, fine)
    for good in (_holds, _converged):
        for size in sorted(tried):
            if good(tried[size]):
                return tried[size]
    best = replace(min(tried.values(), key=_miss(request)), status="infeasible")
    why = Finding("no-sheet-in-limits", _why(request, list(tried.values()), best))
    return replace(best, advice=why.sentence, findings=(why,))


def _converged(result: FitResult) -> bool:
    return result.status == "converged"


def _holds(result: FitResult) -> bool:
    """Whether the sheet meets all limits and can be folded well."""
    return _converged(result) and result.score is not None and result.score.form <= ENOUGH


def _too_fine(request: FitRequest, result: FitResult) -> bool:
    """Whether the sheet is close enough and misses the limit on edges."""
    m, least = result.measurements, request.min_edge_mm
    if m is None or least is None or m.min_edge_mm >= least:
        return False
    return _closeness(request, result).factor <= 1


def _longest(request: FitRequest, result: FitResult, size: int) -> float:
    """The size at which the shortest edge of ``result`` would be long enough."""
    assert result.measurements is not None
    assert request.min_edge_mm is not None
    return size * result.measurements.min_edge_mm / request.min_edge_mm


def _predicted(
    request: FitRequest, fit: Callable[[FitRequest], FitResult], timeout: float | None
) -> int:
    """The size to begin with, from the projection of a coarse seed, which takes a moment."""
    plain = replace(
        request,
        facets=_shape(request, FIRST),
        polish="off",
        pieces=1,
        timeout=timeout,
        min_edge_mm=None,
        max_deviation_mm=None,
        max_distance_mm=None,
    )
    result = fit(plain)
    if result.pattern is None:
        return FIRST
    needed = FAIRER * _needed(request, result, FIRST)
    size = min(needed, _largest(request, result.pattern, FIRST), FIRST_AT_MOST)
    return max(2 * round(size / 2), COARSEST)


def _largest(request: FitRequest, pattern: CreasePattern, size: int) -> float:
    """The largest size whose mean edge is long enough, by that of ``pattern`` of ``size``."""
    lengths = edge_lengths(pattern.vertices_coords, pattern.edges_vertices)
    return size * float(lengths.mean()) / (request.min_edge_mm or math.inf)


def _next(request: FitRequest, tried: Mapping[int, FitResult], coarse: int, fine: int) -> int:
    """The size to try between ``coarse``, which fails, and ``fine``, which holds."""
    if coarse in tried:
        needed = max(_needed(request, tried[coarse], coarse), LEAST_STEP * coarse)
        guess = min(needed, FINER * coarse)
        guess = min(guess, (coarse + fine) / 2) if fine <= FINEST else guess
    else:
        guess = COARSER * fine
    return min(max(2 * round(guess / 2), coarse + 2), fine - 2)


def _needed(request: FitRequest, result: FitResult, size: int) -> float:
    """The size that the distances of ``result`` predict."""
    factors = _closeness(request, result).factors
    if not all(map(math.isfinite, factors.values())):
        return FINER * size
    middle, whole = (factors.get(name, 0.0) for name in ("max_deviation", "max_distance"))
    return size * max(math.sqrt(middle), whole)


def _hopeless(request: FitRequest, tried: Mapping[int, FitResult], size: int) -> bool:
    """Whether no finer sheet than the finest, of ``size``, will do: by what it predicts, a sheet
    that is close enough has edges too short; or it is the second that lies no closer than a coarser
    one, with edges at their limit.
    """
    result = tried[size]
    if result.pattern is None or result.measurements is None or request.min_edge_mm is None:
        return False
    largest = _largest(request, result.pattern, size)
    if size >= largest or _needed(request, result, size) > BEYOND * largest:
        return True
    factors = [_closeness(request, tried[n]).factor for n in sorted(tried)]
    pressed = result.measurements.min_edge_mm <= AT_LIMIT * request.min_edge_mm
    closest = min(factors[:-2], default=math.inf)
    return pressed and min(factors[-2:]) > max(1.0, NO_CLOSER * closest)


def _best_so_far(
    request: FitRequest, tried: Mapping[int, FitResult], why: Finding
) -> FitResult | None:
    """The result to hand back after Ctrl-C or at the time limit, with ``why`` as its advice: the
    coarsest sheet within all limits, else the nearest one; None where no size has a sheet.
    """
    sheets = [tried[n] for n in sorted(tried) if tried[n].pattern is not None]
    if not sheets:
        return None
    for good in (_holds, _converged):
        if within := next(filter(good, sheets), None):
            others = (each for each in within.findings if each != why)
            return replace(within, advice=why.sentence, findings=(why, *others))
    nearest = min(sheets, key=_miss(request))
    return replace(nearest, status="infeasible", advice=why.sentence, findings=(why,))


def _shape(request: FitRequest, longer: int) -> tuple[int, int]:
    """Columns and rows with the proportion of the request; an even number of rows stays even, so
    that a ring closes.
    """
    scale = longer / max(request.columns, request.rows)
    even = request.rows % 2 == 0
    rows = 2 * round(request.rows * scale / 2) if even else round(request.rows * scale)
    return max(2, round(request.columns * scale)), max(2, rows)


def _closeness(request: FitRequest, result: FitResult) -> Closeness:
    return Closeness.of(request, result.measurements, result.deviation_mm)


def _miss(request: FitRequest) -> Callable[[FitResult], tuple[bool, float]]:
    """The key of the order of results: self-crossings, then the largest factor over a limit."""

    def miss(result: FitResult) -> tuple[bool, float]:
        m = result.measurements
        if m is None:
            return True, float("inf")
        factors = [1.0, _closeness(request, result).factor]
        if request.min_edge_mm is not None:
            factors.append(request.min_edge_mm / max(m.min_edge_mm, 1e-12))
        return bool(m.overlaps or m.self_intersections), max(factors)

    return miss


def _why(request: FitRequest, results: list[FitResult], best: FitResult) -> str:
    """Which limit fails and by how much."""
    sound = [r for r in results if r.measurements and not _miss(request)(r)[0]]
    if not sound or best.measurements is None:
        return f"No valid sheet was found at any of {len(results)} sizes. {best.advice}".strip()
    edge = request.min_edge_mm or 0.0
    limits = " and ".join(f"{limit:.3g} mm" for _, _, limit in _closeness(request, best).pairs)
    parts = []
    wide = [r for r in sound if r.measurements and r.measurements.min_edge_mm >= edge]
    if wide:
        nearest = min(wide, key=lambda r: _closeness(request, r).factor)
        assert nearest.measurements is not None
        far = " and ".join(
            f"{distance:.3g} mm from the target {part}, {distance - limit:.3g} mm over the "
            f"{limit:.3g} mm allowed"
            for part, distance, limit in _closeness(request, nearest).pairs
            if distance > limit
        )
        parts.append(
            f"with edges of {edge:.3g} mm the closest sheet ({nearest.measurements.facets} facets) "
            f"lies {far}"
        )
    close = [r for r in sound if _closeness(request, r).factor <= 1]
    if close:
        longest = max(close, key=lambda r: r.measurements.min_edge_mm if r.measurements else 0.0)
        assert longest.measurements is not None
        parts.append(
            f"within {limits} the longest shortest edge ({longest.measurements.facets} "
            f"facets) is {longest.measurements.min_edge_mm:.3g} mm, "
            f"{edge - longest.measurements.min_edge_mm:.3g} mm under the {edge:.3g} mm asked for"
        )
    nearest_sheets = "; ".join(parts) or best.advice
    return f"No sheet meets all limits: {nearest_sheets}. Loosen one of them, or enlarge `size`."
