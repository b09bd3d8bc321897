"""A fit as large as the bed allows: size and bed know each other.

The target is fitted at some size, the flat pattern is measured against the sheets, and the target
is fitted again at the size found. A sheet is linear in its size unless a limit in millimetres is
active, such as the shortest edge, so the second fit is the last one nearly always.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from miurafab.errors import LayoutError
from miurafab.fabrication.options import LayoutOptions
from miurafab.files import AnyPath
from miurafab.origami.fitting.fit import fit as fit_request
from miurafab.origami.fitting.request import DEFAULT_SIZE_MM, FitRequest
from miurafab.origami.fitting.result import FitResult
from miurafab.profiles import MachineProfile, Material, read_machine, read_material
from miurafab.workflow.bed_options import BedOptions

_FITS = 4
"""So many fits are made at most."""

_DIGITS = 2
"""Sizes are rounded down to so many decimals of mm."""


def with_stock(layout: LayoutOptions | None, wanted: BedOptions) -> LayoutOptions:
    """``layout`` with the stock that is ``wanted``."""
    options = layout or LayoutOptions()
    if wanted.stock is None:
        return options
    return replace(options, nesting=replace(options.nesting, stock=wanted.stock))


def fit_to_bed(
    request: FitRequest,
    machine: MachineProfile | AnyPath | None,
    material: Material | AnyPath | None,
    wanted: BedOptions,
    layout: LayoutOptions | None,
    on_progress: Callable[[float, str], None] | None,
) -> FitResult:
    """The fit of ``request`` at the largest size that the sheets allow; ``layout`` is what is asked
    of them. The result may be a fit that found no sheet.

    Raises :class:`~miurafab.errors.LayoutError` if no size can be found.
    """
    from miurafab.fabrication.plan_size import Sizing  # only now: it loads the whole layout

    profile, card = read_machine(machine), read_material(material)
    options = with_stock(layout, wanted)
    size = DEFAULT_SIZE_MM
    for number in range(_FITS):
        result = fit_request(replace(request, size_mm=size), on_progress)
        if result.pattern is None or result.status == "interrupted":
            return result
        sizing = Sizing(result.pattern, profile, card, options, wanted.sheets or 1)
        if number and sizing.holds():
            return result
        found = size * sizing.largest_scale()
        size = math.floor(found * 10**_DIGITS) / 10**_DIGITS
    raise LayoutError(
        f"No `size` was found at which the sheet that is fitted then fits; about {size:g} mm fit."
    )
