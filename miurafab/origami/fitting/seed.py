"""The seed: a Miura corrugation on the target, near enough to an exact sheet for projection.

Symbols (grid index i along the rows, spacing S; j across, spacing L; H height, V zig-zag):

    sigma = H / L,   tau = V / S
    lambda_j^2 = 1 + sigma^2,   lambda_i^2 = 1 + tau^2 sigma^2 / (1 + sigma^2)

are the stretches from the surface to the flat paper. Because paper is flat, lambda_i S and
lambda_j L are those of a rectangle, or of a fan where the spacing grows to one side. One of them is
constant over the sheet, the other is A (1 + k n), with n the grid index across and k fitted to the
spacing (the plane in polar coordinates, which is flat for every k). A is the least value with
lambda >= c.

A cell cannot absorb the curvature kappa_i along the rows. Instead the upper layer slides over the
lower layer by the angle psi,

    d(tan psi) / ds = kappa_i lambda_i^2 / (lambda_i^2 - 1),

integrated along i and centred. The vertices are then

    X = P(u, v + (i mod 2 - 1/2) V) + (j mod 2 - 1/2) H (N + t tan psi).

Metric and ramp decide whether the projection converges; both are this project's own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from miurafab.geometry.arrays import Bools, Floats
from miurafab.geometry.quads import QuadCharts
from miurafab.surfaces.surface import TargetSurface, curvature_along_u, tangents, unit

STEEPEST = math.radians(60)
"""The slide is clipped at this angle unless the caller asks for less."""


@dataclass(frozen=True)
class Corrugation:
    """The least ``amplitude`` (sigma) and ``zigzag`` (tau) anywhere on the sheet."""

    amplitude: float
    zigzag: float

    @property
    def stretch_across(self) -> float:
        """c_j."""
        return math.hypot(1.0, self.amplitude)

    @property
    def stretch_along(self) -> float:
        """c_i."""
        return math.sqrt(1 + (self.zigzag * self.amplitude) ** 2 / (1 + self.amplitude**2))

    @classmethod
    def from_stretches(cls, along: float, across: float) -> Corrugation:
        """The corrugation with the stretches c_i = ``along`` and c_j = ``across``, both > 1."""
        amplitude = math.sqrt(across**2 - 1)
        return cls(amplitude, math.sqrt((along**2 - 1) * (1 + amplitude**2)) / amplitude)


@dataclass(frozen=True, eq=False)
class Seed:
    """The corrugation on a target: ``vertices`` (V, 3) of its charts, and ``steepest``, the largest
    slide psi that it asks for before the clip, radians.
    """

    vertices: Floats
    steepest: float


def seed(
    surface: TargetSurface,
    charts: QuadCharts,
    columns: int,
    rows: int,
    corrugation: Corrugation,
    *,
    clip: float = STEEPEST,
    level: float = 0.0,
) -> Seed:
    """The corrugation on ``surface``, half above and half below it.

    ``charts`` are cells of a lattice of ``columns`` x ``rows`` cells over the domain. Each chart
    has a ramp of its own; vertices that charts share are the mean of both. ``level`` lifts the
    sheet by that part of its height. The slide is clipped at the angle ``clip``.
    """
    lattice = surface.domain.lattice(columns + 1, rows + 1)
    total = np.zeros((charts.vertices_count, 3))
    share = np.zeros(charts.vertices_count)
    whole = len(charts.cells) == columns * rows and not charts.pieces.any()
    steepest = 0.0
    for piece in np.unique(charts.pieces).tolist():
        facets = np.flatnonzero(charts.pieces == piece)
        cells = charts.cells[facets]
        first, last = int(cells[:, 0].min()), int(cells[:, 0].max()) + 1
        corner = cells[:, None, :] + np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
        right, up = corner[..., 0] - first, corner[..., 1]
        used = np.zeros((rows + 1, last - first + 1), dtype=bool)
        used[up, right] = True
        metric = _Metric.of(
            surface, lattice[:, first : last + 1], (columns, rows), corrugation, whole
        )
        ramp = metric.ramp(surface, used)
        steepest = max(steepest, float(np.abs(ramp[used]).max()))
        points = metric.points(
            surface, np.clip(ramp, -math.tan(clip), math.tan(clip)), first, level
        )
        np.add.at(total, charts.faces_vertices[facets], points[up, right])
        np.add.at(share, charts.faces_vertices[facets], 1.0)
    return Seed(total / share[:, None], math.atan(steepest))


@dataclass(frozen=True, eq=False)
class _Metric:
    """The stretches on the vertices ``uv`` (rows, columns, 2) of one chart, and what follows."""

    uv: Floats
    along: Floats
    speed_v: Floats
    spacing_i: Floats
    spacing_j: Floats
    lambda_i: Floats
    lambda_j: Floats

    @classmethod
    def of(
        cls,
        surface: TargetSurface,
        uv: Floats,
        cells: tuple[int, int],
        corrugation: Corrugation,
        fans: bool,
    ) -> _Metric:
        du, dv = surface.domain.cell(cells)
        along, across = tangents(surface, uv)
        speed_v = np.linalg.norm(across, axis=-1)
        t = unit(along)
        spacing_i = np.linalg.norm(along, axis=-1) * du
        # the distance between rows, not between neighbours: parameter lines may be oblique
        oblique = np.einsum("...k,...k->...", across, t)
        spacing_j = np.sqrt(np.maximum(speed_v**2 - oblique**2, 1e-12 * speed_v**2)) * dv
        lambda_i = np.full_like(spacing_i, corrugation.stretch_along)
        lambda_j = np.full_like(spacing_j, corrugation.stretch_across)
        if fans:
            fan_i, fan_j = _fans(spacing_i, spacing_j)
            lambda_i *= (spacing_i / fan_i).max() * fan_i / spacing_i
            lambda_j *= (spacing_j / fan_j).max() * fan_j / spacing_j
        return cls(uv, t, speed_v, spacing_i, spacing_j, lambda_i, lambda_j)

    def ramp(self, surface: TargetSurface, used: Bools) -> Floats:
        """(rows, columns) tan psi, zero in the middle of the vertices ``used`` of each row."""
        rate = curvature_along_u(surface, self.uv) * self.spacing_i
        rate = rate * self.lambda_i**2 / (self.lambda_i**2 - 1)
        steps = (rate[:, 1:] + rate[:, :-1]) / 2
        ramp = np.concatenate([np.zeros((len(rate), 1)), np.cumsum(steps, axis=1)], axis=1)
        first = used.argmax(axis=1)
        last = used.shape[1] - 1 - used[:, ::-1].argmax(axis=1)
        row = np.arange(len(ramp))
        middle = ramp[row, (first + last) // 2] + ramp[row, (first + last + 1) // 2]
        return np.asarray(ramp - middle[:, None] / 2)

    def points(self, surface: TargetSurface, ramp: Floats, first: int, level: float) -> Floats:
        """(rows, columns, 3) the corrugation; ``first`` is the number of the first column."""
        sigma = np.sqrt(self.lambda_j**2 - 1)
        tau = np.sqrt((self.lambda_i**2 - 1) * (1 + sigma**2)) / sigma
        rows, columns = ramp.shape
        i, j = first + np.arange(columns), np.arange(rows)
        shifted = self.uv.copy()
        shifted[..., 1] += ((i % 2) - 0.5)[None, :] * tau * self.spacing_i / self.speed_v
        lift = ((j % 2) - 0.5 + level)[:, None] * sigma * self.spacing_j
        direction = surface.normal(shifted) + self.along * ramp[..., None]
        return np.asarray(surface.point(shifted) + lift[..., None] * direction)


def _fans(spacing_i: Floats, spacing_j: Floats) -> tuple[Floats, Floats]:
    """The shapes of lambda_i S and lambda_j L over the sheet, each (rows, columns) with mean one.

    Only one of them may vary, for flat paper: the one with the larger linear trend.
    """
    fan_i, trend_i = _trend(spacing_i.mean(axis=1))
    fan_j, trend_j = _trend(spacing_j.mean(axis=0))
    level = np.ones_like(spacing_i)
    if trend_i > trend_j:
        return level * fan_i[:, None], level
    return level, level * fan_j[None, :]


def _trend(spacing: Floats) -> tuple[Floats, float]:
    """The line fitted to ``spacing`` (n,), over its mean, and its rise from end to end, which is
    limited to that from 1/4 to 7/4.
    """
    n = np.linspace(-1.0, 1.0, len(spacing))
    slope = float(n @ spacing / (n @ n)) / float(spacing.mean())
    slope = min(max(slope, -0.75), 0.75)
    return 1 + slope * n, 2 * abs(slope)
