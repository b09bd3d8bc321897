"""The study in docs/energy-study.md: how flat-foldability decides the energy of folding.

    python benchmarks/energy_study.py [--facets 20] [--out docs/energy-study]

Prints the tables of the study as Markdown, and writes its figures to ``--out`` (with matplotlib).
Everything is computed afresh, and the same every time.
"""

from __future__ import annotations

import argparse
import itertools
import math
from functools import cache
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from scipy import sparse

from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.bar_hinge import Paper, sheet_model
from miurafab.origami.energy.curve import EnergyCurve, energy_curve
from miurafab.origami.energy.path import Path as FoldingPath
from miurafab.origami.energy.path import pulled_path
from miurafab.origami.fitting.constraints import OrigamiConstraints
from miurafab.origami.fitting.fit import FitRequest, FitResult, fit
from miurafab.origami.fitting.solver import project
from miurafab.origami.tessellation import Tessellation
from miurafab.origami.unfold import unfold
from miurafab.profiles import load_material
from miurafab.surfaces.catalogue import make_surface

SIZE_MM = 200.0
TARGETS: dict[str, dict[str, float]] = {
    "hypar": {},
    "saddle": {},
    "paraboloid": {},
    "bump": {},
    "sphere": {"width": 1.0, "height": 1.0},
}
LEVELS = (1e-1, 5e-2, 1.6e-2, 1e-2, 5e-3, 1e-3, 1e-4, 0.0)
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#555555")


@cache
def developable(name: str, facets: int) -> CreasePattern:
    """The sheet that is fitted to a target when nothing is asked about flat-foldability."""
    surface, parameters = make_surface(name, TARGETS[name])
    target = {"surface": name, "parameters": parameters}
    pattern = fit(
        FitRequest(surface=surface, facets=(facets, facets), size_mm=SIZE_MM, target=target)
    ).pattern
    assert pattern is not None, name
    return pattern


def kawasaki(pattern: CreasePattern) -> np.ndarray:
    """(I,) pi - a1 - a3 at each interior vertex of the folded form."""
    conditions, x, inner = _conditions(pattern)
    return -conditions(x)[0][-inner:]


def _conditions(pattern: CreasePattern) -> tuple[OrigamiConstraints, np.ndarray, int]:
    assert pattern.grid is not None
    assert pattern.folded_coords is not None
    columns, rows = pattern.grid
    sheet = Tessellation(pattern.folded_coords.reshape(rows, columns, 3))
    length = float(sheet.edge_lengths.mean())
    exact = OrigamiConstraints(sheet.grid, length, flat_foldable=True)
    return exact, sheet.vertices.ravel(), (columns - 2) * (rows - 2)


@cache
def scaled(name: str, facets: int, worst: float) -> CreasePattern:
    """The developable fit with all Kawasaki residuals scaled alike, the largest to ``worst``."""
    pattern = developable(name, facets)
    conditions, x, inner = _conditions(pattern)
    residuals = conditions(x)[0][-inner:]
    kept = residuals * worst / np.abs(residuals).max()

    def constraints(x: np.ndarray) -> tuple[np.ndarray, sparse.csr_array]:
        c, jacobian = conditions(x)
        c[-inner:] -= kept
        return c, jacobian

    solution = project(constraints, x, cap=0.25 * conditions.length)
    assert solution.converged, solution.reason
    return _pattern(pattern, solution.x)


@cache
def fitted(name: str, facets: int, worst: float) -> FitResult:
    """What the fit gives when it is asked for residuals within ``worst``, 0 for exact."""
    surface, _ = make_surface(name, TARGETS[name])
    return fit(
        FitRequest(surface=surface, facets=(facets, facets), size_mm=SIZE_MM, flat_foldable=worst)
    )


def _pattern(like: CreasePattern, x: np.ndarray) -> CreasePattern:
    assert like.grid is not None
    columns, rows = like.grid
    return unfold(Tessellation(x.reshape(rows, columns, 3)), scale=like.scale, target=like.target)


