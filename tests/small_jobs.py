"""Small jobs for the tests of the preview: a sheet with known lengths, and a folder like a job."""

import hashlib
import json
from pathlib import Path

import numpy as np
from sealing import seal

import miurafab
from miurafab.fabrication.toolpath import Toolpath
from miurafab.posting import post
from miurafab.profiles import OPERATIONS, load_machine, load_material

LASER = load_machine("grbl-laser-400")
CARD = load_material("card-250")
# Lengths 5, 30, 40 and 100 mm; from the origin to each start, and back.
KNOWN = {
    "engrave": [(3.0, 4.0), (6.0, 8.0)],
    "score": [(20.0, 50.0), (50.0, 50.0)],
    "perforate": [(60.0, 50.0), (60.0, 90.0)],
    "cut": [(100.0, 100.0), (130.0, 100.0), (130.0, 140.0), (100.0, 140.0)],
}


def known_toolpath(sheet="sheet-01"):
    """One stroke an operation, as in :data:`KNOWN`."""
    lines = [KNOWN[name] for name in OPERATIONS]
    return Toolpath(
        sheet=sheet,
        width_mm=380.0,
        height_mm=300.0,
        points=np.array([point for line in lines for point in line]),
        offsets=np.cumsum([0, *map(len, lines)]),
        operation=np.arange(4),
        patch=np.zeros(4, dtype=np.int64),
        edge=np.full(4, -1),
    )


def dashes(count, seed=3):
    """``count`` random short perforation dashes, row by row up and down the bed."""
    random = np.random.default_rng(seed)
    place = np.arange(count)
    row, column = place // 380, place % 380
    column = np.where(row % 2 == 1, 379 - column, column)
    start = np.stack([column + 5.0, 5.0 + row * (390 * 380 / max(count, 390 * 380))], axis=1)
    points = np.stack([start, start + random.uniform(0.01, 0.6, start.shape)], axis=1)
    return Toolpath(
        sheet="sheet-01",
        width_mm=400.0,
        height_mm=400.0,
        points=points.reshape(-1, 2),
        offsets=np.arange(0, 2 * count + 1, 2),
        operation=np.full(count, OPERATIONS.index("perforate")),
        patch=np.zeros(count, dtype=np.int64),
        edge=np.zeros(count, dtype=np.int64),
    )


def write_nc(folder: Path, toolpath: Toolpath) -> Path:
    path = folder / f"{toolpath.sheet}.nc"
    path.write_text(post(toolpath, LASER, CARD).text, newline="\n")
    return path


def write_folder(folder: Path, pattern=None, names=("sheet-01", "sheet-02")) -> Path:
    """A job directory with the known sheet under each of ``names``."""
    folder.mkdir(exist_ok=True)
    digest = "0" * 64
    if pattern is not None:
        pattern.save(folder / "shape.fold")
        digest = hashlib.sha256((folder / "shape.fold").read_bytes()).hexdigest()
    for name in names:
        write_nc(folder, known_toolpath(name))
    layout = {
        "schema": "miurafab-layout/1",
        "pattern": {"file": "shape.fold", "sha256": digest},
        "machine": "grbl-laser-400",
        "material": "card-250",
        "sheets": [
            {"name": name, "width_mm": 380.0, "height_mm": 300.0, "placements": []}
            for name in names
        ],
    }
    (folder / "layout.json").write_text(json.dumps(layout))
    seal(folder)
    return folder


def write_job(folder: Path, count: int, pattern=None) -> Path:
    """A job directory with ``count`` sheets, all alike, of ``pattern`` or of a small saddle."""
    if pattern is None:
        pattern = miurafab.fit("hypar", facets="4x4", size="60mm")
    miurafab.sheets(pattern).write(folder)
    layout = json.loads((folder / "layout.json").read_text())
    (first,) = layout["sheets"]
    for n in range(2, count + 1):
        layout["sheets"].append({**first, "name": f"sheet-0{n}", "placements": []})
        (folder / f"sheet-0{n}.nc").write_bytes((folder / "sheet-01.nc").read_bytes())
    (folder / "layout.json").write_text(json.dumps(layout))
    seal(folder)
    return folder
