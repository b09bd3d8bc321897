"""What a user may ask of a layout beyond machine and material, as one value.

The same options stand in the ``[layout]`` table of a design file and on the command line; either
way they come through :func:`read_options`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

from miurafab.errors import InputError
from miurafab.fabrication.nesting import ENGINES, RASTER
from miurafab.profiles import GRAINS, Table
from miurafab.units import parse_length

TAB_SIDES = ("lower", "upper", "alternate")


@dataclass(frozen=True)
class NestingOptions:
    """What patches are nested on, and by what.

    ``quantity`` is how many of the whole model are made. ``stock`` is a file that tells the sheets
    (:mod:`~miurafab.fabrication.stock`), None for as many as it takes, as large as the bed;
    ``margin_mm`` stands in for the machine's. ``grain`` is which way fibres run in sheets that do
    not tell, None for the material's, and ``along_grain`` the axis (x if None) of the pattern laid
    along them. ``rotations`` are the degrees by which a patch may be turned on its sheet.

    ``engine`` is one of :data:`~miurafab.fabrication.nesting.run.ENGINES`; it has ``seconds`` of
    time, and draws its lots, if any, from ``seed``.
    """

    quantity: int = 1
    stock: Path | None = None
    margin_mm: float | None = None
    grain: str | None = None
    along_grain: str | None = None
    rotations: tuple[int, ...] = (0, 90, 180, 270)
    engine: str = RASTER
    seconds: float = 30.0
    seed: int = 0


@dataclass(frozen=True)
class LayoutOptions:
    """How a pattern is laid out.

    ``gap_mm`` is kept between patches on a sheet. ``offcuts_mm`` (longer, shorter side) are left
    over from other jobs and used up before whole sheets. ``max_patch_mm`` (longer, shorter side)
    limits patches more than the bed does. ``seam_rows`` and ``seam_columns`` are lines of the
    vertex grid along which the pattern is cut in any case, from 1. ``open_row`` and ``open_column``
    are the lines along which a closed ring is opened, None for those where it is open already; the
    other lines are counted from there.

    ``tab_height_mm``, ``tab_inset_mm`` and ``tab_angle`` (rad, the largest inner angle at the base)
    stand in for the material's. ``tab_side`` says which
    patch of a seam bears its tabs: the one with the ``lower`` or the ``upper`` number, or both in
    turn, edge by edge (``alternate``). With ``full_facet`` a tab is the whole facet that it is
    glued to, less the inset.

    ``two_sided`` has valleys that are scored made from the back of the sheet. ``bridges`` is the
    number of places, ``bridge_mm`` long, in which each outline is left whole so that nothing
    falls out; ``spread_heat`` has patches next to each other cut far apart in time.
    ``nesting`` is how patches are laid on sheets.
    """

    gap_mm: float = 2.0
    offcuts_mm: tuple[tuple[float, float], ...] = ()
    max_patch_mm: tuple[float, float] | None = None
    seam_rows: tuple[int, ...] = ()
    seam_columns: tuple[int, ...] = ()
    open_row: int | None = None
    open_column: int | None = None
    tab_height_mm: float | None = None
    tab_inset_mm: float | None = None
    tab_angle: float | None = None
    tab_side: str = "lower"
    full_facet: bool = False
    two_sided: bool = False
    bridges: int = 0
    bridge_mm: float = 0.5
    spread_heat: bool = False
    nesting: NestingOptions = field(default_factory=NestingOptions)


def read_options(table: Table, folder: Path = Path()) -> LayoutOptions:
    """The options in ``table``; its other keys are left to the caller, who finishes it. Files that
    it names are looked for from ``folder`` on.

    Raises the error of the table, naming the key.
    """
    usual = LayoutOptions()

    def length_or_none(key: str, low: float) -> float | None:
        return table.length(key, low=low, high=100) if table.has(key) else None

    def line_or_none(key: str) -> int | None:
        return table.whole(key, low=1, high=10**6) if table.has(key) else None

    bridges = table.whole("bridges", usual.bridges, low=0, high=12)
    if bridges == 1:
        raise table.fault("bridges", "is 1, on which a piece would swing; use 0, or 2 and more")
    if table.has("bridge") and not bridges:
        raise table.fault("bridge", "is the length of holding bridges, but none are wanted; give "
                          "the number of 'bridges' as well")  # fmt: skip
    return LayoutOptions(
        gap_mm=table.length("gap", usual.gap_mm, low=0, high=100),
        offcuts_mm=_sizes(table, "offcuts"),
        max_patch_mm=_size(table, "max_patch"),
        seam_rows=_lines(table, "seam_rows"),
        seam_columns=_lines(table, "seam_columns"),
        open_row=line_or_none("open_row"),
        open_column=line_or_none("open_column"),
        tab_height_mm=length_or_none("tab_height", 0.5),
        tab_inset_mm=length_or_none("tab_inset", 0.0),
        tab_angle=table.angle("tab_angle", 0.0, low=0.1, high=math.pi)
        if table.has("tab_angle")
        else None,
        tab_side=table.choice("tab_side", TAB_SIDES, usual.tab_side),
        full_facet=table.flag("full_facet", usual.full_facet),
        two_sided=table.flag("two_sided", usual.two_sided),
        bridges=bridges,
        bridge_mm=table.length("bridge", usual.bridge_mm, low=0.1, high=20),
        spread_heat=table.flag("spread_heat", usual.spread_heat),
        nesting=_nesting(table, folder),
    )


def _nesting(table: Table, folder: Path) -> NestingOptions:
    usual = NestingOptions()
    margin = table.length("margin", low=0, high=100) if table.has("margin") else None
    return NestingOptions(
        quantity=table.whole("quantity", usual.quantity, low=1, high=1000),
        stock=folder / table.text("stock") if table.has("stock") else None,
        margin_mm=margin,
        grain=table.choice("grain", GRAINS) if table.has("grain") else None,
        along_grain=table.choice("along_grain", ("x", "y")) if table.has("along_grain") else None,
        rotations=_rotations(table, usual.rotations),
        engine=table.choice("engine", ENGINES, usual.engine),
        seconds=table.number("nesting_time", usual.seconds, low=1, high=86_400),
        seed=table.whole("nesting_seed", usual.seed, low=0, high=2**31 - 1),
    )


def _rotations(table: Table, usual: tuple[int, ...]) -> tuple[int, ...]:
    if not table.has("rotations"):
        return usual
    text = table.scalar("rotations")
    parts = [part.strip() for part in text.split(",")]
    if not all(part.isdigit() and int(part) < 360 for part in parts):
        raise table.fault(
            "rotations", f"is '{text}'; write whole degrees from 0 to 359, such as '0,180'"
        )
    return tuple(sorted({int(part) for part in parts}))


def _size(table: Table, key: str) -> tuple[float, float] | None:
    if not table.has(key):
        return None
    return _sides(table, key, table.text(key))


def _sizes(table: Table, key: str) -> tuple[tuple[float, float], ...]:
    if not table.has(key):
        return ()
    return tuple(_sides(table, key, part) for part in table.text(key).split(","))


def _sides(table: Table, key: str, text: str) -> tuple[float, float]:
    sides = text.lower().replace("×", "x").split("x")
    try:
        one, other = (parse_length(side.strip()) for side in sides)
    except (ValueError, InputError):
        raise table.fault(key, f"is '{text}'; write two lengths such as '300mm x 200mm'") from None
    if min(one, other) <= 0:
        raise table.fault(key, f"is '{text}'; both sides must be longer than 0")
    return max(one, other), min(one, other)


def _lines(table: Table, key: str) -> tuple[int, ...]:
    if not table.has(key):
        return ()
    text = table.scalar(key)
    parts = text.split(",")
    if not all(part.strip().isdigit() and int(part) > 0 for part in parts):
        raise table.fault(key, f"is '{text}'; write line numbers from 1 up, such as '10,20'")
    return tuple(sorted({int(part) for part in parts}))
