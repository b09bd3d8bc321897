"""Fit every design of the gallery and print what each is worth: one line a design, and the time.

    python benchmarks/gallery.py [PATTERNS] [--facets COLUMNSxROWS] [--out DIR]

Exits 1 if a design does not converge with every residual at most 1e-12, crosses itself, overlaps
when flat, or has a shorter edge than it asks for.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from miurafab.origami.fitting.fit import fit
from miurafab.workflow.design import design

RESIDUAL = 1e-12


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("patterns", nargs="?", type=Path, default=Path("patterns"))
    parser.add_argument("--facets", default="28x28", help="facets of every design [28x28]")
    parser.add_argument("--out", type=Path, help="also write the FOLD files to this directory")
    options = parser.parse_args()
    print(
        f"{'design':<14} {'status':<11} {'facets':>6} {'planar':>8} {'develop':>8} {'isometry':>8} "
        f"{'flatfold':>8} {'min edge':>8} {'mid dev':>8} {'cross':>5} {'over':>4} {'tries':>5} "
        f"{'seconds':>7}"
    )
    failed = []
    started = time.perf_counter()
    for path in sorted(options.patterns.glob("*.toml")):
        wanted = design(str(path), facets=options.facets)
        result = fit(wanted.request)
        m = result.measurements
        if m is None or result.pattern is None:
            print(f"{path.stem:<14} {result.status:<11} {result.advice}")
            failed.append(path.stem)
            continue
        worst = max(m.max_planarity or 0, m.max_developability or 0, m.max_isometry or 0)
        print(
            f"{path.stem:<14} {result.status:<11} {m.facets:>6} {m.max_planarity:>8.0e} "
            f"{m.max_developability:>8.0e} {m.max_isometry:>8.0e} {m.max_flat_foldability:>8.0e} "
            f"{m.min_edge_mm:>8.2f} {m.hausdorff_midsurface_mm:>8.2f} {m.self_intersections:>5} "
            f"{m.overlaps:>4} {len(result.attempts):>5} {result.seconds:>7.2f}"
        )
        if result.status != "converged" or worst > RESIDUAL:
            failed.append(path.stem)
        if options.out is not None:
            options.out.mkdir(parents=True, exist_ok=True)
            result.pattern.save(options.out / f"{path.stem}.fold", title=wanted.title)
    print(f"{time.perf_counter() - started:.1f} s together")
    if failed:
        print(f"not as asked: {', '.join(failed)}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
