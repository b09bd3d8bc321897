"""The named surfaces at their defaults and all round: sectors, folds, distances, before and after.

    python benchmarks/surfaces.py                  every named surface at 20x20 facets
    python benchmarks/surfaces.py --round          those of revolution all round, and globes
    python benchmarks/surfaces.py --polish off     the projection of the seed alone

Each line is recomputed from the pattern that the fit returns.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import miurafab as mf
from miurafab.geometry.angles import angle_between
from miurafab.geometry.polygons import facet_normals

NAMED = (
    "plane", "cylinder", "log-spiral", "sphere", "hypar", "saddle", "paraboloid", "bump",
    "helicoid", "pill", "candlestick", "vase", "hyperboloid", "catenoid", "ellipsoid", "revolution",
)  # fmt: skip
ROUND = (
    ("ellipsoid", {"latitude": 60}, "24x48", "auto"),
    ("ellipsoid", {"latitude": 75}, "24x48", "auto"),
    *(("ellipsoid", {"latitude": 85, "height": 1.0}, "24x48", n) for n in (2, 6, 8, 12)),
    *((name, {}, "24x48", "auto") for name in
      ("pill", "candlestick", "vase", "hyperboloid", "catenoid", "revolution")),
)  # fmt: skip


def line(name: str, **options: object) -> str:
    began = time.process_time()
    sheet = mf.fit(name, **options)
    seconds = time.process_time() - began
    if sheet.pattern is None or sheet.measurements is None or sheet.score is None:
        return f"| {name} | {sheet.status}: {sheet.advice} |"
    pattern, m = sheet.pattern, sheet.measurements
    corners = pattern.folded_coords[pattern.faces_vertices]
    ahead, behind = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    sectors = np.degrees(angle_between(ahead, behind))
    bad = 100 * float(((sectors < 45 - 0.1) | (sectors > 135 + 0.1)).mean())
    normals = facet_normals(pattern.folded_coords, pattern.faces_vertices)
    inner = pattern.edges_faces[(pattern.edges_faces >= 0).all(axis=1)]
    folds = np.degrees(angle_between(normals[inner[:, 0]], normals[inner[:, 1]]))
    diagonal = float(np.linalg.norm(np.ptp(pattern.folded_coords, axis=0)))
    pieces = 1 if pattern.pieces is None else int(pattern.pieces.max()) + 1
    worst = max(m.max_planarity, m.max_developability, m.max_isometry)
    return (
        f"| {name} | {m.facets} | {pieces} | {100 * m.hausdorff_midsurface_mm / diagonal:.2f} "
        f"| {sectors.min():.0f}-{sectors.max():.0f} | {bad:.0f} "
        f"| {folds.min():.0f}-{folds.max():.0f} | {sheet.score.rim:.2f} | {m.area_ratio:.1f} "
        f"| {m.self_intersections} | {sheet.score.bow_ties} | {worst:.0e} | {seconds:.1f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--round", action="store_true", help="surfaces all round an axis")
    parser.add_argument("--polish", default="on", choices=("on", "off"))
    parser.add_argument("names", nargs="*", help="only these surfaces")
    asked = parser.parse_args()
    print(
        "| surface | facets | pieces | middle % | sectors | outside 45-135 % | folds | rim % "
        "| paper | crossings | bow-ties | residual | CPU s |"
    )
    print("|" + "---|" * 13)
    if asked.round:
        for name, parameters, facets, pieces in ROUND:
            if asked.names and name not in asked.names:
                continue
            print(line(name, facets=facets, pieces=pieces, angle=360, close="seam", **parameters))
        return
    for name in asked.names or NAMED:
        print(line(name, facets="20x20", polish=asked.polish), flush=True)


if __name__ == "__main__":
    main()
