"""Perforation: dashes that fill a crease exactly, seen from either end."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from flat_patterns import card
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from miurafab.errors import LayoutError
from miurafab.fabrication.perforation import MIN_STROKE_MM, perforate, unbroken


def burnt(length: float, material) -> np.ndarray:
    """(n, 2) from and to of the burnt dashes along a crease, kerf included."""
    along = np.array([0.6, 0.8])
    start = np.array([[3.0, -7.0]])
    dashes = perforate(start, start + length * along, material)
    for points in (dashes.starts, dashes.ends):
        assert np.abs((points - start) @ np.array([-0.8, 0.6])).max() < 1e-9
    half = material.kerf_mm / 2
    first, last = ((points - start) @ along for points in (dashes.starts, dashes.ends))
    return np.column_stack([first - half, last + half])


@settings(derandomize=True, max_examples=300, deadline=None)
@given(
    st.floats(0.5, 200.0),
    st.floats(0.3, 5.0),
    st.floats(0.1, 5.0),
    st.floats(0.0, 3.0),
    st.floats(0.0, 4.0),
    st.floats(0.0, 0.2),
)
def test_dashes_fill_the_crease_exactly_and_symmetrically(length, cut, gap, bridge, least, kerf):
    material = card(cut=cut, gap=gap, end_bridge=bridge, min_end=least, kerf=kerf)
    dashes = burnt(length, material)
    lengths, gaps = np.diff(dashes, axis=1)[:, 0], dashes[1:, 0] - dashes[:-1, 1]
    assert len(dashes) >= 1
    np.testing.assert_allclose(dashes, (length - dashes)[::-1, ::-1], atol=1e-6)
    least = max(least, kerf + MIN_STROKE_MM)
    used = length - 2 * bridge
    assume(abs(used - least) > 1e-9)  # at the step itself rounding decides
    if used < least:
        assert len(dashes) == 1
        if min(least, length / 2) > kerf + MIN_STROKE_MM:
            assert lengths[0] == pytest.approx(min(least, length / 2), abs=1e-6)
        return
    assert dashes[0, 0] == pytest.approx(bridge, abs=1e-6)
    assert length - dashes[-1, 1] == pytest.approx(bridge, abs=1e-6)
    np.testing.assert_allclose(gaps, gap, atol=1e-6)
    np.testing.assert_allclose(lengths[1:-1], cut, atol=1e-6)
    assert lengths[[0, -1]].min() >= least - 1e-6
    if len(dashes) == 1:
        assert used < 2 * least + gap + 1e-6
        assert lengths[0] == pytest.approx(used, abs=1e-6)
    else:
        # As many dashes as there can be: one more would make the ends too short.
        assert least - 1e-6 <= lengths[0] < least + (cut + gap) / 2 + 1e-6
        assert lengths.sum() + gaps.sum() == pytest.approx(used, abs=1e-6)


def test_a_hand_computed_crease():
    # u = 12 - 1.2 = 10.8 = 2 e + 4 cut + 5 gap, so e = (10.8 - 4.8 - 4.0) / 2 = 1.0.
    dashes = burnt(12.0, card(cut=1.2, gap=0.8, end_bridge=0.6, min_end=0.5, kerf=0.15))
    expected = [(0.6, 1.6), (2.4, 3.6), (4.4, 5.6), (6.4, 7.6), (8.4, 9.6), (10.4, 11.4)]
    np.testing.assert_allclose(dashes, expected, atol=1e-9)


def test_the_stroke_drawn_is_shorter_than_the_dash_by_the_kerf():
    start, end = np.zeros((1, 2)), np.array([[12.0, 0.0]])
    wide = perforate(start, end, card(kerf=0.2))
    none = perforate(start, end, card(kerf=0.0))
    drawn = np.linalg.norm(wide.ends - wide.starts, axis=1)
    np.testing.assert_allclose(drawn, np.linalg.norm(none.ends - none.starts, axis=1) - 0.2)


def test_many_creases_at_once_are_each_as_alone():
    rng = np.random.default_rng(7)
    starts, ends = rng.normal(size=(2, 40, 2)) * 30
    together = perforate(starts, ends, card())
    assert (np.diff(together.crease) >= 0).all()
    for k in range(40):
        alone = perforate(starts[k : k + 1], ends[k : k + 1], card())
        np.testing.assert_allclose(together.starts[together.crease == k], alone.starts)
        np.testing.assert_allclose(together.ends[together.crease == k], alone.ends)


def test_no_creases_are_no_dashes():
    assert len(perforate(np.empty((0, 2)), np.empty((0, 2)), card())) == 0


def test_dashes_that_the_kerf_would_fill_are_refused_by_name():
    with pytest.raises(
        LayoutError, match=r"'test-card' asks for dashes of 0\.15 mm.*kerf of 0\.15"
    ):
        perforate(np.zeros((1, 2)), np.ones((1, 2)), card(cut=0.15, kerf=0.15))


@settings(derandomize=True, max_examples=300, deadline=None)
@given(
    st.floats(0.5, 200.0),
    st.floats(0.3, 5.0),
    st.floats(0.1, 5.0),
    st.floats(0.0, 3.0),
    st.floats(0.0, 4.0),
    st.sampled_from(["bridge", "cut"]),
    st.sampled_from(["stretch_cut", "stretch_gap"]),
)
def test_stretched_dashes_are_equal_and_so_are_their_gaps(
    length, cut, gap, bridge, least, ends, fit
):
    material = card(cut=cut, gap=gap, end_bridge=bridge, min_end=least, kerf=0.1)
    rule = dataclasses.replace(material.perforation, start_end=ends, fit=fit)
    dashes = burnt(length, dataclasses.replace(material, perforation=rule))
    lengths, gaps = np.diff(dashes, axis=1)[:, 0], dashes[1:, 0] - dashes[:-1, 1]
    np.testing.assert_allclose(dashes, (length - dashes)[::-1, ::-1], atol=1e-6)
    if len(dashes) == 1:
        return
    bridge = bridge if ends == "bridge" else 0.0
    assert dashes[0, 0] == pytest.approx(bridge, abs=1e-6)
    assert length - dashes[-1, 1] == pytest.approx(bridge, abs=1e-6)
    np.testing.assert_allclose(lengths, lengths[0], atol=1e-6)
    np.testing.assert_allclose(gaps, gaps[0], atol=1e-6)
    if fit == "stretch_cut":
        assert gaps[0] == pytest.approx(gap, abs=1e-6)
        assert lengths[0] >= least - 1e-6
    else:
        assert lengths[0] == pytest.approx(cut, abs=1e-6)
        assert gap - 1e-6 <= gaps[0]
        assert (len(dashes) + 1) * cut + len(dashes) * gap > length - 2 * bridge - 1e-6


def test_each_fit_of_one_crease_by_hand():
    # u = 10.8; centre: see above. 10.8 = 6 c + 5 x 0.8, c = 1.1333; and = 5 x 1.2 + 4 g, g = 1.2.
    def fitted(fit):
        material = card(cut=1.2, gap=0.8, end_bridge=0.6, min_end=0.5)
        rule = dataclasses.replace(material.perforation, fit=fit)
        dashes = burnt(12.0, dataclasses.replace(material, perforation=rule))
        return len(dashes), np.ptp(dashes[0]), dashes[1, 0] - dashes[0, 1]

    assert fitted("stretch_cut") == pytest.approx((6, 6.8 / 6, 0.8))
    assert fitted("stretch_gap") == pytest.approx((5, 1.2, 1.2))


def test_a_score_runs_from_bridge_to_bridge():
    start, end = np.zeros((2, 2)), np.array([[12.0, 0.0], [0.9, 0.0]])
    drawn = unbroken(start, end, card(end_bridge=0.6, kerf=0.1))
    np.testing.assert_allclose(drawn.starts[:, 0], [0.65, 0.275])
    np.testing.assert_allclose(drawn.ends[:, 0], [11.35, 0.625])
