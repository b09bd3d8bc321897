"""The table of docs/fit.md: which barriers are asked for, and which come.

    python benchmarks/barrier_reach.py [docs/fit.md]

Each barrier is measured again on the sheet that comes, with another number of steps. Everything is
computed afresh, and the same every time.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from page_tables import Rows, markdown, write_tables

from miurafab.origami.energy import tuning
from miurafab.origami.energy.curve import energy_curve
from miurafab.origami.fitting.fit import fit
from miurafab.origami.fitting.result import FitResult
from miurafab.workflow.design import design

ASKED = {"hypar": (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1.0), "sphere": (1e-6, 1e-4, 1e-2)}
STEPS = 31


def reached(target: str, asked: float, limits: tuple[float, ...] = tuning.LIMITS) -> FitResult:
    """The sheet with the barrier ``asked``, tuned with these limits on the residual."""
    request = design(target, facets=(6, 6), size=120, barrier=asked).request
    kept, tuning.LIMITS = tuning.LIMITS, limits
    try:
        return fit(request)
    finally:
        tuning.LIMITS = kept


def row(target: str, asked: float) -> tuple[str, ...]:
    """What comes for one barrier, with and without the limits."""
    found, without = reached(target, asked), reached(target, asked, ())
    pattern, residual = found.pattern, found.measurements.max_flat_foldability
    assert pattern is not None
    assert residual is not None
    far = [
        "-" if each.status != "converged" else f"{each.deviation_mm:.2f}"
        for each in (found, without)
    ]
    got = energy_curve(pattern, STEPS).barrier
    return target, f"{asked:g}", found.status, f"{got:.3g}", f"{residual:.2g}", *far


def reach() -> tuple[tuple[str, ...], Rows]:
    """All barriers of all targets."""
    head = (
        "target",
        "asked (k_f L)",
        "status",
        "measured (k_f L)",
        "worst residual",
        "distance (mm)",
        "without eps_ff",
    )
    return head, [row(target, asked) for target, all_of in ASKED.items() for asked in all_of]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("page", nargs="?", type=Path, help="The page to write the table into.")
    options = parser.parse_args()
    write_tables(options.page, "barrier_reach", {"reach": markdown(*reach())})


if __name__ == "__main__":
    main()
