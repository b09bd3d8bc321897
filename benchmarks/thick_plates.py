"""Plates of one thickness on shifted hinges, on eight exactly flat-foldable sheets.

    python benchmarks/thick_plates.py [--cells 6] [--thickness 4] [TARGET ...]

Prints for each sheet the pieces, the heights that are free in each, the largest loop gap at ten
states of random heights that close, and of the heights that are made, in mean edges, the thickness
over the range of heights of a whole piece, and what is made: patches, edges that are slit or open,
the most that an axis is above another, in thicknesses, brackets, and the fold angle up to which no
solids collide. Exits 1 if a gap is over 1e-11, or if the free heights are not two less than the
columns and rows of facets.
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
from miurafab.origami.folding.slits import facet_cells
from miurafab.origami.piece import pieces_of
from miurafab.surfaces.catalogue import make_surface

TARGETS = ("plane", "hypar", "saddle", "sphere", "bump", "paraboloid", "helicoid", "cylinder")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("targets", nargs="*", default=TARGETS)
    parser.add_argument("--cells", type=int, default=6)
    parser.add_argument("--thickness", type=float, default=4.0)
    options = parser.parse_args()
    print(
        f"{'target':<11} {'pieces':>6} {'free':>4} {'loop gap':>8} {'made':>8} {'t/range':>7} "
        f"{'patches':>7} {'slit':>4} {'range':>5} {'brackets':>8} {'clear deg':>9} {'seconds':>7}"
    )
    failed = False
    facets = (options.cells, options.cells)
    states = np.geomspace(0.1, 10.0, 10)
    for name in options.targets:
        surface, _ = make_surface(name, {})
        request = FitRequest(surface=surface, facets=facets, size_mm=400.0, flat_foldable=0.0)
        pattern = fit(request).pattern
        if pattern is None:
            print(f"{name:<11} no sheet")
            failed = True
            continue
        gap, least, free = 0.0, np.inf, []
        pieces = [piece.pattern for piece in pieces_of(pattern)]
        for piece in pieces:
            heights = bennett_heights(piece)
            wished = np.random.default_rng(1).uniform(-1, 1, len(piece.edges_vertices))
            closing = nearest_heights(piece, wished)
            gap = max(gap, float(thick_loop_gap(piece, closing, states).max()))
            least, cells = min(least, heights.thickness / 2), facet_cells(piece)
            assert cells is not None
            free.append(heights.free)
            failed |= heights.free != int(np.ptp(cells, axis=0).sum())
        start = time.process_time()
        try:
            plates = thick_plates(pattern, options.thickness)
        except PatternError:
            plates = None
        seconds = time.process_time() - start
        kinds = ",".join(sorted({str(count) for count in free}))
        row = f"{name:<11} {len(pieces):>6} {kinds:>4} {gap:>8.1e}"
        failed |= gap > 1e-11
        if plates is None:
            print(f"{row} {'':>8} {least:>7.4f} {'none':>7}", flush=True)
            continue
        made = max(
            float(thick_loop_gap(patch.pattern, patch.axis_mm, states).max())
            for patch in plates.patches
        )
        failed |= made > 1e-11
        print(
            f"{row} {made:>8.1e} {least:>7.4f} {len(plates.patches):>7} "
            f"{sum(len(seam.slits) for seam in plates.seams):>4} "
            f"{max(patch.range_mm for patch in plates.patches) / options.thickness:>5.1f} "
            f"{sum(len(patch.brackets) for patch in plates.patches):>8} "
            f"{min(patch.clear_deg for patch in plates.patches):>9.1f} {seconds:>7.2f}",
            flush=True,
        )
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
