"""Kerf compensation: what the beam leaves is the nominal piece."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from flat_patterns import bed, card, zigzag
from hypothesis import example, given, settings
from hypothesis import strategies as st

from miurafab.fabrication.drawing.views import edge_letters
from miurafab.fabrication.kerf import SHORTEST_MM, allowance, cut_lines
from miurafab.fabrication.partition.patch_outline import outline_patches
from miurafab.fabrication.sheets import lay_out
from miurafab.profiles import OPERATIONS
from miurafab.profiles.material import Crease


def test_a_rectangle_grows_by_half_a_kerf_on_each_side():
    outline = np.array([[0, 0], [40, 0], [40, 20], [0, 20]], dtype=float)
    (line,) = cut_lines([[outline]], 0.2)[0]
    expected = shapely.box(-0.1, -0.1, 40.1, 20.1).normalize()
    assert shapely.Polygon(line).normalize().equals_exact(expected, 1e-9)
    assert shapely.Polygon(line).exterior.is_ccw


def test_no_kerf_leaves_the_outline_as_it_is():
    outline = np.array([[0, 0], [40, 0], [40, 20]], dtype=float)
    np.testing.assert_array_equal(cut_lines([[outline]], 0.0)[0][0], outline)


@settings(derandomize=True, max_examples=25, deadline=None)
@given(st.floats(0.35, 1.5), st.floats(0.01, 0.4))
@example(1.015625, 0.125)  # two tabs of which the feet are 0.058 mm apart
def test_the_beam_burns_up_to_the_piece_and_never_into_it(sector, kerf):
    pattern = zigzag(8, 8, a=15.0, sector=sector)
    for piece in outline_patches(pattern, 100.0, 75.0, card(kerf=kerf, inset=0.5)).patches:
        nominal = shapely.Polygon(piece.rings[0], piece.rings[1:])
        outer, *waste = piece.cut_lines
        path = shapely.LineString(np.concatenate([outer, outer[:1]]))
        assert path.distance(nominal) == pytest.approx(kerf / 2, abs=1e-9)
        sides = shapely.linestrings(np.stack([outer, np.roll(outer, -1, axis=0)], axis=1))
        straight = shapely.distance(sides, nominal) <= kerf / 2 + 1e-9
        assert shapely.length(sides[straight]).sum() >= 0.95 * path.length
        assert shapely.distance(shapely.points(outer), nominal).max() <= allowance(kerf) + 1e-9
        assert shapely.length(sides).min() >= SHORTEST_MM - 1e-9
        assert not waste


@pytest.mark.parametrize("kerf", [0.03, 0.15, 0.3])
@pytest.mark.parametrize("apex", [59.9, 58.0, 55.0])
def test_a_mitre_that_is_cut_off_ends_in_no_speck(kerf, apex):
    half = np.radians(apex / 2)
    corner = np.array([[0.0, 0.0], [30 * np.sin(half), 30 * np.cos(half)]])
    outline = np.array([corner[1] * [-1, 1], corner[0], corner[1]])
    (line,) = cut_lines([[outline]], kerf)[0]
    low = line[line[:, 1] < 0]
    tip = -kerf / 2 / np.sin(half)
    wide = np.ptp(low[:, 0])
    assert wide == pytest.approx(0) or wide >= SHORTEST_MM - 1e-9
    # Its ends lie on the sides that are kerf / 2 away, up to their meeting point.
    assert np.abs(low[:, 0]) == pytest.approx((low[:, 1] - tip) * np.tan(half))
    assert low[:, 1].max() <= -kerf / 2


def test_a_chamfer_that_is_drawn_stays():
    """Its ends are no mitre and no corner into the piece."""
    outline = np.array([[0, 0], [20, 0], [20, 20], [0.02, 20], [0, 19.98]], dtype=float)
    (line,) = cut_lines([[outline]], 0.2)[0]
    assert len(line) == 5
    assert shapely.distance(shapely.points(line), shapely.Polygon(outline)).min() >= 0.1 - 1e-9


def test_waste_enclosed_by_a_narrow_mouth_is_cut_out_too():
    # A pocket whose mouth is 0.1 mm wide: with a kerf of 0.4 the mouth closes.
    outline = np.array(
        [[0, 0], [30, 0], [30, 20], [15.1, 20], [15.1, 15], [20, 15], [20, 5], [10, 5], [10, 15],
         [15, 15], [15, 20], [0, 20]], dtype=float,
    )  # fmt: skip
    outer, waste = cut_lines([[outline]], 0.4)[0]
    assert shapely.Polygon(outer).contains(shapely.Polygon(waste))
    assert shapely.Polygon(waste).area == pytest.approx(9.6 * 9.6)


def test_pens_and_knives_take_nothing_away():
    laser = bed(300.0, 300.0)
    pattern = zigzag(4, 4)
    knife, pen = (replace(laser, tool=replace(laser.tool, kind=kind)) for kind in ("knife", "pen"))
    made, drawn, plain, burnt = (
        lay_out(pattern, machine, card(kerf=kerf)).toolpaths[0]
        for machine, kerf in ((knife, 0.3), (pen, 0.3), (laser, 0.0), (laser, 0.3))
    )
    np.testing.assert_array_equal(made.points, plain.points)
    assert not np.array_equal(made.points, burnt.points)
    assert drawn.length_of("cut") == pytest.approx(plain.length_of("cut"))


def test_a_pen_draws_mountains_as_lines_and_valleys_dashed():
    laser = bed(120.0, 90.0)
    pen = replace(laser, tool=replace(laser.tool, kind="pen"))
    pattern = zigzag(12, 8, a=14.0)  # too large for the bed
    layout = lay_out(pattern, pen, card())
    letters = edge_letters(layout, pattern)
    assert layout.totals.tabs > 0
    strokes = {}
    for path in layout.toolpaths:
        for k in np.flatnonzero(path.edge >= 0).tolist():
            strokes.setdefault(int(path.edge[k]), []).append(OPERATIONS[path.operation[k]])
    for edge, made in strokes.items():
        if letters[edge] == "V":
            assert set(made) == {"perforate"}
            assert len(made) >= 2
        else:
            assert made == ["score"]
    assert {str(letters[edge]) for edge in strokes} == {"M", "V"}
    # What the material says is drawn as it says.
    own = {"mountain": Crease(), "valley": Crease("score"), "tab": Crease("none")}
    (path,) = lay_out(zigzag(4, 4), pen, replace(card(), creases=own)).toolpaths
    assert path.length_of("perforate") == 0 < path.length_of("score")
