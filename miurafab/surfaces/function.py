"""Targets given by a Python function or by a grid of points: a spline surface through samples.

A function cannot be written to a file. It is sampled once, and the bicubic spline through the
samples is the target of the fit, of the pattern file and of every later check. There are as many
samples as the spline needs to follow the function. They are rounded before the spline is made, so
that the file gives the same surface again, to the last bit.
"""

from __future__ import annotations

import math
import reprlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from miurafab.errors import TargetError
from miurafab.findings import Finding
from miurafab.geometry.arrays import Floats, vector_product
from miurafab.surfaces.frame import described, origin_for, origin_in
from miurafab.surfaces.spline import continued
from miurafab.surfaces.surface import (
    Domain,
    closest_parameters,
    nearest_parameters,
    normal_to,
    patch_tiles,
    tangents,
)

if TYPE_CHECKING:
    from scipy.interpolate import NdBSpline

SAMPLES = (17, 33, 65)
"""Samples to a side that are tried in turn, until the spline follows the function."""

TOLERANCE = 1e-5
"""A spline follows a function that it leaves by no more than this part of the diagonal."""

MARGIN = 0.1
"""A function is also sampled this part of the domain beyond it, where it has values there."""

_DIGITS = 12
_LARGEST = 1e100
_DEGENERATE = 1e-7


@dataclass(frozen=True, eq=False)
class SampledSurface:
    """The bicubic spline through a grid of points.

    Parameters
    ----------
    points : (rows, columns, 3) float64
        The samples: u runs along a row, v along a column, both in even steps over ``span``.
    span : Domain
        The parameters of the samples.
    domain : Domain
        The parameters of the target. It lies inside ``span``.
    origin : (3,) float64
        What the samples are relative to (:mod:`miurafab.surfaces.frame`).
    findings : tuple of Finding
        What a person should know of the samples.
    """

    points: Floats
    span: Domain
    domain: Domain
    origin: Floats = field(default_factory=lambda: np.zeros(3))
    findings: tuple[Finding, ...] = ()

    def __repr__(self) -> str:
        rows, columns = self.points.shape[:2]
        return f"<SampledSurface: {columns}x{rows} samples>"

    @cached_property
    def spline(self) -> NdBSpline:
        """The spline from (u, v) to space."""
        from scipy.interpolate import NdBSpline, make_interp_spline

        span, (rows, columns) = self.span, self.points.shape[:2]
        across = make_interp_spline(np.linspace(span.v0, span.v1, rows), self.points)
        along = make_interp_spline(np.linspace(span.u0, span.u1, columns), across.c, axis=1)
        return NdBSpline((along.t, across.t), along.c, 3)

    def point(self, uv: Floats) -> Floats:
        """(..., 3) points of the spline, which goes straight on beyond ``span``."""
        return continued(self.spline, uv)

    def normal(self, uv: Floats) -> Floats:
        """(..., 3) unit normals."""
        return normal_to(*tangents(self, uv))

    def closest_point(self, points: Floats) -> Floats:
        """(n, 3) nearest points of the spline to ``points`` (n, 3)."""
        return self.point(closest_parameters(self, points, 80))

    def nearest(self, points: Floats) -> Floats:
        """(n, 3) nearest points of the spline over ``domain`` to ``points`` (n, 3)."""
        return self.point(nearest_parameters(self, points, 80))

    def tiles(self) -> Floats:
        """(n, 3, 3) triangles that tile the spline over ``domain``."""
        return patch_tiles(self)

    @property
    def description(self) -> dict[str, Any]:
        """The surface as a pattern file holds it, for :func:`sampled_before`."""
        span, domain = self.span, self.domain
        return {
            "samples": self.points.tolist(),
            "span": [span.u0, span.u1, span.v0, span.v1],
            "domain": [domain.u0, domain.u1, domain.v0, domain.v1],
            **described(self.origin),
        }


def sampled_before(description: Mapping[str, Any]) -> SampledSurface:
    """The surface of a :attr:`SampledSurface.description`. Raises ``TargetError``."""
    try:
        points = np.array(description["samples"], dtype=np.float64)
        span, domain = (read_domain(description[key]) for key in ("span", "domain"))
        origin = origin_in(description)
    except (KeyError, TypeError, ValueError):
        raise TargetError("The samples of the target are damaged.") from None
    if points.ndim != 3 or points.shape[2] != 3 or min(points.shape[:2]) < 4:
        raise TargetError("The samples of the target are damaged.")
    return SampledSurface(points, span, domain, origin)


