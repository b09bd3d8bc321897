"""Plates of one thickness on shifted hinges, on eight exactly flat-foldable sheets.

    python benchmarks/thick_plates.py [--cells 6] [--thickness 4] [TARGET ...]

Prints for each sheet the heights that are free, the largest loop gap at ten states of random
heights that close, in mean edges, the thickness over the range of heights, and what is made of it:
patches, the most that an axis is above another, in thicknesses, brackets, and the fold angle up to
which no solids collide. Exits 1 if a gap is over 1e-11, or if the free heights are not two
less than the columns and rows of facets.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np

from miurafab.errors import PatternError
from miurafab.origami.fitting.fit import FitRequest, fit
from miurafab.origami.folding.bennett import bennett_heights, nearest_heights, thick_loop_gap
from miurafab.origami.folding.plates import thick_plates
from miurafab.surfaces.catalogue import make_surface

TARGETS = ("plane", "hypar", "saddle", "sphere", "bump", "paraboloid", "helicoid", "cylinder")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("targets", nargs="*", default=TARGETS)
    parser.add_argument("--cells", type=int, default=6)
    parser.add_argument("--thickness", type=float, default=4.0)
    options = parser.parse_args()
    print(
        f"{'target':<12} {'free':>5} {'loop gap':>9} {'thickness/range':>15} {'patches':>7} "
        f"{'range':>6} {'brackets':>8} {'clear deg':>9} {'seconds':>8}"
    )
    failed = False
    facets = (options.cells, options.cells)
    for name in options.targets:
        surface, _ = make_surface(name, {})
        request = FitRequest(surface=surface, facets=facets, size_mm=400.0, flat_foldable=0.0)
        pattern = fit(request).pattern
        if pattern is None:
            print(f"{name:<12} no sheet")
            failed = True
            continue
        heights = bennett_heights(pattern)
        wished = np.random.default_rng(1).uniform(-1, 1, len(pattern.edges_vertices))
        states = np.geomspace(0.1, 10.0, 10)
        gap = float(thick_loop_gap(pattern, nearest_heights(pattern, wished), states).max())
        assert pattern.grid is not None
        failed |= gap > 1e-11 or heights.free != sum(pattern.grid) - 4
        start = time.process_time()
        try:
            patches = thick_plates(pattern, options.thickness).patches
            made = (
                f"{len(patches):>7} "
                f"{max(patch.range_mm for patch in patches) / options.thickness:>6.1f} "
                f"{sum(len(patch.brackets) for patch in patches):>8} "
                f"{min(patch.clear_deg for patch in patches):>9.1f}"
            )
        except PatternError:
            made = f"{'none':>7} {'':>6} {'':>8} {'':>9}"
        seconds = time.process_time() - start
        print(
            f"{name:<12} {heights.free:>5} {gap:>9.1e} {heights.thickness / 2:>15.4f} {made} "
            f"{seconds:>8.2f}",
            flush=True,
        )
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
