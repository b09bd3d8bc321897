"""The stock: the sheets from which patches are cut, and the rotations that are allowed on them.

A stock file is TOML with one table for each kind of sheet, as it lies on the bed with its lower
left corner at the bed's::

    [[sheets]]
    name = "left over"            # shown where a sheet is used
    width = "400mm"               # along the bed's x
    height = "300mm"              # along its y
    quantity = 2                  # default: unlimited
    grain = "y"                   # default: the material's

    [[sheets.defects]]            # no patch is placed here
    x = "120mm"
    y = "40mm"
    width = "60mm"
    height = "30mm"

    [[sheets.defects]]
    outline = [[350, 0], [400, 0], [400, 60]]

The grain of a sheet is the direction of its fibres: the bed's x, the bed's y, or none. If a sheet
has a grain, one axis of the pattern is laid along it: patches keep the frame of the pattern, and
only the rotations that lay this axis along the fibres, in either direction, are allowed.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import shapely

from miurafab.errors import InputError, LayoutError
from miurafab.fabrication.nesting.problem import Ring, SheetKind, Stock
from miurafab.fabrication.options import LayoutOptions
from miurafab.options import Choice, Text, Whole, length
from miurafab.profiles import GRAINS, Table, read_toml
from miurafab.profiles.machine import Bed


@dataclass(frozen=True)
class StockSheet:
    """A kind of sheet: its ``name``, whole size in mm, ``quantity`` (None: unlimited), ``grain``
    (``x``, ``y`` or ``none``; None: the material's) and ``defects_mm``.
    """

    name: str
    width_mm: float
    height_mm: float
    quantity: int | None = None
    grain: str | None = None
    defects_mm: tuple[Ring, ...] = ()


@dataclass(frozen=True)
class LaidStock:
    """The ``sheets`` for a bed, the direction of the ``fibres`` of each, the same sheets as
    ``kinds`` for nesting (without ``margin_mm``), and the index of the ``main`` sheet, which
    patches are made to fit.
    """

    sheets: tuple[StockSheet, ...]
    fibres: tuple[str, ...]
    kinds: Stock
    main: int
    margin_mm: float

    @property
    def upright(self) -> bool:
        """Whether patches keep the directions of the pattern, because some sheet has a grain."""
        return any(way != "none" for way in self.fibres)


def read_stock(path: Path) -> tuple[StockSheet, ...]:
    """The sheets in a stock file.

    Raises :class:`~miurafab.errors.InputError` naming the file, the key and what is accepted.
    """
    table = Table(read_toml(path, InputError), path.name, InputError)
    sheets = tuple(
        _sheet(entry, f"sheet {number}")
        for number, entry in enumerate(table.tables("sheets"), start=1)
    )
    table.finish()
    if not sheets:
        raise InputError(f"{path.name} holds no sheet; write one under [[sheets]].")
    return sheets


def _sheet(table: Table, name: str) -> StockSheet:
    sheet = StockSheet(
        name=table.value("name", Text(), name),
        width_mm=table.value("width", length(1, 1e5)),
        height_mm=table.value("height", length(1, 1e5)),
        quantity=table.value("quantity", Whole(1, 10_000), None),
        grain=table.value("grain", Choice(GRAINS), None),
        defects_mm=tuple(_defect(entry) for entry in table.tables("defects")),
    )
    table.finish()
    return sheet


def _defect(table: Table) -> Ring:
    """The corners of a defect, given as a rectangle or as an outline."""
    ring: Ring
    if table.has("outline"):
        ring = table.points("outline")
        if len(ring) < 3 or not shapely.Polygon(ring).is_valid:
            raise table.fault("outline", "must be three points or more around a simple shape")
    else:
        x, y = (table.value(key, length(-1e5, 1e5)) for key in ("x", "y"))
        wide, high = (table.value(key, length(0.01, 1e5)) for key in ("width", "height"))
        ring = ((x, y), (x + wide, y), (x + wide, y + high), (x, y + high))
    table.finish(known=("outline",))
    return ring


def lay_stock(options: LayoutOptions, bed: Bed, grain: str) -> LaidStock:
    """The stock that ``options`` describe, on ``bed``, of a material with the given ``grain``.

    Without a stock file these are the off-cuts and an unlimited number of sheets of the bed's size.
    Raises :class:`~miurafab.errors.LayoutError` if a sheet is larger than the bed or not larger
    than its margins, or if no rotation lays a patch along the fibres.
    """
    wanted = options.nesting
    margin = bed.margin_mm if wanted.margin_mm is None else wanted.margin_mm
    sheets = [_offcut(size, bed) for size in options.offcuts_mm]
    if wanted.stock is None:
        sheets.append(StockSheet("", bed.width_mm, bed.height_mm))
    else:
        sheets += read_stock(wanted.stock)
    fibres = [sheet.grain or wanted.grain or grain for sheet in sheets]
    if wanted.along_grain is not None and all(way == "none" for way in fibres):
        raise LayoutError(
            f"The pattern's {wanted.along_grain} axis is to lie along the grain, but neither the "
            "sheets nor the material have any; give the fibre direction, x or y, as `grain`."
        )
    kinds = []
    for sheet, way in zip(sheets, fibres, strict=True):
        if sheet.width_mm > bed.width_mm or sheet.height_mm > bed.height_mm:
            raise LayoutError(
                f"{_called(sheet)} measures {sheet.width_mm:g} mm x {sheet.height_mm:g} mm and is "
                f"larger than the bed of {bed.width_mm:g} mm x {bed.height_mm:g} mm; cut it down "
                "first."
            )
        width, height = sheet.width_mm - 2 * margin, sheet.height_mm - 2 * margin
        if min(width, height) <= 0:
            raise LayoutError(
                f"{_called(sheet)} leaves nothing within margins of {margin:g} mm; leave it out, "
                "or make the margins smaller."
            )
        defects = tuple(
            tuple((x - margin, y - margin) for x, y in ring) for ring in sheet.defects_mm
        )
        turns = _turns(wanted.rotations, way, wanted.along_grain or "x")
        kinds.append(SheetKind(width, height, turns, sheet.quantity, defects))

    def rank(k: int) -> tuple[bool, float]:
        return kinds[k].quantity is None, kinds[k].width * kinds[k].height

    return LaidStock(
        tuple(sheets),
        tuple(fibres),
        Stock(tuple(kinds), options.gap_mm),
        max(range(len(kinds)), key=rank),
        margin,
    )


def _turns(allowed: tuple[int, ...], fibres: str, axis: str) -> tuple[int, ...]:
    """The rotations that lay the pattern's ``axis`` along the fibres."""
    if fibres == "none":
        return allowed
    along = 0 if fibres == axis else 90
    turns = tuple(turn for turn in allowed if turn % 180 == along)
    if not turns:
        given = ", ".join(str(turn) for turn in allowed)
        raise LayoutError(
            f"None of the rotations {given} lays the pattern's {axis} axis along fibres that run "
            f"along the bed's {fibres}; allow {along} or {along + 180} degrees."
        )
    return turns


def _offcut(size: tuple[float, float], bed: Bed) -> StockSheet:
    """The part of an off-cut that fits the bed, longer side along longer side."""
    long, short = size
    width, height = (long, short) if bed.width_mm >= bed.height_mm else (short, long)
    name = f"off-cut of {long:g} mm x {short:g} mm"
    return StockSheet(name, min(width, bed.width_mm), min(height, bed.height_mm), 1)


def _called(sheet: StockSheet) -> str:
    if not sheet.name:
        return f"The bed of {sheet.width_mm:g} mm x {sheet.height_mm:g} mm"
    return f"The sheet '{sheet.name}'"
