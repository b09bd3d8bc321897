"""Patterns of another size, and the card that a job needs."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import miurafab as mf
from miurafab.errors import OptionError, PatternError
from miurafab.fabrication.nesting import turned
from miurafab.workflow.scaling import ScaleOptions, scaled

UNIT = {
    "file_spec": 1.1,
    "vertices_coords": [[0, 0], [1, 0], [1, 1], [0, 1]],
    "edges_vertices": [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2]],
    "edges_assignment": ["B", "B", "B", "B", "V"],
    "edges_foldAngle": [0, 0, 0, 0, 90],
    "faces_vertices": [[0, 1, 2], [0, 2, 3]],
}


@pytest.fixture
def unit(tmp_path):
    file = tmp_path / "unit.fold"
    file.write_text(json.dumps(UNIT))
    return file


def test_a_pattern_without_a_unit_is_made_at_the_size_wanted(unit, tmp_path):
    job = mf.sheets(unit, size="120mm").write(tmp_path / "job")
    (patch,) = job.layout.patches
    assert np.ptp(patch.outline_mm, axis=0) == pytest.approx([120.15, 120.15])
    assert mf.check_job(tmp_path / "job").valid
    assert np.ptp(mf.load(tmp_path / "job" / "unit.fold").vertices_coords, axis=0).max() == 120.0


def test_a_scale_and_a_size_are_two_ways_to_say_the_same(unit, tmp_path):
    by_scale = mf.convert(unit, tmp_path / "a.fold", scale=40).pattern
    by_size = mf.convert(unit, tmp_path / "b.fold", size="4cm").pattern
    np.testing.assert_array_equal(by_scale.vertices_coords, by_size.vertices_coords)
    with pytest.raises(OptionError, match="give one of them"):
        mf.convert(unit, tmp_path / "c.fold", scale=40, size=40)


def test_a_pattern_without_extent_can_have_no_size(unit, tmp_path):
    point = replace(mf.load(unit), vertices_coords=np.zeros((4, 3)))
    with pytest.raises(PatternError, match="has no extent, so it can have no 'size'"):
        scaled(point, ScaleOptions(size_mm=40.0))


def test_a_scaled_sheet_keeps_its_proof_and_its_target(tmp_path):
    fitted = mf.fit("hypar", facets=(4, 4), size=100)
    fitted.pattern.save(tmp_path / "a.fold")
    mf.convert(tmp_path / "a.fold", tmp_path / "b.fold", size=150)
    checked = mf.check(tmp_path / "b.fold")
    assert checked.valid
    larger = mf.load(tmp_path / "b.fold")
    assert np.ptp(larger.folded_coords, axis=0).max() == pytest.approx(150)
    assert checked.report()["hausdorff_mm"] == pytest.approx(
        1.5 * mf.check(fitted).report()["hausdorff_mm"]
    )


def test_the_card_that_is_needed_holds_the_patches_and_no_smaller_one_does(unit, tmp_path):
    layout = mf.sheets(unit, size=100).write(tmp_path / "job").layout
    (sheet,) = layout.sheets
    (placed,) = sheet.placements
    points = turned(layout.patches[0].outline_mm, placed.rotation_deg)
    far = (points + np.array([placed.x_mm, placed.y_mm])).max(axis=0) + 5.0
    assert (far <= sheet.card_mm).all()
    assert (np.array(sheet.card_mm) < far + 1.0).all()
    assert (sheet.width_mm, sheet.height_mm) == (400.0, 400.0)
    assert mf.read_job(tmp_path / "job").layout.sheets == layout.sheets
