"""A smooth surface through scattered points: a tensor spline with a stiffness chosen from the data.

The bicubic spline f over a rectangle minimises

    (1/n) sum |f(u_k, v_k) - p_k|^2 + stiffness * integral (f_uu^2 + 2 f_uv^2 + f_vv^2),

which bridges gaps and removes noise. The stiffness minimises the generalised cross-validation score
n RSS / (n - tr A)^2, where A maps the points to the smoothed points (Craven and Wahba, Numer. Math.
31, 1979). The trace of A is estimated with a few fixed random signs (Hutchinson, Commun. Stat.
Simul. 18, 1989). Exact data give almost no stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from miurafab.geometry.arrays import Floats
from miurafab.geometry.sparse import factor_symmetric
from miurafab.surfaces.spline import DEGREE
from miurafab.surfaces.surface import Domain

if TYPE_CHECKING:
    from scipy.interpolate import NdBSpline

_PROBES = 8
_RISEN = 4.0
"""The search for the stiffness ends where the score is this many times the least."""
_STEPS = np.arange(-6.0, 3.1, 1.0)
"""Powers of ten of the stiffness, in units of the fourth power of a twentieth of the rectangle."""


@dataclass(frozen=True, eq=False)
class Smoothed:
    """The ``spline`` (u, v) -> space, its ``stiffness``, and the ``roughness``: the root mean
    square distance of the points from the spline.
    """

    spline: NdBSpline
    stiffness: float
    roughness: float


def smooth(
    places: Floats,
    points: Floats,
    domain: Domain,
    spans: tuple[int, int],
    stiffness: float = 0.0,
    closed: bool = False,
) -> Smoothed:
    """The spline with ``spans`` knot intervals along u and v near ``points`` (n, 3) at the
    parameters ``places`` (n, 2) in ``domain``. Its stiffness is at least ``stiffness``.

    Where ``closed``, the spline has the period of the domain's width in u, with two continuous
    derivatives; it still takes parameters in the domain only.
    """
    knots = [
        _periodic_knots(domain.u0, domain.u1, spans[0])
        if closed
        else _knots(domain.u0, domain.u1, spans[0]),
        _knots(domain.v0, domain.v1, spans[1]),
    ]
    from scipy.interpolate import BSpline, NdBSpline

    basis = _rows_of_products(
        *(BSpline.design_matrix(places[:, k], knots[k], DEGREE) for k in (0, 1))
    )
    shape = tuple(len(knot) - DEGREE - 1 for knot in knots)
    # the coefficient of the spline that each basis function takes
    own = np.arange(shape[0] * shape[1])
    if closed:
        own = own % (spans[0] * shape[1])
    count = int(own.max()) + 1
    gather = sparse.csr_array(
        (np.ones(len(own)), (np.arange(len(own)), own)), shape=(len(own), count)
    )
    basis = basis @ gather
    gram = (basis.T @ basis).tocsc() / len(points)
    penalty = (gather.T @ _bending(knots[0], knots[1]) @ gather).tocsc()
    unit = (0.05 * max(domain.width, domain.height)) ** 4 / (domain.width * domain.height)
    # relative to the middle: the matrix is nearly singular where there are no points
    middle = points.mean(axis=0)
    points = points - middle
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (len(points), _PROBES))
    right = basis.T @ np.concatenate([points, signs], axis=1) / len(points)
    tried = np.unique(np.maximum(10.0**_STEPS, stiffness))
    best: tuple[float, float, Floats, float] | None = None
    for factor in tried.tolist():
        matrix = (gram + factor * unit * penalty).tocsc()
        matrix = matrix + sparse.diags_array(np.full(matrix.shape[0], 1e-13)).tocsc()
        solved = factor_symmetric(matrix).solve(right)
        c = solved[:, :3]
        residual = float(np.sum((basis @ c - points) ** 2))
        trace = float(np.einsum("np,np->", signs, basis @ solved[:, 3:])) / _PROBES
        freedom = max(1 - trace / len(points), 1e-2)
        score = residual / freedom**2
        if best is None or score < 0.999 * best[0]:
            best = (score, factor, c, residual)
        elif score > _RISEN * best[0]:
            break
    assert best is not None
    coefficients = (best[2] + middle)[own].reshape(*shape, 3)
    spline = NdBSpline((knots[0], knots[1]), coefficients, DEGREE, extrapolate=True)
    return Smoothed(spline, best[1], float(np.sqrt(best[3] / len(points))))


def _knots(low: float, high: float, spans: int) -> Floats:
    return np.concatenate([[low] * 3, np.linspace(low, high, spans + 1), [high] * 3])


def _periodic_knots(low: float, high: float, spans: int) -> Floats:
    return np.asarray(low + (high - low) / spans * np.arange(-DEGREE, spans + DEGREE + 1))


def _rows_of_products(a: sparse.csr_array, b: sparse.csr_array) -> sparse.csr_array:
    """Row by row the Kronecker product of two design matrices of four entries a row."""
    n, width = a.shape[0], DEGREE + 1
    values = a.data.reshape(n, width, 1) * b.data.reshape(n, 1, width)
    columns = a.indices.reshape(n, width, 1).astype(np.int64) * b.shape[1]
    columns = columns + b.indices.reshape(n, 1, width)
    start = np.arange(n + 1) * width**2
    return sparse.csr_array(
        (values.ravel(), columns.ravel(), start), shape=(n, a.shape[1] * b.shape[1])
    )


def _bending(u: Floats, v: Floats) -> sparse.csc_array:
    """The thin-plate energy of tensor splines as a quadratic form in their coefficients."""
    (u0, u1, u2), (v0, v1, v2) = _products(u), _products(v)
    energy = sparse.kron(u2, v0) + 2 * sparse.kron(u1, v1) + sparse.kron(u0, v2)
    return sparse.csc_array(energy)


def _products(knots: Floats) -> list[sparse.csr_array]:
    """Integrals of products of the basis functions, of their first and second derivatives."""
    nodes, weights = np.polynomial.legendre.leggauss(4)
    edges = np.unique(knots[DEGREE : len(knots) - DEGREE])
    half = np.diff(edges)[:, None] / 2
    at = (edges[:-1, None] + half * (1 + nodes)).ravel()
    weight = (half * weights).ravel()
    count = len(knots) - DEGREE - 1
    from scipy.interpolate import BSpline

    basis = BSpline(knots, np.eye(count), DEGREE)
    derivatives = [basis(at, nu=order) for order in range(3)]
    return [sparse.csr_array(d.T @ (weight[:, None] * d)) for d in derivatives]
