"""The same problems by this solver and by general-purpose ones, in processor time.

    python benchmarks/rivals.py [--target hypar] [--facets 400,900,1600] [--timeout 600]

Problem ``exact``: any sheet that meets the constraints, from the seed. Problem ``nearest``: of
those the one nearest to the seed, min |x - x0|^2 / 2 with c(x) = 0; its answers must agree, so
``moved`` = |x - x0| is shown to nine digits. IPOPT gets exact derivatives by CasADi
(``pip install casadi``); building its expressions is timed apart. SciPy's SLSQP and trust-constr
get the smallest size only.

This package answers ``exact`` by its projection. It has no solver for ``nearest``, which no fit
needs; here one is made of its parts, Newton's method in the tangent space: at an exact sheet x,
with mu the multipliers, projected conjugate gradients minimise the quadratic model with the Hessian
I + sum mu_i H_i (by differences of J^T mu), and the step is projected back.
"""

from __future__ import annotations

import argparse
import importlib.util
import multiprocessing
import os
import sys
import time
import warnings
from typing import Any

import numpy as np
from fit import STEP_CAP, Floats, show, start
from numpy.typing import NDArray
from scipy import optimize, sparse

from miurafab.origami.fitting.reduction import Unknowns
from miurafab.origami.fitting.solver import GramFactor, project

FACETS = (400, 900, 1600)
SMALL = 64


def exact(x: Floats, unknowns: Unknowns) -> tuple[Floats, int, float]:
    """The projection."""
    solved = project(unknowns.constraints(False), x, cap=STEP_CAP * unknowns.length)
    return solved.x, solved.iterations, 0.0


def nearest(seed: Floats, unknowns: Unknowns) -> tuple[Floats, int, float]:
    """Newton's method in the tangent space of the constraints."""
    constraints, length = unknowns.constraints(False), unknowns.length
    x, factor = exact(seed, unknowns)[0], GramFactor()
    rounds = 0
    while rounds < 50:
        jacobian = constraints(x)[1]
        transposed = jacobian.T.tocsr()
        factor.renew(jacobian)
        mu = -factor.solve(jacobian @ (x - seed))
        bent = transposed @ mu
        slope = x - seed + bent
        if np.abs(slope).max() <= 1e-7 * length:
            break

        def times(d: Floats, x: Floats = x, mu: Floats = mu, bent: Floats = bent) -> Floats:
            h = 1e-6 * length / np.abs(d).max()
            return d + (constraints(x + h * d)[1].T @ mu - bent) / h

        residual = -slope
        step, direction = np.zeros_like(x), residual.copy()
        size = first = residual @ residual
        while size > 1e-4 * first:
            image = times(direction)
            curvature = direction @ image
            if curvature <= 0:
                step = step if step.any() else direction
                break
            step = step + size / curvature * direction
            residual = residual - size / curvature * image
            residual = residual - transposed @ factor.solve(jacobian @ residual)
            size, before = residual @ residual, size
            direction = residual + size / before * direction
        step *= min(1.0, 0.5 * length / np.abs(step).max())
        for _ in range(10):
            trial = exact(x + step, unknowns)[0]
            if np.linalg.norm(trial - seed) < np.linalg.norm(x - seed):
                break
            step = step / 3
        else:
            break
        x, rounds = trial, rounds + 1
    return x, rounds, 0.0


def by_scipy(method: str, x: Floats, unknowns: Unknowns) -> tuple[Floats, int, float]:
    """SciPy on ``nearest`` with analytic derivatives; trust-constr gets the sparse Jacobian."""
    constraints = unknowns.constraints(False)

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
    return found.x, int(found.nit), 0.0


def by_ipopt(problem: str, x: Floats, unknowns: Unknowns) -> tuple[Floats, int, float]:
    """IPOPT with exact derivatives by CasADi, and the processor seconds of building them."""
    import casadi

    began = time.process_time()
    charts, length = unknowns.charts, unknowns.length
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

    faces = charts.faces_vertices
    a, b, c = (at(faces[:, k]) - at(faces[:, 0]) for k in (1, 2, 3))
    rows = [casadi.sum2(a * cross(b, c)) / length**3]
    centre, around = charts.interior_vertices, charts.interior_neighbours
    spokes = [at(around[:, k]) - at(centre) for k in range(4)]
    total: Any = -2 * np.pi
    for k in range(4):
        p, q = spokes[k], spokes[(k + 1) % 4]
        sine = casadi.sqrt(casadi.sum2(cross(p, q) ** 2))
        total = total + casadi.atan2(sine, casadi.sum2(p * q))
    rows.append(total)
    distance = casadi.sumsqr(unknown - x) / 2
    solver = casadi.nlpsol(
        "solver",
        "ipopt",
        {
            "x": unknown,
            "f": distance if problem == "nearest" else casadi.SX(0),
            "g": casadi.vertcat(*rows),
        },
        {
            "ipopt.print_level": 0,
            "print_time": False,
            "ipopt.tol": 1e-10,
            "ipopt.constr_viol_tol": 1e-10,
            "ipopt.sb": "yes",
        },
    )
    built = time.process_time() - began
    found = solver(x0=x, lbg=0, ubg=0)
    return np.asarray(found["x"]).ravel(), int(solver.stats()["iter_count"]), built


def solved(problem: str, name: str, target: str, facets: int) -> dict[str, Any]:
    x, unknowns = start(target, facets)
    began = time.process_time()
    if name == "IPOPT":
        found, iterations, built = by_ipopt(problem, x, unknowns)
    elif name == "this":
        found, iterations, built = (exact if problem == "exact" else nearest)(x, unknowns)
    else:
        found, iterations, built = by_scipy(name, x, unknowns)
    worked = time.process_time() - began
    return {
        "problem": problem,
        "solver": name,
        "facets": len(unknowns.charts.faces_vertices),
        "solve_cpu": round(worked - built, 3),
        "build_cpu": round(built, 3),
        "iterations": iterations,
        "residual": float(np.abs(unknowns.constraints(False)(found)[0]).max()),
        "moved": f"{np.linalg.norm(found - x):.9f}",
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--target", default="hypar")
    parser.add_argument("--facets", default=",".join(map(str, FACETS)))
    parser.add_argument("--timeout", type=float, default=600.0, help="wall seconds for one solver")
    options = parser.parse_args()
    sizes = [int(size) for size in options.facets.split(",")]
    rivals = ["this"]
    if importlib.util.find_spec("casadi") is not None:
        rivals.append("IPOPT")
    else:
        print("CasADi is not installed, so IPOPT is left out: pip install casadi")
    plan = [("nearest", name, SMALL) for name in (*rivals, "SLSQP", "trust-constr")]
    plan += [(p, n, size) for size in sizes for p in ("exact", "nearest") for n in rivals]
    os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")
    rows: list[dict[str, Any]] = []
    for problem, name, facets in plan:
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            waiting = pool.apply_async(solved, (problem, name, options.target, facets))
            try:
                show(rows, waiting.get(options.timeout))
            except multiprocessing.TimeoutError:
                print(f"{problem} by {name} at {facets} facets: over {options.timeout:g} s")
    times = {(row["problem"], row["solver"], row["facets"]): row["solve_cpu"] for row in rows}
    for (problem, name, facets), seconds in times.items():
        if name == "IPOPT":
            ratio = seconds / max(times[problem, "this", facets], 1e-3)
            print(f"{problem}, {facets} facets: IPOPT takes {ratio:.1f} times as long")
    return 0


if __name__ == "__main__":
    sys.exit(main())
