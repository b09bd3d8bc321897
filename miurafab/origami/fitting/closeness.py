"""The two limits on distance: `max_deviation` for the middle of a sheet, `max_distance` for all.

The deviation is the distance of the surface that follows the target. The Hausdorff distance is
taken both ways between the sheet, corrugation and border included, and the whole target.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from miurafab.findings import Finding
from miurafab.geometry.hausdorff import WITHIN
from miurafab.origami.fitting.request import FitOptions
from miurafab.origami.verify import Measurements


@dataclass(frozen=True)
class Closeness:
    """How far a sheet lies from its target, mm, and how far it may; None for no limit."""

    deviation: float
    hausdorff: float
    max_deviation: float | None
    max_distance: float | None

    @classmethod
    def of(
        cls, asked: FitOptions, measured: Measurements | None, deviation_mm: float | None
    ) -> Closeness:
        """The distances of a sheet; infinite where it was not measured. The Hausdorff distance is
        the most that it can be, where it is known to ``WITHIN``.
        """
        hausdorff = None
        if measured is not None and measured.hausdorff_mm is not None:
            hausdorff = measured.hausdorff_mm * (1 + WITHIN)
        return cls(
            float("inf") if deviation_mm is None else deviation_mm,
            float("inf") if hausdorff is None else hausdorff,
            asked.max_deviation_mm,
            asked.max_distance_mm,
        )

    @property
    def pairs(self) -> list[tuple[str, float, float]]:
        """Each distance that has a limit: where it is measured, the distance, the limit."""
        both = (
            ("by its middle", self.deviation, self.max_deviation),
            ("where they are farthest apart", self.hausdorff, self.max_distance),
        )
        return [(part, distance, limit) for part, distance, limit in both if limit is not None]

    @property
    def factors(self) -> dict[str, float]:
        """Each distance over its limit, by the name of the limit."""
        both = (
            ("max_deviation", self.deviation, self.max_deviation),
            ("max_distance", self.hausdorff, self.max_distance),
        )
        return {name: distance / limit for name, distance, limit in both if limit is not None}

    @property
    def factor(self) -> float:
        """The largest distance over its limit; 0 without a limit."""
        return max(self.factors.values(), default=0.0)

    def faults(self, follow: str) -> Iterator[Finding]:
        """A finding for each limit that is not met; ``follow`` is what lies on the target."""
        what = "mid-surface" if follow == "middle" else follow
        if self.max_deviation is not None and self.deviation > self.max_deviation:
            yield Finding(
                "max-deviation",
                f"The {what} lies up to {self.deviation:.3g} mm from the target, over the "
                f"{self.max_deviation:.3g} mm allowed; ask for more `facets`.",
            )
        if self.max_distance is not None and self.hausdorff > self.max_distance:
            yield Finding(
                "max-distance",
                f"Sheet and target lie up to {self.hausdorff:.3g} mm from each other, over the "
                f"{self.max_distance:.3g} mm allowed; ask for more `facets`, or a lower "
                "`amplitude` and `zigzag`.",
            )
