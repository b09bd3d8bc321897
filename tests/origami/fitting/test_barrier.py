"""A fit with the barrier that is asked for."""

from functools import cache

import pytest

from miurafab.errors import OptionError
from miurafab.origami.energy.curve import energy_curve
from miurafab.origami.formats.files import load
from miurafab.origami.verify import measure
from miurafab.workflow.fit import fit


@cache
def asked(barrier, target="hypar", **options):
    return fit(target, facets=(6, 6), size=120, barrier=barrier, **options)


@pytest.mark.parametrize("barrier", [1e-6, 5e-3])
def test_the_barrier_is_what_was_asked(barrier, tmp_path):
    """Measured again from the file, with another number of steps; the sheet is exact."""
    result = asked(barrier)
    assert (result.status, result.advice) == ("converged", "")
    result.pattern.save(tmp_path / "snaps.fold")
    again = load(tmp_path / "snaps.fold")
    assert energy_curve(again, 31).barrier == pytest.approx(barrier, rel=0.011)
    assert result.report()["barrier"] == pytest.approx(barrier, rel=0.01)
    found = measure(again)
    assert max(found.max_planarity, found.max_developability, found.max_isometry) <= 1e-9
    assert (found.self_intersections, found.overlaps) == (0, 0)
    span = again.folded_coords.max(axis=0) - again.folded_coords.min(axis=0)
    assert span.max() == pytest.approx(120, abs=1e-6)


def test_a_higher_barrier_takes_a_larger_residual():
    worst = [asked(barrier).measurements.max_flat_foldability for barrier in (1e-6, 5e-3)]
    assert worst == sorted(worst)


def test_a_barrier_out_of_reach_is_told_with_what_there_is():
    result = asked(10.0)
    assert result.status == "infeasible"
    assert "barrier" in [finding.code for finding in result.findings]
    assert f"to {result.barrier:.3g} (residual " in result.advice
    assert result.barrier == pytest.approx(energy_curve(result.pattern, 24).barrier)
    assert 1e-3 < result.barrier < 10.0


def test_sheets_without_balance_end_the_search_with_what_there_is():
    """On the way up to 0.01 a sheet is tried whose folded form is in no balance."""
    result = fit("hypar:height=1", facets=(8, 8), barrier=1e-2)
    assert result.status == "infeasible"
    assert 1e-3 < result.barrier < 1e-2
    assert "beyond them no sheet without faults" in result.advice


def test_a_sheet_that_folds_rigidly_has_no_barrier_to_change():
    result = asked(1e-3, "plane")
    assert result.status == "infeasible"
    assert "folds rigidly" in result.advice


def test_an_interruption_gives_the_nearest_sheet_up_to_then():
    def stop(part, note):
        if note.startswith("residuals times") and not note.startswith("residuals times 1:"):
            raise KeyboardInterrupt

    result = fit("hypar", facets=(4, 4), barrier=1.0, on_progress=stop)
    assert (result.status, result.is_valid) == ("interrupted", True)
    assert result.barrier == pytest.approx(energy_curve(result.pattern, 24).barrier)
    assert "interrupted" in result.advice


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
