"""Curved lines of drawings: near enough to the curve, ruled, and folded as a plane crease folds."""

from __future__ import annotations

import io
import math

import ezdxf
import numpy as np
import pytest
import svgelements
from hypothesis import given
from hypothesis import strategies as st

import miurafab as mf
from miurafab.errors import OptionError, PatternError
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.ruled import bent_corners
from miurafab.origami.flat_folding import vertex_folds
from miurafab.origami.folding import from_flat
from miurafab.origami.folding.motion import find_motion
from miurafab.origami.formats.crease_lines import CreaseLines
from miurafab.origami.formats.dxf_entities import parse_dxf
from miurafab.origami.formats.planar_graph import pattern_from_lines
from miurafab.origami.formats.svg import parse_svg

PATHS = (
    "M10 80 C 40 10 65 10 95 80 S 150 150 180 80",
    "M10 80 Q 52.5 10 95 80 T 180 80 t 20 -30",
    "M0 0 A 30 50 20 0 1 100 50 a 25 25 -30 01 50-25",
    "M0 0 a 5 5 0 1 0 60 20 L 3 7 c 1 2 30 40 50 -60 z m 5 5 q 40 0 40 40",
)
WAVE = (
    '<svg><rect width="100" height="100" fill="none" stroke="#000"/>'
    '<path d="M0 50 C 30 20 70 80 100 50" stroke="#f00" fill="none"/></svg>'
)


def distances(points: np.ndarray, lines: CreaseLines) -> np.ndarray:
    """The distance of each of ``points`` (n, 2) from the nearest of ``lines``."""
    start, along = lines.ends[:, 0], np.diff(lines.ends, axis=1)[:, 0]
    offset = points[:, None] - start
    length = np.maximum((along**2).sum(axis=1), 1e-300)
    place = np.clip((offset * along).sum(axis=2) / length, 0, 1)
    return np.linalg.norm(offset - place[..., None] * along, axis=2).min(axis=1)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("tolerance", [1.0, 0.01])
def test_an_svg_path_is_followed_as_another_reader_reads_it(path: str, tolerance: float) -> None:
    lines = parse_svg(f'<svg><path d="{path}" stroke="red"/></svg>', tolerance)
    curve = svgelements.Path(path)
    points = np.array([[p.x, -p.y] for p in (curve.point(t) for t in np.linspace(0, 1, 999))])
    assert distances(points, lines).max() < tolerance
    assert lines.curves == sum(
        isinstance(each, svgelements.CubicBezier | svgelements.QuadraticBezier | svgelements.Arc)
        for each in curve
    )
    # a corner is on the curve, as near as 999 points tell
    corners = lines.ends[:, 0][lines.curve >= 0]
    apart = np.linalg.norm(corners[:, None] - points, axis=2).min(axis=1)
    assert apart.max() < 0.6 * np.linalg.norm(np.diff(points, axis=0), axis=1).max() + 1e-9


@given(
    st.floats(1, 100), st.floats(1, 100), st.floats(0, 360), st.booleans(), st.booleans(),
    st.floats(-90, 90), st.floats(1, 90),
)  # fmt: skip
def test_any_arc_of_svg_ends_where_it_shall_on_its_ellipse(
    rx: float, ry: float, turn: float, large: bool, sweep: bool, x: float, y: float
) -> None:
    path = f"M0 0 A {rx} {ry} {turn} {large:d} {sweep:d} {x} {y}"
    lines = parse_svg(f'<svg><path d="{path}" stroke="red"/></svg>', 0.05)
    assert lines.ends[-1, 1] == pytest.approx([x, -y], abs=1e-7)
    arc = svgelements.Path(path)[1]
    points = np.array([[p.x, -p.y] for p in (arc.point(t) for t in np.linspace(0, 1, 50))])
    assert distances(points, lines).max() < 0.05 + 1e-6


def test_round_shapes_of_svg_are_closed() -> None:
    lines = parse_svg(
        '<svg stroke="#000"><circle cx="5" cy="6" r="3"/><ellipse rx="4" ry="2"/>'
        '<rect x="10" y="10" width="8" height="4" rx="1"/></svg>',
        1e-3,
    )
    ends = lines.ends
    tails, heads = (ends[:, side].round(9) + 0.0 for side in (0, 1))
    assert sorted(map(tuple, tails)) == sorted(map(tuple, heads))
    x, y = ends[..., 0], ends[..., 1]
    area = float((x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0]).sum() / 2)
    whole = math.pi * 9 + math.pi * 8 + 32 - (4 - math.pi)
    assert 0 < whole - abs(area) < 0.04