def moved(pattern: CreasePattern, name: str, facets: int) -> float:
    """The root mean square distance in mm of the vertices from those of the developable fit."""
    away = pattern.folded_coords - developable(name, facets).folded_coords
    return math.sqrt(float((away**2).sum(axis=1).mean()))


def row(*cells: object) -> None:
    print("| " + " | ".join(str(cell) for cell in cells) + " |")


def number(value: float) -> str:
    """Three digits; what is rounding is zero, and a dash is nothing."""
    if math.isnan(value):
        return "-"
    return f"{value:.2e}" if abs(value) > 1e-13 else "0"


def header(*cells: str) -> None:
    print()
    row(*cells)
    row(*["---"] * len(cells))


def hypars(facets: int) -> list[tuple[float, EnergyCurve]]:
    """Table 1: the barrier of the hypar against its residual, every residual scaled alike."""
    first = float(np.abs(kawasaki(developable("hypar", facets))).max())
    found = []
    header(
        "worst residual",
        "rms residual",
        "barrier (k_f L)",
        "at (deg)",
        "stiffness (k_f L / rad²)",
        "moved (mm)",
        "card (mJ)",
    )
    material = load_material("card-250")
    assert material.modulus_pa is not None
    paper = Paper(material.thickness_mm, material.modulus_pa)
    for worst in (first, *(level for level in LEVELS if level < first)):
        pattern = scaled("hypar", facets, worst)
        curve = energy_curve(pattern)
        joules = energy_curve(pattern, model=sheet_model(pattern, paper=paper)).report()["barrier"]
        at = "-" if curve.barrier_angle is None else f"{math.degrees(curve.barrier_angle):.1f}"
        residuals = kawasaki(pattern)
        row(
            f"{np.abs(residuals).max():.1e}",
            f"{math.sqrt(float((residuals**2).mean())):.1e}",
            f"{curve.barrier:.3e}"
            if curve.barrier
            else f"0 (E <= {curve.path.energies.max():.0e})",
            at,
            f"{curve.stiffness:.2e}" if not curve.rigid else "0",
            f"{moved(pattern, 'hypar', facets):.2f}",
            f"{joules * 1e3:.3g}",
        )
        found.append((worst, curve))
    slopes = [
        math.log(a.barrier / b.barrier) / math.log(high / low)
        for (high, a), (low, b) in itertools.pairwise(found[:-1])
    ]
    print("\nexponents between rows: " + ", ".join(f"{slope:.2f}" for slope in slopes))
    return found


def surfaces(facets: int) -> dict[str, list[tuple[float, float, float]]]:
    """Table 2: (residual, barrier if scaled, barrier if fitted) for every target."""
    found: dict[str, list[tuple[float, float, float]]] = {}
    header("target", "worst residual", "scaled", "fitted within it", "its distance (mm)")
    for name in TARGETS:
        first = float(np.abs(kawasaki(developable(name, facets))).max())
        found[name] = []
        for worst in (first, *(level for level in LEVELS if level < first)):
            alike = energy_curve(scaled(name, facets, worst), 24).barrier
            asked, away = math.nan, "-"
            if worst < first:
                result = fitted(name, facets, worst)
                if result.status == "converged":
                    assert result.pattern is not None
                    assert result.measurements is not None
                    asked = energy_curve(result.pattern, 24).barrier
                    away = f"{result.measurements.hausdorff_midsurface_mm:.2f}"
            found[name].append((worst, alike, asked))
            row(name, f"{worst:.1e}", number(alike), number(asked), away)
        falling = all(a[1] > b[1] for a, b in itertools.pairwise(found[name]))
        assert falling, f"the barrier of {name} does not fall"
    return found


