"""Time the fit: growth with the number of facets, in processor time.

    python benchmarks/fit.py [--target hypar] [--largest 100000] [--fair 10000] [--csv FILE]
                             [--plot FILE]

First table: the plain projection of one seed (``project_cpu``), and the whole fit with ``polish``
off, from seed to audited pattern (``plain_cpu``). Second table: the whole fit with the fair
objective, up to ``--fair`` facets. Third table: the ring of a hyperboloid, solved by one period.

Each row runs in a process of its own, so that its peak memory is its own. Processor time is not
stretched by a busy machine; the libraries of linear algebra get one thread. ``rivals.py`` compares
with general-purpose solvers.
"""

from __future__ import annotations

import argparse
import csv
import math
import multiprocessing
import os
import resource
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from miurafab.geometry.polygons import edge_lengths
from miurafab.geometry.quads import QuadCharts
from miurafab.origami.fitting.fit import FitRequest, fit
from miurafab.origami.fitting.polish import STEP_CAP
from miurafab.origami.fitting.reduction import Unknowns
from miurafab.origami.fitting.seed import Corrugation, seed
from miurafab.origami.fitting.solver import project
from miurafab.origami.fitting.starts import ring as ring_start
from miurafab.surfaces.analytic import Revolution
from miurafab.surfaces.catalogue import make_surface

Floats = NDArray[np.float64]

FACETS = (400, 900, 2500, 4900, 10000, 25600, 48400, 100000)
FAIR = (400, 2500, 10000)
RINGS = (7680, 100_000)
CORRUGATION = Corrugation.from_stretches(1.3, 1.3)


def start(target: str, facets: int) -> tuple[Floats, Unknowns]:
    """The seed on ``target`` as a vector, and the unknowns of its sheet."""
    side = round(math.sqrt(facets))
    charts = QuadCharts.of_cells(np.ones((side, side), dtype=bool))
    made = seed(make_surface(target, {})[0], charts, side, side, CORRUGATION)
    length = float(edge_lengths(made.vertices, charts.edges_vertices).mean())
    return made.vertices.ravel(), Unknowns.all_of(charts, length)


def memory_mb() -> int:
    return round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)


def whole_fit(target: str, facets: int, polish: str) -> dict[str, Any]:
    """From the seed to the audited pattern."""
    side = round(math.sqrt(facets))
    surface = make_surface(target, {})[0]
    began = time.process_time()
    result = fit(FitRequest(surface=surface, facets=(side, side), size_mm=200.0, polish=polish))
    m = result.measurements
    return {
        "facets": side * side,
        "status": result.status,
        "plain_cpu" if polish == "off" else "fair_cpu": round(time.process_time() - began, 3),
        "iterations": result.iterations,
        "residual": max(m.max_planarity or 0, m.max_developability or 0) if m else math.nan,
        "memory_mb": memory_mb(),
    }


def projection(target: str, facets: int) -> dict[str, Any]:
    """The solving alone: the seed projected onto the constraints."""
    x, unknowns = start(target, facets)
    constraints = unknowns.constraints(False)
    began = time.process_time()
    solved = project(constraints, x, cap=STEP_CAP * unknowns.length)
    return {
        "facets": len(unknowns.charts.faces_vertices),
        "project_cpu": round(time.process_time() - began, 3),
        "iterations": solved.iterations,
        "residual": solved.residual,
    }


