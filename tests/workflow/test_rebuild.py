"""What the virtual laser has burnt, folded and glued in memory, is the shell; what it has burnt
wrongly is not."""

from __future__ import annotations

import itertools
import re
import signal
from dataclasses import replace

import numpy as np
import pytest
from piece_problems import gores, trimmed
from problems import regular

import miurafab as mf
from miurafab.errors import InputError, JobStopped, PatternError
from miurafab.fabrication.glue import glued_shell, laid_on
from miurafab.fabrication.recover import RecoveredCorners
from miurafab.geometry.polygons import facet_means
from miurafab.machine.machine_session import MachineSession
from miurafab.motion.segments import SegmentGenerator
from miurafab.origami.crease_pattern import CreasePattern

TRIANGLE = CreasePattern(
    vertices_coords=np.array([[0.0, 0.0], [40.0, 0.0], [10.0, 30.0]]),
    edges_vertices=np.array([[0, 1], [1, 2], [2, 0]]),
    edges_assignment=np.array(["B", "B", "B"]),
    edges_fold_angle=np.zeros(3),
    faces_vertices=np.array([[0, 1, 2]]),
    folded_coords=np.array([[0.0, 0.0, 0.0], [40.0, 0.0, 0.0], [10.0, 30.0, 0.0]]),
)
CASES = {
    "triangle": (lambda: TRIANGLE, {}),
    "patches": (lambda: regular(5, 5), {"max_patch": (30, 60)}),
    "gores": (lambda: gores(3, 12, 3), {}),
}


@pytest.mark.parametrize("name", CASES)
def test_the_shell_glued_from_the_beam_log_is_the_folded_form(name, tmp_path):
    make, options = CASES[name]
    mf.sheets(make(), **options).write(tmp_path)
    found = mf.rebuild(tmp_path)
    assert found.measured == found.corners == len(make().vertices_coords)
    assert found.worst_mm < 0.05


PLANE = {"surface": "plane", "parameters": {"width": 100.0, "depth": 100.0}}


def test_what_burnt_lines_do_not_fix_is_left_out(tmp_path):
    """Without its creases an inner corner has no place, nor has the mean of a facet there."""
    pattern = replace(regular(4, 4), target=PLANE)
    job = mf.sheets(pattern)
    job.write(tmp_path)
    (path,) = job.layout.toolpaths
    at_corner = (path.edge >= 0) & (pattern.edges_vertices[path.edge] == 6).any(axis=1)
    text = (tmp_path / "sheet-01.nc").read_text()
    for x, y in path.starts[at_corner]:
        text = re.sub(rf"G0 X{x:.3f} Y{y:.3f}\nG1.*\n", "", text)
    (tmp_path / "sheet-01.nc").write_text(text)
    found = mf.rebuild(tmp_path)
    assert (found.corners, found.measured) == (16, 14)
    assert 0 < found.worst_mm < 0.02
    assert 0 < found.target_mm < 0.01


def slit(letters: str) -> CreasePattern:
    """Two squares on a crease folded by 60 degrees, one of them with a slit that goes on flat."""
    flat = [[0, 0], [40, 0], [80, 0], [80, 40], [40, 40], [0, 40], [0, 20], [20, 20], [40, 20]]
    sides = [[0, 1], [1, 2], [2, 3], [3, 4], [4, 5], [5, 6], [6, 0], [6, 7], [7, 8], [8, 4], [1, 8]]
    points, turn = np.array(flat, dtype=np.float64), np.radians(60)
    out = np.maximum(points[:, 0] - 40, 0)
    x = points[:, 0] - out * (1 - np.cos(turn))
    return CreasePattern(
        vertices_coords=points,
        edges_vertices=np.array(sides),
        edges_assignment=np.array(list("BBBBBBB" + letters)),
        edges_fold_angle=np.where(np.array(list("BBBBBBB" + letters)) == "V", turn, 0.0),
        faces_vertices=np.array([[0, 1, 8, 7, 6], [6, 7, 8, 4, 5], [1, 2, 3, 4, 8]]),
        folded_coords=np.column_stack([x, points[:, 1], out * np.sin(turn)]),
    )


