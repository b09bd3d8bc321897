"""The gauge: wedges of paper that stand in a fold, and say whether it is folded far enough.

A crease with the fold angle rho leaves an opening of 180 degrees - rho between its two facets. A
wedge with that angle at its tip fills the opening. The angle of a line is the median over its
creases. Lines are taken in the order of their angles, and a wedge serves all lines within
:data:`STEP_DEG` of the first of them; its tip has the middle of their angles. So no line is farther
than half a step from its wedge. With more than :data:`MOST` wedges the step is doubled.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from miurafab.fabrication.kit.rows import Row

STEP_DEG = 5.0
"""Paper springs back by some degrees (judged), so a finer gauge would say nothing more."""
MOST = 8
"""So many wedges fit a page."""
FLAT_DEG = 175.0
"""A fold that is larger is pressed flat: no wedge would go in."""


@dataclass(frozen=True)
class Wedge:
    """A wedge with the angle ``opening_deg`` at its tip, for the lines called ``rows``."""

    opening_deg: float
    rows: tuple[str, ...]


def wedges(rows: Sequence[Row]) -> tuple[Wedge, ...]:
    """The wedges for all ``rows`` that are not pressed flat, the narrowest first."""
    found = sorted((180.0 - row.median_deg, row.name) for row in rows if row.median_deg <= FLAT_DEG)
    step = STEP_DEG
    while len(groups := _groups(found, step)) > MOST:
        step *= 2
    order = {row.name: place for place, row in enumerate(rows)}
    return tuple(
        Wedge(
            round((group[0][0] + group[-1][0]) / 2, 1),
            tuple(sorted((name for _, name in group), key=order.__getitem__)),
        )
        for group in groups
    )


def _groups(found: list[tuple[float, str]], step: float) -> list[list[tuple[float, str]]]:
    groups: list[list[tuple[float, str]]] = []
    for each in found:
        if groups and each[0] - groups[-1][0][0] <= step:
            groups[-1].append(each)
        else:
            groups.append([each])
    return groups