def ring(facets: int) -> dict[str, Any]:
    """The ring of a hyperboloid, ``facets`` in all, solved by one period and turned round."""
    columns = round(math.sqrt(facets / 2.5))
    rows = 2 * round(facets / columns / 2)
    surface = make_surface("hyperboloid", {"angle": "360deg"})[0]
    assert isinstance(surface, Revolution)
    began = time.process_time()
    made = ring_start(
        surface, FitRequest(surface=surface, facets=(columns, rows)), CORRUGATION, 1, 0.0
    )
    unknowns = made.unknowns
    constraints = unknowns.constraints(False)
    solved = project(constraints, made.x, cap=STEP_CAP * unknowns.length)
    charts, vertices = unknowns.whole(solved.x)
    seconds = time.process_time() - began
    whole = Unknowns.all_of(charts, unknowns.length).constraints(False)(vertices.ravel())[0]
    return {
        "facets": len(charts.faces_vertices),
        "project_cpu": round(seconds, 3),
        "iterations": solved.iterations,
        "residual": float(np.abs(whole).max()),
    }


def in_own_process(job: Callable[..., Any], *arguments: Any) -> Any:
    # a child reads these as it starts
    os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(job, arguments)


def show(rows: list[dict[str, Any]], row: dict[str, Any]) -> None:
    if not rows:
        print("  ".join(f"{key:>13}" for key in row), flush=True)
    cells = (f"{v:>13.1e}" if k == "residual" else f"{v!s:>13.13}" for k, v in row.items())
    print("  ".join(cells), flush=True)
    rows.append(row)


def growth(rows: list[dict[str, Any]], key: str) -> float:
    """The exponent p of time ~ facets^p from 2,000 facets on."""
    big = [row for row in rows if row["facets"] >= 2000]
    size, seconds = (np.log([row[k] for row in big]) for k in ("facets", key))
    return float(np.polyfit(size, seconds, 1)[0])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--target", default="hypar")
    parser.add_argument("--largest", type=int, default=100_000)
    parser.add_argument("--fair", type=int, default=10_000, help="the largest fair fit")
    parser.add_argument("--csv", type=Path, help="write the first table to this file")
    parser.add_argument("--plot", type=Path, help="draw time against facets to this picture")
    options = parser.parse_args()
    print(f"{options.target}: the projection, and the fit with polish off")
    plain: list[dict[str, Any]] = []
    for facets in FACETS:
        if facets <= options.largest:
            solved = in_own_process(projection, options.target, facets)
            whole = in_own_process(whole_fit, options.target, facets, "off")
            show(plain, {"project_cpu": solved["project_cpu"], **whole})
    if sum(row["facets"] >= 2000 for row in plain) > 2:
        print(f"the projection grows like facets^{growth(plain, 'project_cpu'):.2f}")
    print(f"{options.target}: the fit with the fair objective")
    fair: list[dict[str, Any]] = []
    for facets in FAIR:
        if facets <= options.fair:
            show(fair, in_own_process(whole_fit, options.target, facets, "on"))
    print("ring of a hyperboloid by one period")
    rings: list[dict[str, Any]] = []
    for facets in RINGS:
        if facets <= options.largest:
            show(rings, in_own_process(ring, facets))
    if options.csv is not None:
        with options.csv.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, plain[0].keys(), lineterminator="\n")
            writer.writeheader()
            writer.writerows(plain)
    if options.plot is not None:
        draw_growth(plain, options.plot, options.target)
    return 0


def draw_growth(rows: list[dict[str, Any]], path: Path, target: str) -> None:
    """Whole fit and solving alone against facets, beside a line of slope one."""
    from matplotlib.figure import Figure

    facets = np.array([row["facets"] for row in rows], dtype=np.float64)
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    axes = figure.add_subplot()
    for key, label in (("plain_cpu", "fit and audit"), ("project_cpu", "solving alone")):
        axes.loglog(facets, [row[key] for row in rows], "o-", label=label)
    linear = rows[-1]["plain_cpu"] * facets / facets[-1]
    axes.loglog(facets, linear, ":", color="gray", label="linear growth")
    axes.set_xlabel("facets")
    axes.set_ylabel("processor seconds")
    axes.set_title(f"Fitting {target}")
    axes.legend()
    axes.grid(True, which="both", alpha=0.25)
    figure.savefig(path, dpi=130)


if __name__ == "__main__":
    sys.exit(main())