def through(points: Floats, span: Domain, domain: Domain | None = None) -> SampledSurface:
    """The surface through ``points`` (rows, columns, 3), which are rounded to nine digits.

    Raises :class:`~miurafab.errors.TargetError` for fewer than 4 x 4 points, for points that are
    not finite, and where the surface has no tangent plane.
    """
    points = np.asarray(points, dtype=np.float64)
    if min(points.shape[:2]) < 4:
        rows, columns = points.shape[:2]
        raise TargetError(f"A grid of {columns} x {rows} points is too coarse; give 4 x 4 or more.")
    if not np.isfinite(points).all():
        row, column = np.argwhere(~np.isfinite(points).all(axis=2))[0].tolist()
        raise TargetError(f"The point in row {row}, column {column} of the grid is not finite.")
    origin = origin_for(points.reshape(-1, 3))
    surface = SampledSurface(rounded(points - origin), span, domain or span, origin)
    lattice = surface.domain.lattice(33, 33)
    along, across = tangents(surface, lattice)
    area = np.linalg.norm(vector_product(along, across), axis=-1)
    if not area.min() > _DEGENERATE * area.max():
        u, v = lattice.reshape(-1, 2)[int(np.argmin(area))].tolist()
        raise TargetError(
            f"The surface has no tangent plane at u = {u:.4g}, v = {v:.4g}, because it shrinks to "
            "a point or a line there; choose a domain that keeps away from it."
        )
    return surface


def rounded(points: Floats) -> Floats:
    """``points`` (..., 3) to twelve digits of their extent: what is beyond them is rounding."""
    size = _diagonal(points)
    return np.round(points, _DIGITS - math.ceil(math.log10(size))) if size > 0 else points


def from_points(points: Floats) -> SampledSurface:
    """The surface through a grid of points (rows, columns, 3). Raises ``TargetError``."""
    rows, columns = points.shape[:2]
    return through(points, Domain(0.0, columns - 1.0, 0.0, rows - 1.0))


def from_function(
    function: Callable[..., Any], domain: object = (-1.0, 1.0, -1.0, 1.0)
) -> tuple[SampledSurface, tuple[Finding, ...]]:
    """A function of u and v as a target, and what a person should know of it.

    Parameters
    ----------
    function : callable
        Takes u and v. It returns a point (x, y, z), or one number, which is the height z over
        x = u and y = v. A function that computes with whole arrays is called with arrays; any
        other function is called with two numbers, once for each sample.
    domain : four numbers
        u0, u1, v0, v1, or the two pairs (u0, u1), (v0, v1).

    Returns
    -------
    SampledSurface, tuple of Finding

    Raises
    ------
    TargetError
        For a domain that is not one, and for a function that fails, or returns anything else than
        finite points.
    """
    try:
        target = read_domain(domain)
    except (TypeError, ValueError):
        raise TargetError(
            f"The domain is {reprlib.repr(domain)}; write u0, u1, v0, v1 such as (-1, 1, 0, 2), "
            "each start under its end."
        ) from None
    evaluate = _evaluator(function, target)
    span = _wider(target)
    try:
        evaluate(span.lattice(3, 3))
    except TargetError:
        span = target
    surface, miss = sample(evaluate, span, target)
    if miss <= TOLERANCE:
        return surface, ()
    return surface, (
        Finding(
            "sampling",
            f"The function turns faster than {SAMPLES[-1]} samples to a side show: the spline "
            f"through the samples, which is fitted and checked, leaves it by {100 * miss:.2g} % of "
            "its size. Choose a smaller domain for a closer spline.",
        ),
    )


def sample(
    evaluate: Callable[[Floats], Floats], span: Domain, domain: Domain
) -> tuple[SampledSurface, float]:
    """The map ``evaluate`` from (..., 2) to (..., 3) over ``span`` through as few samples as follow
    it on ``domain``, and by which part of its diagonal the surface leaves it between them.
    """
    for count in SAMPLES:
        surface = through(evaluate(span.lattice(count, count)), span, domain)
        between = _midpoints(domain, count)
        gap = np.linalg.norm(surface.point(between) + surface.origin - evaluate(between), axis=-1)
        miss = float(gap.max()) / _diagonal(surface.points)
        if miss <= TOLERANCE:
            break
    return surface, miss


