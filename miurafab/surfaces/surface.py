"""Target surfaces: smooth maps from a rectangle to space.

``TargetSurface`` is the protocol. The functions below derive tangents, curvature and nearest points
from the map alone, by differences of fourth order, so that a new surface needs only one formula.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from scipy.spatial import cKDTree

from miurafab.geometry.arrays import Floats


@dataclass(frozen=True)
class Domain:
    """The parameter rectangle [u0, u1] x [v0, v1]."""

    u0: float
    u1: float
    v0: float
    v1: float

    @property
    def width(self) -> float:
        return self.u1 - self.u0

    @property
    def height(self) -> float:
        return self.v1 - self.v0

    def lattice(self, columns: int, rows: int) -> Floats:
        """(rows, columns, 2) evenly spaced parameters, corners included."""
        u = np.linspace(self.u0, self.u1, columns)
        v = np.linspace(self.v0, self.v1, rows)
        return np.stack(np.meshgrid(u, v), axis=-1)


class TargetSurface(Protocol):
    """A target. Parameters are arrays (..., 2), points and unit normals (..., 3).

    ``point`` must accept parameters a little outside ``domain``, where the zig-zag of the first and
    last rows lies.
    """

    @property
    def domain(self) -> Domain: ...

    def point(self, uv: Floats) -> Floats: ...

    def normal(self, uv: Floats) -> Floats: ...

    def closest_point(self, points: Floats) -> Floats:
        """(n, 3) the points of the surface nearest to ``points`` (n, 3)."""
        ...


@dataclass(frozen=True)
class ParametricSurface:
    """A surface given by one vectorised map ``position`` (u, v) -> (..., 3)."""

    position: Callable[[Floats, Floats], Floats]
    domain: Domain
    samples: int = field(default=80, repr=False)

    def point(self, uv: Floats) -> Floats:
        return self.position(uv[..., 0], uv[..., 1])

    def normal(self, uv: Floats) -> Floats:
        along, across = tangents(self, uv)
        return unit(np.cross(along, across))

    def closest_point(self, points: Floats) -> Floats:
        return self.point(closest_parameters(self, points, self.samples))


@dataclass(frozen=True)
class Swapped:
    """The same surface with u and v exchanged, and so with the opposite normal."""

    surface: TargetSurface

    @property
    def domain(self) -> Domain:
        d = self.surface.domain
        return Domain(d.v0, d.v1, d.u0, d.u1)

    def point(self, uv: Floats) -> Floats:
        return self.surface.point(uv[..., ::-1])

    def normal(self, uv: Floats) -> Floats:
        return -self.surface.normal(uv[..., ::-1])

    def closest_point(self, points: Floats) -> Floats:
        return self.surface.closest_point(points)


@dataclass(frozen=True)
class Bent:
    """A blend of plane and target: ``bend`` 0 is flat, 1 is the target.

    The plane is the tangent plane at the centre with the mean speeds of the parameters, so that
    lengths change little in (1 - bend) * plane + bend * target.
    """

    surface: TargetSurface
    bend: float

    @property
    def domain(self) -> Domain:
        return self.surface.domain

    def point(self, uv: Floats) -> Floats:
        d = self.domain
        centre = np.array([(d.u0 + d.u1) / 2, (d.v0 + d.v1) / 2])
        along, across = tangents(self.surface, d.lattice(9, 9))
        speed_u = float(np.linalg.norm(along, axis=-1).mean())
        speed_v = float(np.linalg.norm(across, axis=-1).mean())
        e1, e2 = (unit(t) for t in tangents(self.surface, centre))
        e2 = unit(e2 - e1 * (e1 @ e2))
        offset = uv - centre
        plane = (
            self.surface.point(centre)
            + offset[..., :1] * speed_u * e1
            + offset[..., 1:] * speed_v * e2
        )
        return np.asarray((1 - self.bend) * plane + self.bend * self.surface.point(uv))

    def normal(self, uv: Floats) -> Floats:
        along, across = tangents(self, uv)
        return unit(np.cross(along, across))

    def closest_point(self, points: Floats) -> Floats:
        return self.point(closest_parameters(self, points, 60))


def unit(vectors: Floats) -> Floats:
    """(..., 3) vectors scaled to length one."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _steps(domain: Domain) -> tuple[Floats, Floats]:
    return np.array([domain.width * 1e-3, 0.0]), np.array([0.0, domain.height * 1e-3])


def tangents(surface: TargetSurface, uv: Floats) -> tuple[Floats, Floats]:
    """dS/du and dS/dv at ``uv`` (..., 2), each (..., 3), by central differences of order four."""
    both = []
    for axis, step in enumerate(_steps(surface.domain)):
        near = surface.point(uv + step) - surface.point(uv - step)
        far = surface.point(uv + 2 * step) - surface.point(uv - 2 * step)
        both.append((8 * near - far) / (12 * step[axis]))
    return both[0], both[1]


def curvature_along_u(surface: TargetSurface, uv: Floats) -> Floats:
    """The normal curvature of the u-lines at ``uv``, positive towards the normal, 1/length.

    (d2S/du2 . N) / |dS/du|^2, the second derivative by central differences of order four.
    """
    step = _steps(surface.domain)[0]
    h = float(step[0])
    near = surface.point(uv + step) + surface.point(uv - step)
    far = surface.point(uv + 2 * step) + surface.point(uv - 2 * step)
    second = (16 * near - far - 30 * surface.point(uv)) / (12 * h * h)
    along = tangents(surface, uv)[0]
    bending = np.einsum("...k,...k->...", second, surface.normal(uv))
    return np.asarray(bending / np.einsum("...k,...k->...", along, along))


def closest_parameters(surface: TargetSurface, points: Floats, samples: int) -> Floats:
    """(n, 2) parameters of the nearest surface points to ``points`` (n, 3).

    A Gauss-Newton iteration on |S(u, v) - p|^2 starts from the nearest of ``samples`` squared
    lattice points, which reach a tenth beyond the domain. A step is at most two lattice cells.
    """
    d = surface.domain
    reach_u, reach_v = 0.1 * d.width, 0.1 * d.height
    wide = Domain(d.u0 - reach_u, d.u1 + reach_u, d.v0 - reach_v, d.v1 + reach_v)
    lattice = wide.lattice(samples, samples).reshape(-1, 2)
    start = cKDTree(surface.point(lattice)).query(points)[1]
    uv = lattice[start]
    cap = 2 * np.array([wide.width, wide.height]) / (samples - 1)
    for _ in range(20):
        along, across = tangents(surface, uv)
        gap = surface.point(uv) - points
        a = np.einsum("nk,nk->n", along, along)
        b = np.einsum("nk,nk->n", along, across)
        c = np.einsum("nk,nk->n", across, across)
        f = np.einsum("nk,nk->n", along, gap)
        g = np.einsum("nk,nk->n", across, gap)
        det = a * c - b * b
        step = np.stack([(b * g - c * f) / det, (b * f - a * g) / det], axis=1)
        step = np.clip(step, -cap, cap)
        uv = uv + step
        if np.abs(step / cap).max(initial=0.0) < 1e-10:
            break
    return uv
