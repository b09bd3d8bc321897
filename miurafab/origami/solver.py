"""Projection onto a constraint manifold: the nearest point, to first order, step by step.

Given c(x) and its sparse Jacobian J, one step is the least-norm Gauss-Newton correction

    (J J^T + eps D) mu = c,   dx = -J^T mu,   D = diag(J J^T)

shortened where a coordinate would move by more than ``cap``. J J^T is symmetric, positive definite
up to redundant constraints (for which eps is there), and a fifth of the size of the KKT system.
This module knows nothing of origami.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

Floats = NDArray[np.float64]
Constraints = Callable[[Floats], tuple[Floats, sparse.csr_array]]

REGULARISATION = 1e-12


@dataclass(frozen=True, eq=False)
class Projection:
    """Where a projection ended: ``x`` (n,), the largest residual there, and how it went."""

    x: Floats
    residual: float
    iterations: int
    converged: bool
    reason: str


def project(
    constraints: Constraints,
    x: Floats,
    *,
    tolerance: float = 1e-13,
    cap: float = np.inf,
    max_iterations: int = 60,
    on_iteration: Callable[[int, float], None] | None = None,
) -> Projection:
    """Move ``x`` onto c(x) = 0 until max|c| <= ``tolerance``, no coordinate by over ``cap`` a step.

    Failure is a result: ``reason`` then says whether the residual stalled, grew without bound, or
    the iterations ran out.
    """
    c, jacobian = constraints(x)
    residual = _size(c)
    best = residual
    since_best = 0
    for iteration in range(max_iterations):
        if on_iteration is not None:
            on_iteration(iteration, residual)
        if residual <= tolerance:
            return Projection(x, residual, iteration, True, "converged")
        step = _least_norm_step(jacobian, c)
        if step is None or not np.isfinite(step).all():
            return Projection(x, residual, iteration, False, "the linear system became singular")
        longest = float(np.abs(step).max())
        trial = x + step * min(1.0, cap / longest) if longest > 0 else x
        c, jacobian = constraints(trial)
        trial_residual = _size(c)
        if not np.isfinite(trial_residual):
            return Projection(x, residual, iteration, False, "a facet or edge degenerated")
        x, residual = trial, trial_residual
        since_best = 0 if residual < 0.9 * best else since_best + 1
        best = min(best, residual)
        if since_best >= 20 or (since_best >= 3 and residual <= 50 * tolerance):
            break
    else:
        return Projection(
            x, residual, max_iterations, residual <= tolerance, "the iterations ran out"
        )
    return Projection(x, residual, iteration + 1, residual <= tolerance, "the residual stalled")


def _size(c: Floats) -> float:
    return float(np.abs(c).max()) if len(c) else 0.0


def _least_norm_step(jacobian: sparse.csr_array, c: Floats) -> Floats | None:
    transposed = jacobian.T.tocsr()
    gram = (jacobian @ transposed).tocsc()
    gram.setdiag(gram.diagonal() * (1 + REGULARISATION) + 1e-300)
    try:
        factor = splu(
            gram,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError:
        return None
    step: Floats = -(transposed @ factor.solve(c))
    return step
