"""Projection onto a constraint manifold: to first order the nearest point, step by step.

Given c(x) = 0 and its sparse Jacobian J, one step is the least-norm Gauss-Newton correction

    (J J^T + eps D) mu = c,   dx = -J^T mu,   D = diag(J J^T)

shortened if a coordinate would move by more than ``cap``. J J^T is symmetric, positive definite up
to redundant constraints (which eps is for), and a fifth of the size of the KKT system.

Inequalities g(x) >= 0 join by an active set: a violated row is held at zero until its multiplier
shows that the other rows keep it satisfied.

Near the end J hardly changes, so conjugate gradients on the last factor replace a new factor.
This module knows nothing of origami.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, cg

from miurafab.geometry.arrays import Bools, Floats
from miurafab.geometry.sparse import Factor, SymmetricSolver

Constraints = Callable[[Floats], tuple[Floats, sparse.csr_array]]

REGULARISATION = 1e-12
SMALL_STEP = 0.02
"""After a step shorter than this part of ``cap`` the last factor is used again."""
REFINEMENTS = 8
"""More conjugate gradient iterations than this cost more than a new factor."""


@dataclass(frozen=True, eq=False)
class Projection:
    """The last point ``x`` (n,) of a projection, the largest residual there, and the outcome.

    ``active`` (p,) marks the inequalities that are held at their bound.
    """

    x: Floats
    residual: float
    iterations: int
    converged: bool
    reason: str
    active: Bools


class GramFactor:
    """The last factor of J J^T; the order of elimination is kept from one J to the next."""

    def __init__(self) -> None:
        self._solver = SymmetricSolver()
        self._factor: Factor | None = None
        self.rows = 0

    def renew(self, jacobian: sparse.csr_array) -> bool:
        """Factor J J^T; False where the matrix is singular to the last digit."""
        if self._solver.size != jacobian.shape[0]:
            # a product of ones has every entry that any J may give, so it is planned once
            ones = jacobian.copy()
            ones.data = np.ones(ones.nnz)
            self._solver.expect((ones @ ones.T.tocsr()).tocsc())
        gram = (jacobian @ jacobian.T.tocsr()).tocsc()
        gram.setdiag(gram.diagonal() * (1 + REGULARISATION) + 1e-300)
        gram.sort_indices()
        try:
            self._factor, self.rows = self._solver.factor(gram), gram.shape[0]
        except RuntimeError:
            self._factor, self.rows = None, 0
        return self._factor is not None

    def solve(self, right: Floats) -> Floats:
        """The solution (m,) of J J^T mu = ``right`` (m,)."""
        assert self._factor is not None
        return self._factor.solve(right)

    def refine(self, jacobian: sparse.csr_array, right: Floats) -> Floats | None:
        """The solution for a slightly different ``jacobian``; None if that takes too long."""
        size = (len(right), len(right))
        transposed = jacobian.T.tocsr()
        gram = LinearOperator(size, matvec=lambda y: jacobian @ (transposed @ y), dtype=right.dtype)
        inverse = LinearOperator(size, matvec=self.solve, dtype=right.dtype)
        solution, left = cg(gram, right, rtol=1e-7, atol=0.0, maxiter=REFINEMENTS, M=inverse)
        return None if left else np.asarray(solution, dtype=np.float64)


def project(
    constraints: Constraints,
    x: Floats,
    *,
    inequalities: Constraints | None = None,
    tolerance: float = 1e-13,
    cap: float = np.inf,
    dimension: int = 1,
    max_iterations: int = 60,
) -> Projection:
    """Move ``x`` onto c(x) = 0, g(x) >= 0 until max|c| and max(-g) are at most ``tolerance``.

    ``x`` are points of so many coordinates as ``dimension`` says. No point moves by more than
    ``cap`` in a step. Failure is a result: ``reason`` says why.
    """
    state = _Rows.at(constraints, inequalities, x, None)
    residual, best, since_best = state.residual, state.residual, 0
    factor, factored_for = GramFactor(), None
    last_step = np.inf

    def ended(iterations: int, converged: bool, reason: str) -> Projection:
        return Projection(x, residual, iterations, converged, reason, state.held)

    for iteration in range(max_iterations):
        values, jacobian = state.values, state.jacobian
        if residual <= tolerance:
            if factor.rows and factor.rows == len(values):
                # one more step with the last factor lowers the residual to rounding
                trial = x - jacobian.T @ factor.solve(values)
                following = _Rows.at(constraints, inequalities, trial, state.held)
                if following.residual < residual:
                    x, state, residual = trial, following, following.residual
            return ended(iteration, True, "converged")
        same_rows = factored_for is not None and np.array_equal(factored_for, state.held)
        mu = None
        if same_rows and last_step < SMALL_STEP * cap:
            mu = factor.refine(jacobian, values)
        if mu is None and factor.renew(jacobian):
            factored_for = state.held
            mu = factor.solve(values)
        step = None if mu is None else -(jacobian.T @ mu)
        if mu is None or step is None or not np.isfinite(step).all():
            return ended(iteration, False, "the linear system became singular")
        last_step = longest_move(step, dimension)
        trial = x + step * min(1.0, cap / last_step) if last_step > 0 else x
        following = _Rows.at(constraints, inequalities, trial, state.kept(mu))
        if not np.isfinite(following.residual):
            return ended(iteration, False, "a facet or edge degenerated")
        x, state, residual = trial, following, following.residual
        since_best = 0 if residual < 0.9 * best else since_best + 1
        best = min(best, residual)
        if since_best >= 20 or (since_best >= 3 and residual <= 50 * tolerance):
            break
    else:
        return ended(max_iterations, residual <= tolerance, "the iterations ran out")
    return ended(iteration + 1, residual <= tolerance, "the residual stalled")


def longest_move(step: Floats, dimension: int = 3) -> float:
    """How far the point moves that ``step`` (n,) moves most. Like the length of a vector, and
    unlike its largest coordinate, that does not hang on how the axes lie.
    """
    return float(np.linalg.norm(step.reshape(-1, dimension), axis=1).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class _Rows:
    """The equalities and the inequalities ``held`` (p,) at one point, stacked.

    ``residual`` counts an inequality only as far as it is violated.
    """

    values: Floats
    jacobian: sparse.csr_array
    held: Bools
    residual: float

    @classmethod
    def at(
        cls,
        equalities: Constraints,
        inequalities: Constraints | None,
        x: Floats,
        kept: Bools | None,
    ) -> _Rows:
        c, jacobian = equalities(x)
        residual = float(np.abs(c).max(initial=0.0))
        if inequalities is None:
            return cls(c, jacobian, np.zeros(0, dtype=bool), residual)
        g, gradient = inequalities(x)
        residual = max(residual, float(np.max(-g, initial=0.0)))
        before = np.zeros(len(g), dtype=bool) if kept is None else kept
        held = before | (g < 0)
        chosen = np.flatnonzero(held)
        return cls(
            np.concatenate([c, g[chosen]]),
            sparse.vstack([jacobian, gradient[chosen]], format="csr"),
            held,
            residual,
        )

    def kept(self, mu: Floats) -> Bools | None:
        """The held inequalities that the step presses against (mu <= 0): they stay held."""
        if not len(self.held):
            return None
        kept = self.held.copy()
        kept[self.held] = mu[len(mu) - int(self.held.sum()) :] <= 0
        return kept