def test_a_rectangle_whose_corners_meet_has_no_sides_between_them() -> None:
    lines = parse_svg('<svg><rect width="8" height="4" rx="9" ry="2" stroke="red"/></svg>', 1e-3)
    assert lines.curves == 4
    assert (lines.curve >= 0).all()
    radius = np.linalg.norm((lines.ends - [4, -2]) / [4, 2], axis=2)
    np.testing.assert_allclose(radius, 1.0, atol=1e-12)


def test_a_curve_that_one_line_is_near_enough_to_is_that_line() -> None:
    bow = WAVE.replace("C 30 20 70 80", "Q 50 60")
    pattern = pattern_from_lines(parse_svg(bow, curve_tolerance=6.0))
    creases = np.isin(pattern.edges_assignment, ("M", "V"))
    ((one, other),) = pattern.vertices_coords[pattern.edges_vertices[creases]].tolist()
    assert sorted([one, other]) == [[0.0, 50.0], [100.0, 50.0]]
    assert len(pattern.faces_vertices) == 2


def drawing(draw) -> str:
    document = ezdxf.new("R2010")
    draw(document.modelspace())
    text = io.StringIO()
    document.write(text)
    return text.getvalue()


def test_the_curves_of_a_dxf_are_followed_as_another_reader_reads_them() -> None:
    def draw(space) -> None:
        space.add_arc((3, 4), 5, 30, 200, dxfattribs={"layer": "mountain"})
        space.add_arc((3, 4), 5, 300, 40, dxfattribs={"extrusion": (0, 0, -1)})
        space.add_circle((30, 4), 2)
        space.add_ellipse((10, 40), (8, 3), 0.4, 0.5, 4.5)
        space.add_lwpolyline([(0, 60, 0.7), (10, 60, 0), (20, 65, -2), (30, 60, 0)], format="xyb")
        space.add_polyline2d([(0, 80, 0.3), (10, 80, 0), (10, 90, 0)], format="xyb", close=True)
        spline = space.add_spline(degree=3)
        spline.set_open_uniform([(50, 0), (60, 30), (70, -30), (90, 10), (95, 30)])
        spline.weights = [1, 2, 1, 0.5, 1]

    text, tolerance = drawing(draw), 0.01
    lines = parse_dxf(text, tolerance)
    assert lines.curves == 8  # the polylines have three bulges
    assert lines.assignment[0] == "M"
    total = 0
    for entity in ezdxf.read(io.StringIO(text)).modelspace():
        if entity.dxftype() == "SPLINE":
            spline = entity.construction_tool()
            on = spline.points(np.linspace(0, spline.max_t, 500))
        else:
            on = ezdxf.path.make_path(entity).flattening(1e-4, segments=64)
        points = np.array([[p.x, p.y] for p in on])
        assert distances(points, lines).max() < tolerance + 1e-3, entity.dxftype()
        total += 1
    assert total == 7


def test_a_curve_whose_points_are_one_has_no_shape() -> None:
    """Two curves alike beside it become as many lines each."""
    course = "M 10 10 C 20 40 60 40 70 10 M 10 60 C 20 90 60 90 70 60 M 5 5 C 5 5 5 5 5 5"
    lines = parse_svg(f'<svg><path d="{course}" stroke="red"/></svg>')
    one, other = np.split(lines.ends[:-1], 2)
    assert (lines.ends[-1] == [5.0, -5.0]).all()
    assert len(one) > 1
    assert np.abs(other - one - [0.0, -50.0]).max() < 1e-9


def test_what_a_drawing_holds_besides_lines_is_told() -> None:
    def draw(space) -> None:
        space.add_lwpolyline([(0, 0), (9, 0), (9, 9), (0, 9)], close=True)
        space.add_line((0, 0), (9, 9))
        space.add_solid([(0, 0), (1, 0), (0, 1), (1, 1)])
        space.add_text("a note")

    pattern = pattern_from_lines(parse_dxf(drawing(draw)))
    assert [finding.code for finding in pattern.told] == ["lost-lines"]
    assert "1 SOLID" in pattern.told[0].sentence


