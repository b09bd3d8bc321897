"""A fit with the barrier that is asked for."""

import time
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest

from miurafab.errors import OptionError
from miurafab.origami import coverage
from miurafab.origami.energy import tuning
from miurafab.origami.energy.curve import energy_curve
from miurafab.origami.fitting.fit import fit as fit_sheet
from miurafab.origami.fitting.result import TIME_RAN_OUT
from miurafab.origami.fitting.scaling import with_residual, worst_residual
from miurafab.origami.formats.files import load
from miurafab.origami.verify import measure
from miurafab.workflow.design import design
from miurafab.workflow.fit import fit


@cache
def sheet(target, fairness=1.0, flat_foldable=None):
    request = design(target, facets=(6, 6), size=120).request
    return fit_sheet(replace(request, fairness=fairness, flat_foldable=flat_foldable))


def asked(barrier, target="hypar"):
    """What a fit does with a barrier. The sheets that it tunes are fitted once for all tests, and
    scaled once by each factor.
    """
    request = design(target, facets=(6, 6), size=120, barrier=barrier).request
    assert request.fairness == 1.0
    with mock.patch.object(tuning, "_tried", scaled):
        return tuning.tuned(
            request, sheet(target), lambda other: sheet(target, other.fairness, other.flat_foldable)
        )


SCALED, TRIED = {}, tuning._tried


def scaled(request, fitted, factor):
    """What ``request`` asks for but its barrier is the same in all tests of a target."""
    if (id(fitted), factor) not in SCALED:
        SCALED[id(fitted), factor] = TRIED(request, fitted, factor)
    return SCALED[id(fitted), factor]


def test_the_distances_of_the_first_sheet_and_the_answer_are_measured(monkeypatch, tmp_path):
    """By the whole fit; of no sheet on the way."""
    measured, cover = [], coverage.coverage
    monkeypatch.setattr(
        "miurafab.origami.verify.coverage", lambda *of: measured.append(of) or cover(*of)
    )
    started = time.perf_counter()
    result = fit("hypar", facets=(6, 6), size=120, barrier=1e-6)
    took = time.perf_counter() - started
    assert 0.8 * took < result.seconds < took  # the first sheet takes a tenth
    assert len(measured) == 2
    assert result.measurements.coverage > 0.9
    assert_barrier(result, 1e-6, tmp_path)


def test_the_barrier_is_what_was_asked(tmp_path):
    assert_barrier(asked(1e-3), 1e-3, tmp_path)


def assert_barrier(result, barrier, folder):
    """Measured again from the file, with another number of steps; the sheet is exact."""
    assert (result.status, result.advice) == ("converged", "")
    result.pattern.save(folder / "snaps.fold")
    again = load(folder / "snaps.fold")
    assert energy_curve(again, 31).barrier == pytest.approx(barrier, rel=0.011)
    assert result.report()["barrier"] == pytest.approx(barrier, rel=0.01)
    found = measure(again)
    assert max(found.max_planarity, found.max_developability, found.max_isometry) <= 1e-9
    assert (found.self_intersections, found.overlaps) == (0, 0)
    span = again.folded_coords.max(axis=0) - again.folded_coords.min(axis=0)
    assert span.max() == pytest.approx(120, abs=1e-6)


def test_a_higher_barrier_takes_a_larger_residual(monkeypatch):
    """Of the scaled sheets of one fit; a fit within a limit may have less residual and more."""
    monkeypatch.setattr(tuning, "LIMITS", ())
    monkeypatch.setattr(tuning, "FAIRNESS", ())
    sheets = [asked(barrier) for barrier in (1e-6, 1e-3)]
    worst = [sheet.measurements.max_flat_foldability for sheet in sheets]
    assert worst == sorted(worst)


def test_a_barrier_out_of_reach_is_told_with_what_there_is(monkeypatch):
    monkeypatch.setattr(tuning, "LIMITS", (0.2,))
    monkeypatch.setattr(tuning, "FAIRNESS", (10.0,))
    result = asked(10.0)
    assert result.status == "infeasible"
    assert "barrier" in [finding.code for finding in result.findings]
    assert f"to {result.barrier:.3g} (residual " in result.advice
    assert result.barrier == pytest.approx(energy_curve(result.pattern, 24).barrier)
    assert 1e-3 < result.barrier < 10.0


def test_sheets_without_balance_end_the_search_with_what_there_is(monkeypatch):
    """On the way up to 0.01 a sheet is tried whose folded form is in no balance."""
    monkeypatch.setattr(tuning, "LIMITS", ())
    monkeypatch.setattr(tuning, "FAIRNESS", ())
    result = fit("hypar:height=1", facets=(8, 8), barrier=1e-2)
    assert result.status == "infeasible"
    assert 1e-3 < result.barrier < 1e-2
    assert "beyond them no sheet without faults" in result.advice


