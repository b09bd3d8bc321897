"""Nesting: little stock used up, and every layout proven before it is used."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import shapely
from flat_patterns import bed, card, facet_polygons, zigzag
from hypothesis import given, settings
from hypothesis import strategies as st

from miurafab.errors import LayoutError
from miurafab.fabrication.nesting import (
    Problem,
    SheetKind,
    Slot,
    Stock,
    cells,
    filling,
    layout_faults,
    nest,
    place,
    raster,
    turned,
)
from miurafab.fabrication.sheets import lay_out

ANY = (0, 90, 180, 270)


def problem(outlines, kinds, gap=2.0):
    kinds = (kinds,) if isinstance(kinds, SheetKind) else tuple(kinds)
    names = tuple(f"P{number + 1}" for number in range(len(outlines)))
    return Problem(tuple(outlines), names, Stock(kinds, gap))


def rectangle(wide: float, high: float) -> np.ndarray:
    return np.array([[0, 0], [wide, 0], [wide, high], [0, high]], dtype=float)


def zigzag_pieces(count: int, beds: float, seed: int = 0) -> list[np.ndarray]:
    """Outlines of zig-zag patches of many sizes, as large together as so many beds of 6 x 4 dm."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        columns, rows = (int(n) for n in rng.integers(4, 11, 2))
        pattern = zigzag(columns, rows, rng.uniform(13, 19), rng.uniform(0.6, 1.2))
        outline = shapely.union_all(facet_polygons(pattern)).buffer(3.0, join_style="mitre")
        found.append(shapely.get_coordinates(outline.exterior)[:-1])
    area = sum(shapely.Polygon(outline).area for outline in found)
    return [outline * np.sqrt(beds * 600.0 * 400.0 / area) for outline in found]


def star(seed: int) -> np.ndarray:
    """A star-shaped outline with random spikes."""
    rng = np.random.default_rng(seed)
    angle = (np.arange(12) + rng.uniform(0.0, 0.9, 12)) * (np.pi / 6)
    radius = rng.uniform(5.0, 45.0, 12)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def assert_sound(asked, slots):
    """An independent check: exact polygons, pairwise, sheet by sheet."""
    outlines, stock = asked.outlines, asked.stock
    shapes = [shapely.Polygon(place(o, s)) for o, s in zip(outlines, slots, strict=True)]
    for shape, slot in zip(shapes, slots, strict=True):
        kind = stock.kinds[slot.kind]
        assert shapely.box(0, 0, kind.width, kind.height).buffer(1e-6).contains(shape)
        assert slot.rotation_deg in kind.rotations
        for ring in kind.defects:
            assert shape.buffer(-1e-6).disjoint(shapely.Polygon(ring))
    for i, one in enumerate(shapes):
        for j in range(i):
            if slots[i].sheet == slots[j].sheet:
                assert one.distance(shapes[j]) >= stock.gap - 1e-6
                assert one.buffer(-1e-6).disjoint(shapes[j])
    used = {(slot.sheet, slot.kind) for slot in slots}
    assert {sheet for sheet, _ in used} == set(range(len(used)))
    for number, kind in enumerate(stock.kinds):
        taken = sum(which == number for _, which in used)
        assert kind.quantity is None or taken <= kind.quantity


def sheets_of(slots) -> int:
    return max(slot.sheet for slot in slots) + 1


def test_forty_zigzag_patches_take_five_sheets():
    asked = problem(zigzag_pieces(40, 3.85), SheetKind(600.0, 400.0, ANY))
    found = nest(asked)
    assert_sound(asked, found.slots)
    assert found.finished
    assert (sheets_of(found.slots), found.bound) == (5, 4)


@settings(derandomize=True, max_examples=15, deadline=None)
@given(
    st.lists(st.integers(0, 1000), min_size=1, max_size=8),
    st.floats(95.0, 250.0),
    st.floats(95.0, 250.0),
    st.floats(0.0, 6.0),
    st.sampled_from([(0,), (0, 180), ANY, (0, 45, 200)]),
)
def test_any_outlines_get_a_sound_layout_within_the_allowed_rotations(seeds, w, h, gap, rotations):
    asked = problem([star(seed) for seed in seeds], SheetKind(w, h, rotations), gap)
    found = nest(asked)
    assert_sound(asked, found.slots)
    assert sheets_of(found.slots) >= found.bound


def test_an_outline_that_just_fills_the_bed_fits():
    for wide, high in ((200.0, 100.0), (100.0, 200.0)):
        asked = problem([rectangle(wide, high) - 17.3], SheetKind(200.0, 100.0, ANY), 5.0)
        assert_sound(asked, nest(asked).slots)


