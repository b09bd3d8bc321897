"""How long the energy path takes, and how that grows with the sheet.

    python benchmarks/energy.py [10 20 30 ...] [--steps 40] [--surface hypar] [--json FILE]

A size n is n x n Miura cells, that is 4 n^2 facets. Each sheet is fitted for developability alone,
which does not fold rigidly, and unfolded from its folded form to nearly flat, with barrier and
stiffness; the fit is not part of the time, which is processor time. The columns "factors" and
"steps" count the factorisations of the matrix K and the solutions with it. The last line is the
exponent p of time ~ facets^p over all sizes.
"""

from __future__ import annotations

import argparse
import json
import resource
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from miurafab.origami.energy.curve import energy_curve
from miurafab.origami.energy.equilibrium import Balance
from miurafab.origami.fitting.fit import FitRequest, fit
from miurafab.surfaces.catalogue import make_surface

SIZES = (5, 10, 20, 30, 45, 60)


@contextmanager
def counted(*names: str) -> Iterator[Counter[str]]:
    """How often the methods of ``Balance`` of these ``names`` are called meanwhile."""
    calls: Counter[str] = Counter()
    kept = {name: getattr(Balance, name) for name in names}

    def counting(name: str) -> Callable[..., object]:
        def call(*given: object, **named: object) -> object:
            calls[name] += 1
            return kept[name](*given, **named)

        return call

    for name in names:
        setattr(Balance, name, counting(name))
    try:
        yield calls
    finally:
        for name in names:
            setattr(Balance, name, kept[name])


def measure(surface: str, cells: int, steps: int) -> dict[str, float | int | bool]:
    """One sheet of ``cells`` x ``cells``: times in seconds, and what was found."""
    request = FitRequest(
        surface=make_surface(surface, {})[0], facets=(2 * cells, 2 * cells), size_mm=200.0
    )
    pattern = fit(request).pattern
    if pattern is None:
        raise SystemExit(f"{surface} cannot be fitted with {2 * cells}x{2 * cells} facets.")
    with counted("factor", "step") as calls:
        started = time.process_time()
        curve = energy_curve(pattern, steps)
        seconds = time.process_time() - started
    return {
        "cells": cells,
        "facets": 4 * cells**2,
        "seconds": seconds,
        "factors": calls["factor"],
        "steps": calls["step"],
        "converged": curve.path.converged,
        "barrier": curve.barrier,
        "megabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cells", nargs="*", type=int, default=SIZES)
    parser.add_argument("--steps", type=int, default=40)
    parser.add_argument("--surface", default="hypar")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = []
    print(f"{options.surface}, {options.steps} steps")
    print("  cells  facets        s  factors  steps         barrier  peak MB")
    for cells in options.cells:
        row = measure(options.surface, cells, options.steps)
        rows.append(row)
        print(
            f"{cells:4d}x{cells:<3d}{row['facets']:7d}{row['seconds']:9.2f}"
            f"{row['factors']:9d}{row['steps']:7d}{row['barrier']:16.6e}{row['megabytes']:9.0f}"
            + ("" if row["converged"] else "  lost"),
            flush=True,
        )
    if len(rows) > 1:
        facets, seconds = ([float(row[key]) for row in rows] for key in ("facets", "seconds"))
        print(f"time ~ facets^{np.polyfit(np.log(facets), np.log(seconds), 1)[0]:.2f}")
    if options.json:
        options.json.write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
