"""How few patches a pattern takes, and how short their seams are, before and after the search.

    python benchmarks/patching.py [fan:100000 miura:40000 ...] [--best] [--picture FILE.png]

A case is a pattern of benchmarks/layout.py and its number of facets; ``free`` hides the grid, as if
the pattern came from a file that does not tell it. *Before* is the split along grid lines, or the
grown one where there is no grid; *after* is what the search for covers and the cuts made of it. The
bound is the area of the pattern over that of a bed of 590 x 390 mm, rounded up. No patch can do
without tabs of 7 mm on its seams, so no split of a large pattern comes nearer than about 1.03.

With ``--best`` the fewest patches of all splits by straight cuts right through (each part cut
again, along or across) are found exactly, in some minutes: no split along grid lines does with less
unless it has a pinwheel. Times are of the processor. The exit code is 1 if a case takes more
patches than it did when this was written.
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

from miurafab.fabrication.partition import split as patches
from miurafab.fabrication.partition.fit_box import best_turn
from miurafab.fabrication.seams import inner_seams
from miurafab.fabrication.tabs import tab_regions
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
    }
    return row, pattern, patch


def seam_m(pattern: CreasePattern, patch: np.ndarray) -> float:
    pair = pattern.edges_faces
    seam = (pair >= 0).all(axis=1) & (patch[pair[:, 0]] != patch[pair[:, 1]])
    ends = pattern.vertices_coords[pattern.edges_vertices[seam]]
    return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()) / 1000


def straight_cuts(pattern: CreasePattern) -> int:
    """The fewest patches of a fan or a Miura-ori if every cut goes right through a part.

    Both are the same everywhere along their rows, so a part is known by its first row, its number
    of rows h and of columns n, and by whether it ends at the right border, where no tabs stand:

        fewest(part) = 1 if it fits, else the least sum over its cuts in two, along or across.
    """
    columns, rows = (lines - 1 for lines in pattern.grid)
    inner, border = _largest(pattern, rows, columns)
    fewest = np.full((2, rows + 1, rows + 1, columns + 1), 255, dtype=np.uint8)
    n = np.arange(columns + 1)
    for h in range(1, rows + 1):
        starts = rows - h + 1
        for at_border, largest in enumerate((inner, border)):
            here = fewest[at_border, h, :starts]
            here[(n > 0) & (n <= largest[h, :starts, None])] = 1
            for k in range(1, h):
                low, high = fewest[at_border, k, :starts], fewest[at_border, h - k, k : starts + k]
                np.minimum(here, _sum(low, high), out=here)
            left = fewest[0, h, :starts]
            for c in range(2, columns + 1):
                pairs = _sum(left[:, 1:c], here[:, c - 1 : 0 : -1])
                np.minimum(here[:, c], pairs.min(axis=1), out=here[:, c])
    return int(fewest[1, rows, 0, columns])


def _sum(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Their sum, 255 being as good as infinite."""
    return np.minimum(one, 127) + np.minimum(other, 127)


def _largest(pattern: CreasePattern, rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """(R + 1, R) the most columns of a patch of h rows from each row on that fits the bed, with
    tabs on its right and its upper side; and the same without tabs on the right.
    """
    edges = np.flatnonzero((pattern.edges_faces >= 0).all(axis=1))
    face = pattern.edges_faces[edges]
    seams = inner_seams(pattern, edges, face.argmax(axis=1))
    tabs = tab_regions(pattern, seams, load_material("card-250"), full_facet=False)
    filled = np.where(tabs.present[..., None], tabs.points, tabs.points[:, :1])
    to_right = tabs.mate_face == tabs.own_face + 1
    right, upper = np.full((2, rows * columns), -1)
    right[tabs.own_face[to_right]] = np.flatnonzero(to_right)
    upper[tabs.own_face[~to_right]] = np.flatnonzero(~to_right)
    right, upper = right.reshape(rows, columns), upper.reshape(rows, columns)
    points = pattern.vertices_coords.reshape(rows + 1, columns + 1, 2)

    def fits(r: int, h: int, n: int, *, at_border: bool) -> bool:
        ends = [points[r, : n + 1], points[r + h, : n + 1]]
        ends += [points[r : r + h + 1, 0], points[r : r + h + 1, n]]
        standing = [upper[r + h - 1, :n]] if r + h < rows else []
        standing += [] if at_border else [right[r : r + h, n - 1]]
        ends += [filled[tab].reshape(-1, 2) for tab in standing]
        return best_turn(np.concatenate(ends), *BED_MM) is not None

    found = np.zeros((2, rows + 1, rows), dtype=np.int64)
    for at_border in (False, True):
        for h in range(1, rows + 1):
            for r in range(rows - h + 1):
                # What is most changes little from one row to the next.
                n = int(found[int(at_border), h, r - 1]) if r else columns // 2
                while n < columns - 1 and fits(r, h, n + 1, at_border=at_border):
                    n += 1
                while n > 0 and not fits(r, h, n, at_border=at_border):
                    n -= 1
                found[int(at_border), h, r] = n
            if not found[int(at_border), h].any():
                break
    return found[0], found[1]


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
    parser.add_argument("--best", action="store_true", help="find the fewest by straight cuts")
    options = parser.parse_args()
    print("case               bound  before   seams m  after   seams m  ratio  best   s (search)")
    worse = []
    for case in options.cases:
        row, pattern, patch = measure(case)
        best = str(straight_cuts(pattern)) if options.best and pattern.grid else ""
        print(
            f"{case:18s}{row['bound']:6d}{row['before']:8d}{row['before_m']:10.2f}"
            f"{row['after']:7d}{row['after_m']:10.2f}{row['after'] / row['bound']:7.3f}{best:>6s}"
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
