"""The study in docs/energy-study.md: how flat-foldability decides the energy of folding.

    python benchmarks/energy_study.py [docs/energy-study.md]

Prints the tables of the study as Markdown, or writes them into the page between
``<!-- energy_study: NAME -->`` and ``<!-- end -->``, and its figures into the folder beside it
(with matplotlib). Everything is computed afresh, and the same every time.
"""

from __future__ import annotations

import argparse
import itertools
import math
import statistics
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from closest_sheet import Closest, closest
from matplotlib import rc_context
from matplotlib.figure import Figure
from page_tables import Rows, markdown, write_tables

from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.bar_hinge import Paper, sheet_model
from miurafab.origami.energy.curve import EnergyCurve, energy_curve
from miurafab.origami.fitting.fit import FitRequest, FitResult, fit
from miurafab.origami.fitting.scaling import residuals, with_residual, worst_residual
from miurafab.profiles import load_material
from miurafab.surfaces.catalogue import make_surface

SIZE_MM = 200.0
FACETS = 20
TARGETS: dict[str, dict[str, object]] = {
    "hypar": {},
    "saddle": {},
    "paraboloid": {},
    "bump": {},
    "sphere": {"width": "1rad", "height": "1rad"},
}
LEVELS = (1e-1, 5e-2, 1.6e-2, 1e-2, 5e-3, 1e-3, 1e-4, 0.0)
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#555555")
GRIDS = (8, 10, 12, 14, 16, 18, 20)
HEIGHT, CHANGES = 0.5, (0.0, -0.02, -0.01, 0.01, 0.02)
CURVE_GRID = 12
PARTS = (0.3, 0.1, 0.03)
WEIGHTS = (1e-3, 1e-2, 1e-1)
LIMITS = (1.6e-2, 3.2e-3, 0.0)


def _request(
    name: str, facets: int, limit: float | None = None, **parameters: object
) -> FitRequest:
    surface, _ = make_surface(name, TARGETS[name] | parameters)
    return FitRequest(
        surface=surface, facets=(facets, facets), size_mm=SIZE_MM, flat_foldable=limit
    )


@cache
def fitted(name: str, facets: int, limit: float | None = None) -> FitResult:
    """What `miurafab fit` finds."""
    result = fit(_request(name, facets, limit))
    assert result.status == "converged", (name, result.advice)
    return result


@cache
def scaled(name: str, facets: int, worst: float) -> CreasePattern:
    """The fitted sheet with all its residuals scaled alike, the largest to ``worst``."""
    pattern = fitted(name, facets).pattern
    assert pattern is not None
    return with_residual(pattern, worst)


def levels(name: str, facets: int) -> list[float]:
    """The residuals of the tables: that of the fitted sheet, then smaller ones."""
    pattern = fitted(name, facets).pattern
    assert pattern is not None
    first = worst_residual(pattern)
    return [first, *(level for level in LEVELS if level < first)]


def moved(pattern: CreasePattern, name: str, facets: int) -> float:
    """The root mean square distance in mm of the vertices from those of the fitted sheet."""
    first = fitted(name, facets).pattern
    assert first is not None
    away = pattern.folded_coords - first.folded_coords
    return math.sqrt(float((away**2).sum(axis=1).mean()))


def number(value: float) -> str:
    """Three digits; what is rounding is zero."""
    return f"{value:.2e}" if abs(value) > 1e-13 else "0"


@cache
def hypars() -> tuple[tuple[float, EnergyCurve], ...]:
    """The hypar with ever smaller residuals, all scaled alike, and its energy."""
    worsts = levels("hypar", FACETS)
    return tuple((worst, energy_curve(scaled("hypar", FACETS, worst))) for worst in worsts)