def test_four_rectangles_that_tile_the_bed_with_their_gaps_take_one_sheet():
    asked = problem([rectangle(96, 46)] * 4, SheetKind(200.0, 100.0, (0,)))
    slots = nest(asked).slots
    assert_sound(asked, slots)
    assert sheets_of(slots) == 1


def test_small_outlines_go_into_the_notch_of_a_large_one():
    notched = np.array(
        [[0, 0], [100, 0], [100, 100], [60, 100], [60, 40], [40, 40], [40, 100], [0, 100]],
        dtype=float,
    )
    asked = problem([rectangle(14, 55), notched], SheetKind(101.0, 101.0, ANY))
    slots = nest(asked).slots
    assert_sound(asked, slots)
    assert sheets_of(slots) == 1


HOLE = ((40.0, 20.0), (50.0, 20.0), (50.0, 30.0), (40.0, 30.0))
CORNER = ((40.0, 40.0), (100.0, 40.0), (100.0, 80.0), (40.0, 80.0))


def test_sheets_in_a_given_quantity_go_first_and_their_defects_stay_free():
    kinds = [
        SheetKind(120.0, 100.0, ANY),
        SheetKind(90.0, 60.0, ANY, 1, (HOLE,)),
        SheetKind(100.0, 80.0, ANY, 1, (CORNER,)),
        SheetKind(10.0, 10.0, ANY, 1),
    ]
    asked = problem([rectangle(28, 18)] * 14, kinds)
    slots = nest(asked).slots
    assert_sound(asked, slots)
    counts = [sum(slot.kind == number for slot in slots) for number in range(4)]
    assert counts[1] >= 4
    assert counts[2] >= 4
    assert counts[3] == 0


@settings(derandomize=True, max_examples=25, deadline=None)
@given(
    st.lists(st.integers(0, 1000), min_size=1, max_size=8),
    st.lists(
        st.tuples(st.floats(30.0, 200.0), st.floats(30.0, 160.0), st.integers(0, 3)), max_size=3
    ),
    st.lists(st.tuples(st.integers(0, 1000), st.floats(-20, 200), st.floats(-20, 160)), max_size=3),
    st.sampled_from([(0,), (90, 270), ANY, (15, 100)]),
    st.floats(0.0, 5.0),
)
def test_any_stock_gets_a_sound_layout_or_a_clear_refusal(seeds, sizes, flaws, rotations, gap):
    defects = tuple(tuple(map(tuple, (star(seed) / 3 + [x, y]).tolist())) for seed, x, y in flaws)
    kinds = [SheetKind(w, h, rotations, n, defects[:n]) for w, h, n in sizes]
    kinds = kinds or [SheetKind(180.0, 140.0, rotations, None, defects)]
    asked = problem([star(seed) for seed in seeds], kinds, gap)
    refusal = ""
    try:
        slots = nest(asked).slots
    except LayoutError as fault:
        refusal = str(fault)
    if refusal:
        assert any(part in refusal for part in ("does not fit", "fits no sheet", "is used up"))
        assert any(name in refusal for name in asked.names)
    else:
        assert_sound(asked, slots)
        assert layout_faults(asked, slots) == []


def test_a_stock_that_does_not_suffice_is_told_with_the_patch_left_over():
    for there, words in ((2, "2 sheets is used up and patch P3"), (1, "1 sheet is used up and")):
        asked = problem([rectangle(90, 90)] * 3, SheetKind(100.0, 100.0, ANY, there))
        with pytest.raises(LayoutError, match=f"The stock of {words}"):
            nest(asked)


def test_a_patch_that_only_a_defect_keeps_off_is_told():
    middle = ((45.0, 45.0), (55.0, 45.0), (55.0, 55.0), (45.0, 55.0))
    asked = problem([rectangle(90, 90)], SheetKind(100.0, 100.0, ANY, None, (middle,)))
    with pytest.raises(LayoutError, match="P1 fits no sheet of the stock beside the defects"):
        nest(asked)


def test_of_several_sizes_without_end_the_less_wasteful_layout_wins():
    kinds = [SheetKind(200.0, 100.0, ANY), SheetKind(100.0, 50.0, ANY)]
    asked = problem([rectangle(98, 48)], kinds)
    (slot,) = nest(asked).slots
    assert slot.kind == 1


def test_sheets_of_several_sizes_are_begun_in_the_order_of_the_stock():
    kinds = [
        SheetKind(100.0, 50.0, ANY),
        SheetKind(105.0, 50.0, ANY),
        SheetKind(99.0, 49.0, ANY, 0),
    ]
    asked = problem([rectangle(98, 48)] * 4, kinds)
    assert [slot.kind for slot in nest(asked).slots] == [0, 0, 0, 0]


