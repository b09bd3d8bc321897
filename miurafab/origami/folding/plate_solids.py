"""Plates and brackets as one mesh of prisms, to be written and to be tested for collisions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from miurafab.geometry.arrays import Floats, Ints
from miurafab.origami.folding.contact import triangulate


@dataclass(frozen=True, eq=False)
class PlateSolids:
    """Prisms as one mesh: ``corners`` (n, 3) mm, the facet (n,) that each belongs to, and
    ``triangles`` (m, 3), whose normals point outwards.
    """

    corners: Floats
    facet: Ints
    triangles: Ints

    @classmethod
    def of(cls, parts: list[tuple[int, Floats, float, float]]) -> PlateSolids:
        """From facets, outlines (k, 2) counter-clockwise, and the heights of bottom and top."""
        corners, owner, triangles, count = [], [], [], 0
        for facet, outline, low, high in parts:
            k = len(outline)
            corners += [np.pad(outline, ((0, 0), (0, 1)), constant_values=z) for z in (low, high)]
            owner.append(np.full(2 * k, facet))
            cap, _ = triangulate(np.arange(k)[None], outline)
            here = np.arange(k)
            after = (here + 1) % k
            walls = [
                np.stack([here, after, after + k], axis=1),
                np.stack([here, after + k, here + k], axis=1),
            ]
            triangles += [count + each for each in (cap[:, ::-1], cap + k, *walls)]
            count += 2 * k
        return cls(np.concatenate(corners), np.concatenate(owner), np.concatenate(triangles))
