"""Loose lines made into patterns: crossings, tees, doubled and dangling lines, and real sheets."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from problems import regular

from miurafab.errors import PatternError
from miurafab.geometry.polygons import edge_lengths, filled, no_polygons, signed_areas
from miurafab.origami.folding.contact import overlaps
from miurafab.origami.formats.crease_lines import CreaseLines, lines_of
from miurafab.origami.formats.fold import parse_fold
from miurafab.origami.formats.line_crossings import lines_cross
from miurafab.origami.formats.planar_graph import (
    enclosed_facets,
    faces_of_plane_graph,
    pattern_from_lines,
)


def drawn(*lines: tuple[str, float, float, float, float]) -> CreaseLines:
    ends = np.array([line[1:] for line in lines], dtype=np.float64).reshape(-1, 2, 2)
    return CreaseLines(ends, np.array([line[0] for line in lines]), np.full(len(lines), np.nan))


SQUARE = (("B", 0, 0, 2, 0), ("B", 2, 0, 2, 2), ("B", 2, 2, 0, 2), ("B", 0, 2, 0, 0))


def edge_set(pattern, letters: str) -> set[tuple[tuple[float, float], ...]]:
    ends = pattern.vertices_coords[pattern.edges_vertices].round(6)
    return {
        tuple(sorted(tuple(map(float, end)) for end in pair))
        for pair, letter in zip(ends, pattern.edges_assignment, strict=True)
        if letter in letters
    }


def test_two_crossing_creases_make_four_facets() -> None:
    found = pattern_from_lines(drawn(*SQUARE, ("M", 0, 0, 2, 2), ("V", 0, 2, 2, 0)))
    assert found.faces_vertices.shape == (4, 3)
    assert len(found.vertices_coords) == 5
    assert sorted(found.edges_assignment) == ["B"] * 4 + ["M"] * 2 + ["V"] * 2
    assert found.edges_fold_angle[found.edges_assignment == "M"] == pytest.approx(-np.pi)


def test_an_end_on_a_line_splits_it() -> None:
    found = pattern_from_lines(drawn(*SQUARE, ("V", 1, 0, 1, 2)))
    assert found.faces_vertices.shape == (2, 4)
    assert edge_set(found, "V") == {((1, 0), (1, 2))}
    assert len(edge_set(found, "B")) == 6


def test_ends_within_the_tolerance_are_one() -> None:
    crooked = drawn(*SQUARE[:3], ("B", 0.01, 2, 0, 0.012), ("V", 1, 0.009, 1, 1.992))
    with pytest.raises(PatternError, match="enclose no facet"):
        pattern_from_lines(crooked, tolerance=0.001)
    found = pattern_from_lines(crooked, tolerance=0.02)
    assert found.faces_vertices.shape == (2, 4)
    assert found.told == ()
    joined = pattern_from_lines(crooked)  # as the least tolerance that loses no line
    assert joined.faces_vertices.shape == (2, 4)
    assert [finding.code for finding in joined.told] == ["joined-ends"]


def test_doubled_lines_count_once_and_dangling_ones_not_at_all() -> None:
    found = pattern_from_lines(
        drawn(*SQUARE, ("V", 1, 0, 1, 2), ("F", 1, 2, 1, 0), ("M", 1, 1, 1.5, 1), ("V", 1, 0, 1, 1))
    )
    assert len(found.faces_vertices) == 2
    assert edge_set(found, "F") == set()
    assert edge_set(found, "M") == set()


def test_an_inner_border_is_a_cut_and_a_hole_is_no_facet() -> None:
    hole = (
        ("B", 0.5, 1, 1, 0.5),
        ("B", 1, 0.5, 1.5, 1),
        ("B", 1.5, 1, 1, 1.5),
        ("B", 1, 1.5, 0.5, 1),
    )
    creases = (("V", 1, 0, 1, 0.5), ("V", 1, 1.5, 1, 2))
    found = pattern_from_lines(drawn(*SQUARE, *hole, *creases))
    assert len(found.faces_vertices) == 2
    assert (found.edges_assignment == "V").sum() == 2
    slit = pattern_from_lines(drawn(*SQUARE, ("V", 0, 1, 1, 1), ("B", 1, 1, 2, 1)))
    assert edge_set(slit, "C") == {((1, 1), (2, 1))}


def test_what_is_no_pattern_is_refused() -> None:
    with pytest.raises(PatternError, match="no line"):
        pattern_from_lines(drawn())
    with pytest.raises(PatternError, match="enclose no facet"):
        pattern_from_lines(drawn(("M", 0, 0, 1, 0)))


def ring(letter: str, x: float, y: float, radius: float, sides: int) -> list:
    """A closed line around (x, y)."""
    turn = 2 * np.pi * np.arange(sides + 1) / sides
    corners = np.stack([x + radius * np.cos(turn), y + radius * np.sin(turn)], axis=1)
    return [(letter, *a, *b) for a, b in pairwise(corners)]


def area_of(pattern) -> float:
    return float(signed_areas(pattern.vertices_coords[filled(pattern.faces_vertices)]).sum())


@pytest.mark.parametrize("stray", [(), (("V", 0.1, 0.1, 0.2, 0.2),), (("V", 1.6, 1, 1.7, 1),)])
@pytest.mark.parametrize(("letter", "radius"), [("M", 0.6), ("B", 0.6), ("M", 0.96), ("B", 0.01)])
def test_a_closed_line_inside_a_facet_stays_as_it_is_drawn(letter, radius, stray) -> None:
    """A wide tolerance made one point of its ends, or led it through the border beside it."""
    closed = ring(letter, 1, 1, radius, 38)
    found = pattern_from_lines(drawn(*SQUARE, *closed, *stray))
    hole = letter == "B"
    assert len(found.faces_vertices) == (2 if hole else 3)
    letters = found.edges_assignment == letter
    corners = found.vertices_coords[np.unique(found.edges_vertices[letters])]
    away = np.linalg.norm(corners - 1, axis=1)
    assert (np.abs(away - radius) < 1e-9).sum() == 38
    inner = 38 / 2 * radius**2 * np.sin(2 * np.pi / 38)
    assert area_of(found) == pytest.approx(4 - inner * hole)
    codes = [finding.code for finding in found.told]
    assert "joined-ends" not in codes
    assert "loose-parts" in codes
    assert ("holes" in codes) == hole


def test_ends_are_joined_beside_a_closed_line_that_stays() -> None:
    """A crease that ends short of the border, and a window beside it."""
    short = ("V", 0.5, 0.01, 0.5, 1.99)
    found = pattern_from_lines(drawn(*SQUARE, *ring("B", 1.4, 1, 0.3, 8), short))
    assert len(found.faces_vertices) == 3  # a flat line from the window ends at the crease
    assert len(edge_set(found, "V")) == 2
    assert area_of(found) == pytest.approx(4 - 4 * 0.09 * np.sin(np.pi / 4), abs=0.03)
    assert {finding.code for finding in found.told} == {"joined-ends", "loose-parts", "holes"}


@pytest.mark.parametrize(("count", "seed"), [(30, 0), (40, 4), (150, 1)])
def test_no_tolerance_moves_ends_over_other_lines(count: int, seed: int) -> None:
    """Of 48 such tangles 15 were read as facets on each other. The last leaves more edges short
    than it has lines."""
    ends = np.random.default_rng(seed).random((count, 2, 2))
    found = pattern_from_lines(CreaseLines(ends, np.full(count, "M"), np.full(count, np.nan)))
    assert not lines_cross(found.vertices_coords, found.edges_vertices)
    assert overlaps(found).tolist() == []


@pytest.mark.parametrize("letter", ["F", "V"])
def test_a_line_to_a_window_leaves_polygons(letter: str) -> None:
    """One facet lay on both sides of it, whose border is no polygon: `sheets` refused it."""
    lines = drawn(*SQUARE, *ring("B", 1, 1, 0.5, 4), (letter, 1, 1.5, 1, 2))
    found = pattern_from_lines(lines)
    assert len(found.faces_vertices) == 2
    assert no_polygons(found.vertices_coords, found.faces_vertices).tolist() == []
    assert ((1.0, 1.5), (1.0, 2.0)) in edge_set(found, letter)
    assert {finding.code for finding in found.told} == {"loose-parts", "holes"}
    # so in a FOLD file without facets
    corners, ends = np.unique(lines.ends.reshape(-1, 2).round(9), axis=0, return_inverse=True)
    document = {
        "vertices_coords": corners.tolist(),
        "edges_vertices": ends.reshape(-1, 2).tolist(),
        "edges_assignment": lines.assignment.tolist(),
    }
    assert len(parse_fold(document).faces_vertices) == 2


def test_a_loose_window_beside_one_that_a_line_joins_leaves_polygons() -> None:
    """The loose one was joined, and the facet still lay on both sides of the line to the other."""
    windows = [line for x in (0.5, 1.5) for line in ring("B", x, x, 0.2, 4)]
    found = pattern_from_lines(drawn(*SQUARE, *windows, ("F", 0.5, 0.7, 0.5, 2)))
    assert no_polygons(found.vertices_coords, found.faces_vertices).tolist() == []
    assert [finding.sentence for finding in found.told if finding.code == "loose-parts"] == [
        "1 part of the drawing lies loose inside a facet: two flat lines (F) join it to the lines "
        "around.",
        "1 part of the drawing hangs in a facet at one vertex: a flat line (F) joins it to the "
        "lines around.",
    ]


def test_parts_that_lie_loose_in_each_other_are_joined() -> None:
    """Rings of creases in each other were refused."""
    rings = [
        line for at, letter in enumerate("MVM") for line in ring(letter, 1, 1, 0.9 - at / 4, 6)
    ]
    found = pattern_from_lines(drawn(*SQUARE, *rings))
    assert area_of(found) == pytest.approx(4)
    assert len(found.faces_vertices) == 7  # each ring is parted by the lines of that within it
    assert "3 parts of the drawing lie loose" in found.told[-1].sentence


TRIANGLES = {
    "border": [(0.5, 0, 0.7, 0.5, 0.3, 0.5)],
    "corner": [(0, 0, 0.7, 0.5, 0.5, 0.7)],
    "crease": [(1, 1, 0.7, 1.3, 0.6, 0.9)],
    "right": [(1, 1, 1.3, 1.3, 1.4, 0.9)],
    "window": [(0.5, 1, 0.7, 1.3, 0.3, 1.3), (0.5, 1, 0.7, 0.6, 0.3, 0.6)],
    "three": [
        (0, 0, 0.3, 0.1, 0.1, 0.3),
        (0.3, 0.1, 0.5, 0.4, 0.6, 0.1),
        (0.6, 0.1, 0.8, 0.3, 0.9, 0.1),
    ],
}


@pytest.mark.parametrize("touched", TRIANGLES)
def test_a_window_that_touches_another_line_in_a_vertex_leaves_polygons(touched: str) -> None:
    """The facet around it had the vertex twice; `check` called it sound, and `sheets` refused."""
    windows, paper = [], 4.0
    for x0, y0, x1, y1, x2, y2 in TRIANGLES[touched]:
        windows += [("B", x0, y0, x1, y1), ("B", x1, y1, x2, y2), ("B", x2, y2, x0, y0)]
        paper -= abs((x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)) / 2
    found = pattern_from_lines(drawn(*SQUARE, ("V", 1, 0, 1, 2), *windows))
    assert area_of(found) == pytest.approx(paper)
    assert no_polygons(found.vertices_coords, found.faces_vertices).tolist() == []
    assert {finding.code for finding in found.told} == {"holes", "loose-parts"}


@pytest.mark.parametrize(
    ("slits", "ends"),
    [
        ([(0, 0.7, 0.5, 1)], 1),
        ([(0.3, 0.7, 0.5, 1.2)], 2),
        ([(0.3, 0.7, 0.3, 1.2), (0.6, 0.7, 0.6, 1.2)], 4),  # one flat line ends at the other slit
        ([(0.3, 1, 0.7, 1), (0.5, 0.8, 0.5, 1.2)], 4),
        ([(0.7, 1, 1.3, 1.1)], 2),
        ([(0.2, 0.3, 0.2, 0.8), (0.2, 0.8, 0.7, 0.8), (0.7, 0.8, 0.7, 0.5)], 2),
    ],
)
@pytest.mark.parametrize("letter", ["B", "C"])
def test_a_slit_that_ends_in_a_facet_is_a_cut(letter: str, slits: list, ends: int) -> None:
    """It was left out of the pattern, so that it was not cut."""
    found = pattern_from_lines(drawn(*SQUARE, ("V", 1, 0, 1, 2), *((letter, *s) for s in slits)))
    cut = found.edges_vertices[found.edges_assignment == "C"]
    drawn_mm = sum(np.hypot(x1 - x0, y1 - y0) for x0, y0, x1, y1 in slits)
    assert edge_lengths(found.vertices_coords, cut).sum() == pytest.approx(drawn_mm)
    assert area_of(found) == pytest.approx(4)
    assert no_polygons(found.vertices_coords, found.faces_vertices).tolist() == []
    (told,) = found.told
    assert told.sentence.startswith(f"{ends} end{'s' * (ends > 1)} of cuts")


def test_the_ends_of_slits_stay_apart_and_those_that_miss_a_line_are_joined() -> None:
    """A bridge of paper between two cuts, a twentieth of a line long, is no gap of the drawing."""
    bridge = (("C", 0, 1, 0.45, 1), ("C", 0.55, 1, 1, 1))
    found = pattern_from_lines(drawn(*SQUARE, ("V", 1, 0, 1, 2), *bridge))
    assert edge_set(found, "F") == {((0.45, 1), (0.55, 1))}
    missed = (("B", 0, 1, 0.995, 1), ("M", 1, 1, 2, 1))
    found = pattern_from_lines(drawn(*SQUARE, ("V", 1, 0, 1, 2), *missed))
    assert edge_set(found, "F") == set()
    assert [finding.code for finding in found.told] == ["joined-ends"]


def test_windows_side_by_side_leave_polygons() -> None:
    windows = [line for x in (0.4, 1.0, 1.6) for line in ring("B", x, 1, 0.2, 12)]
    found = pattern_from_lines(drawn(*SQUARE, *windows))
    assert len(found.faces_vertices) == 2
    assert area_of(found) == pytest.approx(4 - 3 * 6 * 0.04 * np.sin(np.pi / 6))
    assert found.pieces is None
    assert "3 parts of the drawing lie loose" in found.told[-1].sentence


def test_lines_that_are_lost_in_part_are_told_and_joined_if_they_can_be() -> None:
    """A crease that ends 0.02 before the border had a half that nobody missed."""
    cross = (("M", 0, 1, 2, 1), ("V", 1, 0, 1, 1.98))
    found = pattern_from_lines(drawn(*SQUARE, *cross))
    assert len(found.faces_vertices) == 4
    assert [finding.code for finding in found.told] == ["joined-ends"]
    torn = pattern_from_lines(drawn(*SQUARE, cross[0], ("V", 1, 0, 1, 1.5)))
    assert len(torn.faces_vertices) == 3
    assert [finding.sentence for finding in torn.told] == [
        "1 line of the drawing is left out in part, where no facet is beside, by up to 0.5 mm, the "
        "first V at (1, 0.75)."
    ]
    over = pattern_from_lines(drawn(*SQUARE, cross[0], ("V", 1, 0, 1, 2.05)))
    assert over.told == ()


@pytest.mark.parametrize("beyond", [0.06, 0.5])
def test_a_crease_that_reaches_beyond_the_border_leaves_the_border_as_it_is(beyond) -> None:
    """A wide tolerance led the border out to the ends of the crease."""
    found = pattern_from_lines(drawn(*SQUARE, ("V", 1, -beyond, 1, 2 + beyond)))
    assert edge_set(found, "V") == {((1, 0), (1, 2))}
    assert area_of(found) == pytest.approx(4)
    assert found.told == ()


def test_edges_of_a_file_with_a_window_are_lines_of_a_drawing() -> None:
    """They were two facets on each other, of which a check said that they overlap."""
    closed = ring("B", 1, 1, 0.5, 8)
    ends = np.array([line[1:] for line in (*SQUARE, *closed)]).reshape(-1, 2)
    points, edges = np.unique(ends.round(9), axis=0, return_inverse=True)
    document = {
        "file_spec": 1.1,
        "vertices_coords": points.tolist(),
        "edges_vertices": edges.reshape(-1, 2).tolist(),
        "edges_assignment": ["B"] * 12,
    }
    found = parse_fold(document)
    assert area_of(found) == pytest.approx(4 - 4 * 0.25 * np.sin(np.pi / 4))
    assert [finding.code for finding in found.told] == ["holes", "loose-parts"]
    point = {**document, "edges_vertices": [*document["edges_vertices"], [0, 0]]}
    point["edges_assignment"] = [*document["edges_assignment"], "M"]
    again = parse_fold(point)  # such an edge has no length, and is no line
    assert (again.faces_vertices == found.faces_vertices).all()
    frames = {**document, "file_frames": [{"frame_classes": ["foldedForm"], **document}]}
    with pytest.raises(PatternError, match=r"at \(0.5, 1\), lies loose inside a facet; join"):
        parse_fold({"frame_classes": ["creasePattern"], **frames})


def test_edges_of_a_file_that_enclose_nothing_or_too_much_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    points = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    ring = np.array([[0, 1], [1, 2], [2, 3], [3, 0]])
    assert enclosed_facets(points, ring, np.full(4, "B")).tolist() == [[0, 1, 2, 3]]
    with pytest.raises(PatternError, match="refers to a vertex that does not exist"):
        enclosed_facets(points[:3], ring, np.full(4, "B"))
    with pytest.raises(PatternError, match="'edges_vertices' encloses no facet"):
        enclosed_facets(points, ring[:3], np.full(3, "B"))
    assert not lines_cross(points[:3], ring)
    assert not lines_cross(np.where(points == 1.0, np.nan, points), ring)
    assert lines_cross(points, np.array([[0, 2], [1, 3]]))
    monkeypatch.setattr("miurafab.origami.formats.planar_graph._MOST_CORNERS", 3)
    with pytest.raises(PatternError, match="more than 4 corners, too many beside 1 others"):
        enclosed_facets(points, ring, np.full(4, "B"))


def test_parts_that_lie_apart_are_pieces() -> None:
    apart = [(letter, x0 + 5, y0, x1 + 5, y1) for letter, x0, y0, x1, y1 in SQUARE]
    found = pattern_from_lines(drawn(*SQUARE, ("M", 0, 0, 2, 2), *apart))
    assert found.pieces_count == 2
    assert sorted((found.faces_vertices >= 0).sum(axis=1).tolist()) == [3, 3, 4]
    assert np.bincount(found.pieces).tolist() in ([2, 1], [1, 2])


def test_a_piece_may_lie_in_the_hole_of_another() -> None:
    inner = [(letter, *(0.9 + 0.1 * at for at in ends)) for letter, *ends in SQUARE]
    hole = [(letter, *(0.5 + 0.5 * at for at in ends)) for letter, *ends in SQUARE]
    creases = (("V", 0, 0, 0.5, 0.5), ("V", 2, 2, 1.5, 1.5))
    found = pattern_from_lines(drawn(*SQUARE, *hole, *creases, *inner))
    assert found.pieces_count == 2
    assert len(found.faces_vertices) == 3


def test_a_concave_outline_is_gone_round_counter_clockwise() -> None:
    points = np.array([[0, 0], [4, 0], [4, 4], [2, 1], [0, 4]], dtype=np.float64)
    sides = np.array([[0, 1], [1, 2], [3, 2], [3, 4], [4, 0]])
    faces = faces_of_plane_graph(points, sides)
    assert faces.shape == (1, 5)
    x, y = points[faces[0]].T
    assert (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() > 0


@given(seed=st.integers(0, 2**32 - 1), jitter=st.floats(0, 1e-4))
def test_a_sheet_is_found_again_from_its_shuffled_lines(seed: int, jitter: float) -> None:
    pattern = regular(5, 4)
    lines = lines_of(pattern)
    random = np.random.default_rng(seed)
    order = random.permutation(len(lines.ends))
    turned = np.where(
        random.random(len(order))[:, None, None] < 0.5, lines.ends, lines.ends[:, ::-1]
    )
    moved = turned + random.uniform(-jitter, jitter, lines.ends.shape)
    shuffled = CreaseLines(moved[order], lines.assignment[order], lines.fold_angle[order])
    found = pattern_from_lines(shuffled)
    assert len(found.vertices_coords) == len(pattern.vertices_coords)
    assert found.faces_vertices.shape == pattern.faces_vertices.shape
    assert len(found.edges_vertices) == len(pattern.edges_vertices)
    for letter in "BMV":
        assert (found.edges_assignment == letter).sum() == (
            pattern.edges_assignment == letter
        ).sum()
    assert found.edges_fold_angle.sum() == pytest.approx(pattern.edges_fold_angle.sum())


def test_a_sheet_is_found_again_from_its_whole_fold_lines() -> None:
    # the straight folds of a Miura drawn in one stroke across all its zig-zags
    pattern = regular(7, 5)
    grid = np.arange(35).reshape(5, 7)
    columns = pattern.vertices_coords[grid[[0, -1]].T]
    zigzags = np.stack([grid[:, :-1], grid[:, 1:]], axis=-1).reshape(-1, 2)
    ends = np.concatenate([columns, pattern.vertices_coords[zigzags]])
    found = pattern_from_lines(CreaseLines(ends, np.full(len(ends), "U"), np.zeros(len(ends))))
    assert len(found.faces_vertices) == len(pattern.faces_vertices)
    assert len(found.vertices_coords) == 35


def test_a_small_drawing_far_from_the_origin_is_read_as_near_it() -> None:
    """The area of its facets had no digit left, and their outside passed for a facet."""
    lines = drawn(*SQUARE, ("M", 0, 0, 2, 2), ("V", 0, 2, 2, 0))
    far = pattern_from_lines(replace(lines, ends=1e-7 * lines.ends + 1e4))
    assert len(far.faces_vertices) == 4
    assert area_of(far) == pytest.approx(4e-14, rel=1e-3)


def test_a_single_sheet_without_creases_stays() -> None:
    found = pattern_from_lines(drawn(*SQUARE))
    assert found.faces_vertices.shape == (1, 4)


def test_what_is_not_in_the_pattern_is_told() -> None:
    stray = drawn(*SQUARE, ("V", 1, 0, 1, 2), ("M", 1, 0, 1, 2), ("V", 5, 5, 6, 6))
    found = pattern_from_lines(stray)
    assert [finding.code for finding in found.told] == ["lost-lines", "lost-lines"]
    doubled, lost = (finding.sentence for finding in found.told)
    assert "first being V and not M at (1, 1)" in doubled
    assert lost == (
        "1 line of the drawing is left out, being no side of a facet, the first V at (5.5, 5.5)."
    )
    again = pattern_from_lines(drawn(*SQUARE, *SQUARE, ("V", 1, 0, 1, 2), ("V", 1, 0, 1, 1.5)))
    assert again.told == ()  # what lies on itself is there


def test_a_part_without_paper_is_told() -> None:
    inner = (("B", 0.5, 0.5, 1, 0.5), ("B", 1, 0.5, 1, 1), ("B", 1, 1, 0.5, 0.5))
    found = pattern_from_lines(drawn(*SQUARE, *inner, ("V", 0, 0, 0.5, 0.5), ("M", 1, 1, 2, 2)))
    assert [finding.code for finding in found.told] == ["holes"]
    assert found.told[0].sentence == (
        "1 part of the drawing, with borders alone around, holds no paper, 3.12 % of its area."
    )


def test_paper_that_passes_for_a_hole_is_told_with_the_way_out() -> None:
    """A square beside a creased one: that it is paper its borders do not tell, a flat line does."""
    other = (("B", 2, 0, 6, 0), ("B", 6, 0, 6, 4), ("B", 6, 4, 2, 4), ("B", 2, 4, 2, 2))
    crease = ("V", 0, 1, 2, 1)
    found = pattern_from_lines(drawn(*SQUARE, *other, crease))
    assert area_of(found) == pytest.approx(4)
    said = [finding.sentence for finding in found.told if finding.code == "holes"]
    assert said == [
        "1 part of the drawing, with borders alone around, holds no paper, 80 % of its area; draw "
        "a flat line (F) in each that is paper."
    ]
    whole = pattern_from_lines(drawn(*SQUARE, *other, crease, ("F", 2, 4, 6, 0)))
    assert area_of(whole) == pytest.approx(20)
    assert "holes" not in [finding.code for finding in whole.told]
    large = (("B", 2, 0, 62, 0), ("B", 62, 0, 62, 60), ("B", 62, 60, 2, 60), ("B", 2, 60, 2, 2))
    found = pattern_from_lines(drawn(*SQUARE, *large, crease))
    (said,) = [finding.sentence for finding in found.told if finding.code == "holes"]
    assert "holds no paper, 99.9 % of its area; draw" in said