@pytest.mark.parametrize(("letters", "measured"), [("CFVV", 7), ("CCVV", 8)])
def test_facets_beside_a_slit_stand_as_they_are_burnt(letters, measured, tmp_path):
    """Lines are parallel at its end, and where the flat edge meets the crease: both facets there
    were glued to nothing, 14 mm from their place.
    """
    mf.sheets(slit(letters)).write(tmp_path)
    found = mf.rebuild(tmp_path)
    assert (found.corners, found.measured) == (9, measured)
    assert found.worst_mm < 0.05


def test_a_crease_burnt_beside_its_place_is_seen_in_the_shell(tmp_path):
    mf.sheets(regular(5, 5)).write(tmp_path)
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


def test_a_signal_while_the_beam_is_rebuilt_stops_it(tmp_path, monkeypatch):
    """In mid-move of the controller in memory, whose program must not be torn."""
    mf.sheets(regular(4, 4)).write(tmp_path)
    segment, calls = SegmentGenerator.next, itertools.count()

    def pressed(self):
        if next(calls) == 500:
            signal.raise_signal(signal.SIGINT)
        return segment(self)

    monkeypatch.setattr(SegmentGenerator, "next", pressed)
    with pytest.raises(JobStopped, match="Ctrl-C"):
        mf.rebuild(tmp_path)
    assert next(calls) > 500


def test_a_signal_as_a_sheet_ends_is_not_lost_before_the_next(tmp_path, monkeypatch):
    """Nothing of that sheet is left to be stopped then."""
    mf.sheets(regular(4, 4)).write(tmp_path)
    close = MachineSession.close

    def pressed(self):
        signal.raise_signal(signal.SIGINT)
        return close(self)

    monkeypatch.setattr(MachineSession, "close", pressed)
    with pytest.raises(JobStopped, match="Ctrl-C"):
        mf.rebuild(tmp_path)


def test_facets_that_the_border_has_cut_are_left_out_as_in_check(tmp_path):
    """The mean of half a facet of a fold lies off the middle of the sheet; in the plane of the
    target the means of whole facets lie."""
    cut = trimmed()
    height = facet_means(cut.folded_coords, cut.faces_vertices[uncut_by_circle(cut)])[:, 2].mean()
    lowered = cut.folded_coords - [0, 0, height]
    target = {"surface": "plane", "parameters": {"width": 200.0, "depth": 200.0}, "edge": "trim"}
    mf.sheets(replace(cut, folded_coords=lowered, target=target)).write(tmp_path)
    found = mf.rebuild(tmp_path)
    assert found.measured == found.corners == len(cut.vertices_coords)
    assert found.worst_mm < 0.05
    assert found.folded_target_mm < 1e-6
    assert found.target_mm < 0.05


SCORED = """
title = "Scored"
thickness = "0.3mm"
kerf = "0.15mm"
[perforation]
cut = "1.2mm"
gap = "0.8mm"
end_bridge = "0.6mm"
min_end = "0.5mm"
[creases.valley]
mode = "score"
[tabs]
height = "7mm"
[beams.diode]
wavelength = 450
lasers = ["5W", "10W"]
operations.score = { power = "2.5W", feed = "2400mm/min" }
operations.perforate = { power = "7W", feed = "1500mm/min" }
operations.cut = { power = "8W", feed = "900mm/min" }
operations.engrave = { power = "1.5W", feed = "3000mm/min" }
"""