def hypar_table() -> str:
    """The barrier of the hypar against its residual."""
    material = load_material("card-250")
    assert material.modulus_pa is not None
    paper = Paper(material.thickness_mm, material.modulus_pa)
    rows = []
    for worst, curve in hypars():
        pattern = scaled("hypar", FACETS, worst)
        joules = energy_curve(pattern, model=sheet_model(pattern, paper=paper)).report()["barrier"]
        found = residuals(pattern)
        rows.append(
            (
                number(float(np.abs(found).max())),
                number(math.sqrt(float((found**2).mean()))),
                number(curve.barrier),
                "-" if curve.barrier_angle is None else f"{math.degrees(curve.barrier_angle):.1f}",
                "0" if curve.rigid else f"{curve.stiffness:.2e}",
                f"{moved(pattern, 'hypar', FACETS):.2f}",
                f"{joules * 1e3:.3g}",
            )
        )
    head = ("worst residual", "rms residual", "barrier (k_f L)", "at (deg)")
    return markdown((*head, "stiffness (k_f L / rad²)", "moved (mm)", "card (mJ)"), rows)


def exponents() -> str:
    """How steeply the barrier falls from row to row."""
    falls = [
        math.log(a.barrier / b.barrier) / math.log(high / low)
        for (high, a), (low, b) in itertools.pairwise(hypars()[:-1])
    ]
    said = ", ".join(f"{fall:.2f}" for fall in falls)
    return f"The exponents from row to row are {said}.\n"


@cache
def scaled_barriers(name: str) -> tuple[tuple[float, float], ...]:
    """(residual, barrier) of one target."""
    found = tuple(
        (worst, energy_curve(scaled(name, FACETS, worst), 24).barrier)
        for worst in levels(name, FACETS)
    )
    assert all(a[1] > b[1] for a, b in itertools.pairwise(found)), f"{name} does not fall"
    return found


def surfaces_table() -> str:
    """The barrier of every target against its residual, and what exactness costs."""
    rows = []
    for name in TARGETS:
        found = dict(scaled_barriers(name))
        first = next(iter(found))
        exact = fitted(name, FACETS, 0.0).measurements
        assert exact is not None
        rows.append(
            (
                name,
                number(first),
                number(found[first]),
                *(number(found[level]) if level in found else "-" for level in LEVELS[1:-1]),
                f"{exact.hausdorff_midsurface_mm:.2f}",
            )
        )
    worsts = (f"at {level:g}" for level in LEVELS[1:-1])
    return markdown(
        ("target", "worst residual", "its barrier", *worsts, "exact fit: distance (mm)"), rows
    )


class Pair(NamedTuple):
    """The sheets nearest to one target, without a limit and within a tenth of its residual."""

    free: Closest
    held: Closest

    @property
    def ratio(self) -> float:
        """The barrier within the limit over that without."""
        return self.held.barrier / self.free.barrier


@cache
def pair(facets: int, change: float) -> Pair:
    """The pair of a hypar whose height is changed by a part."""
    height = HEIGHT * (1 + change)
    free = closest(_request("hypar", facets, height=height))
    return Pair(free, closest(_request("hypar", facets, free.worst / 10, height=height)))


def _spread(values: list[float], digits: str) -> str:
    low, high = format(min(values), digits), format(max(values), digits)
    return f"{statistics.median(values):{digits}} [{low} to {high}]"


def halving_rows(facets: int, changes: tuple[float, ...] = CHANGES) -> tuple[str, ...]:
    """One row of the table of ratios."""
    pairs = [pair(facets, change) for change in changes]
    return (
        f"{facets} x {facets}",
        f"{pairs[0].free.worst:.3f}",
        f"{pairs[0].ratio:.2f}",
        _spread([p.ratio for p in pairs], ".2f"),
        _spread([p.free.barrier * 1e3 for p in pairs], ".2f"),
        _spread([p.held.barrier * 1e3 for p in pairs], ".2f"),
        f"{pairs[0].free.sheet.deviation_mm:.3f}",
        f"{pairs[0].held.sheet.deviation_mm:.3f}",
        f"{max(max(p.free.last_gain, p.held.last_gain) for p in pairs):.1%}",
    )


