"""The sizes of the pages of printers, by name or by measure."""

from __future__ import annotations

from miurafab.errors import InputError
from miurafab.options import Pair, length

PAGES_MM = {
    "a0": (841.0, 1189.0),
    "a1": (594.0, 841.0),
    "a2": (420.0, 594.0),
    "a3": (297.0, 420.0),
    "a4": (210.0, 297.0),
    "a5": (148.0, 210.0),
    "a6": (105.0, 148.0),
    "letter": (215.9, 279.4),
    "legal": (215.9, 355.6),
    "tabloid": (279.4, 431.8),
}
"""Page sizes by name: width and height in mm (ISO 216; ANSI/ASME Y14.1, US legal)."""

_MEASURE = Pair(length(50, 5000), "WIDTHxHEIGHT", "200x300mm", "x")


def page_size(page: str) -> tuple[float, float]:
    """Width and height in mm of the ``page``: a name of :data:`PAGES_MM`, or ``200x300mm``.

    Raises :class:`~miurafab.errors.InputError` for a page that is neither.
    """
    name = page.lower()
    if name in PAGES_MM:
        return PAGES_MM[name]
    try:
        width, height = _MEASURE.read(name)
    except ValueError:
        raise InputError(
            f"The page '{page}' is not one of {', '.join(PAGES_MM)}, nor a measure of 50 mm to 5 m "
            "a side such as 200x300mm."
        ) from None
    return float(width), float(height)
