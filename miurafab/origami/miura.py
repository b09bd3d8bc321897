"""The regular Miura-ori in closed form: the reference of the tests.

One cell has parallelogram facets with sides a (across the rows) and b (along them) and acute angle
alpha. Folded by theta (the angle between facets and the base plane's normal section):

    H = a sin(theta) sin(alpha)                         height of the ridges
    S = b cos(theta) tan(alpha) / sqrt(1 + cos^2(theta) tan^2(alpha))     half cell along i
    L = a sqrt(1 - sin^2(theta) sin^2(alpha))           half cell along j
    V = b / sqrt(1 + cos^2(theta) tan^2(alpha))         zig-zag within the plane

(M. Schenk and S. D. Guest, Geometry of Miura-folded metamaterials, PNAS 110 (2013), eqs 1-4.)
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from miurafab.origami.tessellation import Tessellation


@dataclass(frozen=True)
class MiuraCell:
    """Sides ``across`` (a) and ``along`` (b), acute angle ``alpha`` in radians, fold ``theta``.

    ``theta`` 0 is flat paper and pi/2 folded flat.
    """

    across: float
    along: float
    alpha: float
    theta: float

    @property
    def height(self) -> float:
        return self.across * math.sin(self.theta) * math.sin(self.alpha)

    @property
    def spacing_along(self) -> float:
        reach = math.cos(self.theta) * math.tan(self.alpha)
        return self.along * reach / math.hypot(1.0, reach)

    @property
    def spacing_across(self) -> float:
        return self.across * math.sqrt(1 - (math.sin(self.theta) * math.sin(self.alpha)) ** 2)

    @property
    def zigzag(self) -> float:
        return self.along / math.hypot(1.0, math.cos(self.theta) * math.tan(self.alpha))


def regular_miura(cell: MiuraCell, columns: int, rows: int) -> Tessellation:
    """The folded sheet of ``columns`` x ``rows`` vertices, centred at height zero."""
    i, j = np.meshgrid(np.arange(columns), np.arange(rows))
    x = i * cell.spacing_along
    y = j * cell.spacing_across + (i % 2) * cell.zigzag
    z = ((j % 2) - 0.5) * cell.height
    return Tessellation(np.stack([x, y, z], axis=-1).astype(np.float64))
