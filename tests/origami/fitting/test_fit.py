"""Fits of every kind: exact, valid, within their limits, and honest when there is none."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
from problems import assert_mountains_and_valleys, fitted
from scipy.spatial import cKDTree

from miurafab.errors import InputError, PatternError
from miurafab.origami.fitting.fit import FitRequest, FitResult, _no_sheet, fit
from miurafab.origami.fitting.reduction import about_z
from miurafab.origami.fitting.request import BED
from miurafab.origami.fitting.result import Attempt
from miurafab.origami.fitting.score import ENOUGH
from miurafab.origami.fitting.seed import Corrugation
from miurafab.origami.fitting.starts import corrugations_of
from miurafab.origami.verify import audit
from miurafab.surfaces.analytic import GeneralizedCylinder
from miurafab.surfaces.catalogue import CATALOGUE, make_surface

NAMED = [name for name in CATALOGUE if name != "helicoid"]


def request(name: str, columns: int = 12, rows: int = 12, **changes: object) -> FitRequest:
    surface, parameters = make_surface(name, {})
    target = {"surface": name, "parameters": parameters}
    made = FitRequest(surface=surface, facets=(columns, rows), size_mm=200.0, target=target)
    return replace(made, **changes)


def check_valid(result: FitResult, name: str) -> None:
    assert result.status == "converged", result.advice
    assert result.pattern is not None
    found = audit(result.pattern, make_surface(name, {})[0])
    assert found.valid
    assert_mountains_and_valleys(result.pattern)
    m = found.measurements
    assert m.max_planarity is not None
    assert m.max_planarity <= 1e-12
    assert m.max_developability is not None
    assert m.max_developability <= 1e-12
    assert m.max_isometry is not None
    assert m.max_isometry <= 1e-11
    assert m.self_intersections == m.overlaps == 0


@pytest.mark.parametrize("name", NAMED)
def test_every_named_surface_fits_as_it_stands(name: str) -> None:
    check_valid(fitted(name, 6, 6), name)


def test_a_helicoid_across_its_axis_fits() -> None:
    surface, _ = make_surface("helicoid", {"pitch": 6})
    result = fit(FitRequest(surface=surface, facets=(12, 12), size_mm=200.0))
    assert result.status == "converged"
    assert result.measurements is not None
    assert result.measurements.self_intersections == 0


def test_the_same_request_gives_the_same_sheet() -> None:
    one, other = fit(request("sphere", 8, 8)), fit(request("sphere", 8, 8))
    assert one.pattern is not None
    assert other.pattern is not None
    assert np.array_equal(one.pattern.vertices_coords, other.pattern.vertices_coords)


@pytest.mark.parametrize("name", ["hypar", "saddle", "paraboloid", "catenoid", "cylinder"])
def test_exact_flat_foldability_costs_no_closeness(name: str) -> None:
    exact = fit(request(name, 10, 10, flat_foldable=0.0))
    check_valid(exact, name)
    assert exact.measurements is not None
    assert exact.measurements.max_flat_foldability is not None
    assert exact.measurements.max_flat_foldability <= 1e-10
    assert exact.measurements.hausdorff_midsurface_mm is not None
    assert exact.measurements.hausdorff_midsurface_mm <= 0.01 * 300


def test_polishing_brings_the_sheet_closer_and_keeps_it_exact() -> None:
    plain, polished = fit(request("hypar", polish="off")), fit(request("hypar", polish="on"))
    check_valid(polished, "hypar")
    assert polished.polished
    assert not plain.polished
    assert polished.measurements is not None
    assert plain.measurements is not None
    assert polished.measurements.hausdorff_midsurface_mm is not None
    assert plain.measurements.hausdorff_midsurface_mm is not None
    assert (
        polished.measurements.hausdorff_midsurface_mm
        < plain.measurements.hausdorff_midsurface_mm / 3
    )


class TestLimits:
    def test_an_edge_limit_is_met_and_reported(self) -> None:
        free = fit(request("hypar", 10, 10))
        assert free.measurements is not None
        limit = 1.3 * free.measurements.min_edge_mm
        result = fit(request("hypar", 10, 10, min_edge_mm=limit, polish="on"))
        check_valid(result, "hypar")
        assert result.measurements is not None
        assert result.measurements.min_edge_mm >= limit
        assert result.report()["active_bounds"] == dict(result.active_bounds)

    def test_a_tolerance_on_flat_foldability_is_an_inequality(self) -> None:
        result = fit(request("hypar", flat_foldable=0.005))
        check_valid(result, "hypar")
        assert result.measurements is not None
        worst = result.measurements.max_flat_foldability
        assert worst is not None
        assert 0.0025 < worst <= 0.005
        assert "kawasaki" in result.active_bounds

    def test_sector_angles_and_aspect_stay_within_bounds(self) -> None:
        low, aspect = math.radians(62), 1.6
        result = fit(request("hypar", 8, 8, min_angle=low, max_aspect=aspect, polish="on"))
        check_valid(result, "hypar")
        assert result.pattern is not None
        corners = result.pattern.vertices_coords[result.pattern.faces_vertices]
        sides = np.roll(corners, -1, axis=1) - corners
        lengths = np.linalg.norm(sides, axis=2)
        assert (lengths.max(axis=1) / lengths.min(axis=1)).max() <= aspect
        back = -np.roll(sides, 1, axis=1)
        cosine = np.einsum("fck,fck->fc", sides, back) / lengths / np.roll(lengths, 1, axis=1)
        assert np.arccos(cosine).min() >= low

    @pytest.mark.parametrize("follow", ["top", "bottom"])
    def test_the_side_that_follows_lies_on_the_target(self, follow: str) -> None:
        result = fit(request("hypar", 12, 12, follow=follow, polish="on"))
        check_valid(result, "hypar")
        assert result.pattern is not None
        assert result.pattern.folded_coords is not None
        surface = make_surface("hypar", {})[0]
        rows = result.pattern.folded_coords.reshape(13, 13, 3)
        gaps = []
        for side in (rows[0::2], rows[1::2]):
            points = side.reshape(-1, 3) / result.pattern.scale
            gaps.append(points - surface.closest_point(points))
        near, far = sorted(gaps, key=lambda gap: float(np.abs(gap).max()))
        assert np.abs(near).max() < 0.05 * np.abs(far).max()
        # the other side hangs under the top, or stands over the bottom, by the target's normal
        up = far[:, 2].mean()
        assert (up < 0) == (follow == "top")

    def test_limits_that_cannot_be_met_are_named_with_their_size(self) -> None:
        result = fit(request("hypar", 6, 6, min_edge_mm=150.0, amplitude=0.8, zigzag=1.0))
        assert result.status == "infeasible"
        assert "150 mm" in result.advice
        assert result.pattern is not None


class TestSearch:
    """With one corrugation, so that each size is tried in two directions only."""

    ONE: ClassVar = {"amplitude": 0.6, "zigzag": 0.6}

    def test_the_coarsest_sheet_within_both_limits(self) -> None:
        """Distances recomputed from dense samples both ways; the next coarser size fails."""
        surface, _ = make_surface("hypar", {})
        limits = {"max_distance_mm": 12.0, "min_edge_mm": 14.0, **self.ONE}
        wanted = request("hypar", facets=None, **limits)
        result = fit(wanted)
        check_valid(result, "hypar")
        pattern = result.pattern
        corners = pattern.folded_coords[pattern.faces_vertices]
        steps = np.linspace(0, 1, 15)
        s, t = (part.ravel() for part in np.meshgrid(steps, steps))
        weights = np.stack([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t], axis=1)
        sheet = (weights @ corners).reshape(-1, 3)
        lattice = surface.domain.lattice(300, 300).reshape(-1, 2)
        target = surface.point(lattice) * pattern.scale
        there, back = cKDTree(target).query(sheet)[0].max(), cKDTree(sheet).query(target)[0].max()
        # of two sets of samples, the nearest lie up to a spacing farther than the surfaces
        assert max(there, back) <= 12.0 * 1.01
        assert result.measurements.hausdorff_mm == pytest.approx(max(there, back), rel=0.02)
        assert result.measurements.hausdorff_mm <= 12.0
        edges = pattern.folded_coords[pattern.edges_vertices]
        assert np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1).min() >= 14.0
        side = math.isqrt(result.measurements.facets)
        coarser = fit(replace(wanted, facets=(side - 2, side - 2), pieces=1))
        assert coarser.status != "converged" or coarser.score.form > ENOUGH

    def test_the_limit_on_the_distance_flattens_the_corrugation(self) -> None:
        """Without it the fair sheet of this size lies farther by more than half."""
        free, near = (
            fit(request("hypar", 8, 8, pieces=1, max_distance_mm=limit, **self.ONE))
            for limit in (None, 12.0)
        )
        check_valid(near, "hypar")
        assert near.measurements.hausdorff_mm <= 12.0
        assert free.measurements.hausdorff_mm > 18.0

    def test_which_limit_fails_and_by_how_much(self) -> None:
        limits = {"max_deviation_mm": 0.01, "min_edge_mm": 45.0, "amplitude": 0.8, "zigzag": 1.0}
        result = fit(request("saddle", facets=None, **limits))
        assert result.status == "infeasible"
        assert "No sheet meets all limits" in result.advice
        assert "mm over the 0.01 mm allowed" in result.advice


class TestRings:
    def test_a_ring_closes_and_every_period_is_the_same(self) -> None:
        surface, _ = make_surface("vase", {"angle": "360deg"})
        result = fit(FitRequest(surface=surface, facets=(14, 24), size_mm=200.0, pieces=1))
        check = audit(result.pattern, surface)
        assert check.valid
        assert result.pattern is not None
        assert result.pattern.folded_coords is not None
        rows = result.pattern.folded_coords.reshape(25, 15, 3)
        assert np.abs(rows[0] - rows[-1]).max() < 1e-11
        turned = rows[:-2] @ about_z(2 * math.pi / 12).T
        assert np.abs(turned - rows[2:]).max() < 1e-11
        assert all(attempt.way == "ring" for attempt in result.attempts)

    def test_a_closed_ring_can_be_flat_foldable_vertex_by_vertex(self) -> None:
        surface, _ = make_surface("hyperboloid", {"angle": "360deg"})
        result = fit(
            FitRequest(surface=surface, facets=(12, 24), size_mm=200.0, flat_foldable=0.0, pieces=1)
        )
        assert result.status == "converged"
        assert result.pattern is not None
        assert result.pattern.folded_coords is not None
        rows = result.pattern.folded_coords.reshape(25, 13, 3)
        assert np.abs(rows[0] - rows[-1]).max() < 1e-11


def test_a_target_that_bends_too_much_ends_with_a_reason() -> None:
    surface, _ = make_surface("helicoid", {"turns": 3, "pitch": 0.3})
    result = fit(
        FitRequest(
            surface=surface,
            facets=(4, 4),
            size_mm=200.0,
            amplitude=0.8,
            zigzag=1.0,
            polish="off",
        )
    )
    assert result.status != "converged"
    assert result.advice
    assert result.attempts
    assert len({attempt.corrugation for attempt in result.attempts}) == 1


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        (
            {"facets": (1, 12)},
            "'facets' is 1x12, of which a part is 1; it must be betw",
        ),
        ({"min_edge_mm": -1.0}, "'min_edge' is -1 mm"),
        ({"flat_foldable": 4.0}, "'flat_foldable' is 229.183 deg"),
        ({"follow": "inside"}, "'follow' is 'inside'"),
        ({"polish": "much"}, "'polish' is 'much'"),
        ({"max_aspect": 0.5}, "'max_aspect' is 0.5"),
        ({"min_angle": 1.7}, "'min_angle' is 97.4.* deg; it must be between 0 deg and 90 deg"),
        ({"min_angle": math.pi / 2}, "90 degrees"),
        ({"pieces": 0}, "'pieces' is 0; it must be auto or a whole number from 1 on"),
        ({"poles": (1.0, 2.0, 3.0) * 2}, "'poles' is '1,2,3,1,2,3'; the two points must differ"),
        ({"cut_columns": (3, 3)}, "'cut_columns' is '3,3'; write columns from 1 on, each under"),
        ({"facets": (1000, 1000)}, "'facets' is 1000x1000; in all there may be 400,000"),
    ],
)
def test_requests_that_make_no_sense_name_the_option(changes: dict[str, object], word: str) -> None:
    with pytest.raises(InputError, match=word):
        request("hypar", **changes)


def test_a_bed_is_no_size_without_a_machine() -> None:
    with pytest.raises(InputError, match="'size' is bed, which only 'fit' and 'cut' know"):
        fit(request("hypar", size_mm=BED))


def test_a_fit_without_a_sheet_is_shown_with_its_reason() -> None:
    tried = Attempt("sheet", "u", Corrugation(0.5, 0.5), 3e-4, 9, "stalled")
    told = _no_sheet((tried, replace(tried, residual=2e-3)), None)
    assert "No exact sheet was found in 2 attempts (best residual 3.0e-04)" in told.sentence
    none = FitResult("stalled", told.sentence, None, None, (tried,), 9, 0.1)
    assert repr(none) == "<FitResult stalled: no sheet in 1 attempts>"
    assert not none.is_valid
    with pytest.raises(PatternError, match="There is no sheet to draw: No exact sheet was found"):
        none.plot()


def test_borders_that_meet_and_are_no_seams_are_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "miurafab.origami.fitting.candidate.unlisted_seams", lambda pattern: [(0, 1), (2, 3)]
    )
    result = fit(request("hypar", 4, 4, polish="off", amplitude=0.5, zigzag=0.5))
    assert result.status == "infeasible"
    assert "2 pairs of border edges meet in the folded form without a seam" in result.advice


def test_a_cylinder_without_polish_is_answered_by_its_closed_forms_or_by_a_sheet() -> None:
    """No limit that it misses is met by the rest of the search, without polish, either."""
    name = next(n for n in CATALOGUE if isinstance(make_surface(n, {})[0], GeneralizedCylinder))
    result = fit(request(name, 4, 4, polish="off", max_deviation_mm=1e-9))
    assert result.status == "infeasible"
    assert {attempt.way for attempt in result.attempts} > {"direct"}
    assert not result.polished


@pytest.mark.parametrize("given", [{}, {"zigzag": 0.4}, {"amplitude": 0.6}])
def test_corrugations_keep_what_the_request_fixes(given: dict[str, float]) -> None:
    found = corrugations_of(request("hypar", **given))
    assert len(found) == len(set(found)) > 1
    for name, value in given.items():
        assert [getattr(each, name) for each in found] == pytest.approx([value] * len(found))
    both = corrugations_of(request("hypar", zigzag=0.4, amplitude=0.6))
    assert both == [Corrugation(0.6, 0.4)]


def interrupting(calls: int) -> Callable[[float, str], None]:
    """A progress callback in which Ctrl-C comes once, after so many calls between two steps."""
    left = iter([*[False] * calls, True])

    def on_progress(fraction: float, note: str) -> None:
        if ", step " not in note and next(left, False):
            raise KeyboardInterrupt

    return on_progress


@pytest.mark.parametrize("searches", [False, True])
def test_ctrl_c_leaves_the_best_sheet_up_to_then(searches: bool) -> None:
    # the search goes from a size that holds to coarser ones
    facets, far = (None, 1.0) if searches else ((6, 6), 1e-9)
    limits = request("bump", facets=facets, max_deviation_mm=far, min_edge_mm=1.0)
    with pytest.raises(KeyboardInterrupt):
        fit(limits, interrupting(0))  # there is no sheet yet
    result = fit(limits, interrupting(1 if searches else 2))
    assert result.status == "interrupted"
    assert "interrupted" in result.advice
    assert result.pattern is not None
    assert max(result.measurements.max_planarity, result.measurements.max_developability) < 1e-9


@pytest.mark.parametrize("target", ["hypar", "vase"])
def test_the_progress_of_a_fit_moves_with_each_step_and_never_back(target) -> None:
    told: list[tuple[float, str]] = []
    fit(request(target, 6, 6), lambda fraction, note: told.append((fraction, note)))
    fractions = [fraction for fraction, _ in told]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
    assert len(set(fractions)) > 10
    steps = [float(note.rpartition(" ")[2]) for _, note in told if "objective" in note]
    assert len(steps) > 10
    assert steps[-1] < steps[0]
