"""Meshes of the benchmark fitted with no help: some always, all in the large sample."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from mesh_shapes import SHAPES, mesh

from miurafab.errors import TargetError
from miurafab.origami.fitting import fit as fit_module
from miurafab.origami.fitting.fit import fit
from miurafab.origami.fitting.request import FitRequest
from miurafab.origami.fitting.result import Attempt
from miurafab.surfaces.mesh import mesh_surface
from miurafab.surfaces.placement import Region


@cache
def benchmark() -> ModuleType:
    path = Path(__file__).parents[2] / "benchmarks" / "meshes.py"
    spec = importlib.util.spec_from_file_location("mesh_benchmark", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def panel(tmp_path_factory):
    return benchmark().answer("saddle-l", "10x10", "trim", tmp_path_factory.mktemp("panel"))


def test_a_mesh_is_answered_and_all_figures_are_found_again(panel, tmp_path):
    assert benchmark().verdict(panel) == "sheet", panel
    said = benchmark().answer("torus", "8x8", "trim", tmp_path)
    assert benchmark().verdict(said) == "reason"
    assert "handle" in said["why"]


def test_a_wrong_figure_is_no_answer(panel):
    said = panel
    own = said["again"]
    wrong = {
        "hausdorff_mm 12 for": said | {"hausdorff_mm": 12.0, "again": own | {"hausdorff_mm": 10.0}},
        "coverage": said | {"coverage": 0.94},
        "fold without finding": said | {"again": own | {"fold_deg": 166.0}, "findings": []},
        "area without finding": said | {"again": own | {"area": 4.1}, "findings": []},
        "slow reason": said | {"status": "stalled", "why": "It bends.", "seconds": 31.0},
    }
    for fault, answer in wrong.items():
        assert fault in benchmark().verdict(answer)


@pytest.mark.large
def test_nine_in_ten_of_all_are_answered(tmp_path):
    answers = [benchmark().answer(name, "20x20", "trim", tmp_path) for name in SHAPES]
    good = [benchmark().verdict(said) in ("sheet", "reason") for said in answers]
    assert sum(good) >= 0.9 * len(SHAPES)


@pytest.mark.anew
def test_where_no_sheet_is_found_a_smaller_part_is_taken_and_said(monkeypatch):
    """All starts fail by force but those of the last resort."""
    run = fit_module.polished

    def fail_before(request, start, on_step=None):
        if start.place.startswith("the middle"):
            yield from run(request, start, on_step)
            return
        yield Attempt(start.way, start.rows_along, start.corrugation, 1.0, 0, "by force")

    monkeypatch.setattr(fit_module, "polished", fail_before)
    monkeypatch.setattr(fit_module, "TRIED", 20)
    surface = mesh_surface(*mesh("triangles-8"))
    result = fit(FitRequest(surface=surface, facets=(6, 6), target=surface.description))
    assert result.status == "converged"
    assert "the middle 85 % of the rectangle" in result.advice
    u0, u1, _, _ = result.pattern.target["rectangle"]
    assert u1 - u0 == pytest.approx(0.85 * surface.domain.width)


def test_a_rectangle_that_was_asked_for_stays():
    for name, others in (("petal", []), ("scan-saddle", ["the mesh smoothed more"])):
        surface = replace(mesh_surface(*mesh(name)), free=False)
        assert [place for place, _ in surface.alternatives()] == others


def square_of_two_triangles():
    vertices = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [10.0, 10.0, 0.0], [0.0, 10.0, 0.0]])
    return vertices, np.array([[0, 1, 2], [0, 2, 3]])


def test_a_square_of_two_triangles_is_fitted_at_once():
    result = fit(FitRequest(surface=mesh_surface(*square_of_two_triangles()), facets=(4, 4)))
    assert result.status == "converged"
    assert result.deviation_mm < 1e-9


def test_long_triangles_are_divided_before_they_are_laid_flat():
    surface = mesh_surface(*square_of_two_triangles())
    assert len(surface.layout.whole[1]) == 2
    assert len(surface.layout.vertices) > 150
    assert len(list(surface.alternatives())) > 3


def test_a_rectangle_without_vertices_is_refused_in_a_sentence():
    region = Region.read("0.51,0.511,0.51,0.511")
    with pytest.raises(TargetError, match="only 0 vertices of the mesh lie on the rectangle"):
        mesh_surface(*square_of_two_triangles(), "tile.obj", region=region)
