"""Nesting: few sheets, and every layout proven before it is used."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import shapely
from flat_patterns import facet_polygons, zigzag
from hypothesis import given, settings
from hypothesis import strategies as st

from miurafab.errors import LayoutError
from miurafab.fabrication.nesting import Slot, Stock, layout_faults, nest, place, turned

ANY = (0, 90, 180, 270)


def zigzag_pieces(count: int, seed: int) -> list[np.ndarray]:
    """Outlines of zig-zag patches of many sizes, about 22 cm x 11 cm."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        columns, rows = (int(n) for n in rng.integers(4, 11, 2))
        pattern = zigzag(columns, rows, rng.uniform(13, 19), rng.uniform(0.6, 1.2))
        outline = shapely.union_all(facet_polygons(pattern)).buffer(3.0, join_style="mitre")
        found.append(shapely.get_coordinates(outline.exterior)[:-1])
    return found


def star(seed: int) -> np.ndarray:
    """A star-shaped outline with random spikes."""
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, 12)) + np.arange(12) * 1e-3
    radius = rng.uniform(5.0, 45.0, 12)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def assert_sound(outlines, slots, stock):
    """An independent check: exact polygons, pairwise, sheet by sheet."""
    shapes = [shapely.Polygon(place(o, s)) for o, s in zip(outlines, slots, strict=True)]
    bed = shapely.box(0, 0, stock.width, stock.height).buffer(1e-6)
    for shape in shapes:
        assert bed.contains(shape)
    for i, one in enumerate(shapes):
        for j in range(i):
            if slots[i].sheet == slots[j].sheet:
                assert one.distance(shapes[j]) >= stock.gap - 1e-6
    assert {slot.sheet for slot in slots} == set(range(max(s.sheet for s in slots) + 1))


def test_forty_zigzag_patches_take_six_sheets_at_most():
    outlines = zigzag_pieces(40, 0)
    stock = Stock(600.0, 400.0, 2.0, ANY)
    area = sum(shapely.Polygon(outline).area for outline in outlines)
    scale = np.sqrt(3.85 * 600.0 * 400.0 / area)
    outlines = [outline * scale for outline in outlines]
    slots = nest(outlines, stock)
    assert_sound(outlines, slots, stock)
    assert max(slot.sheet for slot in slots) + 1 <= 6


@settings(derandomize=True, max_examples=25, deadline=None)
@given(
    st.lists(st.integers(0, 1000), min_size=1, max_size=10),
    st.floats(95.0, 250.0),
    st.floats(95.0, 250.0),
    st.floats(0.0, 6.0),
    st.sampled_from([(0,), (0, 180), ANY]),
)
def test_any_outlines_get_a_sound_layout_within_the_allowed_rotations(seeds, w, h, gap, rotations):
    outlines = [star(seed) for seed in seeds]
    stock = Stock(w, h, gap, rotations)
    slots = nest(outlines, stock)
    assert_sound(outlines, slots, stock)
    assert {slot.rotation_deg for slot in slots} <= set(rotations)


def test_an_outline_that_just_fills_the_bed_fits():
    for wide, high in ((200.0, 100.0), (100.0, 200.0)):
        outline = np.array([[0, 0], [wide, 0], [wide, high], [0, high]]) - 17.3
        stock = Stock(200.0, 100.0, 5.0, ANY)
        (slot,) = nest([outline], stock)
        assert_sound([outline], [slot], stock)


def test_four_rectangles_that_tile_the_bed_with_their_gaps_take_one_sheet():
    outline = np.array([[0, 0], [96, 0], [96, 46], [0, 46]], dtype=float)
    stock = Stock(200.0, 100.0, 2.0, (0,))
    slots = nest([outline] * 4, stock)
    assert_sound([outline] * 4, slots, stock)
    assert max(slot.sheet for slot in slots) == 0


def test_small_outlines_go_into_the_notch_of_a_large_one():
    notched = np.array(
        [[0, 0], [100, 0], [100, 100], [60, 100], [60, 40], [40, 40], [40, 100], [0, 100]],
        dtype=float,
    )
    bar = np.array([[0, 0], [14, 0], [14, 55], [0, 55]], dtype=float)
    stock = Stock(101.0, 101.0, 2.0, ANY)
    slots = nest([bar, notched], stock)
    assert_sound([bar, notched], slots, stock)
    assert max(slot.sheet for slot in slots) == 0


def bars(count: int) -> list[np.ndarray]:
    return [np.array([[0, 0], [28, 0], [28, 18], [0, 18]], dtype=float)] * count