def pulls(facets: int) -> list[tuple[str, str, FoldingPath]]:
    """Table 3: two opposite points drawn apart to a strain of 0.2."""
    first = float(np.abs(kawasaki(developable("hypar", facets))).max())
    columns = facets + 1
    last, half = columns**2 - 1, facets // 2
    points = {
        "corners": (0, last),
        "other corners": (columns - 1, last - columns + 1),
        "middles of sides": (half, last - half),
    }
    header(
        "points", "worst residual", "largest force (k_f)", "force at 0.2 (k_f)", "energy (k_f L)"
    )
    found = []
    for where, ends in points.items():
        for worst in (first, 1.6e-2, 0.0):
            path = pulled_path(sheet_model(scaled("hypar", facets, worst)), ends, 0.2)
            assert path.converged
            named = f"{worst:.1e}" if worst else "exact"
            row(
                where,
                named,
                number(np.abs(path.loads).max()),
                number(path.loads[-1]),
                number(path.energies[-1]),
            )
            found.append((where, named, path))
    return found


def figure(path: Path, draw: object, size: tuple[float, float] = (6.4, 4.2)) -> None:
    with rc_context({"svg.hashsalt": "miurafab", "font.size": 10}):
        made = Figure(figsize=size, layout="constrained")
        draw(made)  # type: ignore[operator]
        for axes in made.axes:
            axes.spines[["top", "right"]].set_visible(False)
        made.savefig(path, dpi=120, metadata={"Software": None})


def figures(
    folder: Path,
    curves: list[tuple[float, EnergyCurve]],
    barriers: dict[str, list[tuple[float, float, float]]],
    pulled: list[tuple[str, str, FoldingPath]],
) -> None:
    """Energy curves, barrier against residual, force against extension."""
    folder.mkdir(parents=True, exist_ok=True)

    def energies(made: Figure) -> None:
        axes = made.add_subplot()
        for worst, curve in curves:
            angle = np.abs(np.degrees(curve.path.drives))
            if worst:
                axes.semilogy(angle[1:], curve.path.energies[1:], label=f"{worst:.1e}")
        axes.set_xlim(130, 0)
        axes.set_ylim(1e-13, 1)
        axes.set_xlabel("fold angle of the driven crease, from folded to flat (degrees)")
        axes.set_ylabel("energy (k$_f$ L)")
        axes.legend(title="worst |π − α₁ − α₃|", frameon=False, ncols=3, loc="upper center")

    def scaling(made: Figure) -> None:
        axes = made.add_subplot()
        for (name, rows), colour in zip(barriers.items(), COLOURS, strict=True):
            residual, alike, asked = np.array([r for r in rows if r[0]]).T
            axes.loglog(residual, alike, "o-", color=colour, label=name, ms=4)
            axes.loglog(residual, asked, "x--", color=colour, ms=5, lw=0.9)
        axes.set_xlabel("worst |π − α₁ − α₃| (radians)")
        axes.set_ylabel("barrier (k$_f$ L)")
        axes.legend(frameon=False, title="solid: scaled\ndashed: fitted within")

    def forces(made: Figure) -> None:
        places = list(dict.fromkeys(where for where, _, _ in pulled))
        for axes, place in zip(made.subplots(1, len(places), sharey=True), places, strict=True):
            for where, named, path in pulled:
                if where == place:
                    axes.plot(path.drives / path.drives[0] - 1, path.loads * 1e4, label=named)
            axes.set_title(place)
            axes.set_xlabel("extension")
        made.axes[0].set_ylabel("force (10$^{-4}$ k$_f$)")
        made.axes[0].legend(title="worst |π − α₁ − α₃|", frameon=False)

    figure(folder / "energies.png", energies)
    figure(folder / "barriers.png", scaling)
    figure(folder / "forces.png", forces, (8.4, 3.4))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--facets", type=int, default=20, help="Facets along each side.")
    parser.add_argument("--out", type=Path, help="The folder for the figures.")
    options = parser.parse_args()
    curves = hypars(options.facets)
    barriers = surfaces(options.facets)
    pulled = pulls(options.facets)
    if options.out:
        figures(options.out, curves, barriers, pulled)


if __name__ == "__main__":
    main()
