"""The page of a sheet that is unfolded or pulled holds the states and the curve of the result."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from piece_problems import two_pieces
from problems import fitted

from miurafab.errors import InputError
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.curve import EnergyCurve
from miurafab.origami.energy.pull import PullCurve
from miurafab.workflow.energy import energy
from miurafab.workflow.energy_page import write_energy_page


def sheet() -> CreasePattern:
    pattern = fitted("hypar", 6, 6).pattern
    assert pattern is not None
    return pattern


def fold_of(path: Path) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', path.read_text())
    assert found is not None
    told: dict[str, Any] = json.loads(found[1])["fold"]
    return told


def motion_of(told: dict[str, Any]) -> np.ndarray:
    form = told["forms"][2]
    low, size = np.split(np.array(form["box"]), 2)
    points = np.frombuffer(base64.b64decode(form["points"]), "<u2").reshape(form["frames"], -1, 3)
    return np.asarray(low + points / 65535 * size)


def test_a_pull_has_its_force_over_its_extension_in_newtons(tmp_path: Path) -> None:
    pattern = sheet()
    result = energy(pattern, 6, pull="corners", strain=0.1, cycles=2, material="card-250")
    assert isinstance(result, PullCurve)
    write_energy_page(result, pattern, tmp_path / "pull.html", title="pull")
    told = fold_of(tmp_path / "pull.html")
    frames = motion_of(told)
    step = max(told["forms"][2]["box"][3:]) / 65535
    # the vertices that are pulled are as far apart as the force is for, and no side is stretched
    one, other = result.ends
    apart = np.linalg.norm(frames[:, one] - frames[:, other], axis=1)
    assert np.abs(apart - result.distances).max() <= 2 * step
    flat = edge_lengths(pattern.vertices_coords, pattern.edges_vertices)
    for points in frames:
        assert np.abs(edge_lengths(points, pattern.edges_vertices) - flat).max() <= 2 * step
    curve = told["curve"]
    assert curve["values"] == pytest.approx(result.forces.tolist(), rel=1e-4, abs=1e-12)
    assert curve["places"] == pytest.approx(result.extensions.tolist(), rel=1e-4, abs=1e-12)
    assert curve["top"] == f"{result.report()['largest_force_n']:.3g} N"
    assert told["names"][0].startswith("cycle 1, ")
    assert told["names"][-1].startswith("cycle 2, ")
    assert (told["word"], told["rigid"]) == ("Pulling", False)


@pytest.mark.parametrize("material", [None, "card-250"])
def test_the_way_from_flat_ends_in_the_folded_form(tmp_path: Path, material: str | None) -> None:
    pattern = sheet()
    result = energy(pattern, 5, material=material)
    assert isinstance(result, EnergyCurve)
    write_energy_page(result, pattern, tmp_path / "energy.html")
    told = fold_of(tmp_path / "energy.html")
    frames = motion_of(told)
    assert pattern.folded_coords is not None
    step = max(told["forms"][2]["box"][3:]) / 65535
    assert np.abs(frames[-1] - pattern.folded_coords).max() <= step
    assert told["start"] == len(frames) - 1
    assert told["names"][-1] == "the folded form"
    joule = result.path.model.unit_joule or 1.0
    expected = (result.path.energies[::-1] * joule).tolist()
    assert told["curve"]["values"] == pytest.approx(expected, rel=1e-4, abs=1e-18)
    most = float(told["curve"]["top"].split(" ")[0])
    unit = {"k_f": 1.0, "µJ": 1e-6, "nJ": 1e-9}[told["curve"]["top"].split(" ")[1]]
    assert most * unit == pytest.approx(max(expected), rel=0.06)
    angles = np.frombuffer(base64.b64decode(told["forms"][2]["angles"]), "<i2")
    turned = angles.reshape(len(frames), -1)[-1] / 16383 * np.pi
    inner = (pattern.edges_faces >= 0).all(axis=1)
    assert np.abs(turned - pattern.edges_fold_angle)[inner].max() < 2e-4


def test_several_pieces_have_no_page(tmp_path: Path) -> None:
    pattern = two_pieces(5, 5, 2)
    result = energy(pattern, 2)
    with pytest.raises(InputError, match="several; write a plot"):
        write_energy_page(result, pattern, tmp_path / "energy.html")