def arc(opacity: float, radius: float = 100.0) -> str:
    """A square of 100 whose mountain crease is an arc."""
    return (
        '<svg><rect width="100" height="100" stroke="#000"/><path stroke="#f00" '
        f'stroke-opacity="{opacity}" d="M0 50 A {radius} {radius} 0 0 1 100 50"/></svg>'
    )


def test_rulings_run_towards_the_middle_of_an_arc_and_meet_kawasaki() -> None:
    pattern = pattern_from_lines(parse_svg(arc(0.5), 0.2))
    middle = np.array([50.0, 50 - math.sqrt(100**2 - 50**2)])
    flat = pattern.edges_assignment == "F"
    ends = pattern.vertices_coords[pattern.edges_vertices[flat]] - middle
    cross = ends[:, 0, 0] * ends[:, 1, 1] - ends[:, 0, 1] * ends[:, 1, 0]
    assert np.abs(cross / np.linalg.norm(ends, axis=2).prod(axis=1)).max() < 1e-9
    assert flat.sum() >= 16
    told = [finding.sentence for finding in pattern.told]
    creases = int((pattern.edges_assignment == "M").sum())
    assert f"became {creases} straight lines within 0.2 mm" in told[0]
    assert f"{flat.sum()} rulings" in told[1]


def folded_crease(opacity: float) -> tuple[CreasePattern, np.ndarray, float]:
    """The pattern, the corners of its crease when folded, and the mean angle there."""
    pattern = pattern_from_lines(parse_svg(arc(opacity), 0.2))
    found = find_motion(pattern, 6)
    assert found.verdict is not None
    assert found.verdict.complete
    assert found.verdict.strain.max() < 1e-3
    assert found.verdict.wrong_signs == 0
    creases = np.flatnonzero(pattern.edges_assignment == "M")
    corners = np.unique(pattern.edges_vertices[creases])
    angle = float(np.abs(found.motion.fold_angles[-1][creases]).mean())
    return pattern, found.motion.frames[-1][corners], angle


@pytest.mark.parametrize("degrees", [45, 90])
def test_a_round_crease_folds_as_a_plane_crease_of_one_angle(degrees: int) -> None:
    """The curvature of the flat crease is that of the folded crease times the cosine of half the
    fold angle, so its radius is R cos(rho / 2) (Fuchs and Tabachnikov 1999).
    """
    _, corners, angle = folded_crease(degrees / 180)
    assert math.degrees(angle) == pytest.approx(degrees, rel=0.1)
    centred = corners - corners.mean(axis=0)
    _, size, axes = np.linalg.svd(centred)
    assert size[2] < 0.01 * size[0]
    x, y = centred @ axes[0], centred @ axes[1]
    a, b, c = np.linalg.lstsq(np.stack([x, y, np.ones(len(x))], 1), x**2 + y**2, rcond=None)[0]
    radius = math.sqrt(c + (a**2 + b**2) / 4)
    assert radius == pytest.approx(100 * math.cos(angle / 2), rel=0.02)


def test_a_line_that_ends_on_a_curve_ends_there() -> None:
    lines = parse_svg(
        '<svg><rect width="100" height="100" stroke="#000"/>'
        '<path stroke="#f00" d="M0 50 A 100 100 0 0 1 100 50"/>'
        f'<line x1="47.3" y1="100" x2="47.3" y2="{50 + math.sqrt(7500) - math.sqrt(1e4 - 2.7**2)}" '
        'stroke="#00f"/></svg>',
        1.0,
    )
    pattern = pattern_from_lines(lines)
    valleys = pattern.edges_assignment == "V"
    assert valleys.sum() == 1
    length = np.linalg.norm(np.diff(pattern.vertices_coords[pattern.edges_vertices], axis=1)[:, 0],
                            axis=1)  # fmt: skip
    assert length[valleys][0] == pytest.approx(50 - math.sqrt(7500) + math.sqrt(1e4 - 2.7**2))
    assert length.min() > 1.0
    assert len(vertex_folds(pattern)[0])


def test_a_curve_that_needs_too_many_lines_is_refused() -> None:
    with pytest.raises(PatternError, match="curve_tolerance"):
        parse_svg(arc(1), 1e-9)


