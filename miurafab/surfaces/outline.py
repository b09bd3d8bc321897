"""A disk mesh with its own outline as a target: all of the mesh, not a rectangle of it.

The layout of the mesh is turned by an angle, as for a rectangle. The domain is the box around the
layout and a margin, and one spline through all vertices of the mesh is the target over it. The
outline is the border of the layout. Beyond it the spline goes on for the cells that the outline
cuts, and no farther: a spline means nothing far from its data.

A lattice of cells lies over the domain. A cell is kept if it meets the region inside the outline.
A kept cell that the outline cuts is at the rim: there the sheet has to reach out at least as far as
the middle p = S(c) of its cell, along the outward direction across the outline

    b = unit(S(c - h g) - S(c + h g)),

with g the gradient of the signed distance at c. After the solve the sheet is cut along the outline:
a point of the sheet is inside where its nearest point of the spline has a signed distance over 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import NdBSpline
from scipy.spatial import cKDTree

from miurafab.errors import TargetError
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.distances import closest_on_mesh
from miurafab.geometry.outline import Outline
from miurafab.surfaces.mesh import MeshChart, median_edge, spans
from miurafab.surfaces.mesh_repair import even_triangles
from miurafab.surfaces.parameterise import border_loops
from miurafab.surfaces.placement import turned
from miurafab.surfaces.smoothing import continued, smooth
from miurafab.surfaces.surface import Domain, tangents, unit

MARGIN = 0.04
"""The domain reaches beyond the layout by this part of its size."""

LEAST_SHARE = 0.02
"""A cell with a smaller part inside the outline is not kept."""

EVEN = (0.6, 1.6)
"""Outside the layout, the spline may shrink and stretch lengths by these factors."""

STIFFER = (0.0, 1e-3, 1e-2, 1e-1)
"""The stiffnesses tried until the spline is even beyond the layout."""

_SPANS = 40
_SAMPLES = 81
_STEPS = 30


@dataclass(frozen=True, eq=False)
class WholeMesh:
    """All of a disk mesh. ``spline`` maps ``domain`` to space, ``outline`` is the border of the
    mesh in the layout, turned by ``angle``; ``triangles`` (T, 3, 3) are the mesh itself.
    """

    spline: NdBSpline
    domain: Domain
    outline: Outline
    triangles: Floats
    angle: float
    stiffness: float
    layout: MeshChart = field(repr=False)

    def point(self, uv: Floats) -> Floats:
        """The spline, and beyond its knots its straight continuation."""
        return continued(self.spline, uv)

    def normal(self, uv: Floats) -> Floats:
        along, across = tangents(self, uv)
        return unit(np.cross(along, across))

    def closest_point(self, points: Floats) -> Floats:
        return closest_on_mesh(points, self.triangles)

    def __repr__(self) -> str:
        return f"<WholeMesh {self.layout.name}: {len(self.triangles)} triangles>"

    @property
    def description(self) -> dict[str, Any]:
        """What :func:`whole_mesh` needs to lay the mesh out again; ``rotate`` in degrees."""
        return {"rotate": round(math.degrees(self.angle), 12), "stiffness": self.stiffness}

    def lines(self, columns: int, rows: int) -> tuple[Floats, Floats]:
        """The lines between ``columns`` x ``rows`` cells, along u and along v."""
        d = self.domain
        return np.linspace(d.u0, d.u1, columns + 1), np.linspace(d.v0, d.v1, rows + 1)

    def kept(self, columns: int, rows: int) -> Bools:
        """(rows, columns) the cells that meet the region inside the outline."""
        return self.outline.shares(*self.lines(columns, rows)) > LEAST_SHARE

    def rim(self, columns: int, rows: int, cells: Ints) -> tuple[Ints, Floats, Floats]:
        """Of ``cells`` (F, 2), column and row, those that the outline cuts (k,), their places
        (k, 3) and the outward directions (k, 3).
        """
        u, v = self.lines(columns, rows)
        share = self.outline.shares(u, v)[cells[:, 1], cells[:, 0]]
        cut = np.flatnonzero(share < 1 - 1e-9)
        step = np.array([u[1] - u[0], v[1] - v[0]])
        centres = np.array([u[0], v[0]]) + (cells[cut] + 0.5) * step
        gradient = self.outline.nearest(centres)[1]
        h = 0.05 * float(step.min())
        outward = unit(self.point(centres - h * gradient) - self.point(centres + h * gradient))
        return cut, self.point(centres), outward

    @cached_property
    def _samples(self) -> tuple[cKDTree, Floats]:
        lattice = self.domain.lattice(_SAMPLES, _SAMPLES).reshape(-1, 2)
        near = self.outline.signed_distance(lattice) > -2 * self._cell
        return cKDTree(self.point(lattice[near])), lattice[near]

    @property
    def _cell(self) -> float:
        return 4 * max(self.domain.width, self.domain.height) / _SAMPLES

    def feet(self, points: Floats, start: Floats | None = None) -> Floats:
        """(n, 2) the parameters of the spline's points nearest to ``points`` (n, 3).

        A Gauss-Newton iteration from ``start`` (n, 2), or from the nearest of a lattice of samples.
        """
        if start is None:
            tree, lattice = self._samples
            start = lattice[tree.query(points)[1]]
        uv = start.copy()
        cap = 0.5 * self._cell
        active = np.arange(len(points))
        for _ in range(_STEPS):
            at = uv[active]
            along, across = self._tangents(at)
            gap = self.point(at) - points[active]
            a, b, c = _dot(along, along), _dot(along, across), _dot(across, across)
            f, g = _dot(along, gap), _dot(across, gap)
            det = a * c - b * b
            step = np.stack([(b * g - c * f) / det, (b * f - a * g) / det], axis=1)
            step *= np.minimum(1.0, cap / np.maximum(np.linalg.norm(step, axis=1), 1e-300))[:, None]
            uv[active] = at + step
            active = active[np.linalg.norm(step, axis=1) > 1e-9 * cap]
            if not len(active):
                break
        return uv

    def _tangents(self, uv: Floats) -> tuple[Floats, Floats]:
        """dS/du and dS/dv at ``uv`` (n, 2) by the derivative of the spline, which is exact."""
        low = np.array([knots[0] for knots in self.spline.t])
        high = np.array([knots[-1] for knots in self.spline.t])
        at = np.clip(uv, low, high)
        return np.asarray(self.spline(at, nu=(1, 0))), np.asarray(self.spline(at, nu=(0, 1)))


def whole_mesh(layout: MeshChart, angle: float = 0.0, stiffness: float = 0.0) -> WholeMesh:
    """The target of all of ``layout``, turned by ``angle`` (radians), its spline at least as stiff
    as ``stiffness``, and stiff enough to be even one cell beyond the border.

    Raises :class:`~miurafab.errors.TargetError` where the layout lies over itself.
    """
    frame = turned(layout.flat, angle)
    outline = Outline.of_loops([frame[loop] for loop in border_loops(layout.faces)])
    if not outline.simple:
        raise TargetError(
            f"{layout.name}: its outline crosses itself when the mesh is laid flat; cut the mesh "
            "apart, or give `edge` as rectangle."
        )
    low, high = outline.box
    reach = MARGIN * (high - low)
    domain = Domain(low[0] - reach[0], high[0] + reach[0], low[1] - reach[1], high[1] + reach[1])
    triangles = even_triangles(layout.vertices, layout.faces[: layout.real])
    places, points = frame[: layout.known], layout.vertices[: layout.known]
    count = spans(domain, median_edge(frame, layout.faces), _SPANS)
    for stiff in [s for s in STIFFER if s > stiffness] or [stiffness]:
        tried = max(stiff, stiffness) if stiff else stiffness
        smoothed = smooth(places, points, domain, count, tried)
        target = WholeMesh(smoothed.spline, domain, outline, triangles, angle, tried, layout)
        if _even_beyond(target):
            break
    return target


def _even_beyond(target: WholeMesh) -> bool:
    """Whether the spline keeps lengths within ``EVEN`` in a strip of a twentieth of the size
    around the outline.
    """
    lattice = target.domain.lattice(_SAMPLES, _SAMPLES).reshape(-1, 2)
    phi = target.outline.signed_distance(lattice)
    strip = lattice[(phi < 0) & (phi > -0.05 * max(target.domain.width, target.domain.height))]
    speeds = np.concatenate([np.linalg.norm(t, axis=1) for t in target._tangents(strip)])
    return bool(len(speeds) == 0 or (speeds.min() > EVEN[0] and speeds.max() < EVEN[1]))


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("nk,nk->n", a, b))
