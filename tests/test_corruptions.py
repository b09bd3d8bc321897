"""A change in one place of a pattern file is found, and a file only written otherwise is not
blamed. ``benchmarks/corruptions.py`` does the same with 200 files of ten kinds."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from corruptions import KINDS, corrupted, rewritten, verdict
from piece_problems import gores, trimmed
from problems import regular

import miurafab as mf
from miurafab.findings import refusals

WHOLE = {
    "grid": regular,
    "trimmed": trimmed,
    "gores": gores,
}


@pytest.mark.parametrize("name", WHOLE)
def test_changes_of_every_kind_are_found_and_whole_files_are_not_blamed(name, tmp_path):
    random = np.random.default_rng(7)
    WHOLE[name]().save(tmp_path / "whole.fold")
    whole = json.loads((tmp_path / "whole.fold").read_text())
    for number in range(12):
        again = rewritten(json.loads(json.dumps(whole)), random)
        refused, said = verdict(again, tmp_path / "again.fold")
        assert not refused, said
        kind = KINDS[number % len(KINDS)]
        change = corrupted(again, kind, random)
        if change is not None:
            refused, _ = verdict(change[0], tmp_path / "changed.fold")
            assert refused, change[1]


def test_a_frame_folded_flat_follows_its_facets_however_they_are_written(tmp_path):
    """The facet that keeps its place, and so the side on which the sheet lies, depend on that."""
    mf.fit("cylinder", facets=(4, 6), size=120, close="seam").pattern.save(tmp_path / "whole.fold")
    whole = json.loads((tmp_path / "whole.fold").read_text())
    assert whole["file_frames"][-1]["frame_title"] == "folded flat"
    for start in range(4):
        again = whole | {"faces_vertices": [f[start:] + f[:start] for f in whole["faces_vertices"]]}
        refused, said = verdict(again, tmp_path / "again.fold")
        assert not refused, said


def test_a_drawing_that_can_be_folded_flat_is_not_blamed_for_the_frame_that_says_so(tmp_path):
    """Its file has a frame folded flat, which is not the folded form that its angles tell."""
    pattern = replace(regular(), folded_coords=None)
    pattern.save(tmp_path / "drawn.fold")
    frames = json.loads((tmp_path / "drawn.fold").read_text())["file_frames"]
    assert [frame["frame_title"] for frame in frames] == ["folded flat"]
    assert mf.load(tmp_path / "drawn.fold").folded_coords is None
    assert not refusals(mf.check(tmp_path / "drawn.fold").findings)
