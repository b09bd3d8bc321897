"""Advice on the size of a shell: where a little less saves sheets or all glue.

A size is told if it is at most 5 % smaller and nothing is cut apart any more, or at most 15 %
smaller and the objective of the plan (:mod:`~miurafab.fabrication.plan`) falls by a fifth: four
sheets of one block each are far cheaper than seven with the same shell a little larger. A whole
shell is told how much larger it may be on its sheet. What is told is proven by a whole plan.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.plan import LARGE, MANY, plan_patches, worth_of_sheet
from miurafab.fabrication.plan_size import Sizing
from miurafab.fabrication.sheets import Layout
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import MachineProfile, Material

_NO_GLUE, _LEAST, _DROP = 0.95, 0.85, 0.8
"""The least scales of the two kinds of advice, and the share of J that may be left."""

_MORE = 1.02
"""Less growth is not told."""

_STEPS = 4
"""Bisections between the least scale and 1: to 1 %."""


@dataclass(frozen=True)
class SizeAdvice:
    """At ``scale`` the shell takes ``sheets`` and has ``seam_mm`` of seams."""

    scale: float
    sheets: int
    seam_mm: float


def advised_size(
    pattern: CreasePattern,
    layout: Layout,
    machine: MachineProfile,
    material: Material,
    options: LayoutOptions,
) -> SizeAdvice | None:
    """The size that pays, for the ``layout`` of ``pattern``; None where none does."""
    sizing = Sizing(pattern, machine, material, options)
    totals, copies = layout.totals, options.nesting.quantity
    whole = totals.patches == copies * len(sizing.pieces)
    scale = sizing.bound()
    joins = totals.seam_mm
    if whole:
        grown = totals.sheets == 1 and scale >= _MORE and sizing.holds(scale)
        return SizeAdvice(scale, 1, scale * joins) if grown else None
    chosen = [each for each in layout.alternatives if each.chosen]
    if _NO_GLUE <= scale < 1 and sizing.holds(scale):
        return SizeAdvice(scale, 1, 0.0)
    few = totals.patches <= MANY and len(pattern.faces_vertices) <= LARGE
    full = totals.sheets <= (totals.sheets_bound or 1) and chosen
    if not few or full:
        return None
    worth = worth_of_sheet(sizing.stock, options)

    def planned(at: float) -> tuple[float, SizeAdvice]:
        """J at a scale, and what it takes."""
        given = (sizing.pattern.scaled(at), sizing.stock, sizing.material, options)
        plan = plan_patches(*given)
        (row,) = (each for each in plan.alternatives if each.chosen)
        return worth * row.sheets + row.seam_mm, SizeAdvice(at, row.sheets, row.seam_mm)

    enough = _DROP * (worth * totals.sheets + totals.seam_mm)
    cost, found = planned(_LEAST)
    if cost > enough:
        return None
    fewer = Sizing(pattern, machine, material, options, found.sheets)
    low, high = _LEAST, 1.0
    for _ in range(_STEPS):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if fewer.holds(middle, planned=False) else (low, middle)
    cost, larger = planned(low)
    return larger if cost <= enough else found
