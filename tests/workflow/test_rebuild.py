"""What the virtual laser has burnt, folded and glued in memory, is the shell; what it has burnt
wrongly is not."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from piece_problems import gores, trimmed
from problems import regular

import miurafab as mf
from miurafab.errors import InputError, PatternError
from miurafab.fabrication.glue import glued_shell, laid_on
from miurafab.fabrication.recover import RecoveredCorners
from miurafab.geometry.polygons import facet_means

CASES = {
    "patches": (regular, {"max_patch": (60, 60)}),
    "gores": (gores, {}),
    "trimmed": (trimmed, {}),
}


@pytest.mark.parametrize("name", CASES)
def test_the_shell_glued_from_the_beam_log_is_the_folded_form(name, tmp_path):
    make, options = CASES[name]
    mf.sheets(make(), **options).write(tmp_path)
    found = mf.rebuild(tmp_path)
    assert found.measured == found.corners == len(make().vertices_coords)
    assert found.worst_mm < 0.05


def test_a_crease_burnt_beside_its_place_is_seen_in_the_shell(tmp_path):
    mf.sheets(regular()).write(tmp_path)
    file = tmp_path / "sheet-01.nc"
    whole = mf.rebuild(tmp_path).worst_mm
    # Every dash of one line, 0.1 mm to the side.
    dashes = re.compile(r"G0 X(\S+) Y(\S+)\nG1 X(\S+) Y(\S+)")
    start = file.read_text().index("(operation perforate)")
    moved = dashes.sub(
        lambda m: f"G0 X{float(m[1]) + 0.1:.3f} Y{m[2]}\nG1 X{float(m[3]) + 0.1:.3f} Y{m[4]}",
        file.read_text()[start:],
        count=12,
    )
    file.write_text(file.read_text()[:start] + moved)
    assert mf.rebuild(tmp_path).worst_mm > 2 * whole > 0


def test_facets_that_the_border_has_cut_are_left_out_as_in_check(tmp_path):
    """The mean of half a facet of a fold lies off the middle of the sheet; in the plane of the
    target the means of whole facets lie."""
    cut = trimmed()
    height = facet_means(cut.folded_coords, cut.faces_vertices[uncut_by_circle(cut)])[:, 2].mean()
    lowered = cut.folded_coords - [0, 0, height]
    target = {"surface": "plane", "parameters": {"width": 200.0, "depth": 200.0}, "edge": "trim"}
    mf.sheets(replace(cut, folded_coords=lowered, target=target)).write(tmp_path)
    found = mf.rebuild(tmp_path)
    assert found.folded_target_mm < 1e-6
    assert found.target_mm < 0.05


def uncut_by_circle(pattern):
    sides = pattern.faces_edges
    border = pattern.edges_assignment == "B"
    return ~((sides >= 0) & border[sides]).any(axis=1)


def test_only_the_job_of_a_laser_is_rebuilt(tmp_path):
    mf.sheets(regular(), machine="grbl-pen-a4").write(tmp_path)
    with pytest.raises(InputError, match="is for a pen"):
        mf.rebuild(tmp_path)


def test_what_has_no_form_or_was_not_burnt_is_not_rebuilt(tmp_path):
    mf.sheets(replace(regular(3, 3), folded_coords=None)).write(tmp_path / "flat")
    with pytest.raises(PatternError, match="the pattern has no folded form to compare with"):
        mf.rebuild(tmp_path / "flat")
    mf.sheets(regular(3, 3)).write(tmp_path / "dark")
    (tmp_path / "dark" / "sheet-01.nc").write_text("G21 G90\nG0 X5 Y5\n")
    with pytest.raises(InputError, match="what was burnt does not fix the corners"):
        mf.rebuild(tmp_path / "dark")


def test_exact_corners_glue_to_the_exact_shell():
    """Patches that lie turned and moved on their sheets, without any error of measurement."""
    pattern = gores()
    half = (np.arange(len(pattern.faces_vertices)) % 6 >= 3).astype(np.int64)
    face_patch = 2 * pattern.pieces + half
    patch, vertex, place = [], [], []
    for number in range(int(face_patch.max()) + 1):
        own = np.unique(pattern.faces_vertices[face_patch == number])
        c, s = np.cos(number), np.sin(number)
        patch += [number] * len(own)
        vertex += own.tolist()
        place += (pattern.vertices_coords[own] @ [[c, s], [-s, c]] + 7 * number).tolist()
    corners = RecoveredCorners(np.array(patch), np.array(vertex), np.array(place))
    shell = glued_shell(pattern, face_patch, corners)
    turn, shift = laid_on(shell, pattern.folded_coords)
    np.testing.assert_allclose(shell @ turn.T + shift, pattern.folded_coords, atol=1e-7)
