"""What the plan of the sheets gains, and what it costs: twelve jobs before and after.

    python benchmarks/planning.py [band strip hypar600 ...] [--largest]

Before is the split into the fewest patches, nested; after is the plan
(:mod:`miurafab.fabrication.plan`). The bound is that of the area of the patches. ``smallest`` is
the area of the smallest patch over their mean. Times are processor times of split, tabs and
nesting. ``miura100k`` takes as long as the rest and is done where it is named. With --largest, the
largest size of each job on one sheet is given.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from layout import fan, miura, pattern_of

import miurafab as mf
from miurafab.fabrication.nesting import Problem, nest
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.patch_frame import framed_patches, sheet_space
from miurafab.fabrication.partition.patch_outline import outline_patches
from miurafab.fabrication.plan import plan_patches
from miurafab.fabrication.plan_size import Sizing
from miurafab.fabrication.sheets import worked
from miurafab.fabrication.stock import lay_stock
from miurafab.geometry.polygons import edge_lengths, signed_areas
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import load_machine, load_material, shipped_directory

LARGE = (600.0, 400.0)
"""The bed of the fan and the Miura-ori, mm; the others lie on that of grbl-laser-400."""


def strip() -> CreasePattern:
    """400 x 1 squares of 25 mm."""
    i, j = np.indices((2, 401))
    return pattern_of(np.stack([25.0 * j, 25.0 * i], axis=-1))


def fitted(target: str, **options: object) -> Callable[[], CreasePattern]:
    return lambda: mf.fit(target, **options).pattern


JOBS: dict[str, Callable[[], CreasePattern]] = {
    "band": fitted("plane", width=20, depth=1, facets=(120, 6), size=1800),
    "strip": strip,
    "hypar600": fitted("hypar", facets=(40, 40), size=600),
    "hypar600-off": fitted("hypar", facets=(40, 40), size=600, polish="off"),
    "fan10k": lambda: fan(126, 79),
    "miura10k": lambda: miura(126, 79),
    "miura100k": lambda: miura(400, 250),
}
JOBS |= {
    file.stem: fitted(str(file)) for file in sorted(shipped_directory("patterns").glob("*.toml"))
}
LEFT_OUT = ("miura100k",)
"""Jobs that are done only where they are named."""


def measure(name: str, largest: bool) -> str:
    pattern = JOBS[name]()
    machine, material, options = load_machine("grbl-laser-400"), load_material("card-250"), None
    if name in ("fan10k", "miura10k", "miura100k"):
        width, height = LARGE
        bed = replace(machine.bed, width_mm=width, height_mm=height, margin_mm=5.0)
        machine = replace(machine, bed=bed)
    options = LayoutOptions()
    card = worked(material, machine, options)
    stock = lay_stock(options, machine.bed, card.grain)
    space = sheet_space(stock)

    started = time.process_time()
    turns = space.turns
    outlined = outline_patches(pattern, space.width, space.height, card, options, turns=turns)
    patches = framed_patches(pattern, outlined, space).patches
    outlines = tuple(patch.outline_mm for patch in patches)
    before = nest(Problem(outlines, tuple(patch.label for patch in patches), stock.kinds))
    first = time.process_time() - started
    started = time.process_time()
    plan = plan_patches(pattern, stock, card, options)
    second = time.process_time() - started
    after = plan.framed.outlined.face_patch
    cells = [
        name,
        f"{len(pattern.faces_vertices):,}",
        f"{before.sheets}, {plan.nesting.sheets}",
        str(plan.nesting.bound),
        f"{glue(pattern, outlined.face_patch):.0f}, {glue(pattern, after):.0f}",
        f"{smallest(pattern, outlined.face_patch):.2f}, {smallest(pattern, after):.2f}",
        f"{first:.1f}, {second:.1f}",
    ]
    if largest:
        scale = Sizing(pattern, machine, material, options).largest_scale()
        folded = pattern.folded_coords
        points = pattern.vertices_coords if folded is None else folded
        cells.append(f"{math.floor(scale * np.ptp(points, axis=0).max())} mm")
    return f"| {' | '.join(cells)} |"


def glue(pattern: CreasePattern, patch: np.ndarray) -> float:
    """The length of the seams between patches, mm."""
    pair = pattern.edges_faces
    seam = (pair >= 0).all(axis=1) & (patch[pair[:, 0]] != patch[pair[:, 1]])
    return float(edge_lengths(pattern.vertices_coords, pattern.edges_vertices[seam]).sum())


def smallest(pattern: CreasePattern, patch: np.ndarray) -> float:
    corners = pattern.faces_vertices
    points = pattern.vertices_coords[np.where(corners >= 0, corners, corners[:, :1])]
    areas = np.bincount(patch, np.abs(signed_areas(points)))
    return float(areas.min() / areas.mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("jobs", nargs="*", metavar="JOB", help=", ".join(JOBS))
    parser.add_argument("--largest", action="store_true", help="the largest size on one sheet")
    asked = parser.parse_args()
    head = ["job", "facets", "sheets", "bound", "glue mm", "smallest", "seconds"]
    head += ["one sheet"] if asked.largest else []
    print(f"| {' | '.join(head)} |\n|{' --- |' * len(head)}", flush=True)
    for name in asked.jobs or [name for name in JOBS if name not in LEFT_OUT]:
        print(measure(name, asked.largest), flush=True)


if __name__ == "__main__":
    main()