@pytest.mark.large
def test_limits_on_the_residual_reach_farther():
    """The barrier that the test above does not reach."""
    result = fit("hypar:height=1", facets=(8, 8), barrier=1e-2)
    assert (result.status, result.barrier) == ("converged", pytest.approx(1e-2, rel=0.01))


def test_a_sheet_that_folds_rigidly_has_no_barrier_to_change():
    result = asked(1e-3, "plane")
    assert result.status == "infeasible"
    assert "folds rigidly" in result.advice


def test_an_interruption_gives_the_nearest_sheet_up_to_then():
    def stop(part, note):
        if "residuals times" in note and "residuals times 1:" not in note:
            raise KeyboardInterrupt

    result = fit("hypar", facets=(4, 4), barrier=1.0, on_progress=stop)
    assert (result.status, result.is_valid) == ("interrupted", True)
    assert result.barrier == pytest.approx(energy_curve(result.pattern, 24).barrier)
    assert "interrupted" in result.advice


@pytest.mark.parametrize("sheets", [0, 2])
def test_time_ends_the_search_too(sheets, monkeypatch):
    """Sheets that a fit makes on the way have the time that is left."""
    request = design("hypar", facets=(6, 6), size=120, barrier=1.0).request
    clock = iter(range(100))
    monkeypatch.setattr(tuning, "time", SimpleNamespace(perf_counter=lambda: next(clock)))
    result = tuning.tuned(request, sheet("hypar"), pytest.fail, ends_at=sheets - 0.5)
    assert (result.status, result.advice) == ("infeasible", TIME_RAN_OUT.sentence)
    assert result.findings.count(TIME_RAN_OUT) == 1
    assert next(clock) == sheets + 1
    if sheets:
        assert result.barrier == pytest.approx(energy_curve(result.pattern, 24).barrier)
    else:
        assert result.pattern is sheet("hypar").pattern
    monkeypatch.setattr(tuning, "_search", lambda *_: None)
    given = []

    def fitted(other):
        given.append(other.timeout)
        return sheet("hypar")

    clock = iter(range(100))
    tuning.tuned(request, sheet("hypar"), fitted, ends_at=2.5)
    assert given == [2.5, 1.5, 0.5]


@cache
def small():
    """The request and the fit of a small sheet, whose barrier is about 1e-3 k_f L."""
    request = design("hypar", facets=(4, 4), size=120).request
    return request, fit_sheet(request)


@pytest.fixture
def lawful(monkeypatch):
    """Lets the barrier of the one fit be a law of the factor (None: no sheet); gives the factors
    that are tried.
    """

    def by(barrier):
        seen = []

        def tried(request, fitted, factor):
            seen.append(factor)
            found = barrier(factor)
            return found and tuning.Tried(factor, fitted, small()[1].measurements, found)

        monkeypatch.setattr(tuning, "_tried", tried)
        monkeypatch.setattr(tuning, "_families", lambda *_: [])
        monkeypatch.setattr(tuning, "with_distances", lambda measured, *_: measured)
        return seen

    return by


@pytest.mark.parametrize(
    "barrier",
    [lambda f: 1e-3 * f**2, lambda f: 1e-3 * f**0.7, lambda f: 1e-3 * (f**2 + f**5)],
    ids=["square", "slow", "fast"],
)
@pytest.mark.parametrize("wanted", [1e-6, 3e-2])
def test_a_barrier_that_grows_is_met_in_few_sheets(barrier, wanted, lawful):
    request, result = small()
    seen = lawful(barrier)
    found = tuning.tuned(replace(request, barrier=wanted), result, None)
    assert found.barrier == pytest.approx(wanted, rel=tuning.CLOSE)
    assert found.status == "converged"
    assert len(seen) <= 25


@pytest.mark.parametrize(
    ("barrier", "most"),
    [
        (lambda f: 1e-3, 31),  # which no factor changes
        (lambda f: 1e-3 if f < 2 else 1.0, 33),  # which jumps over what is asked
        (lambda f: -1e-9 if f < 1.5 else 1e-3, 31),  # which is none at first
        (lambda f: 1e-3 if f == 1.0 else None, 7),  # of the fit alone
    ],
    ids=["constant", "jump", "none", "alone"],
)
def test_a_barrier_that_is_not_met_ends_the_search(barrier, most, lawful):
    request, result = small()
    seen = lawful(barrier)
    found = tuning.tuned(replace(request, barrier=0.1), result, None)
    assert found.status == "infeasible"
    assert "No sheet with a barrier of 0.1 k_f L was found" in found.advice
    assert 1 < len(seen) <= most


