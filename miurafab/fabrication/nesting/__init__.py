"""Nesting: the outlines of patches placed on few sheets, turned but never overlapping."""

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
from miurafab.fabrication.nesting.run import ENGINES, RASTER, Nesting, check_engine, nest

__all__ = [
    "ENGINES",
    "RASTER",
    "Nesting",
    "Problem",
    "Ring",
    "SheetKind",
    "Slot",
    "Stock",
    "check_engine",
    "layout_faults",
    "nest",
    "place",
    "turned",
]
