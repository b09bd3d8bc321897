"""The plan: fewer sheets where that is worth the glue, and never worse than the first split."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from flat_patterns import bed, card, fan, grid, miura, without_grid

from miurafab.fabrication import plan as planning
from miurafab.fabrication.layout import read_layout, write_layout
from miurafab.fabrication.nesting import Problem, first_nesting, nest, nest_within, price
from miurafab.fabrication.options import LayoutOptions, NestingOptions
from miurafab.fabrication.partition.fit_box import Space
from miurafab.fabrication.partition.patch_frame import framed_patches, sheet_space
from miurafab.fabrication.partition.patch_outline import outline_patches
from miurafab.fabrication.partition.split import split
from miurafab.fabrication.plan import plan_patches
from miurafab.fabrication.plan_splits import dissolved, equal_blocks, smaller_rooms, tighter_rooms
from miurafab.fabrication.sheets import lay_out
from miurafab.fabrication.stock import lay_stock


def strip(columns: int, rows: int, cell: float):
    i, j = np.indices((rows + 1, columns + 1))
    return grid(np.stack([j * cell, i * cell], axis=-1))


def test_rooms_are_parts_of_a_room_that_leave_something():
    """A room of 10 mm has no three parts with 6 mm between; one with turns has all its sides."""
    found = smaller_rooms(Space(10.0, 100.0), 6.0)
    assert (2.0, 100.0) in {(each.width, each.height) for each in found}
    assert min(min(each.width, each.height) for each in found) == 2.0
    for turns, count in ((None, 2), ((0, 1), 3)):
        rooms = tighter_rooms(Space(200.0, 100.0, turns))
        assert len(rooms) == 4 * count
        assert {each.turns for each in rooms} == {turns}
        sides = {(each.width, each.height) for each in rooms}
        assert ((190.0, 100.0) in sides) == (turns is not None)
        assert {(190.0, 95.0), (200.0, 95.0)} <= sides


def planned(pattern, machine, options=None):
    options = options or LayoutOptions()
    stock = lay_stock(options, machine.bed, "none")
    return plan_patches(pattern, stock, card(), options)


def objective(pattern, face_patch, sheets, machine):
    """J as it is defined, from the split alone."""
    worth = 1.5 * (max(machine.bed.width_mm, machine.bed.height_mm) - 2 * machine.bed.margin_mm)
    glue = 0.0
    for edge, (one, other) in enumerate(pattern.edges_faces.tolist()):
        if min(one, other) >= 0 and face_patch[one] != face_patch[other]:
            a, b = pattern.vertices_coords[pattern.edges_vertices[edge]]
            glue += float(np.hypot(*(b - a)))
    corners = pattern.vertices_coords[pattern.faces_vertices]
    facets = shapely.area(shapely.polygons(corners))
    areas = np.array([facets[face_patch == p].sum() for p in range(face_patch.max() + 1)])
    small = sum(max(0.0, 0.35 - area / areas.mean()) / 0.35 for area in areas)
    return worth * sheets + glue + (worth / 4 * small if len(areas) > 1 else 0.0)


def first_split(pattern, machine):
    """The split into the fewest patches and its sheets."""
    options = LayoutOptions()
    stock = lay_stock(options, machine.bed, "none")
    space = sheet_space(stock)
    outlined = outline_patches(pattern, space.width, space.height, card(), options)
    patches = framed_patches(pattern, outlined, space).patches
    outlines = tuple(patch.outline_mm for patch in patches)
    nesting = nest(Problem(outlines, tuple(patch.label for patch in patches), stock.kinds))
    return outlined.face_patch, nesting.sheets


@pytest.mark.parametrize(
    ("pattern", "machine"),
    [
        (strip(60, 2, 12.0), bed(170.0, 170.0)),
        (miura(22, 9, 14.0, 14.0), bed(170.0, 130.0)),
        (without_grid(fan(9, 8, radius=120.0)), bed(80.0, 70.0)),
        (miura(9, 31, 9.0, 13.0, 1.0), bed(140.0, 190.0)),
    ],
)
def test_no_plan_is_worse_than_the_split_into_the_fewest_patches(pattern, machine):
    face_patch, sheets = first_split(pattern, machine)
    plan = planned(pattern, machine)
    found = objective(pattern, plan.framed.outlined.face_patch, plan.nesting.sheets, machine)
    assert found <= objective(pattern, face_patch, sheets, machine) + 1e-6


def test_a_strip_shares_sheets_instead_of_lying_across_them():
    pattern, machine = strip(60, 2, 12.0), bed(170.0, 170.0)
    _, alone = first_split(pattern, machine)
    plan = planned(pattern, machine)
    assert alone == 4
    assert plan.nesting.sheets == 1
    chosen, other = plan.alternatives
    assert (chosen.sheets, chosen.chosen) == (1, True)
    assert (other.sheets, other.chosen) == (4, False)
    assert other.seam_mm == pytest.approx(24.0 * (other.patches - 1))


def test_what_is_preferred_moves_the_worth_of_a_sheet():
    pattern, machine = miura(22, 9, 14.0, 14.0), bed(170.0, 130.0)
    by = {
        prefer: planned(pattern, machine, LayoutOptions(prefer=prefer))
        for prefer in ("sheets", None, "glue")
    }
    sheets = [by[prefer].nesting.sheets for prefer in ("sheets", None, "glue")]
    glue = [by[prefer].alternatives[0].seam_mm for prefer in ("sheets", None, "glue")]
    assert sheets == sorted(sheets)
    assert glue == sorted(glue, reverse=True)


def test_nothing_is_searched_where_the_sheets_are_full(monkeypatch):
    monkeypatch.setattr(planning, "smaller_rooms", None)
    monkeypatch.setattr(planning, "equal_blocks", None)
    plan = planned(strip(20, 20, 12.0), bed(260.0, 145.0))
    assert plan.nesting.sheets == plan.nesting.bound == 2


def test_copies_are_planned_together():
    """Two halves of a bed each: four copies on two sheets with one seam each."""
    options = LayoutOptions(nesting=NestingOptions(quantity=4))
    plan = planned(strip(10, 10, 12.0), bed(140.0, 260.0), options)
    assert len(plan.patches) == 4
    assert plan.nesting.sheets == 2


def test_equal_blocks_are_equal_and_fit():
    pattern = strip(20, 12, 10.0)
    space = sheet_space(lay_stock(LayoutOptions(), bed(120.0, 90.0).bed, "none"))
    first, *_ = equal_blocks(pattern, space, 7.0, LayoutOptions(), 2, 12)
    assert (first.seam_rows, first.seam_columns) == ((6,), (10,))
    found = split(pattern, space.width, space.height, card(), first, improve=False)
    assert np.bincount(found).tolist() == [60] * 4


def test_rooms_side_by_side_fill_the_bed():
    space = sheet_space(lay_stock(LayoutOptions(), bed(210.0, 110.0).bed, "none"))
    for room in smaller_rooms(space, 2.0):
        across = (space.width + 2.0) / (room.width + 2.0)
        along = (space.height + 2.0) / (room.height + 2.0)
        assert across == pytest.approx(round(across))
        assert along == pytest.approx(round(along))


@pytest.mark.parametrize("told", [True, False])
def test_a_dissolved_patch_is_cut_into_parts_and_the_others_stay(told):
    pattern = miura(12, 6) if told else without_grid(miura(12, 6))
    face_patch = (np.arange(72) % 12 // 4).astype(np.int64)
    ways = list(dissolved(pattern, face_patch, 1))
    assert ways
    for found in ways:
        parts = np.unique(found[face_patch == 1])
        assert (found[face_patch == 0] == 0).all()
        assert parts.tolist() == list(range(1, 1 + len(parts)))
        assert (found[face_patch == 2] == 1 + len(parts)).all()


def test_a_nesting_within_a_price_is_the_nesting_or_none():
    stock = lay_stock(LayoutOptions(), bed(110.0, 90.0).bed, "none").kinds
    sizes = [(60.0, 40.0), (50.0, 40.0), (45.0, 45.0), (30.0, 75.0)]
    outlines = tuple(np.array([(0, 0), (a, 0), (a, b), (0, b)]) for a, b in sizes)
    asked = Problem(outlines, tuple("abcd"), stock)
    usual = nest(asked)
    assert price(usual.slots, stock) == 2
    assert nest_within(asked, 2.0) == usual
    assert nest_within(asked, 1.5) is None
    first = first_nesting(asked)
    assert nest(asked, known=first) == usual
    assert first_nesting(asked, 1.0) is None


def test_the_alternatives_are_written_and_read():
    layout = lay_out(strip(60, 2, 12.0), bed(170.0, 170.0), card())
    assert len(layout.alternatives) == 2
    assert read_layout(write_layout(layout, "p", "s")).alternatives == layout.alternatives
