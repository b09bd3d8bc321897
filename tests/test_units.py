"""Quantities at the edge: what people write, and what they must be told."""

import contextlib
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from miurafab.errors import UnitError
from miurafab.units import parse_angle, parse_feed, parse_length, parse_pressure


@pytest.mark.parametrize(
    ("parse", "text", "value"),
    [
        (parse_length, "3mm", 3.0),
        (parse_length, "0.5in", 12.7),
        (parse_length, ' 2 " ', 50.8),
        (parse_length, "8", 8.0),
        (parse_length, 8, 8.0),
        (parse_length, "1e2 cm", 1000.0),
        (parse_length, ".5M", 500.0),
        (parse_angle, "180deg", math.pi),
        (parse_angle, "90°", math.pi / 2),
        (parse_angle, 45, math.pi / 4),
        (parse_angle, "45", math.pi / 4),
        (parse_angle, "0.5rad", 0.5),
        (parse_feed, "20mm/s", 1200.0),
        (parse_feed, "1200mm/min", 1200.0),
        (parse_pressure, "3GPa", 3e9),
    ],
)
def test_what_people_write(parse, text, value):
    assert parse(text) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize("text", ["", "mm", "3 parsec", "three", "3mm mm", "--3mm", True, "1e999"])
def test_what_is_refused_is_named(text):
    with pytest.raises(UnitError, match=r"is not a length") as refused:
        parse_length(text)
    assert repr(text) in str(refused.value)


@given(st.floats(-1e9, 1e9), st.sampled_from([("mm", 1.0), ("cm", 10.0), ("in", 25.4)]))
def test_a_number_with_its_unit_is_that_many_units(number, unit):
    name, factor = unit
    assert parse_length(f"{number!r}{name}") == pytest.approx(number * factor, rel=1e-15)


@given(st.text(max_size=12))
def test_any_text_is_a_length_or_a_unit_error(text):
    with contextlib.suppress(UnitError):
        assert math.isfinite(parse_length(text))
