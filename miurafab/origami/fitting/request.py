"""What is asked of a fit and what it answers, each a frozen value with its own checks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, get_args

from miurafab.display import Shown
from miurafab.errors import OptionError, PatternError, UnitError
from miurafab.findings import Finding, findings_json
from miurafab.options import (
    Choice,
    Kind,
    Pair,
    Whole,
    Written,
    angle,
    check_options,
    length,
    number,
    option,
)
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.fitting.polish import Follow
from miurafab.origami.fitting.seed import Corrugation
from miurafab.origami.verify import EXACT, Measurements
from miurafab.surfaces.analytic import GeneralizedCylinder
from miurafab.surfaces.placement import Region
from miurafab.surfaces.surface import TargetSurface
from miurafab.units import parse_angle

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DEFAULT_FACETS = (20, 20)
DEFAULT_SIZE_MM = 200.0
"""The longest side of a named surface's folded form; a mesh keeps the size of its file."""
CLOSINGS = ("sector", "open", "seam")
FACETS = Pair(Whole(2), "COLSxROWS", "20x20", "x")


class FlatFoldability(Kind):
    """``exact`` (0 inside), ``off`` (None) or the largest difference of pi - a1 - a3 from 0.

    The paper gives this limit in radians, every other angle here is in degrees; so a number must
    carry its unit.
    """

    @property
    def metavar(self) -> str:
        return "exact|off|ANGLE"

    def read(self, value: object) -> float | None:
        if value == "exact":
            return 0.0
        if value == "off":
            return None
        try:
            float(value)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            pass
        else:
            raise ValueError(
                f"is {value} without a unit; write {value}rad, as the paper does, or degrees such "
                "as 0.9deg"
            )
        try:
            inside = parse_angle(value if isinstance(value, str) else repr(value))
        except UnitError:
            raise ValueError(
                f"is {value!r}; it must be exact, off, or an angle such as 0.016rad or 0.9deg"
            ) from None
        self.check(inside)
        return inside

    def check(self, inside: float) -> None:
        if not 0 <= inside < math.pi:
            raise ValueError(
                f"is {math.degrees(inside):g} deg; it must be exact, off, or an angle under 180 deg"
            )

    def show(self, inside: float) -> str:
        return f"{inside:g}rad" if inside else "exact"


