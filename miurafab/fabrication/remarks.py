"""What a layout could not have as it was wanted, each in a sentence: never silently."""

from __future__ import annotations

import numpy as np

from miurafab.fabrication.labels import Lettering
from miurafab.fabrication.nesting import Nesting
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.patch_frame import FramedPatches
from miurafab.fabrication.strokes import Drawn
from miurafab.fabrication.wording import count
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import Material

_NAMED = 8
"""Of more things than this the first are named by number."""


def remarks_on(
    pattern: CreasePattern,
    framed: FramedPatches,
    nesting: Nesting,
    lettering: Lettering,
    drawn: Drawn,
    material: Material,
    options: LayoutOptions,
) -> tuple[str, ...]:
    """The sentences on one layout."""
    tabs, numbers = framed.outlined.tabs, framed.numbers
    found = []
    weak = np.sort(numbers[tabs.areas < material.tabs.min_area_mm2]).tolist()
    if weak:
        named = ", ".join(str(number) for number in weak[:_NAMED])
        more = f" and {len(weak) - _NAMED} more" if len(weak) > _NAMED else ""
        found.append(
            f"{len(weak)} of {count(len(numbers), 'tab has', 'tabs have')} less than "
            f"{material.tabs.min_area_mm2:g} mm2 of glue: number {named}{more}."
        )
    if lettering.unmarked:
        texts = count(lettering.unmarked, "tab has", "tabs have")
        found.append(f"{texts} no room for the letter of {_its(lettering.unmarked)} fold.")
    if drawn.unrelieved:
        places = count(drawn.unrelieved, "vertex", "vertices")
        found.append(f"At {places} a crease is too short for a relief hole.")
    if drawn.unbridged:
        outlines = count(drawn.unbridged, "outline has", "outlines have")
        found.append(
            f"{outlines} no room for {options.bridges} holding bridges of "
            f"{options.bridge_mm:g} mm: a side that bears one must be over three times as long."
        )
    if not nesting.finished:
        found.append(
            "The nesting reached its limit of work before it had tried every order of the patches; "
            "fewer sheets may be possible. Lay out fewer copies at a time with `quantity`."
        )
    open_folds = int((pattern.edges_assignment == "U").sum())
    if open_folds:
        found.append(
            f"{count(open_folds, 'crease is', 'creases are')} neither mountain nor valley in the "
            "pattern."
        )
    return tuple(found)


def _its(number: int) -> str:
    return "its" if number == 1 else "their"
