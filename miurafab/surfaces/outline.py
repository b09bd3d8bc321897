"""A disk mesh with its own outline as a target: all of the mesh, not a rectangle of it.

One spline through all vertices of the layout is the target; turning the layout turns its parameters
only. The domain is the box around the turned layout and a margin. The outline is the border of the
layout. Beyond it the spline goes on for the cells that the outline cuts, and no farther: a spline
means nothing far from its data.

A lattice of cells lies over the domain. The rows of vertices of a sheet zig-zag: the corners on
every other line across are moved along v. A cell is kept if it meets the region inside the outline.
A kept cell that the outline cuts is at the rim: there the sheet has to reach out at least as far as
the middle p = S(c) of its cell, along the outward direction across the outline

    b = unit(S(c - h g) - S(c + h g)),

with g the gradient of the signed distance at c. After the solve the sheet is cut along the outline:
a point of the sheet is inside where its nearest point of the spline has a signed distance over 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from miurafab.errors import TargetError
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.nearest import tree_of
from miurafab.geometry.outline import Outline
from miurafab.surfaces.mesh import MeshChart, median_edge, spans
from miurafab.surfaces.placement import turned
from miurafab.surfaces.smoothing import smooth
from miurafab.surfaces.spline import continued
from miurafab.surfaces.surface import Domain, gauss_newton, normal_to, unit
from miurafab.surfaces.topology import border_loops

if TYPE_CHECKING:
    from scipy.interpolate import NdBSpline
    from scipy.spatial import cKDTree

LEAST_SHARE = 0.05
"""A cell with a smaller part inside the outline is not kept."""

REACH = 0.1
"""The spline has knots up to this part of the size of the layout beyond it."""

EVEN = (0.6, 1.6)
"""Outside the layout, the spline may shrink and stretch lengths by these factors."""

STIFFER = (1e-3, 1e-2, 1e-1)
"""The stiffnesses tried until the spline is even beyond the layout."""

_SPANS = 40
_SAMPLES = 81
_STEPS = 30


@dataclass(frozen=True, eq=False)
class WholeMesh:
    """All of a disk mesh. ``outline`` is its border in the layout turned by ``angle``, ``domain`` a
    rectangle around it. ``spline`` maps the layout, not turned, to space.
    """

    spline: NdBSpline
    domain: Domain
    outline: Outline
    angle: float
    stiffness: float
    layout: MeshChart = field(repr=False)

    def laid(self, angle: float, margins: tuple[float, float] = (0.0, 0.0)) -> WholeMesh:
        """The same mesh with its layout turned by ``angle`` (radians); the domain is the box around
        it and ``margins`` beyond along u and v.
        """
        loops = [turned(loop, angle - self.angle) for loop in self.outline.loops]
        outline = Outline(tuple(loops))
        low, high = outline.box
        du, dv = margins
        domain = Domain(low[0] - du, high[0] + du, low[1] - dv, high[1] + dv)
        return replace(self, domain=domain, outline=outline, angle=angle)

    def point(self, uv: Floats) -> Floats:
        """The spline, and beyond its knots its straight continuation."""
        return continued(self.spline, self._in_layout(uv))

    def normal(self, uv: Floats) -> Floats:
        return normal_to(*self.tangents(uv))

    def tangents(self, uv: Floats) -> tuple[Floats, Floats]:
        """dS/du and dS/dv at ``uv`` (..., 2) from the derivatives of the spline."""
        knots = self.spline.t
        low, high = (np.array([k[n] for k in knots]) for n in (0, -1))
        at = np.clip(self._in_layout(uv), low, high)
        along, across = (np.asarray(self.spline(at, nu=nu)) for nu in ((1, 0), (0, 1)))
        c, s = math.cos(self.angle), math.sin(self.angle)
        return c * along + s * across, c * across - s * along

    def _in_layout(self, uv: Floats) -> Floats:
        return turned(uv, -self.angle)

    def closest_point(self, points: Floats) -> Floats:
        """(n, 3) the points nearest to ``points`` (n, 3) of the mesh and what fills its holes, and
        of the spline beyond the outline.
        """
        feet = self.feet(points)
        closest = self.layout.filled.closest(points)[0]
        beyond = self.outline.signed_distance(feet) < 0
        on_spline = self.point(feet)
        beyond &= _apart(points, on_spline) < _apart(points, closest)
        return np.where(beyond[:, None], on_spline, closest)

    def nearest(self, points: Floats) -> Floats:
        return self.layout.bare.closest(points)[0]

    def tiles(self) -> Floats:
        return self.layout.triangles

    def __repr__(self) -> str:
        return f"<WholeMesh {self.layout.name}: {len(self.layout.bare.triangles)} triangles>"

    def lines(self, columns: int, rows: int) -> tuple[Floats, Floats]:
        """The lines between ``columns`` x ``rows`` cells, along u and along v."""
        d = self.domain
        return np.linspace(d.u0, d.u1, columns + 1), np.linspace(d.v0, d.v1, rows + 1)

    def kept(self, columns: int, rows: int, zigzag: float = 0.0) -> Bools:
        """(rows, columns) the cells that meet the region inside the outline.

        The rows of vertices of the sheet zig-zag: every other line of vertices across is moved by
        ``zigzag`` times the column spacing, half of it down and half of it up.
        """
        shares = self.outline.shares(*self.lines(columns, rows), zigzag)
        return shares > LEAST_SHARE

    def rim(
        self, columns: int, rows: int, cells: Ints, zigzag: float = 0.0
    ) -> tuple[Ints, Floats, Floats]:
        """Of ``cells`` (F, 2), column and row, those that the outline cuts (k,), their places
        (k, 3) and the outward directions (k, 3).
        """
        u, v = self.lines(columns, rows)
        share = self.outline.shares(u, v, zigzag)[cells[:, 1], cells[:, 0]]
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
        return tree_of(self.point(lattice[near])), lattice[near]

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
            step = gauss_newton(*self.tangents(at), self.point(at) - points[active])[0]
            step *= np.minimum(1.0, cap / np.maximum(np.linalg.norm(step, axis=1), 1e-300))[:, None]
            uv[active] = at + step
            active = active[np.linalg.norm(step, axis=1) > 1e-9 * cap]
            if not len(active):
                break
        return uv


def _apart(points: Floats, others: Floats) -> Floats:
    return np.asarray(np.linalg.norm(points - others, axis=1))


def whole_mesh(layout: MeshChart, stiffness: float = 0.0) -> WholeMesh:
    """The target of all of ``layout``. The spline is at least as stiff as ``stiffness``, and stiff
    enough to be even a little beyond the outline.

    Raises :class:`~miurafab.errors.TargetError` where the layout lies over itself.
    """
    outline = Outline.of_loops([layout.flat[loop] for loop in border_loops(layout.faces)])
    if not outline.simple:
        raise TargetError(
            f"{layout.name}: its outline crosses itself when the mesh is laid flat; cut the mesh "
            "apart, or give `edge` as rectangle."
        )
    low, high = outline.box
    size = high - low
    wide = Domain(*np.stack([low - REACH * size, high + REACH * size], axis=1).ravel().tolist())
    domain = Domain(*np.stack([low, high], axis=1).ravel().tolist())
    places, points = layout.flat[: layout.known], layout.vertices[: layout.known]
    count = spans(wide, median_edge(layout.flat, layout.faces), _SPANS)
    for stiff in [stiffness, *(s for s in STIFFER if s > stiffness)]:
        smoothed = smooth(places, points, wide, count, stiff)
        target = WholeMesh(smoothed.spline, domain, outline, 0.0, stiff, layout)
        if _even_beyond(target):
            break
    return target


def _even_beyond(target: WholeMesh) -> bool:
    """Whether the spline keeps lengths within ``EVEN`` in a strip of a twentieth of the size
    around the outline.
    """
    low, high = target.outline.box
    strip = 0.05 * float((high - low).max())
    wide = target.laid(0.0, (strip, strip)).domain
    lattice = wide.lattice(_SAMPLES, _SAMPLES).reshape(-1, 2)
    phi = target.outline.signed_distance(lattice)
    near = lattice[(phi < 0) & (phi > -strip)]
    speeds = np.concatenate([np.linalg.norm(t, axis=1) for t in target.tangents(near)])
    return bool(speeds.min() > EVEN[0] and speeds.max() < EVEN[1])
