"""The folded form that a file of another program holds beside its flat pattern.

It may be drawn in another size; then it is taken at the size of the flat pattern. It may also be no
form of this sheet: frames of an animation stretch the paper, and files of few digits round it. Such
a form is left out and told of, and the flat pattern is folded by its letters.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from miurafab.findings import Finding
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami import invariants
from miurafab.origami.crease_pattern import CreasePattern

ROUNDED = 1e-4
"""Flat and folded form in a file of five digits differ by as much, as a part of an edge."""


def with_its_own_form(pattern: CreasePattern) -> CreasePattern:
    """``pattern`` with its folded form in the size of the flat one, or without a folded form that
    is not of this sheet.
    """
    assert pattern.folded_coords is not None
    flat = edge_lengths(pattern.vertices_coords, pattern.edges_vertices)
    folded = edge_lengths(pattern.folded_coords, pattern.edges_vertices)
    if not (flat > 0).all() or not np.isfinite(folded).all():
        return pattern  # which the invariants tell of
    size = float(np.median(folded / flat))
    told = pattern.told
    if np.ptp(folded / flat) <= ROUNDED * size < size and abs(size - 1) > ROUNDED:
        says = (
            f"The folded form of the file is {size:.6g} times as large as its flat pattern, and is "
            "taken at the size of that."
        )
        told = (*told, Finding("resized", says))
        pattern = replace(pattern, folded_coords=pattern.folded_coords / size, told=told)
    left = invariants.residuals(pattern).worst
    if left <= ROUNDED:
        return pattern
    says = (
        "The folded form of the file is left out: its sides, diagonals and angles differ from "
        f"those of the flat pattern by up to {left:.2g} mean edges or radians."
    )
    return replace(pattern, folded_coords=None, told=(*told, Finding("folded-form", says)))
