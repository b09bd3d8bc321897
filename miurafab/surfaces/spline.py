"""Tensor splines of two parameters, beyond their knots too.

A target needs this to be asked for its points; what makes a spline of scattered points
(:mod:`~miurafab.surfaces.smoothing`) loads a library for sparse matrices besides.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from miurafab.geometry.arrays import Floats

if TYPE_CHECKING:
    from scipy.interpolate import NdBSpline

DEGREE = 3


def continued(spline: NdBSpline, uv: Floats) -> Floats:
    """(..., 3) points of ``spline`` at ``uv`` (..., 2); beyond its knots it goes straight on."""
    low = np.array([knots[DEGREE] for knots in spline.t])
    high = np.array([knots[-1 - DEGREE] for knots in spline.t])
    inside = np.clip(uv, low, high)
    beyond = uv - inside
    points = np.asarray(spline(inside), dtype=np.float64)
    if beyond.any():
        points += beyond[..., :1] * spline(inside, nu=(1, 0))
        points += beyond[..., 1:] * spline(inside, nu=(0, 1))
    return points
