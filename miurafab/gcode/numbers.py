"""Numbers as the firmware reads and stores them: 32-bit floats of at most eight digits.

An 8-bit controller reads the first eight digits of a word as one integer and scales it by
hundredths and tenths in single precision (``nuts_bolts.c``). The simulator must round the same way;
a program that is only read back uses ``float``.
"""

from __future__ import annotations

import math
from struct import Struct

_DIGITS = 8
_pack, _unpack = Struct("=f").pack, Struct("=f").unpack


def single(value: float) -> float:
    """``value`` rounded to the nearest 32-bit float; infinity beyond its range."""
    try:
        rounded: float = _unpack(_pack(value))[0]
    except OverflowError:
        return math.copysign(math.inf, value)
    return rounded


def read_single(text: str) -> float:
    """The value that the firmware reads from ``text``: a sign, digits, at most one point."""
    whole, _, fraction = text.lstrip("+-").partition(".")
    digits = whole + fraction
    value = single(float(int(digits[:_DIGITS])))
    shift = len(whole) - min(len(digits), _DIGITS)
    if value:
        while shift <= -2:
            value = single(value * single(0.01))
            shift += 2
        if shift == -1:
            value = single(value * single(0.1))
        for _ in range(shift):
            value = single(value * 10.0)
    return -value if text.startswith("-") else value


def whole_byte(value: float) -> int:
    """``trunc(value)`` stored in one byte, as the firmware does."""
    return to_unsigned(value) & 0xFF


def to_unsigned(value: float) -> int:
    """``value`` cast to 32 unsigned bits: negative numbers wrap, larger magnitudes give 0.

    Source: avr-libc ``fixunssfsi``.
    """
    if value != value or abs(value) >= 2.0**32:
        return 0
    return int(value) & 0xFFFFFFFF
