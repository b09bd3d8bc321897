"""Exact flat-foldability: fit each target with Kawasaki's condition, and move the sheet as one.

    python benchmarks/flat_foldable.py [--facets 2500] [--states 50] [TARGET ...]

Prints for each target the Kawasaki residual, the distance of the mid-surface with and without the
condition, and the largest mismatch, in mean edges, with which the facets meet round any vertex at
any state of the closed-form motion. Exits 1 if a residual is over 1e-10 or a mismatch over 1e-9.
"""

from __future__ import annotations

import argparse
import math
import sys
import time

from miurafab.origami.fitting.fit import FitRequest, fit
from miurafab.origami.folding.kinematics import rigid_motion, states_between
from miurafab.surfaces.catalogue import make_surface

TARGETS = ("hypar", "saddle", "sphere", "catenoid", "paraboloid", "cylinder", "log-spiral")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("targets", nargs="*", default=TARGETS)
    parser.add_argument("--facets", type=int, default=2500)
    parser.add_argument("--states", type=int, default=50)
    options = parser.parse_args()
    side = round(math.sqrt(options.facets))
    print(
        f"{'target':<12} {'facets':>6} {'kawasaki':>9} {'mismatch':>9} {'mid dev':>8} "
        f"{'without':>8} {'cross':>5} {'seconds':>8}"
    )
    failed = False
    for name in options.targets:
        surface, _ = make_surface(name, {})
        request = FitRequest(surface=surface, facets=(side, side), size_mm=200.0, flat_foldable=0.0)
        started = time.process_time()
        result = fit(request)
        seconds = time.process_time() - started
        without = fit(FitRequest(surface=surface, facets=(side, side), size_mm=200.0)).measurements
        m = result.measurements
        if m is None or without is None or result.pattern is None:
            print(f"{name:<12} {result.advice}")
            failed = True
            continue
        motion = rigid_motion(result.pattern, states_between(result.pattern, options.states - 1))
        mismatch = math.inf if motion.mismatch is None else float(motion.mismatch.max())
        print(
            f"{name:<12} {m.facets:>6} {m.max_flat_foldability:>9.1e} {mismatch:>9.1e} "
            f"{m.hausdorff_midsurface_mm:>8.3f} {without.hausdorff_midsurface_mm:>8.3f} "
            f"{m.self_intersections:>5} {seconds:>8.2f}",
            flush=True,
        )
        failed |= not (m.max_flat_foldability or 0) <= 1e-10 or mismatch > 1e-9
        failed |= result.status != "converged"
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