def test_the_tolerance_of_curves_is_for_drawings_that_have_some(tmp_path) -> None:
    (tmp_path / "a.svg").write_text(arc(0.5))
    coarse = mf.load(tmp_path / "a.svg", curve_tolerance="2mm")
    fine = mf.load(tmp_path / "a.svg", curve_tolerance=0.05)
    assert len(fine.faces_vertices) > 3 * len(coarse.faces_vertices)
    (tmp_path / "a.cp").write_text("1 0 0 1 0\n")
    with pytest.raises(OptionError, match="curve_tolerance"):
        mf.load(tmp_path / "a.cp", curve_tolerance=1)
    with pytest.raises(OptionError, match="curve_tolerance"):
        mf.load(tmp_path / "a.svg", curve_tolerance=0)


def test_a_crease_that_cannot_reach_half_a_turn_moves_as_far_as_it_goes() -> None:
    found = find_motion(pattern_from_lines(parse_svg(arc(1.0), 0.4)), 6)
    assert found.verdict is not None
    assert found.verdict.wrong_signs == 0
    assert np.degrees(np.abs(found.motion.fold_angles[-1]).max()) > 45


def test_a_curved_crease_that_is_lost_at_once_is_not_blamed_for_its_flat_facets(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Flat facets could not begin to fold there; those of a ruled sheet bend."""
    pattern = pattern_from_lines(parse_svg(WAVE, 0.1))
    assert len(find_motion(pattern, 3).motion.frames) == 4
    monkeypatch.setattr(from_flat, "FIRST_PARTS", ())  # no balance near flat is found
    with pytest.raises(PatternError, match="up to 54 degrees: facets have to bend") as lost:
        find_motion(pattern, 3)
    assert "cannot begin" not in str(lost.value)
    assert "more 'steps'" in str(lost.value)


def drawn_curves(*courses: str) -> CreasePattern:
    """A square of 100 with the curves of an SVG path each, mountain and valley in turns."""
    curves = "".join(
        f'<path d="{course}" stroke="{("red", "blue")[number % 2]}" fill="none"/>'
        for number, course in enumerate(courses)
    )
    text = f'<svg><rect width="100" height="100" fill="none" stroke="#000"/>{curves}</svg>'
    return pattern_from_lines(parse_svg(text, 0.3))


WAVY = "M0 {y} c 20 -24 40 12 50 0 s 30 10 50 -6"


def test_pleats_of_one_curve_fold_as_a_mirrored_cylinder() -> None:
    """The paper between two curves, of which one is the other moved, is ruled along the move. A
    plane that meets the rulings at the angle t cuts the cylinder in both curves, and mirrors it
    beyond. A crease at the angle a to the rulings then lies in a facet that meets the plane at
    sin(rho / 2) = sin(t) / sin(a), so t is the same at every crease.
    """
    pattern = drawn_curves(*(WAVY.format(y=y) for y in (75, 50, 25)))
    flat = pattern.edges_assignment == "F"
    along = np.diff(pattern.vertices_coords[pattern.edges_vertices], axis=1)[:, 0]
    assert np.abs(along[flat, 0]).max() < 0.02 * np.abs(along[flat, 1]).max()
    found = find_motion(pattern, 6)
    assert found.verdict is not None
    assert found.verdict.complete
    assert found.verdict.wrong_signs == 0
    creases = np.isin(pattern.edges_assignment, ("M", "V"))
    sine = np.abs(along[creases, 0]) / np.linalg.norm(along[creases], axis=1)
    folds = np.abs(found.motion.fold_angles[:, creases])
    tilt = np.sin(folds / 2) * sine
    exact = (found.verdict.strain < 1e-12) & (np.arange(7) > 0)
    assert exact.sum() >= 3
    assert np.degrees(folds[exact].max()) > 80
    spread = np.ptp(tilt[exact], axis=1) / tilt[exact].mean(axis=1)
    assert spread.max() < 2e-3


def test_rulings_between_a_curve_and_its_enlargements_meet_in_one_point() -> None:
    curves = "".join(
        f'<path d="M{50 - 30 * size} {60 * size} c {20 * size} {-15 * size} {40 * size} '
        f'{15 * size} {60 * size} 0" stroke="{stroke}" fill="none"/>'
        for size, stroke in ((1.6, "red"), (1.75, "blue"), (1.9, "red"))
    )
    rim = '<path d="M20 60 L 80 60 L 140 180 L -40 180 z" stroke="#000" fill="none"/>'
    pattern = pattern_from_lines(parse_svg(f"<svg>{rim}{curves}</svg>", 0.3))
    flat = pattern.edges_assignment == "F"
    lines = pattern.vertices_coords[pattern.edges_vertices[flat]]
    along = np.diff(lines, axis=1)[:, 0]
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    offsets = (normal * lines[:, 0]).sum(axis=1)
    point, *_ = np.linalg.lstsq(normal, offsets, rcond=None)
    assert len(lines) >= 20
    assert np.abs(normal @ point - offsets).max() < 1e-6
    top = pattern.vertices_coords[:, 1].max()
    assert point[1] - top == pytest.approx(60, abs=1e-6)  # above the sheet, where sizes vanish


UNLIKE = ("M0 60 C20 60 25 85 50 85 S80 60 100 60", "M0 40 C30 40 35 50 50 30 S70 15 100 40")


def test_every_corner_of_curves_that_are_not_alike_is_ruled_on_both_sides_and_folds() -> None:
    """Rulings across one of these curves would cross those of the other, or run along a side; then
    they go to another corner. A corner without one locks (this drawing was "lost" at once)."""
    pattern = drawn_curves(*UNLIKE)
    creased = np.isin(pattern.edges_assignment, ("M", "V"))
    bent = bent_corners(pattern)
    assert bent.sum() > 20
    for face, edges in zip(pattern.faces_vertices, pattern.faces_edges, strict=True):
        corners = face[face >= 0]
        folds = creased[edges[: len(corners)]]
        assert not (bent[corners] & folds & np.roll(folds, 1)).any()
    found = find_motion(pattern, 4)
    assert found.verdict is not None
    assert found.verdict.complete
    assert found.verdict.wrong_signs == 0
    assert np.degrees(np.abs(found.motion.fold_angles[-1]).max()) > 90


def test_curves_that_nearly_meet_leave_no_edges_finer_than_their_tolerance_tells() -> None:
    """Two curves end beside the end of a line, 0.05 mm off where a curve may be 0.3 mm off."""
    curves = "M0 50 C 10 50 20 30 40 30 S 50 40 60 49.95 L 100 50"
    other = "M0 60 C 10 60 20 80 40 80 S 50 60 60 50"
    pattern = drawn_curves(curves, other)
    ends = pattern.vertices_coords[pattern.edges_vertices]
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).min() > 0.075
    assert "joined-ends" in [finding.code for finding in pattern.told]


@pytest.mark.parametrize(
    ("curve", "valley"),
    [
        ('<path d="M0 70 A80 80 0 0 1 70 100" stroke="red"/>', "M80 0V60"),
        ('<circle cx="20" cy="20" r="10" stroke="red"/>', "M50 0V60"),
    ],
)
def test_what_a_crease_lost_is_what_the_finished_pattern_lacks_of_it(curve, valley) -> None:
    """Rulings complete a crease that ends within a facet, as far as they meet it."""
    pattern = pattern_from_lines(
        parse_svg(
            '<svg><g fill="none"><rect width="100" height="100" stroke="#000"/>'
            f'<path d="{valley}" stroke="blue"/>{curve}</g></svg>'
        )
    )
    lengths = np.linalg.norm(
        np.diff(pattern.vertices_coords[pattern.edges_vertices], axis=1)[:, 0], axis=1
    )
    missing = 60 - lengths[pattern.edges_assignment == "V"].sum()
    assert 1 < missing < 30
    (lost,) = [each.sentence for each in pattern.told if each.code == "lost-lines"]
    assert "1 line of the drawing is left out in part" in lost
    assert f"by up to {missing:.3g} mm" in lost


def test_an_end_on_a_curve_is_no_end_that_a_tolerance_moved() -> None:
    """It lies off the straight lines of the curve; nothing was read then (AssertionError)."""
    high = 80 - math.sqrt(1600 - 8**2)
    drawing = (
        '<svg><path stroke="#000" d="M0 0H100V80H0Z"/><path stroke="#00f" d="M4 0.5V79.5"/>'
        '<path stroke="#f00" d="M10 0A40 40 0 0 0 90 0"/>'
        f'<path stroke="#00f" d="M58 80v{-high}"/></svg>'
    )
    found = pattern_from_lines(parse_svg(drawing, 1.0))
    assert {finding.code for finding in found.told} == {"curved-lines", "joined-ends"}
