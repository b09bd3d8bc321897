"""What is asked of a fit, with its own checks."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, get_args

from miurafab.display import Shown
from miurafab.errors import OptionError
from miurafab.options import (
    Choice,
    Either,
    Pair,
    Whole,
    Written,
    angle,
    check_options,
    length,
    number,
    option,
)
from miurafab.origami.fitting.kinds import CutColumns, FlatFoldability, Pieces, Poles
from miurafab.origami.fitting.nominal import Follow
from miurafab.origami.invariants import EXACT
from miurafab.surfaces.analytic import GeneralizedCylinder
from miurafab.surfaces.mesh_repair import Holes
from miurafab.surfaces.placement import Region
from miurafab.surfaces.plates import Side
from miurafab.surfaces.surface import TargetSurface

DEFAULT_FACETS = (20, 20)
DEFAULT_SIZE_MM = 200.0
"""The longest side of a named surface's folded form; a mesh keeps the size of its file."""
CLOSINGS = ("sector", "open", "seam")
MOST_FACETS = 2_000
"""Columns or rows: a sheet of 2,000 x 2,000 would take days; one of 316 x 316 takes minutes."""
MOST_IN_ALL = 400_000
"""The largest measured fit has 100,000 facets."""
LARGEST_MM = 1e6
BED = "bed"
"""The size of a sheet that is as large as a bed allows (miurafab.workflow.bed_size)."""
FACETS = Pair(Whole(2, MOST_FACETS), "COLSxROWS", "20x20", "x")


