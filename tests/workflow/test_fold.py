"""Folding as a whole: rigid where it can be, bent where not, and what is written of it."""

from __future__ import annotations

import csv
import io
import json
import math
import time
from dataclasses import replace
from pathlib import Path

import named_patterns
import numpy as np
import pytest
from PIL import Image
from problems import fitted, regular

from miurafab.errors import InputError, PatternError
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.angles_csv import angles_csv, contacts
from miurafab.origami.folding.bending import bending_motion
from miurafab.origami.folding.contact import self_intersections
from miurafab.origami.folding.judge_motion import target_frame
from miurafab.origami.folding.kinematics import (
    FoldingMotion,
    facet_strain,
    place,
    rigid_motion,
    states_between,
)
from miurafab.origami.folding.layers_apart import layer_shifts
from miurafab.origami.folding.laying import laid_on
from miurafab.origami.folding.thick_panels import thick_panels
from miurafab.origami.formats.files import load
from miurafab.origami.formats.fold import read_fold
from miurafab.workflow.fold import fold
from miurafab.workflow.fold_gif import picture
from miurafab.workflow.panels import thickness_report
from miurafab.workflow.patterns import consistent_pattern

DATA = Path(__file__).parent.parent / "data"


def exact(name: str) -> CreasePattern:
    found = fitted(name, 8, 8, 0.0).pattern
    assert found is not None
    return found


def developable(name: str) -> CreasePattern:
    found = fitted(name, 8, 8).pattern
    assert found is not None
    return found


