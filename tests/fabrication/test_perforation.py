"""Perforation: dashes that fill a crease exactly, seen from either end."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from flat_patterns import card
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from miurafab.errors import LayoutError
from miurafab.fabrication.perforation import MIN_STROKE_MM, burnt_shares, perforate, unbroken
from miurafab.profiles.material import FITS


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


def worked_out(length, rule, kerf, slack):
    """[(from, to), ...] the burnt dashes along one crease, each number of dashes tried in turn."""
    used, cut, gap, bridge = length - 2 * rule.bridge_mm, rule.cut_mm, rule.gap_mm, rule.bridge_mm
    least = max(rule.min_end_mm, kerf + MIN_STROKE_MM)

    def lengths(n):
        if rule.fit == "centre":
            return (used - (n - 2) * cut - (n - 1) * gap) / 2, cut, gap
        if rule.fit == "stretch_cut":
            return (used - (n - 1) * gap) / n, (used - (n - 1) * gap) / n, gap
        return cut, cut, (used - n * cut) / (n - 1)

    tried = {n: lengths(n) for n in range(2, 200)}
    if rule.fit == "stretch_gap":
        allowed = [n for n in tried if tried[n][2] >= gap - slack and used >= rule.min_end_mm]
    else:
        allowed = [n for n in tried if tried[n][0] >= least - slack]
    if rule.fit == "stretch_cut" and allowed:
        allowed.append(1)
        allowed = [min(allowed, key=lambda n: abs(n * (cut + gap) - (used + gap) - slack))]
    count = max(allowed, default=1)
    if count == 1:
        least = max(rule.min_end_mm, MIN_STROKE_MM)
        alone = used if used >= least else min(least, length / 2)
        return [((length - alone) / 2, (length + alone) / 2)]
    end, inner, space = tried[count]
    dashes, at = [], bridge
    for k in range(count):
        dashes.append((at, at + (end if k in (0, count - 1) else inner)))
        at = dashes[-1][1] + space
    return dashes


def strokes(dashes, kerf):
    """The strokes that burn ``dashes``: half a kerf shorter at both ends, but never a dot."""
    drawn = []
    for start, end in dashes:
        size = max(end - start - kerf, min(end - start, MIN_STROKE_MM))
        drawn.append(((start + end - size) / 2, (start + end + size) / 2))
    return np.array(drawn)


@settings(derandomize=True, max_examples=400, deadline=None)
@given(
    st.floats(0.05, 30.0),
    st.floats(0.3, 5.0),
    st.floats(0.1, 5.0),
    st.floats(0.0, 3.0),
    st.floats(0.0, 4.0),
    st.floats(0.0, 0.25),
    st.sampled_from(["bridge", "cut"]),
    st.sampled_from(FITS),
)
@example(4.0, 0.3, 0.1, 0.5, 4.0, 0.1, "bridge", "stretch_gap")  # its dashes once lay crosswise
def test_each_fit_is_the_one_that_trying_all_counts_finds(
    length, cut, gap, bridge, least, kerf, ends, fit
):
    material = card(cut=cut, gap=gap, end_bridge=bridge, min_end=least, kerf=kerf)
    rule = dataclasses.replace(material.perforation, start_end=ends, fit=fit)
    expected = worked_out(length, rule, kerf, 1e-7)
    # At a step from one count to the next rounding decides.
    assume(len(worked_out(length, rule, kerf, -1e-7)) == len(expected))
    assume(abs(length - 2 * rule.bridge_mm - max(least, MIN_STROKE_MM)) > 1e-9)
    start, along = np.array([[3.0, -7.0]]), np.array([0.6, 0.8])
    material = dataclasses.replace(material, perforation=rule)
    dashes = perforate(start, start + length * along, material)
    drawn = np.column_stack([(at - start) @ along for at in (dashes.starts, dashes.ends)])
    np.testing.assert_allclose(drawn, strokes(expected, kerf), atol=1e-9)
    flat = drawn.ravel()
    assert (np.diff(flat) > 0).all(), "each stroke forwards, and none over another"
    assert -1e-12 < flat[0] < flat[-1] < length + 1e-12
    shares = burnt_shares(dashes, np.array([length]), kerf)
    assert shares == pytest.approx((flat[1::2] - flat[::2] + kerf).sum() / length)


@pytest.mark.parametrize("fit", FITS)
def test_dashes_that_fit_exactly_are_all_there(fit):
    """Rounding takes none away: n dashes of ``cut`` and n - 1 gaps of ``gap``, for each n."""
    cut, gap, bridge = 1.1, 0.7, 0.3
    material = card(cut=cut, gap=gap, end_bridge=bridge, min_end=cut)
    rule = dataclasses.replace(material.perforation, fit=fit)
    material = dataclasses.replace(material, perforation=rule)
    for n in range(1, 150):
        period = np.arange(n) * (cut + gap) + bridge
        dashes = burnt(2 * bridge + n * cut + (n - 1) * gap, material)
        np.testing.assert_allclose(dashes, np.column_stack([period, period + cut]), atol=1e-9)


def test_the_steps_stand_where_they_are_said_to_stand():
    """A dash of just min_end, and of just what a kerf can draw, by numbers exact in binary."""

    def along_x(length, material, **changed):
        rule = dataclasses.replace(material.perforation, **changed)
        material = dataclasses.replace(material, perforation=rule)
        dashes = perforate(np.zeros((1, 2)), np.array([[length, 0.0]]), material)
        return np.column_stack([dashes.starts[:, 0], dashes.ends[:, 0]])

    long = card(end_bridge=0.25, min_end=1.5, kerf=0.0)
    assert along_x(2.0, long).tolist() == [[0.25, 1.75]]
    two = along_x(2.0, long, fit="stretch_gap", cut_mm=0.5, gap_mm=0.5)
    assert two.tolist() == [[0.25, 0.75], [1.25, 1.75]]
    least = 0.1 + MIN_STROKE_MM
    inner = along_x(12.0, card(cut=least, kerf=0.1))[1:-1]
    np.testing.assert_allclose(np.diff(inner, axis=1), MIN_STROKE_MM, atol=1e-12)


def test_each_crease_has_its_own_share():
    """Creases of one and of two dashes, by hand: (1.2 + 1.2) / 4.4 and 0.9 / 2.1."""
    starts = np.array([[5.0, 1.0], [5.0, 1.0]])
    ends = starts + np.array([[4.4, 0.0], [0.0, 2.1]])
    material = card(cut=1.2, gap=0.8, end_bridge=0.6, min_end=0.9, kerf=0.1)
    dashes = perforate(starts, ends, material)
    assert dashes.crease.tolist() == [0, 0, 1]
    shares = burnt_shares(dashes, np.array([4.4, 2.1]), 0.1)
    np.testing.assert_allclose(shares, [2.4 / 4.4, 0.9 / 2.1])


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
    start = np.array([[5.0, 1.0], [5.0, 1.0], [5.0, 1.0]])
    drawn = unbroken(start, start + np.array([[12.0, 0], [0.9, 0], [0, 0.08]]), card(kerf=0.1))
    np.testing.assert_allclose(drawn.starts - start, [[0.65, 0], [0.275, 0], [0, 0.02]], atol=1e-12)
    np.testing.assert_allclose(drawn.ends - start, [[11.35, 0], [0.625, 0], [0, 0.06]], atol=1e-12)
