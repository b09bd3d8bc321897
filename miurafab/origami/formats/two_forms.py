"""The folded form that a file of another program holds beside its flat pattern.

It may be drawn in another size; then it is taken at the size of the flat pattern. It may also be no
form of this sheet: frames of an animation stretch the paper, and files of few digits round it. Such
a form is left out and told of, and the flat pattern is folded by its letters. What a form differs
by less, as the digits of its file explain, is told of and counts as exact.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from miurafab.findings import Finding
from miurafab.geometry.arrays import Floats
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami import invariants
from miurafab.origami.crease_pattern import CreasePattern

ROUNDED = 1e-4
"""Flat and folded form in a file of five digits differ by as much, as a part of an edge."""

MOST_DECIMALS = 15
"""Numbers of more decimals are taken as not rounded."""

STEPS = 16
"""So many steps between numbers, over the shortest edge, add up in a residual."""

FEWEST_DIGITS = 1e-5
"""A step between numbers, as a part of their range, that may come from rounding."""


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


def with_its_rounding(pattern: CreasePattern, flat: Floats, folded: Floats) -> CreasePattern:
    """``pattern`` with what the few digits of its file leave between its two forms, which are the
    numbers ``flat`` and ``folded`` (V, 2) or (V, 3) there; the pattern itself where they differ by
    more than such digits explain, or by nothing.
    """
    if pattern.folded_coords is None:
        return pattern
    forms = flat, folded
    shortest = [edge_lengths(form, pattern.edges_vertices).min() for form in forms]
    if not min(shortest) > 0:
        return pattern
    explained = max(_step(form) / side for form, side in zip(forms, shortest, strict=True))
    if explained == 0.0:
        return pattern
    left = invariants.residuals(pattern).worst
    if not invariants.exactness(pattern) < left <= min(ROUNDED, STEPS * explained):
        return pattern
    says = (
        "The coordinates of the file have few digits: its flat pattern and its folded form differ "
        f"by up to {left:.2g} mean edges or radians, which is their rounding."
    )
    return replace(pattern, rounded=left, told=(*pattern.told, Finding("rounded", says)))


def _step(form: Floats) -> float:
    """The step between the numbers of a ``form`` of few decimals, or of single precision; else 0.

    Numbers with fewer than five digits, as those of a grid, are not taken as rounded.
    """
    rounded = [(10.0**-decimals, np.round(form, decimals)) for decimals in range(MOST_DECIMALS + 1)]
    single = form.astype(np.float32)
    rounded.append((float(np.spacing(np.abs(single).max())), single.astype(np.float64)))
    step = next((step for step, numbers in rounded if (numbers == form).all()), 0.0)
    return step if step <= FEWEST_DIGITS * np.ptp(form) else 0.0
