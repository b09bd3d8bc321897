"""Patterns of another size: those of other programs often have no unit.

A pattern is as large as the longest side of its folded form, or of its flat form where no folded
form is known.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from miurafab.display import Shown
from miurafab.errors import OptionError, PatternError
from miurafab.options import check_options, length, number, option
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.fitting.request import LARGEST_MM


@dataclass(frozen=True, repr=False)
class ScaleOptions(Shown):
    """The size that a pattern is given."""

    size_mm: float | None = option(
        length(0, LARGEST_MM, above=True),
        "Make the pattern so large: its longest side folded, or flat where the folded form is not "
        "known.",
        group="Size",
        default_text="as it is",
    )
    scale: float | None = option(
        number(0, 1e9, above=True),
        "Make the pattern so many times as large.",
        group="Size",
        default_text="1",
    )

    def __post_init__(self) -> None:
        check_options(self)
        if self.size_mm is not None and self.scale is not None:
            raise OptionError("scale", "and `size` are both given; give one of them")


def scaled(pattern: CreasePattern, wanted: ScaleOptions) -> CreasePattern:
    """``pattern`` as large as ``wanted``; itself where nothing is wanted."""
    if wanted.scale is not None:
        return pattern.scaled(wanted.scale)
    if wanted.size_mm is None:
        return pattern
    longest = size_of(pattern)
    if longest <= 0:
        raise PatternError("The pattern has no extent, so it can have no `size`.")
    return pattern.scaled(wanted.size_mm / longest)


def size_of(pattern: CreasePattern) -> float:
    """How large a pattern is, mm."""
    known = pattern.folded_coords
    points = pattern.vertices_coords if known is None else known
    return float(np.ptp(points, axis=0).max(initial=0.0)) if len(points) else 0.0