def test_what_is_scored_on_the_back_is_folded_and_glued_too(tmp_path):
    """The back lies turned over about the vertical axis of the sheet."""
    material = tmp_path / "scored.toml"
    material.write_text(SCORED)
    mf.sheets(regular(5, 5), material=material, two_sided=True).write(tmp_path / "job")
    assert (tmp_path / "job" / "sheet-01-back.nc").is_file()
    found = mf.rebuild(tmp_path / "job")
    assert (found.corners, found.measured) == (25, 25)
    assert found.worst_mm < 0.05
    assert repr(found) == f"<Rebuilt 25 of 25 corners, within {found.worst_mm:.3g} mm>"


def test_distances_from_the_target_are_in_millimetres_of_the_shell(tmp_path):
    """The shell stands over a plane; its target is half as large."""
    pattern = replace(regular(5, 5), scale=2.0, target=PLANE)
    raised = replace(pattern, folded_coords=pattern.folded_coords + np.array([0.0, 0.0, 5.0]))
    mf.sheets(raised).write(tmp_path)
    found = mf.rebuild(tmp_path)
    height = facet_means(raised.folded_coords, raised.faces_vertices)[:, 2].max()
    assert found.folded_target_mm == pytest.approx(height, abs=1e-6)
    assert found.target_mm == pytest.approx(height, abs=0.05)
    assert found.target_mm != found.folded_target_mm
    report = found.report()
    assert report == {
        "valid": True,
        "corners": 25,
        "measured": 25,
        "worst_mm": found.worst_mm,
        "target_mm": found.target_mm,
        "folded_target_mm": found.folded_target_mm,
        "thickness_mm": 0.3,
        "seconds": found.seconds,
    }
    assert 0 < found.seconds < 60


def test_a_shell_that_is_off_by_more_than_the_material_is_thick_does_not_hold(
    run, tmp_path, monkeypatch
):
    """Whatever the distance was, it was told with exit code 0."""
    mf.sheets(regular(3, 3)).write(tmp_path / "job")
    found = mf.rebuild(tmp_path / "job")
    for off, code in ((found.thickness_mm, 0), (1.01 * found.thickness_mm, 1)):
        moved = replace(found, worst_mm=off)
        monkeypatch.setattr(mf, "rebuild", lambda folder, moved=moved: moved)
        done = run("check", tmp_path / "job", "--rebuild")
        assert done.returncode == code
        assert ("more than the material is thick (0.3 mm)" in done.stdout) == bool(code)


def test_a_shell_without_a_target_has_no_distance_from_one(tmp_path):
    mf.sheets(regular(4, 4)).write(tmp_path)
    found = mf.rebuild(tmp_path)
    assert (found.target_mm, found.folded_target_mm) == (None, None)
    assert 0 < found.worst_mm < 0.02


def uncut_by_circle(pattern):
    sides = pattern.faces_edges
    border = pattern.edges_assignment == "B"
    return ~((sides >= 0) & border[sides]).any(axis=1)


def test_only_the_job_of_a_laser_is_rebuilt(tmp_path):
    with pytest.raises(InputError, match="The job directory is 3, which is not a path"):
        mf.rebuild(3)
    mf.sheets(TRIANGLE, machine="grbl-pen-a4").write(tmp_path)
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
    fixed = np.ones(len(patch), dtype=bool)
    corners = RecoveredCorners(np.array(patch), np.array(vertex), np.array(place), fixed)
    shell = glued_shell(pattern, face_patch, corners)
    turn, shift = laid_on(shell, pattern.folded_coords)
    np.testing.assert_allclose(shell @ turn.T + shift, pattern.folded_coords, atol=1e-7)


def test_facets_that_no_measured_edge_joins_are_left_out():
    pattern = slit("CFVV")
    place = pattern.vertices_coords.copy()
    place[[7, 8]] = np.nan  # every crease and flat edge ends there
    none = np.zeros(len(place), dtype=np.int64)
    corners = RecoveredCorners(none, np.arange(len(place)), place, np.isfinite(place[:, 0]))
    shell = glued_shell(pattern, none[:3], corners)
    assert np.flatnonzero(np.isfinite(shell).all(axis=1)).tolist() == [0, 1, 6]
