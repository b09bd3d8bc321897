"""The order on a sheet: the same strokes, creases before outlines, little travel."""

from __future__ import annotations

import dataclasses

import flat_patterns
import numpy as np
import pytest
from flat_patterns import bed, card, miura, triangles, zigzag

from miurafab.fabrication import sheets
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.ordering import Strokes, order_strokes, travel_bound
from miurafab.fabrication.sheets import lay_out
from miurafab.fabrication.toolpath import Toolpath
from miurafab.profiles import OPERATIONS

CASES = {
    "miura": miura(30, 26),
    "acute": zigzag(24, 30),
    "fan": flat_patterns.fan(36, 30, radius=250.0),
    "triangles": triangles(3, 14, 500.0),
}
MACHINE = bed(300.0, 200.0)


@pytest.fixture(scope="module", params=CASES)
def before_and_after(request):
    """(strokes of each sheet before they were ordered, the layout, the pattern)."""
    taken: list[Strokes] = []
    kept = sheets.order_strokes

    def spy(strokes, edges_vertices, **wanted):
        taken.append(strokes)
        return kept(strokes, edges_vertices, **wanted)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sheets, "order_strokes", spy)
        pattern = CASES[request.param]
        return taken, lay_out(pattern, MACHINE, card()), pattern


def canonical(toolpath) -> list[tuple]:
    """The strokes without their order, direction and, if closed, beginning."""
    found = []
    for k in range(len(toolpath)):
        points = np.round(toolpath.stroke(k), 9)
        if len(points) > 3 and np.array_equal(points[0], points[-1]):
            ring = points[:-1]
            first = np.lexsort((ring[:, 1], ring[:, 0]))[0]
            points = np.roll(ring, -first, axis=0)
        elif tuple(points[0]) > tuple(points[-1]):
            points = points[::-1]
        key = (toolpath.operation[k], toolpath.patch[k], toolpath.edge[k], points.tobytes())
        found.append(key)
    return sorted(found)


def test_the_strokes_are_the_same_before_and_after(before_and_after):
    taken, layout, _ = before_and_after
    for strokes, toolpath in zip(taken, layout.toolpaths, strict=True):
        assert canonical(strokes.toolpath) == canonical(toolpath)


def test_operations_follow_each_other_and_the_outlines_come_last(before_and_after):
    _, layout, _ = before_and_after
    for toolpath in layout.toolpaths:
        assert (np.diff(toolpath.operation) >= 0).all()
        cuts = np.flatnonzero(toolpath.operation == OPERATIONS.index("cut"))
        outlines = cuts[toolpath.edge[cuts] < 0]
        assert (np.diff(outlines) == 1).all()
        assert outlines[-1] == len(toolpath) - 1


def test_the_dashes_of_a_crease_are_made_in_turn_along_it(before_and_after):
    _, layout, _ = before_and_after
    for toolpath in layout.toolpaths:
        chosen = np.flatnonzero(toolpath.operation == OPERATIONS.index("perforate"))
        runs = np.flatnonzero(np.diff(toolpath.edge[chosen], prepend=-2))
        assert len(runs) == len(np.unique(toolpath.edge[chosen]))
        for run in np.split(chosen, runs[1:]):
            starts, ends = toolpath.starts[run], toolpath.ends[run]
            way = ends[-1] - starts[0]
            along = np.stack([starts @ way, ends @ way], axis=1).ravel()
            assert (np.diff(along) > 0).all()


def test_travel_is_little(before_and_after):
    """Against the dashes' own gaps, which no order can save, and against no order at all."""
    taken, layout, _ = before_and_after
    for strokes, toolpath in zip(taken, layout.toolpaths, strict=True):
        assert toolpath.travel_mm < strokes.toolpath.travel_mm
        creases = toolpath.operation == OPERATIONS.index("perforate")
        starts, ends = toolpath.starts[creases], toolpath.ends[creases]
        legs = np.linalg.norm(starts[1:] - ends[:-1], axis=1)
        # Within a crease a gap and a kerf; through a vertex two bridges and a kerf.
        vertex = np.diff(toolpath.edge[creases]) != 0
        rule = card().perforation
        np.testing.assert_allclose(legs[~vertex], rule.gap_mm + 0.15, atol=1e-6)
        through = 2 * rule.end_bridge_mm + 0.15 + 3.0
        far = legs[vertex] > through
        # Only the ends of creases at the outline need a jump, and n creases have about 4 sqrt n.
        assert far.sum() <= 5 * np.sqrt(len(np.unique(toolpath.edge[creases])))


