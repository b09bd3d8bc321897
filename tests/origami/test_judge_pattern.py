"""What the audit says of a pattern: each sentence, what it measured, and what is proved."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from piece_problems import two_pieces
from problems import regular
from test_contact import fan, rolled
from test_crease_pattern import two_squares as unit_squares

from miurafab.findings import Finding, counted, refusals
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.invariants import EXACT
from miurafab.origami.judge_pattern import (
    _lie_together,
    _these,
    gather,
    judge,
    judge_quality,
    proved,
    unlisted_seams,
)
from miurafab.origami.quality import Quality
from miurafab.origami.verify import Audit, Measurements, audit, measure

WITHOUT_FORM = (
    "Without a folded form it is not known whether the facets stay flat and keep clear of each "
    "other."
)


def said(pattern: CreasePattern) -> list[str]:
    return [f"{each.code}: {each.sentence}" for each in audit(pattern).findings]


def shifted(points: np.ndarray, vertices: object, *by: float) -> np.ndarray:
    points = points.copy()
    points[vertices] += by
    return points


def two_squares(height: float = 0.0, turn: float = 0.0) -> CreasePattern:
    """Two squares of 10 mm, one ``height`` over the other in the folded form; a ``turn`` about the
    middle of the second makes them cross.
    """
    square = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
    ring = np.array([[0, 1], [1, 2], [2, 3], [3, 0]])
    low = np.pad(square, ((0, 0), (0, 1)))
    away = square[:, 0] - 5
    high = np.column_stack(
        [5 + away * math.cos(turn), square[:, 1], height + away * math.sin(turn)]
    )
    return CreasePattern(
        np.concatenate([square, square + np.array([20.0, 0.0])]),
        np.concatenate([ring, ring + 4]),
        np.full(8, "B"),
        np.zeros(8),
        np.array([[0, 1, 2, 3], [4, 5, 6, 7]]),
        np.concatenate([low, high]),
        pieces=np.array([0, 1]),
    )


def strip(height: np.ndarray, last: float = 3.0) -> CreasePattern:
    """Squares of 10 mm side by side, flat; those of the lower row at ``height``."""
    count = len(height)
    x = np.append(np.arange(count - 1.0), last)
    points = 10 * np.concatenate([np.column_stack([x, height]), np.column_stack([x, 1 + 0 * x])])
    n = np.arange(count - 1)
    faces = np.column_stack([n, n + 1, n + 1 + count, n + count])
    sides = np.sort(np.concatenate([faces[:, [k, (k + 1) % 4]] for k in range(4)]), axis=1)
    edges, uses = np.unique(sides, axis=0, return_counts=True)
    return CreasePattern(
        points,
        edges,
        np.where(uses == 2, "F", "B"),
        np.zeros(len(edges)),
        faces,
        np.pad(points, ((0, 0), (0, 1))),
    )


def test_one_thing_or_several_are_counted() -> None:
    assert [counted(n, "pair is", "pairs are") for n in (0, 1, 2)] == [
        "0 pairs are",
        "1 pair is",
        "2 pairs are",
    ]


@pytest.mark.parametrize(
    ("count", "noun", "says"),
    [
        (1, "edge", "Edge 0 is"),
        (2, "vertex", "2 vertices (0, 1) are"),
        (5, "facet", "5 facets (0, 1, 2, 3, 4) are"),
        (6, "seam", "6 seams (0, 1, 2, 3, 4, ...) are"),
    ],
)
def test_five_of_a_kind_are_named(count: int, noun: str, says: str) -> None:
    assert _these(np.arange(count), noun) == says


def test_a_whole_sheet_is_proved_sentence_by_sentence() -> None:
    facets = [
        "The 48 facets fit the 110 edges and the lattice.",
        "The letters of 110 edges agree with their facets and fold angles.",
        "No facets overlap in the flat pattern.",
    ]
    folds = "82 fold angles, 82 of them with their sign, are those of the folded form."
    same = "The 48 facets are flat, and the same in both forms."
    apart = "No facets meet in the folded form."
    whole = audit(regular())
    assert whole.proved == (*facets, folds, same, apart)
    assert whole.findings == ()
    loose = replace(regular(), grid=None)
    assert audit(loose).proved[0] == "The 48 facets fit the 110 edges."
    columns, rows = np.meshgrid(np.arange(8), np.arange(6))
    celled = replace(loose, cells=np.column_stack([columns.ravel(), rows.ravel()]))
    assert audit(celled).proved[0] == facets[0]
    square = CreasePattern(
        np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]),
        np.array([[0, 1], [1, 2], [2, 3], [0, 3]]),
        np.array(["B"] * 4),
        np.zeros(4),
        np.array([[0, 1, 2, 3]]),
    )
    assert audit(square).proved[0] == "The 1 facet fits the 4 edges."
    flat = audit(replace(regular(), folded_coords=None))
    assert flat.proved == tuple(facets)
    assert flat.findings == (Finding("not-proven", WITHOUT_FORM),)
    assert audit(two_pieces()).proved[-1] == "The two edges of each of 8 seams fit."


FALLS = {
    **dict.fromkeys(("double-edge", "facets", "turned-over", "bow-tie", "degenerate-edge"), (0,)),
    "assignment": (1, 3),
    "overlap": (2,),
    "fold-angle": (3,),
    **dict.fromkeys(("planarity", "isometry", "developability"), (4,)),
    "seam": (6,),
    "dented": (),
    "not-proven": (),
}


@pytest.mark.parametrize("code", FALLS)
def test_what_is_broken_is_not_proved(code: str) -> None:
    pattern = two_pieces()
    evidence = gather(pattern)
    whole = proved(pattern, evidence, [])
    assert len(whole) == 7
    left = proved(pattern, evidence, [Finding(code, ".")])
    assert left == tuple(claim for n, claim in enumerate(whole) if n not in FALLS[code])


@pytest.mark.parametrize(
    "pattern", [rolled(math.radians(58), 8), two_squares()], ids=["through", "on each other"]
)
def test_facets_that_meet_are_not_proved_to_lie_apart(pattern: CreasePattern) -> None:
    assert "The letters" in "".join(audit(pattern).proved)
    assert not any("No facets meet" in claim for claim in audit(pattern).proved)


def test_without_a_folded_form_nothing_is_known_to_cross() -> None:
    evidence = gather(replace(two_squares(), folded_coords=None))
    assert (evidence.residuals, evidence.folds) == (None, None)
    assert (evidence.crossings.shape, evidence.crossings.dtype) == ((0, 2), np.int64)


def test_forms_of_few_digits_are_the_same_within_what_is_left() -> None:
    moved = shifted(regular().vertices_coords, 31, 1e-6, 0.0)
    rounded = replace(regular(), vertices_coords=moved, rounded=1e-6)
    left = audit(rounded).measurements.max_isometry
    assert 1e-8 < left < 1e-6
    assert (
        f"The 48 facets are flat, and the same in both forms within {left:.2g} mean edges or "
        in ("".join(audit(rounded).proved))
    )


def test_what_is_exact_says_nothing_of_what_is_left() -> None:
    evidence = gather(regular())
    for residual, says in ((EXACT, "."), (2 * EXACT, " within 2e-10 mean edges or radians.")):
        off = np.append(evidence.residuals.planarity[1:], residual)
        rough = replace(evidence, residuals=replace(evidence.residuals, planarity=off))
        claim = proved(regular(), rough, [])[4]
        assert claim == f"The 48 facets are flat, and the same in both forms{says}"


def test_what_does_not_hold_says_how_much_and_where() -> None:
    pattern = regular()
    mean = float(edge_lengths(pattern.vertices_coords, pattern.edges_vertices).mean())
    broken = replace(pattern, vertices_coords=shifted(pattern.vertices_coords, 31, 1e-6, 0.0))
    worst = audit(broken).measurements.max_isometry
    assert said(broken) == [
        "isometry: 4 facets (19, 20, 27, 28) are not the same flat and folded: up to "
        f"{worst:.1e}, over 1e-10."
    ]
    lifted = replace(pattern, folded_coords=shifted(pattern.folded_coords, 31, 0.0, 0.0, 1e-5))
    found = audit(lifted).measurements
    assert said(lifted) == [  # the worst first
        "developability: 5 vertices (22, 30, 31, 32, 40) are not developable: up to "
        f"{found.max_developability:.1e}, over 1e-10.",
        "planarity: 4 facets (19, 20, 27, 28) are not planar: up to "
        f"{found.max_planarity:.1e}, over 1e-10.",
        "isometry: 4 facets (19, 20, 27, 28) are not the same flat and folded: up to "
        f"{found.max_isometry:.1e}, over 1e-10.",
    ]
    assert (
        "48 facets (0, 1, 2, 3, 4, ...) are not the same"
        in said(replace(pattern, folded_coords=1.001 * pattern.folded_coords))[0]
    )
    corner = replace(pattern, folded_coords=shifted(pattern.folded_coords, 0, 0.0, 0.0, 1e-5))
    assert any(each.startswith("planarity: Facet 0 is not planar: up to") for each in said(corner))
    flat, folded = pattern.vertices_coords.copy(), pattern.folded_coords.copy()
    flat[1], folded[1] = flat[0] + [2e-6, 0.0], folded[0] + [2e-6, 0.0, 0.0]
    short = replace(pattern, vertices_coords=flat, folded_coords=folded)
    (edge,) = np.flatnonzero((pattern.edges_vertices == [0, 1]).all(axis=1))
    (told,) = [each for each in audit(short).findings if each.code == "degenerate-edge"]
    assert told.where == (edge,)
    assert told.sentence.startswith(
        f"Edge {edge} is shorter than a millionth of the mean edge (down to 2.0e-06 mm): they"
    )
    assert mean > 10
    flat[1], folded[1] = flat[0] + [2e-5, 0.0], folded[0] + [2e-5, 0.0, 0.0]
    longer = replace(pattern, vertices_coords=flat, folded_coords=folded)
    assert not any("degenerate" in each for each in said(longer))


def test_an_edge_is_degenerate_below_a_millionth_of_the_mean() -> None:
    flat = np.array([[0, 0], [1, 0], [10, 10], [0, 10.0]])
    pattern = replace(two_squares(), folded_coords=None, pieces=None)
    for _ in range(5):  # the mean has hardly any of the edge
        flat[1, 0] = 1e-6 * edge_lengths(flat, pattern.edges_vertices[:4]).mean()
    ring = replace(
        pattern,
        vertices_coords=flat,
        edges_vertices=pattern.edges_vertices[:4],
        edges_assignment=np.full(4, "B"),
        edges_fold_angle=np.zeros(4),
        faces_vertices=pattern.faces_vertices[:1],
    )
    shorter = flat.copy()
    shorter[1, 0] = math.nextafter(flat[1, 0], 0.0)
    assert not any("degenerate" in each for each in said(ring))
    told = said(replace(ring, vertices_coords=shorter))
    assert sum("degenerate-edge: Edge 0 is" in each for each in told) == 1


def test_residuals_count_from_what_is_exact_on_and_the_worst_comes_first() -> None:
    pattern = regular()
    evidence = gather(pattern)
    found = evidence.residuals
    assert found is not None

    def codes(**worst: float) -> list[str]:
        changed = {name: np.zeros_like(getattr(found, name)) for name in worst}
        for name, value in worst.items():
            changed[name][-1] = value
        rough = replace(evidence, residuals=replace(found, **changed))
        return [each.code for each in judge(pattern, rough)]

    exact, over = found.exact, math.nextafter(found.exact, 1.0)
    assert codes(planarity=exact, developability=exact, isometry=exact) == []
    for name in ("planarity", "developability", "isometry"):
        assert codes(**{name: over}) == [name]
    assert codes(planarity=3e-7, developability=1e-7, isometry=2e-7) == [
        "planarity",
        "isometry",
        "developability",
    ]
    assert codes(planarity=1e-7, developability=2e-7, isometry=3e-7) == [
        "isometry",
        "developability",
        "planarity",
    ]


def test_a_seam_that_gapes_says_how_far() -> None:
    pattern = two_pieces()
    second = np.unique(pattern.faces_vertices[pattern.pieces == 1])
    mean = float(edge_lengths(pattern.vertices_coords, pattern.edges_vertices).mean())
    apart = replace(pattern, folded_coords=shifted(pattern.folded_coords, second, 0.0, 0.0, 1e-6))
    assert said(apart) == [
        "seam: 8 seams (0, 1, 2, 3, 4, ...) are not closed: the two edges differ by up to "
        f"{1e-6 / mean:.1e} mean edges in length or in place."
    ]


def test_a_seam_is_closed_up_to_what_counts_as_exact() -> None:
    """Edges of 1 mm, of which one end gapes by 0.25 mm."""
    pattern = unit_squares()
    apart = pattern.folded_coords.copy()
    apart[4, 2] = 0.25
    for rounded, closed in ((0.25, True), (0.2499, False)):
        gaping = replace(pattern, folded_coords=apart, rounded=rounded)
        assert ("seam" not in {each.code for each in audit(gaping).findings}) is closed


def test_seams_that_are_not_named_are_found() -> None:
    pattern = two_pieces()
    lost = pattern.seams[2]
    one = replace(pattern, seams=np.delete(pattern.seams, 2, axis=0))
    assert unlisted_seams(one).tolist() == [lost.tolist()]
    assert said(one) == [
        "seam: 1 pair of border edges meets in the folded form outside the 7 seams, the first "
        f"being edges {lost[0]} and {lost[1]}; name them in `miurafab:seams`, or leave that out, "
        "and all are found."
    ]
    none = replace(pattern, seams=pattern.seams[:0])
    pairs = unlisted_seams(none)
    assert {frozenset(pair) for pair in pairs.tolist()} == {
        frozenset(pair) for pair in pattern.seams.tolist()
    }
    (told,) = audit(none).findings
    assert told.sentence.startswith(
        "8 pairs of border edges meet in the folded form outside the 0 seams, the first being "
        f"edges {pairs[0, 0]} and {pairs[0, 1]};"
    )
    assert told.where == tuple(sorted(pattern.seams.ravel().tolist()))
    nothing = unlisted_seams(replace(pattern, seams=None))
    assert (nothing.shape, nothing.dtype) == ((0, 2), np.int64)
    assert said(replace(pattern, seams=None)) == []


def test_a_target_that_is_not_known_is_told() -> None:
    (told,) = audit(replace(regular(), target_kept=None)).findings
    assert (told.code, told.sentence[:43]) == (
        "not-proven",
        "The file has no `miurafab:target_sha256`, s",
    )
    (told,) = audit(replace(regular(), target_kept=False)).findings
    assert (told.code, told.severity) == ("scale", "refusal")


def test_facets_that_meet_are_named_in_pairs() -> None:
    assert said(two_squares(height=1e-4)) == []
    level = (
        "not-proven: 1 pair of facets lies on each other in the folded form, the first being "
        "facets 0 and 1; the order of such layers is not judged."
    )
    assert said(two_squares()) == [level]
    assert said(two_squares(turn=9e-7)) == [level]
    assert said(two_squares(turn=2e-6)) == [
        "self-intersection: 1 pair of facets passes through or lies on each other in the folded "
        "form, the first being facets 0 and 1."
    ]
    # A lattice has no layers that lie on each other: the shell would go through itself.
    cells = np.array([[0, 0], [1, 0]])
    assert [
        each.code for each in refusals(audit(replace(two_squares(), cells=cells)).findings)
    ] == ["self-intersection"]
    found = refusals(audit(replace(two_squares(), grid=(4, 2))).findings)
    assert [each.code for each in found] == ["facets", "self-intersection"]
    (told,) = audit(rolled(math.radians(58), 8)).findings
    assert told.sentence == (
        "3 pairs of facets pass through or lie on each other in the folded form, the first being "
        "facets 0 and 6."
    )
    (told,) = audit(rolled(math.radians(60), 8)).findings
    assert told.sentence.startswith("2 pairs of facets lie on each other in the folded form, the ")


@pytest.mark.parametrize(
    ("height", "turn", "worst", "together"),
    [
        (9e-6, 0.0, 0.0, True),  # in edges of 10 mm
        (1.1e-5, 0.0, 0.0, False),
        (0.0, 9e-7, 0.0, True),
        (0.0, 1.1e-6, 0.0, False),
        (6.4e-4, 0.0, 1e-6, True),
        (6.6e-4, 0.0, 1e-6, False),
        (0.0, 6.4e-5, 1e-6, True),
        (0.0, 6.6e-5, 1e-6, False),
    ],
)
def test_facets_lie_together_within_what_their_forms_are_exact(
    height: float, turn: float, worst: float, together: bool
) -> None:
    """Beside a pair of squares that cross, and one of squares that lie a whole edge apart."""
    parts = [two_squares(height, turn), two_squares(turn=1.0), two_squares(height=10.0)]
    faces = np.concatenate([part.faces_vertices + 8 * n for n, part in enumerate(parts)])
    edges = np.concatenate([part.edges_vertices + 8 * n for n, part in enumerate(parts)])
    whole = CreasePattern(
        np.concatenate([part.vertices_coords for part in parts]),
        edges,
        np.full(24, "B"),
        np.zeros(24),
        faces,
        np.concatenate([part.folded_coords for part in parts]),
    )
    pairs = np.arange(6).reshape(3, 2)
    assert _lie_together(whole, pairs, worst).tolist() == [together, False, False]


def test_facets_that_overlap_when_flat_are_told_from_pieces_that_do() -> None:
    (told,) = [
        each for each in audit(fan(math.tau * 14 / 12, 14)).findings if each.code == "overlap"
    ]
    assert told.sentence == (
        "2 pairs of facets overlap in the flat pattern, the first being facets 0 and 12: it cannot "
        "be cut from one piece."
    )
    assert told.where == (0, 1, 12, 13)
    squares = two_squares(height=5.0)
    flat = np.tile(squares.vertices_coords[:4], (2, 1))
    (told,) = audit(replace(squares, vertices_coords=flat)).findings
    assert told.sentence == (
        "Pieces lie on each other in the flat pattern (1 pair of facets, the first being 0 and 1): "
        "they have to lie apart."
    )
    (told,) = audit(replace(squares, vertices_coords=flat, pieces=None)).findings
    assert told.sentence.startswith("1 pair of facets overlaps in the flat pattern, the first ")
    # Of both kinds at once, those within a piece are told.
    three = CreasePattern(
        np.tile(flat[:4], (3, 1)),
        np.concatenate([squares.edges_vertices, squares.edges_vertices[:4] + 8]),
        np.full(12, "B"),
        np.zeros(12),
        np.arange(12).reshape(3, 4),
        pieces=np.array([0, 1, 1]),
    )
    (told,) = refusals(audit(three).findings)
    assert told.sentence.startswith(
        "1 pair of facets overlaps in the flat pattern, the first being facets 1 and 2: it cannot"
    )
    assert told.where == (0, 1, 2)


def test_shapes_that_no_paper_has_are_told() -> None:
    bow = strip(np.array([0.0, 0.0, 0.0, 0.0]))
    flat = bow.vertices_coords.copy()
    flat[[2, 6]] = flat[[6, 2]]  # the second and third square are crossed
    crossed = replace(bow, vertices_coords=flat, folded_coords=np.pad(flat, ((0, 0), (0, 1))))
    (told,) = [each for each in audit(crossed).findings if each.code == "bow-tie"]
    assert told.where == (1, 2)
    assert told.sentence == (
        "2 facets (1, 2) are folded over, two sides crossing as in a bow-tie: no piece of paper "
        "has that shape."
    )
    pattern = regular()
    flat, folded = pattern.vertices_coords.copy(), pattern.folded_coords.copy()
    for points in (flat, folded):  # the corner goes over the diagonal of its facet
        points[0] = points[0] + 0.7 * (points[10] - points[0])
    assert said(replace(pattern, vertices_coords=flat, folded_coords=folded)) == [
        "dented: Facet 0 is not convex, which folds badly."
    ]


def test_a_facet_on_both_sides_of_an_edge_is_told() -> None:
    """`sheets` refused it and sent to `check`, which called it sound."""
    outer, inner = (
        np.array([[0.0, 0], [3, 0], [3, 3], [0, 3]]),
        np.array([[1.0, 1], [2, 1], [2, 2]]),
    )
    ring = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 4], [0, 4]])
    pattern = CreasePattern(
        np.concatenate([outer, inner]),
        ring,
        np.array([*"BBBBBBBF"]),
        np.zeros(8),
        np.array([[0, 1, 2, 3, 0, 4, 6, 5, 4]]),
    )
    assert said(pattern)[0] == (
        "both-sides: Facet 0 lies on both sides of edge 7, which ends inside it or leads to a "
        "window there: it is no polygon, and cannot be laid out on sheets. Join what is there to "
        "another side of the facet by a flat edge (F), or leave the edge out."
    )
    both = CreasePattern(
        np.concatenate([outer, inner, [[2.5, 2.5]]]),
        np.concatenate([ring, [[2, 7]]]),
        np.array([*"BBBBBBBFF"]),
        np.zeros(9),
        np.array([[0, 1, 2, 7, 2, 3, 0, 4, 6, 5, 4]]),
    )
    assert said(both)[0].endswith(" The same kind of fault is at 1 more edge (8).")


def test_a_facet_that_touches_itself_is_told() -> None:
    """`sheets` refused it and sent to `check`, which called it sound."""
    points = np.array([[0.0, 0], [3, 0], [3, 3], [0, 3], [2, 1], [1, 2], [6, 0], [4, 0]])
    ring = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [0, 4], [4, 5], [5, 0]])
    window = CreasePattern(
        points[:6], ring, np.full(7, "B"), np.zeros(7), np.array([[0, 1, 2, 3, 0, 5, 4]])
    )
    assert said(window)[0] == (
        "touches-itself: Facet 0 touches itself at vertex 0: it is no polygon, and cannot be laid "
        "out on sheets. Join what hangs there to another side of the facet by a flat edge (F), or "
        "leave `faces_vertices` out of a file without a folded form."
    )
    flat = CreasePattern(
        points[[0, 1, 2, 6, 7]],
        np.array([[0, 1], [1, 2], [2, 0], [1, 3], [3, 4], [4, 1]]),
        np.full(6, "B"),
        np.zeros(6),
        np.array([[0, 1, 2], [1, 3, 4]]),
    )
    assert said(flat)[0].startswith(
        "touches-itself: Facet 1 touches itself, or has no area: it is no polygon,"
    )
    bow = replace(window, vertices_coords=points[:6] + np.array([[0, 0]] * 4 + [[2, 0], [0, 0]]))
    assert [line.split(":")[0] for line in said(bow)][:1] == ["bow-tie"]


def measured(**values: object) -> Measurements:
    return Measurements(facets=1, vertices=4, min_edge_mm=1.0, overlaps=0, **values)


def folding_by(degrees: float) -> Quality:
    return Quality((0.1, 0.2, math.radians(degrees)), (1.0, 2.0), (1.0, 1.0), 1.0)


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({}, ""),
        ({"quality": folding_by(165.0)}, ""),
        (
            {"quality": folding_by(165.001)},
            "steep-folds: Creases fold by up to 165 degrees, and facets nearly lie on each other "
            "there.",
        ),
        (
            {"quality": folding_by(170.0)},
            "steep-folds: Creases fold by up to 170 degrees, and facets nearly lie on each other "
            "there.",
        ),
        ({"area_ratio": 4.0}, ""),
        (
            {"area_ratio": 4.01},
            "much-paper: The sheet takes 4.0 times the area of the target under it, so it is thick "
            "and steep; lower `zigzag` or `amplitude`.",
        ),
        ({"coverage": 0.95}, ""),
        ({"coverage": 0.9494}, "coverage: The sheet covers 94.9 % of the target's area."),
        ({"overhang": 0.01}, ""),
        (
            {"overhang": 0.505},
            "overhang: 50.5 % of the sheet reaches beyond the border of the target or lies over "
            "its holes.",
        ),
    ],
)
def test_what_is_hard_to_fold_is_told_from_its_limit_on(
    values: dict[str, object], says: str
) -> None:
    found = judge_quality(measured(**values), fitted=False)
    assert [f"{each.code}: {each.sentence}" for each in found] == ([says] if says else [])


def test_only_a_fitted_sheet_can_be_asked_for_otherwise() -> None:
    steep = measured(quality=folding_by(170.0))
    (told,) = judge_quality(steep, fitted=True)
    assert told.sentence.endswith("; ask for other `facets`, or a lower `amplitude` or `zigzag`.")


def test_the_numbers_alone_are_those_of_the_audit() -> None:
    assert measure(two_pieces()) == audit(two_pieces()).measurements
    found = measure(two_pieces())
    lengths = edge_lengths(two_pieces().vertices_coords, two_pieces().edges_vertices)
    assert found.seam_mm == pytest.approx(lengths[two_pieces().seams[:, 0]].sum())
    assert found.seam_mm == pytest.approx(lengths[two_pieces().seams[:, 1]].sum())
    assert (found.pieces, found.overlaps, found.self_intersections) == (2, 0, 0)
    squares = unit_squares()  # of their seam, the second edge is made longer
    longer = shifted(squares.vertices_coords, 7, 0.0, 0.25)
    assert measure(replace(squares, vertices_coords=longer)).seam_mm == 1.0
    assert found.min_edge_mm == pytest.approx(lengths.min())
    pattern = regular()
    near = pattern.folded_coords.copy()
    near[1] = near[0] + 0.1 * (near[1] - near[0])
    shorter = measure(replace(pattern, folded_coords=near)).min_edge_mm
    assert shorter == pytest.approx(edge_lengths(near, pattern.edges_vertices).min())
    assert shorter < measure(pattern).min_edge_mm / 5


def test_a_report_has_status_advice_and_what_is_proved() -> None:
    whole = audit(regular()).report()
    assert (whole["status"], whole["advice"], whole["iterations"]) == ("converged", "", None)
    assert whole["proved"] == list(audit(regular()).proved)
    assert whole["findings"] == []
    assert 0 < whole["seconds"] < 60
    shape = audit(regular()).measurements.quality
    assert whole["quality"] == shape.as_json(None)
    broken = replace(two_pieces(), seams=two_pieces().seams[1:], target_kept=None)
    report, found = audit(broken).report(), audit(broken).findings
    assert report["status"] == "invalid"
    assert report["advice"] == found[1].sentence
    assert [each["code"] for each in report["findings"]] == ["not-proven", "seam"]
    assert audit(broken).valid is False
    assert set(Measurements.report(None).values()) == {None}
    assert Measurements.report(None).keys() == Measurements.report(measure(regular())).keys()
    flat = Measurements.report(measure(replace(regular(), folded_coords=None)))
    assert (flat["facets"], flat["quality"], flat["max_isometry"]) == (48, None, None)


def test_what_was_not_measured_is_none() -> None:
    numbers = vars(measured())
    told = {"facets": 1, "vertices": 4, "min_edge_mm": 1.0, "overlaps": 0}
    told |= {"pieces": 1, "seam_mm": 0.0}
    assert numbers == dict.fromkeys(numbers) | told
    assert Audit(measured(), (), 0.0).proved == ()


def test_a_value_shows_what_is_not_as_usual_and_a_notebook_all() -> None:
    usual = measured(pieces=1, seam_mm=0.0, max_isometry=None, quality=None)
    assert repr(usual) == "<Measurements facets=1, vertices=4, min_edge_mm=1, overlaps=0>"
    found = audit(regular())
    shown = found._repr_mimebundle_()["text/html"]
    for name in ("valid", *vars(found.measurements)):
        assert f">{name.replace('_', ' ')}<" in shown
