"""The options of a motion, for `fold` and its command."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from miurafab.errors import OptionError
from miurafab.options import Choice, Whole, length, number, option

ENDINGS = (".fold", ".gif", ".glb", ".html")
"""What a motion can be written as."""

COLOURED = (".gif", ".html")
"""Those with colours that change as the sheet moves."""

METHODS = ("tapered", "bennett")


@dataclass(frozen=True)
class FoldOptions:
    """The options of a motion: of its steps, its picture and its panels."""

    steps: int = option(Whole(2, 1000), "The number of steps of the motion.", default=40)
    colour: str = option(
        Choice(("side", "strain")),
        "Colour the facets by side or by strain, in a .gif or .html file.",
        default="side",
    )
    thickness_mm: float | None = option(
        length(above=True),
        "Also say how to make panels of this thickness; exit 1 if such panels cannot fold.",
    )
    timeout: float | None = option(
        number(0, above=True),
        "Give up after so many seconds, if the motion is not ready by then.",
        default_text="none",
    )
    method: str = option(
        Choice(METHODS),
        "How panels make room: cut back beside creases, or plates on shifted hinges.",
        default="tapered",
    )


def check_colour(path: Path, *, by_strain: bool) -> None:
    """Raise :class:`~miurafab.errors.OptionError` where ``path`` cannot have colours by strain."""
    if by_strain and path.suffix.lower() not in COLOURED:
        raise OptionError(
            "colour", f"is for a .gif or .html file; {path.name} has no colours by strain"
        )
