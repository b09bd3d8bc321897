"""Time the solver: growth with the number of facets, and side by side with general-purpose ones.

    python benchmarks/fit.py [--target hypar] [--largest 100000] [--rivals] [--csv FILE]
                             [--plot FILE]

First table: whole fits from seed to audited pattern, and the solving alone. Each size runs in a
process of its own, so that its peak memory is its own; ``fit_cpu`` is the processor's time, which
a busy machine does not stretch. Then the ring of a hyperboloid by one
period. With ``--rivals``: the same constraints from the same seed, least movement as the objective,
given to SciPy's SLSQP and trust-constr (the sizes they can do) and to IPOPT by CasADi
(``pip install casadi``) with exact derivatives; each timed on the solving alone.
"""

from __future__ import annotations

import argparse
import csv
import importlib.util
import math
import multiprocessing
import resource
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, sparse

from miurafab.geometry.polygons import edge_lengths
from miurafab.geometry.quads import QuadCharts
from miurafab.origami.fitting.constraints import OrigamiConstraints
from miurafab.origami.fitting.fit import FitRequest, fit
from miurafab.origami.fitting.polish import STEP_CAP
from miurafab.origami.fitting.reduction import Unknowns
from miurafab.origami.fitting.result import FitResult
from miurafab.origami.fitting.seed import Corrugation, seed
from miurafab.origami.fitting.solver import project
from miurafab.surfaces.analytic import revolution
from miurafab.surfaces.catalogue import make_surface

Floats = NDArray[np.float64]

FACETS = (400, 900, 2304, 4900, 10000, 25600, 48400, 100000)
CORRUGATION = Corrugation.from_stretches(1.3, 1.3)


def start(target: str, facets: int) -> tuple[Floats, Unknowns]:
    """The seed on ``target`` as a vector, and the constraints on it."""
    side = round(math.sqrt(facets))
    charts = QuadCharts.of_cells(np.ones((side, side), dtype=bool))
    made = seed(make_surface(target, {})[0], charts, side, side, CORRUGATION)
    length = float(edge_lengths(made.vertices, charts.edges_vertices).mean())
    return made.vertices.ravel(), Unknowns.all_of(charts, length)


def whole_fit(target: str, facets: int) -> dict[str, Any]:
    """One fit, and again the solving alone."""
    side = round(math.sqrt(facets))
    worked = time.process_time()
    result: FitResult = fit(
        FitRequest(surface=make_surface(target, {})[0], facets=(side, side), size_mm=200.0)
    )
    worked = time.process_time() - worked
    x, constraints = start(target, facets)
    began = time.perf_counter()
    solved = project(constraints, x, constraints.places, cap=STEP_CAP * constraints.length)
    seconds = time.perf_counter() - began
    m = result.measurements
    worst = max(m.max_planarity or 0, m.max_developability or 0) if m else math.nan
    return {
        "facets": side * side,
        "status": result.status,
        "fit_seconds": round(result.seconds, 3),
        "fit_cpu": round(worked, 3),
        "solve_seconds": round(seconds, 3),
        "iterations": solved.iterations,
        "residual": worst,
        "memory_mb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024),
    }


def in_own_process(job: Callable[..., Any], *arguments: Any) -> Any:
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(job, arguments)


def ring(facets: int) -> dict[str, Any]:
    """The ring of a hyperboloid, ``facets`` in all, solved by one period and turned round."""
    columns = round(math.sqrt(facets / 2.5))
    rows = 2 * round(facets / columns / 2)
    surface = make_surface("hyperboloid", {"angle": "360deg"})[0]
    began = time.perf_counter()
    beta = surface.angle / rows
    first, _ = seed(revolution(surface.profile, beta), columns + 1, 2, CORRUGATION)
    unknowns = Unknowns(columns + 1, rows + 1, float(first.edge_lengths.mean()), 2 * beta)
    constraints = unknowns.constraints(False)
    cap = STEP_CAP * unknowns.length
    solved = project(constraints, first.vertices.ravel(), unknowns.places, cap=cap)
    sheet = unknowns.sheet(solved.x)
    seconds = time.perf_counter() - began
    whole = OrigamiConstraints(sheet.grid, unknowns.length)(sheet.vertices.ravel())[0]
    return {
        "facets": len(sheet.grid.faces_vertices),
        "solve_seconds": round(seconds, 3),
        "iterations": solved.iterations,
        "residual": float(np.abs(whole).max()),
    }


