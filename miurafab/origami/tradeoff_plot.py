"""A trade-off as a table and as a plot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from miurafab.errors import InputError
from miurafab.origami.plotting import BLUE, ORANGE, picture_bytes, without_frame
from miurafab.origami.tradeoff import Tradeoff, cost, optimal_side

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIZE = (12.0, 3.8)
SHEETS, LAW = BLUE, ORANGE
MOST_TICKS = 6
"""So many sheets are labelled on an axis by their facets; of more, every second or third is."""


def tradeoff_table(found: Tradeoff) -> str:
    """One line a sheet as CSV: what was measured, and its cost at each weight."""
    names = ("hausdorff_mm", "hausdorff_relative", "hausdorff_midsurface_mm", "area_ratio")
    header = ["facets", "columns", "rows", "status", *names, "min_edge_mm"]
    header += [f"cost_{curve.weight:g}" for curve in found.curves]
    lines = [",".join(header)]
    place = 0
    for s in found.samples:
        values = [getattr(s, name) for name in (*names, "min_edge_mm")]
        costs: list[float | None] = [None] * len(found.curves)
        if s.status == "converged" and found.curves:
            costs = [curve.costs[place] for curve in found.curves]
            place += 1
        cells = [str(s.columns * s.rows), str(s.columns), str(s.rows), s.status]
        cells += ["" if value is None else repr(float(value)) for value in (*values, *costs)]
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


def tradeoff_plot(found: Tradeoff, kind: str, title: str) -> bytes:
    """The plot as a picture, ``kind`` png or svg; the same bytes for the same trade-off."""
    return picture_bytes(
        lambda axes: draw_tradeoff(found, axes, title), kind, SIZE, count=3, font_size=9
    )


def draw_tradeoff(found: Tradeoff, axes: Sequence[Axes], title: str = "") -> None:
    """Distance, area ratio and cost over the number of facets, in three axes.

    Raises :class:`~miurafab.errors.InputError` where there is no law to draw.
    """
    if found.coefficient is None or found.area_limit is None or found.area_slope is None:
        raise InputError("There is nothing to plot: fewer than three sheets were found.")
    from matplotlib import colormaps
    from matplotlib.ticker import LogLocator, NullLocator, ScalarFormatter

    distance, area, costs = axes
    facets = np.array([s.columns * s.rows for s in found.found], dtype=np.float64)
    n = np.geomspace(math.sqrt(facets[0]) / 1.15, math.sqrt(facets[-1]) * 1.15, 200)
    law = found.coefficient / n
    distance.loglog(
        n**2, 100 * law, color=LAW, lw=1.2, label=f"{100 * found.coefficient:.3g} % / n"
    )
    distance.loglog(
        facets, [100 * (s.hausdorff_relative or 0.0) for s in found.found], "o", color=SHEETS,
        label=f"sheets (free power: n$^{{{found.exponent:.2f}}}$)",
    )  # fmt: skip
    distance.set_ylabel("Hausdorff distance (% of the diagonal)")
    area.semilogx(
        n**2, found.area_limit + found.area_slope / n, color=LAW, lw=1.2,
        label=f"{found.area_limit:.3f} {found.area_slope:+.2g} / n",
    )  # fmt: skip
    area.axhline(found.area_limit, color=LAW, lw=0.8, ls=":")
    area.semilogx(
        facets, [s.area_ratio for s in found.found], "o", color=SHEETS,
        label=f"sheets (free power: n$^{{{found.area_power:.2f}}}$)",
    )  # fmt: skip
    area.set_ylabel("area of the paper over that of the target")
    shades = colormaps["viridis"](np.linspace(0.0, 0.85, len(found.curves)))
    for curve, shade in zip(found.curves, shades, strict=True):
        costs.loglog(n**2, cost(curve.weight, n, law), color=shade, lw=1.0)
        costs.loglog(facets, curve.costs, ".", color=shade, ms=4, label=f"w = {curve.weight:g}")
        best = np.array([optimal_side(curve.weight, found.coefficient)])
        if n[0] <= best[0] <= n[-1]:
            least = cost(curve.weight, best, found.coefficient / best)
            costs.loglog(best**2, least, "v", color=shade, ms=6)
    costs.set_ylabel("cost: (1 - w) distance / 1 %  +  w facets / 1000")
    ticks = facets[:: -(-len(facets) // MOST_TICKS)]
    for each in axes:
        each.set_xlabel("facets (n$^2$)")
        each.set_xticks(ticks, [f"{number:.0f}" for number in ticks])
        each.xaxis.set_minor_locator(NullLocator())
    without_frame(*axes)
    for each in (distance, costs):
        each.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        each.yaxis.set_major_formatter(ScalarFormatter())
        each.yaxis.set_minor_locator(NullLocator())
    for each in (distance, area):
        each.legend(frameon=False, fontsize=8)
    costs.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    distance.figure.suptitle(title)
