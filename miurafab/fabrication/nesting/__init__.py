"""Nesting: the outlines of patches placed on few sheets, turned but never overlapping."""

from miurafab.fabrication.nesting.problem import (
    Problem,
    SheetKind,
    Slot,
    Stock,
    layout_faults,
    place,
    turned,
)
from miurafab.fabrication.nesting.run import Nesting, nest

__all__ = [
    "Nesting",
    "Problem",
    "SheetKind",
    "Slot",
    "Stock",
    "layout_faults",
    "nest",
    "place",
    "turned",
]
