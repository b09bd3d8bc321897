"""What a fit answers: the sheet, its measurements, and what was tried."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from miurafab.display import Shown
from miurafab.errors import PatternError
from miurafab.findings import Finding, findings_json
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.fitting.score import Score
from miurafab.origami.fitting.seed import Corrugation
from miurafab.origami.verify import Measurements

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INTERRUPTED = Finding(
    "interrupted", "The fit was interrupted; this is the best exact sheet up to then."
)
"""The advice of a fit that Ctrl-C ended."""
TIME_RAN_OUT = Finding(
    "timeout", "The `timeout` ended the search; this is the best sheet up to then."
)


@dataclass(frozen=True)
class Attempt:
    """One attempt: the way (``direct``, ``sheet``, ``ring``, ``gores``), the row direction, the
    corrugation, the residual it ended with, why it was not enough (empty if it was), on a mesh
    where else the sheet was laid, the number of pieces, the largest slide that the seed asks for
    (radians), and the score of the sheet, None without one.
    """

    way: str
    rows_along: str
    corrugation: Corrugation
    residual: float
    iterations: int
    fault: str
    place: str = ""
    pieces: int = 1
    steepest: float = 0.0
    score: float | None = None


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
    score : Score, optional
        How good the sheet is to fold and how much of the target it follows; 1 is as good as asked.
    polished : bool
        Whether the sheet was brought closer after it was found.
    active_bounds : mapping
        How many inequalities of each kind hold the sheet back.
    barrier : float, optional
        The barrier of ``pattern`` in k_f L, where one was asked for.
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
    score: Score | None = None
    polished: bool = False
    active_bounds: Mapping[str, int] = field(default_factory=dict)
    barrier: float | None = None
    findings: tuple[Finding, ...] = ()

    @property
    def is_valid(self) -> bool:
        """Whether ``pattern`` is a sheet that meets every limit, or the best one at Ctrl-C."""
        return self.pattern is not None and self.status in ("converged", "interrupted")

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
        return {
            key: value
            for key, value in self.report().items()
            if value not in ("", None) and not isinstance(value, list | dict)
        }

    def report(self) -> dict[str, Any]:
        """The fit report, ready for JSON."""
        return {
            "status": self.status,
            "advice": self.advice,
            **Measurements.report(self.measurements),
            "iterations": self.iterations,
            "seconds": self.seconds,
            "deviation_mm": self.deviation_mm,
            "score": None if self.score is None else self.score.report(),
            "polished": self.polished,
            "active_bounds": dict(self.active_bounds),
            "barrier": self.barrier,
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
                    "pieces": a.pieces,
                    "steepest_deg": math.degrees(a.steepest),
                    "score": a.score,
                }
                for a in self.attempts
            ],
        }
