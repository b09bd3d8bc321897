"""Meshes of the benchmark fitted with no help: some always, all thirty in the large sample."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from miurafab.errors import TargetError
from miurafab.origami.fitting import fit as fit_module
from miurafab.origami.fitting.fit import fit
from miurafab.origami.fitting.request import FitRequest
from miurafab.origami.fitting.result import Attempt
from miurafab.surfaces.mesh import mesh_surface

SOME = ("bump-disc", "saddle-noisy", "cap", "twisted", "torus-top", "waves-noisy")


@cache
def benchmark() -> ModuleType:
    path = Path(__file__).parents[2] / "benchmarks" / "meshes.py"
    spec = importlib.util.spec_from_file_location("mesh_benchmark", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_set_is_thirty_disks_and_always_the_same():
    meshes = benchmark().meshes()
    assert len(meshes) == 30
    for name, (vertices, faces) in benchmark().meshes().items():
        assert np.isfinite(vertices).all()
        assert (vertices == meshes[name][0]).all()
        assert (faces == meshes[name][1]).all()
        edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        assert len(vertices) - len(np.unique(edges, axis=0)) + len(faces) == 1


@pytest.mark.parametrize("name", SOME)
def test_a_mesh_is_fitted_with_no_help(name):
    answer = benchmark().trial(name, benchmark().meshes()[name], (20, 20))
    assert answer["fitted"], answer


@pytest.mark.large
def test_nine_in_ten_of_all_are_fitted_and_the_others_say_why():
    answers = [benchmark().trial(*item, (20, 20)) for item in benchmark().meshes().items()]
    assert sum(answer["fitted"] for answer in answers) >= 27
    assert all(answer["fitted"] or answer["why"] for answer in answers)


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
    surface = mesh_surface(*benchmark().meshes()["saddle-disc"])
    result = fit(FitRequest(surface=surface, facets=(6, 6), target=surface.description))
    assert result.status == "converged"
    assert "the middle 85 % of the rectangle" in result.advice
    u0, u1, _, _ = result.pattern.target["rectangle"]
    assert u1 - u0 == pytest.approx(0.85 * surface.domain.width)


def test_a_rectangle_that_was_asked_for_stays():
    for name, others in (("saddle-disc", []), ("saddle-noisy", ["the mesh smoothed more"])):
        surface = replace(mesh_surface(*benchmark().meshes()[name]), free=False)
        assert [place for place, _ in surface.alternatives()] == others


def square_of_two_triangles():
    vertices = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [10.0, 10.0, 0.0], [0.0, 10.0, 0.0]])
    return vertices, np.array([[0, 1, 2], [0, 2, 3]])


def test_a_square_of_two_triangles_is_fitted_at_once():
    result = fit(FitRequest(surface=mesh_surface(*square_of_two_triangles()), facets=(4, 4)))
    assert result.status == "converged"
    assert result.deviation_mm < 1e-9


def test_a_placement_without_vertices_is_left_out_and_does_not_end_the_search():
    """Turned by 30 degrees the square holds a rectangle, but none of its four corners is on it."""
    surface = mesh_surface(*square_of_two_triangles())
    assert [place for place, _ in surface.alternatives()] == ["the middle 85 % of the rectangle"]


def test_a_mesh_too_small_for_a_rectangle_of_vertices_is_refused_in_a_sentence():
    vertices, _ = square_of_two_triangles()
    with pytest.raises(TargetError, match="only 0 vertices of the mesh lie on the rectangle"):
        mesh_surface(vertices[[0, 1, 3]], np.array([[0, 1, 2]]), "tri.obj")
