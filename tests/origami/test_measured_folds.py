"""Folds, letters, edges and facets against each other: what is measured, and each sentence."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from piece_problems import gores
from problems import regular
from test_judge_pattern import strip

from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.invariants import EXACT, residuals
from miurafab.origami.judge_creases import (
    MeasuredFolds,
    judge_creases,
    measured_folds,
    unmeasured,
)
from miurafab.origami.unfold import FLAT_ANGLE

HINGE = 3
"""The edge between the two facets of :func:`hinge`."""
RULE = (
    "a valley (V) folds by 0 to 180 degrees, a mountain (M) by 0 to -180, and no other edge folds."
)


def hinge(angle: float, width: float = 2.0) -> CreasePattern:
    """A square of 10 mm and a strip of 10 mm by ``width`` beside it, folded by ``angle``."""
    pattern = strip(np.zeros(3), 1 + width / 10)
    folded = pattern.folded_coords.copy()
    for vertex in (2, 5):
        folded[vertex] = [
            10 + width * math.cos(angle), folded[vertex, 1], width * math.sin(angle)
        ]  # fmt: skip
    return replace(pattern, folded_coords=folded)


def lettered(pattern: CreasePattern, letter: str, angle: float) -> CreasePattern:
    letters, angles = pattern.edges_assignment.copy(), pattern.edges_fold_angle.copy()
    letters[HINGE], angles[HINGE] = letter, angle
    return replace(pattern, edges_assignment=letters, edges_fold_angle=angles)


def said(pattern: CreasePattern, *, form: bool = True) -> list[tuple[str, tuple, str]]:
    folds = measured_folds(pattern, residuals(pattern)) if form else None
    found = judge_creases(pattern, folds)
    return [(each.code, each.where, each.sentence) for each in found]


@pytest.mark.parametrize("angle", [0.5 * math.pi, -0.5 * math.pi, 0.25, math.pi])
def test_a_fold_is_measured_as_exactly_as_its_lower_facet_is_high(angle: float) -> None:
    pattern = hinge(angle)
    folds = measured_folds(pattern, residuals(pattern))
    assert folds.angle[HINGE] == pytest.approx(angle)
    mean = edge_lengths(pattern.folded_coords, pattern.edges_vertices).mean()
    assert folds.within[HINGE] == pytest.approx(FLAT_ANGLE + 64 * EXACT * mean / 2.0)
    assert np.flatnonzero(folds.known).tolist() == [HINGE]
    assert np.flatnonzero(folds.signed).tolist() == ([] if angle == math.pi else [HINGE])
    # As much as either facet is off its plane or its size, the fold is, too.
    found = residuals(pattern)
    for name in ("planarity", "isometry"):
        for off in ([1e-5, 0.0], [0.0, 1e-5]):
            rough = measured_folds(pattern, replace(found, **{name: np.array(off)}))
            within = FLAT_ANGLE + 64 * (EXACT + 1e-5) * mean / 2.0
            assert rough.within[HINGE] == pytest.approx(within, rel=1e-3)


def test_near_half_a_turn_the_sign_is_not_known() -> None:
    within = measured_folds(hinge(3.0), residuals(hinge(3.0))).within[HINGE]
    for less, signed in ((0.5 * within, False), (2 * within, True)):
        pattern = hinge(math.pi - less)
        folds = measured_folds(pattern, residuals(pattern))
        assert bool(folds.signed[HINGE]) is signed
        told = [(each.code, each.where, each.sentence) for each in unmeasured(folds, pattern)]
        sentence = (
            "One edge folds by 180 degrees, where the folded form does not tell mountains from "
            "valleys."
        )
        assert told == ([] if signed else [("not-proven", (HINGE,), sentence)])
    both = strip(np.zeros(4))
    points = both.folded_coords.copy()
    points[[2, 3, 6, 7], 0] = [0.0, 10.0, 0.0, 10.0]  # to and fro
    closed = replace(both, folded_coords=points)
    (told,) = unmeasured(measured_folds(closed, residuals(closed)), closed)
    assert told.where == (3, 5)
    assert told.sentence.startswith("2 edges fold by 180 degrees, where the folded form does not")


def measured(angle: float, within: float) -> MeasuredFolds:
    """The fold of the hinge alone, as if it were measured so."""
    folds = np.full((2, 7), np.nan)
    folds[:, HINGE] = angle, within
    return MeasuredFolds(*folds)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_fold_within_what_is_known_is_none(sign: int) -> None:
    pattern, half = hinge(0.0), 0.5 * sign
    for within, codes in ((0.5, []), (math.nextafter(0.5, 0), ["assignment", "fold-angle"])):
        found = list(judge_creases(pattern, measured(half, within)))
        assert [each.code for each in found] == codes
        told = list(judge_creases(lettered(pattern, "V", half), measured(half, within)))
        assert (told == []) is (sign > 0)  # -0.5 is no valley
    least = math.pi - 0.5
    for angle, signed in ((least, False), (math.nextafter(least, 0), True)):
        folds = measured(sign * angle, 0.5)
        assert bool(folds.signed[HINGE]) is signed
        letter = "V" if sign > 0 else "M"
        sided = lettered(pattern, letter, sign * angle)
        assert list(judge_creases(sided, folds)) == []
        other = lettered(pattern, "M" if sign > 0 else "V", -sign * angle)
        codes = [each.code for each in judge_creases(other, folds)]
        assert codes == (["assignment", "fold-angle"] if signed else ["fold-angle"])
    assert np.flatnonzero(folds.known).tolist() == [HINGE]
    assert not measured(1.0, math.inf).known.any()
    assert not measured(math.nan, 1.0).known.any()


def test_where_a_facet_has_no_area_no_fold_is_measured() -> None:
    pattern = hinge(0.5)
    folded = pattern.folded_coords.copy()
    folded[[2, 5]] = folded[[1, 4]]
    flat = replace(pattern, folded_coords=folded)
    (told,) = unmeasured(measured_folds(flat, residuals(flat)), flat)
    assert (told.code, told.where) == ("not-proven", (HINGE,))
    assert told.sentence == "Of one edge no fold angle is measured: a facet beside has no area."
    assert [each[0] for each in said(lettered(flat, "V", 0.5))] == []


RIGHT = 0.5 * math.pi


def contradicts(letter: str, degrees: int) -> tuple[str, str]:
    return "assignment", f"Edge 3 is {letter} and its fold angle is {degrees} degrees: {RULE}"


@pytest.mark.parametrize(
    ("folded", "letter", "angle", "told"),
    [
        (RIGHT, "V", RIGHT, []),
        (-RIGHT, "M", -RIGHT, []),
        (0.0, "F", 0.0, []),
        (0.0, "V", 0.0, []),
        (RIGHT, "F", RIGHT, [contradicts("F", 90)]),
        (RIGHT, "U", RIGHT, [contradicts("U", 90)]),
        (-RIGHT, "V", -RIGHT, [contradicts("V", -90)]),
        (
            RIGHT,
            "V",
            1.5 * math.pi,
            [
                contradicts("V", 270),
                (
                    "fold-angle",
                    "Edge 3 folds by 90 degrees in the folded form, and its fold angle is given as "
                    "270 degrees.",
                ),
            ],
        ),
        (-RIGHT, "V", 1.5 * math.pi, [contradicts("V", 270)]),
        (
            RIGHT,
            "M",
            -RIGHT,
            [
                ("assignment", "Edge 3 folds by 90 degrees in the folded form, and is M, not V."),
                (
                    "fold-angle",
                    "Edge 3 folds by 90 degrees in the folded form, and its fold angle is given as "
                    "-90 degrees.",
                ),
            ],
        ),
        (
            -RIGHT,
            "V",
            RIGHT,
            [
                ("assignment", "Edge 3 folds by -90 degrees in the folded form, and is V, not M."),
                (
                    "fold-angle",
                    "Edge 3 folds by -90 degrees in the folded form, and its fold angle is given "
                    "as 90 degrees.",
                ),
            ],
        ),
        (
            RIGHT,
            "F",
            -0.0,
            [
                ("assignment", "Edge 3 folds by 90 degrees in the folded form, and is F, not V."),
                (
                    "fold-angle",
                    "Edge 3 folds by 90 degrees in the folded form, and its fold angle is given as "
                    "0 degrees.",
                ),
            ],
        ),
        (math.pi, "V", math.pi, []),
        (math.pi, "M", -math.pi, []),
        (
            math.pi,
            "F",
            0.0,
            [
                (
                    "assignment",
                    "Edge 3 folds by 180 degrees in the folded form, and is F, not M or V.",
                ),
                (
                    "fold-angle",
                    "Edge 3 folds by 180 degrees in the folded form, and its fold angle is given "
                    "as 0 degrees.",
                ),
            ],
        ),
    ],
)  # fmt: skip
def test_letter_and_angle_are_judged_by_the_folded_form(
    folded: float, letter: str, angle: float, told: list[tuple[str, str]]
) -> None:
    found = said(lettered(hinge(folded), letter, angle))
    assert found == [(code, (HINGE,), sentence) for code, sentence in told]


def test_no_edge_folds_by_more_than_half_a_turn() -> None:
    most = math.pi + FLAT_ANGLE
    for angle, right in ((most, True), (math.nextafter(most, 4.0), False)):
        for letter, sign in (("V", 1), ("M", -1)):
            told = said(lettered(hinge(0.0), letter, sign * angle), form=False)
            assert (told == []) is right


def test_a_border_that_folds_or_lies_within_the_sheet_is_told() -> None:
    pattern = hinge(0.0)
    angles = pattern.edges_fold_angle.copy()
    angles[0] = 0.5
    assert said(replace(pattern, edges_fold_angle=angles)) == [
        ("assignment", (0,), f"Edge 0 is B and its fold angle is 28.6479 degrees: {RULE}")
    ]
    letters = pattern.edges_assignment.copy()
    letters[HINGE] = "B"
    assert said(replace(pattern, edges_assignment=letters)) == [
        (
            "assignment",
            (HINGE,),
            "Edge 3 is a border (B) and lies between facets 0 and 1; a cut within the sheet is C.",
        )
    ]
    letters = pattern.edges_assignment.copy()
    letters[[0, 1, 2]] = "F"
    alone = "a side of one facet alone: it is a border (B), or the facet beyond it is missing."
    assert said(replace(pattern, edges_assignment=letters)) == [
        (
            "assignment",
            (0, 1, 2),
            f"Edge 0 is F and {alone} The same kind of fault is at 2 more edges (1, 2).",
        )
    ]
    unlettered = replace(pattern, edges_assignment=np.full(len(letters), "U"))
    assert said(unlettered) == []


@pytest.mark.parametrize(
    ("count", "more"),
    [
        (1, ""),
        (2, " The same kind of fault is at 1 more edge (1)."),
        (5, " The same kind of fault is at 4 more edges (1, 2, 4, 6)."),
        (6, " The same kind of fault is at 5 more edges (1, 2, 4, 6, ...)."),
    ],
)
def test_faults_of_one_kind_are_one_finding(count: int, more: str) -> None:
    pattern = strip(np.zeros(4))
    edges = np.flatnonzero(pattern.edges_assignment == "B")[:count]
    letters = pattern.edges_assignment.copy()
    letters[edges] = "J"
    ((code, where, sentence),) = said(replace(pattern, edges_assignment=letters), form=False)
    assert (code, where) == ("assignment", tuple(edges.tolist()))
    assert sentence.partition("is missing.")[2] == more


def test_folds_that_are_all_0_contradict_no_letter_without_a_folded_form() -> None:
    """A file of the flat state may give no sizes at all; where it gives some, 0 is one, too."""
    pattern = replace(regular(4, 4), folded_coords=None)
    still = replace(pattern, edges_fold_angle=np.zeros(len(pattern.edges_vertices)))
    assert said(still, form=False) == []
    mountain = int(np.flatnonzero(pattern.edges_assignment == "M")[0])
    still.edges_fold_angle[mountain] = -FLAT_ANGLE  # as good as none, and tells no size either
    assert [each[:2] for each in said(still, form=False)] == [("assignment", (mountain,))]
    angles = pattern.edges_fold_angle.copy()
    crease = int(np.flatnonzero(pattern.edges_assignment == "V")[0])
    angles[crease] = 0.0
    ((code, where, sentence),) = said(replace(pattern, edges_fold_angle=angles), form=False)
    assert (code, where) == ("assignment", (crease,))
    assert sentence == f"Edge {crease} is V and its fold angle is 0 degrees: {RULE}"
    angles[crease] = 2.0 * FLAT_ANGLE
    assert said(replace(pattern, edges_fold_angle=angles), form=False) == []
    for part in (0.5, 1.0):  # as good as none
        angles[crease] = part * FLAT_ANGLE
        told = said(replace(pattern, edges_fold_angle=angles), form=False)
        assert [each[:2] for each in told] == [("assignment", (crease,))]


def test_an_edge_that_is_there_twice_is_told_once_with_its_letters() -> None:
    pattern = replace(hinge(0.0), folded_coords=None)
    edges = np.append(pattern.edges_vertices, pattern.edges_vertices[[HINGE]][:, ::-1], axis=0)
    twice = replace(
        pattern,
        edges_vertices=edges,
        edges_assignment=np.append(pattern.edges_assignment, "V"),
        edges_fold_angle=np.append(pattern.edges_fold_angle, 0.0),
    )
    found = {code: (where, sentence) for code, where, sentence in said(twice, form=False)}
    last = len(edges) - 1
    assert found == {
        "double-edge": (
            (last,),
            f"Edges {HINGE} (F) and {last} (V) join the same two vertices; an edge is there once.",
        )
    }


def test_edges_and_facets_of_one_fault_are_counted_as_such() -> None:
    pattern = replace(hinge(0.0), folded_coords=None)
    count = len(pattern.edges_vertices)
    for more, code in (
        (pattern.edges_vertices[[0, HINGE]], "double-edge"),
        ([[0, 2], [0, 5]], "facets"),
    ):
        two = replace(
            pattern,
            edges_vertices=np.append(pattern.edges_vertices, more, axis=0),
            edges_assignment=np.append(pattern.edges_assignment, ["M", "M"]),
            edges_fold_angle=np.append(pattern.edges_fold_angle, [0.0, 0.0]),
        )
        ((where, sentence),) = [each[1:] for each in said(two, form=False) if each[0] == code]
        assert where == (count, count + 1)
        assert sentence.endswith(f" The same kind of fault is at 1 more edge ({count + 1}).")
    over = replace(pattern, vertices_coords=pattern.vertices_coords * [-1.0, 1.0])
    ((code, where, sentence),) = said(over, form=False)
    assert (code, where) == ("turned-over", (0, 1))
    assert sentence.endswith(" The same kind of fault is at 1 more facet (1).")


def test_an_edge_of_no_facet_is_told_unless_it_is_flat() -> None:
    pattern = replace(hinge(0.0), folded_coords=None)
    edges = np.append(pattern.edges_vertices, [[0, 2]], axis=0)

    def with_one(letter: str, angle: float = 0.0) -> list[tuple[str, tuple, str]]:
        more = replace(
            pattern,
            edges_vertices=edges,
            edges_assignment=np.append(pattern.edges_assignment, letter),
            edges_fold_angle=np.append(pattern.edges_fold_angle, angle),
        )
        return said(more, form=False)

    last = len(edges) - 1
    for letter in "MB":
        sentence = (
            f"Edge {last} ({letter}) is a side of no facet: a facet is missing, or the edge is one "
            "too many."
        )
        assert with_one(letter) == [("facets", (last,), sentence)]
    assert with_one("F") == []
    assert with_one("F", 0.5) == []  # it is a side of nothing that folds


def test_facets_that_are_not_those_of_the_grid_are_named() -> None:
    pattern = replace(regular(4, 3), folded_coords=None)
    swapped = replace(pattern, grid=(3, 4))
    (found,) = [each for each in said(swapped, form=False) if each[0] == "facets"]
    assert found[2] == (
        "Facet 0 is no cell of the grid of 3 x 4 vertices. The same kind of fault is at 5 more "
        "facets (1, 2, 3, 4, ...)."
    )
    assert found[1] == (0, 1, 2, 3, 4, 5)
    fewer = replace(pattern, faces_vertices=pattern.faces_vertices[:-1])
    assert [each[1:] for each in said(fewer, form=False) if "for which" in each[2]] == [
        ((5,), "The grid of 4 x 3 vertices has a cell 5 for which there is no facet.")
    ]
    fewer = replace(pattern, faces_vertices=pattern.faces_vertices[1:-1])
    told = [each for each in said(fewer, form=False) if "for which" in each[2]]
    assert told[0][1] == (0, 5)
    assert told[0][2].endswith(" The same kind of fault is at 1 more cell (5).")


def test_a_facet_that_is_turned_over_is_named() -> None:
    pattern = replace(hinge(0.0), folded_coords=None)
    flat = pattern.vertices_coords.copy()
    flat[[2, 5], 0] = 5.0  # back over the square
    assert said(replace(pattern, vertices_coords=flat), form=False) == [
        (
            "turned-over",
            (1,),
            "Facet 1 lies turned over in the flat pattern: its corners run clockwise while those "
            "of its neighbours do not.",
        )
    ]


def test_neighbours_whose_cells_lie_apart_are_named() -> None:
    pattern = replace(strip(np.zeros(5), 4.0), folded_coords=None)
    column = np.column_stack([np.arange(4), np.zeros(4, dtype=np.int64)])
    inner = np.flatnonzero(pattern.edges_assignment == "F")
    assert said(replace(pattern, cells=column), form=False) == []
    assert said(replace(pattern, cells=column[:, ::-1]), form=False) == []
    assert said(replace(pattern, cells=column + 7), form=False) == []
    # The first and last of a ring are neighbours: here the columns run 2 3 0 1.
    assert said(replace(pattern, cells=np.roll(column, 2, axis=0)), form=False) == []
    apart = column.copy()
    apart[:2, 0] -= 1
    ((code, where, sentence),) = said(replace(pattern, cells=apart), form=False)
    assert (code, where) == ("facets", (int(inner[1]),))
    assert sentence == (
        f"Edge {inner[1]} lies between facets 1 and 2, whose cells are not beside each other in "
        "the lattice."
    )
    diagonal = column.copy()
    diagonal[1, 1] = diagonal[3, 1] = 2
    diagonal[2, 1] = 4
    ((_, where, sentence),) = said(replace(pattern, cells=diagonal), form=False)
    assert where == tuple(inner.tolist())
    more = f"2 more edges ({inner[1]}, {inner[2]})"
    assert sentence.endswith(f" The same kind of fault is at {more}.")


def test_two_rings_close_each_on_itself() -> None:
    """Columns run 2 3 0 1 in the one, and 102 103 100 101 in the other."""
    one = replace(strip(np.zeros(5), 4.0), folded_coords=None)
    count = len(one.vertices_coords)
    column = np.column_stack([np.roll(np.arange(4), 2), np.zeros(4, dtype=np.int64)])
    both = replace(
        one,
        vertices_coords=np.append(one.vertices_coords, one.vertices_coords + 100, axis=0),
        edges_vertices=np.append(one.edges_vertices, one.edges_vertices + count, axis=0),
        edges_assignment=np.tile(one.edges_assignment, 2),
        edges_fold_angle=np.tile(one.edges_fold_angle, 2),
        faces_vertices=np.append(one.faces_vertices, one.faces_vertices + count, axis=0),
        cells=np.append(column, column + 100, axis=0),
        pieces=np.repeat([0, 1], 4),
    )
    assert said(both, form=False) == []
    assert [each[0] for each in said(replace(both, pieces=None), form=False)] == ["facets"]


def test_each_piece_closes_on_itself() -> None:
    pattern = gores()
    folds = measured_folds(pattern, residuals(pattern))
    assert list(judge_creases(pattern, folds)) == []
    assert pattern.cells is not None
    cells = pattern.cells.copy()
    cells[pattern.pieces == 1] += 100
    assert list(judge_creases(replace(pattern, cells=cells), folds)) == []
