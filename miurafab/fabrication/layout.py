"""``layout.json``: a layout written down, and read back, so that others can rely on it.

The schema is ``miurafab-layout/1``: machine, material, sheets with placements, patches with
outlines and tabs in the patch frame, the folder's kit (rows in the order of creasing, wedges of the
gauge; angles in degrees), and totals. Lengths are mm,
rotations degrees, counter-clockwise; lists of points are [[x, y], ...] and closed curves do not
repeat their first point. Toolpaths are not in it: they are in the drawings and the G-code.
"""

from __future__ import annotations

import dataclasses
import json
import math
import reprlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from miurafab.errors import LayoutError, is_plain
from miurafab.fabrication.borders import OpenBorder
from miurafab.fabrication.kit.plan import kit_table, read_kit
from miurafab.fabrication.labels import AbsentLabel
from miurafab.fabrication.partition.patch_frame import Patch
from miurafab.fabrication.plan import Alternative
from miurafab.fabrication.sheets import Layout, Placement, Sheet, Totals
from miurafab.fabrication.slots import TabSlot
from miurafab.fabrication.tabs import Tab
from miurafab.files import Reading, file_name, parse_json
from miurafab.findings import finding_from_json, findings_json
from miurafab.geometry.arrays import Floats

SCHEMA = "miurafab-layout/1"
LARGEST_MM = 1e5
"""No sheet is longer."""


def write_layout(layout: Layout, pattern_file: str, pattern_sha256: str) -> str:
    """The text of ``layout.json``; ``pattern_file`` and its SHA-256 tell which pattern it is of."""
    document = {
        "schema": SCHEMA,
        "pattern": {"file": pattern_file, "sha256": pattern_sha256},
        "machine": layout.machine,
        "material": layout.material,
        "sheets": [dataclasses.asdict(sheet) for sheet in layout.sheets],
        "patches": [_patch_table(patch) for patch in layout.patches],
        "borders": [dataclasses.asdict(border) for border in layout.borders],
        "absent_labels": [dataclasses.asdict(label) for label in layout.absent],
        **({} if layout.kit is None else {"kit": kit_table(layout.kit)}),
        "totals": dataclasses.asdict(layout.totals),
        "alternatives": [dataclasses.asdict(each) for each in layout.alternatives],
        "findings": findings_json(layout.findings),
    }
    return json.dumps(document, separators=(",", ":")) + "\n"


@dataclass(frozen=True)
class LayoutHead:
    """What a layout says of the whole job: the names of its machine and material, the file of its
    pattern with its SHA-256, and the sheets. ``is_whole`` tells that patches are in it, too.
    """

    machine: str
    material: str
    pattern_file: str
    pattern_sha256: str
    sheets: tuple[Sheet, ...]
    is_whole: bool


def read_head(text: str, where: object = "The layout") -> LayoutHead:
    """The head of the layout written in ``text``; ``where`` is how messages call it.

    Raises :class:`~miurafab.errors.LayoutError` if it is not a layout of this schema.
    """
    with _reading(where):
        return _head(_document(text, where), str(where))


def read_layout(text: str, where: object = "The layout") -> Layout:
    """The layout written in ``text``, without toolpaths; ``where`` is how messages call it.

    Raises :class:`~miurafab.errors.LayoutError` if it is not a layout of this schema.
    """
    with _reading(where):
        document = _document(text, where)
        head = _head(document, str(where))
        return Layout(
            machine=head.machine,
            material=head.material,
            patches=tuple(_patch(table) for table in document["patches"]),
            sheets=head.sheets,
            totals=_totals(document["totals"]),
            findings=tuple(map(finding_from_json, document.get("findings", ()))),
            borders=tuple(map(_border, document.get("borders", ()))),
            absent=tuple(map(_absent, document.get("absent_labels", ()))),
            kit=read_kit(document["kit"]) if "kit" in document else None,
            alternatives=tuple(map(_alternative, document.get("alternatives", ()))),
        )


def _reading(where: object) -> Reading:
    return Reading(where, "a layout that 'miurafab sheets' wrote", LayoutError)


def _document(text: str, where: object) -> dict[str, Any]:
    document = parse_json(text)
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        schema = document.get("schema") if isinstance(document, dict) else None
        raise LayoutError(
            f"{where} is not a layout of this version: its schema is {reprlib.repr(schema)}, and "
            f"this version reads '{SCHEMA}'."
        )
    return document


def _head(document: dict[str, Any], where: str) -> LayoutHead:
    machine, material = (file_name(document[key], where) for key in ("machine", "material"))
    sheets = tuple(_sheet(table, where) for table in document["sheets"])
    if not sheets:
        raise ValueError("it has no sheets")
    pattern = document["pattern"]
    return LayoutHead(
        machine,
        material,
        file_name(pattern["file"], where),
        _text(pattern["sha256"]),
        sheets,
        "patches" in document,
    )