def assert_on_offcuts(outlines, slots, stock):
    """Parts on off-cuts lie in them, and each off-cut is one sheet."""
    for outline, slot in zip(outlines, slots, strict=True):
        if slot.offcut >= 0:
            region = stock.offcuts[slot.offcut].buffer(1e-6)
            assert region.contains(shapely.Polygon(place(outline, slot)))
    used = {(slot.sheet, slot.offcut) for slot in slots}
    assert len({sheet for sheet, _ in used}) == len(used)


def test_offcuts_go_first_and_their_defects_stay_free():
    hole = shapely.box(40.0, 20.0, 50.0, 30.0)
    corner = shapely.Polygon([(0, 0), (100, 0), (100, 40), (40, 40), (40, 80), (0, 80)])
    offcuts = (shapely.box(0, 0, 90, 60).difference(hole), corner, shapely.box(0, 0, 10, 10))
    outlines = bars(14)
    stock = Stock(120.0, 100.0, 2.0, ANY, offcuts)
    slots = nest(outlines, stock)
    assert_sound(outlines, slots, stock)
    assert_on_offcuts(outlines, slots, stock)
    counts = [sum(slot.offcut == number for slot in slots) for number in (0, 1, 2, -1)]
    assert counts[0] >= 4
    assert counts[1] >= 4
    assert counts[2] == 0
    assert layout_faults(outlines, slots, stock) == []


@settings(derandomize=True, max_examples=15, deadline=None)
@given(
    st.lists(st.integers(0, 1000), min_size=1, max_size=8),
    st.lists(st.integers(0, 1000), min_size=1, max_size=3),
)
def test_any_offcuts_get_a_sound_layout(seeds, shapes):
    outlines = [star(seed) for seed in seeds]
    offcuts = tuple(shapely.Polygon(2.5 * star(seed) + 100.0).buffer(0) for seed in shapes)
    stock = Stock(200.0, 160.0, 3.0, ANY, offcuts)
    slots = nest(outlines, stock)
    assert_sound(outlines, slots, stock)
    assert_on_offcuts(outlines, slots, stock)


def test_a_part_off_its_offcut_or_an_offcut_used_twice_is_a_fault():
    outlines = bars(2)
    stock = Stock(120.0, 100.0, 2.0, ANY, (shapely.box(0, 0, 40, 60),))
    off = [Slot(0, 0.0, 0.0, 0, 0), Slot(0, 30.0, 30.0, 0, 0)]
    assert layout_faults(outlines, off, stock) == ["patch 1 lies outside off-cut 1"]
    twice = [Slot(0, 0.0, 0.0, 0, 0), Slot(1, 0.0, 0.0, 0, 0)]
    assert "two sheets" in layout_faults(outlines, twice, stock)[0]


def test_the_same_input_gives_the_same_layout():
    outlines = zigzag_pieces(12, 3)
    stock = Stock(400.0, 300.0, 2.0, ANY)
    assert nest(outlines, stock) == nest(outlines, stock)


def test_an_outline_larger_than_the_bed_is_refused_with_its_size():
    outline = np.array([[0, 0], [250, 0], [250, 30], [0, 30]], dtype=float)
    with pytest.raises(LayoutError, match=r"Patch 0 measures 250\.0 mm x 30\.0 mm"):
        nest([outline], Stock(200.0, 200.0, 2.0, ANY))


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"x_mm": -1.0}, "outside the usable bed"),
        ({"x_mm": 49.0}, "nearer than 2 mm"),
        ({"rotation_deg": 180, "x_mm": 30.0, "y_mm": 30.0}, "turned by 180"),
    ],
)
def test_an_engine_that_cheats_is_refused(change, fault):
    outline = np.array([[0, 0], [30, 0], [30, 30], [0, 30]], dtype=float)
    stock = Stock(100.0, 50.0, 2.0, (0, 90))
    good = [Slot(0, 0.0, 0.0, 0), Slot(0, 50.0, 0.0, 0)]
    assert nest([outline] * 2, stock, lambda *_: good) == good
    bad = [dataclasses.replace(good[0], **change), good[1]]
    if "x_mm" in change and change["x_mm"] > 40:
        bad = [good[0], dataclasses.replace(good[1], x_mm=31.0)]
    with pytest.raises(LayoutError, match=fault):
        nest([outline] * 2, stock, lambda *_: bad)
    assert layout_faults([outline], good, stock) == ["it has 2 places for 1 patches"]


def test_right_angles_turn_exactly():
    point = np.array([[3.0, 5.0]])
    np.testing.assert_array_equal(turned(point, 90), [[-5.0, 3.0]])
    np.testing.assert_array_equal(turned(point, 180), [[-3.0, -5.0]])
    np.testing.assert_array_equal(turned(point, -90), [[5.0, -3.0]])
    np.testing.assert_allclose(turned(point, 30.0), turned(turned(point, 10.0), 20.0))
