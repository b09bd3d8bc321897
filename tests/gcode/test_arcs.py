"""Arcs as chords: on the circle, within the tolerance, the right way round."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from miurafab.gcode.arcs import arc_chords, centre_from_radius, chord_count

radii = st.floats(0.1, 200)
angles = st.floats(0.05, 2 * math.pi - 0.05)


@given(radii, angles, st.floats(0, 6.28), st.booleans(), st.floats(0.001, 0.1), st.floats(-5, 5))
def test_chords_end_on_the_circle_and_stay_near_it(
    radius: float, angle: float, first: float, clockwise: bool, tolerance: float, climb: float
) -> None:
    turn = -angle if clockwise else angle
    start = [radius * math.cos(first), radius * math.sin(first), 0.0]
    end = [radius * math.cos(first + turn), radius * math.sin(first + turn), climb]
    centre = [-start[0], -start[1], 0.0]
    count, ends = arc_chords(start, end, centre, radius, (0, 1, 2), clockwise, tolerance)
    assert len(ends) == max(count, 1)
    assert ends[-1] == end
    for index, (x, y, z) in enumerate(ends[:-1], 1):
        assert math.hypot(x, y) == pytest.approx(radius)
        assert math.remainder(math.atan2(y, x) - first - turn * index / count, math.tau) == (
            pytest.approx(0, abs=1e-9)
        )
        assert z == pytest.approx(climb * index / count)
    if count:
        # One chord fewer than exactly fits is what rounding down may cost.
        exact = (count + 1) / count * angle / (count + 1)
        sagitta = radius * (1 - math.cos(exact / 2))
        assert sagitta <= tolerance * ((count + 1) / count) ** 2 * 1.01 + 1e-12


@given(radii, st.floats(0.1, math.pi - 0.1), st.booleans(), st.booleans())
def test_a_radius_finds_the_centre_of_the_short_or_the_long_arc(
    radius: float, half: float, clockwise: bool, long: bool
) -> None:
    chord = 2 * radius * math.sin(half / 2)
    centre = centre_from_radius(chord, 0.0, -radius if long else radius, clockwise)
    assert centre is not None
    assert math.hypot(*centre) == pytest.approx(radius)
    assert centre[0] == pytest.approx(chord / 2)
    # The centre of a short counterclockwise arc lies to the left of the chord.
    assert (centre[1] > 0) == (clockwise == long)


def test_what_has_no_chord_is_a_line() -> None:
    assert centre_from_radius(10.0, 0.0, 4.9, False) is None
    assert chord_count(math.pi, 0.001, 0.002) == 0
    assert chord_count(math.pi, 10.0, 0.0) == 0
    assert arc_chords([0, 0, 0], [0, 0, 1], [math.nan] * 3, 1.0, (0, 1, 2), True, 0.002) == (
        0,
        [[0, 0, 1]],
    )


def test_a_full_turn_goes_round() -> None:
    count, ends = arc_chords([1, 0, 0], [1, 0, 0], [-1, 0, 0], 1.0, (0, 1, 2), False, 0.002)
    assert count > 40
    assert min(x for x, _, _ in ends) == pytest.approx(-1, abs=0.01)
