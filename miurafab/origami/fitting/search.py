"""The coarsest sheet within a largest distance and a shortest edge.

More facets bring the sheet closer to the target and make its edges shorter, so the limits bound the
number of facets from both sides. The distance is that of the middle (`max_deviation`), or that of
the whole sheet both ways (`max_distance`), or each within its own limit. The search refines the
sheet in steps until all limits are met, then bisects the last step for the coarsest such sheet.
Each size is tried with several corrugations and polished. If no size meets all limits, the answer
says which limit fails, and by how much, on the nearest sheet.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Mapping
from dataclasses import replace

from miurafab.findings import Finding
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.fitting.closeness import Closeness
from miurafab.origami.fitting.request import FitRequest
from miurafab.origami.fitting.result import INTERRUPTED, TIME_RAN_OUT, FitResult

COARSEST = 4
"""Facets along the longer side of the coarsest sheet tried."""
FINER = 1.5
FINEST = 160
"""Facets along the longer side of the finest sheet tried."""


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
        if longer not in tried:
            columns, rows = _shape(request, longer)
            if on_progress is not None:
                on_progress(1 - 0.8 ** len(tried), f"{columns}x{rows} facets")
            limit = request.timeout
            left = None if limit is None else limit - (time.perf_counter() - started)
            if left is not None and left <= 0:
                raise TimeoutError
            # more pieces would hide that a size is too coarse
            pieces = request.pieces or 1
            size = replace(request, facets=(columns, rows), timeout=left, pieces=pieces)
            tried[longer] = fit(size)
            if tried[longer].status == "interrupted":
                raise KeyboardInterrupt
        return tried[longer]

    try:
        best = _search(request, trial, tried)
    except KeyboardInterrupt:
        best = _best_so_far(request, tried, "interrupted", INTERRUPTED)
    except TimeoutError:
        best = _best_so_far(request, tried, "infeasible", TIME_RAN_OUT)
    if on_progress is not None:
        on_progress(1.0, "done")
    return replace(
        best,
        attempts=tuple(itertools.chain.from_iterable(r.attempts for r in tried.values())),
        iterations=sum(r.iterations for r in tried.values()),
        seconds=time.perf_counter() - started,
    )


def _search(
    request: FitRequest, trial: Callable[[int], FitResult], tried: Mapping[int, FitResult]
) -> FitResult:
    """Make the sheet finer until it meets the limits, then coarser; ``trial`` fills ``tried``."""
    for longer in _sizes():
        result = trial(longer)
        if result.status == "converged":
            coarse = max((n for n in tried if n < longer), default=COARSEST)
            return _halve(trial, coarse, longer)
        if _too_fine(request, result):
            break
    best = replace(min(tried.values(), key=_miss(request)), status="infeasible")
    why = Finding("no-sheet-in-limits", _why(request, list(tried.values()), best))
    return replace(best, advice=why.sentence, findings=(why,))


def _best_so_far(
    request: FitRequest, tried: Mapping[int, FitResult], status: str, why: Finding
) -> FitResult:
    """The result to hand back after Ctrl-C or at the time limit, with ``why`` as its advice. Raises
    ``KeyboardInterrupt`` where no size has a sheet.
    """
    miss = _miss(request)
    sheets = [tried[n] for n in sorted(tried) if tried[n].pattern is not None]
    if not sheets:
        raise KeyboardInterrupt
    return replace(
        min(sheets, key=miss),
        status=status,
        advice=why.sentence,
        findings=(why,),
    )


def _sizes() -> list[int]:
    sizes = [COARSEST]
    while sizes[-1] < FINEST:
        sizes.append(min(FINEST, 2 * round(sizes[-1] * FINER / 2)))
    return sizes


def _shape(request: FitRequest, longer: int) -> tuple[int, int]:
    """Columns and rows with the proportion of the request; an even number of rows stays even, so
    that a ring closes.
    """
    scale = longer / max(request.columns, request.rows)
    even = request.rows % 2 == 0
    rows = 2 * round(request.rows * scale / 2) if even else round(request.rows * scale)
    return max(2, round(request.columns * scale)), max(2, rows)


def _halve(trial: Callable[[int], FitResult], coarse: int, fine: int) -> FitResult:
    """The result at the least size over ``coarse``, which fails, up to ``fine``, which holds."""
    while fine - coarse > 2:
        middle = 2 * round((coarse + fine) / 4)
        if trial(middle).status == "converged":
            fine = middle
        else:
            coarse = middle
    return trial(fine)


def _too_fine(request: FitRequest, result: FitResult) -> bool:
    """Whether the mean edge is too short, so that finer sheets cannot succeed."""
    if result.pattern is None or request.min_edge_mm is None:
        return False
    lengths = edge_lengths(result.pattern.vertices_coords, result.pattern.edges_vertices)
    return float(lengths.mean()) < request.min_edge_mm


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