HALVING_HEAD = (
    "facets",
    "residual without limit",
    "ratio of barriers",
    "median [range] of five heights",
    "barrier without (1e-3 k_f L)",
    "barrier within a tenth",
    "distance without (mm)",
    "distance within (mm)",
    "gain of the last 40 steps, at most",
)


def halving_table() -> str:
    """The ratio of barriers on every grid."""
    return markdown(HALVING_HEAD, [halving_rows(facets) for facets in GRIDS])


class Point(NamedTuple):
    """A sheet on one of the curves of barrier against distance."""

    family: str
    asked: str
    worst: float
    distance: float
    barrier: float


def _nearest(asked: str, sheet: Closest, family: str) -> Point:
    return Point(family, asked, sheet.worst, sheet.sheet.deviation_mm, sheet.barrier)


def stiffer_movement(weight: float) -> Point:
    """The nearest sheet that moves little from its projected seed, without a limit."""
    sheet = closest(_request("hypar", CURVE_GRID, height=HEIGHT), weight)
    return _nearest(f"w = {weight:g}", sheet, "nearest, evenly moved")


def even(limit: float | None) -> Point:
    """What `miurafab fit` finds, whose facets are even."""
    result = fitted("hypar", CURVE_GRID, limit)
    assert result.pattern is not None
    assert result.deviation_mm is not None
    asked = "no limit" if limit is None else "exact" if limit == 0 else f"within {limit:g}"
    worst = worst_residual(result.pattern)
    barrier = energy_curve(result.pattern, 24).barrier
    return Point("miurafab fit", asked, worst, result.deviation_mm, barrier)


@cache
def curves() -> tuple[Point, ...]:
    """Barrier against distance: nearest sheets within limits, evenly moved ones, fitted ones."""
    free = closest(_request("hypar", CURVE_GRID, height=HEIGHT))
    points = [_nearest("no limit", free, "nearest")]
    for part in PARTS:
        sheet = closest(_request("hypar", CURVE_GRID, part * free.worst, height=HEIGHT))
        points.append(_nearest(f"within {part:g} of it", sheet, "nearest"))
    points += [stiffer_movement(weight) for weight in WEIGHTS]
    points += [even(limit) for limit in (None, *LIMITS)]
    return tuple(points)


def curve_row(point: Point) -> tuple[str, ...]:
    """A row of the table of curves."""
    numbers = (number(point.worst), f"{point.distance:.3f}", number(point.barrier))
    return (point.family, point.asked, *numbers)


def curves_table() -> str:
    """The table of curves."""
    head = ("sheet", "residual", "worst residual", "distance (mm)", "barrier (k_f L)")
    return markdown(head, [curve_row(point) for point in curves()])


def summary(rows: Rows, points: Rows) -> str:
    """What the tables of ratios and of curves say, in sentences."""
    medians = [float(row[3].split(" ")[0]) for row in rows]
    spread = [float(word.strip("[]")) for row in rows for word in row[3].split(" ")[1::2]]
    near, moved, fits = (
        [row for row in points if row[0] == name]
        for name in ("nearest", "nearest, evenly moved", "miurafab fit")
    )
    free, softest = float(near[0][4]), min(float(row[4]) for row in moved)
    sentences = [
        "Within a tenth of the residual the nearest sheet has "
        f"{min(medians):.2f} to {max(medians):.2f} times its barrier (medians of the grids; "
        f"{min(spread):.2f} to {max(spread):.2f} over all sheets).",
        "Without any limit, a sheet that is moved more evenly has down to "
        f"{softest / free:.2g} times the barrier of the nearest sheet.",
        f"The sheet of `miurafab fit` has {float(fits[0][4]) / free:.1g} times the barrier of the "
        "nearest sheet, at a distance of "
        f"{fits[0][3]} mm against {near[0][3]} mm; within {LIMITS[0]:g} its barrier "
        f"is {float(fits[1][4]) / float(fits[0][4]):.1g} times its own without a limit, within "
        f"{LIMITS[1]:g} {float(fits[2][4]) / float(fits[0][4]):.1g} times.",
    ]
    return "".join(f"- {sentence}\n" for sentence in sentences)


