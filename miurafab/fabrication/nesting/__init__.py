"""Nesting: placing the outlines of patches on few sheets without overlap."""

from miurafab.fabrication.nesting.problem import (
    Problem,
    Ring,
    SheetKind,
    Slot,
    Stock,
    layout_faults,
    place,
    turned,
)
from miurafab.fabrication.nesting.raster import Nesting, nest

__all__ = [
    "Nesting",
    "Problem",
    "Ring",
    "SheetKind",
    "Slot",
    "Stock",
    "layout_faults",
    "nest",
    "place",
    "turned",
]
