"""Areas of Shapely shapes, with a workaround for a fault of GEOS."""

from __future__ import annotations

import shapely
from shapely.geometry.base import BaseGeometry

GRID_MM = 1e-9
"""Without a grid, GEOS 3.14 can return all of a polygon that only touches the other shape."""


def common_area(first: BaseGeometry, second: BaseGeometry) -> float:
    """The area in mm² that two shapes share."""
    return float(shapely.area(shapely.intersection(first, second, grid_size=GRID_MM)))
