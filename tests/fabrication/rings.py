"""Sheets whose folded form closes upon itself: a revolved ring, a tube by direct construction."""

from __future__ import annotations

from functools import cache

import numpy as np

from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.cylinder import cylinder_over_polyline
from miurafab.origami.fitting.fit import fit
from miurafab.origami.unfold import unfold
from miurafab.workflow.design import design


@cache
def tube(sides: int = 12, columns: int = 7, size: float = 30.0) -> CreasePattern:
    """A closed tube over a star of ``sides`` (even) corners, about ``size`` mm in radius."""
    turn = 2 * np.pi * np.arange(-1, sides + 2) / sides
    radius = size * np.where(np.arange(-1, sides + 2) % 2, 1.3, 1.0)
    profile = radius[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    return unfold(cylinder_over_polyline(profile, 0.5 * size, 0.15 * size, columns))


@cache
def revolved(facets: str, size: str, close: str = "seam") -> CreasePattern:
    """A hyperboloid turned all round in one piece, with a seam to glue or a gap."""
    return fit(
        design("hyperboloid", facets=facets, size=size, close=close, pieces=1).request
    ).pattern
