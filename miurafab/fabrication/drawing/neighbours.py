"""How a patch is joined to its neighbours, in sentences for its card in the guide."""

from __future__ import annotations

from miurafab.fabrication.drawing.page import tabs_called
from miurafab.fabrication.drawing.views import Views

_JOINED = {
    "glue": ("under", "Over {tabs} of {mate}"),
    "slots": ("into the slots of", "Slots for {tabs} of {mate}"),
    "double": ("onto those of", ""),
}
"""The words between the tabs of a patch and its mate, and those for the tabs of the mate."""


def neighbours(views: Views, patch: int) -> list[str]:
    """A sentence for each neighbour of ``patch`` and each side that bears the tabs."""
    own: dict[int, list[str]] = {}
    others: dict[int, list[str]] = {}
    patches = views.layout.patches
    free = [tab.label for tab in patches[patch].tabs if tab.mate_patch is None]
    for tab in patches[patch].tabs:
        if tab.mate_patch is not None:
            own.setdefault(tab.mate_patch, []).append(tab.label)
    for other in patches:
        for tab in other.tabs:
            if tab.mate_patch == patch and other.id != patch:
                others.setdefault(other.id, []).append(tab.label)
    ours, theirs = _JOINED[views.join]
    found = []
    for mate, labels in sorted(own.items()):
        other_side = "its own far border" if mate == patch else patches[mate].label
        found.append(f"{tabs_called(labels).capitalize()} {ours} {other_side}")
    found += [
        theirs.format(tabs=tabs_called(labels), mate=patches[mate].label)
        for mate, labels in sorted(others.items())
        if theirs
    ]
    if free:
        found.append(f"{tabs_called(free).capitalize()} to the base or frame")
    return found or ["Stands alone: nothing is joined to it."]