def test_a_lost_way_and_a_fit_without_a_sheet_are_told(monkeypatch):
    request, result = small()
    request = replace(request, barrier=0.1)
    none = replace(result, status="stalled", pattern=None, measurements=None)
    assert tuning.tuned(request, none, None) is none
    with pytest.raises(OptionError, match="'barrier' is for a sheet that is one whole grid"):
        tuning.tuned(request, replace(result, pattern=replace(result.pattern, grid=None)), None)
    monkeypatch.setattr(tuning, "_tried", lambda *_: None)
    # of the other fits one has no sheet, and Ctrl-C ends another before there is any
    found = tuning.tuned(request, result, lambda other: none)
    assert found.status == "infeasible"
    assert "The way to flat of the fitted sheet was lost." in found.advice
    with pytest.raises(KeyboardInterrupt):
        tuning.tuned(request, result, lambda other: replace(result, status="interrupted"))


def test_residuals_that_are_not_found_are_no_sheet(monkeypatch):
    pattern = small()[1].pattern
    half = worst_residual(pattern) / 2
    assert worst_residual(with_residual(pattern, half)) == pytest.approx(half)
    monkeypatch.setattr("miurafab.origami.fitting.scaling.scaled_residuals", lambda *_: None)
    with pytest.raises(ArithmeticError, match=r"no sheet with residuals up to 0\.01 was found"):
        with_residual(pattern, 0.01)


def test_a_sheet_beyond_a_limit_is_no_answer():
    request, result = small()
    inside = replace(request, max_deviation_mm=2 * result.deviation_mm)
    one = tuning._tried(inside, result.pattern, 1.0)
    assert one.barrier == pytest.approx(energy_curve(result.pattern, tuning.STEPS).barrier)
    beyond = replace(request, max_deviation_mm=result.deviation_mm / 2)
    assert tuning._tried(beyond, result.pattern, 1.0) is None
    long = replace(request, min_edge_mm=2 * result.measurements.min_edge_mm)
    assert tuning._tried(long, result.pattern, 1.0) is None
    free = replace(request, size_mm=None)
    assert tuning._tried(free, result.pattern, 1.0).pattern is result.pattern


@pytest.mark.parametrize(
    ("options", "part"),
    [
        ({"flat_foldable": "0.016rad"}, "give only one of the two"),
        ({"min_angle": 50}, "leave them out"),
        ({"pieces": 2}, "one piece"),
        ({"barrier": 0}, "barrier"),
    ],
)
def test_what_does_not_go_with_a_barrier_is_said(options, part):
    with pytest.raises(OptionError, match=part):
        fit("hypar", facets=(6, 6), **({"barrier": 1e-4} | options))


def test_fairness_gives_a_closer_sheet_with_the_same_barrier(monkeypatch):
    monkeypatch.setattr(tuning, "LIMITS", ())
    found = asked(1e-3, "sphere")
    monkeypatch.setattr(tuning, "FAIRNESS", ())
    scaled = asked(1e-3, "sphere")
    assert (found.status, scaled.status) == ("converged", "converged")
    assert found.barrier == pytest.approx(scaled.barrier, rel=0.02)
    assert found.deviation_mm < 0.9 * scaled.deviation_mm


def test_limits_on_the_residual_give_a_closer_sheet_with_the_same_barrier(monkeypatch):
    """eps_ff is tuned: from rougher residuals a high barrier is nearer to the target."""
    monkeypatch.setattr(tuning, "FAIRNESS", ())
    found = asked(1e-3)
    monkeypatch.setattr(tuning, "LIMITS", ())
    without = asked(1e-3)
    assert (found.status, without.status) == ("converged", "converged")
    assert found.barrier == pytest.approx(1e-3, rel=0.01)
    assert found.barrier == pytest.approx(without.barrier, rel=0.02)
    assert found.deviation_mm < 0.6 * without.deviation_mm
    assert found.measurements.max_flat_foldability < without.measurements.max_flat_foldability


@pytest.mark.parametrize("name", ["barrier", "size", "amplitude", "min_edge", "seed"])
@pytest.mark.parametrize("truth", [True, np.True_])
def test_yes_is_no_number(name, truth):
    with pytest.raises(OptionError, match=f"'{name}' is True, not a"):
        design("hypar", **{name: truth})


def test_a_small_barrier_is_shown_as_it_is():
    with pytest.raises(OptionError, match="'barrier' is -1e-12; it must be greater than 0"):
        design("hypar", barrier=-1e-12)
