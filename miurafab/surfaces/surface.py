"""Target surfaces: smooth maps from a rectangle to space.

``TargetSurface`` is the protocol. The functions below derive tangents, curvature and nearest points
from the map alone, by differences of fourth order, so that a new surface needs only one formula.

A target has two faces. The fit follows the *map*, which goes on a little beyond its rectangle. What
is reported is measured to the *whole target*, which is all that the user gave and no more:
``nearest`` and ``tiles``. The whole target of a named surface is the image of its rectangle. That
of a mesh is its triangles, of which the rectangle may cover a part.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import ceil, sqrt
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from miurafab.geometry.arrays import Bools, Floats, vector_product
from miurafab.geometry.nearest import tree_of

CHORD = 2e-4
"""Tiles leave the target by no more than this part of its diagonal. The distances that are reported
are some hundredths of it, so that this is one per cent of them."""

COARSEST_TILES, FINEST_TILES = 48, 600
"""The fewest and the most tiles along a side of the domain, whatever their chords."""


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

    def cell(self, cells: tuple[int, int]) -> Floats:
        """(2,) the sides of one of ``cells`` columns and rows."""
        return np.array([self.width / cells[0], self.height / cells[1]])

    def at(self, places: ArrayLike, cells: tuple[int, int]) -> Floats:
        """(..., 2) the parameters of ``places`` (..., 2), counted in ``cells`` columns and rows."""
        return np.array([self.u0, self.v0]) + np.asarray(places) * self.cell(cells)


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
        """(n, 3) the points nearest to ``points`` (n, 3) of the surface and its continuation."""
        ...

    def nearest(self, points: Floats) -> Floats:
        """(n, 3) the points of the whole target nearest to ``points`` (n, 3)."""
        ...

    def tiles(self) -> Floats:
        """(n, 3, 3) triangles that tile the whole target, side to side.

        Their corners lie on the target, and between the corners they leave it by no more than
        ``CHORD`` of its size.
        """
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
        return normal_to(*tangents(self, uv))

    def closest_point(self, points: Floats) -> Floats:
        return self.point(closest_parameters(self, points, self.samples))

    def nearest(self, points: Floats) -> Floats:
        return self.point(nearest_parameters(self, points, self.samples))

    def tiles(self) -> Floats:
        return patch_tiles(self)


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

    def nearest(self, points: Floats) -> Floats:
        return self.surface.nearest(points)

    def tiles(self) -> Floats:
        return self.surface.tiles()


def unit(vectors: Floats) -> Floats:
    """(..., 3) vectors scaled to length one."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def normal_to(along: Floats, across: Floats) -> Floats:
    """(..., 3) the unit normal to two tangents (..., 3), with which they are right-handed."""
    return unit(vector_product(along, across))


def _steps(domain: Domain) -> tuple[Floats, Floats]:
    return np.array([domain.width * 1e-3, 0.0]), np.array([0.0, domain.height * 1e-3])


def tangents(surface: TargetSurface, uv: Floats) -> tuple[Floats, Floats]:
    """dS/du and dS/dv at ``uv`` (..., 2), each (..., 3), by central differences of order four."""
    du, dv = steps = _steps(surface.domain)
    offsets = np.array([k * step for step in steps for k in (1, -1, 2, -2)])
    # One call: a surface takes as long for one point as for a hundred.
    points = surface.point(uv + offsets.reshape(8, *(1,) * (uv.ndim - 1), 2))
    along, across = (
        (8 * (p[0] - p[1]) - (p[2] - p[3])) / (12 * step)
        for p, step in ((points[:4], du[0]), (points[4:], dv[1]))
    )
    return along, across


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
    uv, cap = _nearest_lattice_point(surface, points, wide, samples)
    for _ in range(20):
        step = np.clip(_towards(surface, uv, points)[0], -cap, cap)
        uv = uv + step
        if np.abs(step / cap).max(initial=0.0) < 1e-10:
            break
    return uv