def by_projection(x: Floats, constraints: OrigamiConstraints) -> tuple[Floats, int]:
    solved = project(constraints, x, constraints.places, cap=STEP_CAP * constraints.length)
    return solved.x, solved.iterations


def by_scipy(method: str) -> Callable[[Floats, OrigamiConstraints], tuple[Floats, int]]:
    """SciPy with analytic derivatives; trust-constr gets the sparse Jacobian."""

    def solve(x: Floats, constraints: OrigamiConstraints) -> tuple[Floats, int]:
        def jacobian(y: Floats) -> Any:
            matrix = constraints(y)[1]
            return matrix.toarray() if method == "SLSQP" else sparse.csr_matrix(matrix)

        if method == "SLSQP":
            conditions: Any = {"type": "eq", "fun": lambda y: constraints(y)[0], "jac": jacobian}
            options = {"maxiter": 100, "ftol": 1e-14}
        else:
            conditions = optimize.NonlinearConstraint(
                lambda y: constraints(y)[0], 0.0, 0.0, jac=jacobian, hess=optimize.BFGS()
            )
            warnings.simplefilter("ignore", UserWarning)  # that a quasi-Newton step was skipped
            options = {"maxiter": 200, "gtol": 1e-10}
        found = optimize.minimize(
            lambda y: (0.5 * float((y - x) @ (y - x)), y - x),
            x,
            jac=True,
            method=method,
            constraints=[conditions],
            options=options,
        )
        return found.x, int(found.nit)

    return solve


def by_ipopt(x: Floats, constraints: OrigamiConstraints) -> tuple[Floats, int]:
    """IPOPT with exact derivatives by CasADi; building the expressions is not timed."""
    import casadi

    grid, length = constraints.grid, constraints.length
    unknown = casadi.SX.sym("x", len(x))
    points = casadi.reshape(unknown, 3, len(x) // 3).T

    def at(vertices: NDArray[np.int64]) -> Any:
        return points[vertices.tolist(), :]

    def cross(a: Any, b: Any) -> Any:
        return casadi.horzcat(
            a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1],
            a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2],
            a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0],
        )

    faces = grid.faces_vertices
    a, b, c = (at(faces[:, k]) - at(faces[:, 0]) for k in (1, 2, 3))
    rows = [casadi.sum2(a * cross(b, c)) / length**3]
    centre, around = grid.interior_vertices, grid.interior_neighbours
    spokes = [at(around[:, k]) - at(centre) for k in range(4)]
    total: Any = -2 * np.pi
    for k in range(4):
        p, q = spokes[k], spokes[(k + 1) % 4]
        sine = casadi.sqrt(casadi.sum2(cross(p, q) ** 2))
        total = total + casadi.atan2(sine, casadi.sum2(p * q))
    rows.append(total)
    problem = {
        "x": unknown,
        "f": casadi.sumsqr(unknown - x) / 2,
        "g": casadi.vertcat(*rows),
    }
    options = {
        "ipopt.print_level": 0,
        "print_time": False,
        "ipopt.tol": 1e-10,
        "ipopt.constr_viol_tol": 1e-10,
        "ipopt.sb": "yes",
    }
    solver = casadi.nlpsol("solver", "ipopt", problem, options)
    global _built
    _built = time.perf_counter()
    found = solver(x0=x, lbg=0, ubg=0)
    return np.asarray(found["x"]).ravel(), int(solver.stats()["iter_count"])


_built: float | None = None


