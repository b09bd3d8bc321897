"""Ways to an exact sheet where the projection of the seed fails: bend, refine, shake.

Continuation starts from an easier problem, a flatter target or a coarser grid, and carries its
solution step by step to the problem that was asked for. Every step ends with a projection.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from miurafab.geometry.arrays import Floats
from miurafab.origami.fitting.prolongation import from_local, refined, to_local
from miurafab.origami.fitting.reduction import Unknowns
from miurafab.origami.fitting.seed import Corrugation, seed
from miurafab.origami.fitting.solver import Projection, project
from miurafab.origami.tessellation import Tessellation
from miurafab.surfaces.surface import Bent, TargetSurface

COARSEST = 12
"""Grids with more vertices a side can start from a coarser grid."""
BEND_STEPS = 12
STEP_CAP = 0.25
"""The largest move of a coordinate in one step, in mean edge lengths."""
SHAKE = 0.03
"""The standard deviation of the random moves of a coordinate, in mean edge lengths."""


def solve(unknowns: Unknowns, x: Floats, flat_foldable: bool) -> Projection:
    """The projection of ``x`` onto the constraints, with the Kawasaki rows if asked for."""
    constraints = unknowns.constraints(flat_foldable)
    return project(constraints, x, unknowns.places, cap=STEP_CAP * unknowns.length)


def bend(
    surface: TargetSurface, columns: int, rows: int, corrugation: Corrugation, level: float
) -> tuple[Unknowns, Projection]:
    """From the flat sheet to the full target in equal steps.

    Each step starts from the last solution, carried along in the target's own frame (tangents and
    normal at each vertex).
    """
    uv = surface.domain.lattice(columns, rows)
    bends = np.linspace(0.0, 1.0, BEND_STEPS + 1)
    start, _ = seed(Bent(surface, 0.0), columns, rows, corrugation, level)
    unknowns = Unknowns(columns, rows, float(start.edge_lengths.mean()))
    solution = solve(unknowns, start.vertices.ravel(), flat_foldable=False)
    iterations = solution.iterations
    for before, after in itertools.pairwise(bends):
        local = to_local(Bent(surface, before), uv, solution.x.reshape(rows, columns, 3))
        carried = Tessellation(from_local(Bent(surface, after), uv, local))
        unknowns = replace(unknowns, length=float(carried.edge_lengths.mean()))
        solution = solve(unknowns, carried.vertices.ravel(), flat_foldable=False)
        iterations += solution.iterations
        if not solution.converged:
            break
    return unknowns, replace(solution, iterations=iterations)


def refine(
    surface: TargetSurface, columns: int, rows: int, corrugation: Corrugation, level: float
) -> tuple[Unknowns, Projection]:
    """From the solution on a coarse grid to grids twice as fine, up to ``columns`` x ``rows``."""
    iterations = 0
    if min(columns, rows) > COARSEST:
        few, fewer = (max(n // 2, COARSEST // 2) + 1 for n in (columns - 1, rows - 1))
        coarse, solution = refine(surface, few, fewer, corrugation, level)
        if not solution.converged:
            return coarse, solution
        iterations = solution.iterations
        start = refined(surface, coarse.sheet(solution.x), columns, rows)
    else:
        start, _ = seed(surface, columns, rows, corrugation, level)
    unknowns = Unknowns(columns, rows, float(start.edge_lengths.mean()))
    solution = solve(unknowns, start.vertices.ravel(), flat_foldable=False)
    return unknowns, replace(solution, iterations=iterations + solution.iterations)


def shaken(start: Tessellation, seed_number: int) -> Tessellation:
    """``start`` with every coordinate moved a little at random, by the seed ``seed_number``."""
    random = np.random.default_rng(seed_number)
    amount = SHAKE * float(start.edge_lengths.mean())
    return Tessellation(start.points + random.normal(scale=amount, size=start.points.shape))