def test_a_motion_that_takes_longer_than_its_timeout_is_given_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Also where a way that is lost would lead to another, and in the middle of a descent."""
    clock = iter(range(1000))
    monkeypatch.setattr(time, "monotonic", lambda: float(next(clock)))
    told: list[str] = []
    pattern = named_patterns.waterbomb_base()
    with pytest.raises(InputError, match=r"within the 2 s of 'timeout'.* step 1 of 4, round 3"):
        fold(pattern, 4, timeout=2.0, on_progress=lambda part, text: told.append(text))
    assert told == ["step 1 of 4, round 1", "step 1 of 4, round 2"]
    with pytest.raises(InputError, match="'timeout'"):
        fold(pattern, 4, timeout=-1.0)
    assert len(fold(pattern, 4, timeout=999.0).motion.frames) == 5
    late = r"^The motion was not ready within the 2 s of 'timeout': it was at self-contact\."
    with pytest.raises(InputError, match=late):  # by its closed form it is there at once
        fold(regular(), 4, timeout=2.0)


def test_frames_of_a_wish_are_named_by_their_part_of_it(tmp_path: Path) -> None:
    bare = replace(regular(3, 3), folded_coords=None)
    angles = np.where(np.arange(len(bare.edges_vertices)) % 2, 0.8, 1.0) * bare.edges_fold_angle
    folding = fold(replace(bare, edges_fold_angle=angles), 4)
    folding.save(tmp_path / "wish.html")
    assert "75% of the fold angles" in (tmp_path / "wish.html").read_text()


@pytest.mark.parametrize("folded_flat", [False, True])
def test_the_motion_of_a_drawing_is_read_again(tmp_path: Path, folded_flat: bool) -> None:
    """Its first frame, which lies flat, passed for the folded form, and `check` refused that."""
    sheet = regular(3, 3)
    wish = np.pi * np.sign(sheet.edges_fold_angle) if folded_flat else sheet.edges_fold_angle
    drawing = replace(sheet, folded_coords=None, edges_fold_angle=wish)
    folding = fold(drawing, 4)
    folding.save(tmp_path / "motion.fold")
    again = consistent_pattern(tmp_path / "motion.fold")
    assert again.edges_fold_angle == pytest.approx(wish)
    if folded_flat:  # a state in which facets lie on each other is no folded form
        assert again.folded_coords is None
    else:
        assert again.folded_coords == pytest.approx(folding.motion.frames[1], abs=1e-9)


@pytest.mark.parametrize("name", ["plane", "hypar", "sphere", "saddle", "cylinder"])
def test_an_exact_sheet_goes_from_flat_to_flat_folded_without_meeting_itself(name: str) -> None:
    folding = fold(exact(name), 12)
    assert folding.motion.is_rigid
    assert folding.mismatch < 1e-9
    assert folding.contacts == ()
    assert folding.motion.states[0] == 0
    assert math.isinf(folding.motion.states[-1])


@pytest.mark.parametrize("name", ["hypar", "sphere", "saddle"])
def test_any_other_sheet_bends_on_its_way_to_the_folded_form(name: str) -> None:
    pattern = developable(name)
    folding = fold(pattern, 12)
    motion = folding.motion
    assert not motion.is_rigid
    assert folding.mismatch > 0.1
    assert (np.diff(motion.states) > 0).all()
    assert motion.states[-1] == 1.0
    assert motion.states[0] < 0.1
    assert pattern.folded_coords is not None
    size = float(np.linalg.norm(np.ptp(pattern.folded_coords, axis=0)))
    assert np.abs(motion.frames[-1] - pattern.folded_coords).max() < 1e-8 * size
    lengths = edge_lengths(pattern.folded_coords, pattern.edges_vertices)
    for points in motion.frames:  # its sides do not stretch
        assert np.abs(edge_lengths(points, pattern.edges_vertices) / lengths - 1).max() < 1e-6
    strain = facet_strain(pattern, motion.frames)
    assert strain[-1].max() < 1e-9 < strain.max() < 1e-2
    # and it is no straight line between its ends
    middle = (motion.frames[0] + motion.frames[-1]) / 2
    halfway = laid_on(motion.frames[6], middle)
    assert np.linalg.norm(halfway - middle, axis=1).max() > 0.01 * size


def test_a_bent_motion_has_the_fold_angles_of_its_triangles() -> None:
    pattern = developable("hypar")
    motion = bending_motion(pattern, 8)
    assert np.abs(motion.fold_angles[-1] - pattern.edges_fold_angle).max() < 1e-6
    assert np.degrees(np.abs(motion.fold_angles[0])).max() < 30


def test_fold_angles_alone_lead_a_sheet_from_flat_to_its_folded_form() -> None:
    pattern = developable("hypar")
    assert pattern.folded_coords is not None
    folding = fold(replace(pattern, folded_coords=None), 8)
    assert folding.motion.method == "from flat"
    assert folding.motion.states[-1] == 1.0
    told = folding.report()
    assert told["stable"]
    assert told["wrong_signs"] == 0
    assert not told["certificate"]["rigid"]
    assert [finding["code"] for finding in told["findings"]] == ["bent-facets", "no-layer-order"]
    deciding = told["certificate"]
    off = f"off by up to {100 * deciding['residual']:.2g} %"
    assert off in told["findings"][0]["sentence"]
    last = laid_on(folding.motion.frames[-1], pattern.folded_coords)
    size = float(np.linalg.norm(np.ptp(pattern.folded_coords, axis=0)))
    assert np.abs(last - pattern.folded_coords).max() < 1e-6 * size


def test_what_cannot_move_says_why() -> None:
    published = load(DATA / "peaks_coarse_flat.obj", folded=DATA / "peaks_coarse_fold.obj")
    with pytest.raises(PatternError, match=r"has no length.*'tolerance'"):
        fold(published, 8)
    with pytest.raises(InputError, match="'steps' is 1"):
        fold(regular(), 1)


def test_the_published_pattern_folds_to_its_given_folded_form() -> None:
    pattern = load(DATA / "peaks_coarse_flat.obj", folded=DATA / "peaks_coarse_fold.obj")
    assert pattern.folded_coords is not None
    placement = place(pattern, pattern.edges_fold_angle[None])
    facet, corner = np.nonzero(pattern.faces_vertices >= 0)
    vertex = pattern.faces_vertices[facet, corner]
    placed = placement.points(pattern.vertices_coords[vertex], facet)[0]
    given = pattern.folded_coords[vertex]
    size = float(np.linalg.norm(np.ptp(given, axis=0)))
    assert np.linalg.norm(laid_on(placed, given) - given, axis=1).max() < 2e-9 * size


def folded_through_itself() -> FoldingMotion:
    """A strip of four squares folded by 150 degrees three times the same way, in closed form."""
    x = np.repeat(np.arange(5.0), 2) * 10
    flat = np.stack([x, np.tile([0.0, 10.0], 5)], axis=1)
    index = np.arange(10).reshape(5, 2)
    corners = (index[:-1, 0], index[1:, 0], index[1:, 1], index[:-1, 1])
    ends = [*index.tolist(), *np.stack([index[:-1, 0], index[1:, 0]], axis=1).tolist()]
    ends += np.stack([index[:-1, 1], index[1:, 1]], axis=1).tolist()
    angle = np.zeros(13)
    angle[1:4] = math.radians(150)
    strip = CreasePattern(
        vertices_coords=flat,
        edges_vertices=np.array(ends),
        edges_assignment=np.where(angle > 0, "V", "B"),
        edges_fold_angle=angle,
        faces_vertices=np.stack(corners, axis=1),
    )
    return rigid_motion(strip, states_between(strip, 20))


def test_self_contact_is_reported_by_state_and_facets() -> None:
    motion = folded_through_itself()
    found = contacts(motion)
    assert found
    touched = {pair for contact in found for pair in contact.facets}
    assert (0, 3) in touched
    assert all(abs(a - b) > 1 for a, b in touched)
    first = found[0]
    assert motion.states[first.frame] == first.state
    # three equal folds close a square at 90 degrees; beyond, the last goes through the first
    turned = math.degrees(motion.fold_angles[first.frame].max())
    before = math.degrees(motion.fold_angles[first.frame - 1].max())
    assert before <= 90 + 1e-9 < turned
    for contact in found:
        shape = replace(motion.pattern, folded_coords=motion.frames[contact.frame])
        assert [tuple(p) for p in self_intersections(shape).tolist()] == list(contact.facets)


def test_the_angles_of_every_crease_and_frame_are_in_the_table() -> None:
    motion = fold(regular(4, 4), 6).motion
    rows = list(csv.reader(io.StringIO(angles_csv(motion))))
    assert rows[0][:4] == ["edge", "tail", "head", "assignment"]
    assert len(rows[0]) == 4 + 7
    inner = (motion.pattern.edges_faces >= 0).all(axis=1)
    assert len(rows) == 1 + int(inner.sum())
    for row in rows[1:]:
        edge = int(row[0])
        assert row[3] == motion.pattern.edges_assignment[edge]
        expected = np.degrees(motion.fold_angles[:, edge])
        assert [float(value) for value in row[4:]] == pytest.approx(expected.tolist(), rel=1e-8)
        assert float(row[4]) == 0.0
        assert abs(float(row[-1])) == pytest.approx(180)


@pytest.mark.parametrize("ending", ["fold", "gif", "glb", "html"])
def test_the_same_motion_gives_the_same_bytes(ending: str, tmp_path: Path) -> None:
    folding = fold(regular(5, 4), 6)
    for name in ("one", "two"):
        folding.save(tmp_path / f"{name}.{ending}", title="regular")
    one, two = (tmp_path / f"{name}.{ending}" for name in ("one", "two"))
    assert one.read_bytes() == two.read_bytes()
    if ending == "fold":
        frames = json.loads(one.read_text())["file_frames"]
        assert len(frames) == 1 + 7
        assert read_fold(one).grid == (5, 4)


def test_a_gif_goes_there_and_back_and_rests_at_the_folded_form(tmp_path: Path) -> None:
    folding = fold(regular(5, 4), 6)
    folding.save(tmp_path / "a.gif")
    durations, coverage = [], []
    with Image.open(tmp_path / "a.gif") as image:
        assert image.n_frames == 28  # 7 frames of the motion, 8 in which the layers part
        assert image.info["loop"] == 0
        for frame in range(28):
            image.seek(frame)
            durations.append(image.info["duration"])
            pixels = np.asarray(image.convert("RGB")).astype(int)
            coverage.append(int((np.abs(pixels - pixels[0, 0]).sum(axis=2) > 30).sum()))
    rests = {frame for frame, duration in enumerate(durations) if duration > 500}
    target = target_frame(folding.motion)
    assert rests == {0, 6, 14, 22, target, 28 - target}
    assert coverage[0] == max(coverage)
    assert coverage[6] < coverage[0] / 2
    assert coverage[6] < coverage[14]
    assert coverage[1:14] == coverage[:14:-1]


def test_facets_in_front_hide_those_behind() -> None:
    motion = fold(regular(), 6).motion
    pixels = np.asarray(picture(motion, 1)).astype(int)
    blue = (pixels[..., 2] > pixels[..., 0] + 20) & (pixels[..., 1] > pixels[..., 0])
    # hardly folded, the sheet shows its front alone; the bar of progress is blue, too
    assert blue[:-60].sum() < 0.002 * pixels[..., 0].size


@pytest.mark.parametrize("name", ["a.mp4", "a"])
def test_an_ending_that_is_no_motion_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"does not end in one of \.fold"):
        fold(regular(4, 4), 2).save(tmp_path / name)
    with pytest.raises(InputError, match="folder"):
        fold(regular(4, 4), 2).save(tmp_path / "none" / "a.gif")


def test_the_report_on_thickness_tells_every_crease() -> None:
    pattern = regular(5, 4)
    report = thickness_report(thick_panels(pattern, 2.0))
    inner = (pattern.edges_faces >= 0).all(axis=1)
    assert [crease["edge"] for crease in report["creases"]] == np.flatnonzero(inner).tolist()
    for crease in report["creases"]:
        assert crease["closing_side"] == {"V": "top", "M": "bottom"}[crease["assignment"]]
        expected = math.tan(math.radians(abs(crease["fold_deg"])) / 2)
        assert crease["offset_mm"] == pytest.approx(expected)
    assert report["folds"] is True


def test_the_last_pictures_part_the_layers(tmp_path: Path) -> None:
    found = fitted("cylinder", 6, 6, 0.0).pattern
    assert found is not None
    folding = fold(found, 6)
    order = folding.layers
    assert order is not None
    shifts = layer_shifts(folding.motion, order)
    assert shifts is not None
    # along the normal of the plane, and by as much as the order says
    plane = folding.motion.frames[-1] - folding.motion.frames[-1].mean(axis=0)
    normal = np.linalg.svd(plane)[2][2]
    heights = shifts @ normal
    assert np.abs(shifts - heights[:, None] * normal).max() < 1e-9 * np.abs(shifts).max()
    above = np.subtract(*heights[order.folded.shared.pairs].T)
    faces, points = found.faces_vertices[0], folding.motion.frames[-1]
    front = np.cross(points[faces[1]] - points[faces[0]], points[faces[2]] - points[faces[1]])
    side = np.sign(front @ normal) * (1 if order.folded.up[0] else -1)
    assert (np.sign(above) * side == order.above).all()

    folding.save(tmp_path / "sheet.glb")
    corners = (found.faces_vertices >= 0).sum()
    content = (tmp_path / "sheet.glb").read_bytes()
    document = json.loads(content[20 : 20 + int.from_bytes(content[12:16], "little")])
    targets = document["meshes"][0]["primitives"][0]["targets"]
    assert len(targets) == len(folding.motion.frames) + 1
    assert document["accessors"][targets[-1]["POSITION"]]["count"] == corners

    folding.save(tmp_path / "sheet.gif")
    with Image.open(tmp_path / "sheet.gif") as gif:
        assert gif.n_frames == 2 * (len(folding.motion.frames) + 8) - 2


def test_a_sheet_that_does_not_fold_flat_is_given_no_order() -> None:
    folding = fold(developable("hypar"), 4)
    told = folding.report()
    assert told["layers"] is None
    motion = folding.motion
    worst = motion.states.tolist().index(told["certificate"]["state"])
    creases = np.isin(motion.pattern.edges_assignment, ["M", "V"])
    middle = np.degrees(np.median(np.abs(motion.fold_angles[worst, creases])))
    sentence = told["findings"][0]["sentence"]
    assert f"where its median fold angle is {middle:.0f} degrees," in sentence
    assert "s = " not in sentence
    codes = [finding["code"] for finding in told["findings"]]
    assert codes == ["bent-facets", "no-layer-order"]
    exactly = fold(exact("hypar"), 4).report()
    assert exactly["layers"]["known"] is True
    assert exactly["layers"]["crossing"] == exactly["findings"] == []


def test_a_sheet_that_crosses_itself_as_it_closes_is_told() -> None:
    """Of a sheet of our own, a grid, the closed form is the motion in any case."""
    told = fold(replace(folded_through_itself().pattern, grid=(2, 5)), 4).report()
    assert told["layers"]["crossing"][0] == [0, 2]
    assert [finding["code"] for finding in told["findings"]] == ["contacts", "crossing-layers"]
