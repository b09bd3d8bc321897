"""What is asked of a fit and what it answers, each a frozen value with its own checks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from miurafab.errors import InputError
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.fitting.inequalities import Bounds
from miurafab.origami.fitting.polish import Follow
from miurafab.origami.fitting.reduction import Unknowns
from miurafab.origami.fitting.seed import Corrugation
from miurafab.origami.verify import EXACT, Measurements
from miurafab.surfaces.analytic import GeneralizedCylinder
from miurafab.surfaces.surface import TargetSurface

INTERRUPTED = "The fit was interrupted; this is the best exact sheet up to then."
"""The advice of a fit that Ctrl-C ended."""


@dataclass(frozen=True)
class FitRequest:
    """What is asked. ``columns`` x ``rows`` facets on ``surface``.

    ``size_mm`` is the longest side of the folded bounding box, None for the target's own size;
    ``amplitude`` and ``zigzag`` the corrugation (height over row spacing, zig-zag over column
    spacing), None for automatic; ``flat_foldable`` the largest allowed |pi - a1 - a3| in radians, 0
    for exact, None for off; ``min_edge_mm`` and ``max_deviation_mm`` (of the mid-surface) are
    limits; ``seed`` decides the random attempts. ``target`` describes the surface in the file.

    ``follow`` is what lies on the target: the ``middle`` of the sheet, or its ``top`` or ``bottom``
    vertices (top is the side of the target's normal). ``min_angle`` and ``max_angle`` bound the
    sector angles, radians; ``max_aspect`` the ratio of two sides of a facet. ``polish`` is ``on``,
    ``off``, or ``auto``: where a limit is not met or flat-foldability is asked for.
    With ``search``, ``columns`` and ``rows`` give only the proportion, and the coarsest sheet that
    meets all limits is looked for.
    """

    surface: TargetSurface
    columns: int
    rows: int
    size_mm: float | None = None
    amplitude: float | None = None
    zigzag: float | None = None
    flat_foldable: float | None = None
    min_edge_mm: float | None = None
    max_deviation_mm: float | None = None
    seed: int = 0
    target: dict[str, Any] = field(default_factory=dict)
    follow: Follow = "middle"
    min_angle: float | None = None
    max_angle: float | None = None
    max_aspect: float | None = None
    polish: str = "auto"
    search: bool = False

    def __post_init__(self) -> None:
        if self.columns < 2 or self.rows < 2:
            raise InputError(
                f"A sheet of {self.columns}x{self.rows} facets cannot fold; ask for 2x2 or more."
            )
        for name in ("size_mm", "amplitude", "zigzag", "min_edge_mm", "max_deviation_mm"):
            value = getattr(self, name)
            if value is not None and not 0 < value < np.inf:
                option = "--" + name.removesuffix("_mm").replace("_", "-")
                raise InputError(f"{option} is {value:g}; it must be greater than zero.")
        if self.flat_foldable is not None and not 0 <= self.flat_foldable < np.pi:
            raise InputError(
                f"--flat-foldable is {self.flat_foldable:g}; it must be exact, off, or an angle "
                "from 0 to pi."
            )
        if self.follow not in ("middle", "top", "bottom"):
            raise InputError(f"--follow is '{self.follow}'; it must be middle, top or bottom.")
        if self.polish not in ("auto", "on", "off"):
            raise InputError(f"--polish is '{self.polish}'; it must be auto, on or off.")
        if self.is_tube and self.rows == 2:
            raise InputError("A tube of 2 rows of facets has no inside; ask for 4 rows or more.")
        if self.polish == "on" and self.is_tube:
            raise InputError("--polish on would open the seam of a closed tube; leave it out.")
        if self.max_aspect is not None and not self.max_aspect > 1:
            raise InputError(f"--max-aspect is {self.max_aspect:g}; it must be greater than 1.")
        low, high = self.angles
        if not 0 <= low < np.pi / 2 < high <= np.pi:
            raise InputError(
                f"The sector angles are to lie between {np.degrees(low):g} and "
                f"{np.degrees(high):g} degrees; no sheet folds unless 90 degrees lie between."
            )

    @property
    def angles(self) -> tuple[float, float]:
        """The least and the greatest sector angle allowed, radians."""
        low = 0.0 if self.min_angle is None else self.min_angle
        return low, np.pi if self.max_angle is None else self.max_angle

    @property
    def is_tube(self) -> bool:
        """Whether the sheet is built as a closed tube, whose first and last row are one."""
        tube = isinstance(self.surface, GeneralizedCylinder) and self.surface.closed
        return tube and self.rows % 2 == 0

    @property
    def exactly_flat_foldable(self) -> bool:
        """Whether Kawasaki's condition is a constraint and not a limit."""
        return self.flat_foldable is not None and self.flat_foldable <= EXACT

    def bounds(self, unknowns: Unknowns, scale: float, margin: float = 0.0) -> Bounds:
        """The limits as inequalities in the target's own unit, tightened by the part ``margin``."""
        tighter, looser = 1 + margin, 1 - margin
        bounded = self.min_angle is not None or self.max_angle is not None
        low, high = self.angles
        tolerance = self.flat_foldable
        return Bounds(
            unknowns.grid,
            unknowns.length,
            min_edge=None if self.min_edge_mm is None else self.min_edge_mm / scale * tighter,
            angles=(low * tighter, np.pi - (np.pi - high) * tighter) if bounded else None,
            aspect=None if self.max_aspect is None else self.max_aspect * looser,
            kawasaki=None if tolerance is None or tolerance <= EXACT else tolerance * looser,
        )


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


@dataclass(frozen=True, eq=False)
class FitResult:
    """The outcome. ``status`` is ``converged``, ``infeasible`` (an exact sheet, but a limit is not
    met), ``interrupted`` (the best exact sheet when Ctrl-C ended the fit) or ``stalled`` (no exact
    sheet was found); ``pattern`` is the best sheet there is, or None.

    ``deviation_mm`` is how far what follows the target lies from it at most; ``polished`` whether
    the sheet was brought closer after it was found; ``active_bounds`` how many inequalities of each
    kind hold it back.
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
