"""The stock: sheets read strictly from a file, laid on the bed, along the grain, in copies."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import shapely
from flat_patterns import bed, card, miura
from hypothesis import given, settings
from hypothesis import strategies as st

from miurafab.errors import InputError, LayoutError
from miurafab.fabrication.layout import read_layout, write_layout
from miurafab.fabrication.nesting import turned
from miurafab.fabrication.options import LayoutOptions, NestingOptions
from miurafab.fabrication.sheets import lay_out
from miurafab.fabrication.stock import StockSheet, lay_stock, read_stock

WHOLE = """
[[sheets]]
name = "left over"
width = "20cm"
height = 150
quantity = 2
grain = "y"

[[sheets.defects]]
x = "12mm"
y = 4
width = 6
height = "3mm"

[[sheets.defects]]
outline = [[200, 0], ["20cm", "1in"], [150, 0]]

[[sheets]]
width = 260
height = 200
"""


def written(folder: Path, text: str) -> Path:
    file = folder / "stock.toml"
    file.write_text(text)
    return file


def test_a_stock_file_is_read(tmp_path):
    assert read_stock(written(tmp_path, WHOLE)) == (
        StockSheet(
            "left over",
            200.0,
            150.0,
            2,
            "y",
            (
                ((12.0, 4.0), (18.0, 4.0), (18.0, 7.0), (12.0, 7.0)),
                ((200.0, 0.0), (200.0, 25.4), (150.0, 0.0)),
            ),
        ),
        StockSheet("sheet 2", 260.0, 200.0),
    )


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("quantity", "quantiy", r"stock.toml \[\[sheets\]\] 1: 'quantiy' is not a known key; did"),
        ("quantity = 2", "quantity = 0", "'quantity' is 0; it must be between 1 and"),
        ('grain = "y"', 'grain = "z"', "'grain' is 'z'; it must be one of none, x, y"),
        ('"20cm"\nheight', '"20 kg"\nheight', "'width' cannot be read"),
        ('x = "12mm"\n', "", r"\[\[defects\]\] 1: 'x' is missing"),
        ("[150, 0]", "[150]", r"'outline' is .*; write points such as"),
        ("[150, 0]", "[200, 10]", "'outline' must be three points or more around a simple shape"),
        ("[[sheets.defects]]\nx", "[sheets.defects]\nx", "not valid TOML"),
    ],
)
def test_a_wrong_stock_file_is_refused_by_name(tmp_path, old, new, complaint):
    with pytest.raises(InputError, match=complaint):
        read_stock(written(tmp_path, WHOLE.replace(old, new)))


def test_an_empty_or_missing_stock_file_is_told(tmp_path):
    with pytest.raises(InputError, match=r"stock.toml: 'sheets' must be tables \[\[sheets\]\]"):
        read_stock(written(tmp_path, "sheets = 3"))
    with pytest.raises(InputError, match=r"stock.toml holds no sheet; write one under \[\[sheets"):
        read_stock(written(tmp_path, ""))
    with pytest.raises(InputError, match="'sheet' is not a known key; did you mean 'sheets'"):
        read_stock(written(tmp_path, "[[sheet]]\nwidth = 3\n"))
    with pytest.raises(InputError, match="does not exist"):
        read_stock(tmp_path / "none.toml")


def options(**nesting) -> LayoutOptions:
    return LayoutOptions(nesting=NestingOptions(**nesting))


def test_a_bed_without_room_within_its_margins_is_told():
    with pytest.raises(LayoutError, match="The bed of 80 mm x 9 mm leaves nothing within margins"):
        lay_stock(options(), bed(80.0, 9.0).bed, "none")


def test_sheets_lose_their_margins_and_turn_with_their_grain(tmp_path):
    file = written(tmp_path, WHOLE)
    laid = lay_stock(options(stock=file, margin_mm=10.0), bed(260.0, 200.0).bed, "x")
    first, second = laid.kinds.kinds
    assert (first.width, first.height, first.rotations) == (180.0, 130.0, (90, 270))
    assert first.defects[0][0] == (2.0, -6.0)
    assert (second.width, second.height, second.rotations) == (240.0, 180.0, (0, 180))
    assert (laid.main, laid.upright, laid.margin_mm) == (1, True, 10.0)
    across = options(stock=file, grain="none", along_grain="y")
    laid = lay_stock(across, bed(260.0, 200.0).bed, "x")
    assert [kind.rotations for kind in laid.kinds.kinds] == [(0, 180), (0, 90, 180, 270)]


def test_an_axis_to_lie_along_no_fibres_is_refused():
    with pytest.raises(LayoutError, match="The pattern's y axis is to lie along the grain, but"):
        lay_stock(options(along_grain="y"), bed(260.0, 200.0).bed, "none")


@pytest.mark.parametrize(
    ("chosen", "complaint"),
    [
        ({}, r"The sheet 'sheet 2' measures 260 mm x 200 mm and is larger than the bed of 250"),
        ({"margin_mm": 80.0}, "The sheet 'left over' leaves nothing within margins of 80 mm"),
        ({"rotations": (0,)}, "None of the rotations 0 lays the pattern's x axis .*; allow 90 or"),
    ],
)
def test_a_stock_that_cannot_be_laid_is_refused(tmp_path, chosen, complaint):
    file = written(tmp_path, WHOLE)
    with pytest.raises(LayoutError, match=complaint):
        lay_stock(options(stock=file, **chosen), bed(250.0, 200.0).bed, "none")


def test_patches_lie_along_the_fibres_of_every_sheet(tmp_path):
    file = written(tmp_path, WHOLE)
    wanted = LayoutOptions(max_patch_mm=(90.0, 60.0), nesting=NestingOptions(stock=file, grain="x"))
    layout = lay_out(miura(16, 16), bed(260.0, 200.0), card(), options=wanted)
    assert {sheet.stock for sheet in layout.sheets} == {"left over", "sheet 2"}
    for sheet in layout.sheets:
        assert sheet.grain == ("y" if sheet.stock == "left over" else "x")
        along = np.array([[0.0, 1.0]] if sheet.grain == "y" else [[1.0, 0.0]])
        shapes = []
        for placement in sheet.placements:
            patch = layout.patches[placement.patch]
            turn = patch.rotation_deg + placement.rotation_deg
            assert abs((turned(np.array([[1.0, 0.0]]), turn) @ along.T).item()) == 1.0
            shapes.append(shapely.Polygon(placement.from_patch(patch.outline_mm)))
        for ring in sheet.defects_mm:
            assert all(shape.buffer(-1e-5).disjoint(shapely.Polygon(ring)) for shape in shapes)


def test_a_pattern_too_long_along_the_fibres_is_divided_further():
    upright = options(grain="y")
    layout = lay_out(miura(20, 8), bed(260.0, 120.0), card(), options=upright)
    free = lay_out(miura(20, 8), bed(260.0, 120.0), card())
    assert free.totals.patches == 1
    assert layout.totals.patches > 1
    assert all(patch.rotation_deg == 0.0 for patch in layout.patches)
    with pytest.raises(LayoutError, match=r"does not fit|cannot be divided"):
        lay_out(miura(20, 8, 80.0), bed(260.0, 60.0), card(), options=upright)


def test_copies_repeat_every_patch_and_every_stroke():
    pattern, machine = miura(10, 8), bed(300.0, 200.0)
    one = lay_out(pattern, machine, card())
    three = lay_out(pattern, machine, card(), options=options(quantity=3))
    count = len(one.patches)
    assert (three.copies, len(three.patches), one.copies) == (3, 3 * count, 1)
    assert [patch.label for patch in three.patches[:2]] == ["P1-1", "P2-1"][:count] + ["P1-2"] * (
        count == 1
    )
    for patch in three.patches:
        own = one.patches[patch.id % count]
        np.testing.assert_array_equal(patch.outline_mm, own.outline_mm)
        np.testing.assert_array_equal(patch.faces, own.faces)
        assert patch.copy == patch.id // count + 1
        for tab, first in zip(patch.tabs, own.tabs, strict=True):
            assert tab.mate_patch == first.mate_patch + count * (patch.copy - 1)
            assert tab.number == first.number
    for total in ("cut_mm", "perforated_mm", "seam_mm", "tabs", "patches"):
        assert getattr(three.totals, total) == pytest.approx(3 * getattr(one.totals, total))
    placed = sorted(p.patch for sheet in three.sheets for p in sheet.placements)
    assert placed == list(range(3 * count))
    assert [patch.id for patch in three.model.patches] == list(range(count))


def test_the_layout_file_tells_stock_copies_and_what_nested_it(tmp_path):
    file = written(tmp_path, WHOLE)
    wanted = LayoutOptions(
        max_patch_mm=(90.0, 60.0), nesting=NestingOptions(stock=file, quantity=2)
    )
    layout = lay_out(miura(8, 8), bed(260.0, 200.0), card(), options=wanted)
    text = write_layout(layout, "x.fold", "0" * 64)
    assert 1 <= json.loads(text)["totals"]["sheets_bound"] <= len(layout.sheets)
    read = read_layout(text)
    assert read.sheets == layout.sheets
    assert read.totals == layout.totals
    assert read.sheets[0].stock == "left over"
    assert [patch.copy for patch in read.patches] == [patch.copy for patch in layout.patches]
    assert write_layout(read, "x.fold", "0" * 64) == text


@settings(derandomize=True, max_examples=12, deadline=None)
@given(
    st.floats(120.0, 300.0),
    st.floats(120.0, 300.0),
    st.sampled_from(["none", "x", "y"]),
    st.sampled_from(["x", "y"]),
    st.integers(1, 3),
    st.floats(0.0, 12.0),
)
def test_any_bed_grain_and_quantity_gets_a_valid_layout_or_a_refusal(w, h, grain, axis, n, margin):
    axis = None if grain == "none" else axis
    wanted = options(grain=grain, along_grain=axis, quantity=n, margin_mm=margin)
    layout = lay_out(miura(9, 7), bed(w, h), card(), options=wanted)
    for sheet in layout.sheets:
        inside = shapely.box(margin, margin, sheet.width_mm - margin, sheet.height_mm - margin)
        shapes = [
            shapely.Polygon(p.from_patch(layout.patches[p.patch].outline_mm))
            for p in sheet.placements
        ]
        assert all(inside.buffer(1e-5).contains(shape) for shape in shapes)
        for i, one in enumerate(shapes):
            assert all(one.distance(other) >= 2.0 - 1e-5 for other in shapes[:i])
