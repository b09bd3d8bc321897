"""Crease patterns that lie flat in another plane than that of x and y."""

from __future__ import annotations

from typing import Any

import numpy as np

from miurafab.geometry.arrays import Floats, vector_product

FLAT = 1e-9
"""The height of a pattern over its plane, as a part of its size, up to which it is flat."""


def laid_in_plane(points: Floats, faces: Any = None) -> Floats | None:
    """``points`` (V, 3) turned so that they lie in the plane of x and y; None if in no plane.

    The side that the first of ``faces`` (lists of corners, as a FOLD file has them) shows comes to
    lie upwards, and without it the side towards the positive axis that is nearest to the normal.
    The axes change as little as the turn needs: from x, z to x, y for a pattern in that plane.
    """
    middle = points.mean(axis=0)
    if len(points) < 3 or not np.isfinite(points).all():
        return None
    _, size, axes = np.linalg.svd(points - middle, full_matrices=False)
    if size[1] <= FLAT * size[0] or size[2] > FLAT * size[0]:
        return None
    normal = axes[2] * np.sign(axes[2][np.argmax(np.abs(axes[2]))])
    if _runs_clockwise(points, faces, normal):
        normal = -normal
    across = np.eye(3)[np.argmin(np.abs(normal))]
    x = across - (across @ normal) * normal
    x /= np.linalg.norm(x)
    y = vector_product(normal, x)
    return np.asarray(points @ np.stack([x, y], axis=1))


def _runs_clockwise(points: Floats, faces: Any, normal: Floats) -> bool:
    """Whether the first facet runs clockwise seen from where ``normal`` points."""
    if not isinstance(faces, list) or not faces or not isinstance(faces[0], list):
        return False
    if not all(type(v) is int and 0 <= v < len(points) for v in faces[0]):
        return False
    corners = points[faces[0]] - points[faces[0][0]]
    area = vector_product(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
    return bool(area @ normal < 0)
