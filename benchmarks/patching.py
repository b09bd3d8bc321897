"""How few patches a pattern takes, and how short their seams are, before and after the search.

    python benchmarks/patching.py [fan:100000 miura:40000 fan:10000:free ...] [--picture FILE.png]

A case is a pattern of benchmarks/layout.py and its number of facets; ``free`` hides the grid, as if
the pattern came from a file that does not tell it. *Before* is the split along grid lines, or the
grown one where there is no grid; *after* is what the search for covers and the cuts made of it. The
bound is the area of the pattern over that of a bed of 590 x 390 mm, rounded up. No patch can do
without tabs of 7 mm on its seams, so no split of a large pattern comes nearer than about 1.03.

``best`` of a Miura-ori is the fewest patches of all splits by straight cuts right through (each
part cut again, along or across), found exactly: no split along its grid lines does with less unless
it has a pinwheel. Times are of the processor. The exit code is 1 if a case takes more patches than
it did when this was written.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from layout import PATTERNS

from miurafab.fabrication import patches
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import load_material

BED_MM = (590.0, 390.0)
KNOWN = {
    "fan:100000": 63,
    "fan:30000": 20,
    "fan:10000": 7,
    "miura:100000": 43,
    "miura:63000": 29,
    "miura:40000": 19,
    "miura:25000": 12,
    "miura:16000": 8,
    "miura:10000": 6,
    "fan:30000:free": 24,
    "fan:10000:free": 8,
    "miura:16000:free": 9,
}


def pattern_of_case(case: str) -> CreasePattern:
    name, facets, *free = case.split(":")
    columns = round(math.sqrt(1.6 * int(facets)))
    pattern = PATTERNS[name](columns, round(int(facets) / columns))
    if not free:
        return pattern
    return CreasePattern(
        pattern.vertices_coords,
        pattern.edges_vertices,
        pattern.edges_assignment,
        pattern.edges_fold_angle,
        pattern.faces_vertices,
    )


def measure(case: str) -> tuple[dict[str, Any], CreasePattern, np.ndarray]:
    """Patches, seams in m and seconds before and after, and the split."""
    pattern = pattern_of_case(case)
    seen: dict[str, Any] = {}
    improved = patches.improved

    def watched(
        pattern: CreasePattern, patch: np.ndarray, *rest: Any, straight: bool
    ) -> np.ndarray:
        seen["before"], seen["search"] = patch, time.process_time()
        found = improved(pattern, patch, *rest, straight=straight)
        seen["search"] = time.process_time() - seen["search"]
        return found

    patches.improved = watched
    try:
        started = time.process_time()
        patch = patches.split(pattern, *BED_MM, load_material("card-250"))
        seconds = time.process_time() - started
    finally:
        patches.improved = improved
    corners = pattern.vertices_coords[pattern.faces_vertices]
    x, y = corners[..., 0], corners[..., 1]
    area = abs((x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1)).sum()) / 2
    row = {
        "case": case,
        "bound": math.ceil(area / (BED_MM[0] * BED_MM[1])),
        "before": int(seen["before"].max()) + 1,
        "before_m": seam_m(pattern, seen["before"]),
        "after": int(patch.max()) + 1,
        "after_m": seam_m(pattern, patch),
        "seconds": seconds,
        "search": seen["search"],
        "best": straight_cuts(pattern) if case.startswith("miura") else None,
    }
    return row, pattern, patch


def seam_m(pattern: CreasePattern, patch: np.ndarray) -> float:
    pair = pattern.edges_faces
    seam = (pair >= 0).all(axis=1) & (patch[pair[:, 0]] != patch[pair[:, 1]])
    ends = pattern.vertices_coords[pattern.edges_vertices[seam]]
    return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()) / 1000


def straight_cuts(pattern: CreasePattern) -> int:
    """The fewest patches of a regular Miura-ori if every cut goes right through a part.

    A patch of c x r facets measures c times the first side, and the zig-zag and the tab beyond it,
    by r times the row height and the tab; at the far border there is no tab, which is granted to
    all patches by taking one row and one column from the whole.
    """
    points = pattern.vertices_coords
    columns = int(np.flatnonzero(np.diff(points[:, 0]) < 0)[0])
    rows = len(points) // (columns + 1) - 1
    side, lean = points[1, 0] - points[0, 0], points[columns + 1, 0] - points[0, 0]
    height = points[columns + 1, 1]
    tab = 7.0 / math.sin(math.atan2(height, lean)) - 0.31
    most = [
        (int((w - lean - tab) / side), int((h - 7.0) / height)) for w, h in (BED_MM, BED_MM[::-1])
    ]
    fewest = np.full((columns, rows), np.iinfo(np.int64).max // 4)
    for c in range(1, columns):
        for r in range(1, rows):
            if any(c <= wide and r <= high for wide, high in most):
                fewest[c, r] = 1
                continue
            if c > 1:
                across = fewest[1 : c // 2 + 1, r] + fewest[c - 1 : c - c // 2 - 1 : -1, r]
                fewest[c, r] = across.min()
            if r > 1:
                along = fewest[c, 1 : r // 2 + 1] + fewest[c, r - 1 : r - r // 2 - 1 : -1]
                fewest[c, r] = min(fewest[c, r], along.min())
    return int(fewest[columns - 1, rows - 1])


def draw(pattern: CreasePattern, patch: np.ndarray, file: Path) -> None:
    """The flat pattern with its patches coloured, as a PNG."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.collections import LineCollection, PolyCollection

    figure, axes = plt.subplots(figsize=(16, 11))
    colours = plt.get_cmap("tab20")(patch * 7 % 20)
    corners = pattern.vertices_coords[pattern.faces_vertices]
    axes.add_collection(PolyCollection(corners, facecolors=colours, antialiased=False))
    pair = pattern.edges_faces
    seam = (pair >= 0).all(axis=1) & (patch[pair[:, 0]] != patch[pair[:, 1]])
    ends = pattern.vertices_coords[pattern.edges_vertices[seam]]
    axes.add_collection(LineCollection(ends, colors="black", linewidths=0.8))
    for number in range(int(patch.max()) + 1):
        axes.text(*corners[patch == number].mean(axis=(0, 1)), f"P{number + 1}", ha="center")
    axes.autoscale()
    axes.set_aspect("equal")
    axes.axis("off")
    figure.tight_layout()
    figure.savefig(file, dpi=80)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", nargs="*", default=list(KNOWN), metavar="PATTERN:FACETS[:free]")
    parser.add_argument("--picture", type=Path, help="draw the last case")
    options = parser.parse_args()
    print("case               bound  before   seams m  after   seams m  ratio  best   s (search)")
    worse = []
    for case in options.cases:
        row, pattern, patch = measure(case)
        best = "" if row["best"] is None else row["best"]
        print(
            f"{case:18s}{row['bound']:6d}{row['before']:8d}{row['before_m']:10.2f}"
            f"{row['after']:7d}{row['after_m']:10.2f}{row['after'] / row['bound']:7.3f}{best!s:>6s}"
            f"{row['seconds']:6.1f} ({row['search']:.1f})",
            flush=True,
        )
        if row["after"] > KNOWN.get(case, row["after"]):
            worse.append(case)
    if options.picture:
        draw(pattern, patch, options.picture)
    if worse:
        print(f"more patches than before: {', '.join(worse)}", file=sys.stderr)
    return 1 if worse else 0


if __name__ == "__main__":
    sys.exit(main())
