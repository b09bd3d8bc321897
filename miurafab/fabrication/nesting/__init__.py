"""Nesting: placing the outlines of patches on few sheets without overlap."""

from miurafab.fabrication.nesting.problem import (
    Problem,
    Ring,
    SheetKind,
    Slot,
    Stock,
    layout_faults,
    place,
    price,
    turned,
)
from miurafab.fabrication.nesting.raster import Nesting, first_nesting, nest, nest_within

__all__ = [
    "Nesting",
    "Problem",
    "Ring",
    "SheetKind",
    "Slot",
    "Stock",
    "first_nesting",
    "layout_faults",
    "nest",
    "nest_within",
    "place",
    "price",
    "turned",
]
