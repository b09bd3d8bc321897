"""Numbers and words as matrices of bytes, a row for each line, to write 100,000 lines at once.

Nearly all lines of a job look alike, so they are one matrix, a row a line and a column range a
field, filled by looking up tables of digits. What a field leaves over is zero, and the zeros are
struck out at the end.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from miurafab.errors import LayoutError
from miurafab.geometry.arrays import Ints

LINE_CHARS = 70
"""The longest line written, comments included."""

ByteRows = NDArray[np.uint8]
_COMMENT = re.compile(r"[ -~]*")
# Ends of comments, and what senders or controllers obey even inside one.
_NOT_IN_COMMENT = frozenset("()!?~;%")


def table(texts: Sequence[str]) -> ByteRows:
    """(len(texts), width) ASCII, short rows filled with zeros."""
    padded = np.array([text.encode("ascii") for text in texts], dtype=np.bytes_)
    return padded.view(np.uint8).reshape(len(texts), -1)


# A bed is at most 20 m, so five digits before the point are enough.
_WHOLE = table([str(value) for value in range(20_001)])
_THOUSANDTHS = table([f".{value:03d}".rstrip(".0") for value in range(1000)])


def absolute_number(microns: Ints) -> ByteRows:
    """(n, width) micrometres written in mm, without trailing zeros."""
    whole, rest = np.divmod(microns, 1000)
    return np.concatenate([_WHOLE[whole], _THOUSANDTHS[rest]], axis=1)


_WHOLE_UNLESS_ZERO = table([str(value) if value else "" for value in range(20_001)])


def relative_number(microns: Ints) -> ByteRows:
    """(n, width) signed micrometres written in mm, in the shortest form that controllers read."""
    whole, rest = np.divmod(np.abs(microns), 1000)
    sign = table(["", "-"])[(microns < 0).astype(np.int64)]
    return np.concatenate([sign, _WHOLE_UNLESS_ZERO[whole], _THOUSANDTHS[rest]], axis=1)


def trimmed(value: float) -> str:
    return f"{value:.3f}".rstrip("0").rstrip(".")


def comment(key: str, value: str) -> str:
    line = f"({key} {value})"
    if not _COMMENT.fullmatch(value) or _NOT_IN_COMMENT.intersection(value):
        raise LayoutError(
            f"The {key} name {value!r} cannot stand in G-code; use ASCII without "
            f"{' '.join(sorted(_NOT_IN_COMMENT))}."
        )
    if len(line) > LINE_CHARS:
        raise LayoutError(
            f"The {key} name {value!r} is too long for G-code; use at most "
            f"{LINE_CHARS - len(key) - 3} characters."
        )
    return line + "\n"
