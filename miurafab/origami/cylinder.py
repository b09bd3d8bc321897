"""Generalized cylinders by direct construction: algebra meets every constraint, without a solver.

The profile is a zig-zag polyline P_j in the plane across the axis, with unit segments d_j in the
directions theta_j. Columns are a step a apart along the axis. Alternate columns are shifted along
v_j, the only direction that keeps neighbouring facets planar:

    X_ij = (i a, P_j + h_i v_j),   v_j = (-1)^j (d_{j-1} + d_j) / sin(theta_{j-1} - theta_j)

With h_i alternating between two values the sheet is developable, flat-foldable and folds rigidly
(Zhou, Wang and You, Proc. R. Soc. A 471 (2015) 20150407; Dudte et al. 2016, Methods).
"""

from __future__ import annotations

import math

import numpy as np

from miurafab.geometry.arrays import Floats
from miurafab.origami.tessellation import Tessellation
from miurafab.surfaces.analytic import GeneralizedCylinder


def cylinder_over_polyline(profile: Floats, step: float, push: float, columns: int) -> Tessellation:
    """The tessellation of ``columns`` x (n - 2) vertices over a zig-zag polyline.

    ``profile`` (n, 2) are y and z of the polyline; its first and last point only give the
    directions at the ends. Columns are ``step`` apart and shifted by +-``push`` / 2.
    """
    segments = np.diff(profile, axis=0)
    d = segments / np.linalg.norm(segments, axis=1, keepdims=True)
    before, after = d[:-1], d[1:]
    sine = before[:, 1] * after[:, 0] - before[:, 0] * after[:, 1]
    sign = np.where(np.arange(len(sine)) % 2, -1.0, 1.0)
    v = sign[:, None] * (before + after) / sine[:, None]
    h = np.where(np.arange(columns) % 2, 0.5, -0.5) * push
    yz = profile[1:-1, None, :] + h[None, :, None] * v[:, None, :]
    x = (np.arange(columns) - (columns - 1) / 2) * step
    x = np.broadcast_to(x[None, :, None], (*yz.shape[:2], 1))
    return Tessellation(np.concatenate([x, yz], axis=-1))


def cylinder_on(
    surface: GeneralizedCylinder,
    columns: int,
    rows: int,
    amplitude: float,
    zigzag: float,
    level: float = 0.0,
) -> Tessellation:
    """The tessellation of ``columns`` x ``rows`` vertices on a generalized cylinder.

    ``amplitude`` is the height of the corrugation over the row spacing, ``zigzag`` the zig-zag
    over the column spacing. The vertices of the profile are evenly spaced along the curve, half the
    height above and below it; ``level`` lifts the sheet by that part of the height.

    On a closed profile, with an odd number of ``rows``, the sheet is a tube whose last row of
    vertices is its first row.
    """
    if surface.closed and rows % 2:
        around = np.arange(-2, rows + 2) % (rows - 1)
        on_curve = surface.profile.evenly(rows)[around]
        on_curve, tangent = on_curve[1:-1], np.gradient(on_curve, axis=0)[1:-1]
    else:
        beyond = 1.0 / (rows - 1)
        on_curve = surface.profile.evenly(rows + 2, -beyond, 1.0 + beyond)
        tangent = np.gradient(on_curve, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    spacing = float(np.linalg.norm(np.diff(on_curve, axis=0), axis=1).mean())
    # the point before the first row is row -1, hence the shifted parity
    side = np.where(np.arange(rows + 2) % 2, -0.5, 0.5)
    profile = on_curve + (side + level)[:, None] * amplitude * spacing * normal
    step = surface.domain.width / (columns - 1)
    # On a plane |v_j| = 1 / sin(phi), phi the profile's slope, tan(phi) = amplitude.
    push = zigzag * step * math.sin(math.atan(amplitude))
    return cylinder_over_polyline(profile, step, push, columns)
