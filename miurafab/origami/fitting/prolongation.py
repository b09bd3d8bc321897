"""Prolongation: a sheet carried to a target that bends a little more, or to a finer grid.

A vertex has local coordinates: its offset from the target at its parameters (u, v), in terms of the
two tangents and the normal there. Local coordinates hardly change when the target bends. Among
vertices of one parity (i mod 2, j mod 2) they are a smooth function of (u, v), proportional to the
spacing of the grid, and can be interpolated.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from miurafab.geometry.arrays import Floats
from miurafab.origami.tessellation import Tessellation
from miurafab.surfaces.surface import TargetSurface, tangents


def to_local(surface: TargetSurface, uv: Floats, points: Floats) -> Floats:
    """(..., 3) coordinates of ``points`` in the frames of ``surface`` at ``uv`` (..., 2)."""
    offset = points - surface.point(uv)
    return np.asarray(np.linalg.solve(_frame(surface, uv), offset[..., None])[..., 0])


def from_local(surface: TargetSurface, uv: Floats, local: Floats) -> Floats:
    """(..., 3) points with the coordinates ``local``, the inverse of :func:`to_local`."""
    return np.asarray(surface.point(uv) + (_frame(surface, uv) @ local[..., None])[..., 0])


def _frame(surface: TargetSurface, uv: Floats) -> Floats:
    along, across = tangents(surface, uv)
    return np.stack([along, across, surface.normal(uv)], axis=-1)


def refined(surface: TargetSurface, coarse: Tessellation, columns: int, rows: int) -> Tessellation:
    """``coarse``, of 4 vertices a side or more, interpolated to ``columns`` x ``rows`` vertices."""
    domain = surface.domain
    old_rows, old_columns = coarse.points.shape[:2]
    old, new = domain.lattice(old_columns, old_rows), domain.lattice(columns, rows)
    local = to_local(surface, old, coarse.points)
    fine = np.empty((rows, columns, 3))
    for b in (0, 1):
        for a in (0, 1):
            smooth = RegularGridInterpolator(
                (old[b::2, 0, 1], old[0, a::2, 0]),
                local[b::2, a::2],
                bounds_error=False,
                fill_value=None,
            )
            fine[b::2, a::2] = smooth(new[b::2, a::2, ::-1])
    shrink_u, shrink_v = (old_columns - 1) / (columns - 1), (old_rows - 1) / (rows - 1)
    fine *= [shrink_u, shrink_v, np.sqrt(shrink_u * shrink_v)]
    return Tessellation(from_local(surface, new, fine))