INTERRUPTED = Finding(
    "interrupted", "The fit was interrupted; this is the best exact sheet up to then."
)
"""The advice of a fit that Ctrl-C ended."""


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
    size_mm: float | None = option(
        length(above=True),
        "Longest side of the folded bounding box.",
        group="Sheet",
        default_text=f"{DEFAULT_SIZE_MM:g} mm; a mesh keeps its file's size",
        page="first",
    )
    amplitude: float | None = option(
        number(0, above=True),
        "Height of the corrugation over the row spacing.",
        group="Sheet",
        default_text="automatic",
        page="more",
    )
    zigzag: float | None = option(
        number(0, above=True),
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
    )
    rotate: float | None = option(
        angle(-360, 360),
        "Turn the grid on the mesh by this angle.",
        group="Mesh targets",
        default_text="automatic",
    )
    polish: str = option(
        Choice(("auto", "on", "off")),
        "Bring the sheet as close to the target as it goes: on, off, or auto (where a limit is not "
        "met or flat-foldability is asked for).",
        "auto",
        group="Search",
    )
    seed: int = option(Whole(), "Random seed of the attempts.", 0, group="Search")

    def __post_init__(self) -> None:
        check_options(self)
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
    """

    surface: TargetSurface = field(kw_only=True)
    target: dict[str, Any] = field(default_factory=dict, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.is_tube and self.rows == 2:
            raise OptionError("facets", "has 2 rows; a closed tube has an inside from 4 rows on")
        if self.is_tube and self.polish == "on":
            raise OptionError("polish", "is on, which would open the seam of a closed tube")

    @property
    def is_tube(self) -> bool:
        """Whether the sheet is built as a closed tube, whose first and last row are one."""
        tube = isinstance(self.surface, GeneralizedCylinder) and self.surface.closed
        return tube and self.rows % 2 == 0


@dataclass(frozen=True)
class Attempt:
    """One attempt: the way (``direct``, ``strip``, ``seed``, ``bent``, ``refined``,
    ``shaken``), the row
    direction, the corrugation, the residual it ended with, why it was not enough (empty if it
    was), and on a mesh where else the sheet was laid.
    """

    way: str
    rows_along: str
    corrugation: Corrugation
    residual: float
    iterations: int
    fault: str
    place: str = ""


@dataclass(frozen=True, eq=False, repr=False)
class FitResult(Shown):
    """The outcome of a fit.

    Parameters
    ----------
    status : str
        ``converged``; ``infeasible``: an exact sheet that misses a limit; ``interrupted``: the best
        exact sheet when Ctrl-C ended the fit; ``stalled``: no exact sheet was found.
    advice : str
        What to change, empty where nothing is to be said.
    pattern : CreasePattern or None
        The best sheet, None where none was found.
    measurements : Measurements or None
        The residuals and distances of ``pattern``.
    attempts : tuple of Attempt
        What was tried, in order.
    iterations : int
        Iterations of the solver, in all attempts.
    seconds : float
        The time that the fit took.
    deviation_mm : float, optional
        How far the part of the sheet that follows the target lies from it at most, mm.
    polished : bool
        Whether the sheet was brought closer after it was found.
    active_bounds : mapping
        How many inequalities of each kind hold the sheet back.
    findings : tuple of Finding
        What a person should know of the target.
    """

    status: str
    advice: str
    pattern: CreasePattern | None
    measurements: Measurements | None
    attempts: tuple[Attempt, ...]
    iterations: int
    seconds: float
    deviation_mm: float | None = None
    polished: bool = False
    active_bounds: Mapping[str, int] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()

    def plot(self, form: str | None = None, ax: Axes | None = None) -> Axes:
        """Draw the pattern (:meth:`CreasePattern.plot`).

        Raises
        ------
        PatternError
            Where no sheet was found.
        """
        if self.pattern is None:
            raise PatternError(f"There is no sheet to draw: {self.advice}")
        return self.pattern.plot(form, ax)

    def _summary(self) -> str:
        if self.pattern is None or self.measurements is None:
            return f"{self.status}: no sheet in {len(self.attempts)} attempts"
        far = self.measurements.hausdorff_mm
        grid = self.pattern.grid
        return f"{self.status}: {self.measurements.facets} facets" + "".join(
            [
                "" if far is None else f", {far:.2g} mm from {self.pattern.name or 'the target'}",
                "" if grid is None else f", pattern {grid[0]}x{grid[1]}",
            ]
        )

    def _picture(self) -> str:
        return "" if self.pattern is None else self.pattern._picture()

    def _facts(self) -> Mapping[str, object]:
        report = self.report()
        return {key: value for key, value in report.items() if not isinstance(value, list | dict)}

    def report(self) -> dict[str, Any]:
        """The fit report, ready for JSON."""
        numbers = {f.name: getattr(self.measurements, f.name, None) for f in fields(Measurements)}
        return {
            "status": self.status,
            "advice": self.advice,
            **numbers,
            "iterations": self.iterations,
            "seconds": self.seconds,
            "deviation_mm": self.deviation_mm,
            "polished": self.polished,
            "active_bounds": dict(self.active_bounds),
            "findings": findings_json(self.findings),
            "attempts": [
                {
                    "way": a.way,
                    "rows_along": a.rows_along,
                    "amplitude": a.corrugation.amplitude,
                    "zigzag": a.corrugation.zigzag,
                    "residual": a.residual,
                    "iterations": a.iterations,
                    "fault": a.fault,
                    "place": a.place,
                }
                for a in self.attempts
            ],
        }
