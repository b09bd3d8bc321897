"""The number of sheets that the nesting takes, and how well it fills them.

    python benchmarks/nesting.py [--json FILE]

Zig-zag patches of many sizes, with a rim of 3 mm for tabs, on beds of 600 x 400 mm, 2 mm apart, at
quarter turns: 40 patches with an area of 3.85 beds, and 200 small patches with 5.02. `reach` counts
the least filled sheet by the share of it that its patches reach into; `filled` is the area of the
patches over the area of the sheets. Seconds are of the processor.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from miurafab.fabrication.nesting import Nesting, Problem, SheetKind, Stock, nest, place

BED = SheetKind(600.0, 400.0, (0, 90, 180, 270))
GAP = 2.0
CASES = {"40 zig-zag patches": (40, 3.85), "200 small patches": (200, 5.02)}


def patches(count: int, beds: float) -> tuple[np.ndarray, ...]:
    """Outlines (n, 2) of ``count`` zig-zag patches as large together as so many beds."""
    rng = np.random.default_rng(0)
    outlines = []
    for _ in range(count):
        columns, rows = (int(n) for n in rng.integers(4, 11, 2))
        side, sector = rng.uniform(13, 19), rng.uniform(0.6, 1.2)
        across = np.arange(columns + 1)
        x = side * (across + 0.15 * across**2 / columns)
        up = np.arange(rows + 1)
        lean = side * np.cos(sector) * (up % 2)
        y = up * side * np.sin(sector)
        corners = np.concatenate(
            [
                np.column_stack([x, np.zeros(columns + 1)]),
                np.column_stack([x[-1] + lean, y])[1:],
                np.column_stack([x + lean[-1], np.full(columns + 1, y[-1])])[-2::-1],
                np.column_stack([lean, y])[-2:0:-1],
            ]
        )
        rim = shapely.Polygon(corners).buffer(3.0, join_style="mitre")
        outlines.append(shapely.get_coordinates(rim.exterior)[:-1])
    area = sum(shapely.Polygon(outline).area for outline in outlines)
    scale = np.sqrt(beds * BED.width * BED.height / area)
    return tuple(outline * scale for outline in outlines)


def measure(case: str) -> dict[str, Any]:
    """The sheets and the time of one case."""
    outlines = patches(*CASES[case])
    names = tuple(f"P{number + 1}" for number in range(len(outlines)))
    problem = Problem(outlines, names, Stock((BED,), GAP))
    started = time.process_time()
    nesting = nest(problem)
    seconds = time.process_time() - started
    area = sum(shapely.Polygon(outline).area for outline in outlines)
    return {
        "case": case,
        "seconds": seconds,
        "sheets": nesting.sheets,
        "bound": nesting.bound,
        "reach": reach(problem, nesting),
        "filled": area / (nesting.sheets * BED.width * BED.height),
        "finished": nesting.finished,
    }


def reach(problem: Problem, nesting: Nesting) -> float:
    """The number of sheets; the least filled counts by the share that its patches reach into."""
    boxes: dict[int, list[np.ndarray]] = {}
    for outline, slot in zip(problem.outlines, nesting.slots, strict=True):
        boxes.setdefault(slot.sheet, []).append(place(outline, slot))
    size = np.array([BED.width, BED.height])
    shares = [float((np.ptp(np.concatenate(b), axis=0) / size).min()) for b in boxes.values()]
    return nesting.sheets - 1 + min(shares)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = []
    for case in CASES:
        rows.append(row := measure(case))
        print(
            f"{case:20s}{row['seconds']:6.1f} s {row['sheets']:3d} sheets (bound {row['bound']}, "
            f"reach {row['reach']:.2f}), {row['filled']:.1%} filled",
            "" if row["finished"] else "work limit reached",
            flush=True,
        )
    if options.json:
        options.json.write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
