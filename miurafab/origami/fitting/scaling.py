"""Sheets near a given one whose Kawasaki residuals are all its own times a factor.

With K_v = pi - a1 - a3 at vertex v of an exact sheet, the sheet nearest to it with the residuals
f K_v is found by projection onto planarity, developability and these residuals. f = 0 is exactly
flat-foldable. The pattern of the residuals stays as it is, so the energy of folding grows smoothly
with f, at first with its square.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from miurafab.geometry.arrays import Floats
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.fitting.constraints import OrigamiConstraints
from miurafab.origami.fitting.solver import project
from miurafab.origami.tessellation import Tessellation
from miurafab.origami.unfold import unfold

_CAP = 0.25
"""The largest move of a vertex in one step of the projection, in mean edge lengths."""


def residuals(pattern: CreasePattern) -> Floats:
    """(I,) pi - a1 - a3 at each interior vertex of the folded form of a grid, radians."""
    sheet, conditions = _conditions(pattern)
    return np.asarray(-conditions(sheet.vertices.ravel())[0][-_inner(pattern) :])


def worst_residual(pattern: CreasePattern) -> float:
    """The largest of :func:`residuals`, without sign."""
    return float(np.abs(residuals(pattern)).max())


def with_residual(pattern: CreasePattern, worst: float) -> CreasePattern:
    """``pattern`` with its residuals scaled so that the largest is ``worst``.

    Raises ``ArithmeticError`` where no such sheet is found.
    """
    found = scaled_residuals(pattern, worst / worst_residual(pattern))
    if found is None:
        raise ArithmeticError(f"no sheet with residuals up to {worst:g} was found nearby")
    return found


def scaled_residuals(pattern: CreasePattern, factor: float) -> CreasePattern | None:
    """``pattern`` with its residuals times ``factor``, None where no such sheet is found nearby.

    The pattern is one full grid with a folded form.
    """
    sheet, conditions = _conditions(pattern)
    x, inner = sheet.vertices.ravel(), _inner(pattern)
    kept = conditions(x)[0][-inner:] * factor

    def constraints(x: Floats) -> tuple[Floats, sparse.csr_array]:
        values, jacobian = conditions(x)
        values[-inner:] -= kept
        return values, jacobian

    solution = project(constraints, x, cap=_CAP * conditions.length)
    if not solution.converged:
        return None
    assert pattern.grid is not None
    moved = Tessellation(solution.x.reshape(pattern.grid[1], pattern.grid[0], 3))
    return unfold(moved, scale=pattern.scale, target=pattern.target)


def _conditions(pattern: CreasePattern) -> tuple[Tessellation, OrigamiConstraints]:
    assert pattern.grid is not None
    assert pattern.folded_coords is not None
    columns, rows = pattern.grid
    sheet = Tessellation(pattern.folded_coords.reshape(rows, columns, 3))
    length = float(sheet.edge_lengths.mean())
    return sheet, OrigamiConstraints(sheet.grid, length, flat_foldable=True)


def _inner(pattern: CreasePattern) -> int:
    assert pattern.grid is not None
    return (pattern.grid[0] - 2) * (pattern.grid[1] - 2)