def rival(name: str, target: str, facets: int) -> dict[str, Any]:
    solvers = {
        "this": by_projection,
        "SLSQP": by_scipy("SLSQP"),
        "trust-constr": by_scipy("trust-constr"),
        "IPOPT": by_ipopt,
    }
    x, constraints = start(target, facets)
    began = time.perf_counter()
    found, iterations = solvers[name](x, constraints)
    ended = time.perf_counter()
    return {
        "solver": name,
        "facets": round(math.sqrt(facets)) ** 2,
        "solve_seconds": round(ended - (_built or began), 3),
        "iterations": iterations,
        "residual": float(np.abs(constraints(found)[0]).max()),
        "moved": float(np.linalg.norm(found - x)),
    }


def show(rows: list[dict[str, Any]], row: dict[str, Any]) -> None:
    if not rows:
        print("  ".join(f"{key:>13}" for key in row), flush=True)
    cells = (f"{v:>13.1e}" if k == "residual" else f"{v!s:>13.13}" for k, v in row.items())
    print("  ".join(cells), flush=True)
    rows.append(row)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--target", default="hypar")
    parser.add_argument("--largest", type=int, default=100_000)
    parser.add_argument("--rivals", action="store_true", help="also run the general solvers")
    parser.add_argument("--csv", type=Path, help="write the first table to this file")
    parser.add_argument("--plot", type=Path, help="draw time against facets to this picture")
    options = parser.parse_args()
    print(f"{options.target}: whole fits")
    growth: list[dict[str, Any]] = []
    for facets in FACETS:
        if facets <= options.largest:
            show(growth, in_own_process(whole_fit, options.target, facets))
    big = [row for row in growth if row["facets"] >= 2000]
    if len(big) > 2:
        size, seconds = (np.log([row[k] for row in big]) for k in ("facets", "solve_seconds"))
        print(f"solving grows like facets^{np.polyfit(size, seconds, 1)[0]:.2f}")
    if options.csv is not None:
        with options.csv.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, growth[0].keys(), lineterminator="\n")
            writer.writeheader()
            writer.writerows(growth)
    if options.plot is not None:
        draw_growth(growth, options.plot, options.target)
    print("ring of a hyperboloid by one period")
    rings: list[dict[str, Any]] = []
    for facets in (7680, 100_000):
        show(rings, ring(facets))
    if options.rivals:
        compare(options.target, options.largest)
    return 0


def draw_growth(rows: list[dict[str, Any]], path: Path, target: str) -> None:
    """Whole fit and solving alone against facets, beside a line of slope one."""
    from matplotlib.figure import Figure

    facets = np.array([row["facets"] for row in rows], dtype=np.float64)
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    axes = figure.add_subplot()
    for key, label in (("fit_seconds", "fit and audit"), ("solve_seconds", "solving alone")):
        axes.loglog(facets, [row[key] for row in rows], "o-", label=label)
    linear = rows[-1]["fit_seconds"] * facets / facets[-1]
    axes.loglog(facets, linear, ":", color="gray", label="linear growth")
    axes.set_xlabel("facets")
    axes.set_ylabel("seconds")
    axes.set_title(f"Fitting {target}")
    axes.legend()
    axes.grid(True, which="both", alpha=0.25)
    figure.savefig(path, dpi=130)


def compare(target: str, largest: int) -> None:
    print(f"{target}: the same problem by several solvers, solving alone")
    has_casadi = importlib.util.find_spec("casadi") is not None
    if not has_casadi:
        print("CasADi is not installed, so IPOPT is left out: pip install casadi")
    plan = [("this", 64), ("SLSQP", 64), ("trust-constr", 64), ("this", 400), ("this", 2304)]
    if has_casadi:
        plan += [("IPOPT", 64), ("IPOPT", 400), ("IPOPT", 2304)]
    rows: list[dict[str, Any]] = []
    for name, facets in sorted(plan, key=lambda pair: pair[1]):
        if facets <= largest:
            show(rows, in_own_process(rival, name, target, facets))
    times = {(row["solver"], row["facets"]): row["solve_seconds"] for row in rows}
    for facets in (64, 400, 2304):
        if ("IPOPT", facets) in times and ("this", facets) in times:
            factor = times["IPOPT", facets] / max(times["this", facets], 1e-3)
            print(f"{facets} facets: {factor:.0f} times as fast as IPOPT")


if __name__ == "__main__":
    sys.exit(main())
