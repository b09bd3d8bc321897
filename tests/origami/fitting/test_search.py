"""The search of a number of facets, on sheets made up by the laws of fine sheets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.fitting.closeness import Closeness
from miurafab.origami.fitting.request import FitRequest
from miurafab.origami.fitting.result import TIME_RAN_OUT, FitResult
from miurafab.origami.fitting.score import Score
from miurafab.origami.fitting.search import COARSEST, FINEST, coarsest
from miurafab.origami.verify import Measurements
from miurafab.surfaces.catalogue import make_surface

Fit = Callable[[FitRequest], FitResult]
HYPAR = make_surface("hypar", {})[0]
GOOD = Score(*[1.0] * 8, 0)
POOR = Score(*[1.0] * 4, 5.0, *[1.0] * 3, 0)


def request(**limits: float | None) -> FitRequest:
    return FitRequest(surface=HYPAR, facets=(16, 16), size_mm=200.0, **limits)


def square(side: float) -> CreasePattern:
    """A facet of this side, which is the mean edge of the pattern."""
    corners = side * np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
    around = np.array([[0, 1], [1, 2], [2, 3], [0, 3]])
    return CreasePattern(corners, around, np.full(4, "B"), np.zeros(4), np.array([[0, 1, 2, 3]]))


def lawful(middle: float, whole: float, side: float, score: Score = GOOD, low: float = 1.0) -> Fit:
    """A fit of n x n facets by the laws: its middle lies ``middle`` / n^2 and the whole of it
    ``whole`` / n from the target, and edges are ``side`` / n long, the shortest ``low`` of that.
    """

    def fit(asked: FitRequest) -> FitResult:
        n = max(asked.columns, asked.rows)
        edge = low * side / n
        measured = Measurements(n * n, (n + 1) ** 2, edge, 0, hausdorff_mm=whole / n)
        near = Closeness.of(asked, measured, middle / n**2).factor <= 1
        status = "converged" if near and edge >= (asked.min_edge_mm or 0.0) else "infeasible"
        return FitResult(
            status, "", square(side / n), measured, (), 1, 0.0, deviation_mm=middle / n**2,
            score=score,
        )  # fmt: skip

    return fit


sizes = st.floats(20.0, 5000.0)


@settings(max_examples=60, deadline=None)
@given(sizes, sizes, st.floats(100.0, 3000.0), st.sampled_from(["middle", "whole", "both"]))
def test_where_the_laws_hold_the_answer_is_the_coarsest_size_within_all_limits(
    middle: float, whole: float, side: float, which: str
) -> None:
    limits: dict[str, float] = {"min_edge_mm": 8.0}
    if which != "whole":
        limits["max_deviation_mm"] = 0.5
    if which != "middle":
        limits["max_distance_mm"] = 5.0
    asked, fit = request(**limits), lawful(middle, whole, side)
    seen: list[FitRequest] = []

    def counted(size: FitRequest) -> FitResult:
        seen.append(size)
        return fit(size)

    found = coarsest(asked, counted)
    every = [fit(replace(asked, facets=(n, n))) for n in range(COARSEST, FINEST + 1, 2)]
    good = [each.measurements.facets for each in every if each.status == "converged"]
    if good:
        assert (found.status, found.measurements.facets) == ("converged", good[0])
    else:
        assert found.status == "infeasible"
        assert found.advice.startswith("No sheet meets all limits: ")
        assert [finding.code for finding in found.findings] == ["no-sheet-in-limits"]
    assert len({size.columns for size in seen[1:]}) == len(seen) - 1, "no size is fitted twice"
    assert found.iterations == len(seen) - 1


def test_short_edges_of_a_close_sheet_ask_for_coarser_ones() -> None:
    """The shortest edge is a third of the mean one: what is close enough, 10 x 10 facets, has
    edges of 4 mm, and what has edges of 5 mm lies 0.78 mm off.
    """
    fit = lawful(50.0, 0.0, 120.0, low=1 / 3)
    found = coarsest(request(max_deviation_mm=0.5, min_edge_mm=5.0), fit)
    assert found.status == "infeasible"
    assert found.advice == (
        "No sheet meets all limits: with edges of 5 mm the closest sheet (64 facets) lies 0.781 mm "
        "from the target by its middle, 0.281 mm over the 0.5 mm allowed; within 0.5 mm the "
        "longest shortest edge (100 facets) is 4 mm, 1 mm under the 5 mm asked for. Loosen one of "
        "them, or enlarge `size`."
    )


def test_where_none_folds_well_the_coarsest_within_the_limits_is_the_answer() -> None:
    fit, fitted = lawful(0.0, 100.0, 900.0, POOR), []

    def kept(asked: FitRequest) -> FitResult:
        fitted.append(fit(asked))
        return fitted[-1]

    found = coarsest(request(max_distance_mm=5.0), kept)
    assert found.status == "converged"
    within = [each.measurements.facets for each in fitted[1:] if each.status == "converged"]
    assert found.measurements.facets == min(within) < max(within)


def test_without_any_sheet_the_advice_is_that_of_the_fit() -> None:
    def none(asked: FitRequest) -> FitResult:
        return FitResult("stalled", "The target bends too much.", None, None, (), 2, 0.0)

    found = coarsest(request(max_deviation_mm=0.5, min_edge_mm=5.0), none)
    assert found.status == "infeasible"
    assert found.pattern is None
    assert found.advice.startswith("No valid sheet was found at any of ")
    assert found.advice.endswith(" sizes. The target bends too much.")


def crossing(asked: FitRequest) -> FitResult:
    made = lawful(50.0, 0.0, 300.0)(asked)
    return replace(made, status="infeasible", measurements=replace(made.measurements, overlaps=1))


def test_sheets_that_cross_themselves_are_no_valid_ones() -> None:
    found = coarsest(request(max_deviation_mm=0.5), crossing)
    assert found.status == "infeasible"
    assert "No valid sheet was found at any of" in found.advice


@pytest.mark.parametrize("after", [1, 2, 3])
def test_ctrl_c_and_time_leave_the_nearest_sheet(
    after: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After the seed and ``after`` sizes; without a size there is nothing to hand back."""
    fit, fitted = lawful(900.0, 0.0, 3000.0), []

    def stopped(asked: FitRequest) -> FitResult:
        made = fit(asked)
        fitted.append(made)
        return replace(made, status="interrupted") if len(fitted) > after else made

    asked = request(max_deviation_mm=0.5, timeout=10.0)
    found = coarsest(asked, stopped)
    nearest = min(each.deviation_mm for each in fitted[1:])
    assert (found.status, found.deviation_mm) == ("interrupted", nearest)
    assert "interrupted" in found.advice

    now = iter(range(0, 10_000, 10 // after + 1 if after > 1 else 20))
    monkeypatch.setattr("miurafab.origami.fitting.search.time.perf_counter", lambda: next(now))
    late = coarsest(asked, fit)
    assert late.status == "infeasible"
    assert "`timeout` ended the search" in late.advice


def test_a_sheet_within_the_limits_stays_valid_when_time_runs_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    fit, fitted = lawful(900.0, 0.0, 3000.0), []

    def kept(asked: FitRequest) -> FitResult:
        fitted.append(fit(asked))
        return fitted[-1]

    now = 0.0
    monkeypatch.setattr("miurafab.origami.fitting.search.time.perf_counter", lambda: now)

    def late(asked: FitRequest) -> FitResult:
        nonlocal now
        made = kept(asked)
        now = 20.0 if made.status == "converged" and len(fitted) > 1 else 0.0
        return made

    found = coarsest(request(max_deviation_mm=0.5, timeout=10.0), late)
    assert found.status == fitted[-1].status == "converged"
    assert found.measurements.facets == fitted[-1].measurements.facets
    assert "`timeout` ended the search" in found.advice


def test_a_fit_that_time_cut_short_says_nothing_of_what_is_possible() -> None:
    """Edges of 8 mm are far longer than a sheet within 0.001 mm has; but that sheet was not
    polished, so "No sheet meets all limits" would claim what nobody knows.
    """
    fit = lawful(900.0, 0.0, 3000.0)

    def cut_short(asked: FitRequest) -> FitResult:
        return replace(fit(asked), findings=(TIME_RAN_OUT,))

    asked = request(max_deviation_mm=0.001, min_edge_mm=8.0, timeout=10.0)
    assert coarsest(asked, fit).advice.startswith("No sheet meets all limits")
    found = coarsest(asked, cut_short)
    assert found.status == "infeasible"
    assert found.advice == TIME_RAN_OUT.sentence
    assert found.findings == (TIME_RAN_OUT,)


def test_ctrl_c_before_there_is_a_sheet_goes_on() -> None:
    def none(asked: FitRequest) -> FitResult:
        status = "stalled" if asked.max_deviation_mm is None else "interrupted"
        return FitResult(status, "", None, None, (), 0, 0.0)

    with pytest.raises(KeyboardInterrupt):
        coarsest(request(max_deviation_mm=0.5), none)


def test_edges_longer_than_those_of_the_coarsest_sheet_end_the_search_at_once() -> None:
    told: list[tuple[float, str]] = []
    asked = request(max_deviation_mm=0.5, min_edge_mm=100.0)
    found = coarsest(asked, lawful(1.0, 0.0, 120.0), lambda *each: told.append(each))
    assert told == [(0.0, "4x4 facets"), (1.0, "done")]
    assert found.advice == (
        "No sheet meets all limits: within 0.5 mm the longest shortest edge (16 facets) is 30 mm, "
        "70 mm under the 100 mm asked for. Loosen one of them, or enlarge `size`."
    )
