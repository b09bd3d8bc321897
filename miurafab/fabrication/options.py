"""What a user may ask of a layout besides machine and material, each option declared once.

The same options stand in the ``[layout]`` table of a design file, on the command line and on the
page.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from miurafab.display import Shown
from miurafab.errors import OptionError
from miurafab.options import (
    Choice,
    File,
    Flag,
    Kind,
    Pair,
    Several,
    Whole,
    angle,
    check_options,
    distinct,
    length,
    option,
)
from miurafab.profiles import GRAINS

JOINS = ("glue", "slots", "double")
TAB_SIDES = ("lower", "upper", "alternate")
MARKS = ("front", "back", "tabs", "none")
BRIDGE_MM = 0.5
LINES = Whole(1, 10**6)
"""A line of the vertex grid, from 1: the number of facets before it."""


Chosen = tuple[int, ...] | Literal["all"]
"""The numbers of the open borders that are meant."""


class Borders(Kind):
    """``all``, or the numbers of open borders."""

    numbers = Several(Whole(1, 10**6), distinct)

    @property
    def metavar(self) -> str:
        return "all|N,..."

    def read(self, value: object) -> Chosen:
        if value == "all":
            return "all"
        numbers: tuple[int, ...] = self.numbers.read(value)
        return numbers

    def check(self, inside: Chosen) -> None:
        if inside != "all":
            self.numbers.check(inside)

    def show(self, inside: Chosen) -> str:
        return "all" if inside == "all" else self.numbers.show(inside)


def longer_first(sides: tuple[float, float]) -> tuple[float, float]:
    """Two sides as (longer, shorter)."""
    return max(sides), min(sides)


SIDES = Pair(length(above=True), "LENGTHxLENGTH", "300mmx200mm", "x", longer_first)


@dataclass(frozen=True, repr=False)
class NestingOptions(Shown):
    """The sheets on which patches are nested."""

    quantity: int = option(
        Whole(1, 1000), "Number of copies of the whole model.", 1, group="Sheets", page="first"
    )
    stock: Path | None = option(
        File(),
        "A TOML file with the sheets to use: sizes, quantities, defects.",
        group="Sheets",
        default_text="any number of sheets of the bed's size",
    )
    margin_mm: float | None = option(
        length(0, 100),
        "Border of the sheet that stays free.",
        group="Sheets",
        default_text="the machine's",
        page="more",
    )
    grain: str | None = option(
        Choice(GRAINS),
        "Direction of the fibres, for sheets whose file does not give it.",
        group="Sheets",
        default_text="the material's",
    )
    along_grain: str | None = option(
        Choice(("x", "y")),
        "The axis of the pattern that lies along the fibres.",
        group="Sheets",
        default_text="x",
    )
    rotations: tuple[int, ...] = option(
        Several(Whole(0, 359), distinct),
        "Allowed turns of a patch on the sheet, in whole degrees.",
        (0, 90, 180, 270),
        group="Sheets",
    )

    def __post_init__(self) -> None:
        check_options(self)


@dataclass(frozen=True, repr=False)
class LayoutOptions(Shown):
    """How a pattern is laid out. Sizes are (longer, shorter) side in mm.

    Attributes
    ----------
    nesting : NestingOptions
        How patches are placed on sheets.
    """

    gap_mm: float = option(
        length(0, 100),
        "Least distance between patches on a sheet.",
        2.0,
        group="Patches",
        page="first",
    )
    offcuts_mm: tuple[tuple[float, float], ...] = option(
        Several(SIDES), "Left-over sheets to use up first.", (), group="Sheets", page="more"
    )
    max_patch_mm: tuple[float, float] | None = option(
        SIDES, "The largest patch.", group="Patches", default_text="the bed", page="first"
    )
    prefer: str | None = option(
        Choice(("sheets", "glue")),
        "What to save where one costs the other: sheets, or glue, which is the length of the "
        "seams.",
        group="Patches",
        default_text="a sheet is worth 1.5 long sides of the bed in seams",
        page="more",
    )
    seam_rows: tuple[int, ...] = option(
        Several(LINES, distinct), "Force a seam after these rows of facets.", (), group="Patches"
    )
    seam_columns: tuple[int, ...] = option(
        Several(LINES, distinct), "Force a seam after these columns of facets.", (), group="Patches"
    )
    open_row: int | None = option(
        LINES,
        "Open a closed ring after this row of facets, and count rows from it.",
        group="Patches",
        default_text="where the pattern is already open",
    )
    open_column: int | None = option(
        LINES,
        "Open a closed ring after this column of facets, and count columns from it.",
        group="Patches",
        default_text="where the pattern is already open",
    )
    join: str = option(
        Choice(JOINS),
        "What holds a seam. glue: tabs under the facets; slots: tabs that are put through slots in "
        "the facets, without glue; double: tabs on both patches, glued to each other behind.",
        JOINS[0],
        group="Tabs",
        page="more",
    )
    tab_height_mm: float | None = option(
        length(0.5, 100),
        "Height of the tabs.",
        group="Tabs",
        default_text="the material's",
        page="more",
    )
    tab_inset_mm: float | None = option(
        length(0, 100),
        "Distance of the tabs from the borders of the facet that they are glued to.",
        group="Tabs",
        default_text="the material's",
    )
    tab_angle: float | None = option(
        angle(5, 180),
        "Largest inner angle at the base of a tab.",
        group="Tabs",
        default_text="the material's",
    )
    tab_side: str = option(
        Choice(TAB_SIDES),
        "The patch of a seam that bears the tabs: the one with the lower or the upper number, or "
        "alternate: both in turn, edge by edge.",
        "lower",
        group="Tabs",
        page="more",
    )
    full_facet: bool = option(
        Flag(),
        "Make each tab as large as the facet that it is glued to, less the inset.",
        False,
        group="Tabs",
        page="more",
    )
    caps: Chosen = option(
        Borders(),
        "Close open borders by a cap, a piece of its own: all, or the numbers that the report "
        "gives; those that stay open are numbered anew.",
        (),
        group="Patches",
        page="more",
    )
    border_tabs: Chosen = option(
        Borders(),
        "Tabs on open borders, to fix the shell to a base or a frame: all, or the numbers that the "
        "report gives.",
        (),
        group="Tabs",
        page="more",
    )
    marks: str = option(
        Choice(MARKS),
        "Where names and labels are engraved. The front is the show side; back: from a file of "
        "its own for the back; tabs: only where gluing hides them; none: in the guide alone.",
        MARKS[0],
        group="Cutting",
        page="more",
    )
    rim_numbers: bool = option(
        Flag(),
        "Engrave the number of each row on the waste beside its ends, where there is room.",
        False,
        group="Cutting",
        page="more",
    )
    jig_mm: float | None = option(
        length(0.1, 30),
        "Also draw the ribs of a jig that carries the folded shell, from board of this thickness.",
        group="Tabs",
        default_text="no jig",
        page="more",
    )
    ticks_mm: float | None = option(
        length(0.4, 3),
        "Length of ticks at the ends of folds on the outline: one across a mountain, two across a "
        "valley.",
        group="Cutting",
        default_text="none",
        page="more",
    )
    two_sided: bool = option(
        Flag(), "Score the valleys from the back of the sheet.", False, group="Cutting", page="more"
    )
    bridges: int = option(
        Whole(0, 12),
        "Holding bridges on each outline, so that nothing falls out: 0, or 2 and more.",
        0,
        group="Cutting",
        page="more",
    )
    bridge_mm: float = option(
        length(0.1, 20), "Length of a holding bridge.", BRIDGE_MM, group="Cutting", page="more"
    )
    spread_heat: bool = option(
        Flag(), "Cut neighbouring patches far apart in time.", False, group="Cutting", page="more"
    )
    nesting: NestingOptions = field(default_factory=NestingOptions)

    @property
    def tabs_on_both_sides(self) -> bool:
        """Whether either patch of a seam may bear tabs."""
        return self.tab_side == "alternate" or self.join == "double"

    def __post_init__(self) -> None:
        check_options(self)
        if self.full_facet and self.join != JOINS[0]:
            raise OptionError(
                "full_facet",
                f"makes tabs as large as the facet over them, but `join` is {self.join}, where no "
                "facet is glued; leave one of them out",
            )
        if self.ticks_mm is not None and self.marks in ("tabs", "none"):
            raise OptionError(
                "ticks",
                f"is {self.ticks_mm:g} mm, but `marks` is {self.marks}, which keeps the facets "
                "clean; take `marks` front or back",
            )
        if self.bridges == 1:
            raise OptionError("bridges", "is 1, on which a piece would swing; use 0, or 2 and more")
        if self.bridge_mm != BRIDGE_MM and not self.bridges:
            raise OptionError(
                "bridge",
                "is the length of holding bridges, but none are wanted; give the number of "
                "`bridges` as well",
            )
