"""The best sheet of several starts: named surfaces, zones and globes in pieces, limits of time."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import miurafab as mf
from miurafab.errors import OptionError
from miurafab.geometry.angles import angle_between
from miurafab.geometry.polygons import facet_means
from miurafab.origami.fitting.fit import FitRequest, FitResult, fit
from miurafab.origami.verify import audit
from miurafab.surfaces.catalogue import make_surface


@cache
def sheet(name: str, facets: tuple[int, int], pieces: int | None, **given: object) -> FitResult:
    surface, parameters = make_surface(name, dict(given))
    target = {"surface": name, "parameters": parameters}
    request = FitRequest(
        surface=surface, facets=facets, size_mm=200.0, target=target, pieces=pieces
    )
    return fit(request)


def sectors_of(result: FitResult) -> np.ndarray:
    assert result.pattern is not None
    corners = result.pattern.folded_coords[result.pattern.faces_vertices]
    ahead, behind = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    return np.degrees(angle_between(ahead, behind))


def assert_good(result: FitResult, middle: float) -> None:
    """Exact, clean, sectors of 43-138 degrees, and the middle within so many % of the diagonal."""
    assert result.status == "converged", result.advice
    assert result.pattern is not None
    m = audit(result.pattern).measurements
    assert max(m.max_planarity, m.max_developability) <= 1e-12
    assert m.max_isometry <= 1e-11
    assert m.self_intersections == m.overlaps == 0
    sectors = sectors_of(result)
    assert sectors.min() >= 43
    assert sectors.max() <= 138
    assert ((sectors < 44.9) | (sectors > 135.1)).mean() <= 0.12
    assert result.score is not None
    assert result.score.rim <= 1.25  # per cent of the diagonal
    diagonal = float(np.linalg.norm(np.ptp(result.pattern.folded_coords, axis=0)))
    surface = make_surface(result.pattern.target["surface"], result.pattern.target["parameters"])[0]
    means = facet_means(result.pattern.folded_coords, result.pattern.faces_vertices)
    scale = result.pattern.scale
    # nearest in the target that ends at its border, and not on its continuation
    gap = np.linalg.norm(surface.nearest(means / scale) * scale - means, axis=1)
    assert 100 * gap.max() / diagonal <= middle


@pytest.mark.parametrize(("name", "middle"), [("bump", 0.3), ("ellipsoid", 0.5), ("pill", 0.3)])
def test_a_named_surface_comes_whole_with_corners_that_fold(name: str, middle: float) -> None:
    result = sheet(name, (16, 16), 1)
    assert_good(result, middle)
    assert result.measurements is not None
    assert result.measurements.area_ratio <= 4  # times the area of the target


def test_a_zone_of_the_sphere_is_no_drum() -> None:
    result = sheet("ellipsoid", (24, 48), 1, latitude="60deg", angle="360deg")
    assert result.pattern is not None
    means = facet_means(result.pattern.folded_coords, result.pattern.faces_vertices)
    radius = np.linalg.norm(means, axis=1) / result.pattern.scale
    assert np.abs(radius - 1).max() < 0.008
    latitude = np.degrees(np.arcsin(means[:, 2] / np.linalg.norm(means, axis=1)))
    assert latitude.max() > 56
    assert latitude.min() < -56


@pytest.mark.parametrize("pieces", [2, 8])
def test_a_globe_in_pieces_closes_along_its_seams(pieces: int) -> None:
    result = sheet("ellipsoid", (16, 32), pieces, latitude="80deg", angle="360deg")
    assert_good(result, 0.3)
    pattern = result.pattern
    assert pattern is not None
    assert int(pattern.pieces.max()) + 1 == pieces
    assert audit(pattern).valid
    first, second = pattern.edges_vertices[pattern.seams].transpose(1, 0, 2)
    ends = pattern.folded_coords[first], pattern.folded_coords[second]
    swapped = np.abs(ends[0] - ends[1]).max(axis=(1, 2)) > 1e-9
    mates = np.where(swapped[:, None, None], ends[1][:, ::-1], ends[1])
    assert np.abs(ends[0] - mates).max() < 1e-9
    # gores meet along meridians of 16 edges; bands along the equator of 32, and each with itself
    assert len(pattern.seams) == (8 * 16 if pieces == 8 else 32 + 16)


@pytest.mark.parametrize(("rows", "pieces"), [(9, 1), (8, 4)])
def test_a_part_of_a_turn_ends_at_the_two_borders_of_that_part(rows: int, pieces: int) -> None:
    result = sheet("pill", (8, rows), pieces, angle=120)
    assert result.pattern is not None
    x, y, _ = facet_means(result.pattern.folded_coords, result.pattern.faces_vertices).T
    turn = np.degrees(np.arctan2(y, x))
    step = 120 / (8 if pieces == 4 else rows)
    assert (-turn.min(), turn.max()) == pytest.approx((60 - step / 2,) * 2, abs=step / 4)


def test_pieces_are_cut_where_asked() -> None:
    surface, _ = make_surface("bump", {})
    request = FitRequest(
        surface=surface, facets=(10, 6), cut_columns=(4,), target={"surface": "bump"}
    )
    result = fit(request)
    assert result.pattern is not None
    counts = np.bincount(result.pattern.pieces)
    assert counts.tolist() == [4 * 6, 6 * 6]
    with pytest.raises(OptionError, match="reaches column 10, and the sheet has 10 columns"):
        replace(request, cut_columns=(4, 10))
    with pytest.raises(OptionError, match="give only one of the two"):
        replace(request, pieces=5)


def test_the_report_tells_every_attempt_with_its_score_and_slide() -> None:
    result = sheet("pill", (16, 16), 1)
    report = result.report()
    assert report["score"]["total"] == max(
        value for name, value in report["score"].items() if name not in ("total", "bow_ties")
    )
    scores = [a["score"] for a in report["attempts"] if not a["fault"]]
    assert report["score"]["total"] == min(scores)
    assert all(0 <= a["steepest_deg"] < 90 for a in report["attempts"])


def test_a_time_limit_gives_the_best_sheet_so_far_and_says_so() -> None:
    surface, _ = make_surface("pill", {})
    result = fit(FitRequest(surface=surface, facets=(16, 16), timeout=1e-3))
    assert result.status in ("converged", "stalled", "infeasible")
    assert "`timeout` ended the search" in result.advice


def test_another_seed_gives_another_sheet_as_good() -> None:
    surface, _ = make_surface("bump", {})
    made = [fit(FitRequest(surface=surface, facets=(8, 8), size_mm=200.0, seed=n)) for n in (0, 1)]
    assert all(result.status == "converged" for result in made)
    one, two = (result.pattern.vertices_coords for result in made)
    assert np.abs(one - two).max() > 1e-6
    assert math.isclose(made[0].score.total, made[1].score.total, rel_tol=0.5)


@pytest.mark.parametrize(("name", "told"), [("pill", True), ("hypar", False)])
def test_a_sheet_far_from_its_target_is_told_with_the_distance(name: str, told: bool) -> None:
    """Without the fair polish the pill's sheet is 1.5 % of its diagonal off."""
    result = mf.fit(name, facets=(20, 20), polish="off")
    found = [finding for finding in result.findings if finding.code == "far-from-target"]
    assert bool(found) == told
    for finding in found:
        assert result.deviation_mm is not None
        assert f"up to {result.deviation_mm:.3g} mm" in finding.sentence
