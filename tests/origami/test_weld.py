"""Edges that are too short to fold are welded, and the pattern is what it was without them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from problems import regular

import miurafab as mf
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.weld import welded

DATA = Path(__file__).parent.parent / "data"


def with_a_short_edge(pattern: CreasePattern, edge: int, length: float) -> CreasePattern:
    """``pattern`` with one more vertex on ``edge``, ``length`` mm before its second end."""
    a, b = pattern.edges_vertices[edge].tolist()
    new = len(pattern.vertices_coords)
    part = length / np.linalg.norm(pattern.vertices_coords[b] - pattern.vertices_coords[a])
    added = [
        np.vstack([points, (1 - part) * points[b] + part * points[a]])
        for points in (pattern.vertices_coords, pattern.folded_coords)
    ]
    faces = []
    for corners in pattern.faces_vertices.tolist():
        around = list(zip(corners, corners[1:] + corners[:1], strict=True))
        at = next((k + 1 for k, side in enumerate(around) if set(side) == {a, b}), 4)
        faces.append([*corners[:at], -1 if at == 4 and set(around[3]) != {a, b} else new])
        faces[-1] += corners[at:]
    lines = pattern.edges_vertices.copy()
    lines[edge] = a, new
    return replace(
        pattern,
        vertices_coords=added[0],
        folded_coords=added[1],
        edges_vertices=np.vstack([lines, [new, b]]),
        edges_assignment=np.append(pattern.edges_assignment, pattern.edges_assignment[edge]),
        edges_fold_angle=np.append(pattern.edges_fold_angle, pattern.edges_fold_angle[edge]),
        faces_vertices=np.array(faces),
        grid=None,
    )


@pytest.mark.parametrize("letter", ["M", "V", "B"])
def test_a_short_edge_of_any_kind_vanishes_and_nothing_else_does(letter, tmp_path):
    whole = regular()
    edge = int(np.flatnonzero(whole.edges_assignment == letter)[3])
    torn = with_a_short_edge(whole, edge, 1e-9)
    assert "degenerate-edge" in {found.code for found in mf.check(torn).findings}
    torn.save(tmp_path / "torn.fold")
    mf.convert(tmp_path / "torn.fold", tmp_path / "mended.fold", tolerance="0.001mm")
    mended = mf.load(tmp_path / "mended.fold")
    assert mf.check(mended).valid
    assert np.array_equal(mended.edges_assignment, whole.edges_assignment)
    assert np.array_equal(mended.faces_vertices[:, :4], whole.faces_vertices)
    assert np.abs(mended.vertices_coords - whole.vertices_coords).max() < 1e-9
    assert mf.sheets(mended).layout.totals.sheets == 1


def test_what_is_longer_stays():
    torn = with_a_short_edge(regular(), 20, 0.5)
    assert welded(torn, 0.4) is torn
    assert len(welded(torn, 0.6).vertices_coords) == len(regular().vertices_coords)


def test_the_short_edges_of_a_published_pattern_are_welded():
    flat, folded = (DATA / f"peaks_coarse_{form}.obj" for form in ("flat", "fold"))
    codes = [
        {found.code for found in mf.check(mf.load(flat, folded=folded, tolerance=t)).findings}
        for t in (None, 1e-9)
    ]
    assert codes[0] - codes[1] == {"degenerate-edge", "bow-tie"}
    assert codes[1] < codes[0]