def read_domain(value: object) -> Domain:
    """Four numbers, or two pairs. Raises ``TypeError`` or ``ValueError``."""
    u0, u1, v0, v1 = np.asarray(value, dtype=np.float64).ravel().tolist()
    if not (u0 < u1 and v0 < v1 and math.isfinite(u1 - u0) and math.isfinite(v1 - v0)):
        raise ValueError
    return Domain(u0, u1, v0, v1)


def _wider(domain: Domain) -> Domain:
    across, up = MARGIN * domain.width, MARGIN * domain.height
    return Domain(domain.u0 - across, domain.u1 + across, domain.v0 - up, domain.v1 + up)


def _midpoints(domain: Domain, count: int) -> Floats:
    """Parameters between those of a lattice over ``domain``, none of them on its edge."""
    half_u, half_v = domain.width / (count - 1) / 2, domain.height / (count - 1) / 2
    inner = Domain(domain.u0 + half_u, domain.u1 - half_u, domain.v0 + half_v, domain.v1 - half_v)
    return inner.lattice(count - 1, count - 1)


def _diagonal(points: Floats) -> float:
    return float(np.linalg.norm(np.ptp(points.reshape(-1, 3), axis=0)))


def _evaluator(function: Callable[..., Any], domain: Domain) -> Callable[[Floats], Floats]:
    """Points (..., 3) at parameters (..., 2), by arrays where the function computes with them."""

    def one_by_one(uv: Floats) -> Floats:
        flat = uv.reshape(-1, 2)
        found = [_point(function, u, v) for u, v in flat.tolist()]
        return np.array(found).reshape(*uv.shape[:-1], 3)

    def at_once(uv: Floats) -> Floats:
        with np.errstate(all="ignore"):
            points = _points(function(uv[..., 0], uv[..., 1]), uv)
        bad = ~np.isfinite(points).all(axis=-1)
        if bad.any():
            u, v = uv[bad][0].tolist()
            raise TargetError(f"The function has no finite value at u = {u:g}, v = {v:g}.")
        _refuse_large(points, "somewhere")
        return points

    probe = domain.lattice(5, 7)
    expected = one_by_one(probe)
    try:
        agrees = np.allclose(at_once(probe), expected, rtol=1e-9, atol=1e-9 * _diagonal(expected))
    except Exception:  # noqa: BLE001 - a function for numbers fails with arrays in any way it likes
        agrees = False
    return at_once if agrees else one_by_one


def _point(function: Callable[..., Any], u: float, v: float) -> Floats:
    """The one point at ``u``, ``v``. Raises ``TargetError`` with the reason."""
    where = f"at u = {u:g}, v = {v:g}"
    try:
        with np.errstate(all="ignore"):
            value = function(u, v)
    except Exception as fault:  # a function of the user's fails in any way it likes
        reason = " ".join(str(fault).split()).rstrip(".") or "no reason given"
        raise TargetError(
            f"The function fails {where}: {type(fault).__name__}: {reason}."
        ) from fault
    try:
        point = _points(value, np.array([u, v]))
    except (TypeError, ValueError):
        raise TargetError(
            f"The function returns {reprlib.repr(value)} {where}; it must return a point (x, y, z) "
            "or one height z."
        ) from None
    if not np.isfinite(point).all():
        raise TargetError(f"The function has no finite value {where}.")
    _refuse_large(point, where)
    return point


def _points(value: Any, uv: Floats) -> Floats:
    """What a function returned for ``uv`` (..., 2) as points (..., 3). Raises ``ValueError``."""
    shape = uv.shape[:-1]
    if value is None or np.iscomplexobj(value) or isinstance(value, str | bytes):
        raise ValueError
    if isinstance(value, tuple | list) and len(value) == 3:
        parts = [np.broadcast_to(np.asarray(part, dtype=np.float64), shape) for part in value]
        return np.stack(parts, axis=-1)
    array = np.asarray(value, dtype=np.float64)
    if array.shape == shape:
        return np.concatenate([uv, array[..., None]], axis=-1)
    if array.shape == (3, *shape):
        return np.moveaxis(array, 0, -1)
    if array.shape == (*shape, 3):
        return array
    raise ValueError


def _refuse_large(points: Floats, where: str) -> None:
    """Refuse values whose squares are beyond all floats."""
    if np.abs(points).max(initial=0.0) > _LARGEST:
        raise TargetError(f"The function has a value beyond {_LARGEST:g} {where}; scale it down.")