@dataclass(frozen=True, repr=False)
class FitOptions(Shown):
    """The options of a fit. Inside, lengths are in mm and angles in radians."""

    facets: tuple[int, int] | None = option(
        FACETS,
        "Columns and rows of facets; left out with `min_edge` and `max_distance` or "
        "`max_deviation`, the coarsest sheet that meets them.",
        group="Sheet",
        default_text=FACETS.show(DEFAULT_FACETS),
        page="first",
    )
    size_mm: float | str | None = option(
        Either(Choice((BED,)), length(0, LARGEST_MM, above=True)),
        "Longest side of the folded bounding box; bed: as large as the machine's bed allows.",
        group="Sheet",
        default_text=f"{DEFAULT_SIZE_MM:g} mm; a mesh keeps its file's size",
        page="first",
    )
    amplitude: float | None = option(
        number(0, 100, above=True),
        "Height of the corrugation over the row spacing.",
        group="Sheet",
        default_text="automatic",
        page="first",
    )
    zigzag: float | None = option(
        number(0, 100, above=True),
        "Zig-zag over the column spacing.",
        group="Sheet",
        default_text="automatic",
        page="more",
    )
    close: str = option(
        Choice(CLOSINGS),
        "For surfaces of revolution and the circular cylinder: sector (of the angle given), open "
        "(all round but one facet), or seam (all round, to be glued).",
        "sector",
        group="Sheet",
        page="more",
    )
    follow: Follow = option(
        Choice(get_args(Follow)),
        "What lies on the target: the middle of the sheet, or its top or bottom vertices (top is "
        "the side of the target's normal).",
        "middle",
        group="Sheet",
    )
    flat_foldable: float | None = option(
        FlatFoldability(),
        "Largest |pi - a1 - a3| at a vertex: exact (0), off, or a limit with its unit, such as "
        "0.016rad or 0.9deg.",
        group="Limits",
        default_text="off",
        page="more",
    )
    barrier: float | None = option(
        number(0, 1e3, above=True),
        "The energy barrier that holds the folded form, in k_f L, within 1 %: fairness and the "
        "Kawasaki residuals (eps_ff) are tuned, and the closest such sheet is taken.",
        group="Limits",
        default_text="as it comes",
    )
    min_edge_mm: float | None = option(
        length(above=True), "The shortest edge allowed.", group="Limits", page="first"
    )
    max_deviation_mm: float | None = option(
        length(above=True),
        "The farthest that the mid-surface may lie from the target.",
        group="Limits",
        page="more",
    )
    max_distance_mm: float | None = option(
        length(above=True),
        "The farthest that the sheet may lie from the whole target, and the target from the sheet: "
        "the Hausdorff distance.",
        group="Limits",
        page="more",
    )
    min_angle: float | None = option(
        angle(0, 90), "The least sector angle allowed.", group="Limits"
    )
    max_angle: float | None = option(
        angle(90, 180), "The greatest sector angle allowed.", group="Limits"
    )
    max_aspect: float | None = option(
        number(1, above=True), "The greatest ratio of two sides of a facet.", group="Limits"
    )
    region: Region | None = option(
        Written(Region.read, str, "U0,U1,V0,V1"),
        "The part of the mesh to cover, in its flat layout, as fractions or lengths.",
        group="Mesh targets",
        default_text="automatic",
        page="mesh",
    )
    rotate: float | None = option(
        angle(-360, 360),
        "Turn the grid on the mesh by this angle.",
        group="Mesh targets",
        default_text="automatic",
        page="mesh",
    )
    pieces: int | None = option(
        Pieces(),
        "The number of flat pieces, joined along seams in space; auto takes the fewest that reach "
        "the quality of a good sheet.",
        group="Sheet",
        default_text="auto",
        page="more",
    )
    cut_columns: tuple[int, ...] | None = option(
        CutColumns(),
        "Cut the sheet into pieces along these columns of vertices.",
        group="Sheet",
        default_text="evenly spaced",
    )
    poles: tuple[float, ...] | None = option(
        Poles(),
        "Points near the two poles of a closed mesh, in its own coordinates; gores run from one to "
        "the other.",
        group="Mesh targets",
        default_text="automatic",
        page="mesh",
    )
    polar_hole_mm: float | None = option(
        length(above=True),
        "Radius of the hole that the sheet leaves round each pole of a closed mesh, in the mesh's "
        "own unit.",
        group="Mesh targets",
        default_text="6 % of the root of the area",
        page="mesh",
    )
    side: Side = option(
        Choice(get_args(Side)),
        "Of a closed solid that is a thin plate: the outer skin (the larger), the inner skin, or "
        "the middle between them.",
        "outer",
        group="Mesh targets",
        page="mesh",
    )
    holes: Holes = option(
        Choice(get_args(Holes)),
        "The holes of the mesh: fill small ones (up to 15 % of the border's length) and refuse "
        "large ones, fill all, or fill small ones and keep large ones as windows in the sheet.",
        "small",
        group="Mesh targets",
        page="mesh",
    )
    edge: str = option(
        Choice(("trim", "whole", "rectangle")),
        "The border of the sheet: cut along the mesh's own outline (trim), whole facets inside it "
        "(whole), or a rectangle of the mesh (rectangle; so with `region`).",
        "trim",
        group="Mesh targets",
        page="mesh",
    )
    polish: str = option(
        Choice(("on", "off")),
        "Minimise the fair objective: on, or off for the projection of the seed alone, which is "
        "faster and leaves facets that are harder to fold.",
        "on",
        group="Search",
    )
    timeout: float | None = option(
        number(0, above=True),
        "End the search after so many seconds, with the best sheet up to then.",
        group="Search",
        default_text="none",
    )
    seed: int = option(
        Whole(),
        "Random seed: 0 starts from the smooth corrugation, any other number from a shaken one, "
        "for another sheet.",
        0,
        group="Search",
    )

    def __post_init__(self) -> None:
        check_options(self)
        if self.columns * self.rows > MOST_IN_ALL:
            raise OptionError(
                "facets",
                f"is {FACETS.show((self.columns, self.rows))}; in all there may be {MOST_IN_ALL:,}",
            )
        if self.cut_columns is not None:
            if self.cut_columns[-1] >= self.columns:
                raise OptionError(
                    "cut_columns",
                    f"reaches column {self.cut_columns[-1]}, and the sheet has {self.columns} "
                    "columns of facets",
                )
            if self.pieces not in (None, len(self.cut_columns) + 1):
                raise OptionError(
                    "pieces",
                    f"is {self.pieces}, and {len(self.cut_columns)} `cut_columns` make "
                    f"{len(self.cut_columns) + 1} pieces; give only one of the two",
                )
        if self.barrier is not None and self.flat_foldable is not None:
            raise OptionError(
                "barrier",
                "decides the residuals, and so does `flat_foldable`; give only one of the two",
            )
        if self.barrier is not None and (self.pieces or 1) > 1:
            raise OptionError("barrier", "is for one piece; ask for one of `pieces`")
        shapes = (self.min_angle, self.max_angle, self.max_aspect)
        if self.barrier is not None and any(limit is not None for limit in shapes):
            raise OptionError(
                "barrier",
                "does not go with `min_angle`, `max_angle` and `max_aspect`; leave them out",
            )
        low, high = self.angles
        if not low < math.pi / 2 < high:
            raise OptionError(
                None,
                f"The sector angles are to lie between {math.degrees(low):g} and "
                f"{math.degrees(high):g} degrees (`min_angle`, `max_angle`); no sheet folds unless "
                "90 degrees lie between",
            )

    @property
    def columns(self) -> int:
        """Columns of facets; only the proportion to the rows counts in a search."""
        return (self.facets or DEFAULT_FACETS)[0]

    @property
    def rows(self) -> int:
        """Rows of facets; only the proportion to the columns counts in a search."""
        return (self.facets or DEFAULT_FACETS)[1]

    @property
    def side_mm(self) -> float | None:
        """The longest side of the folded form, mm; None for that of the target itself."""
        return None if isinstance(self.size_mm, str) else self.size_mm

    @property
    def search(self) -> bool:
        """Whether the coarsest sheet that meets the limits is looked for."""
        close = self.max_deviation_mm is not None or self.max_distance_mm is not None
        return self.facets is None and self.min_edge_mm is not None and close

    @property
    def angles(self) -> tuple[float, float]:
        """The least and the greatest sector angle allowed, radians."""
        low = 0.0 if self.min_angle is None else self.min_angle
        return low, math.pi if self.max_angle is None else self.max_angle

    @property
    def exactly_flat_foldable(self) -> bool:
        """Whether Kawasaki's condition is a constraint and not a limit."""
        return self.flat_foldable is not None and self.flat_foldable <= EXACT


@dataclass(frozen=True, repr=False)
class FitRequest(FitOptions):
    """What is asked of one fit: its options, and the ``surface`` that the sheet is to follow.

    A ``size_mm`` of None is the surface's own size.

    Attributes
    ----------
    surface : TargetSurface
        The surface that the sheet follows.
    target : dict
        The description of the surface in the file of the pattern.
    fairness : float
        The weight of fairness in the objective, over the usual one.
    """

    surface: TargetSurface = field(kw_only=True)
    target: dict[str, Any] = field(default_factory=dict, kw_only=True)
    fairness: float = field(default=1.0, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.is_tube and self.rows == 2:
            raise OptionError("facets", "has 2 rows; a closed tube has an inside from 4 rows on")
        if self.is_tube and (self.pieces or 1) > 1:
            raise OptionError("pieces", "is over 1, and a closed tube is one piece")

    @property
    def is_tube(self) -> bool:
        """Whether the sheet is built as a closed tube, whose first and last row are one."""
        tube = isinstance(self.surface, GeneralizedCylinder) and self.surface.closed
        return tube and self.rows % 2 == 0
