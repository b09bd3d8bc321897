"""The options of a fit as large as the bed allows, for `fit`, `cut` and their commands."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from miurafab.display import Shown
from miurafab.options import File, Whole, check_options, option


@dataclass(frozen=True, repr=False)
class BedOptions(Shown):
    """What a size by the bed depends on, besides the machine and the material."""

    sheets: int | None = option(
        Whole(1, 1000),
        "With `size` bed: as large as so many sheets allow; on one sheet nothing is cut apart.",
        group="Bed",
        default_text="1",
    )
    stock: Path | None = option(
        File(),
        "With `size` bed: a TOML file with the sheets to use.",
        group="Bed",
        default_text="sheets of the bed's size",
    )

    def __post_init__(self) -> None:
        check_options(self)
