"""Which points are near: trees of points, made by SciPy.

``scipy.spatial`` takes a tenth of a second to load, and most commands begin without it, so it is
loaded with the first tree.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from miurafab.geometry.arrays import Floats

if TYPE_CHECKING:
    from scipy.spatial import cKDTree


def tree_of(points: Floats) -> cKDTree:
    """The tree of ``points`` (n, d) that finds the nearest of them."""
    from scipy.spatial import cKDTree

    return cKDTree(points)