def test_patches_that_fill_a_sheet_each_are_placed_without_a_search(monkeypatch):
    outlines = [rectangle(90.0 + n * 0.01, 80.0) for n in range(60)]
    asked = problem(outlines, SheetKind(100.0, 90.0, ANY))
    monkeypatch.setattr(cells.Raster, "open_positions", None)
    found = nest(asked)
    assert_sound(asked, found.slots)
    assert (sheets_of(found.slots), found.bound) == (60, 60)


def test_the_work_grows_with_the_outlines_and_not_with_their_pairs(monkeypatch):
    tried = []
    take = filling.FilledSheet.take
    monkeypatch.setattr(filling.FilledSheet, "take", lambda *a: tried.append(1) or take(*a))
    asked = problem([rectangle(90.0, 80.0)] * 2000, SheetKind(100.0, 90.0, ANY))
    found = nest(asked)
    assert (sheets_of(found.slots), found.bound) == (2000, 2000)
    assert len(tried) == 2000


def test_copies_of_an_outline_share_their_masks(monkeypatch):
    made = []
    mark = cells._scan
    monkeypatch.setattr(cells, "_scan", lambda *given: made.append(1) or mark(*given))
    nest(problem([rectangle(30.0, 20.0)] * 50, SheetKind(200.0, 100.0, (0, 90))))
    # At two rotations: the cells of the coarse raster, those of the fine one, and its rims.
    assert len(made) == 6


@pytest.mark.parametrize("share", [0.0, 0.0005, 0.004, 0.03, 1.0])
def test_free_positions_are_those_where_no_cell_is_marked(share):
    """Against every position, with many free positions left, few, and none."""
    part = cells.Part(star(7), 1.0)
    grid = cells.Raster(SheetKind(150.0, 120.0, (0,)), 1.0, [part], 64, 2)
    marked = grid.blank(SheetKind(150.0, 120.0, (0,)))
    marked |= np.random.default_rng(1).random(marked.shape) < share
    mask = grid.mask(0, 0)
    shape = np.array(mask.cells.shape)
    windows = np.lib.stride_tricks.sliding_window_view(marked[2:-2, 2:-2], tuple(shape))
    expected = ~(windows & mask.cells).any(axis=(2, 3))
    room = filling._room(marked)
    opened = grid.open_positions(room, mask)
    clear = grid.clear(room, mask, *opened)
    np.testing.assert_array_equal(np.argwhere(expected), np.column_stack(opened)[clear])
    every = np.indices(expected.shape).reshape(2, -1)
    np.testing.assert_array_equal(grid.clear(room, mask, *every), expected.ravel())
    assert (share in (0.03, 1.0)) == (not expected.any())


def test_positions_are_tried_from_the_best_on_and_equals_in_their_order():
    order = np.random.default_rng(2).integers(0, 40, 1000).astype(np.float32)
    found = list(filling._best_first(order))
    np.testing.assert_array_equal(np.concatenate(found), np.argsort(order, kind="stable"))
    assert len(found[0]) < 150


def test_the_rule_of_most_company_lays_a_part_where_it_touches_most():
    """A notch that a square fits is taken, though another free corner is nearer to the origin."""
    notch = np.array([(0, 0), (100, 0), (100, 60), (60, 60), (60, 40), (40, 40), (40, 60), (0, 60)])
    asked = problem(
        [notch.astype(float), rectangle(18.0, 19.0)], SheetKind(130.0, 100.0, (0,)), gap=0.5
    )
    search = raster._Search(asked, raster.WORK)
    company = search.first_fit([0, 1], None, [0], True)
    middle = np.array([company[1].x_mm, company[1].y_mm]) + 9.5
    inside = middle - [company[0].x_mm, company[0].y_mm]
    np.testing.assert_allclose(inside, [50.0, 50.0], atol=1.0)
    (beside,) = search.first_fit([0, 1], (1.0, 0.01), [0], True)[1:]
    assert beside.y_mm > 50.0


@pytest.mark.large
def test_two_hundred_small_patches_take_no_more_sheets_than_their_area_needs():
    outlines = zigzag_pieces(200, 5.02)
    found = nest(problem(outlines, SheetKind(600.0, 400.0, ANY)))
    assert sheets_of(found.slots) == found.bound == 6


def test_the_work_limit_ends_the_search_with_a_sound_layout():
    asked = problem(zigzag_pieces(20, 2.4), SheetKind(600.0, 400.0, ANY))
    for work in (0, 10_000_000):
        found = nest(asked, work)
        assert not found.finished
        assert_sound(asked, found.slots)


def test_the_same_input_gives_the_same_layout():
    asked = problem(zigzag_pieces(12, 1.5), SheetKind(400.0, 300.0, ANY))
    assert nest(asked) == nest(asked)


