"""The size of a shell by the bed: how many times as large a pattern may be on so many sheets.

A pattern is linear in its size: scaled, it is the pattern of the scaled target. So no size needs a
fit of its own. On one sheet nothing is cut apart: each piece of the pattern lies on it whole.
Without tabs on its border, the largest scale of one piece is a closed form
(:func:`~miurafab.fabrication.partition.fit_box.scale_to_fit`). Tabs do not grow with the pattern,
and several pieces are nested: there the closed form is an upper bound, and the scale is bisected
below it. On several sheets the scale is bisected below the bound by area. Each step nests the
splits of a plan by its first pass; the size that is found is proven by a whole plan
(:mod:`~miurafab.fabrication.plan`).
"""

from __future__ import annotations

import math

import numpy as np

from miurafab.errors import LayoutError
from miurafab.fabrication.caps import capped
from miurafab.fabrication.open_ring import opened
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.fit_box import scale_to_fit
from miurafab.fabrication.partition.patch_frame import sheet_space
from miurafab.fabrication.partition.patch_outline import patch_space
from miurafab.fabrication.partition.pieces import hanging_together
from miurafab.fabrication.partition.split import split
from miurafab.fabrication.plan import fits_on, plan_patches
from miurafab.fabrication.sheets import worked
from miurafab.fabrication.stock import lay_stock
from miurafab.fabrication.wording import count
from miurafab.geometry.polygons import filled, signed_areas
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import MachineProfile, Material

_FINE, _ROUGH = 2e-4, 3e-3
"""The relative error of a scale that is bisected on one sheet, and on several."""

_SAFE = 1 - 1e-7
"""A scale of closed form is made so much smaller, so that rounding decides nothing."""

_SAFER = 0.98
"""The step to a size for which the plan, which weighs glue, takes the sheets as well."""

_SMALLER, _TIMES = 0.8, 12
"""A scale that allows a layout is looked for in so many such steps below the bound."""


class Sizing:
    """One pattern and what it is cut from: ``sheets`` sheets of a machine and a material."""

    def __init__(
        self,
        pattern: CreasePattern,
        machine: MachineProfile,
        material: Material,
        options: LayoutOptions,
        sheets: int = 1,
    ) -> None:
        self.pattern = capped(opened(pattern, options), options)
        self.material, self.options, self.sheets = (
            worked(material, machine, options),
            options,
            sheets,
        )
        self.stock = lay_stock(options, machine.bed, self.material.grain)
        self.room = patch_space(sheet_space(self.stock), self.material, options)
        self.pieces = hanging_together(self.pattern)

    def largest_scale(self) -> float:
        """The largest s for which the pattern, s times as large, can be cut from the sheets.

        Raises :class:`~miurafab.errors.LayoutError` if it cannot at any size.
        """
        if self.sheets > 1:
            corners = self.pattern.vertices_coords[filled(self.pattern.faces_vertices)]
            area = float(np.abs(signed_areas(corners)).sum()) * self.options.nesting.quantity
            largest = max(kind.area for kind in self.stock.kinds.kinds)
            return self.bisected(math.sqrt(self.sheets * largest / area), _ROUGH)
        return self.bisected(self.bound(), _FINE)

    def bound(self) -> float:
        """The largest scale at which each piece fits whole without the tabs on its border."""
        coords = (piece.pattern.vertices_coords for piece in self.pieces)
        return _SAFE * min(scale_to_fit(each, self.room) for each in coords)

    def holds(self, scale: float = 1.0, *, planned: bool = True) -> bool:
        """Whether the pattern, ``scale`` times as large, can be cut from the sheets; as it is
        ``planned``, or by any split.
        """
        scaled = self.pattern.scaled(scale)
        given = (scaled, self.stock, self.material, self.options)
        try:
            if self.sheets == 1 and not self.whole(scaled):
                return False
            if planned:
                return plan_patches(*given).nesting.sheets <= self.sheets
            return fits_on(*given, self.sheets)
        except LayoutError:
            return False  # A facet is larger than the bed, or the stock does not suffice.

    def whole(self, pattern: CreasePattern) -> bool:
        """Whether each piece can be one patch."""
        sides, turns = (self.room.width, self.room.height), self.room.turns
        found = split(pattern, *sides, self.material, self.options, turns=turns, improve=False)
        return int(found.max()) + 1 == len(self.pieces)

    def bisected(self, bound: float, step: float) -> float:
        """The largest scale up to ``bound`` that holds, within a relative ``step``."""
        if self.holds(bound, planned=False) and self.holds(bound):
            return bound
        high = low = bound
        for _ in range(_TIMES):
            low *= _SMALLER
            if self.holds(low, planned=False):
                break
            high = low
        else:
            raise LayoutError(
                f"At no size can the shell be cut from {count(self.sheets, 'sheet', 'sheets')}; "
                "take more sheets, or a larger bed."
            )
        while high > (1 + step) * low:
            middle = math.sqrt(low * high)
            if self.holds(middle, planned=False):
                low = middle
            else:
                high = middle
        while not self.holds(low):
            low *= _SAFER  # The plan takes less glue and one sheet more.
        return low