def nearest_parameters(surface: TargetSurface, points: Floats, samples: int) -> Floats:
    """(n, 2) parameters in the domain of the nearest points of the patch to ``points`` (n, 3).

    The iteration of :func:`closest_parameters`, held in the domain: from the middles of lattice
    cells, which no pole hits. While one parameter stands at its bound and would leave it, the other
    takes the best step that it has alone. Where two sides of the domain are one line in space, as
    all round a revolution, a parameter that leaves at one side comes in at the other.
    """
    d = surface.domain
    low, high = np.array([d.u0, d.v0]), np.array([d.u1, d.v1])
    half_u, half_v = d.width / samples / 2, d.height / samples / 2
    inner = Domain(d.u0 + half_u, d.u1 - half_u, d.v0 + half_v, d.v1 - half_v)
    closed = closed_directions(surface)
    uv, cap = _nearest_lattice_point(surface, points, inner, samples)
    moving = np.arange(len(points))
    for _ in range(30):
        here = uv[moving]
        both, alone = _towards(surface, here, points[moving])
        leaves = ~closed & (((here <= low) & (both < 0)) | ((here >= high) & (both > 0)))
        step = np.clip(np.where(leaves[:, ::-1], alone, both), -cap, cap)
        there = here + step
        uv[moving] = np.where(closed, low + (there - low) % (high - low), np.clip(there, low, high))
        still = np.where(closed, np.abs(step), np.abs(uv[moving] - here)) < 1e-9 * cap
        moving = moving[~still.all(axis=1)]
        if not len(moving):
            break
    return uv


def closed_directions(surface: TargetSurface) -> Bools:
    """(2,) whether the sides u0 and u1 of the domain, and v0 and v1, are one line in space."""
    d = surface.domain
    corners = surface.point(d.lattice(9, 9))
    size = np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0))
    gaps = (corners[:, 0] - corners[:, -1], corners[0] - corners[-1])
    return np.array([np.abs(gap).max() <= 1e-9 * size for gap in gaps])


def patch_tiles(surface: TargetSurface) -> Floats:
    """The tiles of the image of the domain: a lattice, as fine in u and in v as ``CHORD`` asks."""
    d = surface.domain
    columns = rows = COARSEST_TILES
    between = d.lattice(2 * columns + 1, 2 * rows + 1)
    points = surface.point(between)
    size = float(np.linalg.norm(np.ptp(points.reshape(-1, 3), axis=0)))
    mean_u = (points[::2, :-1:2] + points[::2, 2::2]) / 2 - points[::2, 1::2]
    mean_v = (points[:-1:2, ::2] + points[2::2, ::2]) / 2 - points[1::2, ::2]
    twist = (points[:-1:2, :-1:2] + points[2::2, 2::2]) / 2 - points[1::2, 1::2]
    sag_u, sag_v, sag = (
        float(np.abs(np.einsum("jik,jik->ji", gap, surface.normal(uv))).max())
        for gap, uv in (
            (mean_u, between[::2, 1::2]),
            (mean_v, between[1::2, ::2]),
            (twist, between[1::2, 1::2]),
        )
    )
    # the sag of a chord falls with the square of its length
    both = max(sag - sag_u - sag_v, 0.0)
    columns, rows = (
        min(max(n, ceil(n * sqrt((part + both) / (CHORD * size)))), FINEST_TILES)
        for n, part in ((columns, sag_u), (rows, sag_v))
    )
    p = surface.point(d.lattice(columns + 1, rows + 1))
    a, b, c, e = (q.reshape(-1, 3) for q in (p[:-1, :-1], p[:-1, 1:], p[1:, 1:], p[1:, :-1]))
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, e], axis=1)])


def _nearest_lattice_point(
    surface: TargetSurface, points: Floats, domain: Domain, samples: int
) -> tuple[Floats, Floats]:
    """(n, 2) the start of the iterations, and (2,) the longest step: two cells of the lattice."""
    lattice = domain.lattice(samples, samples).reshape(-1, 2)
    start = tree_of(surface.point(lattice)).query(points)[1]
    return lattice[start], 2 * np.array([domain.width, domain.height]) / (samples - 1)


def _towards(surface: TargetSurface, uv: Floats, points: Floats) -> tuple[Floats, Floats]:
    return gauss_newton(*tangents(surface, uv), surface.point(uv) - points)


def gauss_newton(along: Floats, across: Floats, gap: Floats) -> tuple[Floats, Floats]:
    """The step (n, 2) of u and v together that lowers |``gap``|^2, and the steps (n, 2) of each
    alone; ``along`` and ``across`` (n, 3) are the tangents, ``gap`` (n, 3) is S(u, v) - p.
    """
    a = np.einsum("nk,nk->n", along, along)
    b = np.einsum("nk,nk->n", along, across)
    c = np.einsum("nk,nk->n", across, across)
    f = np.einsum("nk,nk->n", along, gap)
    g = np.einsum("nk,nk->n", across, gap)
    det = a * c - b * b
    with np.errstate(invalid="ignore", divide="ignore"):
        alone = np.stack([np.where(a > 0, -f / a, 0.0), np.where(c > 0, -g / c, 0.0)], axis=1)
        both = np.stack([(b * g - c * f) / det, (b * f - a * g) / det], axis=1)
    # where the map has no tangent plane, as at a pole, there is no common step
    return np.where((det > 1e-12 * a * c)[:, None], both, alone), alone