def figure(path: Path, draw: Callable[[Figure], None], size: tuple[float, float]) -> None:
    """Draw into a file, with the same bytes every time."""
    with rc_context({"svg.hashsalt": "miurafab", "font.size": 10}):
        made = Figure(figsize=size, layout="constrained")
        draw(made)
        for axes in made.axes:
            axes.spines[["top", "right"]].set_visible(False)
        made.savefig(path, dpi=120, metadata={"Software": None})


def draw_energies(made: Figure) -> None:
    """Energy along the path."""
    axes = made.add_subplot()
    for worst, curve in hypars():
        angle = np.abs(np.degrees(curve.path.drives))
        if worst:
            axes.semilogy(angle[1:], curve.path.energies[1:], label=f"{worst:.1e}")
    axes.set_xlim(130, 0)
    axes.set_ylim(1e-13, 1)
    axes.set_xlabel("fold angle of the driven crease, from folded to flat (degrees)")
    axes.set_ylabel("energy (k$_f$ L)")
    axes.legend(title="worst |π − α₁ − α₃|", frameon=False, ncols=3, loc="upper center")


def draw_barriers(made: Figure) -> None:
    """Barrier against residual."""
    axes = made.add_subplot()
    for name, colour in zip(TARGETS, COLOURS, strict=True):
        worst, barrier = np.array([row for row in scaled_barriers(name) if row[0]]).T
        axes.loglog(worst, barrier, "o-", color=colour, label=name, ms=4)
    axes.set_xlabel("worst |π − α₁ − α₃| (radians)")
    axes.set_ylabel("barrier (k$_f$ L)")
    axes.legend(frameon=False)


def draw_halving(made: Figure) -> None:
    """The ratio of barriers on every grid, and barrier against distance."""
    left, right = made.subplots(1, 2)
    for facets in GRIDS:
        ratios = [pair(facets, change).ratio for change in CHANGES]
        left.plot([facets] * len(ratios), ratios, ".", color=COLOURS[4], ms=5)
        left.plot([facets], [statistics.median(ratios)], "_", color=COLOURS[1], ms=16, mew=2.5)
    left.axhline(0.5, color="#999999", lw=0.8, ls="--")
    left.set_ylim(0, None)
    left.set_xticks(GRIDS)
    left.set_xlabel("facets along a side")
    left.set_ylabel("barrier within a tenth / without limit")
    families = dict.fromkeys(point.family for point in curves())
    for family, colour, mark in zip(families, COLOURS, "os^", strict=False):
        own = [point for point in curves() if point.family == family and point.barrier]
        own.sort(key=lambda point: point.distance)
        distances = [point.distance for point in own]
        right.semilogy(
            distances,
            [point.barrier for point in own],
            f"{mark}-",
            color=colour,
            label=family,
            ms=5,
        )
    right.set_xlabel("distance from the target (mm)")
    right.set_ylabel("barrier (k$_f$ L)")
    right.legend(frameon=False)


FIGURES: dict[str, tuple[Callable[[Figure], None], tuple[float, float]]] = {
    "energies": (draw_energies, (6.4, 4.2)),
    "barriers": (draw_barriers, (6.4, 4.2)),
    "halving": (draw_halving, (9.0, 3.8)),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("page", nargs="?", type=Path, help="The page to write the tables into.")
    page = parser.parse_args().page
    tables = {
        "hypar": hypar_table(),
        "exponents": exponents(),
        "surfaces": surfaces_table(),
        "halving": halving_table(),
        "curves": curves_table(),
        "summary": summary(
            [halving_rows(facets) for facets in GRIDS], [curve_row(point) for point in curves()]
        ),
    }
    write_tables(page, "energy_study", tables)
    if page is not None:
        folder = page.with_suffix("")
        folder.mkdir(parents=True, exist_ok=True)
        for name, (draw, size) in FIGURES.items():
            figure(folder / f"{name}.png", draw, size)


if __name__ == "__main__":
    main()
