"""The fair objective by this solver and by IPOPT, from the same seed, in processor time.

    python benchmarks/fair_rival.py [--target bump] [--facets 100,400,900]

Both minimise r.r under c(x) = 0, with the residuals r, the constraints c and their Jacobians of
this package; IPOPT gets 2 J^T J for the Hessian (Gauss-Newton), as this solver does. IPOPT ends at
its tolerance or after 200 iterations. ``build`` is the time of making the problem: for IPOPT the
pattern of the Hessian. ``value`` is r.r at the answer, ``residual`` the largest of |c|.
IPOPT comes with ``pip install cyipopt-wheels`` or ``cyipopt``.
"""

from __future__ import annotations

import argparse
import importlib.util
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from fit import show
from scipy import sparse

from miurafab.geometry.arrays import Floats, Ints
from miurafab.origami.fitting.fair import fairest
from miurafab.origami.fitting.objective import FairObjective, Weights
from miurafab.origami.fitting.polish import EASING, FEW, LEGS, MORE, STEP_CAP
from miurafab.origami.fitting.solver import project
from miurafab.origami.fitting.starts import Start, starts_for
from miurafab.workflow.design import design

TOLERANCE = 1e-6


def objective_of(start: Start) -> FairObjective:
    return FairObjective.of(
        start.surface,
        start.unknowns.charts,
        start.cells,
        start.unknowns.vertices(start.x),
        rim=start.rim,
        weights=Weights.of(start.pieces, start.all_round),
    )


class Problem:
    """The problem as IPOPT asks for it; holds the last point, the nearest points there and the
    ``steps`` taken.
    """

    def __init__(self, start: Start) -> None:
        self.steps = 0
        self.unknowns = start.unknowns
        self.objective_terms = objective_of(start)
        self.feet = self.objective_terms.feet
        self.conditions = start.unknowns.constraints(False)
        self.last: tuple[bytes, Any] | None = None
        self.pattern = self.near_pairs()
        self.first = sparse.coo_array(self.at(start.x)[3])

    def near_pairs(self) -> tuple[Ints, Ints]:
        """The lower entries of J^T J: coordinates of vertices that share a term."""
        charts = self.objective_terms.charts
        faces = charts.faces_vertices
        pairs = faces[charts.neighbouring_facets].reshape(-1, 8)
        terms = [faces, pairs, self.objective_terms.chains[0]]
        rows = np.concatenate(
            [np.repeat(np.arange(len(t)), t.shape[1]) + sum(map(len, terms[:n]))
             for n, t in enumerate(terms)]
        )  # fmt: skip
        columns = np.concatenate([t.ravel() for t in terms])
        shape = sum(map(len, terms)), charts.vertices_count
        share = sparse.coo_array((np.ones(len(rows)), (rows, columns)), shape).tocsr()
        full = sparse.kron((share.T @ share) > 0, np.ones((3, 3)))
        entries = sparse.tril(full).tocoo()
        return entries.row, entries.col

    def at(self, x: Floats) -> Any:
        key = x.tobytes()
        if self.last is None or self.last[0] != key:
            terms = self.objective_terms(self.unknowns.vertices(x), self.feet)
            residuals, jacobian, self.feet = terms
            jacobian = self.unknowns.by_unknowns(jacobian)
            self.last = key, (residuals, jacobian, *self.conditions(x))
        return self.last[1]

    def objective(self, x: Floats) -> float:
        return float(self.at(x)[0] @ self.at(x)[0])

    def gradient(self, x: Floats) -> Floats:
        return np.asarray(2 * (self.at(x)[1].T @ self.at(x)[0]))

    def constraints(self, x: Floats) -> Floats:
        return np.asarray(self.at(x)[2])

    def jacobianstructure(self) -> tuple[Ints, Ints]:
        return self.first.row, self.first.col

    def jacobian(self, x: Floats) -> Floats:
        return np.asarray(sparse.csr_array(self.at(x)[3])[self.first.row, self.first.col])

    def intermediate(self, _mode: int, steps: int, *_rest: float) -> bool:
        self.steps = steps
        return True

    def hessianstructure(self) -> tuple[Ints, Ints]:
        return self.pattern

    def hessian(self, x: Floats, _multipliers: Floats, factor: float) -> Floats:
        jacobian = self.at(x)[1]
        normal = sparse.csr_array(jacobian.T @ jacobian)
        return np.asarray(2 * factor * normal[self.pattern])


def by_ipopt(start: Start) -> tuple[Floats, int, float]:
    import cyipopt

    began = time.process_time()
    problem = Problem(start)
    count = len(problem.constraints(start.x))
    solver = cyipopt.Problem(
        len(start.x), count, problem_obj=problem, cl=np.zeros(count), cu=np.zeros(count)
    )
    for name, value in {"tol": TOLERANCE, "max_iter": 200, "print_level": 0, "sb": "yes"}.items():
        solver.add_option(name, value)
    built = time.process_time() - began
    found, _ = solver.solve(start.x)
    return found, problem.steps, built


def by_this(start: Start) -> tuple[Floats, int, float]:
    objective, unknowns = objective_of(start), start.unknowns
    constraints = unknowns.constraints(False)
    x, feet, taken = start.x, objective.feet, 0
    for penalty, steps in (*EASING, *LEGS):
        steps = MORE if (penalty, steps) == LEGS[-1] and len(x) < FEW else steps
        sheet = fairest(objective, unknowns, x, feet, steps=steps, penalty=penalty)
        x, feet, taken = sheet.x, sheet.feet, taken + sheet.steps
    return project(constraints, x, cap=STEP_CAP * unknowns.length).x, taken, 0.0


def rows(target: str, sizes: list[int]) -> Iterator[dict[str, Any]]:
    names = ["this"]
    if importlib.util.find_spec("cyipopt") is not None:
        names.append("IPOPT")
    else:
        print("cyipopt is not installed, so IPOPT is left out: pip install cyipopt-wheels")
    for size in sizes:
        side = round(size**0.5)
        starts = starts_for(design(target, facets=(side, side)).request, 1)
        start = next(start for start in starts if start.way == "sheet")
        for name in names:
            began = time.process_time()
            x, steps, built = by_this(start) if name == "this" else by_ipopt(start)
            seconds = time.process_time() - began - built
            problem = Problem(start)
            value = problem.objective(x)
            yield {
                "solver": name,
                "facets": side * side,
                "solve_cpu": round(seconds, 2),
                "build_cpu": round(built, 2),
                "iterations": steps,
                "value": f"{value:.3g}",
                "residual": float(np.abs(problem.constraints(x)).max()),
            }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--target", default="bump")
    parser.add_argument("--facets", default="100,400,900")
    asked = parser.parse_args()
    made: list[dict[str, Any]] = []
    for row in rows(asked.target, [int(size) for size in asked.facets.split(",")]):
        show(made, row)


if __name__ == "__main__":
    main()
