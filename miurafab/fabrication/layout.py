"""``layout.json``: a layout written down, and read back, so that others can rely on it.

The schema is ``miurafab-layout/1``: machine, material, sheets with placements, patches with
outlines and tabs in the patch frame, and totals. Lengths are mm,
rotations degrees, counter-clockwise; lists of points are [[x, y], ...] and closed curves do not
repeat their first point. Toolpaths are not in it: they are in the drawings and the G-code.
"""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import numpy as np

from miurafab.errors import LayoutError
from miurafab.fabrication.borders import OpenBorder
from miurafab.fabrication.partition.patch_frame import Patch
from miurafab.fabrication.sheets import Layout, Placement, Sheet, Totals
from miurafab.fabrication.tabs import Tab
from miurafab.findings import finding_from_json, findings_json
from miurafab.geometry.arrays import Floats

SCHEMA = "miurafab-layout/1"


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
        "totals": dataclasses.asdict(layout.totals),
        "findings": findings_json(layout.findings),
    }
    return json.dumps(document, separators=(",", ":")) + "\n"


def read_layout(text: str) -> Layout:
    """The layout written in ``text``, without toolpaths.

    Raises :class:`~miurafab.errors.LayoutError` if it is not a layout of this schema.
    """
    try:
        document = json.loads(text)
    except json.JSONDecodeError as fault:
        raise LayoutError(f"The layout is not valid JSON: {fault}.") from None
    schema = document.get("schema") if isinstance(document, dict) else None
    if schema != SCHEMA:
        raise LayoutError(f"The layout's schema is {schema!r}; this version reads '{SCHEMA}'.")
    try:
        return Layout(
            machine=str(document["machine"]),
            material=str(document["material"]),
            patches=tuple(_patch(table) for table in document["patches"]),
            sheets=tuple(_sheet(table) for table in document["sheets"]),
            totals=Totals(**document["totals"]),
            findings=tuple(map(finding_from_json, document.get("findings", ()))),
            borders=tuple(map(_border, document.get("borders", ()))),
        )
    except KeyError as fault:
        raise LayoutError(f"The layout lacks {fault}.") from None
    except (TypeError, ValueError) as fault:
        raise LayoutError(f"The layout cannot be read: {fault}.") from None


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
                "edge": tab.edge,
                "mate_edge": tab.mate_edge,
                "mate_patch": tab.mate_patch,
                "fold": tab.fold,
                "polygon_mm": tab.polygon_mm.tolist(),
            }
            for tab in patch.tabs
        ],
    }


def _patch(table: dict[str, Any]) -> Patch:
    x, y = table["origin_mm"]
    return Patch(
        id=int(table["id"]),
        label=str(table["label"]),
        faces=np.array(table["faces"], dtype=np.int64),
        outline_mm=_points(table["outline_mm"]),
        waste_mm=tuple(_points(ring) for ring in table.get("waste_mm", ())),
        origin_mm=(float(x), float(y)),
        rotation_deg=float(table["rotation_deg"]),
        tabs=tuple(
            Tab(
                number=int(tab["number"]),
                edge=int(tab["edge"]),
                mate_edge=_mate(tab.get("mate_edge", tab["edge"])),
                mate_patch=_mate(tab["mate_patch"]),
                polygon_mm=_points(tab["polygon_mm"]),
                fold=str(tab.get("fold", "flat")),
            )
            for tab in table["tabs"]
        ),
        copy=int(table.get("copy", 1)),
    )


def _sheet(table: dict[str, Any]) -> Sheet:
    return Sheet(
        name=str(table["name"]),
        width_mm=float(table["width_mm"]),
        height_mm=float(table["height_mm"]),
        placements=tuple(Placement(**placement) for placement in table["placements"]),
        back=table.get("back"),
        travel_mm=float(table.get("travel_mm", 0.0)),
        stock=str(table.get("stock", "")),
        grain=str(table.get("grain", "none")),
        defects_mm=tuple(
            tuple((float(x), float(y)) for x, y in ring) for ring in table.get("defects_mm", ())
        ),
    )


def _border(table: dict[str, Any]) -> OpenBorder:
    return OpenBorder(**{**table, "edges": tuple(map(int, table["edges"]))})


def _mate(number: object) -> int | None:
    """The number of what a tab is glued to; None on an open border."""
    if number is None or type(number) is int:
        return number
    raise ValueError(f"{number!r} is no mate of a tab")


def _points(values: list[list[float]]) -> Floats:
    points = np.array(values, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2:
        raise ValueError("a list of points is not a list of pairs")
    return points
