"""Meshes of the benchmark fitted with no help: some always, all thirty in the large sample."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from miurafab.origami.fitting import strategies as attempts
from miurafab.origami.fitting.fit import fit
from miurafab.origami.fitting.request import Attempt, FitRequest
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
    """All attempts fail by force but those on the last resort."""
    run = attempts.Strategy.run

    def fail_before(plan, request):
        if plan.place.startswith("the middle"):
            return run(plan, request)
        return Attempt(plan.way, plan.rows_along, plan.corrugation, 1.0, 0, "by force", plan.place)

    monkeypatch.setattr(attempts.Strategy, "run", fail_before)
    surface = mesh_surface(*benchmark().meshes()["saddle-disc"])
    result = fit(FitRequest(surface=surface, facets=(6, 6), target=surface.description))
    assert result.status == "converged"
    assert "the middle 85 % of the rectangle" in result.advice
    places = list(dict.fromkeys(attempt.place for attempt in result.attempts))
    assert places[0] == ""
    assert places[1].startswith("the grid turned by")
    u0, u1, _, _ = result.pattern.target["rectangle"]
    assert u1 - u0 == pytest.approx(0.85 * surface.domain.width)


def test_a_rectangle_that_was_asked_for_stays():
    for name, others in (("saddle-disc", []), ("saddle-noisy", ["the mesh smoothed more"])):
        surface = replace(mesh_surface(*benchmark().meshes()[name]), free=False)
        assert [place for place, _ in surface.alternatives()] == others
