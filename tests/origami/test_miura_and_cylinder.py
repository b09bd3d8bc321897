"""The two closed forms: the cell against its formulae, cylinders against the constraints."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from problems import assert_mountains_and_valleys

from miurafab.errors import InputError
from miurafab.fabrication.open_ring import open_ring
from miurafab.fabrication.seams import border_seams
from miurafab.origami.cylinder import cylinder_on
from miurafab.origami.fitting.constraints import OrigamiConstraints
from miurafab.origami.fitting.fit import fit
from miurafab.origami.miura import MiuraCell, regular_miura
from miurafab.origami.tessellation import Tessellation
from miurafab.origami.unfold import unfold
from miurafab.origami.verify import audit
from miurafab.surfaces.analytic import GeneralizedCylinder
from miurafab.surfaces.catalogue import make_surface
from miurafab.workflow.design import design


@settings(max_examples=50)
@given(
    across=st.floats(0.5, 20), along=st.floats(0.5, 20), alpha=st.floats(0.3, 1.5),
    theta=st.floats(0.05, 1.5),
)  # fmt: skip
def test_the_cell_has_the_sides_and_angle_it_was_given(
    across: float, along: float, alpha: float, theta: float
) -> None:
    p = regular_miura(MiuraCell(across, along, alpha, theta), 3, 3).points
    assert np.allclose(np.linalg.norm(np.diff(p, axis=1), axis=2), along)
    assert np.allclose(np.linalg.norm(np.diff(p, axis=0), axis=2), across)
    cosine = (p[0, 1] - p[0, 0]) @ (p[1, 0] - p[0, 0]) / (along * across)
    angle = math.acos(cosine)
    assert math.isclose(min(angle, math.pi - angle), alpha, rel_tol=1e-9)


@settings(max_examples=50)
@given(alpha=st.floats(0.3, 1.5), theta=st.floats(0.05, 1.5))
def test_the_creases_of_a_miura_have_the_fold_angles_of_its_closed_form(
    alpha: float, theta: float
) -> None:
    """2 theta along the rows and 2 atan(cos alpha tan theta) across them.

    Ridges, the rows of odd index, are mountains; across the rows mountains and valleys alternate.
    """
    pattern = unfold(regular_miura(MiuraCell(12.0, 10.0, alpha, theta), 5, 6))
    count = 6 * 4
    along = pattern.edges_fold_angle[:count].reshape(6, 4)[1:-1]
    across = pattern.edges_fold_angle[count:].reshape(5, 5)[:, 1:-1]
    ridge = np.where(np.arange(1, 5) % 2, -1.0, 1.0)
    assert np.allclose(along, ridge[:, None] * 2 * theta)
    parity = np.add.outer(np.arange(5), np.arange(1, 4)) % 2
    slope = 2 * math.atan(math.cos(alpha) * math.tan(theta))
    assert np.allclose(across, np.where(parity, 1.0, -1.0) * slope)
    assert_mountains_and_valleys(pattern)


@pytest.mark.parametrize("name", ["cylinder", "log-spiral"])
@pytest.mark.parametrize("level", [0.0, -0.5])
def test_cylinders_are_exact_and_flat_foldable_without_a_solver(name: str, level: float) -> None:
    surface = make_surface(name, {})[0]
    assert isinstance(surface, GeneralizedCylinder)
    sheet = cylinder_on(surface, 41, 41, 0.83, 1.4, level)
    constraints = OrigamiConstraints(sheet.grid, float(sheet.edge_lengths.mean()), True)
    assert np.abs(constraints(sheet.vertices.ravel())[0]).max() < 2e-14
    assert_mountains_and_valleys(unfold(sheet))


def test_the_top_of_a_cylinder_lies_on_it() -> None:
    surface = make_surface("cylinder", {})[0]
    assert isinstance(surface, GeneralizedCylinder)
    sheet = cylinder_on(surface, 21, 41, 0.83, 1.4, -0.5)
    upper = sheet.points[1::2].reshape(-1, 3)
    lower = sheet.points[0::2].reshape(-1, 3)
    gap = [np.linalg.norm(surface.closest_point(p) - p, axis=1).max() for p in (upper, lower)]
    assert gap[0] < 0.1 * gap[1]


EGG = {"profile": [[0, -1], [0.9, -0.5], [0.7, 0.8], [0, 1.2], [-0.7, 0.8], [-0.9, -0.5], [0, -1]]}


@pytest.mark.parametrize("given", [{"angle": "360deg"}, EGG], ids=["circle", "egg"])
@pytest.mark.parametrize("level", [0.0, 0.5, -0.5])
def test_around_a_closed_profile_the_sheet_is_a_tube(given, level) -> None:
    """Its first and last row are one, and it is exact and flat-foldable there as everywhere."""
    surface = make_surface("cylinder", given)[0]
    assert isinstance(surface, GeneralizedCylinder)
    assert surface.closed
    sheet = cylinder_on(surface, 21, 41, 0.83, 1.4, level)
    assert np.abs(sheet.points[0] - sheet.points[-1]).max() < 1e-12
    further = Tessellation(np.concatenate([sheet.points[-21:-1], sheet.points[:21]]))
    for each in (sheet, further):
        constraints = OrigamiConstraints(each.grid, float(each.edge_lengths.mean()), True)
        assert np.abs(constraints(each.vertices.ravel())[0]).max() < 4e-14


def test_with_an_odd_number_of_facets_around_there_is_no_seam() -> None:
    surface = make_surface("cylinder", {"angle": "360deg"})[0]
    assert isinstance(surface, GeneralizedCylinder)
    sheet = cylinder_on(surface, 21, 40, 0.83, 1.4)
    assert np.linalg.norm(sheet.points[0] - sheet.points[-1], axis=1).min() > 0.05


def test_a_tube_that_is_fitted_is_closed_wherever_it_is_opened() -> None:
    asked = design("cylinder", facets="12x24", close="seam", flat_foldable="exact")
    result = fit(asked.request)
    assert result.status == "converged"
    assert result.pattern is not None
    for line in (None, 7):
        pattern = result.pattern if line is None else open_ring(result.pattern, 0, line)
        found = audit(pattern, asked.request.surface)
        assert found.findings == ()
        assert found.measurements.max_flat_foldability is not None
        assert found.measurements.max_flat_foldability < 1e-12
        assert len(border_seams(pattern)) == 12


@pytest.mark.parametrize(
    ("target", "options", "why"),
    [
        ("cylinder", {"facets": "8x9"}, "needs an even number of rows of facets"),
        ("cylinder", {"facets": "8x2"}, "has 2 rows; a closed tube has an inside from 4 rows on"),
        ("cylinder", {"pieces": 2}, "is over 1, and a closed tube is one piece"),
        ("log-spiral", {}, "needs a surface of revolution or a circular cylinder"),
    ],
)
def test_what_cannot_be_a_tube_is_refused(target, options, why) -> None:
    with pytest.raises(InputError, match=why):
        design(target, close="seam", **options)
