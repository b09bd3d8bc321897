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

from miurafab.geometry.arrays import Floats
from miurafab.origami.tessellation import Tessellation
from miurafab.surfaces.surface import TargetSurface, curvature_along_u, tangents, unit

MAX_TAN_PSI = math.tan(math.radians(60))


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


def seed(
    surface: TargetSurface,
    columns: int,
    rows: int,
    corrugation: Corrugation,
    level: float = 0.0,
) -> tuple[Tessellation, float]:
    """The corrugation on ``surface`` with ``columns`` x ``rows`` vertices, half above and half
    below it; ``level`` lifts the sheet by that part of its height.

    Also returns the largest |tan psi| before the ramp is clipped at tan(60 degrees). A larger value
    means that the target bends too much along the rows for one sheet.
    """
    domain = surface.domain
    uv = domain.lattice(columns, rows)
    du, dv = domain.width / (columns - 1), domain.height / (rows - 1)
    along, across = tangents(surface, uv)
    speed_v = np.linalg.norm(across, axis=-1)
    t = unit(along)
    spacing_i = np.linalg.norm(along, axis=-1) * du
    # the distance between rows, not between neighbours: parameter lines may be oblique
    oblique = np.einsum("...k,...k->...", across, t)
    spacing_j = np.sqrt(np.maximum(speed_v**2 - oblique**2, 1e-12 * speed_v**2)) * dv
    fan_i, fan_j = _fans(spacing_i, spacing_j)
    lambda_i = corrugation.stretch_along * (spacing_i / fan_i).max() * fan_i / spacing_i
    lambda_j = corrugation.stretch_across * (spacing_j / fan_j).max() * fan_j / spacing_j
    sigma = np.sqrt(lambda_j**2 - 1)
    tau = np.sqrt((lambda_i**2 - 1) * (1 + sigma**2)) / sigma

    rate = curvature_along_u(surface, uv) * lambda_i**2 / (lambda_i**2 - 1) * spacing_i
    ramp = np.concatenate(
        [np.zeros((rows, 1)), np.cumsum((rate[:, 1:] + rate[:, :-1]) / 2, axis=1)], axis=1
    )
    ramp -= ramp[:, [columns // 2]] / 2 + ramp[:, [(columns - 1) // 2]] / 2
    steepest = float(np.abs(ramp).max())
    ramp = np.clip(ramp, -MAX_TAN_PSI, MAX_TAN_PSI)

    i, j = np.arange(columns), np.arange(rows)
    shifted = uv.copy()
    shifted[..., 1] += ((i % 2) - 0.5)[None, :] * tau * spacing_i / speed_v
    lift = ((j % 2) - 0.5 + level)[:, None] * sigma * spacing_j
    direction = surface.normal(shifted) + t * ramp[..., None]
    return Tessellation(surface.point(shifted) + lift[..., None] * direction), steepest


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
