"""Accuracy against effort: the distance of a sheet from its target for a number of facets.

Let n be the facets along a side (the root of their number F), d the Hausdorff distance between
sheet and target over the diagonal of the folded form, A the area of the paper and A0 that of the
target. A corrugation whose height is proportional to the size of its facets gives

    d(n) = c / n,        A / A0 = a + b / n,

where a > 1 is paper that no refinement saves. Each power is also left free, A / A0 = a + b n^p, and
reported beside the law's; so is the power of the distance of the mid-surface, which falls faster
than that of the whole, since the height of the corrugation falls as 1 / n.
With a weight w in (0, 1) on effort,

    C_w(n) = (1 - w) d(n) / 1% + w n^2 / 1000,    least at  n = ((1 - w) 1000 c / (2 w 1%))^(1/3).

(Dudte, Vouga, Tachi and Mahadevan, Nature Materials 15, 2016, last figure, ask the same of a
hyperboloid, and let the area fall as 1 over the number of facets, which is p = -2. The units of the
cost, 1 % and 1000 facets, are this project's.)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from miurafab.display import Shown
from miurafab.files import AnyPath
from miurafab.geometry.arrays import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

UNIT_DISTANCE = 0.01
UNIT_FACETS = 1000.0
WEIGHTS = (0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.95)
ENOUGH = 3
"""The least number of sheets for a law."""


@dataclass(frozen=True)
class Sample:
    """One sheet: its request and its measurements, which are None where no sheet was found.

    Lengths in mm; the names are those of the fit report.
    """

    columns: int
    rows: int
    status: str
    amplitude: float | None = None
    zigzag: float | None = None
    hausdorff_mm: float | None = None
    hausdorff_relative: float | None = None
    hausdorff_midsurface_mm: float | None = None
    area_ratio: float | None = None
    min_edge_mm: float | None = None

    @property
    def side(self) -> float:
        """n, the root of the number of facets."""
        return float(np.sqrt(self.columns * self.rows))


@dataclass(frozen=True)
class CostCurve:
    """The cost of each sheet for one ``weight`` on effort, the sheet and the optimum of the law."""

    weight: float
    costs: tuple[float, ...]
    best_facets: int
    optimal_facets: float


@dataclass(frozen=True, repr=False)
class Tradeoff(Shown):
    """The samples by facets, and the laws of those that converged, None for fewer than three.

    Attributes
    ----------
    samples : tuple of Sample
        One for each number of facets, also where no sheet was found.
    coefficient : float or None
        c of the law d = c / n, where d is the distance from the target and n the facets on a side.
    exponent : float or None
        The power of n if it is fitted too; the law says -1.
    law_error : float or None
        The largest relative distance of a sample from c / n.
    area_limit, area_slope : float or None
        a and b of the law of the area of the paper.
    area_power, area_free_limit : float or None
        p and a of the law of the area with a free power, the best fit with p from -4 to -0.25.
    midsurface_exponent : float or None
        The power of n by which the distance of the mid-surface falls.
    curves : tuple of CostCurve
        The cost of each sheet, for each weight on effort.
    """

    samples: tuple[Sample, ...]
    coefficient: float | None
    exponent: float | None
    law_error: float | None
    area_limit: float | None
    area_slope: float | None
    curves: tuple[CostCurve, ...]
    area_power: float | None = None
    area_free_limit: float | None = None
    midsurface_exponent: float | None = None

    @property
    def found(self) -> tuple[Sample, ...]:
        """The samples with an exact sheet."""
        return tuple(s for s in self.samples if s.status == "converged")

    def save(self, path: AnyPath, *, title: str = "") -> None:
        """Write a plot (``.png``, ``.svg``) or a table (``.csv``), by the ending of ``path``.

        Raises
        ------
        InputError
            For another ending, for a folder that does not exist, and for a plot where fewer than
            three sheets were found.
        """
        from miurafab.origami.plotting import write_result
        from miurafab.origami.tradeoff_plot import tradeoff_plot, tradeoff_table

        write_result(
            path,
            "The trade-off",
            lambda: tradeoff_table(self),
            lambda kind: tradeoff_plot(self, kind, title),
        )

    def plot(self) -> list[Axes]:
        """Draw distance, area and cost over the number of facets with matplotlib.

        Returns
        -------
        list of three matplotlib Axes
        """
        from miurafab.origami.plotting import shown_row
        from miurafab.origami.tradeoff_plot import SIZE, draw_tradeoff

        axes = shown_row(SIZE, 3)
        draw_tradeoff(self, axes)
        return axes

    def _summary(self) -> str:
        law = "no law"
        if self.coefficient is not None:
            law = f"distance {100 * self.coefficient:.3g} % / n"
        return f"{len(self.samples)} sheets, {len(self.found)} converged, {law}"

    def _picture(self) -> str:
        from miurafab.origami.tradeoff_plot import tradeoff_plot

        return tradeoff_plot(self, "svg", "").decode("utf-8") if self.curves else ""

    def _facts(self) -> Mapping[str, object]:
        return {
            f"{s.columns} x {s.rows}": "-" if s.hausdorff_mm is None else f"{s.hausdorff_mm:.3g} mm"
            for s in self.samples
        }

    def report(self) -> dict[str, Any]:
        """Everything, ready for JSON."""
        return {
            "samples": [{"facets": s.columns * s.rows, **asdict(s)} for s in self.samples],
            "law": {
                "coefficient": self.coefficient,
                "exponent": self.exponent,
                "largest_error": self.law_error,
            },
            "area_ratio_limit": self.area_limit,
            "area_ratio_slope": self.area_slope,
            "area_ratio_power": self.area_power,
            "area_ratio_free_limit": self.area_free_limit,
            "midsurface_exponent": self.midsurface_exponent,
            "costs": [asdict(curve) for curve in self.curves],
        }


def summarise(samples: list[Sample], weights: tuple[float, ...] = WEIGHTS) -> Tradeoff:
    """The laws and cost curves that follow from ``samples``."""
    ordered = tuple(sorted(samples, key=lambda s: (s.columns * s.rows, s.columns)))
    fitted = [s for s in ordered if s.status == "converged"]
    if len(fitted) < ENOUGH:
        return Tradeoff(ordered, None, None, None, None, None, ())
    n = np.array([s.side for s in fitted])
    d = np.array([s.hausdorff_relative for s in fitted], dtype=np.float64)
    area = np.array([s.area_ratio for s in fitted], dtype=np.float64)
    coefficient = float(np.exp(np.log(d * n).mean()))
    exponent = float(np.polyfit(np.log(n), np.log(d), 1)[0])
    # weighted by n, since fine sheets are closer to the limit
    slope, limit = np.polyfit(1 / n, area, 1, w=n)
    curves = []
    for weight in weights:
        costs = cost(weight, n, d)
        best = fitted[int(np.argmin(costs))]
        curves.append(
            CostCurve(
                weight,
                tuple(costs.tolist()),
                best.columns * best.rows,
                optimal_side(weight, coefficient) ** 2,
            )
        )
    return Tradeoff(
        ordered,
        coefficient,
        exponent,
        float(np.abs(d * n / coefficient - 1).max()),
        float(limit),
        float(slope),
        tuple(curves),
        *_free_area_law(n, area),
        _power(n, np.array([s.hausdorff_midsurface_mm for s in fitted], dtype=np.float64)),
    )


def _free_area_law(n: Floats, area: Floats) -> tuple[float, float]:
    """p and a of the law a + b n^p that is nearest to ``area`` (k,), weighted by n."""
    powers = np.linspace(-4, -0.25, 376)
    fits = [np.polyfit(n**power, area, 1, w=n) for power in powers.tolist()]
    misses = [
        float(np.linalg.norm(n * (np.polyval(fit, n**power) - area)))
        for fit, power in zip(fits, powers.tolist(), strict=True)
    ]
    best = int(np.argmin(misses))
    return float(powers[best]), float(fits[best][1])


def _power(n: Floats, distance: Floats) -> float | None:
    """The power of n by which ``distance`` falls; None where it is 0 or nearly so somewhere."""
    if not distance.min() > 1e-9:
        return None
    return float(np.polyfit(np.log(n), np.log(distance), 1)[0])


def cost(weight: float, n: Floats, d: Floats) -> Floats:
    """C_w of sheets with ``n`` facets a side at the relative distances ``d``."""
    return (1 - weight) * d / UNIT_DISTANCE + weight * n**2 / UNIT_FACETS


def optimal_side(weight: float, coefficient: float) -> float:
    """The n at which the cost is least, d being ``coefficient`` / n."""
    scale = UNIT_FACETS * coefficient / (2 * UNIT_DISTANCE)
    return float(((1 - weight) / weight * scale) ** (1 / 3))
