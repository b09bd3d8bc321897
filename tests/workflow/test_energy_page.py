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


def two_flaps() -> CreasePattern:
    """A square with two flaps on one side, folded by 60 degrees, which a cut parts."""
    flat = [[0, 0], [2, 0], [2, 1], [2, 2], [0, 2], [3, 0], [3, 1], [3, 2]]
    edges = [[1, 2], [2, 3], [2, 6], [0, 1], [1, 5], [5, 6], [6, 7], [7, 3], [3, 4], [4, 0]]
    facets = [[0, 1, 2, 3, 4], [1, 5, 6, 2, -1], [2, 6, 7, 3, -1]]
    points, turn = np.array(flat) * 20.0, np.radians(60)
    out = np.maximum(points[:, 0] - 40, 0)
    folded = np.column_stack(
        [points[:, 0] - out * (1 - np.cos(turn)), points[:, 1], out * np.sin(turn)]
    )
    return CreasePattern(
        vertices_coords=points,
        edges_vertices=np.array(edges),
        edges_assignment=np.array(list("VVC" + 7 * "B")),
        edges_fold_angle=np.array([turn, turn] + 8 * [0.0]),
        faces_vertices=np.array(facets),
        folded_coords=folded,
    )


def test_a_cut_holds_nothing_together_and_opens_on_the_page(tmp_path: Path) -> None:
    """Of a folded form a cut was as stiff as a crease, and of a drawing no page was written."""
    pattern = two_flaps()
    result = energy(pattern, 2, pull=(0, 5), strain=0.05, cycles=1)
    assert isinstance(result, PullCurve)
    assert len(result.slips) == 2
    other = np.linalg.norm(result.coords[:, 7] - result.coords[:, 4], axis=1)
    assert np.ptp(other) <= 1e-9 < 1 < np.ptp(result.distances)
    write_energy_page(result, pattern, tmp_path / "pull.html")
    told = fold_of(tmp_path / "pull.html")
    step = max(told["forms"][2]["box"][3:]) / 65535
    assert np.abs(motion_of(told) - result.coords).max() <= step
    # both sides of the cut are edges of the page
    edges = np.frombuffer(base64.b64decode(told["edges"]), "<u4")
    assert len(edges) == 2 * (len(pattern.edges_vertices) + 1)


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