def test_no_order_has_less_travel_than_the_bound(before_and_after):
    taken, layout, _ = before_and_after
    rng = np.random.default_rng(5)
    for strokes, toolpath, sheet in zip(taken, layout.toolpaths, layout.sheets, strict=True):
        bound = travel_bound(toolpath)
        assert 0.0 < bound <= toolpath.travel_mm
        assert travel_bound(strokes.toolpath) == pytest.approx(bound, rel=0.02)
        assert (sheet.travel_mm, sheet.travel_bound_mm) == pytest.approx(
            (toolpath.travel_mm, bound), abs=1e-3
        )
        ends = np.stack([toolpath.starts, toolpath.ends], axis=1)[rng.permutation(len(toolpath))]
        legs = np.linalg.norm(ends[1:, 0] - ends[:-1, 1], axis=1).sum()
        assert bound <= legs


def test_the_bound_of_strokes_in_a_row_is_their_travel():
    starts = np.column_stack([np.arange(5) * 3.0 + 1.0, np.zeros(5)])
    points = np.stack([starts, starts + np.array([2.0, 0.0])], axis=1).reshape(-1, 2)
    minus = np.full(5, -1)
    row = Toolpath("s", 99.0, 99.0, points, np.arange(0, 11, 2), minus + 3, minus, minus)
    # Both ends of four gaps; the way from the origin, from both ends; back to it; the last end.
    assert travel_bound(row) == pytest.approx((4 * 2 * 1.0 + 2 * 1.0 + 1.0 + 3.0) / 2)
    assert travel_bound(row) <= row.travel_mm


def test_spread_heat_cuts_far_from_where_it_just_cut():
    pattern = miura(30, 4, 12.0, 12.0)
    options = LayoutOptions(max_patch_mm=(70.0, 60.0))
    usual = lay_out(pattern, MACHINE, card(), options=options)
    spread = lay_out(
        pattern, MACHINE, card(), options=dataclasses.replace(options, spread_heat=True)
    )
    (one,), (other,) = usual.toolpaths, spread.toolpaths
    assert canonical(one) == canonical(other)

    def apart(toolpath):
        cuts = np.flatnonzero(toolpath.operation == OPERATIONS.index("cut"))
        middles = np.array([toolpath.stroke(k).mean(axis=0) for k in cuts])
        return np.linalg.norm(np.diff(middles, axis=0), axis=1)

    assert len(apart(one)) >= 6
    assert apart(other)[0] > 100.0
    assert apart(other).mean() > 1.5 * apart(one).mean()


def test_ordering_again_changes_nothing_but_the_beginning(before_and_after):
    taken, layout, pattern = before_and_after
    again = order_strokes(taken[0], pattern.edges_vertices)
    np.testing.assert_array_equal(again.points, layout.toolpaths[0].points)


def test_cuts_within_patches_go_before_outlines():
    pattern = miura(6, 6, 20.0, 20.0)
    kinds = pattern.edges_assignment.copy()
    inner = np.flatnonzero(kinds != "B")[[3, 4, 20]]
    kinds[inner] = "C"
    slit = dataclasses.replace(pattern, edges_assignment=kinds)
    (toolpath,) = lay_out(slit, MACHINE, card()).toolpaths
    cuts = toolpath.operation == OPERATIONS.index("cut")
    assert sorted(toolpath.edge[cuts][:-1].tolist()) == sorted(inner.tolist())
    assert toolpath.edge[-1] == -1
    perforated = np.unique(toolpath.edge[toolpath.operation == OPERATIONS.index("perforate")])
    folded = np.flatnonzero(np.isin(kinds, ["M", "V"]))
    np.testing.assert_array_equal(perforated, folded)
