"""Quantities as people write them, turned into floats.

Inside, lengths are millimetres, times seconds, angles radians, and feeds millimetres a minute
(``feed_mm_min``). No other module knows the names of units.
"""

from __future__ import annotations

import math
import re

from miurafab.errors import UnitError

DECIMAL = r"(?:\d++(?:\.\d*+)?|\.\d++)"
"""The pattern of a number without sign and exponent. It matches any digits in one way alone: of
n digits of which each may stand before or after a point that is missing, an expression that fails
behind them tries n ways, and n^2 with two such numbers."""

_QUANTITY = re.compile(rf"([-+]?{DECIMAL}(?:[eE][-+]?\d+)?)\s*+([^\d\s].*)?")

_SHOWN = 60
"""Letters of a text that a sentence repeats."""

# The inch is exactly 25.4 mm (international yard and pound agreement, 1959).
_LENGTHS = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "um": 1e-3, "µm": 1e-3, "in": 25.4, '"': 25.4}
_ANGLES = {"rad": 1.0, "deg": math.pi / 180.0, "°": math.pi / 180.0}
_FEEDS = {"mm/min": 1.0, "mm/s": 60.0, "m/min": 1000.0, "in/min": 25.4, "in/s": 1524.0}
_POWERS = {"w": 1.0, "mw": 1e-3, "kw": 1e3}
_PRESSURES = {"pa": 1.0, "kpa": 1e3, "mpa": 1e6, "gpa": 1e9}


def _parse(text: str | float, units: dict[str, float], bare: str, what: str) -> float:
    if isinstance(text, bool):
        raise UnitError(f"{text!r} is not {what}; write a number with a unit such as {bare!r}.")
    if isinstance(text, int | float):
        value, unit = as_float(text), bare
    else:
        match = _QUANTITY.fullmatch(text.strip())
        if match is None:
            raise UnitError(
                f"{text[:_SHOWN]!r} is not {what}; write a number with one of the units "
                f"{_list(units)}."
            )
        value, unit = float(match.group(1)), (match.group(2) or bare)
        text, unit = text[:_SHOWN], unit[:_SHOWN]
    factor = units.get(unit) if unit in units else units.get(unit.lower())
    if factor is None:
        raise UnitError(f"{text!r} is not {what}: the unit {unit!r} is not one of {_list(units)}.")
    if not math.isfinite(value):
        raise UnitError(f"{text!r} is not {what}: it is not a finite number.")
    return value * factor


def as_float(number: float) -> float:
    """``number`` as a float; infinite for a whole number with more digits than a float has."""
    try:
        return float(number)
    except OverflowError:
        return math.inf


def _list(units: dict[str, float]) -> str:
    return ", ".join(units)


def parse_length(text: str | float) -> float:
    """A length in millimetres; a bare number is millimetres already.

    Raises :class:`~miurafab.errors.UnitError` for anything else than a finite number
    with a unit of length.

    >>> parse_length("0.5in")
    12.7
    """
    return _parse(text, _LENGTHS, "mm", "a length")


def parse_angle(text: str | float) -> float:
    """An angle in radians; a bare number is degrees, as in FOLD. Raises ``UnitError``."""
    return _parse(text, _ANGLES, "deg", "an angle")


def parse_feed(text: str | float) -> float:
    """A feed in millimetres a minute; a bare number is that already. Raises ``UnitError``."""
    return _parse(text, _FEEDS, "mm/min", "a feed")


def parse_pressure(text: str | float) -> float:
    """A modulus or pressure in pascal; a bare number is pascal. Raises ``UnitError``."""
    return _parse(text, _PRESSURES, "pa", "a modulus")


def parse_power(text: str | float) -> float:
    """A power in watts; a bare number is watts. Raises ``UnitError``."""
    return _parse(text, _POWERS, "w", "a power")