def test_an_outline_larger_than_the_bed_is_refused_with_its_size():
    asked = problem([rectangle(250, 30)], SheetKind(200.0, 200.0, ANY))
    with pytest.raises(LayoutError, match=r"Patch P1 measures 250\.0 mm x 30\.0 mm"):
        nest(asked)


def test_the_bound_counts_area_and_patches_that_cannot_share():
    bed = SheetKind(98.0, 98.0, ANY)
    assert problem([rectangle(8, 8)] * 100, bed).bound == 1
    assert problem([rectangle(48, 48)] * 5, bed).bound == 2
    assert problem([rectangle(88, 58)] * 7, bed).bound == 7
    kinds = [bed, SheetKind(48.0, 98.0, ANY, 3)]
    assert problem([rectangle(98, 98)] * 2, kinds).bound == 2
    kinds = [SheetKind(98.0, 98.0, ANY, 1), SheetKind(48.0, 98.0, ANY)]
    assert problem([rectangle(38, 38)] * 10, kinds).bound == 3
    few = SheetKind(98.0, 98.0, ANY, 2)
    assert problem([rectangle(48, 48)] * 40, few).bound == 2, "no more than there are"


def test_a_search_that_reached_its_limit_is_told(monkeypatch):
    def stopped(*given, **how):
        return dataclasses.replace(nest(*given, **how), finished=False)

    monkeypatch.setattr("miurafab.fabrication.plan.nest", stopped)
    layout = lay_out(zigzag(4, 4), bed(300.0, 300.0), card())
    (told,) = (each for each in layout.findings if each.code == "nesting-limit")
    assert told.sentence.startswith("The nesting reached its limit of work before it had tried")


def test_a_nesting_that_the_proof_refuses_is_none(monkeypatch):
    monkeypatch.setattr(raster, "layout_faults", lambda *_: ["P1 lies on P2"])
    with pytest.raises(LayoutError, match="The nesting cannot be used: P1 lies on P2"):
        nest(problem([rectangle(8, 8)] * 2, SheetKind(90.0, 90.0, ANY)))


GOOD = [Slot(0, 0, 0.0, 0.0, 0), Slot(0, 0, 50.0, 0.0, 0)]


@pytest.mark.parametrize(
    ("number", "change", "fault"),
    [
        (0, {"x_mm": -1.0}, "patch P1 lies outside the usable bed"),
        (0, {"x_mm": float("nan")}, "patch P1 is nowhere"),
        (1, {"x_mm": 31.0}, "patches P1 and P2 are nearer than 2 mm"),
        (1, {"x_mm": 0.0}, "patches P1 and P2 are nearer than 2 mm"),
        (0, {"rotation_deg": 180, "x_mm": 30.0, "y_mm": 30.0}, "patch P1 is turned by 180"),
        (1, {"y_mm": 15.0}, "patch P2 lies on a defect"),
        (1, {"kind": 2}, "it uses a sheet that the stock does not hold"),
        (1, {"kind": 1}, "a sheet is of two kinds"),
        (1, {"sheet": 2}, "its sheets are not numbered from 0 on"),
        (1, {"sheet": 1}, "it takes 2 sheets of a kind of which there are 1"),
    ],
)
def test_a_layout_that_cheats_is_found_out(number, change, fault):
    flaw = ((55.0, 40.0), (60.0, 40.0), (60.0, 50.0), (55.0, 50.0))
    kinds = (SheetKind(100.0, 50.0, (0, 90), 1, (flaw,)), SheetKind(100.0, 50.0, (0, 90)))
    asked = problem([rectangle(30, 30)] * 2, kinds)
    assert layout_faults(asked, GOOD) == []
    bad = list(GOOD)
    bad[number] = dataclasses.replace(bad[number], **change)
    assert fault in layout_faults(asked, bad)[0]
    assert layout_faults(asked, GOOD[:1]) == ["it has 1 places for 2 patches"]


def test_without_a_gap_outlines_may_touch_but_not_overlap():
    asked = problem([rectangle(30, 30)] * 2, SheetKind(100.0, 50.0, ANY), gap=0.0)
    beside = [GOOD[0], dataclasses.replace(GOOD[1], x_mm=30.0)]
    assert layout_faults(asked, beside) == []
    within = [GOOD[0], dataclasses.replace(GOOD[1], x_mm=29.9)]
    assert layout_faults(asked, within) == ["patches P1 and P2 overlap"]


def test_right_angles_turn_exactly():
    point = np.array([[3.0, 5.0]])
    np.testing.assert_array_equal(turned(point, 90), [[-5.0, 3.0]])
    np.testing.assert_array_equal(turned(point, 180), [[-3.0, -5.0]])
    np.testing.assert_array_equal(turned(point, -90), [[5.0, -3.0]])
    np.testing.assert_allclose(turned(point, 30.0), turned(turned(point, 10.0), 20.0))
