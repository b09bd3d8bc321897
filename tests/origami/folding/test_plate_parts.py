"""What plates on shifted hinges are cut from: notched plates, brackets, tapes, and their sheets."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import ezdxf
import numpy as np
import pytest
import shapely
from problems import fitted
from shapely.geometry import MultiPoint, Polygon

import miurafab
from miurafab.errors import InputError
from miurafab.geometry.polygons import signed_areas
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.plates import ThickPlates, thick_plates
from miurafab.origami.folding.thick_panels import thick_panels
from miurafab.origami.formats.panel_parts import panel_parts
from miurafab.profiles import OPERATIONS
from miurafab.workflow.check_job import check_job


@cache
def saddle() -> CreasePattern:
    found = fitted("hypar", 4, 4, 0.0).pattern
    assert found is not None
    return found


@cache
def plywood() -> ThickPlates:
    """Four by four facets of a hypar, 200 mm long, in plywood of 4 mm."""
    return thick_plates(saddle(), 4.0)


def test_a_bracket_fills_its_notch_and_reaches_from_the_far_face_to_the_axis() -> None:
    (patch,) = plywood().patches
    parts = panel_parts(plywood())
    plates, brackets = parts[:16], parts[16:]
    assert [part.name for part in plates] == [f"f{facet}" for facet in range(16)]
    assert len(brackets) == len(patch.brackets) > 20
    feet = {facet: [b.foot for b in patch.brackets if b.facet == facet] for facet in range(16)}
    for part in plates:
        whole = Polygon(patch.outlines[part.facet])
        notched, gone = (
            Polygon(part.outline),
            shapely.union_all([Polygon(foot) for foot in feet[part.facet]]),
        )
        assert notched.is_valid
        assert shapely.area(shapely.symmetric_difference(whole.difference(gone), notched)) < 1e-9
    for part, each in zip(brackets, patch.brackets, strict=True):
        wide, high = np.ptp(part.outline, axis=0)
        axis = float(patch.axis_mm[each.edge])
        bottom = float(patch.bottom_mm[each.facet])
        assert high == pytest.approx(max(abs(axis - bottom), abs(axis - bottom - 4.0)))
        # as wide as its foot along the crease, and as thick as the foot is across
        sides = np.linalg.norm(np.roll(each.foot, -1, axis=0) - each.foot, axis=1)
        assert sides == pytest.approx([wide, 4.0, wide, 4.0])
        start, end = patch.pattern.vertices_coords[patch.pattern.edges_vertices[each.edge]]
        left = np.array([start[1] - end[1], end[0] - start[0]]) / np.linalg.norm(end - start)
        assert np.abs((each.foot - start) @ left) == pytest.approx([0.2, 0.2, 4.2, 4.2])


def test_each_hinge_has_a_tape_on_its_axis() -> None:
    (patch,) = plywood().patches
    assert [edge for edge, _ in patch.tapes] == patch.edges_inner.tolist()
    for edge, outline in patch.tapes:
        start, end = patch.pattern.vertices_coords[patch.pattern.edges_vertices[edge]]
        assert outline.mean(axis=0) == pytest.approx((start + end) / 2)
        assert np.linalg.norm(outline[3] - outline[0]) == pytest.approx(8.4)
        feet = [each.foot for each in patch.brackets if each.edge == edge]
        for foot in feet:  # which the tape covers
            assert Polygon(outline).buffer(1e-6).covers(Polygon(foot))
        if not feet:  # then it is on the faces of both plates
            faces = patch.bottom_mm[patch.pattern.edges_faces[edge]]
            level = patch.axis_mm[edge] - (4.0 if patch.pattern.edges_fold_angle[edge] > 0 else 0)
            assert faces == pytest.approx([level, level], abs=0.01)


def test_brackets_that_have_no_room_are_refused(tmp_path: Path) -> None:
    least = float(plywood().limit_mm.min())
    for share in (0.98, 1.03):
        made = thick_plates(saddle(), share * least)
        (patch,) = made.patches
        assert made.limit_mm.min() == pytest.approx(least, rel=0.01)
        clean = all(
            Polygon(patch.outlines[facet]).buffer(2e-3 * least).covers(shapely.union_all(feet))
            and shapely.union_all(feet).area == pytest.approx(sum(f.area for f in feet), rel=1e-4)
            for facet in range(16)
            if (feet := [Polygon(b.foot) for b in patch.brackets if b.facet == facet])
        )
        assert clean == (share < 1) == (not len(made.too_small))
    with pytest.raises(InputError, match="too small for panels"):
        made.save(tmp_path / "plates.fold")
    assert not list(tmp_path.iterdir())


def test_plates_are_drawn_with_notches_hinges_tapes_and_brackets(tmp_path: Path) -> None:
    (patch,) = plywood().patches
    plywood().save(tmp_path / "plates.dxf")
    space = ezdxf.readfile(tmp_path / "plates.dxf").modelspace()
    by_layer: dict[str, list[np.ndarray]] = {}
    for line in space.query("POLYLINE"):
        points = np.array([tuple(vertex.dxf.location)[:2] for vertex in line.vertices])
        by_layer.setdefault(line.dxf.layer, []).append(points)
    assert {name: len(lines) for name, lines in by_layer.items()} == {
        "Plate": 16,
        "Hinge": 24,
        "HingeTape": 24,
        "Bracket": len(patch.brackets),
    }
    # plates are facets less the clearance, of which 0.2 mm is on each side, and less the feet
    facets = patch.pattern.vertices_coords[patch.pattern.faces_vertices]
    around = np.linalg.norm(facets - np.roll(facets, 1, axis=1), axis=2).sum()
    feet = sum(float(signed_areas(each.foot[None])[0]) for each in patch.brackets)
    left = sum(float(signed_areas(points[None])[0]) for points in by_layer["Plate"])
    lost = float(signed_areas(facets).sum()) - left
    assert lost - feet == pytest.approx(0.2 * around, rel=0.01)
    heights = sorted(float(np.ptp(points[:, 1])) for points in by_layer["Bracket"])
    assert heights == pytest.approx(sorted(b.high - b.low + 4.0 for b in patch.brackets), abs=1e-5)
    labels = [text.dxf.text for text in space.query("TEXT")]
    assert f"f5 {patch.bottom_mm[5]:+.2f}" in labels
    rising = sum(each.low >= patch.bottom_mm[each.facet] for each in patch.brackets)
    assert sum(label.endswith(" up") for label in labels) == rising > 0
    assert sum(label.endswith(" down") for label in labels) == len(patch.brackets) - rising > 0


@pytest.mark.parametrize("method", ["bennett", pytest.param("tapered", marks=pytest.mark.large)])
def test_the_parts_are_laid_out_on_sheets_and_the_job_is_proven(
    method: str, tmp_path: Path
) -> None:
    made = plywood() if method == "bennett" else thick_panels(saddle(), 2.0)
    parts = panel_parts(made)
    made.save(tmp_path / "parts.fold")
    job = miurafab.sheets(tmp_path / "parts.fold", machine="grbl-laser-400", material="card-250")
    layout = job.layout
    assert [patch.label for patch in layout.patches] == [f"P{n}" for n in range(1, len(parts) + 1)]
    assert (layout.borders, layout.absent, layout.findings) == ((), (), ())
    assert layout.totals.perforated_mm == 0.0
    for patch, part in zip(layout.patches, parts, strict=True):
        # the cut is half a kerf outside of the part
        around = Polygon(part.outline)
        wider = Polygon(patch.outline_mm).area - around.area
        assert wider == pytest.approx(0.075 * around.length, rel=0.03)
    for path in layout.toolpaths:  # each name is on its part, clear of the border
        strokes = np.split(path.points, path.offsets[1:-1])
        cut, engraved = (
            [
                (n, strokes[s])
                for s, n in enumerate(path.patch.tolist())
                if path.operation[s] == kind
            ]
            for kind in (OPERATIONS.index("cut"), OPERATIONS.index("engrave"))
        )
        room = {number: Polygon(points).buffer(-0.45) for number, points in cut}
        assert {number for number, _ in engraved} == set(room)
        assert all(room[number].covers(MultiPoint(points)) for number, points in engraved)
    assert check_job(job.write(tmp_path / "job").path).valid