def _patch_table(patch: Patch) -> dict[str, Any]:
    return {
        "id": patch.id,
        "label": patch.label,
        "copy": patch.copy,
        "faces": patch.faces.tolist(),
        "outline_mm": patch.outline_mm.tolist(),
        "waste_mm": [ring.tolist() for ring in patch.waste_mm],
        "origin_mm": list(patch.origin_mm),
        "rotation_deg": patch.rotation_deg,
        "tabs": [
            {
                "number": tab.number,
                "label": tab.label,
                "edge": tab.edge,
                "mate_edge": tab.mate_edge,
                "mate_patch": tab.mate_patch,
                "fold": tab.fold,
                "join": tab.join,
                "polygon_mm": tab.polygon_mm.tolist(),
            }
            for tab in patch.tabs
        ],
        "slots": [
            {
                "tab": slot.tab,
                "label": slot.label,
                "edge": slot.edge,
                "mate_patch": slot.mate_patch,
                "polygon_mm": slot.polygon_mm.tolist(),
            }
            for slot in patch.slots
        ],
    }


def _patch(table: dict[str, Any]) -> Patch:
    return Patch(
        id=int(table["id"]),
        label=_text(table["label"]),
        faces=np.array(table["faces"], dtype=np.int64),
        outline_mm=_points(table["outline_mm"]),
        waste_mm=tuple(_points(ring) for ring in table.get("waste_mm", ())),
        origin_mm=_pair(table["origin_mm"]),
        rotation_deg=_number(table["rotation_deg"]),
        tabs=tuple(
            Tab(
                number=int(tab["number"]),
                label=_text(tab.get("label", str(tab["number"]))),
                edge=int(tab["edge"]),
                mate_edge=_mate(tab.get("mate_edge", tab["edge"])),
                mate_patch=_mate(tab["mate_patch"]),
                polygon_mm=_points(tab["polygon_mm"]),
                fold=_text(tab.get("fold", "flat")),
                join=_text(tab.get("join", "glue")),
            )
            for tab in table["tabs"]
        ),
        slots=tuple(map(_slot, table.get("slots", ()))),
        copy=int(table.get("copy", 1)),
    )


def _slot(table: dict[str, Any]) -> TabSlot:
    return TabSlot(
        tab=int(table["tab"]),
        label=_text(table["label"]),
        edge=int(table["edge"]),
        mate_patch=int(table["mate_patch"]),
        polygon_mm=_points(table["polygon_mm"]),
    )


def _sheet(table: dict[str, Any], where: str) -> Sheet:
    back = table.get("back")
    return Sheet(
        name=file_name(table["name"], where),
        width_mm=_length(table["width_mm"]),
        height_mm=_length(table["height_mm"]),
        placements=tuple(_placement(placement) for placement in table["placements"]),
        back=None if back is None else file_name(back, where),
        travel_mm=_number(table.get("travel_mm", 0.0)),
        stock=_text(table.get("stock", "")),
        grain=_text(table.get("grain", "none")),
        defects_mm=tuple(tuple(map(_pair, ring)) for ring in table.get("defects_mm", ())),
        card_mm=_pair(card) if (card := table.get("card_mm")) is not None else None,
    )


def _placement(table: dict[str, Any]) -> Placement:
    turn = {"rotation_deg": _number(table["rotation_deg"])} if "rotation_deg" in table else {}
    placed = {**table, "x_mm": _number(table["x_mm"]), "y_mm": _number(table["y_mm"]), **turn}
    return Placement(**{**placed, "patch": int(table["patch"])})


def _totals(table: dict[str, Any]) -> Totals:
    return Totals(**{name: value and _number(value) for name, value in table.items()})


def _border(table: dict[str, Any]) -> OpenBorder:
    return OpenBorder(**{**table, "edges": tuple(map(int, table["edges"]))})


def _absent(table: dict[str, Any]) -> AbsentLabel:
    numbers = (_number(table[key]) for key in ("x_mm", "y_mm", "rotation_deg", "height_mm"))
    return AbsentLabel(int(table["patch"]), _text(table["text"]), *numbers)


def _alternative(table: dict[str, Any]) -> Alternative:
    return Alternative(
        **{
            name: value if value in (True, False) else _number(value)
            for name, value in table.items()
        }
    )


def _text(value: object) -> str:
    if not isinstance(value, str) or not is_plain(value):
        raise ValueError(f"{value!r} is not a plain text")
    return value


def _number(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"{value!r} is not a number")
    return value


def _length(value: Any) -> float:
    if not 0 < _number(value) <= LARGEST_MM:
        raise ValueError(f"{value!r} mm is not the length of a sheet")
    return float(value)


def _pair(values: Any) -> tuple[float, float]:
    x, y = values
    return float(_number(x)), float(_number(y))


def _mate(number: object) -> int | None:
    """The number of what a tab is glued to; None on an open border."""
    if number is None or type(number) is int:
        return number
    raise ValueError(f"{number!r} is no mate of a tab")


def _points(values: list[list[float]]) -> Floats:
    points = np.array(values, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise ValueError("a list of points is not a list of pairs of numbers")
    if np.abs(points).max(initial=0.0) > LARGEST_MM:
        raise ValueError(f"a list of points holds a coordinate over {LARGEST_MM:g} mm")
    return points
