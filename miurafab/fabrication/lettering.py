"""Single-line lettering for engraving: one stroke of the beam per pen stroke of a letter.

The letters are drawn on a grid 4 wide and 6 high, two digits "xy" a point, spaces between the
points of a stroke and commas between strokes. Capital letters, small letters without a part below
the line, digits and ``- . / %``.
"""

from __future__ import annotations

import numpy as np

from miurafab.errors import LayoutError
from miurafab.geometry.arrays import Floats

_HEIGHT = 6.0
_WIDTH = 4.0
_ADVANCE = 6.0

_LETTERS = {
    "0": "10 01 05 16 36 45 41 30 10",
    "1": "05 26 20,00 40",
    "2": "05 16 36 45 44 00 40",
    "3": "05 16 36 45 44 33 13,33 42 41 30 10 01",
    "4": "30 36 02 42",
    "5": "46 06 03 33 42 41 30 10 01",
    "6": "45 36 16 05 01 10 30 41 42 33 13 02",
    "7": "06 46 10",
    "8": "13 04 05 16 36 45 44 33 13 02 01 10 30 41 42 33",
    "9": "01 10 30 41 45 36 16 05 04 13 33 44",
    "A": "00 26 40,12 32",
    "B": "00 06 36 45 44 33 03,33 42 41 30 00",
    "C": "45 36 16 05 01 10 30 41",
    "D": "00 06 26 44 42 20 00",
    "E": "46 06 00 40,03 33",
    "F": "46 06 00,03 33",
    "G": "45 36 16 05 01 10 30 41 43 23",
    "H": "00 06,03 43,46 40",
    "I": "16 36,26 20,10 30",
    "J": "46 41 30 10 01",
    "K": "00 06,46 03 40",
    "L": "06 00 40",
    "M": "00 06 23 46 40",
    "N": "00 06 40 46",
    "O": "10 01 05 16 36 45 41 30 10",
    "P": "00 06 36 45 44 33 03",
    "Q": "10 01 05 16 36 45 41 30 10,22 40",
    "R": "00 06 36 45 44 33 03,23 40",
    "S": "45 36 16 05 04 13 33 42 41 30 10 01",
    "T": "06 46,26 20",
    "U": "06 01 10 30 41 46",
    "V": "06 20 46",
    "W": "06 10 23 30 46",
    "X": "00 46,06 40",
    "Y": "06 23 46,23 20",
    "Z": "06 46 00 40",
    "a": "43 34 14 03 01 10 30 41,44 40",
    "b": "06 00,03 14 34 43 41 30 10 01",
    "c": "43 34 14 03 01 10 30 41",
    "d": "43 34 14 03 01 10 30 41,46 40",
    "e": "02 42 43 34 14 03 01 10 30 41",
    "f": "46 36 25 20,04 44",
    "h": "06 00,03 14 34 43 40",
    "k": "06 00,34 02 40",
    "n": "04 00,03 14 34 43 40",
    "r": "04 00,03 14 34",
    "s": "43 34 14 03 12 32 41 30 10 01",
    "t": "26 21 30 40,04 44",
    "u": "04 01 10 30 41,44 40",
    "w": "04 10 23 30 44",
    "x": "04 40,00 44",
    "z": "04 44 00 40",
    "-": "13 33",
    ".": "20 21",
    "/": "00 46",
    "%": "00 46,05 15 16 06 05,30 40 41 31 30",
}

_STROKES = {
    letter: [
        np.array([[float(digit) for digit in point] for point in stroke.split()])
        for stroke in text.split(",")
    ]
    for letter, text in _LETTERS.items()
}


def text_width(text: str) -> float:
    """The width of ``text`` over its height, without the space after it."""
    return (len(text) * _ADVANCE - (_ADVANCE - _WIDTH)) / _HEIGHT


def text_strokes(text: str) -> list[Floats]:
    """The strokes (n, 2) of ``text``, its capitals of height 1, and centred on the origin.

    Raises :class:`~miurafab.errors.LayoutError` for a character that has no letter.
    """
    strokes = []
    for place, letter in enumerate(text):
        if letter not in _STROKES:
            raise LayoutError(
                f"The label '{text}' holds '{letter}', which cannot be engraved; use capital "
                "letters, the small letters 'abcdefhknrstuwxz', digits and '-./%'."
            )
        middle = np.array([text_width(text) / 2, 0.5])
        shift = np.array([place * _ADVANCE / _HEIGHT, 0.0]) - middle
        strokes += [stroke / _HEIGHT + shift for stroke in _STROKES[letter]]
    return strokes
