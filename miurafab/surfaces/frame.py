"""The frame of a target that lies far from the origin of its coordinates.

A number of 64 bits has 16 digits. Of a mesh in map coordinates, 26,000 sizes from the origin, five
of them say where it lies, and too few are left for residuals of 1e-13. So such a target is kept
relative to an ``origin``, a point near its middle, and so is everything that is computed from it.
A description holds the origin, in the target's own unit, and none for a target near enough.

The origin is a whole number of steps of a power of two. The difference of a coordinate and the
origin is then exact.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from miurafab.geometry.arrays import Floats

NEAR = 4.0
"""A target whose middle is at most this many sizes from the origin keeps its own coordinates."""


def origin_for(points: Floats) -> Floats:
    """(3,) the origin for a target with the finite ``points`` (n, 3); zeros if it lies near."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, size = low / 2 + high / 2, float((high - low).max())
    if not np.abs(middle).max() > NEAR * size > 0:
        return np.zeros(3)
    step = 2.0 ** math.floor(math.log2(size))
    return np.asarray(np.round(middle / step) * step)


def origin_in(description: Mapping[str, Any]) -> Floats:
    """(3,) the origin that a target's ``description`` holds; zeros for none.

    Raises ``ValueError`` or ``TypeError`` for anything but three finite numbers.
    """
    origin = np.array(description.get("origin", (0.0, 0.0, 0.0)), dtype=np.float64)
    if origin.shape != (3,) or not np.isfinite(origin).all():
        raise ValueError("the origin is not three finite numbers")
    return origin


def described(origin: Floats) -> dict[str, Any]:
    """The part of a description that holds ``origin``: empty for zeros."""
    return {"origin": origin.tolist()} if origin.any() else {}
